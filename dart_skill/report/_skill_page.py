"""The page of a run of any skill but throws at baskets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from dart_skill.common.extras import remedy
from dart_skill.figures import arm_darts_figure, trials_figure
from dart_skill.report._html import (
    HANDLING,
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
from dart_skill.report._pictures import Picture, picture
from dart_skill.report._replay import Replay
from dart_skill.report._skill_replay import replay_of, shown_in_replay
from dart_skill.report._skill_run import SkillRun
from dart_skill.session import DartsSummary, SkillResult, SkillSummary, in_words
from dart_skill.skills.protocol import Demonstration
from dart_skill.view import ViewUnavailable

TRIALS = (
    "(a) From above: ways of the hand that were shown, where bodies stood then (dashed), and where"
    " it was tried. (b) The same ways from the side. (c) The error of each trial."
)
DARTS = (
    "Spread, aim and score over the own throws, and where they hit, all as the cameras saw them."
)


def skill_pictures(run: SkillRun, summary: SkillSummary | DartsSummary | None) -> list[Picture]:
    """Every figure of a run, in the order of the page."""
    drawn: list[tuple[str, str, str, Callable[[bool], Figure]]] = []
    if isinstance(summary, DartsSummary):
        darts = summary.run
        drawn.append(("darts", "Darts", DARTS, partial(arm_darts_figure, darts)))
    else:
        of = summary or SkillSummary(run.skill.name, 0, str(run.bag), len(run.shown), 0, (), 0.0)
        drawn.append(
            (
                "trials",
                "What was shown, and tried",
                TRIALS,
                partial(trials_figure, of, run.skill, run.shown),
            )
        )
    return [picture(*one) for one in drawn]


def skill_page_of(
    run: SkillRun, drawn: Sequence[Picture], summary: SkillSummary | DartsSummary | None = None
) -> str:
    """The page of a run with its pictures; the same for the same run, versions and machine. drawn:
    the pictures.
    """
    try:
        replay: Replay | None = replay_of(run)
        why = ""
    except ViewUnavailable:
        replay, why = (
            None,
            (
                f"The replay needs the package viser, which was not there: {remedy('viser')}, then"
                " make it again."
            ),
        )
    sections = [
        _numbers(run, summary),
        _replay_section(run, replay, why),
        *(figure(one) for one in drawn),
        _leg_section(summary),
        _trials_section(run, replay),
        _demonstrations_section(run),
        what_was_run(run.about, {"Skill": run.skill.name}, run.notes),
    ]
    return page(run.about.title, sections)


def _numbers(run: SkillRun, summary: SkillSummary | DartsSummary | None) -> str:
    shown = [(f"{len(run.shown)}", "demonstrations")]
    if run.trials:
        done = sum(bool(one.outcome.success) for one in run.trials)
        shown.append((f"{done}/{len(run.trials)}", "trials succeeded"))
        errors = [1e3 * one.error_m for one in run.trials if one.error_m is not None]
        if errors:
            shown.append((f"{np.median(errors):.1f} mm", "median error"))
            shown.append((f"{max(errors):.1f} mm", "largest error"))
    if isinstance(summary, DartsSummary):
        shown.append(
            (
                f"{np.mean([dart.score for dart in summary.run.darts[-25:]]):.1f}",
                "points a dart, the last 25",
            )
        )
    if "Seed" in run.about.facts:
        shown.append((escaped(run.about.facts["Seed"]), "seed"))
    return large(shown)


def _replay_section(run: SkillRun, replay: Replay | None, why: str) -> str:
    if replay is None:
        return f"<h2>Replay</h2>{quiet(escaped(why))}"
    what = (
        "movements of the arm"
        if any(not one.guided for one in run.movements)
        else "guided movements"
    )
    return (
        f"<h2>Replay</h2><p>{len(replay.starts)} {what}, {replay.seconds:.0f} s. {HANDLING}</p>"
        f"{embedded('Replay of the movements in three dimensions', replay.html)}"
        f"{quiet('Arm as its joints were measured; bodies as the cameras saw them; ways of the hand in the demonstrations (grey).')}"
    )


def _leg_section(summary: SkillSummary | DartsSummary | None) -> str:
    if not isinstance(summary, DartsSummary) or summary.leg is None:
        return ""
    rows = [
        [str(number), str(dart.before), escaped(dart.hit), str(dart.points), str(dart.after)]
        for number, dart in enumerate(summary.leg.darts, start=1)
    ]
    notes = ["bust" if dart.bust else "" for dart in summary.leg.darts]
    table = table_of(["dart", "left before", "hit", "points", "left after"], rows, notes)
    return f"<h2>A leg of 501</h2><p>{escaped(summary.leg.in_words)}.</p>{table}"


def _trials_section(run: SkillRun, replay: Replay | None) -> str:
    if not run.trials:
        said = "What became of trials is not in a bag: the folder of a run has it (summary.json)."
        return f"<h2>Trials</h2>{quiet(said)}"
    begun = (
        {one.name: f"{replay.starts[k]:.1f}" for k, one in enumerate(shown_in_replay(run))}
        if replay
        else {}
    )
    rows = [
        _cells(run, number, one, begun.get(f"trial {number}", ""))
        for number, one in enumerate(run.trials, start=1)
    ]
    head = ["", "error [mm]", "result", "replay [s]", "situation"]
    return f"<h2>Trials</h2>{table_of(head, rows, [one_line(one.why) for one in run.trials])}"


def _cells(run: SkillRun, number: int, one: SkillResult, begun: str) -> list[str]:
    error = "-" if one.error_m is None else f"{1e3 * one.error_m:.1f}"
    result = "done" if one.outcome.success else '<span class="out">failed</span>'
    return [
        str(number),
        error,
        result,
        begun,
        escaped(in_words(one.situation, units=run.skill.units)),
    ]


def _demonstrations_section(run: SkillRun) -> str:
    rows = []
    for one in run.shown:
        start, stop = run.skill.cut(one)
        rows.append([escaped(one.id), f"{stop - start:.1f}", escaped(_situation(run, one, start))])
    table = (
        table_of(["", "duration [s]", "situation"], rows, [""] * len(rows))
        if rows
        else quiet("There are none in this bag.")
    )
    return f"<h2>Demonstrations</h2>{table}"


def _situation(run: SkillRun, one: Demonstration, start: float) -> str:
    try:
        return in_words(run.skill.situation(one, start), run.skill.bodies, run.skill.units)
    except ValueError as error:
        return str(error)
