"""One HTML page of a run that stands alone: text, tables, figures and replay in one file, which
fetches nothing; and what a run leaves behind.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from dart_skill.common import palette
from dart_skill.common.extras import remedy
from dart_skill.common.files import new_file
from dart_skill.recording import HAND
from dart_skill.report._html import (
    HANDLING,
    colour_key,
    embedded,
    escaped,
    figure,
    large,
    one_line,
    page,
    quiet,
    table_of,
    what_was_run,
)
from dart_skill.report._pictures import Picture, pictures, save_pictures
from dart_skill.report._replay import Replay, in_replay, replay_of
from dart_skill.report._run import About, Run, read_run
from dart_skill.session import RunSummary, TrialResult, write_summary
from dart_skill.view import ViewUnavailable, is_painted

_T = TypeVar("_T")

PAGE = "report.html"
"""Name of the page of a run."""
LAST = 25
"""Darts whose mean score stands at the top of the page."""
NO_REPLAY = "The bag holds no movement that can be shown."
SEEN = "Arm as its joints were measured; bodies as the cameras saw them."
GAUSSIANS = (
    " The Gaussians are those of the skill that the demonstrations taught, for the basket that is"
    " shown, two standard deviations wide. What became of a throw is told when the ball is down."
)


def write_page(
    run: Run, output: str | os.PathLike, figures: str | os.PathLike | None = None
) -> list[Path]:
    """Write the page of a run to the file `output`.

    Parameters
    ----------
    figures
        A folder that gets every figure as SVG and PNG, too.

    Returns
    -------
    list[Path]
        The paths of everything that was written, the page first.
    """
    output, drawn = Path(output), pictures(run)
    content = page_of(run, drawn).encode()
    output.parent.mkdir(parents=True, exist_ok=True)
    with new_file(output, replace=True) as file:
        file.write(content)
    return [output, *(save_pictures(drawn, figures) if figures is not None else [])]


def write_report(summary: RunSummary, output: Path, about: About | None = None) -> list[Path]:
    """Write JSON, the page and every picture of a run into the folder `output`.

    A throw is learned again from the bag: the same demonstrations give the same plans to the last
    bit.

    Parameters
    ----------
    about
        What the page says of the run besides.

    Returns
    -------
    list[Path]
        The paths.
    """
    written = write_summary(summary.to_json(), output)
    run = read_run(summary.bag, about, summary.trials, summary.darts)
    return [written, *write_page(run, Path(output) / PAGE, output)]


def page_of(run: Run, drawn: Sequence[Picture]) -> str:
    """The page of a run with its pictures; the same for the same run, versions and machine.

    Parameters
    ----------
    drawn
        The pictures.
    """
    replay, why = _replay(run)
    sections = [
        _numbers(run),
        _replay_section(run, replay, why),
        *(figure(picture) for picture in drawn),
        _leg_section(run),
        _trials_section(run, replay),
        _guided_section(run, replay),
        what_was_run(run.about, {"Skill": _skill_fact(run)}, run.notes),
    ]
    return page(run.about.title, sections)


# the head


def _numbers(run: Run) -> str:
    """The few numbers that matter, large."""
    shown = [(f"{len(run.shown)}", "demonstrations")]
    shown += _of_practice(run) if run.practised else _of_trials(run)
    if run.darts is not None:
        score = np.mean([dart.score for dart in run.darts.darts[-LAST:]])
        shown.append((f"{score:.1f}", f"points a dart, the last {LAST}"))
    if "Seed" in run.about.facts:
        shown.append((escaped(run.about.facts["Seed"]), "seed"))
    return large(shown)


def _of_trials(run: Run) -> list[tuple[str, str]]:
    """Numbers of trials that have one purpose."""
    if not run.trials:
        return []
    words, done = run.skill.words, sum(one.success for one in run.trials)
    what = f"own {words.trials} {words.done}" if run.throws else f"{words.trials} succeeded"
    shown = [(f"{done}/{len(run.trials)}", what)]
    errors, unit = _errors(run, run.trials), words.unit[0]
    if len(errors):
        low, middle, high = np.percentile(errors, [25, 50, 75])
        kind = "landing error" if run.throws else "error"
        spread = f"quartiles {low:.1f} and {high:.1f}, n&nbsp;=&nbsp;{len(errors)}"
        shown.append((f"{middle:.1f} {unit}", f"median {kind}, {spread}"))
        shown.append((f"{errors.max():.1f} {unit}", f"largest {kind}"))
    return shown


def _of_practice(run: Run) -> list[tuple[str, str]]:
    """Numbers of practice: those of its tests, at the same baskets each, and how many throws it
    took.
    """
    shown = []
    for phase, throws in run.tests:
        errors = _errors(run, throws)
        error = f"{np.median(errors):.2f} cm" if len(errors) else "not seen"
        most = f", largest {errors.max():.1f}" if len(errors) else ""
        what = (
            f"{escaped(phase.name)}: median landing error at {len(throws)} fixed baskets{most};"
            f" {sum(one.success for one in throws)} in"
        )
        shown.append((error, what))
    return [*shown, (f"{len(run.practised)}", "own throws learned from, elsewhere")]


def _errors(run: Run, trials: Iterable[TrialResult]) -> np.ndarray:
    """Errors that were seen, in the unit of the skill."""
    errors = [one.error_m for one in trials if one.error_m is not None]
    return run.skill.words.unit[1] * np.array(errors)


# the replay


def _replay(run: Run) -> tuple[Replay | None, str]:
    """The replay, or why there is none."""
    try:
        replay = replay_of(run)
        return replay, "" if replay else NO_REPLAY
    except ViewUnavailable:
        return None, (
            f"The replay needs the package viser, which was not there: {remedy('viser')}, then"
            " dart-skill report BAG."
        )


def _replay_section(run: Run, replay: Replay | None, why: str) -> str:
    if replay is None:
        return f"<h2>Replay</h2>{quiet(escaped(why))}"
    movements, what = run.own or run.guided, "throws" if run.throws else "movements"
    kind = f"{what} of the arm" if run.own else f"guided {what}"
    first, every = len(in_replay(run)), len(movements)
    some = f"The first {first} of {every}" if first < every else f"All {every}"
    body, *others = run.skill.bodies or ("",)
    colours = {
        body: palette.BALL,
        **dict.fromkeys(
            (one for one in others if not is_painted(run.skill.solids(one))), palette.BASKET
        ),
        f"way of the {HAND}": palette.HAND,
        "demonstrations": palette.DEMONSTRATION,
        **({"Gaussians": palette.GAUSSIAN} if run.throws else {}),
    }
    return (
        f"<h2>Replay</h2><p>{some} {kind}, {replay.seconds:.0f} s. {HANDLING} The tables say when"
        f" each begins.</p>{embedded('Replay in three dimensions', replay.html)}"
        f"{colour_key(colours)}{quiet(SEEN + (GAUSSIANS if run.throws else ''))}"
    )


# figures and tables


def _leg_section(run: Run) -> str:
    leg = None if run.darts is None else run.darts.leg
    if leg is None:
        return ""
    rows = [
        [str(number), str(dart.before), escaped(dart.hit), str(dart.points), str(dart.after)]
        for number, dart in enumerate(leg.darts, start=1)
    ]
    notes = ["bust" if dart.bust else "" for dart in leg.darts]
    table = table_of(["dart", "left before", "hit", "points", "left after"], rows, notes)
    return f"<h2>A leg of 501</h2><p>{escaped(leg.in_words)}.</p>{table}"


def _trials_section(run: Run, replay: Replay | None) -> str:
    title = f"<h2>{run.skill.words.trials.capitalize()} of the arm</h2>"
    if not run.trials:
        said = (
            "The arm made no throws of its own."
            if run.throws
            else "What became of trials is not in a bag: the folder of a run has it (summary.json)."
        )
        return title + quiet(said)
    numbered = list(enumerate(run.trials, start=1))
    rows = [
        [
            str(number),
            purpose,
            *_result_cells(run, one),
            replay.begun(number) if replay else "",
            "" if run.throws else escaped(run.skill.in_words(one.situation)),
        ]
        for (number, one), purpose in zip(numbered, run.purposes, strict=True)
    ]
    head = ["", "purpose", *_result_head(run), "replay [s]", "situation"]
    notes = [one_line(one.message if run.throws else one.why) for one in run.trials]
    return title + table_of(head, rows, notes)


def _guided_section(run: Run, replay: Replay | None) -> str:
    """What was guided, with its result where that is known; else the demonstrations."""
    judged = [(one, one.result) for one in run.guided if one.result is not None]
    if judged:
        begun = {} if replay is None else {one.name: f"{at:.1f}" for one, at in replay.starts}
        rows = [
            [number, escaped(one.name), *_result_cells(run, result), begun.get(one.name, "")]
            for number, (one, result) in _numbered(judged)
        ]
        table = table_of(
            ["", "id", *_result_head(run), "replay [s]"],
            rows,
            [one_line(one.note) for one, _ in judged],
        )
        return f"<h2>Guided {run.skill.words.trials}</h2>{table}"
    rows, head = [], ["", "id", *(TARGET if run.throws else ("duration [s]", "situation"))]
    for number, one in _numbered(run.shown):
        if run.throws:
            rows.append([number, escaped(one.id), *_target_cells(one.target)])
        else:
            start, stop = run.skill.cut(one)
            situation = escaped(_situation(run, one, start))
            rows.append([number, escaped(one.id), f"{stop - start:.1f}", situation])
    table = (
        table_of(head, rows, [""] * len(rows)) if rows else quiet("There are none in this bag.")
    )
    return f"<h2>Demonstrations</h2>{table}"


def _numbered(shown: Iterable[_T]) -> Iterator[tuple[str, _T]]:
    """What was shown, with its number: the first has 1."""
    return ((str(number), one) for number, one in enumerate(shown, start=1))


def _situation(run: Run, one: Any, start: float) -> str:
    try:
        situation = run.skill.situation(one, start)
    except ValueError as error:
        return str(error)
    return situation.in_words(run.skill.bodies, run.skill.units)


TARGET = ["target x [m]", "y [m]", "z [m]", "distance [m]", "azimuth [°]"]
"""Head of the columns of a basket."""


def _result_head(run: Run) -> list[str]:
    if run.throws:
        return [*TARGET, "landing x [m]", "y [m]", "error [cm]", "result"]
    return [f"error [{run.skill.words.unit[0]}]", "result"]


def _result_cells(run: Run, one: TrialResult) -> list[str]:
    words = run.skill.words
    error = "-" if one.error_m is None else f"{words.unit[1] * one.error_m:.1f}"
    done, failed = words.result
    result = done if one.success else f'<span class="out">{failed}</span>'
    if not run.throws:
        return [error, result]
    landing = (
        [_minus(f"{value:.3f}") for value in one.landing[:2]]
        if one.landing is not None
        else ["not seen", "-"]
    )
    return [*_target_cells(one.target), *landing, error, result]


def _target_cells(target: np.ndarray) -> list[str]:
    x, y, z = target
    cells = [*(f"{value:.3f}" for value in (x, y, z)), f"{np.hypot(x, y):.2f}"]
    return [_minus(cell) for cell in [*cells, f"{np.degrees(np.arctan2(y, x)):+.1f}"]]


def _minus(number: str) -> str:
    return number.replace("-", "\N{MINUS SIGN}")


def _skill_fact(run: Run) -> str:
    learned = None if run.throws is None else run.throws.learned
    if learned is None:
        return run.skill.name
    c, n = learned.configuration, len(learned.throws)
    return (
        f"configuration '{c.name}', {c.components} components, n = {n} demonstrations, the hand"
        f" opens {1e3 * learned.hand_delay:.0f} ms after it is told to; model {learned.model_id}"
    )
