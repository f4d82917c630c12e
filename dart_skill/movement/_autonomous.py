"""Autonomous DS-GMR: the state of the robot drives the movement, not the clock (thesis chapter 9).

An attractor y(x, x') that is regressed on the state alone can get stuck. Where the demonstrations
rest before they move, it asks for no motion. Where a path comes near itself (wind-up and throw),
it mixes both passes. Therefore the state acts through the phase s [s], the place of the robot
along the movement. Regression of the mixture over [t, x, x', y] on t gives the state z(s) that
belongs to a phase, with covariance R(s), and the attractor y(s). The state changes the phase by

    s' = clip(1 + d / T, slowest, fastest),    d = z_s' R^-1 (z - z(s)) / (z_s' R^-1 z_s + 1 / w^2),    z_s = dz(s)/ds.

d [s] is how far the state is ahead of the phase: it is the correction of an extended Kalman filter
for s with standard deviation w. R contains the spread of the demonstrations and the uncertainty of
the pace, so that a robot that is slow because it is held back is not taken to be at the end of the
movement. Then (7.19) follows y(s).

The system has no clock. If the robot is held back, the phase creeps on, at `slowest` at least. If
it is pushed ahead, the movement skips a part. The phase never goes back: a robot that is led back
to the start goes from there to where the movement is. It reaches the goal from every start: since s' >= slowest > 0, s reaches its
end in finite time; from then on y is constant, and (7.19) with a constant attractor is a stable
linear system.

The goal is where the demonstrations ended: their last positions are one Gaussian in each frame,
and the product of these (7.21) is the goal in new frames. The regression at the mean duration is
elsewhere, as some demonstrations have ended by then and others have not. A stretch of `SETTLING`
after the last phase leads from there to the goal, so the course before is the regression's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_finite, as_number, as_samples, as_vector
from dart_skill.common.hyper_parameters import Arrays, array_of
from dart_skill.common.pace import PhaseRule
from dart_skill.mixture import GaussianMixture, regress
from dart_skill.movement._attractor import attractor_from_motion, discretise
from dart_skill.movement._ds_gmr import AttractorModel
from dart_skill.movement._frames import MovingFrame, TaskFrame
from dart_skill.movement._placement import Weights
from dart_skill.movement._task_parameterised import TaskParameterisedMixture
from dart_skill.movement._time import as_stamps, uniform_step

UNKNOWN_PACE = 1.0
"""Standard deviation of the robot's pace, relative to the demonstrated one."""
Push = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
StateFrame = TaskFrame | MovingFrame | None
"""A frame that stands still, one that moves, or one that is missing."""
SLOPE_STEP = 0.01
"""Over which the change of the state with the phase is measured on either side [s]."""
SETTLING = 0.2
"""How long the attractor takes from the end of the regression to the goal [s of phase]."""


