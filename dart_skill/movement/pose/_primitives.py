"""Movement primitives of position and orientation: six degrees of freedom that share the phase.

The state of Ude et al. (ICRA 2014) is the angular velocity, and the rotation vector from the hand
to the goal is taken anew at each instant. L. Koutras and Z. Doulgeri, "A correct formulation for
the orientation dynamic movement primitives for robot control in the Cartesian space", CoRL 2019
(PMLR 100, 2020), show that the movement then changes with tau and with start and goal in ways that
(7.8) does not. In their formulation, which is this one, the rotation vector e from the goal to the
hand and its own derivative are the state:
    tau^2 e'' = -K e - D tau e' + f(z),   q = exp(e) g.
So in e the primitive is linear, and all that `DiscretePrimitive` says of goals, pace and amplitude
holds for it.

For periodic movements e is the rotation vector from a baseline: the projection of F. Abu-Dakka, M.
Saveriano and L. Peternel, "Periodic DMP formulation for quaternion trajectories", ICAR 2021: its
first approach.
"""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common import quaternions
from dart_skill.common.checks import as_finite, as_vector
from dart_skill.common.hyper_parameters import Arrays, SavableModel, array_of
from dart_skill.movement._demonstrations import (
    are_several,
    as_period,
    complete,
    estimate_period,
    mean_over_periods,
)
from dart_skill.movement._primitive import Primitive, PrimitiveState
from dart_skill.movement._primitives import DiscretePrimitive, RhythmicPrimitive
from dart_skill.movement._time import as_stamps
from dart_skill.movement.pose._manifold import mean_point
from dart_skill.movement.pose._motion import PoseMotion, as_pose, as_poses
from dart_skill.movement.pose._rotation_vectors import (
    cross,
    nearest,
    path_about,
    slope_of,
    turning,
)

TOLERANCE = (0.03, 0.1)
"""Errors of position [m] and rotation [rad] that halve the pace."""
BASELINE_PASSES = 8
"""Passes of the search for the mean orientation of a cycle; each makes its error smaller by the
square of the swing.
"""


@dataclass(frozen=True, eq=False)
class PoseTrajectory:
    """A movement at the stamps time (n,) [s]: pose (n, 7), velocity (n, 6) [m/s, rad/s],
    acceleration (n, 6), in world axes.
    """

    time: np.ndarray
    pose: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True, eq=False)
class PoseState:
    """State of a movement at one instant.

    To continue from a measured pose or velocity: `dataclasses.replace(state, pose=...)`.

    Parameters
    ----------
    pose : (7,)
    velocity : (6,) [m/s, rad/s]
    acceleration : (6,)
        In world axes.
    goal : (7,)
        Goal or baseline, on its way to the wanted one.
    base : (4,)
        Orientation about which the coordinates are taken.
    inner
        PrimitiveState in these coordinates.
    """

    pose: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    goal: np.ndarray
    base: np.ndarray
    inner: PrimitiveState

    @property
    def progress(self) -> float:
        """Time since the start in units of the duration; for rhythmic movements the share of the
        period, in [0, 1).
        """
        return self.inner.progress

    @property
    def pace(self) -> float:
        """Progress per second [1/s]."""
        return self.inner.pace


AnyPosePrimitive = TypeVar("AnyPosePrimitive", bound="PosePrimitive")


