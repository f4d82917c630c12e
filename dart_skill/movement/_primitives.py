"""Dynamic movement primitives (thesis 7.2, 7.3, equations (7.6)-(7.13)): a spring-damper that is
pulled to a goal, and a learned forcing term, a function of a phase. Discrete movements have a
point attractor, rhythmic ones a limit cycle.

With tau = 1 / duration (or period), progress s and s' = tau, (7.8) and (7.9) are
    d2x/ds2 = K (g - x) - D dx/ds + A f(z),   K = alpha_x beta_x,  D = alpha_x = 2 sqrt(K),  x' =
    tau dx/ds.
(7.6) is z = exp(-alpha_z s), or the angle z = 2 pi s. The forcing term f is (7.10), (7.11). All of
these are functions of s alone. So the pace of s does not change the path.

The default differs from the printed equations in some points. Options give the printed form.

* The goal g moves. With a fixed g the pull jumps at the start. In the first formulation f was
  multiplied by goal - start instead. Then f vanishes for a movement that returns to its start, and
  it becomes too large for a far goal if the movement was learned with the goal near the start.
  Here g begins at the start: it is the attractor (7.20) of a smooth path from start to goal
  (Hoffmann, Park, Pastor and Schaal, "Biologically-inspired dynamical systems for movement
  generation", ICRA 2009). The system is linear, so a new start or goal adds the path between old
  and new, and the goal is reached at the end. `goal_path="fixed"` is (7.8).
* All weights are found in one regression. (7.13) fits each kernel as if it were alone, although
  kernels overlap, and this smooths the movement too much. `regression="local"` is (7.13). Both fit
  accelerations; `regression="path"` fits the positions of the movement, in which it is linear,
  too.
* (7.10) has no factor z, so f never ends; (7.13) has z. Without z, f fades to zero over a quarter
  of the duration after the end. `phase_scaled=True` multiplies f by z.
* In (7.13) Psi also contains the weights of samples and demonstrations. The amplitude A of (7.12)
  is one.
* Kernels of rhythmic primitives are periodic, so that the cycle is smooth at its end. The thesis
  gives no such kernels.
* A goal, amplitude or pace that changes during a movement is followed with the time constant of
  the spring. So a new goal does not make the acceleration jump, and a new duration not the
  velocity, as in (7.8) and (7.9).
* A tracking error slows down the whole movement and not the phase alone, so the movement stays on
  its path while it waits (the adaptive tau of Ijspeert, Nakanishi, Hoffmann, Pastor and Schaal,
  "Dynamical movement primitives", Neural Computation 25, 2013).
"""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_finite, as_number, as_vector
from dart_skill.movement._demonstrations import (
    ShownMovement,
    as_demonstrations,
    as_period,
    estimate_period,
    mean_over_periods,
    shares,
)
from dart_skill.movement._forcing import (
    REGRESSIONS,
    GaussianKernels,
    PeriodicKernels,
    blend,
    blend_attractor,
    divide,
    integrate,
    within,
)
from dart_skill.movement._primitive import (
    Execution,
    Primitive,
    PrimitiveState,
    Trajectory,
    as_given,
)

RELEASE = 0.25
"""A forcing term without the factor z fades to zero within this share of the duration after the end.
"""
MAX_DECAY = 100.0
"""Largest decay of the phase, beyond which z vanishes before the end."""


