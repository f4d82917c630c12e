"""The figures of a report as SVG to stand in a page: each with a title, what is seen in it, and
ids of its own.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from dart_skill.figures import (
    arm_darts_figure,
    demonstrated_motions,
    executed_throw,
    execution_figure,
    gaussians_figure,
    house_style,
    landings_figure,
    save,
    svg_text,
    synchronisation_figure,
    trials_figure,
)
from dart_skill.report._curve import compared_figure, curve_figure
from dart_skill.report._run import Run
from dart_skill.session import TrialResult

if TYPE_CHECKING:
    from dart_skill.report._throws import Throws

FONTS = "'DejaVu Sans', Verdana, Arial, sans-serif"


@dataclass(frozen=True)
class Picture:
    """A figure of the page.

    Parameters
    ----------
    svg
        Text of an SVG file, "" if it could not be drawn; caption then says why.
    narrow
        The same for a narrow screen.
    """

    name: str
    title: str
    caption: str
    svg: str = ""
    figure: Figure | None = None
    narrow: str = ""

    @property
    def element(self) -> str:
        """The picture as an element of a page, which shows the one of its two forms for which
        there is room.
        """
        return "".join(f'<div class="{kind}">{form}</div>' for kind, form in self.forms.items())

    @property
    def forms(self) -> dict[str, str]:
        """The broad and the narrow form as elements; none of what could not be drawn."""
        if not self.svg:
            return {}
        return {
            "broad": embeddable(self.svg, self.name),
            "narrow": embeddable(self.narrow, f"{self.name}-narrow"),
        }


def pictures(run: Run) -> list[Picture]:
    """Every figure of a run, in the order of the page."""
    if run.throws is not None:
        return _pictures_of_throws(run, run.throws)
    if run.darts is not None:
        return [picture("darts", "Darts", DARTS, partial(arm_darts_figure, run.darts))]
    draw = partial(trials_figure, run.trials, run.skill, run.shown)
    words = ("What was shown, and tried", TRIALS) if run.trials else ("What was shown", SHOWN)
    return [picture("trials", *words, draw)]


def _pictures_of_throws(run: Run, throws: Throws) -> list[Picture]:
    return [
        *_errors(run),
        picture("landings", *_landings_words(run), partial(_landings, run)),
        picture(
            "synchronisation",
            "Demonstrations before and after synchronisation",
            SYNCHRONISATION,
            partial(_synchronisation, run, throws),
        ),
        picture("gaussians", "What was learned", GAUSSIANS, partial(_gaussians, throws)),
        picture(
            "execution",
            "Executed path against attractor",
            EXECUTION,
            partial(_execution, run.trials, throws),
        ),
    ]


TRIALS = (
    "(a) From above: ways of the hand that were shown, where bodies stood then (dashed), and where"
    " it was tried. (b) The same ways from the side. (c) The error of each trial."
)
SHOWN = (
    "(a) From above: ways of the hand that were shown, and where bodies stood then (dashed)."
    " (b) The same ways from the side."
)
DARTS = (
    "Spread, aim and score over the own throws, and where they hit, all as the cameras saw them."
)
ERROR = (
    "Landing error: horizontal distance from where the ball crossed the plane of the rim to the"
    " centre of the rim."
)
TESTS = (
    "Throws at the same baskets in each test, from which nothing was learned: this is what"
    " practice is judged by. (a) All of them; (b) basket by basket, with an arrow to the last test"
    " from the one before. " + ERROR
)
PRACTISED = (
    "The throws that were learned from, in their order. They go to other baskets each time, where"
    " a throw teaches most, so this curve alone does not tell whether"
    " practice helps. " + ERROR
)
UNTESTED = PRACTISED + " There were no tests (--tests 0)."
LANDINGS = (
    "(a) The floor plan with the arm at the origin, baskets to scale. (b) Every landing relative"
    " to its basket."
)
SYNCHRONISATION = (
    "Speed of the hand in each demonstration: (a) as recorded; (b) cut at the thresholds and"
    " aligned on the release."
)
GAUSSIANS = (
    "Attractors of the demonstrations and the components of the mixture that was learned from"
    " them, in two task frames."
)
EXECUTION = (
    "The first throw of the arm that can be told apart, from the side. The plan is made again, by"
    " the skill learned from the demonstrations alone; own throws that were learned from later do"
    " not enter."
)


def save_pictures(drawn: Iterable[Picture], folder: str | os.PathLike) -> list[Path]:
    """Write NAME.svg and NAME.png of every picture that could be drawn into a folder.

    Returns
    -------
    list[Path]
        Their paths.
    """
    with house_style():
        return [
            path
            for one in drawn
            if one.figure is not None
            for path in save(one.figure, os.fspath(folder), one.name, one.svg)
        ]


def embeddable(svg: str, prefix: str) -> str:
    """An SVG file as an element of a page: without prolog and metadata, its ids marked with a
    prefix, with fonts to fall back on. Each colour becomes a variable, which the page sets for
    light and dark (`colours_of`).
    """
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.DOTALL)
    # a pattern for all of them would take ten times as long
    for mark in (
        ' id="',
        'href="#',
        "url(#",
    ):
        svg = svg.replace(mark, f"{mark}{prefix}-")
    svg = re.sub(r"(?<=[ :])#([0-9a-f]{6})\b", r"var(--c\1)", svg)
    return svg.replace("'DejaVu Sans'", FONTS).strip()


def picture(name: str, title: str, caption: str, draw: Callable[[bool], Figure]) -> Picture:
    """A figure, or why it could not be drawn.

    Parameters
    ----------
    draw
        Draws it, for a narrow screen or not.
    """
    try:
        with house_style():  # once for all that is drawn
            figure = draw(False)
            return Picture(name, title, caption, svg_text(figure), figure, svg_text(draw(True)))
    except ValueError as error:
        return Picture(name, title, f"Not drawn: {error}")


def _errors(run: Run) -> list[Picture]:
    """What became better, and the throws from which it did; where nothing was practised, the
    errors of all throws.
    """
    if not run.practised:
        return [
            picture(
                "curve",
                "Landing error, throw by throw",
                _curve_caption(run),
                partial(curve_figure, run.trials),
            )
        ]
    tests = [(phase.name, results) for phase, results in run.tests]
    compared = (
        [picture("tests", "Before and after practice", TESTS, partial(compared_figure, tests))]
        if len(tests) > 1
        else []
    )
    said = PRACTISED if compared else UNTESTED
    return [
        *compared,
        picture(
            "curve",
            "Learning curve",
            said,
            lambda narrow: curve_figure(run.practised, narrow, run.about.marks, learned=True),
        ),
    ]


def _curve_caption(run: Run) -> str:
    known = (
        "None of these throws was learned from."
        if run.about.phases
        else "The bag does not tell whether the arm learned from them."
    )
    return f"{known} {ERROR}"


def _landings_words(run: Run) -> tuple[str, str]:
    """Title and caption."""
    title, caption = "Where the balls came down", LANDINGS
    return (
        (f"{title}: {run.tests[-1][0].name}", f"The throws of the last test. {caption}")
        if run.tests
        else (title, caption)
    )


def _landings(run: Run, narrow: bool) -> Figure:
    if not run.trials:
        raise ValueError("the arm made no throws of its own")
    shown = run.tests[-1][1] if run.tests else run.trials
    return landings_figure(
        shown, np.array([one.target for one in run.shown]).reshape(-1, 3), narrow=narrow
    )


def _synchronisation(run: Run, throws: Throws, narrow: bool) -> Figure:
    if not any(throw.shows for throw in throws.found):
        raise ValueError("no demonstration was recorded with its raw poses")
    return synchronisation_figure(demonstrated_motions(throws.stretches, run.shown), narrow)


def _gaussians(throws: Throws, narrow: bool) -> Figure:
    if throws.learned is None:
        raise ValueError("no skill was learned")
    return gaussians_figure(throws.learned, narrow)


def _execution(trials: Sequence[TrialResult], throws: Throws, narrow: bool) -> Figure:
    if throws.learned is None:
        raise ValueError("no skill was learned, so nothing was planned")
    if not len(throws.command_stamps):
        raise ValueError("the commands of the arm were not recorded")
    stretches = throws.stretches
    for one in trials:
        try:
            executed = executed_throw(stretches, throws.learned.plan(one.target))
        except ValueError:
            continue  # refused, or stopped
        return execution_figure(executed, narrow=narrow)
    raise ValueError("no throw of the arm was recorded")
