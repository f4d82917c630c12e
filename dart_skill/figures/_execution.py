"""Figure `execution`: one throw from the side. Where the attractor went, where the hand was
expected and where the cameras saw it.

All of it in the vertical plane through the base axis and the basket; the tracking error has all
three dimensions.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.arm import MotionPlan, the_arm
from dart_skill.figures._style import (
    ATTRACTOR,
    BALL,
    BLACK,
    GREEN,
    GREY,
    HAND,
    LIGHT,
    PLANNED,
    RELEASE,
    SKY,
    basket_from_the_side,
    house_style,
    legend_below,
    letter_panels,
    panels,
    unit_along,
)
from dart_skill.figures._synchronisation import SAME_BASKET, HandRecording
from dart_skill.simulation import Basket

FLIGHT_WATCHED = 1.0
"""The ball is drawn so long after its release [s]."""
FOLLOWED = 0.05
"""The tracking error is drawn so long after the release [s]: from then on nothing depends on it.
"""


@dataclass(frozen=True, eq=False)
class ExecutedThrow:
    """A plan and what the cameras saw of it, on the clock of the plan's path [s], frame world [m].

    Parameters
    ----------
    hand_time : (n,)
        Hand frame.
    hand_position : (n, 3)
        Hand frame.
    ball_time : (m,)
        The ball from its release on.
    ball_position : (m, 3)
        The ball from its release on.
    """

    plan: MotionPlan
    hand_time: np.ndarray
    hand_position: np.ndarray
    ball_time: np.ndarray
    ball_position: np.ndarray

    @property
    def tracking_error(self) -> np.ndarray:
        """(n, 2): along the planned motion, positive ahead of the plan, and distance beside it
        [m].
        """
        path = self.plan.path
        expected = _interpolated(self.hand_time, path.time, path.position)
        velocity = _interpolated(self.hand_time, path.time, path.velocity[:, :3])
        direction = velocity / np.maximum(np.linalg.norm(velocity, axis=1, keepdims=True), 1e-9)
        error = self.hand_position - expected
        along = np.einsum("ij,ij->i", error, direction)
        return np.column_stack([along, np.linalg.norm(error - along[:, None] * direction, axis=1)])


def executed_throw(recordings: Sequence[HandRecording], plan: MotionPlan) -> ExecutedThrow:
    """The last recording in which the arm threw at the plan's target.

    Raises
    ------
    ValueError
        If there is none.
    """
    found = [
        (one, one.opened_ns)
        for one in recordings
        if one.opened_ns is not None
        and np.linalg.norm(one.basket - plan.thrown.target) < SAME_BASKET
    ]
    if not found:
        place = plan.thrown.target.round(3).tolist()
        raise ValueError(
            f"no recording of a throw at a basket at {place}: is /wam/command in the bag, and did"
            " it open the hand?"
        )
    (recording, opened_ns), path = found[-1], plan.path
    start_ns = plan.begin_ns(opened_ns, recording.command_stamps)
    hand_time, ball_time = (
        (stamps - start_ns) * 1e-9 for stamps in (recording.hand_stamps, recording.ball_stamps)
    )
    hand = (hand_time >= 0.0) & (hand_time <= path.duration)
    ball = (ball_time >= plan.release) & (ball_time <= plan.release + FLIGHT_WATCHED)
    return ExecutedThrow(
        plan,
        hand_time[hand],
        recording.hand_position[hand],
        ball_time[ball],
        recording.ball_position[ball],
    )


@house_style()
def execution_figure(
    throw: ExecutedThrow, basket: Basket | None = None, narrow: bool = False
) -> Figure:
    """The figure.

    Parameters
    ----------
    throw
        What was planned and what was done.
    basket
        Its size, the one of the simulator by default.
    narrow
        Its panels stand one below the other.
    """
    figure, (side, error) = panels([(6.4, 4.6), (4.1, 3.4 if narrow else 4.6)], narrow)
    _draw_side(side, throw, basket or Basket())
    _draw_error(error, throw)
    (handles, labels), (more, others) = (
        axes.get_legend_handles_labels() for axes in (side, error)
    )
    letter_panels(side, error)
    legend_below(figure, [*handles, *more], [*labels, *others], 5, narrow)
    return figure


def _draw_side(axes: Axes, throw: ExecutedThrow, basket: Basket) -> None:
    plan = throw.plan
    azimuth = float(np.arctan2(plan.thrown.target[1], plan.thrown.target[0]))
    forward = unit_along(azimuth)

    def seen(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return points[:, :2] @ forward, points[:, 2]

    # The floor, the stand with the base axis, and the shoulder.
    shoulder = the_arm().shoulder[2]
    axes.axhline(0.0, color=LIGHT, linewidth=1.0, zorder=0)
    axes.plot(
        [0.0, 0.0],
        [0.0, shoulder],
        color=LIGHT,
        linewidth=4.0,
        solid_capstyle="butt",
        zorder=0,
        gid="arm",
    )
    axes.plot(0.0, shoulder, "o", color=GREY, markersize=6, zorder=0)
    axes.annotate(
        "shoulder", (0.0, shoulder), xytext=(8, -3), textcoords="offset points", color=GREY
    )
    basket_from_the_side(
        axes,
        float(plan.thrown.target[:2] @ forward),
        float(plan.thrown.target[2]),
        basket.radius,
        basket.depth,
    )
    axes.plot(
        *seen(plan.attractor_position),
        color=ATTRACTOR,
        linestyle="--",
        linewidth=1.3,
        label="attractor",
        gid="attractor",
    )
    axes.plot(
        *seen(plan.path.position),
        color=PLANNED,
        linewidth=3.6,
        label="hand, planned",
        gid="planned",
    )
    axes.plot(
        *seen(throw.hand_position), color=HAND, linewidth=1.2, label="hand, seen", gid="hand"
    )
    if len(throw.ball_time):
        axes.plot(
            *seen(throw.ball_position),
            ".",
            color=BALL,
            markersize=3.5,
            label="ball, seen",
            gid="ball",
        )
    release = _interpolated(np.array([plan.release]), plan.path.time, plan.path.position)
    axes.plot(
        *seen(release),
        "D",
        color=RELEASE,
        markeredgecolor=BLACK,
        markersize=5.5,
        label="release, planned",
        gid="release",
    )
    axes.plot(
        *seen(plan.thrown.landing[None]),
        "x",
        color=BLACK,
        markersize=8,
        markeredgewidth=2,
        linestyle="none",
        label="landing, planned",
        gid="predicted_landing",
    )
    axes.set_aspect("equal", adjustable="datalim")
    distance = np.hypot(plan.thrown.target[0], plan.thrown.target[1])
    axes.set(
        xlabel="forward, in the plane of the throw [m]",
        ylabel="height [m]",
        title=f"Throw at a basket at {distance:.2f} m, {np.degrees(azimuth):+.0f}°",
    )


def _draw_error(axes: Axes, throw: ExecutedThrow) -> None:
    time = throw.hand_time - throw.plan.release
    drawn = time <= FOLLOWED
    along, beside = 1e3 * throw.tracking_error[drawn].T
    time, total = time[drawn], np.hypot(along, beside)
    axes.axhline(0.0, color=LIGHT, linewidth=0.8, zorder=0)
    axes.axvline(0.0, color=RELEASE, linewidth=1.0, zorder=0)
    axes.plot(time, total, color=BLACK, linewidth=1.8, label="error, total", gid="error_total")
    axes.plot(
        time, along, color=SKY, linewidth=1.6, label="along the motion, + ahead", gid="error_along"
    )
    axes.plot(
        time,
        beside,
        color=GREEN,
        linewidth=1.2,
        linestyle="--",
        label="beside it",
        gid="error_beside",
    )
    axes.margins(y=0.12)
    axes.annotate("release", (0.0, 1.0), xycoords=("data", "axes fraction"), xytext=(-4, -10), textcoords="offset points",
                  color=RELEASE, ha="right")  # fmt: skip
    largest = total[time <= 0.0].max(initial=0.0)
    axes.set(
        title=(
            f"Tracking error of the hand: {np.interp(0.0, time, total):.1f} mm at the\nrelease, at"
            f" most {largest:.1f} mm before it"
        ),
        xlabel="time since the planned release [s]",
        ylabel="hand seen minus planned [mm]",
    )


def _interpolated(at: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(at, time, column) for column in values.T])
