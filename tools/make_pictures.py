#!/usr/bin/env python3
"""Makes the pictures of the documentation that a browser draws, in docs/: throws.webp, report.png
and those of the live page.

    source tools/env.sh && python3 tools/make_pictures.py              # or some of them: view_darts view_by_mouse

Needs a Chromium on PATH, or named by $CHROMIUM, and takes some minutes: the arm learns and
practises for them.
"""

import argparse
import functools
import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from dart_skill_nodes.process.environment import choose_domain  # noqa: E402
from dart_skill_nodes.process.graph_processes import Graph  # noqa: E402

choose_domain()

import numpy as np  # noqa: E402
import rclpy  # noqa: E402  the domain must be chosen before rclpy starts
from PIL import Image, ImageDraw, ImageFont  # noqa: E402

from dart_skill.common import palette  # noqa: E402
from dart_skill.common.regions import REGION  # noqa: E402
from dart_skill.common.situation import Situation  # noqa: E402
from dart_skill.report import play, read_run  # noqa: E402
from dart_skill.skills.protocol import load_skill  # noqa: E402
from dart_skill.view import Scene, open_server  # noqa: E402
from dart_skill_nodes.client.graph_client import GraphClient  # noqa: E402
from tests.integration.browser import Page  # noqa: E402
from tests.screen_person import PageHands, ScreenPerson  # noqa: E402
from tests.view_client import PageClient  # noqa: E402

DOCS = ROOT / "docs"
FILM = (560, 400)  # pixels
FRAME = 0.04  # between two pictures of the film [s]
FILMED = 3  # throws, the first three of bags/throws
MEANING = (
    ("guided by a person", palette.DEMONSTRATION),
    ("learned from it", palette.GAUSSIAN),
    ("the ball", palette.BALL),
    ("a basket that nobody showed", palette.BASKET),
)
"""What the colours of the film mean."""
EYE, LOOK_AT = (1.0, -3.7, 1.7), (0.85, 0.0, 1.0)
LIVE = (1280, 880)
"""Of the live page [pixels]: as much as its panel needs."""
CLOSE_NOTES = """(() => {
  const within = document.querySelector('iframe')?.contentDocument ?? document;
  within.querySelectorAll('button[class*=Notification]').forEach(button => button.click());
})()"""

TO_THE_TOP = (
    "document.querySelectorAll('.mantine-ScrollArea-viewport').forEach(part => part.scrollTop = 0)"
)


class Film:
    """Takes the place of a timeline: a picture of the page for each moment that stands, with what
    its colours mean below, and what was told last above.
    """

    def __init__(self, client):
        self._client, self.pictures, self.milliseconds = client, [], []
        self._told = ""

    def tell(self, text: str) -> None:
        """Words that stand above the pictures from now on."""
        self._told = text

    def insert_sleep(self, seconds: float) -> None:
        """Take a picture that stands so long."""
        width, height = FILM
        pixels = Image.fromarray(
            self._client.get_render(2 * height, 2 * width, transport_format="png")
        )
        page = Image.alpha_composite(Image.new("RGBA", pixels.size, "white"), pixels)
        picture = page.convert("RGB").resize(FILM, Image.Resampling.LANCZOS)
        self._write(ImageDraw.Draw(picture))
        self.pictures.append(picture)
        self.milliseconds.append(round(1e3 * seconds))

    def _write(self, draw: ImageDraw.ImageDraw) -> None:
        draw.text((12, 8), self._told, "black", ImageFont.load_default(18))
        at, font = 12.0, ImageFont.load_default(13)
        for word, colour in MEANING:
            draw.text((at, FILM[1] - 22), word, palette.hexadecimal(colour), font)
            at += draw.textlength(word, font) + 14

    def save(self, path: Path) -> None:
        """As an animated WebP that goes on for ever."""
        self.pictures[0].save(
            path,
            save_all=True,
            append_images=self.pictures[1:],
            duration=self.milliseconds,
            loop=0,
            quality=60,
            method=6,
        )


def film_throws(folder: Path) -> Path:
    """Throws that the arm made by itself, recorded in bags/throws."""
    run = read_run(ROOT / "bags" / "throws")
    server = open_server()
    scene = Scene(server)
    server.initial_camera.position, server.initial_camera.look_at = EYE, LOOK_AT
    scene.show_demonstrations(run.shown)
    with Page(folder, f"http://127.0.0.1:{server.get_port()}", few_frames=False):
        client = _wait(lambda: next(iter(server.get_clients().values()), None), "the page")
        _wait(lambda: np.allclose(client.camera.position, EYE, atol=1e-3), "the first look")
        film = Film(client)
        for throw in run.own[:FILMED]:
            play(scene, film, run, throw, FRAME, film.tell)
    server.stop()
    film.save(DOCS / "throws.webp")
    return DOCS / "throws.webp"


@contextmanager
def _live_graph(folder: Path, skill: str = "") -> Iterator[tuple[GraphClient, str]]:
    """A client of the simulated graph of a skill, and the address of its live page."""
    rclpy.init()
    with Graph(folder / "logs") as graph:
        client = GraphClient(graph.dead)
        graph.start_all("composed", 0, folder / "bag", skill=skill)
        client.wait_until_ready()
        graph.start("viewer", {"port": 0} | ({"skill": skill} if skill else {}))
        log = folder / "logs" / "viewer.log"
        yield (
            client,
            _wait(
                lambda: re.search(r"live view is at (\S+)", log.read_text()),
                "the viewer",
                client.spin,
            ).group(1),
        )
        client.close()
    rclpy.try_shutdown()


