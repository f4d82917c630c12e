"""How figures 8.6 to 8.10 show throws: paths of the hand with gripper frames, from above and from
the side, and the angles of the hand.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from dart_skill.common.regions import REGION
from dart_skill.experiments.thesis.ball_throws import Angles, DrawnThrow
from dart_skill.figures import (
    BALL,
    BASKET,
    BLACK,
    DEMONSTRATION,
    GREEN,
    HAND,
    PURPLE,
    RIM_RADIUS,
    SKY,
    basket_from_above,
    quantity_colours,
    unit_along,
)
from dart_skill.movement import rotate

TRIAD = 0.09
"""Length of the axes of a gripper frame [m]."""
TRIAD_COLOURS = (PURPLE, GREEN, SKY)
ABOVE, SIDE = (-1.1, 2.75, -1.6, 1.6), (-1.1, 2.75, 0.25, 2.45)
"""Limits of the two views [m]."""


def trajectory_panels(figure: Figure, n_columns: int) -> np.ndarray:
    """Axes (2, n): the view from above over the one from the side, to one scale."""
    heights = [one[3] - one[2] for one in (ABOVE, SIDE)]
    panels = figure.subplots(2, n_columns, height_ratios=heights, sharey="row", squeeze=False)
    for above, side in panels.T:
        above.set(aspect="equal", xlim=ABOVE[:2], ylim=ABOVE[2:], xlabel="x, front of the arm [m]")
        side.set(
            aspect="equal",
            xlim=SIDE[:2],
            ylim=SIDE[2:],
            xlabel="forward, in the plane of the throw [m]",
        )
    panels[0, 0].set_ylabel("y [m]")
    panels[1, 0].set_ylabel("height [m]")
    return panels


def draw_trajectories(
    column: np.ndarray, trajectories: list[DrawnThrow], gid: str, new: bool = False
) -> None:
    """Throws in a column (2,) of panels.

    Parameters
    ----------
    new
        At a target that was not demonstrated.
    """
    for axes, above in zip(column, (True, False), strict=True):
        for number, one in enumerate(trajectories, start=1):
            name = f"{gid}_{'above' if above else 'side'}_{number}"
            _draw_trajectory(
                axes, one, above, name, new, every=0.1 if len(trajectories) < 5 else 0.24
            )
    column[0].plot(0.0, 0.0, "s", color=BLACK, markersize=6)


def trajectory_legend(figure: Figure, n_columns: int) -> None:
    """What is what, below the panels."""
    dot: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 4.5}
    entries = [
        Line2D([], [], color=DEMONSTRATION, linewidth=1.4, label="hand, demonstrated"),
        Line2D([], [], color=HAND, linewidth=1.4, label="hand, planned"),
        Line2D([], [], color=BALL, linewidth=1.0, label="ball"),
    ]
    entries += [
        Line2D([], [], color=colour, label=f"gripper's {name}")
        for name, colour in zip("xyz", TRIAD_COLOURS, strict=True)
    ]
    entries += [
        Line2D([], [], color=colour, label=name, **dot)
        for colour, name in ((DEMONSTRATION, "basket, demonstrated"), (BASKET, "basket, new"))
    ]
    entries += [Line2D([], [], color=BLACK, linestyle="none", marker="s", label="arm")]
    figure.legend(handles=entries, loc="outside lower center", ncols=n_columns)


def _draw_trajectory(
    axes: Axes, one: DrawnThrow, above: bool, gid: str, new: bool, every: float
) -> None:
    hand, basket = (HAND, BASKET) if new else (DEMONSTRATION, DEMONSTRATION)
    forward = unit_along(float(np.arctan2(one.target[1], one.target[0])))

    def seen(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return (points[:, 0], points[:, 1]) if above else (points[:, :2] @ forward, points[:, 2])

    axes.plot(*seen(one.flight), color=BALL, linewidth=0.7, alpha=0.7, zorder=1, gid=f"{gid}_ball")
    axes.plot(*seen(one.position), color=hand, linewidth=1.1, zorder=2, gid=f"{gid}_hand")
    k = np.searchsorted(one.time, np.arange(one.time[0], one.time[-1], every))
    for unit, shade in zip(np.eye(3), TRIAD_COLOURS, strict=True):
        ends = one.position[k] + TRIAD * rotate(one.quaternion[k], unit[None])
        pairs = zip(seen(one.position[k]), seen(ends), strict=True)
        axes.plot(*(_strokes(*pair) for pair in pairs), color=shade, linewidth=0.9, zorder=3)
    axes.plot(
        *seen(one.target[None]), "o", color=basket, markersize=4.5, zorder=4, gid=f"{gid}_target"
    )
    if above:
        basket_from_above(
            axes,
            one.target,
            RIM_RADIUS,
            facecolor="none",
            edgecolor=basket,
            linewidth=0.6,
            alpha=0.7,
        )


def _strokes(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Coordinates of separate strokes as one line with gaps."""
    return np.column_stack([starts, ends, np.full(len(starts), np.nan)]).ravel()


def draw_angles(figure: Figure, columns: dict[str, Angles]) -> None:
    """alpha over beta, one column per title, coloured by the azimuth of the target, with the mean
    and the spread over the throws.
    """
    side = np.rad2deg(REGION.side)
    shades = ScalarMappable(Normalize(-side, side), quantity_colours())
    panels = figure.subplots(2, len(columns), sharex=True, sharey="row", squeeze=False)
    for number, (column, (title, angles)) in enumerate(
        zip(panels.T, columns.items(), strict=True), start=1
    ):
        for k, (axes, name) in enumerate(zip(column, ("alpha", "beta"), strict=True)):
            _draw_angle(axes, angles, k, shades, f"{name}_{number}")
            spread, at_release = (
                np.rad2deg(value[k]) for value in (angles.spread, angles.spread_at_release)
            )
            axes.annotate(
                f"{name}: s.d. {spread:.1f}°, at the release {at_release:.1f}°",
                (0.02, 1.0),
                xycoords="axes fraction",
                # fmt: skip
                va="bottom",
                xytext=(0, 2),
                textcoords="offset points",
                fontsize=8.5,
            )
        column[0].set_title(title, pad=20)
        column[1].set_xlabel("time since the motion began [s]")
    panels[0, 0].set_ylabel("alpha [°]")
    panels[1, 0].set_ylabel("beta [°]")
    figure.colorbar(shades, ax=panels, label="azimuth of the target [°]", aspect=40, pad=0.02)


def _draw_angle(axes: Axes, angles: Angles, k: int, shades: ScalarMappable, gid: str) -> None:
    values = np.rad2deg(angles.values[:, :, k])
    mean, deviation = values.mean(axis=0), values.std(axis=0)
    axes.fill_between(
        angles.time, mean - deviation, mean + deviation, color=SKY, alpha=0.3, linewidth=0
    )
    for number, (one, azimuth, release) in enumerate(
        zip(values, angles.azimuths, angles.releases, strict=True), start=1
    ):
        colour = shades.to_rgba(np.rad2deg(azimuth))
        axes.plot(angles.time, one, color=colour, linewidth=1.1, gid=f"{gid}_{number}")
        at_release = np.interp(release, angles.time, one)
        axes.plot(
            release,
            at_release,
            "D",
            color=colour,
            markeredgecolor=BLACK,
            markeredgewidth=0.5,
            markersize=4,
        )
