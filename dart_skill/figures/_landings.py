"""Figure `landings`: where the balls came down on the plane of the rim, on the floor plan and
relative to their baskets.

Figure `trials`: the same for other skills than throws: where a skill was shown and tried, and how
far each trial was off.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dart_skill.common.situation import Pose
from dart_skill.common.world import the_world
from dart_skill.figures._style import (
    BASKET,
    BLACK,
    DEMONSTRATION,
    FAILURE,
    LIGHT,
    PALE,
    SUCCESS,
    basket_from_above,
    house_style,
    legend_below,
    letter_panels,
    panels,
    unit_along,
    zoomed_inset,
)
from dart_skill.recording import HAND, Demonstration
from dart_skill.session import TrialResult, throws_in_a_line
from dart_skill.skills.protocol import Skill

RIM_RADIUS = the_world().basket_radius
HALO = {"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.8}


@house_style()
def landings_figure(
    throws: Sequence[TrialResult],
    demonstrated: np.ndarray,
    rim_radius: float = RIM_RADIUS,
    narrow: bool = False,
) -> Figure:
    """The figure.

    Parameters
    ----------
    throws
        Their results.
    demonstrated : (n, 3)
        Baskets of the demonstrations [m].
    rim_radius
        Of the baskets [m].
    narrow
        Its panels stand one below the other.

    Raises
    ------
    ValueError
        If there is nothing to draw.
    """
    if not throws and not len(demonstrated):
        raise ValueError("no throws and no demonstrated baskets: there is nothing to draw")
    figure, (plan, misses) = panels([(5.25, 5.4), (5.25, 5.4)], narrow)
    _draw_plan(plan, throws, demonstrated, rim_radius)
    _draw_misses(misses, throws, 100.0 * rim_radius)
    handles, labels = plan.get_legend_handles_labels()
    letter_panels(plan, misses)
    legend_below(figure, handles, labels, len(labels), narrow)
    return figure


def along_across(throw: TrialResult) -> np.ndarray:
    """Landing relative to the centre of the rim (2,) [m]: along the throw, + too far, and across
    it, + to the left.
    """
    forward = unit_along(throw.azimuth)
    assert throw.landing is not None  # only of throws that were seen
    miss = np.array(throw.landing[:2]) - throw.target[:2]
    return np.array([miss @ forward, miss @ [-forward[1], forward[0]]])


def _draw_plan(
    axes: Axes, throws: Sequence[TrialResult], demonstrated: np.ndarray, radius: float
) -> None:
    axes.plot(0.0, 0.0, "s", color=BLACK, markersize=8, label="arm", gid="arm")
    for number, centre in enumerate(demonstrated, start=1):
        basket_from_above(
            axes,
            centre,
            radius,
            facecolor="none",
            edgecolor=DEMONSTRATION,
            linestyle="--",
            label="basket, demonstrated" if number == 1 else None,
            gid=f"demonstrated_{number}",
        )
    for number, throw in enumerate(throws, start=1):
        basket_from_above(
            axes,
            throw.target,
            radius,
            facecolor=PALE,
            edgecolor=BASKET,
            label="basket, thrown at" if number == 1 else None,
            gid=f"thrown_{number}",
        )
        beyond = throw.target[:2] + (radius + 0.08) * unit_along(throw.azimuth)
        axes.text(beyond[0], beyond[1], str(number), ha="center", va="center", bbox=HALO, zorder=4)
    seen = [throw for throw in throws if throw.landing is not None]
    _draw_points(
        axes, seen, np.array([throw.landing for throw in seen]).reshape(-1, 3)[:, :2], "plan"
    )
    axes.set_aspect("equal", adjustable="datalim")
    axes.autoscale_view()
    axes.set(
        xlabel="x, front of the arm [m]",
        ylabel="y [m]",
        title=f"Floor plan: {len(demonstrated)} demonstrated baskets, {len(throws)} thrown at",
    )


def _draw_misses(axes: Axes, throws: Sequence[TrialResult], radius_cm: float) -> None:
    seen = [throw for throw in throws if throw.landing is not None]
    places = (
        100.0
        * np.array([along_across(throw) for throw in seen]).reshape(-1, 2)[:, ::-1]
        * [-1.0, 1.0]
    )
    basket_from_above(
        axes, np.zeros(2), radius_cm, gid="rim", facecolor=PALE, edgecolor=BASKET, linewidth=1.5
    )
    axes.axhline(0.0, color=LIGHT, linewidth=0.8)
    axes.axvline(0.0, color=LIGHT, linewidth=0.8)
    _draw_points(axes, seen, places, "relative")
    limit = 1.12 * max(radius_cm, np.abs(places).max(initial=0.0))
    axes.set(
        xlim=(-limit, limit),
        ylim=(-limit, limit),
        aspect="equal",
        xlabel="across the throw, + to the right [cm]",
        ylabel="along the throw, + too far [cm]",
        title=(
            f"Landings about the middle, radius of the rim {radius_cm:g} cm\n"
            f"{throws_in_a_line(throws)}"
        ),
    )
    if len(places) < 3:
        return
    half = float(np.ceil(1.3 * np.quantile(np.abs(places).max(axis=1), 0.9)))
    if half <= radius_cm / 4.0:  # most landings again, larger, where they are a blob
        # its title ends below that of the panel
        inset = zoomed_inset(axes, half, (0.66, 0.61, 0.32, 0.32))
        inset.axhline(0.0, color=LIGHT, linewidth=0.8)
        inset.axvline(0.0, color=LIGHT, linewidth=0.8)
        _draw_points(inset, seen, places, "middle")


def _draw_points(axes: Axes, throws: Sequence[TrialResult], places: np.ndarray, gid: str) -> None:
    """Landings at places (n, 2), by what became of the ball."""
    inside = np.array([throw.success for throw in throws], dtype=bool)
    axes.plot(
        *places[inside].T,
        "o",
        color=SUCCESS,
        markerfacecolor="white",
        markersize=4.0,
        linestyle="none",
        zorder=3,
        label="landing, in",
        gid=f"{gid}_in",
    )
    axes.plot(
        *places[~inside].T,
        "X",
        color=FAILURE,
        markersize=6.5,
        linestyle="none",
        zorder=3,
        label="landing, out" if not inside.all() else None,
        gid=f"{gid}_out",
    )


SIDE = 0.035
"""Half the edge of the square that stands for a body [m]."""


@house_style()
def trials_figure(
    trials: Sequence[TrialResult],
    skill: Skill,
    shown: Sequence[Demonstration],
    narrow: bool = False,
) -> Figure:
    """The figure.

    Parameters
    ----------
    trials
        In order; without any, the panel of their errors is left out.
    shown
        What was learned from.
    narrow
        Its panels stand one below the other.

    Raises
    ------
    ValueError
        Where nothing was shown and nothing tried.
    """
    if not shown and not trials:
        raise ValueError("no demonstrations and no trials: there is nothing to draw")
    sizes = [(4.3, 4.6), (3.45, 3.6 if narrow else 4.6), (2.75, 2.4 if narrow else 4.6)]
    figure, axes = panels(sizes if trials else sizes[:2], narrow)
    above, side, *errors = axes
    ways = []  # of the hand between the first and the last instant of each demonstration
    for one in shown:
        start, stop = skill.cut(one)
        ways.append(one.hand_position[(one.hand_time >= start) & (one.hand_time <= stop)])
    _draw_above(above, trials, skill, shown, ways)
    for hand in ways:
        steps = np.linalg.norm(np.diff(hand[:, :2], axis=0), axis=1)
        way = np.concatenate([[0.0], np.cumsum(steps)])
        side.plot(way, hand[:, 2], color=DEMONSTRATION, linewidth=1.0)
    side.set(title=f"Height of the {HAND}, shown", xlabel="way over the floor [m]", ylabel="z [m]")
    for panel in errors:
        _draw_errors(panel, trials)
    letter_panels(*axes)
    handles, labels = above.get_legend_handles_labels()
    legend_below(figure, handles, labels, len(labels), narrow)
    return figure


def _draw_above(
    axes: Axes,
    trials: Sequence[TrialResult],
    skill: Skill,
    shown: Sequence[Demonstration],
    ways: Sequence[np.ndarray],
) -> None:
    axes.plot(0.0, 0.0, "s", color=BLACK, markersize=8, label="arm", gid="arm")
    for number, (one, hand) in enumerate(zip(shown, ways, strict=True)):
        axes.plot(
            hand[:, 0],
            hand[:, 1],
            color=DEMONSTRATION,
            linewidth=1.0,
            label=None if number else "hand, shown",
        )
        for role in skill.bodies[1:] or skill.bodies:  # the first is moved, if there are others
            pose = one.track(role).pose_at(float(one.hand_time[0]))
            _draw_body(
                axes, pose, DEMONSTRATION, "" if number else f"{role}, shown", linestyle="--"
            )
    labelled: set[str] = set()
    for number, trial in enumerate(trials, start=1):
        colour = SUCCESS if trial.success else FAILURE
        for role, pose in trial.situation.poses.items():
            what = f"{role}, {'done' if trial.success else 'failed'}"
            _draw_body(axes, pose, colour, "" if what in labelled else what)
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


def _draw_errors(axes: Axes, trials: Sequence[TrialResult]) -> None:
    for number, trial in enumerate(trials, start=1):
        if trial.error_m is not None:
            colour = SUCCESS if trial.success else FAILURE
            axes.bar(number, 1e3 * trial.error_m, color=colour, width=0.7)
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
    axes.set_xlim(0.4, len(trials) + 0.6)  # a mark does not widen it
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
