"""One HTML page of a run that stands alone: text, tables, figures and replay in one file, which
asks nobody for anything.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from dart_skill.common import palette
from dart_skill.common.extras import remedy
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
from dart_skill.report._pictures import Picture
from dart_skill.report._replay import Replay
from dart_skill.report._replay_of_run import replay_of
from dart_skill.report._run import Run, result_of
from dart_skill.session import ThrowResult
from dart_skill.view import ViewUnavailable

SHOWN = {
    "ball": palette.BALL,
    "basket": palette.BASKET,
    "way of the hand": palette.HAND,
    "demonstrations": palette.DEMONSTRATION,
} | {"Gaussians": palette.GAUSSIAN}
"""What is seen in the replay."""


def page_of(run: Run, drawn: Sequence[Picture]) -> str:
    """The page of a run with its pictures; the same for the same run, versions and machine. drawn:
    the pictures.
    """
    replay, why = _replay(run)
    sections = [
        _numbers(run),
        _replay_section(run, replay, why),
        *(figure(picture) for picture in drawn),
        _throws_section(run, replay if run.own else None),
        _demonstrations_section(run, replay if not run.own else None),
        what_was_run(run.about, _skill_facts(run), run.notes),
    ]
    return page(run.about.title, sections)


# the head


def _numbers(run: Run) -> str:
    """The few numbers that matter, large."""
    shown = [(f"{len(run.shown)}", "demonstrations")]
    shown += _of_practice(run) if run.practised else _of_throws(run.results)
    if "Seed" in run.about.facts:
        shown.append((escaped(run.about.facts["Seed"]), "seed"))
    return large(shown)


def _of_throws(throws: Sequence[ThrowResult]) -> list[tuple[str, str]]:
    """Numbers of throws that have one purpose."""
    inside, errors, shown = sum(throw.in_basket for throw in throws), _errors(throws), []
    if throws:
        shown.append((f"{inside}/{len(throws)}", "own throws in the basket"))
    if len(errors):
        low, middle, high = np.percentile(errors, [25, 50, 75])
        shown.append(
            (
                f"{middle:.1f} cm",
                (
                    f"median landing error, quartiles {low:.1f} and {high:.1f},"
                    f" n&nbsp;=&nbsp;{len(errors)}"
                ),
            )
        )
        shown.append((f"{errors.max():.1f} cm", "largest landing error"))
    return shown


def _of_practice(run: Run) -> list[tuple[str, str]]:
    """Numbers of practice: those of its tests, at the same baskets each, and how many throws it
    took.
    """
    shown = []
    for phase, throws in run.tests:
        inside, errors = sum(throw.in_basket for throw in throws), _errors(throws)
        error = f"{np.median(errors):.2f} cm" if len(errors) else "not seen"
        most = f", largest {errors.max():.1f}" if len(errors) else ""
        shown.append(
            (
                error,
                (
                    f"{escaped(phase.name)}: median landing error at {len(throws)} fixed"
                    f" baskets{most}; {inside} in"
                ),
            )
        )
    return [*shown, (f"{len(run.practised)}", "own throws learned from, elsewhere")]


def _errors(throws: Iterable[ThrowResult]) -> np.ndarray:
    return 100.0 * np.array([throw.error_m for throw in throws if throw.seen])


# the replay


def _replay(run: Run) -> tuple[Replay | None, str]:
    """The replay, or why there is none."""
    try:
        replay = replay_of(run)
        return replay, "" if replay else "The bag holds no throw that can be shown."
    except ViewUnavailable:
        return (
            None,
            (
                f"The replay needs the package viser, which was not there: {remedy('viser')}, then"
                " dart-skill report BAG."
            ),
        )


def _replay_section(run: Run, replay: Replay | None, why: str) -> str:
    if replay is None:
        return f'<h2>Replay</h2><p class="quiet">{escaped(why)}</p>'
    kind, throws = ("throws of the arm", run.own) if run.own else ("guided throws", run.guided)
    some = (
        f"The first {len(replay.starts)} of {len(throws)}"
        if len(replay.starts) < len(throws)
        else f"All {len(throws)}"
    )
    return (
        f"<h2>Replay</h2><p>{some} {kind}, {replay.seconds:.0f} s. {HANDLING} The tables say when"
        " each throw"
        f" begins.</p>{embedded('Replay of the throws in three dimensions', replay.html)}{colour_key(SHOWN)}<p"
        ' class="quiet">Arm as its joints were measured; ball, basket and hand as the cameras'
        " saw them. The Gaussians are those of the skill that the demonstrations taught, for the"
        " basket that is shown, two standard deviations wide. What became of a throw is told when"
        " the ball is down.</p>"
    )


# figures and tables


def _throws_section(run: Run, replay: Replay | None) -> str:
    begun = (
        {
            number: f"{replay.starts[k]:.1f}"
            for k, number in run.numbers.items()
            if k in replay.starts
        }
        if replay
        else {}
    )
    rows = [
        [str(number), purpose, *_result_cells(throw), begun.get(number, "")]
        for number, (purpose, throw) in enumerate(
            zip(run.purposes, run.results, strict=True), start=1
        )
    ]
    table = table_of(
        [_HEAD[0], "purpose", *_HEAD[1:], "replay [s]"],
        rows,
        [one_line(throw.message) for throw in run.results],
    )
    return (
        "<h2>Throws of the"
        f" arm</h2>{table if rows else quiet('The arm made no throws of its own.')}"
    )


def _demonstrations_section(run: Run, replay: Replay | None) -> str:
    rows, notes = [], []
    for number, throw in enumerate(run.guided):
        if throw.demonstration is None:
            continue
        start = f"{replay.starts[number]:.1f}" if replay and number in replay.starts else ""
        rows.append([escaped(throw.demonstration.id), *_result_cells(result_of(throw)), start])
        notes.append(one_line(throw.reason or ("" if throw.shows else "a miss: no demonstration")))
    if rows:
        return f"<h2>Guided throws</h2>{table_of([*_HEAD, 'replay [s]'], rows, notes)}"
    rows = [[escaped(one.id), *_target_cells(one.target.tolist())] for one in run.shown]
    table = (
        table_of(_HEAD[:6], rows, [""] * len(rows))
        if rows
        else quiet("There are none in this bag.")
    )
    return f"<h2>Demonstrations</h2>{table}"


_HEAD = [
    "",
    "target x [m]",
    "y [m]",
    "z [m]",
    "distance [m]",
    "azimuth [°]",
    "landing x [m]",
    "y [m]",
    "error [cm]",
    "result",
]


def _target_cells(target: Sequence[float]) -> list[str]:
    x, y, z = target
    cells = [
        f"{x:.3f}",
        f"{y:.3f}",
        f"{z:.3f}",
        f"{np.hypot(x, y):.2f}",
        f"{np.degrees(np.arctan2(y, x)):+.1f}",
    ]
    return [_minus(cell) for cell in cells]


def _result_cells(throw: ThrowResult) -> list[str]:
    landing = (
        [_minus(f"{value:.3f}") for value in throw.landing[:2]]
        if throw.landing is not None
        else ["not seen", "-"]
    )
    error = "-" if throw.error_m is None else f"{100 * throw.error_m:.1f}"
    return [
        *_target_cells(throw.target),
        *landing,
        error,
        "in" if throw.in_basket else '<span class="out">out</span>',
    ]


def _minus(number: str) -> str:
    return number.replace("-", "\N{MINUS SIGN}")


def _skill_facts(run: Run) -> dict[str, str]:
    skill = run.skill
    if skill is None:
        return {}
    c, n = skill.configuration, len(skill.throws)
    text = f"configuration '{c.name}', {c.components} components, n = {n} demonstrations"
    return {
        "Skill": (
            f"{text}, the hand opens {1e3 * skill.hand_delay:.0f} ms after it is told to; model"
            f" {skill.model_id}"
        )
    }