class DiscretePrimitive(Primitive):
    """Point attractor: a movement from a start to a goal, in d dimensions that share the phase z
    ((7.6)-(7.13)).

    Attributes after `fit`; all but the first are means over the demonstrations:

    * start_, goal_ (d,).

    ; the module `primitives` explains the options:

    Parameters
    ----------
    n_basis
        Int, default 50. Number of kernels of (7.11).
    stiffness
        Float, default 156.25. alpha_x beta_x of (7.8), per duration squared; the damping is
        critical.
    canonical_decay
        Float, default 4.6. alpha_z of (7.6); z is exp(-alpha_z) at the end.
    phase_scaled
        Bool, default False. True: f is multiplied by z, so that it fades.
    goal_path
        "smooth" (default) or "fixed" as in (7.8).
    goal_window
        Two numbers in [0, 1], default (0, 1). Shares of the duration between which a smooth goal
        path leads from the start to the goal; before, it is at the start, afterwards at the goal.
    regression
        "joint" (default), "local" as in (7.13), or "path". The first two fit accelerations. "path"
        then finds the weights and the speed at the start for which the movement itself is nearest
        to the positions; for demonstrations whose start is noisy.

    Attributes
    ----------
    weights_ : (n_basis, d)
    duration_ : [s]
    start_velocity_ : (d,)
        In units of the position per second.
    """

    _LEARNED = ("start", "goal", "start_velocity", "duration")

    def __init__(
        self,
        n_basis: int = 50,
        *,
        stiffness: float = 156.25,
        canonical_decay: float = 4.6,
        phase_scaled: bool = False,
        goal_path: str = "smooth",
        goal_window: tuple[float, float] = (0.0, 1.0),
        regression: str = "joint",
    ):
        n_basis, decay = (
            as_count(n_basis, "n_basis", 2),
            as_number(canonical_decay, "canonical_decay"),
        )
        if decay > MAX_DECAY:
            raise ValueError(
                f"canonical_decay must be at most {MAX_DECAY:g}, got {decay:g}: z would vanish"
                " before the end"
            )
        if goal_path not in ("smooth", "fixed"):
            raise ValueError(f"goal_path must be 'smooth' or 'fixed', got {goal_path!r}")
        if regression not in (*REGRESSIONS, "path"):
            raise ValueError(
                f"regression must be one of {[*REGRESSIONS, 'path']}, got {regression!r}"
            )
        super().__init__(
            GaussianKernels(n_basis, decay),
            n_basis,
            stiffness,
            "joint" if regression == "path" else regression,
        )
        self.regression = regression
        self.canonical_decay, self.phase_scaled, self.goal_path = decay, phase_scaled, goal_path
        self.goal_window = as_window(goal_window)
        length = self.goal_window[1] - self.goal_window[0]
        self._smooth_path = blend_attractor(self.stiffness * length**2, self._damping * length)

    def fit(
        self,
        time: ArrayLike,
        position: ArrayLike,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        *,
        weights: ArrayLike | None = None,
        noise: float | None = None,
    ) -> DiscretePrimitive:
        """Learn from one demonstration, time (n,) [s], n >= 2, and position (n, d), or from
        sequences of several.

        Velocity and acceleration (n, d) that are not given are computed: by differences if the
        samples are clean, by `smooth_derivatives` if they are noisy.

        Parameters
        ----------
        weights
            One number per sample (n,), default 1; for several demonstrations one number, or one
            per sample, for each.
        noise
            Standard deviation of the positions, in their unit; estimated when None.

        Raises
        ------
        ValueError
            If a value is not finite, time does not increase, or a shape is wrong.
        """
        demonstrations = as_demonstrations(time, position, velocity, acceleration, weights, noise)
        durations = np.array([demo.time[-1] for demo in demonstrations])
        starts = np.array([demo.motion.position[0] for demo in demonstrations])
        goals = np.array([demo.motion.position[-1] for demo in demonstrations])
        speeds = (
            np.array([demo.motion.velocity[0] for demo in demonstrations]) * durations[:, None]
        )
        self._learn(demonstrations, starts, goals, durations)
        if self.regression == "path":
            speeds += self._approach_paths(demonstrations, starts, goals, speeds)
        share = shares(demonstrations)
        self.start_, self.goal_, self.duration_ = (
            share @ starts,
            share @ goals,
            float(share @ durations),
        )
        self.start_velocity_ = share @ speeds / self.duration_
        return self

    def _approach_paths(
        self,
        demonstrations: list[ShownMovement],
        starts: np.ndarray,
        goals: np.ndarray,
        speeds: np.ndarray,
    ) -> np.ndarray:
        """Change the weights so that the movements are nearest to the positions shown; returns the
        change (d,) of the speeds at the start.

        The movement is linear in weights and speed, so that is one least-squares problem. starts,
        goals (m, d); speeds (m, d), by progress.
        """
        rows, rest = [], []
        for demo, start, goal, speed in zip(demonstrations, starts, goals, speeds, strict=True):
            duration, root = demo.time[-1], np.sqrt(demo.weights)[:, None]
            state = self._begin(
                Execution(start, goal, np.ones(len(start)), duration), start, speed / duration, 0.0
            )
            rows.append(root * self._responses(demo.time / duration))
            rest.append(root * (demo.motion.position - self.open_loop(demo.time, state).position))
        equations = np.concatenate(rows)
        sizes = np.linalg.norm(equations, axis=0)
        sizes = np.where(sizes > 0.0, sizes, 1.0)
        change = (
            np.linalg.lstsq(equations / sizes, np.concatenate(rest), rcond=None)[0]
            / sizes[:, None]
        )
        self.weights_ = self.weights_ + change[:-1]
        return np.asarray(change[-1])

    def _responses(self, progress: np.ndarray) -> np.ndarray:
        """Movement (n, n_basis + 1) that each kernel alone makes from rest, and that a speed of 1
        at the start makes; progress (n,).
        """
        each, n = copy(self), self.n_basis
        each.weights_ = np.eye(n)
        rest = np.zeros(n)
        moved = each._follow(
            each._begin(Execution(rest, rest, np.ones(n), 1.0), rest, rest, 0.0), progress, None
        )[0]
        return np.column_stack([moved, progress * np.exp(-self._frequency * progress)])

    def begin(
        self,
        start: ArrayLike | None = None,
        *,
        goal: ArrayLike | None = None,
        duration: float | None = None,
        amplitude: ArrayLike = 1.0,
        velocity: ArrayLike | None = None,
    ) -> PrimitiveState:
        """State at the start of the movement, for `open_loop` and `step`.

        start, goal and velocity (d,) and duration [s] are those of the demonstrations unless
        given. amplitude, one number or (d,), is A of (7.8): it scales the forcing term, that is
        all of the movement but the way from start to goal.
        """
        self._fitted()
        duration = self.duration_ if duration is None else as_number(duration, "duration")
        amplitude = self._as_amplitude(amplitude)
        start, goal = (
            as_given(start, "start", self.start_),
            as_given(goal, "goal", self.goal_),
        )
        demonstrated = amplitude * self.start_velocity_ * (self.duration_ / duration)
        velocity = as_given(velocity, "velocity", demonstrated)
        return self._begin(Execution(start, goal, amplitude, duration), start, velocity, 0.0)

    def step(
        self,
        state: PrimitiveState,
        dt: float,
        *,
        goal: ArrayLike | None = None,
        duration: float | None = None,
        amplitude: ArrayLike | None = None,
        coupling: ArrayLike | None = None,
        tracking_error: ArrayLike | None = None,
        tolerance: float = 0.03,
    ) -> PrimitiveState:
        """State dt seconds later.

        To continue from a measured position or velocity: `dataclasses.replace(state,
        position=...)`.

        Parameters
        ----------
        goal : (d,)
            New values from now on; None for no change.
        duration : [s]
            New values from now on; None for no change.
        amplitude
            New values from now on; None for no change.
        coupling : (d,)
            C of (7.5), an acceleration during this step, for example of a push.
        tracking_error : (d,)
            Actual minus planned position. It slows the movement down to the share 1 / (1 +
            |error|^2 / tolerance^2) of its pace, so that the movement waits for a robot that is
            held.
        tolerance
            The error that halves the pace, in the unit of the position.
        """
        state = self._with_wishes(state, goal, duration, amplitude, ("goal", "duration"))
        return self._advance(state, dt, coupling, tracking_error, tolerance)

    def _gate(self, progress: np.ndarray) -> np.ndarray:
        if self.phase_scaled:
            return self._kernels.phase(progress)
        return 1.0 - blend((progress - 1.0) / RELEASE)

    def _goal_path(self, progress: np.ndarray) -> np.ndarray:
        """g of (7.8) as a share of the way from start to goal."""
        if self.goal_path == "fixed":
            return np.ones(len(progress))
        return self._smooth_path(within(progress, self.goal_window))


