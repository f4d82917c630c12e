"""A headless Chromium for tests, driven through the DevTools protocol over the websockets package
that viser brings.
"""

import base64
import functools
import io
import json
import os
import shutil
import subprocess
import tempfile
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from dart_skill.view import FIELD_OF_VIEW

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
OPTIONS = (
    "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--disable-quic",
    "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage",
    "--hide-scrollbars", "--force-device-scale-factor=1", "--remote-debugging-port=0", "--no-proxy-server",
    "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
)  # fmt: skip
"""No name is looked up: whatever a page asks for outside this machine is listed, and fails."""
SIZE, SMALL = (1280, 800), (1120, 560)
"""Of a page [pixels]. Without a graphics card a large one takes several seconds of a core for a
second of movement. The panel takes 320 of the width: what is beside the middle must not be under
it.
"""
FEW_FRAMES = """(() => {
  const frame = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (draw) => setTimeout(() => frame(draw), 100);
  window.cancelAnimationFrame = (timer) => clearTimeout(timer);
})()"""
"""A page draws ten times in a second at most: without a graphics card each picture takes a tenth
of a second of a core.
"""
STILL = 2e-3
"""Share of pixels that may differ between two pictures of a page that stands still."""
CORRECTIONS = 6
"""Of the end of a drag at most."""
SHIFT = 8
"""The key, as DevTools numbers it."""


@functools.lru_cache(maxsize=1)
def find_chromium():
    """Path of a Chromium on this machine, named by $CHROMIUM or found on PATH; None if there is
    none.
    """
    return os.environ.get("CHROMIUM") or next(
        (path for name in NAMES if (path := shutil.which(name)) and _runs(path)), None
    )


def _runs(path):
    """Whether it is a browser; on Ubuntu the command may be there only to say that a snap is
    wanted.
    """
    return subprocess.run([path, "--version"], capture_output=True).returncode == 0


needs_chromium = pytest.mark.skipif(
    find_chromium() is None,
    reason=(
        "no Chromium: `apt-get install chromium` as root on Debian, or name another one in"
        " $CHROMIUM"
    ),
)