@dataclass(frozen=True, eq=False)
class StateDriven:
    """A movement of an autonomous policy, in the units of the movement.

    Parameters
    ----------
    time, phase
        (n,) each [s].
    attractor, position, velocity, acceleration
        (n, d) each.
    """

    time: np.ndarray
    phase: np.ndarray
    attractor: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class AutonomousDSGMR(AttractorModel):
    """DS-GMR over d movement variables that is driven by the state (x, x') instead of a clock.

    Attribute after `fit`: mixture_, the fitted TaskParameterisedMixture over [t, u, x, x', y],
    where u are the further inputs.

    Parameters
    ----------
    n_components
        Int, number of components of the mixture.
    stiffness
        One number or (d,), default 200 [1/s^2]. kp of (7.19).
    damping
        One number or (d,) [1/s], default None: critical, 2 sqrt(kp).
    rule
        PhaseRule, how the state changes the phase; default None: its defaults.
    n_inputs, partition, overlap
        As in `DSGMR`.
    mixture_options
        Hyper-parameters of `TaskParameterisedMixture`.
    """

    def __init__(
        self,
        n_components: int,
        stiffness: ArrayLike = 200.0,
        damping: ArrayLike | None = None,
        rule: PhaseRule | None = None,
        *,
        n_inputs: int = 0,
        partition: str = "em",
        overlap: float | None = None,
        **mixture_options: Any,
    ) -> None:
        super().__init__(
            n_components,
            stiffness,
            damping,
            n_inputs=n_inputs,
            partition=partition,
            overlap=overlap,
            **mixture_options,
        )
        self.rule = rule or PhaseRule()

    def _plain_params(self) -> dict[str, Any]:
        return {**super()._plain_params(), "rule": asdict(self.rule)}

    @classmethod
    def _from_plain(cls, values: dict[str, Any]) -> dict[str, Any]:
        return {**values, "rule": PhaseRule(**values["rule"])}

    def _to_arrays(self) -> Arrays:
        last = (
            {f"last.{name}": value for name, value in self._last._to_arrays().items()}
            if hasattr(self, "_last")
            else {}
        )
        return {**super()._to_arrays(), **last, "ends": self._ends}

    def _from_arrays(self, arrays: Arrays) -> None:
        super()._from_arrays(arrays)
        self._ends = array_of(arrays, "ends", (2,))
        last = {
            name.removeprefix("last."): value
            for name, value in arrays.items()
            if name.startswith("last.")
        }
        if last:
            self._last = TaskParameterisedMixture(1)
            self._last._from_arrays(last)

    @property
    def _blocks_of_columns(self) -> int:
        return 3

    def fit(
        self,
        times: Sequence[ArrayLike],
        motions: Sequence[Sequence[ArrayLike]],
        frames: Sequence[Sequence[StateFrame | Sequence[StateFrame]]],
        weights: Weights = None,
        *,
        attractors: Sequence[ArrayLike] | None = None,
        inputs: Sequence[ArrayLike] | None = None,
        rng: np.random.Generator | None = None,
    ) -> AutonomousDSGMR:
        """Learn from demonstrations.

        Parameters
        ----------
        times
            For each demonstration its stamps (n_i,) [s].
        motions
            For each demonstration position, velocity and acceleration (n_i, d), as
            `smooth_derivatives` returns them. The acceleration may be missing if attractors are
            given.
        frames
            For each demonstration P frames of the features [t, u, y], as in `DSGMR.fit`; one that
            moves is a list with a `MovingFrame` for each sample.
        weights
            As in `DSGMR.fit`.
        attractors
            For each demonstration (n_i, d), default None: computed from the motions by (7.20).
        inputs
            For each demonstration its further inputs u, (q,) or (n_i, q); default None: there are
            none.
        rng
            As in `DSGMR.fit`.

        Returns
        -------
        AutonomousDSGMR
            Self.
        """
        samples, lifted = self._encoded(times, motions, frames, attractors, inputs)
        self._learn(samples, lifted, weights, rng)
        self._last = _gaussian_of_ends(samples, lifted, weights)
        self._ends = np.array([(np.min(time), np.max(time)) for time in times]).mean(0)
        return self

    def bic(
        self,
        times: Sequence[ArrayLike],
        motions: Sequence[Sequence[ArrayLike]],
        frames: Sequence[Sequence[StateFrame | Sequence[StateFrame]]],
        weights: Weights = None,
        *,
        attractors: Sequence[ArrayLike] | None = None,
        inputs: Sequence[ArrayLike] | None = None,
    ) -> float:
        """Bayesian information criterion for demonstrations, which are given as to `fit`: lower is
        better.
        """
        return self._fitted.bic(
            *self._encoded(times, motions, frames, attractors, inputs), weights
        )

    def _encoded(
        self,
        times: Sequence[ArrayLike],
        motions: Sequence[Sequence[ArrayLike]],
        frames: Sequence[Sequence[StateFrame | Sequence[StateFrame]]],
        attractors: Sequence[ArrayLike] | None,
        inputs: Sequence[ArrayLike] | None,
    ) -> tuple[list[np.ndarray], list[list]]:
        """Features [t, u, x, x', y] of each demonstration, and its frames over them."""
        if not len(times) == len(motions) == len(frames):
            raise ValueError(
                f"times, motions and frames must be as many, got {len(times)}, {len(motions)} and"
                f" {len(frames)}; each is a list with one entry for each demonstration, also for a"
                " single one"
            )
        attractors = _one_each(attractors, len(times), "attractors")
        inputs = _one_each(inputs, len(times), "inputs")
        samples = [
            self._features(times[i], motions[i], attractors[i], inputs[i])
            for i in range(len(times))
        ]
        return samples, [self._lifted(its_frames) for its_frames in frames]

    @classmethod
    def of_mixture(
        cls,
        mixture: TaskParameterisedMixture,
        ends: tuple[float, float],
        stiffness: ArrayLike = 200.0,
        damping: ArrayLike | None = None,
        rule: PhaseRule | None = None,
        *,
        n_inputs: int = 0,
    ) -> AutonomousDSGMR:
        """The model whose mixture over [t, u, x, x', y] was fitted elsewhere.

        Parameters
        ----------
        ends
            First and last phase [s].
        stiffness, damping, rule, n_inputs
            As of the class.
        """
        model = cls(len(mixture.priors_), stiffness, damping, rule, n_inputs=n_inputs)
        model.mixture_, model._ends = model._with_outputs(mixture), np.array(ends, dtype=float)
        return model

    def _features(
        self,
        time: ArrayLike,
        motion: Sequence[ArrayLike] | np.ndarray,
        attractor: ArrayLike | None,
        inputs: ArrayLike | None,
    ) -> np.ndarray:
        """[t, u, x, x', y] (n, 1 + q + 3d)."""
        _require_motion(motion, 2 if attractor is not None else 3)
        if attractor is None:
            position, velocity, acceleration = motion
            attractor = attractor_from_motion(
                position, velocity, acceleration, self.stiffness, self.damping
            )
        attractor = as_samples(attractor, "attractor")
        position = as_samples(motion[0], "position", attractor.shape[1])
        velocity = as_samples(motion[1], "velocity", attractor.shape[1])
        if not len(position) == len(velocity) == len(attractor):
            raise ValueError(
                f"position, velocity and attractor must be as long, got {len(position)},"
                f" {len(velocity)}, {len(attractor)}"
            )
        return np.column_stack(
            [self._with_inputs(time, inputs, len(attractor)), position, velocity, attractor]
        )

    def _lifted(self, frames: Sequence[StateFrame | Sequence[StateFrame]]) -> list:
        return [
            (
                self._lifted(one)
                if isinstance(one, Sequence)
                else None
                if one is None
                else lift(one, self.n_inputs)
            )
            for one in frames
        ]

    def product(self, frames: Sequence[StateFrame]) -> GaussianMixture:
        """(7.21): the mixture over [t, u, x, x', y] in the world, for P new frames of the features
        [t, u, y]; None for a missing one.
        """
        return self._fitted.product(self._lifted(frames))

    @property
    def ends(self) -> tuple[float, float]:
        """First and last phase [s]: where the demonstrations began and ended, on the mean."""
        self._fitted  # noqa: B018 - or a ValueError that says so
        first, last = self._ends
        return float(first), float(last)

    def moment(
        self, frames: Sequence[StateFrame], phase: float, inputs: ArrayLike | None = None
    ) -> Moment:
        """What belongs to one phase [s], in frames as they are now.

        Parameters
        ----------
        inputs
            The further inputs u (q,).
        """
        states, spreads, attractors = self._at_phases(
            frames, phase + SLOPE_STEP * np.array([-1.0, 0.0, 1.0]), inputs
        )
        slope = (states[2:] - states[:1]) / (2.0 * SLOPE_STEP)
        gain, _ = correction(states[1:2], spreads[1:2], slope, self.rule)
        d = len(attractors[1])
        (position, velocity), attractor = np.split(states[1], 2), attractors[1]
        later, _, _ = self._at_phases(
            [_after(one, SLOPE_STEP) for one in frames], np.array([phase]), inputs
        )
        carried = (later[0, :d] - position) / SLOPE_STEP
        return Moment(
            states[1],
            attractor,
            gain[0],
            spreads[1, :d, :d],
            self.stiffness * (attractor - position) - self.damping * velocity,
            np.append(velocity - carried, slope[0, d:]),
        )

    def _at_phases(
        self, frames: Sequence[StateFrame], phases: np.ndarray, inputs: ArrayLike | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """States z(s) (n, 2d), their covariances R(s) (n, 2d, 2d) and attractors y(s) (n, d) at
        phases (n,).
        """
        mixture, queries = self.product(frames), self._with_inputs(phases, inputs)
        n_inputs = queries.shape[1]
        mean, covariance = regress(
            mixture, queries, np.arange(n_inputs), np.arange(n_inputs, mixture.n_dims)
        )
        d = (mixture.n_dims - n_inputs) // 3
        return mean[:, : 2 * d], covariance[:, : 2 * d, : 2 * d], mean[:, 2 * d :]

    def policy(
        self,
        frames: Sequence[TaskFrame | None],
        resolution: int = 400,
        *,
        phase: ArrayLike | None = None,
        inputs: ArrayLike | None = None,
        goal: ArrayLike | None = None,
    ) -> AutonomousPolicy:
        """The policy for new frames.

        Parameters
        ----------
        frames
            P frames of the features [t, u, y]; None for a frame that is missing.
        resolution
            Int, default 400. Number of phases at which the policy is computed beforehand.
        phase
            (n,) [s], equally spaced, default None: `resolution` of them, from the start to the end
            of the demonstrations.
        inputs
            The further inputs u, (q,) or one row for each phase (n, q); default None: there are
            none.
        goal
            (d,), where the movement ends. Default None: where the demonstrations ended (`goal`);
            but if `phase` is given, or the mixture was fitted elsewhere, where the regression is
            at the last phase.
        """
        if goal is None and phase is None and hasattr(self, "_last"):
            goal = self.goal(frames, inputs)
        if phase is None:
            phase = np.linspace(*self.ends, as_count(resolution, "resolution", 10))
        phase = as_stamps(phase, minimum=2)
        step = uniform_step(phase)  # or a ValueError
        course = self._at_phases(frames, phase, inputs)
        if goal is not None:
            goal = as_vector(goal, "goal", course[2].shape[1])
            phase, course = _settled(phase, step, course, goal)
        return AutonomousPolicy(phase, *course, self.stiffness, self.damping, self.rule)

    def goal(self, frames: Sequence[StateFrame], inputs: ArrayLike | None = None) -> np.ndarray:
        """Where the demonstrations ended, as seen in P new frames (d,): the product (7.21) of the
        Gaussians of their last positions.

        Parameters
        ----------
        inputs
            The further inputs u, (q,) or rows (n, q), of which the last counts; the ends are
            regressed on them.

        Raises
        ------
        ValueError
            If nothing was fitted, or elsewhere.
        """
        if not hasattr(self, "_last"):
            self._fitted  # noqa: B018 - or a ValueError that says so
            raise ValueError(
                "the mixture of this model was fitted elsewhere, and the ends of its"
                " demonstrations are not known: give a goal"
            )
        product = self._last.product(self._lifted(frames))
        first, d = 1 + self.n_inputs, (product.n_dims - 1 - self.n_inputs) // 3
        if not self.n_inputs:
            return product.means_[0, first : first + d]
        query = self._with_inputs(
            self.ends[1:],
            None if inputs is None else np.atleast_2d(as_finite(inputs, "inputs"))[-1],
        )[:, 1:]
        return regress(product, query, np.arange(1, first), np.arange(first, first + d))[0][0]

    def reproduce(
        self,
        frames: Sequence[TaskFrame | None],
        position0: ArrayLike,
        velocity0: ArrayLike,
        *,
        step: float = 0.002,
        duration: float,
        push: Push | None = None,
        phase: ArrayLike | None = None,
        inputs: ArrayLike | None = None,
        goal: ArrayLike | None = None,
    ) -> StateDriven:
        """Movement in new frames from position0 and velocity0 (d,), for `duration` [s].

        step and push as in `AutonomousPolicy.run`; phase, inputs and goal as in `policy`.
        """
        policy = self.policy(frames, phase=phase, inputs=inputs, goal=goal)
        return policy.run(position0, velocity0, step=step, duration=duration, push=push)


def _require_motion(motion: Sequence[ArrayLike] | np.ndarray, least: int) -> None:
    """ValueError unless a motion has its parts (n, d): `least` to 3 of them."""
    shapes = (
        [np.shape(part) for part in motion] if isinstance(motion, (Sequence, np.ndarray)) else []
    )
    if least <= len(shapes) <= 3 and all(len(shape) == 2 for shape in shapes):
        return
    alike = len(set(shapes)) == 1 and len(shapes[0]) < 2
    got = (
        f"one array of shape {(len(shapes), *shapes[0])}"
        if alike
        else f"{len(shapes)} parts of shapes {shapes[:4]}"
    )
    parts = "position, velocity and acceleration" if least == 3 else "position and velocity"
    remedy = (
        "give the acceleration, or its attractor"
        if len(shapes) == 2 and not alike
        else "smooth_derivatives(time, positions) makes one of positions"
    )
    raise ValueError(f"a motion must hold {parts}, (n, d) each, got {got}; {remedy}")


def _one_each(given: Sequence | None, n: int, name: str) -> Sequence:
    """One entry for each of n demonstrations: those given, or None for each."""
    if given is None:
        return [None] * n
    if len(given) != n:
        raise ValueError(
            f"{name} has {len(given)} entries for {n} demonstrations; give one for each"
        )
    return given


def _gaussian_of_ends(
    samples: list[np.ndarray], frames: list[list], weights: Weights
) -> TaskParameterisedMixture:
    """One Gaussian in each frame of the last row of the features [t, u, x, x', y] (n_i, m) of each
    demonstration.
    """
    last = [
        [one[-1:] if isinstance(one, list) else one for one in its_frames] for its_frames in frames
    ]
    heard = None if weights is None else [np.ravel(one)[-1:] for one in weights]
    return TaskParameterisedMixture(1).fit([rows[-1:] for rows in samples], last, heard)


def _settled(
    phase: np.ndarray,
    step: float,
    course: tuple[np.ndarray, np.ndarray, np.ndarray],
    goal: np.ndarray,
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Phases (n + k,) [s], states, their covariances and attractors: the course (n, ...) and then
    smoothly to rest at the goal (d,).
    """
    n_more = max(2, round(SETTLING / step))
    share = (np.arange(1, n_more + 1) / n_more)[:, None]
    share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    states, spreads, attractors = course
    rest = np.concatenate([goal, np.zeros_like(goal)])
    states = np.vstack([states, states[-1] + share * (rest - states[-1])])
    attractors = np.vstack([attractors, attractors[-1] + share * (goal - attractors[-1])])
    attractors[-1] = goal
    spreads = np.concatenate([spreads, np.broadcast_to(spreads[-1], (n_more, *spreads.shape[1:]))])
    return np.concatenate([phase, phase[-1] + step * np.arange(1, n_more + 1)]), (
        states,
        spreads,
        attractors,
    )


def correction(
    state: np.ndarray, spread: np.ndarray, slope: np.ndarray, rule: PhaseRule
) -> tuple[np.ndarray, np.ndarray]:
    """Gain (n, 2d) with which a difference of the state says how far it is ahead [s], and the
    precision (n, 2d, 2d) of the state.

    Parameters
    ----------
    state, spread, slope
        z(s) (n, 2d), R(s) (n, 2d, 2d) and z_s (n, 2d).
    """
    d = state.shape[1] // 2
    slower = np.hstack([np.zeros_like(state[:, :d]), UNKNOWN_PACE * state[:, d:]])
    precision = np.linalg.inv(spread + slower[:, :, None] * slower[:, None])
    weighted = np.einsum("nij,nj->ni", precision, slope)
    return (
        weighted / (np.einsum("ni,ni->n", weighted, slope) + rule.deviation**-2)[:, None],
        precision,
    )


class Turning(NamedTuple):
    """Orientation of a hand that turns (3, 3), angular velocity (3,) [rad/s] and acceleration (3,)
    [rad/s^2], at the pace that was shown.
    """

    rotation: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True, eq=False)
class Moment:
    """What belongs to one phase: state (2d,), position over velocity.

    Parameters
    ----------
    attractor : (d,)
    gain : (2d,)
        As of `correction`.
    spread : (d, d)
        Covariance of the position.
    acceleration : (d,)
        By (7.19).
    alone : (2d,)
        Share of velocity and acceleration that is not the motion of the frames: what the phase
        makes of them.
    turning
        Of the hand; None: it keeps the orientation of the start.
    """

    state: np.ndarray
    attractor: np.ndarray
    gain: np.ndarray
    spread: np.ndarray
    acceleration: np.ndarray
    alone: np.ndarray
    turning: Turning | None = None

    def paced(self, rate: float) -> tuple[np.ndarray, np.ndarray]:
        """Velocity and acceleration (d,) each while the phase goes on at a rate. Slower is what the
        phase makes of them; the frames do not wait.
        """
        d = len(self.attractor)
        velocity = self.state[d:] - (1.0 - rate) * self.alone[:d]
        return velocity, self.acceleration - (1.0 - rate**2) * self.alone[d:]

    def aside(self, away: np.ndarray) -> float:
        """How many standard deviations a robot that is so far away (d,) is beside the way of the
        phase: a robot that is on it is ahead or behind.
        """
        way = self.alone[: len(away)]
        precise = np.linalg.solve(self.spread, np.column_stack([away, way]))
        whole, shared, length = away @ precise[:, 0], away @ precise[:, 1], way @ precise[:, 1]
        along = shared**2 / length if length > 0.0 else 0.0
        return float(np.sqrt(max(whole - along, 0.0)))


class AutonomousPolicy:
    """The policy for one situation, made by `AutonomousDSGMR.policy`.

    `locate` finds the phase of a state, `advance` changes the phase over a step, and `attractor`
    gives y at a phase.

    Parameters
    ----------
    phase : (n,)
        Equally spaced phases [s].
    state : (n, 2d)
        Position and velocity that belong to each phase.
    spread : (n, 2d, 2d)
        Covariance of the state.
    attractors : (n, d)
        y at each phase.
    stiffness, damping
        Gains of (7.19), one number or (d,) [1/s^2, 1/s].
    rule
        PhaseRule.
    """

    def __init__(
        self,
        phase: np.ndarray,
        state: np.ndarray,
        spread: np.ndarray,
        attractors: np.ndarray,
        stiffness: ArrayLike,
        damping: ArrayLike,
        rule: PhaseRule,
    ):
        self.phase, self.state, self.attractors, self.rule = phase, state, attractors, rule
        d = attractors.shape[1]
        self._kp, self._kv = np.broadcast_to(stiffness, d), np.broadcast_to(damping, d)
        self._gain, self._precision = correction(
            state, spread, np.gradient(state, phase, axis=0), rule
        )

    @property
    def goal(self) -> np.ndarray:
        """Where the movement ends (d,)."""
        return self.attractors[-1]

    def locate(self, position: ArrayLike, velocity: ArrayLike) -> float:
        """Phase [s] whose state is nearest to position and velocity (d,), by Mahalanobis distance;
        the earliest of equals.
        """
        error = self._as_state(position, velocity) - self.state
        return float(
            self.phase[np.argmin(np.einsum("ni,nij,nj->n", error, self._precision, error))]
        )

    def advance(
        self, phase: float, position: ArrayLike, velocity: ArrayLike, step: float
    ) -> float:
        """Phase [s] a `step` [s] later, for a robot with this position and velocity (d,)."""
        return self._advanced(phase, self._as_state(position, velocity), as_number(step, "step"))

    def attractor(self, phase: float) -> np.ndarray:
        """Attractor (d,) at a phase [s]; constant before the start and after the end of the
        movement.
        """
        return self._at(self.attractors, phase)

    def gain(self, phase: np.ndarray) -> np.ndarray:
        """By how much a difference of the state (x, x') from that of the phase is ahead (n, 2d),
        at phases (n,) [s].
        """
        return self._at(self._gain, np.asarray(phase, dtype=float))

    def acceleration(self, phase: float, position: ArrayLike, velocity: ArrayLike) -> np.ndarray:
        """(7.19) at a phase: kp (y - x) - kv x' (d,).

        Parameters
        ----------
        position, velocity
            x and x' (d,).
        """
        state = self._as_state(position, velocity)
        d = len(self._kp)
        return self._kp * (self.attractor(phase) - state[:d]) - self._kv * state[d:]

    def run(
        self,
        position0: ArrayLike,
        velocity0: ArrayLike,
        *,
        step: float = 0.002,
        duration: float,
        push: Push | None = None,
    ) -> StateDriven:
        """Movement of a unit mass (7.19) in place of the robot, from position0 and velocity0 (d,),
        for `duration` [s].

        Parameters
        ----------
        push
            Function of time, position and velocity that returns an acceleration (d,) from outside,
            in units of the movement per s^2; it is constant over a step. Each step is exact for an
            attractor that is linear in between.
        """
        step, n_steps = (
            as_number(step, "step"),
            round(as_number(duration, "duration") / as_number(step, "step")),
        )
        d = len(self._kp)
        states, phases = np.empty((n_steps + 1, 2 * d)), np.empty(n_steps + 1)
        states[0] = self._as_state(position0, velocity0)
        phases[0] = self.locate(states[0, :d], states[0, d:])
        pushes = np.zeros((n_steps + 1, d))
        flow = _flow(step, self._kp, self._kv)
        for k in range(n_steps):
            if push is not None:
                pushes[k] = as_vector(
                    push(k * step, states[k, :d].copy(), states[k, d:].copy()), "push", d
                )
            phases[k + 1] = self._advanced(phases[k], states[k], step)
            now, later = (
                self.attractor(phase) + pushes[k] / self._kp for phase in phases[k : k + 2]
            )
            states[k + 1] = flow(states[k], now, later)
        attractor = self._at(self.attractors, phases)
        position, velocity = states[:, :d], states[:, d:]
        acceleration = self._kp * (attractor - position) - self._kv * velocity + pushes
        return StateDriven(
            step * np.arange(n_steps + 1), phases, attractor, position, velocity, acceleration
        )

    def _as_state(self, position: ArrayLike, velocity: ArrayLike) -> np.ndarray:
        d = len(self._kp)
        return np.concatenate(
            [as_vector(position, "position", d), as_vector(velocity, "velocity", d)]
        )

    def _advanced(self, phase: float, state: np.ndarray, step: float) -> float:
        ahead = float(self._at(self._gain, phase) @ (state - self._at(self.state, phase)))
        return min(phase + self.rule.rate(ahead) * step, float(self.phase[-1]))

    def _at(self, rows: np.ndarray, phase: float | np.ndarray) -> np.ndarray:
        """Rows (n, ...) interpolated at a phase, or at many."""
        place = np.clip(
            (phase - self.phase[0]) / (self.phase[1] - self.phase[0]), 0.0, len(rows) - 1.0
        )
        before = np.minimum(place.astype(int) if np.ndim(place) else int(place), len(rows) - 2)
        share = (place - before)[..., None] if np.ndim(place) else place - before
        return rows[before] + share * (rows[before + 1] - rows[before])


def _flow(
    step: float, stiffness: np.ndarray, damping: np.ndarray
) -> Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """A function for one exact step of (7.19): from state (2d,), attractor (d,) now and one step
    later, linear in between.
    """
    d = len(stiffness)
    parts = [discretise(step, float(p), float(v)) for p, v in zip(stiffness, damping, strict=True)]
    units = np.stack([np.ones(d), np.sqrt(stiffness)])
    transition = np.stack([part[0] for part in parts])  # (d, 2, 2)
    # (2, d)
    first, second = (
        np.stack([part[1] for part in parts]).T,
        np.stack([part[2] for part in parts]).T,
    )

    def flow(state: np.ndarray, now: np.ndarray, later: np.ndarray) -> np.ndarray:
        scaled = state.reshape(2, d) / units
        moved = (transition @ scaled.T[..., None])[..., 0].T
        return ((moved + first * now + second * later) * units).ravel()

    return flow


def _after(frame: StateFrame, time: float) -> StateFrame:
    """A frame so much later [s], with the velocity that it has."""
    if not isinstance(frame, MovingFrame):
        return frame
    way, still = time * frame.velocity, frame.frame
    moved = np.append(still.b[: -len(way)], still.b[-len(way) :] + way)
    return MovingFrame(TaskFrame._made(still.A, moved), frame.velocity, frame.attractor + way)


def lift(frame: TaskFrame | MovingFrame, n_inputs: int = 0) -> TaskFrame:
    """The frame of [t, u, x, x', y] that belongs to a frame of [t, u, y]: positions and attractors
    are shifted, velocities only turned. One that moves shifts each of the three by its own.

    Parameters
    ----------
    n_inputs
        Number of further inputs u after time.

    Raises
    ------
    ValueError
        For a frame that mixes time or inputs with movement variables.
    """
    first = 1 + n_inputs
    if isinstance(frame, MovingFrame):
        still, d = lift(frame.frame, n_inputs), len(frame.velocity)
        return TaskFrame._made(
            still.A, np.concatenate([still.b[: first + d], frame.velocity, frame.attractor])
        )
    d, matrix, offset = frame.n_dims - first, frame.A, frame.b
    if (
        np.any(matrix[:first, first:])
        or np.any(matrix[first:, :first])
        or np.any(matrix[0, 1:first])
    ):
        raise ValueError(
            "a frame that mixes time or inputs with movement variables has no velocities: let them"
            " pass through"
        )
    lifted, moved = np.zeros((3 * d + first, 3 * d + first)), np.zeros(3 * d + first)
    lifted[:first, :first], moved[:first] = matrix[:first, :first], offset[:first]
    for block in range(3):
        rows = slice(first + block * d, first + (block + 1) * d)
        lifted[rows, rows] = matrix[first:, first:] / (matrix[0, 0] if block == 1 else 1.0)
        moved[rows] = 0.0 if block == 1 else offset[first:]
    return TaskFrame._made(lifted, moved)
