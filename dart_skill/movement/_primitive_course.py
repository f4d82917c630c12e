"""A discrete primitive that the state of the robot drives, from one task frame to another, both of
which may move.

(7.8) is linear. So a movement from x0 to g that was shown with kernels theta is, at the time s of
the pace that was shown,

    x(s) = x0 + b(s) (g - x0) + R r(s),

where b(s) is what (7.8) makes of its goal path from 0 to 1, r(s) what it makes of f(z) (7.10) alone,
and R the axes of the frame in which the goal stands. x0 and g are taken from the frames of now. The
state of the robot acts on the clock (7.6), as C of (7.5): it changes the rate of s (`PhaseRule`) by
how far the robot is ahead along x'(s),

    d = x'(s) (x - x(s)) / (x'(s)^2 + sigma(s)^2 / w^2),

which is the correction of `AutonomousDSGMR` for a spread sigma that is equal in all directions, and
without the speed of the robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.pace import PhaseRule
from dart_skill.movement._attractor import critical_damping
from dart_skill.movement._autonomous import Moment, StateFrame
from dart_skill.movement._forcing import blend, within
from dart_skill.movement._frames import MovingFrame
from dart_skill.movement._primitives import DiscretePrimitive

DEVIATION = 0.05
"""w of the correction for a plan that is made beforehand [s], that of `PhaseRule`."""
LATEST_BEGIN = 0.6
"""Latest begin of a window of the goal that is chosen, as a share of the duration."""
LEAST_WINDOW = 0.2
"""Least length of such a window."""
WINDOW_STEP = 0.025
"""Between the windows among which one is chosen."""


def ahead_gain(
    velocity: np.ndarray, spread: ArrayLike, deviation: float = DEVIATION
) -> np.ndarray:
    """What a difference of the position is ahead by [s/m] (..., d): x' / (x'^2 + sigma^2 / w^2).

    Parameters
    ----------
    velocity
        x' (..., d) [m/s].
    spread
        sigma (...,) [m].
    deviation
        w [s].
    """
    return (
        velocity
        / (np.square(velocity).sum(-1) + np.square(np.asarray(spread) / deviation))[..., None]
    )


class SeenMovement(NamedTuple):
    """A movement as the last frame sees it, which may move: position (m, 3) [m], and the way of
    that frame since the beginning, in its own axes (m, 3) [m].
    """

    position: np.ndarray
    carried: np.ndarray

    @classmethod
    def among(cls, position: np.ndarray, axes: np.ndarray, origin: np.ndarray) -> SeenMovement:
        """From positions in the world (m, 3), and axes (m, 3, 3) and origin (m, 3) of that frame."""
        parts = (position - origin, origin - origin[0])
        return cls(*(np.einsum("nji,nj->ni", axes, part) for part in parts))

    def at_rest(self, share: np.ndarray) -> np.ndarray:
        """The movement (m, 3) [m] if the frame had stayed where it was at the beginning: without
        the share b (m,) of its way.
        """
        return self.position + (1.0 - share)[:, None] * self.carried


def goal_share(progress: np.ndarray, window: tuple[float, float]) -> np.ndarray:
    """b (m,) of a primitive whose smooth goal path has a window, at time in units of the duration
    (m,): (7.8) follows the attractor (7.20) of just this path.
    """
    return blend(within(progress, window))


def choose_goal_window(
    progress: np.ndarray, movements: Sequence[SeenMovement]
) -> tuple[float, float]:
    """When the goal of a primitive moves from the start to the goal (`goal_window`), so that as
    little as possible is left to f(z): of several movements, of what they do not have in common.

    A start or goal that is elsewhere changes a movement by b(s) of it. So the window says until
    when the way may be another one, which one movement tells by where it goes on its way, and
    several by where they differ.

    Parameters
    ----------
    progress
        Time in units of the duration (m,), the same for all.
    """

    def left(window: tuple[float, float]) -> float:
        share = goal_share(progress, window)
        rows = np.array([one.at_rest(share) for one in movements])
        rows = rows - rows[:, :1] - share[:, None] * (rows[:, -1:] - rows[:, :1])
        return float(np.square(rows - (rows.mean(0) if len(rows) > 1 else 0.0)).sum())

    begins = np.arange(0.0, LATEST_BEGIN + 1e-9, WINDOW_STEP)
    ends = np.arange(LEAST_WINDOW, 1.0 + 1e-9, WINDOW_STEP)
    pairs = [(float(a), float(b)) for a in begins for b in ends if b >= a + LEAST_WINDOW - 1e-9]
    return min(((a, min(b, 1.0)) for a, b in pairs), key=left)


class FrameMotion(NamedTuple):
    """A frame at one instant: axes (3, 3), position, velocity and acceleration (3,) of its origin
    [m], [m/s], [m/s^2].
    """

    axes: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True, eq=False)
class PrimitiveCourse:
    """The answers b and r of a fitted primitive, with which `ReactivePolicy` may be asked.

    Parameters
    ----------
    time
        (n,) [s], equally spaced from 0 on, at the pace that was shown.
    share
        (n, 3): b, and its first and second derivative by time.
    rest
        (n, 3, d): r, and its derivatives. The first three columns are the position [m].
    goal
        (d,), as the last frame sees it.
    spread
        (n,), standard deviation in each direction of what was shown about the course [m].
    stiffness
        Of the arm's spring-damper (7.19) [1/s^2], critically damped.
    rule
        How the state changes the phase.
    """

    time: np.ndarray
    share: np.ndarray
    rest: np.ndarray
    goal: np.ndarray
    spread: np.ndarray
    stiffness: float
    rule: PhaseRule

    n_inputs = 0

    @property
    def ends(self) -> tuple[float, float]:
        """First and last phase [s]."""
        return float(self.time[0]), float(self.time[-1])

    @property
    def damping(self) -> float:
        """Critical, for the stiffness [1/s]."""
        return float(critical_damping(self.stiffness))

    def arrays(self) -> dict[str, np.ndarray]:
        """All that was fitted, by name."""
        return {
            one.name: getattr(self, one.name)
            for one in fields(self)
            if one.name not in ("stiffness", "rule")
        }

    def moment(
        self, frames: Sequence[StateFrame], phase: float, inputs: ArrayLike | None = None
    ) -> Moment:
        """What belongs to one phase [s], in frames as they are now.

        Parameters
        ----------
        frames
            Over [t, x, y, z]. The movement leads from the first to the last.
        inputs
            None: a primitive has none.
        """
        share, rest, spread = self._at(phase)
        first, last = (self.frame_motion(frames[k]) for k in (0, -1))
        (b, db, ddb), (r, dr, ddr) = share, rest[:, :3] @ last.axes.T
        way = last.position + last.axes @ self.goal[:3] - first.position
        faster = last.velocity - first.velocity
        velocity, acceleration = db * way + dr, ddb * way + ddr + db * faster
        position = first.position + b * way + r
        whole = velocity + first.velocity + b * faster
        pulled = acceleration + db * faster + (1.0 - b) * first.acceleration
        pulled = pulled + b * last.acceleration
        gain = ahead_gain(velocity, spread, self.rule.deviation)
        return Moment(
            np.concatenate([position, whole]),
            position + (self.damping * whole + pulled) / self.stiffness,
            np.concatenate([gain, np.zeros(3)]),
            np.square(spread) * np.eye(3),
            pulled,
            np.concatenate([velocity, acceleration]),
        )

    def frame_motion(self, frame: StateFrame) -> FrameMotion:
        """Axes and motion of a frame, whose acceleration (7.19) makes of its attractor."""
        assert frame is not None, "a primitive leads from one frame to another"
        still = np.zeros(3)
        if not isinstance(frame, MovingFrame):
            return FrameMotion(frame.A[-3:, -3:], frame.b[-3:], still, still)
        at, velocity = frame.frame.b[-3:], frame.velocity
        acceleration = self.stiffness * (frame.attractor - at) - self.damping * velocity
        return FrameMotion(frame.frame.A[-3:, -3:], at, velocity, acceleration)

    def _at(self, phase: float) -> tuple[np.ndarray, np.ndarray, float]:
        place = np.clip(phase / self.time[1], 0.0, len(self.time) - 1.0)
        k = min(int(place), len(self.time) - 2)
        return tuple(
            rows[k] + (place - k) * (rows[k + 1] - rows[k])
            for rows in (self.share, self.rest, self.spread)
        )


def answers(primitive: DiscretePrimitive, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """b (n, 3) and r (n, 3, d) of a fitted primitive, with derivatives, at instants (n,) [s] from 0
    on (7.8).
    """
    n, d = len(time), primitive.n_dims
    still, one = np.zeros(d), np.ones(d)
    unforced = primitive.with_parameters(np.zeros(len(primitive.parameters)))
    led = unforced.open_loop(time, unforced.begin(still, goal=one, velocity=still))
    forced = primitive.open_loop(time, primitive.begin(still, goal=still, velocity=still))
    share, rest = (
        np.stack([made.position, made.velocity, made.acceleration], axis=1)
        for made in (led, forced)
    )
    assert rest.shape == (n, 3, d)
    return share[:, :, 0], rest
