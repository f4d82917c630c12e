"""Autonomous DS-GMR: the state of the robot drives the movement, not the clock (thesis chapter 9).

A field y(x, x') that is regressed on the state alone stalls: where the demonstrations rest before they move it asks for no motion, and
where a path comes near itself (wind-up and throw) it mixes both passes. So the state enters by way of the phase s, how far along
the movement the robot is. The mixture over [t, x, x', y] gives, by regression on t, the state z(s) that belongs to a phase, with
covariance R(s), and the attractor y(s). The phase moves on by what the state says,

    s' = clip(1 + d / T, slowest, fastest),    d = z_s' R^-1 (z - z(s)) / (z_s' R^-1 z_s + 1 / w^2),    z_s = dz(s)/ds,

where d is how much later or earlier the state looks than the phase: the correction of an extended Kalman filter for s with deviation w.
R holds, beside the spread of the demonstrations, that the pace is not known: a robot that is held back on its way is not at the end of it.
Then (7.19) with y(s). The system has no clock: held back, it waits; pushed ahead, it skips; and since s' >= slowest > 0 and y stays at
its last value from the end on, it comes to the goal from every start (s is at the end after finite time, and (7.19) with a constant
attractor is a stable linear system).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.checks import as_count, as_number, as_samples, as_vector
from dart_skill.mixture import regress
from dart_skill.movement._time import as_stamps
from dart_skill.movement.attractor import as_gains, attractor_from_motion, critical_damping, discretise
from dart_skill.movement.differentiation import Motion
from dart_skill.movement.frames import TaskFrame
from dart_skill.movement.task_parameterised import TaskParameterisedMixture

UNKNOWN_PACE = 1.0
"""Standard deviation of the pace at which a robot passes through the movement, as a share of the demonstrated one."""
Push = Callable[[float, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class StateDriven:
    """A movement of an autonomous policy: time (n,), phase (n,) [s], attractor, position, velocity and acceleration (n, d)."""

    time: np.ndarray
    phase: np.ndarray
    attractor: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True)
class PhaseRule:
    """How the state moves the phase on: rates `slowest` and `fastest` [s/s], time constant T and deviation w [s] of the correction."""

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
    """Movement primitive over d variables that is driven by the state (x, x').

    n_components, stiffness and damping as in `DSGMR`; rule: how the state moves the phase on. Further options go to
    `TaskParameterisedMixture`; `mixture_`, over [t, x, x', y], holds the fitted one.
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
        """Learn from motions (n_i, d) at stamps (n_i,), as `smooth_derivatives` gives them.

        frames: P per demonstration, for features [t, y] as in `DSGMR.fit`; weights and rng as there.
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
        """The policy for new frames; resolution: phases at which it is worked out beforehand."""
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
        """Movement in new frames from position0 and velocity0 (d,), for `duration` seconds; push as in `AutonomousPolicy.run`."""
        return self.policy(frames).run(position0, velocity0, step=step, duration=duration, push=push)


class AutonomousPolicy:
    """The policy for one situation. `locate` finds the phase of a state, `advance` moves it on, `attractor` is what pulls at a phase.

    phase (n,) [s]; state (n, 2d) and spread (n, 2d, 2d): position over velocity that belongs to each phase; attractors (n, d).
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
        """Phase [s] that a state (d,), (d,) fits best: the least Mahalanobis distance, the earliest of equals."""
        error = self._as_state(position, velocity) - self.state
        return float(self.phase[np.argmin(np.einsum("ni,nij,nj->n", error, self._precision, error))])

    def advance(self, phase: float, position: ArrayLike, velocity: ArrayLike, step: float) -> float:
        """Phase [s] a `step` [s] later, as the state says."""
        return self._advanced(phase, self._as_state(position, velocity), as_number(step, "step"))

    def attractor(self, phase: float) -> np.ndarray:
        """Attractor (d,) at a phase [s]; before the start and beyond the end that of the start and of the end."""
        return self._at(self.attractors, phase)

    def acceleration(self, phase: float, position: ArrayLike, velocity: ArrayLike) -> np.ndarray:
        """(7.19) at a phase: kp (y - x) - kv x' (d,)."""
        state = self._as_state(position, velocity)
        d = len(self._kp)
        return self._kp * (self.attractor(phase) - state[:d]) - self._kv * state[d:]

    def run(
        self, position0: ArrayLike, velocity0: ArrayLike, *, step: float = 0.002, duration: float, push: Push | None = None
    ) -> StateDriven:
        """Movement from a state, the unit mass of (7.19) standing in for the robot.

        push(time, position, velocity) -> acceleration (d,) [1/s^2 of the movement variables] acts on it from outside; it is held over a
        step. Exact between the stamps for an attractor that runs straight.
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
    """One exact step of (7.19): state (2d,), attractor (d,) now and a step later, straight in between -> state (2d,)."""
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
    """The frame of [t, x, x', y] that belongs to a frame of [t, y]: positions and attractors move with it, velocities turn only."""
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