class PosePrimitive(SavableModel):
    """Base of both kinds: a linear primitive over coordinates of the pose, position and e, then
    any others.
    """

    _inner: Primitive

    _KIND: type[Primitive]
    """Type of the inner primitive."""
    _LEARNED: dict[str, int]
    """Attributes that `fit` sets beside those of the inner primitive, and their lengths."""

    @classmethod
    def _parameters(cls) -> dict[str, inspect.Parameter]:
        return cls._KIND._parameters()

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The hyper-parameters by name, as the constructor takes them.

        Parameters
        ----------
        deep
            For scikit-learn.
        """
        return self._inner.get_params(deep)

    def _to_arrays(self) -> Arrays:
        inner = {f"inner.{name}": value for name, value in self._inner._to_arrays().items()}
        return {**inner, **{name.strip("_"): getattr(self, name) for name in self._LEARNED}}

    def _from_arrays(self, arrays: Arrays) -> None:
        self._inner._from_arrays(
            {
                name.removeprefix("inner."): value
                for name, value in arrays.items()
                if name.startswith("inner.")
            }
        )
        for name, length in self._LEARNED.items():
            setattr(self, name, array_of(arrays, name.strip("_"), (length,)))
        lasts = f"{self._inner._LEARNED[-1]}_"
        setattr(self, lasts, getattr(self._inner, lasts))

    def _fitted_to(self) -> str:
        if not hasattr(self._inner, "weights_"):
            return ""
        return f"{self._shown()}positions and orientations, {self._inner.n_basis} kernels"

    @property
    def n_dims(self) -> int:
        """Number of movement variables: three of the position, three of the rotation."""
        return 6

    @property
    def weights_(self) -> np.ndarray:
        """(n_basis, 6): of position [m] and rotation vector [rad], world axes."""
        return self._inner._fitted().weights_[:, :6]

    @property
    def parameters(self) -> np.ndarray:
        """theta of (7.10) as one vector (n_basis * 6,), kernel by kernel; a copy."""
        return self.weights_.ravel().copy()

    def with_parameters(self: AnyPosePrimitive, parameters: ArrayLike) -> AnyPosePrimitive:
        """A copy of this primitive with other parameters (n_basis * 6,)."""
        given, whole = (
            as_vector(parameters, "parameters", self.weights_.size),
            self._inner.weights_.copy(),
        )
        whole[:, :6] = given.reshape(-1, 6)
        other = copy(self)
        other._inner = self._inner.with_parameters(whole.ravel())
        return other

    def activations(self, progress: ArrayLike) -> np.ndarray:
        """phi of (7.14), (n, n_basis), at progress (n,): activations @ weights_ is f (7.10)."""
        return self._inner.activations(progress)

    def begin(self) -> PoseState:
        """State at the start of the movement, as demonstrated."""
        raise NotImplementedError

    def open_loop(self, times: ArrayLike, state: PoseState | None = None) -> PoseTrajectory:
        """The movement without disturbance from a state of `begin` or `step`; as demonstrated when
        None.

        Parameters
        ----------
        times
            Stamps (n,) [s], the first of which is the time of the state; or one number, a step
            [s], for one duration.
        """
        state = self.begin() if state is None else state
        made = self._inner.open_loop(times, self._inner_state(state))
        return PoseTrajectory(
            made.time, *_in_world(state.base, made.position, made.velocity, made.acceleration)
        )

    def _state(self, base: np.ndarray, inner: PrimitiveState) -> PoseState:
        motion = _in_world(
            base, inner.position[None], inner.velocity[None], inner.acceleration[None]
        )
        pose, velocity, acceleration = (rows[0] for rows in motion)
        return PoseState(
            pose, velocity, acceleration, self._goal_pose(base, inner.goal), base, inner
        )

    def _goal_pose(self, base: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """Goal or baseline (7,) from its coordinates; its rotation is in the last three."""
        return np.concatenate(
            [goal[:3], quaternions.product(quaternions.from_vectors(goal[-3:]), base)]
        )

    def _inner_state(self, state: PoseState) -> PrimitiveState:
        """The inner state with the pose and velocity of the state, which the caller may have
        replaced.
        """
        if not isinstance(state, PoseState):
            raise ValueError(
                "state must be a PoseState from `begin` or a former step, got"
                f" {type(state).__name__}"
            )
        return _moved(
            state.inner,
            state.base,
            as_pose(state.pose, "state.pose"),
            as_vector(state.velocity, "state.velocity", 6),
        )

    def _push(self, inner: PrimitiveState, coupling: ArrayLike | None) -> np.ndarray | None:
        """An acceleration (6,) in world axes as one of the coordinates."""
        if coupling is None:
            return None
        push = as_vector(coupling, "coupling", 6)
        return _padded(
            np.concatenate([push[:3], slope_of(inner.position[3:6], push[3:])]),
            inner.position,
            0.0,
        )

    def _error(
        self, inner: PrimitiveState, error: ArrayLike | None, tolerance: ArrayLike
    ) -> np.ndarray | None:
        """A tracking error (6,) in units of its tolerances (2,)."""
        if error is None:
            return None
        limits = as_vector(tolerance, "tolerance", 2)
        if limits.min() <= 0:
            raise ValueError(f"tolerance must be above 0, got {limits.tolist()}")
        return _padded(
            as_vector(error, "tracking_error", 6) / np.repeat(limits, 3), inner.position, 0.0
        )


class DiscretePosePrimitive(PosePrimitive):
    """Point attractor on poses: a movement from a start to a goal, `DiscretePrimitive` on position
    and orientation.

    Parameters are those of `DiscretePrimitive`: n_basis (default 50), stiffness (156.25),
    canonical_decay (4.6), phase_scaled (False), goal_path ("smooth"), regression ("joint").
    phase_scaled=True with goal_path="fixed" is the form that is printed in the papers, without
    their scaling by goal minus start.

    The movement turns the way that was shown, through half a turn and up to nearly a full turn
    from its goal.

    After `fit`; all but the first are means over the demonstrations:

    Parameters
    ----------
    options
        All but n_basis.

    Attributes
    ----------
    weights_ : (n_basis, 6)
    start_
        Poses.
    goal_ : (7,)
        Poses.
    duration_ : [s]
    start_turn_ : (3,)
        Rotation vector from the goal to the start [rad]. It may be longer than half a turn.
    """

    _inner: DiscretePrimitive
    _KIND = DiscretePrimitive
    _LEARNED = {"start_": 7, "goal_": 7, "start_turn_": 3, "_goal_rotation": 4}

    def __init__(self, n_basis: int = 50, **options: Any):
        self._inner = DiscretePrimitive(n_basis, **options)

    def fit(
        self,
        time: ArrayLike,
        pose: ArrayLike,
        *,
        weights: ArrayLike | None = None,
        noise: ArrayLike | None = None,
    ) -> DiscretePosePrimitive:
        """Learn from one demonstration, time (n,) [s], n >= 2, and pose (n, 7), or from sequences
        of several.

        Parameters
        ----------
        pose
            Position [m] and unit quaternion x, y, z, w; signs do not matter.
        weights
            One number per sample (n,), default 1; for several demonstrations one number, or one
            per sample, for each.
        noise
            Two numbers, standard deviations of position [m] and orientation [rad]; estimated when
            None.

        Returns
        -------
        DiscretePosePrimitive
            Self.

        Raises
        ------
        ValueError
            If a value is not finite, a quaternion's length is not 1, time does not increase, a
            shape is wrong, or a pose is turned by nearly a full turn against the last one.
        """
        shown = _demonstrations(time, pose)
        tracks = [
            np.hstack([rows[:, :3], path_about(rows[:, 3:], rows[-1, 3:], last=True)])
            for _, rows in shown
        ]
        _learn(self._inner, shown, tracks, weights, noise, are_several(pose))
        shares = _shares(weights, are_several(pose))
        self._goal_rotation = mean_point([rows[-1, 3:] for _, rows in shown], shares)
        self.n_demonstrations_ = self._inner.n_demonstrations_
        self.start_turn_, self.duration_ = self._inner.start_[3:], self._inner.duration_
        self.goal_ = np.concatenate([self._inner.goal_[:3], self._goal_rotation])
        self.start_ = _in_world(
            self._goal_rotation,
            *(np.atleast_2d(one) for one in (self._inner.start_, np.zeros(6), np.zeros(6))),
        ).pose[0]
        return self

    def begin(
        self,
        start: ArrayLike | None = None,
        *,
        goal: ArrayLike | None = None,
        duration: float | None = None,
        amplitude: ArrayLike = 1.0,
        velocity: ArrayLike | None = None,
    ) -> PoseState:
        """State at the start of the movement, for `open_loop` and `step`.

        start and goal (7,), velocity (6,) [m/s, rad/s] and duration [s] are those of the
        demonstrations unless given. Of the two turns from start to goal the one that is nearer to
        the demonstrated turn is made. amplitude, one number or (6,), is A of (7.8): it scales all
        of the movement but the way from start to goal.
        """
        self._inner._fitted()
        first = self.start_ if start is None else as_pose(start, "start")
        last = self.goal_ if goal is None else as_pose(goal, "goal")
        turn = nearest(first[3:], last[3:], self.start_turn_)
        speed = None
        if velocity is not None:
            given = as_vector(velocity, "velocity", 6)
            speed = np.concatenate([given[:3], slope_of(turn, given[3:])])
        inner = self._inner.begin(
            np.concatenate([first[:3], turn]),
            goal=np.concatenate([last[:3], np.zeros(3)]),
            duration=duration,
            amplitude=amplitude,
            velocity=speed,
        )
        return self._state(last[3:], inner)

    def step(
        self,
        state: PoseState,
        dt: float,
        *,
        goal: ArrayLike | None = None,
        duration: float | None = None,
        amplitude: ArrayLike | None = None,
        coupling: ArrayLike | None = None,
        tracking_error: ArrayLike | None = None,
        tolerance: ArrayLike = TOLERANCE,
    ) -> PoseState:
        """State dt seconds later.

        Parameters
        ----------
        goal : (7,)
            New values from now on; None for no change. A goal that moves is followed beyond half a
            turn from the first one.
        duration : [s]
            New values from now on; None for no change. A goal that moves is followed beyond half a
            turn from the first one.
        amplitude
            New values from now on; None for no change. A goal that moves is followed beyond half a
            turn from the first one.
        coupling : (6,)
            Acceleration [m/s^2, rad/s^2] during this step in world axes, for example of a push.
        tracking_error : (6,)
            Actual minus planned position [m], and rotation vector from the planned to the actual
            orientation [rad]. It slows the movement down, as in `DiscretePrimitive.step`.
        tolerance : (2,)
            The errors [m] and [rad] that halve the pace.
        """
        inner = self._inner_state(state)
        wish = None
        if goal is not None:
            pose = as_pose(goal, "goal")
            wish = np.concatenate([pose[:3], nearest(pose[3:], state.base, inner.wanted.goal[3:])])
        error = self._error(inner, tracking_error, tolerance)
        made = self._inner.step(
            inner,
            dt,
            goal=wish,
            duration=duration,
            amplitude=amplitude,
            coupling=self._push(inner, coupling),
            tracking_error=error,
            tolerance=1.0,
        )
        return self._state(state.base, made)


class RhythmicPosePrimitive(PosePrimitive):
    """Limit cycle on poses: a movement that repeats about a baseline, `RhythmicPrimitive` on
    position and orientation.

    Parameters are those of `RhythmicPrimitive`: n_basis (default 50), stiffness (156.25),
    regression ("joint").

    The hand swings by less than a full turn from its baseline. A baseline that changes carries the
    cycle with it, in world axes.

    After `fit`:

    Parameters
    ----------
    options
        All but n_basis.

    Attributes
    ----------
    weights_ : (n_basis, 6)
    baseline_ : (7,)
        Mean pose over whole periods.
    period_ : [s]
    """

    # The inner primitive has nine coordinates: position, rotation vector from the baseline, and
    # that of the baseline from its first place, which no weight moves. So the cycle is the same
    # about any baseline.
    _inner: RhythmicPrimitive
    _KIND = RhythmicPrimitive
    _LEARNED = {"baseline_": 7}

    def __init__(self, n_basis: int = 50, **options: Any):
        self._inner = RhythmicPrimitive(n_basis, **options)

    def fit(
        self,
        time: ArrayLike,
        pose: ArrayLike,
        *,
        period: float | None = None,
        weights: ArrayLike | None = None,
        noise: ArrayLike | None = None,
    ) -> RhythmicPosePrimitive:
        """Learn as `DiscretePosePrimitive.fit` does; the phase is zero at the first sample of each
        demonstration.

        Parameters
        ----------
        period : [s]
            When None it is estimated from each demonstration, which must then span about two
            periods.
        pose, weights, noise
            As of `DiscretePosePrimitive.fit`.

        Raises
        ------
        ValueError
            Also if a demonstration does not repeat, or turns by nearly a full turn from its mean.
        """
        shown = _demonstrations(time, pose)
        bases, tracks = zip(
            *(_about_baseline(stamps, rows, period) for stamps, rows in shown), strict=True
        )
        nine = [np.hstack([track, np.zeros((len(track), 3))]) for track in tracks]
        _learn(self._inner, shown, nine, weights, noise, are_several(pose), period=period)
        base = mean_point(np.array(bases), _shares(weights, are_several(pose)))
        self.n_demonstrations_ = self._inner.n_demonstrations_
        self.baseline_, self.period_ = (
            np.concatenate([self._inner.baseline_[:3], base]),
            self._inner.period_,
        )
        return self

    def limit_cycle(
        self,
        phase: float = 0.0,
        *,
        baseline: ArrayLike | None = None,
        period: float | None = None,
        amplitude: ArrayLike = 1.0,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pose (7,) and velocity (6,) on the limit cycle at a phase in units of the period.

        Parameters
        ----------
        baseline, amplitude
            Of the cycle; None for the baseline that was learned.
        """
        state = self.begin(baseline=baseline, period=period, amplitude=amplitude, phase=phase)
        return state.pose, state.velocity

    def begin(
        self,
        start: ArrayLike | None = None,
        *,
        baseline: ArrayLike | None = None,
        period: float | None = None,
        amplitude: ArrayLike = 1.0,
        velocity: ArrayLike | None = None,
        phase: float = 0.0,
    ) -> PoseState:
        """State at a phase in units of the period, for `open_loop` and `step`.

        start (7,) and velocity (6,) are those of the limit cycle unless given. baseline (7,) and
        period [s] are those of the demonstrations unless given. amplitude, one number or (6,),
        scales the movement about its baseline.
        """
        self._inner._fitted()
        middle = self.baseline_ if baseline is None else as_pose(baseline, "baseline")
        wanted = np.concatenate([middle[:3], np.zeros(6)])
        inner = self._inner.begin(
            baseline=wanted, period=period, amplitude=self._amplitude(amplitude), phase=phase
        )
        state = self._state(middle[3:], inner)
        if start is None and velocity is None:
            return state
        pose = state.pose if start is None else as_pose(start, "start")
        speed = state.velocity if velocity is None else as_vector(velocity, "velocity", 6)
        moved = _moved(inner, state.base, pose, speed)
        inner = self._inner.begin(
            moved.position,
            baseline=wanted,
            period=period,
            amplitude=self._amplitude(amplitude),
            velocity=moved.velocity,
            phase=phase,
        )
        return self._state(state.base, inner)

    def step(
        self,
        state: PoseState,
        dt: float,
        *,
        baseline: ArrayLike | None = None,
        period: float | None = None,
        amplitude: ArrayLike | None = None,
        coupling: ArrayLike | None = None,
        tracking_error: ArrayLike | None = None,
        tolerance: ArrayLike = TOLERANCE,
    ) -> PoseState:
        """State dt seconds later; arguments as in `DiscretePosePrimitive.step`. progress stays
        within one period.
        """
        inner = self._inner_state(state)
        wish = None
        if baseline is not None:
            pose = as_pose(baseline, "baseline")
            wish = np.concatenate(
                [pose[:3], np.zeros(3), nearest(pose[3:], state.base, inner.wanted.goal[6:])]
            )
        made = self._inner.step(
            inner,
            dt,
            baseline=wish,
            period=period,
            amplitude=None if amplitude is None else self._amplitude(amplitude),
            coupling=self._push(inner, coupling),
            tracking_error=self._error(inner, tracking_error, tolerance),
            tolerance=1.0,
        )
        return self._state(state.base, made)

    @staticmethod
    def _amplitude(amplitude: ArrayLike) -> np.ndarray:
        given = as_finite(amplitude, "amplitude")
        if given.shape not in ((), (6,)):
            raise ValueError(
                f"amplitude must be one number or one per dimension (6), got shape {given.shape}"
            )
        return np.concatenate([np.broadcast_to(given, 6), np.ones(3)])


