"""Figure `trials`: how a skill was shown, where it was tried, and how far each trial was off."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator

from dart_skill.figures._style import (
    BLACK,
    DEMONSTRATION,
    FAILURE,
    SUCCESS,
    house_style,
    legend_below,
    letter_panels,
    panels,
    save,
)
from dart_skill.session import TrialResult
from dart_skill.skills.protocol import HAND, Pose, Skill, TaskDemonstration

SIDE = 0.035
"""A body is drawn as a square of this half edge [m], turned as it is."""


def draw_trials(
    trials: Sequence[TrialResult],
    skill: Skill,
    shown: Sequence[TaskDemonstration],
    folder: str | Path,
) -> list[Path]:
    """Write the figure; returns the paths. trials: in order; shown: what was learned from."""
    with house_style():
        return save(trials_figure(trials, skill, shown), folder, "trials")


def trials_figure(
    trials: Sequence[TrialResult],
    skill: Skill,
    shown: Sequence[TaskDemonstration],
    narrow: bool = False,
) -> Figure:
    """The figure itself, as `draw_trials` writes it; narrow: its panels stand one below the other.

    ValueError where nothing was shown and nothing tried.
    """
    if not shown and not trials:
        raise ValueError("no demonstrations and no trials: there is nothing to draw")
    with house_style():
        figure, (above, side, errors) = panels(
            [(4.3, 4.6), (3.45, 3.6 if narrow else 4.6), (2.75, 2.4 if narrow else 4.6)], narrow
        )
        _draw_above(above, trials, skill, shown)
        _draw_side(side, skill, shown)
        _draw_errors(errors, trials)
        letter_panels(above, side, errors)
        handles, labels = above.get_legend_handles_labels()
        legend_below(figure, handles, labels, len(labels), narrow)
        return figure


def _movements(
    skill: Skill, shown: Sequence[TaskDemonstration]
) -> list[tuple[TaskDemonstration, np.ndarray]]:
    """Each demonstration with the positions of the hand (n, 3) between its first and its last
    instant.
    """
    found = []
    for one in shown:
        start, stop = skill.cut(one)
        found.append((one, one.hand_position[(one.hand_time >= start) & (one.hand_time <= stop)]))
    return found


def _draw_above(
    axes: Axes, trials: Sequence[TrialResult], skill: Skill, shown: Sequence[TaskDemonstration]
) -> None:
    axes.plot(0.0, 0.0, "s", color=BLACK, markersize=8, label="arm", gid="arm")
    for number, (one, hand) in enumerate(_movements(skill, shown)):
        axes.plot(
            hand[:, 0],
            hand[:, 1],
            color=DEMONSTRATION,
            linewidth=1.0,
            label=None if number else "hand, shown",
        )
        for role in skill.bodies[1:]:
            pose = one.track(role).pose_at(float(one.hand_time[0]))
            _draw_body(
                axes, pose, DEMONSTRATION, "" if number else f"{role}, shown", linestyle="--"
            )
    labelled: set[str] = set()
    for number, trial in enumerate(trials, start=1):
        done = trial.success
        for role, pose in trial.situation.poses.items():
            what = f"{role}, {'done' if done else 'failed'}"
            _draw_body(axes, pose, SUCCESS if done else FAILURE, "" if what in labelled else what)
            axes.text(
                pose.position[0],
                pose.position[1],
                str(number),
                ha="center",
                va="center",
                fontsize=8,
                gid=f"trial_{number}",
            )
            labelled.add(what)
    axes.set(title="Seen from above", xlabel="x [m]", ylabel="y [m]", aspect="equal")


def _draw_body(axes: Axes, pose: Pose, colour: str, label: str, linestyle: str = "-") -> None:
    """A square about a body's origin, turned as it is, with its x axis as a tick."""
    x, y = SIDE * pose.rotation[:2, :2].T
    corners = pose.position[:2] + np.array([x + y, x - y, -x - y, -x + y, x + y])
    axes.plot(*corners.T, color=colour, linestyle=linestyle, linewidth=1.2, label=label or None)
    axes.plot(
        *np.array([pose.position[:2] + x, pose.position[:2] + 1.5 * x]).T,
        color=colour,
        linewidth=1.2,
    )


def _draw_side(axes: Axes, skill: Skill, shown: Sequence[TaskDemonstration]) -> None:
    for _, hand in _movements(skill, shown):
        way = np.concatenate(
            [[0.0], np.cumsum(np.linalg.norm(np.diff(hand[:, :2], axis=0), axis=1))]
        )
        axes.plot(way, hand[:, 2], color=DEMONSTRATION, linewidth=1.0)
    axes.set(title=f"Height of the {HAND}, shown", xlabel="way over the floor [m]", ylabel="z [m]")


def _draw_errors(axes: Axes, trials: Sequence[TrialResult]) -> None:
    for number, trial in enumerate(trials, start=1):
        done = trial.success
        if trial.error_m is not None:
            axes.bar(number, 1e3 * trial.error_m, color=SUCCESS if done else FAILURE, width=0.7)
        else:
            axes.text(number, 0.0, "?", ha="center", va="bottom", color=FAILURE)
    errors = [1e3 * trial.error_m for trial in trials if trial.error_m is not None]
    if errors and max(errors) > 20.0 * max(np.median(errors), 0.1):
        axes.set_yscale("log")
    axes.set(
        title=f"{sum(one.success for one in trials)} of {len(trials)} succeeded",
        xlabel="trial",
        ylabel="error [mm]",
    )
    axes.set_xlim(0.4, max(len(trials), 1) + 0.6)  # a mark does not widen it
    axes.xaxis.set_major_locator(
        MaxNLocator(integer=True, min_n_ticks=1) if trials else NullLocator()
    )
