"""The farthest throw of an arm, seen from the side."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from dart_skill.common.constants import GRAVITY
from dart_skill.figures._style import BALL, BASKET, BLACK, GREY, house_style

if TYPE_CHECKING:
    from dart_skill.arm import ThrowingBound, UrdfArm

POSTURES = 5
"""Number of postures of the swing that are drawn, the last at the release."""
INSTANTS = 60
"""Number of points of the flight."""


def throwing_bound_figure(arm: UrdfArm, bound: ThrowingBound, rim: float) -> Figure:
    """The postures of the swing and the flight of the ball, in the plane of the swing.

    Parameters
    ----------
    bound
        The throw of the arm.
    rim
        Height of the rim above the floor [m].
    """
    share = np.linspace(0.0, 1.0, POSTURES)[:, None] ** 2
    swing = bound.start + share * (bound.angles - bound.start)
    places = bound.plane.places(swing[:, bound.plane.joints])
    side = np.sign(places[-1, -1, 0] * bound.release[0])
    ways = np.cos(bound.angle) * bound.speed
    rise = np.sin(bound.angle) * bound.speed
    time = np.linspace(0.0, (bound.distance - bound.release[0]) / ways, INSTANTS)
    height = bound.release[1] + rise * time - 0.5 * GRAVITY * time**2
    with house_style():
        figure = Figure(figsize=(7.2, 4.2), layout="constrained")
        axes = figure.subplots()
        base = [[0.0, arm.mount_height]]
        for number, chain in enumerate(places, start=1):
            chain = np.vstack([base, chain * [side, 1.0]])
            last = number == POSTURES
            axes.plot(*chain.T, "o-", color=BLACK if last else GREY, ms=3, lw=2 if last else 1)
        axes.plot(bound.release[0] + ways * time, height, color=BALL)
        axes.plot([bound.distance - 0.15, bound.distance + 0.15], [rim, rim], color=BASKET, lw=3)
        axes.set(
            aspect="equal",
            xlabel="from the axis of the base [m]",
            ylabel="above the floor [m]",
            ylim=(0.0, None),
            title=f"{arm.name}: {bound.distance:.2f} m, {bound.speed:.1f} m/s",
        )
    return figure
