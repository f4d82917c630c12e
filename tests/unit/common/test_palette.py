"""One colour for one thing, wherever it is drawn, and colours that colour-blind people can tell
apart.
"""

import itertools
import json
import re

import numpy as np
import pytest
import yaml

from dart_skill import figures
from dart_skill.common import palette
from dart_skill.view import legend
from tests.paths import ROOT

VIEWERS = ROOT / "config" / "viewers"
SIGHTS = {
    "all cones": np.eye(3),
    "no red cones": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "no green cones": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "no blue cones": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}
"""Linear red, green and blue as others see them: Machado, Oliveira, Fernandes (2009), severity 1.
"""
LEAST = 10.0
"""Of two things that are seen together, as a distance in CIE Lab; 2.3 is just noticeable. Purple
and grey are the nearest (14.8).
"""


def lab(colour, sight):
    """CIE Lab (3,) of a colour in sRGB, seen with some cones, white D65."""
    part = np.array(colour) / 255
    linear = np.clip(
        sight @ np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4), 0.0, 1.0
    )
    xyz = (
        np.array(
            [
                [0.4124564, 0.3575761, 0.1804375],
                [0.2126729, 0.7151522, 0.0721750],
                [0.0193339, 0.1191920, 0.9503041],
            ]
        )
        @ linear
    )
    x, y, z = np.cbrt(xyz / [0.95047, 1.0, 1.08883])
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("sight", SIGHTS)
def test_things_that_are_seen_together_can_be_told_apart_by_everybody(sight):
    for (one, first), (other, second) in itertools.combinations(palette.THINGS.items(), 2):
        apart = np.linalg.norm(lab(first, SIGHTS[sight]) - lab(second, SIGHTS[sight]))
        assert apart > LEAST, f"{one} and {other} with {sight}: {apart:.1f}"


def test_figures_have_the_colours_of_the_things():
    for thing, colour in palette.THINGS.items():
        assert getattr(figures, thing.upper()) == palette.hexadecimal(colour), thing
    assert palette.hexadecimal((0, 114, 178)) == "#0072b2" and palette.unit((255, 0, 51)) == (
        1.0,
        0.0,
        0.2,
    )


def test_the_live_page_has_the_colours_of_the_things():
    named = {
        "ball": "ball",
        "basket": "basket",
        "hand's path": "hand",
        "attractor": "attractor",
        "demonstrations": "demonstration",
    }
    assert {name: palette.THINGS[thing] for name, thing in named.items()} == legend(
        ("ball", "basket")
    )
    assert set(legend(("dart", "board"))) == {
        "dart",
        "hand's path",
        "attractor",
        "demonstrations",
    }, "a board is painted"


def test_files_of_other_viewers_have_the_colours_of_the_things():
    topics = json.loads((VIEWERS / "foxglove.json").read_text())["configById"]["3D!arm"]["topics"]
    for thing in ("ball", "hand", "basket"):
        assert (
            topics[f"/vrpn_mocap/{thing}/pose"]["color"].lower()
            == palette.hexadecimal(palette.THINGS[thing]) + "ff"
        ), thing
    attractor = palette.hexadecimal(palette.ATTRACTOR) + "ff"
    assert topics["/commander/attractor"]["color"].lower() == attractor
    assert {colour.lower() for colour in topics["/commander/plan"]["gradient"]} == {attractor}
    shown = yaml.safe_load((VIEWERS / "throwing.rviz").read_text())["Visualization Manager"][
        "Displays"
    ]
    plan = next(display for display in shown if display["Name"] == "Plan")
    assert tuple(map(int, plan["Color"].split(";"))) == palette.ATTRACTOR


def test_the_layout_for_rerun_which_cannot_import_them_has_the_colours_of_the_things():
    text = (ROOT / "dart_skill" / "view" / "rerun" / "_blueprint.py").read_text()
    for name in ("BALL", "BASKET", "GREY", "SKY"):
        colour = re.search(rf"^{name} = (.*)$", text, re.MULTILINE)[1]
        assert eval(colour) == getattr(palette, name), name


def test_markers_have_the_colours_of_the_things():
    learner = pytest.importorskip("dart_skill_nodes.executables.skill_learner")
    for marker, colour in zip(learner.COLOURS, palette.GAUSSIANS, strict=True):
        assert [marker.r, marker.g, marker.b] == pytest.approx(palette.unit(colour), abs=1e-6)
    assert [learner.SHOWN.r, learner.SHOWN.g, learner.SHOWN.b] == pytest.approx(
        palette.unit(palette.DEMONSTRATION), abs=1e-6
    )


def test_no_other_module_names_a_colour_of_a_thing_in_numbers():
    """What has no meaning of its own may: greys of a page, the paint of a dart board."""
    meant = {palette.hexadecimal(colour) for colour in palette.THINGS.values()} - {"#000000"}
    tuples = {str(colour).strip("()") for colour in palette.THINGS.values() if any(colour)}
    for path in [*(ROOT / "dart_skill").rglob("*.py"), *(ROOT / "nodes").rglob("*.py")]:
        if path.name in ("palette.py", "_blueprint.py"):
            continue
        text = path.read_text().lower()
        wrong = [colour for colour in meant | tuples if colour in text]
        assert not wrong, (
            f"{path.relative_to(ROOT)} has {wrong}: take them from dart_skill.common.palette"
        )


@pytest.mark.parametrize("colour", [*palette.THINGS.values(), palette.GREY, (68, 1, 84)])
def test_what_is_seen_on_white_is_seen_on_the_dark_page(colour):
    dark = palette.in_the_dark(colour)
    assert palette.contrast(dark, palette.DARK_PAGE) > 3.0, f"{colour} becomes {dark}"


def test_white_and_pale_areas_become_dark():
    assert palette.in_the_dark((255, 255, 255)) == palette.DARK_PAGE
    assert palette.contrast(palette.in_the_dark(palette.PALE), palette.DARK_PAGE) < 2.0
