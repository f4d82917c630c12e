"""The page of a bag as the command writes it. In a real browser, from a file: the replay plays,
and no request leaves the page.
"""

import shutil
import subprocess

import numpy as np
import pytest

from tests.integration.browser import Page, needs_chromium
from tests.paths import BAGS

ARM, BALL, BASKET = np.array([200, 200, 205]), np.array([213, 94, 0]), np.array([0, 114, 178])


def near(pixels, colour, within=45):
    """How many pixels have about a colour."""
    return int((np.abs(pixels.astype(int) - colour).max(axis=2) < within).sum())


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """What the command said, and the page that it wrote beside the bag."""
    bag = tmp_path_factory.mktemp("bags") / "throws with space"
    shutil.copytree(BAGS / "throws", bag)
    done = subprocess.run(
        ["dart-skill", "report", str(bag)], capture_output=True, text=True, timeout=180
    )
    assert done.returncode == 0, done.stderr
    return done.stdout, bag.parent / "throws with space_report.html"


def test_the_command_says_what_the_bag_holds_and_where_the_page_is(written):
    said, path = written
    assert "20 throws of the arm" in said and str(path) in said and path.is_file()


@needs_chromium
def test_the_page_stands_alone_and_its_replay_moves(written, tmp_path):
    _, path = written
    with Page(tmp_path, path.as_uri()) as page:
        page._wait(lambda: "What was run" in page.text(), 60.0, "the end of the page")
        width = page.run("document.documentElement.scrollWidth")
        page.run("document.querySelector('iframe').scrollIntoView({block: 'center'})")
        box = page.run(
            "(() => {const r = document.querySelector('iframe').getBoundingClientRect(); return"
            " [r.x, r.y, r.width, r.height]})()"
        )
        x, y, w, h = (int(value) for value in box)
        seen = []

        def scene():
            seen.append(page.screenshot(tmp_path / "page.png")[max(y, 0) : y + h - 50, x : x + w])
            return near(seen[-1], BASKET) > 300 and near(seen[-1], BALL) > 100

        page._wait(scene, 90.0, "arm and basket in the replay")
        page._wait(
            lambda: scene() and np.abs(seen[-1].astype(int) - seen[-2]).max() > 60,
            60.0,
            "a replay that moves",
        )
        assert width <= 1280, f"the page is {width} pixels wide, more than its window"
        _fits_a_telephone_in_the_dark(page)
        assert page.exceptions == []
        assert [
            where
            for where in page.addresses
            if not where.startswith(("file:", "data:", "blob:", "about:"))
        ] == []


def _fits_a_telephone_in_the_dark(page):
    """Nothing is wider than the window, figures come in their narrow form, and the text is light
    on dark.
    """
    page.call(
        "Emulation.setDeviceMetricsOverride",
        width=360,
        height=740,
        deviceScaleFactor=1,
        mobile=True,
    )
    page.call(
        "Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark"}]
    )
    assert page.run("document.documentElement.scrollWidth") <= 360
    shown = (
        "[...document.querySelectorAll('figure .%s')].map(form =>"
        " form.getBoundingClientRect().width)"
    )
    assert max(page.run(shown % "broad")) == 0 and 300 < min(page.run(shown % "narrow")) <= 360
    background, text = (
        page.run(f"getComputedStyle(document.body).{name}")
        for name in ("backgroundColor", "color")
    )
    dark, light = (
        np.mean([int(part) for part in colour[4:-1].split(",")]) for colour in (background, text)
    )
    assert dark < 50 and light > 200, f"{text} on {background}"
    page._wait(
        lambda: _is_dark(page, "document.querySelector('iframe').contentDocument"),
        60.0,
        "a dark replay",
    )
    ink = page.run("getComputedStyle(document.querySelector('figure .narrow svg text')).fill")
    assert np.mean([int(part) for part in ink[4:-1].split(",")]) > 200, f"{ink} in a figure"
    patch = page.run("getComputedStyle(document.querySelector('figure .narrow svg path')).fill")
    assert np.mean([int(part) for part in patch[4:-1].split(",")]) < 50, f"{patch} below a figure"
    shadow = page.run("getComputedStyle(document.querySelector('.wide')).backgroundAttachment")
    assert "local" in shadow and "scroll" in shadow, "what is cut off is shown by a shadow"
    height = page.run("document.querySelector('iframe').getBoundingClientRect().height")
    assert height <= 0.5 * 740, "a replay that is all seen, with some text"


def _is_dark(page, document):
    """Whether the page of a replay has chosen its dark colours."""
    scheme = f"{document}.documentElement.getAttribute('data-mantine-color-scheme')"
    return page.run(f"{document} && {document}.documentElement && {scheme}") == "dark"
