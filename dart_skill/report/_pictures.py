"""The figures of a report as SVG to stand in a page: each with a title, what is seen in it, and ids of its own."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dart_skill.figures import (
    demonstrated_motions,
    executed_throw,
    execution_figure,
    gaussians_figure,
    house_style,
    landings_figure,
    save,
    svg_text,
    synchronisation_figure,
)
from dart_skill.report._curve import curve_figure
from dart_skill.report._run import Run

FONTS = "'DejaVu Sans', Verdana, Arial, sans-serif"


@dataclass(frozen=True)
class Picture:
    """svg: text of an SVG file, "" if it could not be drawn; caption then says why."""

    name: str
    title: str
    caption: str
    svg: str = ""
    figure: Figure | None = None

    @property
    def element(self) -> str:
        """The picture as an element of a page."""
        return embeddable(self.svg, self.name) if self.svg else ""


def pictures(run: Run) -> list[Picture]:
    """Every figure of a run, in the order of the page."""
    return [
        picture("curve", "Learning curve", CURVE, lambda: curve_figure(run.results, run.about.marks)),
        picture("landings", "Where the balls came down", LANDINGS, lambda: _landings(run)),
        picture("synchronisation", "Demonstrations before and after synchronisation", SYNCHRONISATION, lambda: _synchronisation(run)),
        picture("gaussians", "What was learned", GAUSSIANS, lambda: _gaussians(run)),
        picture("execution", "Executed path against attractor", EXECUTION, lambda: _execution(run)),
    ]


CURVE = "Horizontal distance from where the ball crossed the plane of the rim to the centre of the rim, in the order of the throws."
LANDINGS = "Left, the floor plan with the arm at the origin, baskets to scale. Right, every landing relative to its basket."
SYNCHRONISATION = "Speed of the hand in each demonstration: left, as recorded; right, cut at the thresholds and aligned on the release."
GAUSSIANS = "Attractors of the demonstrations and the components of the mixture that was learned from them, in two task frames."
EXECUTION = (
    "The first throw of the arm that can be told apart, from the side. The plan is made again, by the skill learned from the demonstrations"
    " alone; own throws that were learned from later do not enter."
)


def save_pictures(drawn: Iterable[Picture], folder: str | os.PathLike) -> list[Path]:
    """Write NAME.svg and NAME.png of every picture that there is into a folder; returns their paths."""
    written = []
    for picture in drawn:
        if picture.figure is not None:
            with house_style():
                written += save(picture.figure, os.fspath(folder), picture.name)
    return written


def embeddable(svg: str, prefix: str) -> str:
    """An SVG file as an element of a page: without prolog and metadata, its ids marked with a prefix, with fonts to fall back on."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\bid="', f'id="{prefix}-', svg)
    svg = re.sub(r'(xlink:href="#|\bhref="#|url\(#)', rf"\g<1>{prefix}-", svg)
    return svg.replace("'DejaVu Sans'", FONTS).strip()


def picture(name: str, title: str, caption: str, draw: Callable[[], Figure]) -> Picture:
    """A figure, or why it could not be drawn."""
    try:
        figure = draw()
        return Picture(name, title, caption, svg_text(figure), figure)
    except ValueError as error:
        return Picture(name, title, f"Not drawn: {error}")


def _landings(run: Run) -> Figure:
    if not run.results:
        raise ValueError("the arm made no throws of its own")
    return landings_figure(run.results, np.array([one.target for one in run.shown]).reshape(-1, 3))


def _synchronisation(run: Run) -> Figure:
    if not any(throw.shows for throw in run.guided):
        raise ValueError("no demonstration was recorded with its raw poses")
    return synchronisation_figure(demonstrated_motions(run.recordings, run.shown))


def _gaussians(run: Run) -> Figure:
    if run.skill is None:
        raise ValueError("no skill was learned")
    return gaussians_figure(run.skill)


def _execution(run: Run) -> Figure:
    if run.skill is None:
        raise ValueError("no skill was learned, so nothing was planned")
    if not len(run.command_stamps):
        raise ValueError("the commands of the arm were not recorded")
    for result in run.results:
        try:
            return execution_figure(executed_throw(run.recordings, run.skill.plan(np.array(result.target))))
        except ValueError:
            continue  # refused, or stopped
    raise ValueError("no throw of the arm was recorded")
