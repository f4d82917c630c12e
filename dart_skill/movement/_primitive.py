"""The common base of discrete and rhythmic movement primitives.

It has the spring-damper (7.8), (7.9), driven by goal and forcing term, its integration, and the
regression on demonstrations. The module `primitives` has the equations, and says where the
defaults differ from them.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_finite, as_number, as_vector
from dart_skill.common.hyper_parameters import Arrays, SavableModel, array_of
from dart_skill.movement._demonstrations import ShownMovement
from dart_skill.movement._differentiation import Motion
from dart_skill.movement._forcing import (
    REGRESSIONS,
    Kernels,
    divide,
    integrate,
    normalised,
    regress_jointly,
)
from dart_skill.movement._time import as_stamps

MIN_SHARE = 1e-9
"""Least share of its pace to which a tracking error slows a movement down; at zero it could not
continue.
"""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A movement at the stamps time (n,) [s]: position, velocity and acceleration (n, d)."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class Execution(NamedTuple):
    """What a movement shall be: start, goal and amplitude (d,), duration [s].

    A rhythmic movement has its baseline as start and goal, and its period as duration.
    """

    start: np.ndarray
    goal: np.ndarray
    amplitude: np.ndarray
    duration: float


@dataclass(frozen=True, eq=False)
class PrimitiveState:
    """State of a movement at one instant.

    * position, velocity, acceleration (d,).

    Parameters
    ----------
    progress
        Time since the start in units of the duration; for rhythmic movements the share of the
        period, in [0, 1).
    pace
        Progress per second [1/s]; goal, amplitude (d,). All three approach the wanted values
        smoothly.
    wanted
        The wanted start, goal, amplitude and duration.
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    progress: float
    pace: float
    goal: np.ndarray
    amplitude: np.ndarray
    wanted: Execution


AnyPrimitive = TypeVar("AnyPrimitive", bound="Primitive")