def project(points, eye, look_at, size=SIZE, field_of_view=FIELD_OF_VIEW):
    """Points of the world (n, 3) as pixels (n, 2) of a page of a size that looks from one place to
    another, upright.
    """
    forward = (look_at - eye) / np.linalg.norm(look_at - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    away = np.atleast_2d(points) - eye
    scale = size[1] / 2 / np.tan(field_of_view / 2) / (away @ forward)
    return np.column_stack(
        [
            size[0] / 2 + scale * (away @ right),
            size[1] / 2 - scale * (away @ np.cross(right, forward)),
        ]
    )


def _differ(one, other):
    """Whether two pictures show something else: a line of text, or a path that goes on, does not
    count.
    """
    return (np.abs(one.astype(int) - other).max(axis=2) > 0).mean() > STILL


class Page:
    """One page of a browser of its own; a context manager that leaves no process behind."""

    def __init__(self, folder, url, size=SIZE, few_frames=True):
        from websockets.sync.client import connect

        self._folder, self._number = Path(folder), 0
        self._profile = tempfile.TemporaryDirectory(prefix="chromium-", ignore_cleanup_errors=True)
        self.exceptions, self.addresses = [], []
        self._folder.mkdir(parents=True, exist_ok=True)
        self._log = open(self._folder / "chromium.txt", "wb")
        command = [
            find_chromium(),
            *OPTIONS,
            f"--user-data-dir={self._profile.name}",
            "--window-size={},{}".format(*size),
            "about:blank",
        ]
        self._process = subprocess.Popen(
            command, stdout=self._log, stderr=self._log, start_new_session=True
        )
        try:
            # A film is made without a word to this socket for minutes.
            self._socket = connect(
                self._address(), max_size=None, open_timeout=30, ping_interval=None
            )
            for domain in ("Page", "Runtime", "Network"):
                self.call(f"{domain}.enable")
            width, height = self.size = size
            self.call(
                "Emulation.setDeviceMetricsOverride",
                width=width,
                height=height,
                deviceScaleFactor=1,
                mobile=False,
            )
            if few_frames:
                self.call("Page.addScriptToEvaluateOnNewDocument", source=FEW_FRAMES)
            self.call("Page.navigate", url=url)
        except BaseException:
            self.close()
            raise

    def _address(self):
        """Of the page's own DevTools socket."""
        port_file = Path(self._profile.name) / "DevToolsActivePort"
        self._wait(
            lambda: port_file.is_file() and len(port_file.read_text().splitlines()) == 2,
            60.0,
            "Chromium's port",
        )
        port = port_file.read_text().splitlines()[0]

        def pages():
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json", timeout=30) as answer:
                return [page for page in json.load(answer) if page["type"] == "page"]

        self._wait(pages, 30.0, "a page")
        return pages()[0]["webSocketDebuggerUrl"]

    def _wait(self, condition, limit, what, meanwhile=lambda: None):
        until = time.monotonic() + limit
        while not condition():
            meanwhile()
            assert self._process.poll() is None, (
                "Chromium"
                f" ended:\n{(self._folder / 'chromium.txt').read_text(errors='replace')[-2000:]}"
            )
            assert time.monotonic() < until, f"{what} did not come in {limit:.0f} s"
            time.sleep(0.05)

    def call(self, method, **parameters):
        """Result of a DevTools command; errors of the page's program, and what it fetches
        meanwhile, are kept.
        """
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._socket.recv(timeout=120))
            if answer.get("id") == self._number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]
            self._note(answer)

    def _note(self, event):
        if event["method"] == "Runtime.exceptionThrown":
            self.exceptions.append(json.dumps(event["params"]["exceptionDetails"])[:1000])
        elif event["method"] == "Network.requestWillBeSent":
            self.addresses.append(event["params"]["request"]["url"])

    def run(self, script):
        """Value of a JavaScript expression."""
        result = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def text(self):
        """All text of the page."""
        return self.run("document.body ? document.body.innerText : ''")

    def button(self, label):
        """Middle of the button with this label, in pixels, scrolled into view; None while there is
        none, or while it cannot be clicked.
        """
        return self.run(
            "(() => {const b = [...document.querySelectorAll('button')].find(b =>"
            " b.innerText.trim() === "
            + json.dumps(label)
            + ");if (!b || b.disabled) return null; b.scrollIntoView({block: 'center'});const r ="
            " b.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2];})()"
        )

    def mouse(self, kind, place, buttons=0, shift=False):
        """A mouse event: "mouseMoved", "mousePressed" or "mouseReleased" at a place in pixels."""
        pressed = {"button": "left", "clickCount": 1} if kind != "mouseMoved" else {}
        held = {"buttons": buttons, "modifiers": SHIFT if shift else 0}
        self.call(
            "Input.dispatchMouseEvent",
            type=kind,
            x=float(place[0]),
            y=float(place[1]),
            **held,
            **pressed,
        )

    def draw(self, pictures):
        """Wait until the page has drawn so many pictures."""
        for _ in range(pictures):
            self.run("new Promise(resolve => requestAnimationFrame(resolve))")

    def cursor(self, place):
        """How the page shows the mouse at a place in pixels."""
        return self.run(
            f"getComputedStyle(document.elementFromPoint({float(place[0])},"
            f" {float(place[1])})).cursor"
        )

    def key(self, key):
        """A key is pressed and let go: a letter, or "Enter"."""
        code, number = (key, 13) if key == "Enter" else (f"Key{key.upper()}", ord(key.upper()))
        for kind in ("keyDown", "keyUp"):
            self.call(
                "Input.dispatchKeyEvent",
                type=kind,
                key=key,
                code=code,
                windowsVirtualKeyCode=number,
            )

    def click(self, label):
        """A click with the mouse on the button with this label."""
        place = self.button(label)
        assert place, f"no button '{label}' that can be clicked, in:\n{self.text()}"
        self.mouse("mouseMoved", place)
        self.mouse("mousePressed", place, 1)
        self.mouse("mouseReleased", place)

    def drag(self, start, end, steps=8, shift=False, correct=lambda end: None):
        """Hold the mouse from one place to another, in pixels; shift: with that key; correct:
        gives a better end, or None to let go.
        """

        def seen():
            """The page sees with a picture what is under the mouse, and shows it by the cursor;
            else it would turn its view.
            """
            self.mouse("mouseMoved", start, shift=shift)
            self.draw(3)
            return self.cursor(start) == "pointer"

        self._wait(seen, 60.0, "a cursor that shows that something can be dragged")
        self.mouse("mousePressed", start, 1, shift)
        self.draw(1)
        for share in np.linspace(0.0, 1.0, steps + 1):
            self.mouse("mouseMoved", np.add(start, share * np.subtract(end, start)), 1, shift)
            time.sleep(0.05)
        for _ in range(CORRECTIONS):
            if (better := correct(end)) is None:
                break
            end = better
            self.mouse("mouseMoved", end, 1, shift)
        self.mouse("mouseReleased", end, shift=shift)

    def settle(self, meanwhile=lambda: None):
        """Wait until the page looks the same twice; meanwhile: called again and again."""
        pictures = [self.screenshot()]

        def still():
            pictures.append(self.screenshot())
            return not _differ(*pictures[-2:])

        self._wait(still, 120.0, "a page that stands still", meanwhile)

    def screenshot(self, path=None):
        """The page as pixels (height, width, 3); also written to a file if a path is given."""
        from PIL import Image

        data = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        if path is not None:
            Path(path).write_bytes(data)
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))

    def close(self):
        """End the browser and everything that it started."""
        if hasattr(self, "_socket"):
            try:
                self.call("Browser.close")
            except Exception:  # it may be gone already
                pass
            self._socket.close()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            os.killpg(self._process.pid, 9)
            self._process.wait()
        self._log.close()
        self._profile.cleanup()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