def _press(page: PageClient, client: GraphClient, button: str, said: str) -> None:
    """A button of the live page, as soon as it can be pressed, until the page says so and can be
    asked again.
    """
    page.wait_for(
        lambda: not page.is_disabled(button), 60.0, f"the button '{button}'", client.spin
    )
    page.click(button)
    page.wait_for(
        lambda: page.says(said) and not page.is_disabled(button),
        900.0,
        f"'{said}' after {button}",
        client.spin,
    )


def _picture(
    folder: Path,
    url: str,
    meanwhile: Callable[[], None],
    path: Path,
    arrange: Callable[[], None] = lambda: None,
) -> Path:
    """The live page in a browser, once it stands still. It comes last, as one that looks on takes
    a core of its own.

    meanwhile: called again and again, for who else must be heard.
    arrange: called when the page is there.
    """
    with Page(folder, url, LIVE, few_frames=False) as page:
        _wait(lambda: page.button("Stop"), "the page", meanwhile)
        arrange()
        page.settle(meanwhile=meanwhile)
        page.run(CLOSE_NOTES)
        page.run(TO_THE_TOP)
        page.settle(meanwhile=meanwhile)
        Image.fromarray(page.screenshot()).save(path, optimize=True)
    return path


def show_view(folder: Path) -> Path:
    """The live view after thirteen demonstrations and ten own throws."""
    with _live_graph(folder) as (client, url):
        for target in REGION.spread(13, np.random.default_rng([0, 1])):
            client.teach(target)
        client.learn()
        # after the lessons, as a page that does not listen is closed
        with PageClient(url, origin=url) as page:
            _press(page, client, "Practise", "throws made")
            _press(page, client, "Throw", "from the middle")
        return _picture(folder, url, client.spin, DOCS / "view.png")


def show_skill(name: str, folder: Path) -> Path:
    """The live view of another skill that was taught, learned, practised and tried once more, with
    the buttons of the page.
    """
    do, trials = ("Throw", "throws") if name == "darts" else ("Execute", "trials")
    with _live_graph(folder, name) as (client, url), PageClient(url, origin=url) as page:
        _press(page, client, "Teach", "demonstrations shown")
        _press(page, client, "Learn", f"Next: press {do}")
        _press(page, client, "Practise", f"{trials} made")
        _press(page, client, do, "mm off")
        return _picture(folder, url, client.spin, DOCS / f"view_{name}.png")


def show_by_mouse(folder: Path) -> Path:
    """A lesson on the page: the part was pulled over its holder, as the page looks at it from the
    side.
    """
    with _live_graph(folder, "place") as (client, url), PageClient(url, origin=url) as page:

        def until(found, what: str) -> None:
            page.wait_for(found, 120.0, what, client.spin)

        person = ScreenPerson(
            client, ("hand", "part", "holder"), PageHands(page), meanwhile=page.listen
        )
        until(lambda: not page.is_disabled("Take the hand"), "the button")
        page.click("Take the hand")
        until(lambda: page.says("beside its place"), "a hand that is held")
        person.look(until)
        person.carry(load_skill("place").goal(Situation({"holder": person.seen["holder"]})))

        def look_from_the_side() -> None:
            for _ in range(2):  # from above is first
                looks = page.looks
                page.click("From above, or the side (V)")
                until(lambda looks=looks: page.looks > looks, "another look")

        def hear_both() -> None:
            client.spin()
            page.listen()

        return _picture(folder, url, hear_both, DOCS / "view_by_mouse.png", look_from_the_side)


def show_report(folder: Path) -> Path:
    """The page of twenty own throws; the base is turned after five."""
    practice = [
        "practice",
        "--change",
        "base_turned",
        "--output",
        str(folder / "practice"),
        "--json",
    ]
    said = subprocess.run(
        [sys.executable, "-m", "dart_skill.cli", *practice],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    assert json.loads(said)
    with Page(folder, (folder / "practice" / "report.html").as_uri(), few_frames=False) as page:
        page.call(
            "Emulation.setDeviceMetricsOverride",
            width=1050,
            height=1430,
            deviceScaleFactor=0.8,
            mobile=False,
        )
        _wait(lambda: "What was run" in page.text(), "the page")
        time.sleep(10.0)  # the replay has no word for having begun
        page.run(CLOSE_NOTES)
        time.sleep(5.0)
        page.screenshot(DOCS / "report.png")
    return DOCS / "report.png"


def _wait(found, what: str, meanwhile=lambda: time.sleep(0.1), limit: float = 300.0):
    until = time.monotonic() + limit
    while not (result := found()):
        if time.monotonic() > until:
            sys.exit(f"{what} did not come in {limit:.0f} s")
        meanwhile()
    return result


SKILLS = {
    f"view_{name}": functools.partial(show_skill, name) for name in ("darts", "place", "reach")
}
MAKERS = {
    "throws": film_throws,
    "report": show_report,
    "view": show_view,
    **SKILLS,
    "view_by_mouse": show_by_mouse,
}


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "pictures", nargs="*", metavar="PICTURE", help=f"any of {', '.join(MAKERS)} (default: all)"
    )
    options = parser.parse_args()
    if unknown := set(options.pictures) - set(MAKERS):
        parser.error(f"no picture {sorted(unknown)}, only {sorted(MAKERS)}")
    for name in options.pictures or MAKERS:
        with tempfile.TemporaryDirectory() as folder:
            path = MAKERS[name](Path(folder))
        print(f"{path} {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