class Primitive(SavableModel):
    """Base of both kinds. A subclass has `fit`, `begin` and `step`.

    Its method `_gate` gives the factor by which f fades. Its method `_goal_path` gives the
    position of g between start (0) and goal (1).
    """

    weights_: np.ndarray
    _LEARNED: tuple[str, ...]
    """Attributes (d,) that `fit` sets beside weights_; the last is a number [s]."""

    def __init__(self, kernels: Kernels, n_basis: int, stiffness: float, regression: str) -> None:
        if regression not in REGRESSIONS:
            raise ValueError(
                f"regression must be one of {sorted(REGRESSIONS)}, got {regression!r}"
            )
        self.n_basis, self.regression = n_basis, regression
        self.stiffness = as_number(stiffness, "stiffness")
        self._frequency = float(np.sqrt(self.stiffness))
        self._damping = 2.0 * self._frequency
        self._kernels = kernels
        # Longer steps are subdivided, to at most half a time constant of the spring and half the
        # distance of two kernels.
        self._max_step = 0.5 / max(self._frequency, n_basis)

    def begin(self) -> PrimitiveState:
        """State at the start of the movement, as demonstrated."""
        raise NotImplementedError

    def _gate(self, progress: np.ndarray) -> np.ndarray:
        raise NotImplementedError

    def _goal_path(self, progress: np.ndarray) -> np.ndarray:
        raise NotImplementedError

    @property
    def n_dims(self) -> int:
        """Number of movement variables d."""
        return self._fitted().weights_.shape[1]

    @property
    def parameters(self) -> np.ndarray:
        """theta of (7.10) as one vector (n_basis * d,), kernel by kernel; a copy."""
        return self._fitted().weights_.ravel().copy()

    def with_parameters(self: AnyPrimitive, parameters: ArrayLike) -> AnyPrimitive:
        """A copy of this primitive with other parameters (n_basis * d,); for the search of
        (7.14)-(7.17).
        """
        other = copy(self._fitted())
        other.weights_ = as_vector(parameters, "parameters", self.weights_.size).reshape(
            self.weights_.shape
        )
        return other

    def activations(self, progress: ArrayLike) -> np.ndarray:
        """phi of (7.14), (n, n_basis), at progress (n,), which is time / duration: activations @
        weights_ is f (7.10).

        Each row holds the kernels (7.11), which sum to one, times the factor by which f fades.
        """
        progress = as_vector(progress, "progress")
        if progress.min(initial=0.0) < 0:
            raise ValueError(
                f"progress must be at least 0, the start of the movement, got {progress.min():g}"
            )
        return normalised(self._kernels.raw(progress)) * self._gate(progress)[:, None]

    def open_loop(self, times: ArrayLike, state: PrimitiveState | None = None) -> Trajectory:
        """The movement without disturbance from a state of `begin` or `step`; as demonstrated when
        None.

        Parameters
        ----------
        times
            Stamps (n,) [s], the first of which is the time of the state; or one number, a step
            [s], for one duration (or period).
        """
        state = self.begin() if state is None else self._as_state(state)
        stamps = _as_times(times, state.wanted.duration)
        made, pace, change = self._clock(state, stamps - stamps[0], 1.0)
        return Trajectory(stamps, *_timed(pace, change, *self._follow(state, made, None)))

    def _to_arrays(self) -> Arrays:
        self._fitted()
        return {
            "weights": self.weights_,
            **{name: np.array(getattr(self, f"{name}_")) for name in self._LEARNED},
        }

    def _from_arrays(self, arrays: Arrays) -> None:
        weights = array_of(arrays, "weights", (self.n_basis, None))
        for name in self._LEARNED[:-1]:
            setattr(self, f"{name}_", array_of(arrays, name, weights.shape[1:]))
        lasts = self._LEARNED[-1]
        setattr(self, f"{lasts}_", as_number(array_of(arrays, lasts, ()), lasts))
        self.weights_ = weights

    def _fitted_to(self) -> str:
        return (
            f"{self._shown()}{self.n_dims} movement variables, {self.n_basis} kernels"
            if hasattr(self, "weights_")
            else ""
        )

    def _fitted(self: AnyPrimitive) -> AnyPrimitive:
        if not hasattr(self, "weights_"):
            raise ValueError(f"this {type(self).__name__} holds no weights yet; call fit first")
        return self

    def _learn(
        self,
        demonstrations: list[ShownMovement],
        starts: np.ndarray,
        goals: np.ndarray,
        durations: np.ndarray,
    ) -> None:
        """Weights from all demonstrations by (7.12), then (7.13) or its joint form."""
        self.n_demonstrations_ = len(demonstrations)
        progress, targets = [], []
        for demo, start, goal, duration in zip(
            demonstrations, starts, goals, durations, strict=True
        ):
            position, velocity, acceleration = demo.motion
            share = demo.time / duration
            way = self._goal_path(share)[:, None] * (goal - start) - (position - start)
            # f_ref of (7.12), with A = 1: the drive that the spring-damper needs to move as shown.
            targets.append(
                acceleration * duration**2
                + self._damping * duration * velocity
                - self.stiffness * way
            )
            progress.append(share)
        instants = np.concatenate(progress)
        weights = np.concatenate([demo.weights for demo in demonstrations])
        psi = normalised(self._kernels.raw(instants))
        regress = REGRESSIONS.get(self.regression, regress_jointly)
        self.weights_ = regress(
            psi, self._gate(instants), np.concatenate(targets), weights, self._kernels
        )

    def _transformation(self, progress: np.ndarray) -> np.ndarray:
        """f (n, d) of (7.10) at progress (n,)."""
        psi = normalised(self._kernels.raw(progress))
        return self._gate(progress)[:, None] * (psi @ self.weights_)

    def _begin(
        self, wanted: Execution, position: np.ndarray, velocity: np.ndarray, progress: float
    ) -> PrimitiveState:
        at_rest, pace = np.zeros(len(position)), 1.0 / wanted.duration
        state = PrimitiveState(
            position, velocity, at_rest, progress, pace, wanted.goal, wanted.amplitude, wanted
        )
        return self._after(state, 0.0, 1.0, None)

    def _after(
        self, state: PrimitiveState, dt: float, share: float, push: np.ndarray | None
    ) -> PrimitiveState:
        """The state dt seconds later, with a share of the wanted pace and a push, an acceleration
        (d,).
        """
        made, pace, change = self._clock(state, np.array([0.0, dt]), share)
        path = self._follow(state, made if dt else made[:1], push)
        motion = _timed(pace[-1:], change[-1:], *(rows[-1:] for rows in path))
        goal, amplitude = self._settled(state, made[-1:, None])
        return PrimitiveState(
            motion.position[0],
            motion.velocity[0],
            motion.acceleration[0],
            self._wrapped(state.progress + float(made[-1])),
            float(pace[-1]),
            goal[0],
            amplitude[0],
            state.wanted,
        )

    def _clock(
        self, state: PrimitiveState, elapsed: np.ndarray, share: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Progress since a state, pace and its change per second (n,) after times (n,) [s]: the
        pace approaches a share of the wanted one.
        """
        wanted, rate = share / state.wanted.duration, self._frequency / state.wanted.duration
        excess = (state.pace - wanted) * np.exp(-rate * elapsed)
        made = wanted * elapsed + (state.pace - wanted - excess) / rate
        return made, wanted + excess, -rate * excess

    def _follow(
        self, state: PrimitiveState, made: np.ndarray, push: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x, dx/ds and d2x/ds2 (n, d) of (7.8) and (7.9) at the progress `made` (n,) since the
        state.
        """
        steps, start = divide(made, self._max_step), state.wanted.start
        goal, amplitude = self._settled(state, steps.stages[:, None])
        progress = state.progress + steps.stages
        drive = self._goal_path(progress)[:, None] * (self.stiffness * (goal - start))
        drive += amplitude * self._transformation(progress)
        if push is not None:
            drive += state.wanted.duration**2 * push
        begin = np.array([state.position - start, state.velocity / state.pace])
        position, slope = integrate(steps, self.stiffness, self._damping, begin, drive)
        curvature = (
            drive[:: 2 * steps.per_node] - self.stiffness * position - self._damping * slope
        )
        return start + position, slope, curvature

    def _settled(self, state: PrimitiveState, made: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Goal and amplitude (n, d) after the progress `made` (n, 1); both approach the wanted
        ones.
        """
        wanted, lag = state.wanted, np.exp(-self._frequency * made)
        return wanted.goal + lag * (state.goal - wanted.goal), wanted.amplitude + lag * (
            state.amplitude - wanted.amplitude
        )

    def _advance(
        self,
        state: PrimitiveState,
        dt: float,
        coupling: ArrayLike | None,
        tracking_error: ArrayLike | None,
        tolerance: float,
    ) -> PrimitiveState:
        push = None if coupling is None else as_vector(coupling, "coupling", self.n_dims)
        share = 1.0
        if tracking_error is not None:
            error = math.hypot(
                *as_vector(tracking_error, "tracking_error", self.n_dims)
            ) / as_number(tolerance, "tolerance")
            share = max(1.0 / (1.0 + error * error), MIN_SHARE)
        return self._after(state, as_number(dt, "dt"), share, push)

    def _with_wishes(
        self,
        state: PrimitiveState,
        goal: ArrayLike | None,
        duration: float | None,
        amplitude: ArrayLike | None,
        names: tuple[str, str],
    ) -> PrimitiveState:
        """The state with new wanted values from now on; names: of goal and duration, for error
        messages.
        """
        wanted = self._as_state(state).wanted
        if goal is None and duration is None and amplitude is None:
            return state
        goal = as_given(goal, names[0], wanted.goal)
        duration = wanted.duration if duration is None else as_number(duration, names[1])
        amplitude = wanted.amplitude if amplitude is None else self._as_amplitude(amplitude)
        return replace(state, wanted=Execution(wanted.start, goal, amplitude, duration))

    def _wrapped(self, progress: float) -> float:
        return progress

    def _as_state(self, state: PrimitiveState) -> PrimitiveState:
        for values in (state.position, state.velocity):
            if np.shape(values) != (self.n_dims,) or not np.isfinite(values).all():
                raise ValueError(
                    f"state must hold {self.n_dims} finite positions and velocities; take it from"
                    " `begin` or a former step"
                )
        return state

    def _as_amplitude(self, amplitude: ArrayLike) -> np.ndarray:
        amplitude = as_finite(amplitude, "amplitude")
        if amplitude.shape not in ((), (self.n_dims,)):
            raise ValueError(
                f"amplitude must be one number or one per dimension ({self.n_dims}), got shape"
                f" {amplitude.shape}"
            )
        return np.broadcast_to(amplitude, self.n_dims)


def as_given(value: ArrayLike | None, name: str, default: np.ndarray) -> np.ndarray:
    """Numbers as many as the default (d,), which takes their place if there are none."""
    return default if value is None else as_vector(value, name, len(default))


def _as_times(times: ArrayLike, duration: float) -> np.ndarray:
    """Stamps (n,) as given; for a step [s], stamps from 0 to the duration or just beyond it."""
    if np.ndim(times) > 0:
        return as_stamps(times)
    step = as_number(times, "step")
    return step * np.arange(int(np.ceil(duration / step - 1e-6)) + 1)


def _timed(
    pace: np.ndarray,
    change: np.ndarray,
    position: np.ndarray,
    slope: np.ndarray,
    curvature: np.ndarray,
) -> Motion:
    """Motion in seconds from a path (n, d) and its derivatives by progress, at a pace (n,) that
    changes (n,).
    """
    pace, change = pace[:, None], change[:, None]
    return Motion(position, pace * slope, pace**2 * curvature + change * slope)