# --- coordinates ---


def _in_world(
    base: np.ndarray, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray
) -> PoseMotion:
    """Motion of poses from coordinates (n, 6), q = exp(e) base, or (n, 9), q = exp(e) exp(c) base."""
    turn, rate, change = turning(*(rows[:, 3:6] for rows in (position, velocity, acceleration)))
    if position.shape[1] > 6:
        carried, base_rate, base_change = turning(
            *(rows[:, 6:] for rows in (position, velocity, acceleration))
        )
        base_rate, base_change = (
            quaternions.rotate(turn, base_rate),
            quaternions.rotate(turn, base_change),
        )
        change = change + base_change + cross(rate, base_rate)
        rate, base = rate + base_rate, quaternions.product(carried, base)
    rotation = quaternions.product(turn, base)
    return PoseMotion(
        np.hstack([position[:, :3], rotation]),
        np.hstack([velocity[:, :3], rate]),
        np.hstack([acceleration[:, :3], change]),
    )


def _moved(
    inner: PrimitiveState, base: np.ndarray, pose: np.ndarray, velocity: np.ndarray
) -> PrimitiveState:
    """The inner state at another pose (7,) with another velocity (6,); the baseline stays where it
    is.
    """
    rate = velocity[3:]
    if len(inner.position) > 6:
        carried, base_rate, _ = turning(inner.position[6:], inner.velocity[6:], np.zeros(3))
        base = quaternions.product(carried, base)
    vector = nearest(pose[3:], base, inner.position[3:6])
    if len(inner.position) > 6:
        rate = rate - quaternions.rotate(quaternions.from_vectors(vector), base_rate)
    position = np.concatenate([pose[:3], vector, inner.position[6:]])
    return replace(
        inner,
        position=position,
        velocity=np.concatenate([velocity[:3], slope_of(vector, rate), inner.velocity[6:]]),
    )