def as_window(window: ArrayLike) -> tuple[float, float]:
    """Two shares of the duration, the first less than the second, checked."""
    begins, ends = as_vector(window, "goal_window", 2).tolist()
    if not 0.0 <= begins < ends <= 1.0:
        raise ValueError(
            f"goal_window must be two shares in order, between 0 and 1, got {begins:g}, {ends:g}"
        )
    return begins, ends


CYCLE_STEPS = 200
"""Least number of steps per period with which the limit cycle is computed."""


class RhythmicPrimitive(Primitive):
    """Limit cycle: a movement that repeats about a baseline, in d dimensions that share the phase
    angle.

    After `fit`:

    Parameters
    ----------
    n_basis
        Int, default 50. Number of kernels.
    stiffness
        Float, default 156.25. alpha_x beta_x of (7.8), per period squared; the damping is
        critical.
    regression
        "joint" (default) or "local" as in (7.13).

    Attributes
    ----------
    weights_ : (n_basis, d)
    baseline_ : (d,)
        Mean position over whole periods.
    period_ : [s]
    """

    _LEARNED = ("baseline", "period")

    def __init__(self, n_basis: int = 50, *, stiffness: float = 156.25, regression: str = "joint"):
        n_basis = as_count(n_basis, "n_basis", 3)
        super().__init__(PeriodicKernels(n_basis), n_basis, stiffness, regression)

    def fit(
        self,
        time: ArrayLike,
        position: ArrayLike,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        *,
        period: float | None = None,
        weights: ArrayLike | None = None,
        noise: float | None = None,
    ) -> RhythmicPrimitive:
        """Learn as `DiscretePrimitive.fit` does; the phase is zero at the first sample of each
        demonstration.

        Parameters
        ----------
        period : [s]
            When None it is estimated from each demonstration, which must then span about two
            periods.
        position, velocity, acceleration, weights, noise
            As of `DiscretePrimitive.fit`.

        Raises
        ------
        ValueError
            Also if a demonstration does not repeat.
        """
        demonstrations = as_demonstrations(time, position, velocity, acceleration, weights, noise)
        tracks = [(demo.time, demo.motion.position) for demo in demonstrations]
        periods = np.array(
            [
                estimate_period(*track) if period is None else as_period(period, *track)
                for track in tracks
            ]
        )
        baselines = np.array(
            [mean_over_periods(*track, each) for track, each in zip(tracks, periods, strict=True)]
        )
        self._learn(demonstrations, baselines, baselines, periods)
        share = shares(demonstrations)
        self.baseline_, self.period_ = share @ baselines, float(share @ periods)
        return self

    def limit_cycle(
        self,
        phase: float = 0.0,
        *,
        baseline: ArrayLike | None = None,
        period: float | None = None,
        amplitude: ArrayLike = 1.0,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Position and velocity (d,) on the limit cycle at a phase in units of the period.

        It is the state that is the same again after one period.

        Parameters
        ----------
        baseline, amplitude
            Of the cycle; None for the baseline that was learned.
        """
        wanted = self._execution(baseline, period, amplitude)
        n_steps = CYCLE_STEPS + 2 * int(np.ceil(1.0 / self._max_step))
        steps = divide(np.linspace(0.0, 1.0, n_steps + 1), 1.0)
        drive = wanted.amplitude * self._transformation(
            float(as_finite(phase, "phase", 0)) + steps.stages
        )
        driven = integrate(
            steps, self.stiffness, self._damping, np.zeros((2, self.n_dims)), drive
        )[:, -1]
        carried = integrate(
            steps, self.stiffness, self._damping, np.eye(2), np.zeros((len(drive), 2))
        )[:, -1]
        position, slope = np.linalg.solve(np.eye(2) - carried, driven)
        return wanted.goal + position, slope / wanted.duration

    def begin(
        self,
        start: ArrayLike | None = None,
        *,
        baseline: ArrayLike | None = None,
        period: float | None = None,
        amplitude: ArrayLike = 1.0,
        velocity: ArrayLike | None = None,
        phase: float = 0.0,
    ) -> PrimitiveState:
        """State at a phase in units of the period, for `open_loop` and `step`.

        start and velocity (d,) are those of the limit cycle unless given. baseline (d,) and period
        [s] are those of the demonstrations unless given. amplitude, one number or (d,), scales the
        movement about its baseline.
        """
        position, speed = self.limit_cycle(
            phase, baseline=baseline, period=period, amplitude=amplitude
        )
        start, velocity = (
            as_given(start, "start", position),
            as_given(velocity, "velocity", speed),
        )
        return self._begin(
            self._execution(baseline, period, amplitude), start, velocity, self._wrapped(phase)
        )

    def step(
        self,
        state: PrimitiveState,
        dt: float,
        *,
        baseline: ArrayLike | None = None,
        period: float | None = None,
        amplitude: ArrayLike | None = None,
        coupling: ArrayLike | None = None,
        tracking_error: ArrayLike | None = None,
        tolerance: float = 0.03,
    ) -> PrimitiveState:
        """State dt seconds later; arguments as in `DiscretePrimitive.step`. progress stays within
        one period.
        """
        state = self._with_wishes(state, baseline, period, amplitude, ("baseline", "period"))
        return self._advance(state, dt, coupling, tracking_error, tolerance)

    def _execution(
        self, baseline: ArrayLike | None, period: float | None, amplitude: ArrayLike
    ) -> Execution:
        self._fitted()
        baseline = as_given(baseline, "baseline", self.baseline_)
        return Execution(
            baseline,
            baseline,
            self._as_amplitude(amplitude),
            self.period_ if period is None else as_number(period, "period"),
        )

    def _wrapped(self, progress: float) -> float:
        return float(np.mod(progress, 1.0))

    def _gate(self, progress: np.ndarray) -> np.ndarray:
        return np.ones(len(progress))

    def _goal_path(self, progress: np.ndarray) -> np.ndarray:
        return np.ones(len(progress))


__all__ = ["DiscretePrimitive", "Execution", "PrimitiveState", "RhythmicPrimitive", "Trajectory"]
