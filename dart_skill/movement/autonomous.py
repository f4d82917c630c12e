"""Autonomous DS-GMR: the state of the robot drives the movement, not the clock (thesis chapter 9).

An attractor y(x, x') that is regressed on the state alone can get stuck. Where the demonstrations rest before they move,
it asks for no motion. Where a path comes near itself (wind-up and throw), it mixes both passes. Therefore the state acts
through the phase s [s], the place of the robot along the movement. Regression of the mixture over [t, x, x', y] on t gives
the state z(s) that belongs to a phase, with covariance R(s), and the attractor y(s). The state changes the phase by

    s' = clip(1 + d / T, slowest, fastest),    d = z_s' R^-1 (z - z(s)) / (z_s' R^-1 z_s + 1 / w^2),    z_s = dz(s)/ds.

d [s] is how far the state is ahead of the phase: it is the correction of an extended Kalman filter for s with standard
deviation w. R contains the spread of the demonstrations and the uncertainty of the pace, so that a robot that is slow
because it is held back is not taken to be at the end of the movement. Then (7.19) follows y(s).

The system has no clock. If the robot is held back, the movement waits. If it is pushed ahead, the movement skips a part.
It reaches the goal from every start: since s' >= slowest > 0, s reaches its end in finite time; from then on y is
constant, and (7.19) with a constant attractor is a stable linear system.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..mixture import regress
from ..mixture._checks import as_count, as_number, as_samples, as_vector
from ._time import as_stamps
from .attractor import as_gains, attractor_from_motion, critical_damping, discretise
from .differentiation import Motion
from .frames import TaskFrame
from .task_parameterised import TaskParameterisedMixture

UNKNOWN_PACE = 1.0
"""Standard deviation of the robot's pace, relative to the demonstrated one."""
Push = Callable[[float, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class StateDriven:
    """A movement of an autonomous policy.

    time (n,) [s]; phase (n,) [s]; attractor, position, velocity and acceleration (n, d), in the units of the movement.
    """

    time: np.ndarray
    phase: np.ndarray
    attractor: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True)
class PhaseRule:
    """How the state changes the phase.

    Parameters:

    * slowest: float in (0, 1), default 0.05. Least rate s' of the phase; 1 is the demonstrated pace.
    * fastest: float above 1, default 4. Largest rate of the phase.
    * time_constant: float, default 0.05 [s]. T of the correction.
    * deviation: float, default 0.05 [s]. w, standard deviation of the phase in the correction.
    """

    slowest: float = 0.05
    fastest: float = 4.0
    time_constant: float = 0.05
    deviation: float = 0.05

    def __post_init__(self):
        for name in ("slowest", "fastest", "time_constant", "deviation"):
            as_number(getattr(self, name), name)
        if not self.slowest < 1.0 < self.fastest:
            raise ValueError(f"slowest {self.slowest} and fastest {self.fastest} must lie on either side of 1, the demonstrated pace")


class AutonomousDSGMR:
    """DS-GMR over d movement variables that is driven by the state (x, x') instead of a clock.

    Parameters:

    * n_components: int, number of components of the mixture.
    * stiffness: one number or (d,), default 200 [1/s^2]. kp of (7.19).
    * damping: one number or (d,) [1/s], default None: critical, 2 sqrt(kp).
    * rule: PhaseRule, how the state changes the phase; default None: its defaults.
    * mixture_options: hyper-parameters of `TaskParameterisedMixture`.

    Attribute after `fit`: mixture_, the fitted TaskParameterisedMixture over [t, x, x', y].
    """

    def __init__(
        self,
        n_components: int,
        stiffness: ArrayLike = 200.0,
        damping: ArrayLike | None = None,
        rule: PhaseRule | None = None,
        **mixture_options,
    ):
        self.stiffness = as_gains(stiffness, None, "stiffness", strict=True)
        self.damping = critical_damping(self.stiffness) if damping is None else as_gains(damping, None, "damping", strict=False)
        self.rule = rule or PhaseRule()
        self._mixture = TaskParameterisedMixture(n_components, **mixture_options)

    def fit(
        self,
        times: Sequence[ArrayLike],
        motions: Sequence[Motion],
        frames: Sequence[Sequence[TaskFrame]],
        weights: Sequence | None = None,
        *,
        rng: np.random.Generator | None = None,
    ) -> AutonomousDSGMR:
        """Learn from motions (n_i, d) at stamps (n_i,), as `smooth_derivatives` returns them; returns self.

        frames: for each demonstration P frames of the features [t, y], as in `DSGMR.fit`; weights and rng as there.
        """
        if not len(times) == len(motions) == len(frames):
            raise ValueError(f"times, motions and frames must be as many, got {len(times)}, {len(motions)} and {len(frames)}")
        samples = [self._features(time, motion) for time, motion in zip(times, motions, strict=True)]
        lifted = [[lift(frame) for frame in its_frames] for its_frames in frames]
        self.mixture_ = self._mixture.fit(samples, lifted, weights, rng=rng)
        self._ends = np.array([(np.min(time), np.max(time)) for time in times]).mean(0)
        return self

    def _features(self, time: ArrayLike, motion: Motion) -> np.ndarray:
        attractor = attractor_from_motion(*motion, self.stiffness, self.damping)
        return np.column_stack([as_stamps(time, len(attractor)), motion.position, motion.velocity, attractor])

    def policy(self, frames: Sequence[TaskFrame], resolution: int = 400) -> AutonomousPolicy:
        """The policy for new frames; resolution: number of phases at which it is computed beforehand."""
        if not hasattr(self, "mixture_"):
            raise ValueError("this AutonomousDSGMR holds no model yet; call fit first")
        phase = np.linspace(*self._ends, as_count(resolution, "resolution", 10))
        mean, covariance = regress(
            self.mixture_.product([lift(frame) for frame in frames]), phase[:, None], [0], np.arange(1, self.mixture_.n_dims)
        )
        d = (self.mixture_.n_dims - 1) // 3
        state, spread = mean[:, : 2 * d], covariance[:, : 2 * d, : 2 * d]
        return AutonomousPolicy(phase, state, spread, mean[:, 2 * d :], self.stiffness, self.damping, self.rule)

    def reproduce(
        self,
        frames: Sequence[TaskFrame],
        position0: ArrayLike,
        velocity0: ArrayLike,
        *,
        step: float = 0.002,
        duration: float,
        push: Push | None = None,
    ) -> StateDriven:
        """Movement in new frames from position0 and velocity0 (d,), for `duration` [s]; push as in `AutonomousPolicy.run`."""
        return self.policy(frames).run(position0, velocity0, step=step, duration=duration, push=push)


class AutonomousPolicy:
    """The policy for one situation, made by `AutonomousDSGMR.policy`.

    `locate` finds the phase of a state, `advance` changes the phase over a step, and `attractor` gives y at a phase.

    Parameters:

    * phase (n,): equally spaced phases [s].
    * state (n, 2d): position and velocity that belong to each phase.
    * spread (n, 2d, 2d): covariance of the state.
    * attractors (n, d): y at each phase.
    * stiffness, damping: gains of (7.19), one number or (d,) [1/s^2, 1/s].
    * rule: PhaseRule.
    """

    def __init__(self, phase, state, spread, attractors, stiffness, damping, rule: PhaseRule):
        self.phase, self.state, self.attractors, self.rule = phase, state, attractors, rule
        d = attractors.shape[1]
        self._kp, self._kv = np.broadcast_to(stiffness, d), np.broadcast_to(damping, d)
        slower = np.hstack([np.zeros_like(attractors), UNKNOWN_PACE * state[:, d:]])
        self._precision = np.linalg.inv(spread + slower[:, :, None] * slower[:, None])
        slope = np.gradient(state, phase, axis=0)
        weighted = np.einsum("nij,nj->ni", self._precision, slope)
        self._gain = weighted / (np.einsum("ni,ni->n", weighted, slope) + rule.deviation**-2)[:, None]

    @property
    def goal(self) -> np.ndarray:
        """Where the movement ends (d,)."""
        return self.attractors[-1]

    def locate(self, position: ArrayLike, velocity: ArrayLike) -> float:
        """Phase [s] whose state is nearest to position and velocity (d,), by Mahalanobis distance; the earliest of equals."""
        error = self._as_state(position, velocity) - self.state
        return float(self.phase[np.argmin(np.einsum("ni,nij,nj->n", error, self._precision, error))])

    def advance(self, phase: float, position: ArrayLike, velocity: ArrayLike, step: float) -> float:
        """Phase [s] a `step` [s] later, for a robot with this position and velocity (d,)."""
        return self._advanced(phase, self._as_state(position, velocity), as_number(step, "step"))

    def attractor(self, phase: float) -> np.ndarray:
        """Attractor (d,) at a phase [s]; constant before the start and after the end of the movement."""
        return self._at(self.attractors, phase)

    def acceleration(self, phase: float, position: ArrayLike, velocity: ArrayLike) -> np.ndarray:
        """(7.19) at a phase: kp (y - x) - kv x' (d,)."""
        state = self._as_state(position, velocity)
        d = len(self._kp)
        return self._kp * (self.attractor(phase) - state[:d]) - self._kv * state[d:]

    def run(
        self, position0: ArrayLike, velocity0: ArrayLike, *, step: float = 0.002, duration: float, push: Push | None = None
    ) -> StateDriven:
        """Movement of a unit mass (7.19) in place of the robot, from position0 and velocity0 (d,), for `duration` [s].

        push: function of time, position and velocity that returns an acceleration (d,) from outside, in units of the
        movement per s^2; it is constant over a step. Each step is exact for an attractor that is linear in between.
        """
        step, n_steps = as_number(step, "step"), round(as_number(duration, "duration") / as_number(step, "step"))
        d = len(self._kp)
        states, phases = np.empty((n_steps + 1, 2 * d)), np.empty(n_steps + 1)
        states[0] = self._as_state(position0, velocity0)
        phases[0] = self.locate(states[0, :d], states[0, d:])
        pushes = np.zeros((n_steps + 1, d))
        flow = _flow(step, self._kp, self._kv)
        for k in range(n_steps):
            if push is not None:
                pushes[k] = as_vector(push(k * step, states[k, :d].copy(), states[k, d:].copy()), "push", d)
            phases[k + 1] = self._advanced(phases[k], states[k], step)
            now, later = (self.attractor(phase) + pushes[k] / self._kp for phase in phases[k : k + 2])
            states[k + 1] = flow(states[k], now, later)
        attractor = self._at(self.attractors, phases)
        position, velocity = states[:, :d], states[:, d:]
        acceleration = self._kp * (attractor - position) - self._kv * velocity + pushes
        return StateDriven(step * np.arange(n_steps + 1), phases, attractor, position, velocity, acceleration)

    def _as_state(self, position: ArrayLike, velocity: ArrayLike) -> np.ndarray:
        d = len(self._kp)
        return np.concatenate([as_vector(position, "position", d), as_vector(velocity, "velocity", d)])

    def _advanced(self, phase: float, state: np.ndarray, step: float) -> float:
        ahead = float(self._at(self._gain, phase) @ (state - self._at(self.state, phase)))
        rate = min(max(1.0 + ahead / self.rule.time_constant, self.rule.slowest), self.rule.fastest)
        return min(phase + rate * step, float(self.phase[-1]))

    def _at(self, rows: np.ndarray, phase: float | np.ndarray) -> np.ndarray:
        """Rows (n, ...) interpolated at a phase, or at many."""
        place = np.clip((phase - self.phase[0]) / (self.phase[1] - self.phase[0]), 0.0, len(rows) - 1.0)
        before = np.minimum(place.astype(int) if np.ndim(place) else int(place), len(rows) - 2)
        share = (place - before)[..., None] if np.ndim(place) else place - before
        return rows[before] + share * (rows[before + 1] - rows[before])


def _flow(step: float, stiffness: np.ndarray, damping: np.ndarray) -> Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """A function for one exact step of (7.19): from state (2d,), attractor (d,) now and one step later, linear in between."""
    d = len(stiffness)
    parts = [discretise(step, float(p), float(v)) for p, v in zip(stiffness, damping, strict=True)]
    units = np.stack([np.ones(d), np.sqrt(stiffness)])
    transition = np.stack([part[0] for part in parts])  # (d, 2, 2)
    first, second = np.stack([part[1] for part in parts]).T, np.stack([part[2] for part in parts]).T  # (2, d)

    def flow(state: np.ndarray, now: np.ndarray, later: np.ndarray) -> np.ndarray:
        scaled = state.reshape(2, d) / units
        moved = (transition @ scaled.T[..., None])[..., 0].T
        return ((moved + first * now + second * later) * units).ravel()

    return flow


def lift(frame: TaskFrame) -> TaskFrame:
    """The frame of [t, x, x', y] that belongs to a frame of [t, y]: positions and attractors are shifted, velocities only turned."""
    d, matrix, offset = frame.n_dims - 1, as_samples(frame.A, "A"), frame.b
    if np.any(matrix[0, 1:]) or np.any(matrix[1:, 0]):
        raise ValueError("a frame that mixes time with movement variables has no velocities: let time pass through")
    lifted, moved = np.zeros((3 * d + 1, 3 * d + 1)), np.zeros(3 * d + 1)
    lifted[0, 0], moved[0] = matrix[0, 0], offset[0]
    for block in range(3):
        rows = slice(1 + block * d, 1 + (block + 1) * d)
        lifted[rows, rows] = matrix[1:, 1:] / (matrix[0, 0] if block == 1 else 1.0)
        moved[rows] = 0.0 if block == 1 else offset[1:]
    return TaskFrame(lifted, moved)