def _padded(six: np.ndarray, like: np.ndarray, value: float) -> np.ndarray:
    return np.concatenate([six, np.full(len(like) - 6, value)])


# --- demonstrations ---


def _demonstrations(time: ArrayLike, pose: ArrayLike) -> list[tuple[np.ndarray, np.ndarray]]:
    """Stamps (n,) from zero and poses (n, 7) of one demonstration or several, checked."""
    if not are_several(pose):
        return [_demonstration(time, pose, "pose")]
    if not isinstance(time, Sequence | np.ndarray) or len(time) != len(pose):
        raise ValueError(f"time must have one entry for each of the {len(pose)} demonstrations")
    return [
        _demonstration(t, one, f"pose of demonstration {i}")
        for i, (t, one) in enumerate(zip(time, pose, strict=True))
    ]


def _demonstration(time: Any, pose: ArrayLike, name: str) -> tuple[np.ndarray, np.ndarray]:
    rows = as_poses(pose, name)
    stamps = as_stamps(time, len(rows), 2)
    return stamps - stamps[0], rows


def _learn(
    inner: DiscretePrimitive | RhythmicPrimitive,
    shown: list[tuple[np.ndarray, np.ndarray]],
    tracks: list[np.ndarray],
    weights: ArrayLike | None,
    noise: ArrayLike | None,
    several: bool,
    **options: Any,
) -> None:
    """Fit the linear primitive to coordinates; positions and rotations are smoothed apart, each
    with a noise of its own.
    """
    levels = [None, None] if noise is None else list(as_vector(noise, "noise", 2))
    times, motions = [stamps for stamps, _ in shown], []
    for stamps, track in zip(times, tracks, strict=True):
        groups = [
            complete(stamps, track[:, 3 * i : 3 * i + 3], noise=level)
            for i, level in enumerate(levels)
        ]
        rest = np.zeros((len(track), track.shape[1] - 6))
        motions.append([np.hstack([*parts, rest]) for parts in zip(*groups, strict=True)])
    columns: list[Any] = [times, *(list(one) for one in zip(*motions, strict=True))]
    inner.fit(*(columns if several else [one[0] for one in columns]), weights=weights, **options)


def _shares(weights: Any, several: bool) -> np.ndarray | None:
    """Weight of each of several demonstrations, the mean of its samples."""
    return np.array([np.mean(one) for one in weights]) if several and weights is not None else None


def _about_baseline(
    time: np.ndarray, rows: np.ndarray, period: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """Mean orientation (4,) over whole periods, and the coordinates (n, 6) about it."""
    base = mean_point(rows[:, 3:])
    track = np.hstack([rows[:, :3], path_about(rows[:, 3:], base, last=False)])
    length = estimate_period(time, track) if period is None else as_period(period, time, track)
    for _ in range(BASELINE_PASSES):
        middle = mean_over_periods(time, track[:, 3:], length)
        base = quaternions.product(quaternions.from_vectors(middle), base)
        track[:, 3:] = path_about(rows[:, 3:], base, last=False)
    return base, track
