"""The limit cycle: a primitive that repeats."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_finite, as_number
from dart_skill.movement._demonstrations import as_demonstrations, shares
from dart_skill.movement._forcing import PeriodicKernels
from dart_skill.movement._period import as_period, estimate_period, mean_over_periods
from dart_skill.movement._primitive import Execution, Primitive, PrimitiveState
from dart_skill.movement._runge_kutta import divide, integrate

# Least number of steps per period with which the limit cycle is computed.
CYCLE_STEPS = 200


class RhythmicPrimitive(Primitive):
    """Limit cycle: a movement that repeats about a baseline, in d dimensions that share the phase
    angle.

    Parameters:

    * n_basis: int, default 50. Number of kernels.
    * stiffness: float, default 156.25. alpha_x beta_x of (7.8), per period squared; the damping is
      critical.
    * regression: "joint" (default) or "local" as in (7.13).

    Attributes after `fit`:

    * weights_ (n_basis, d).
    * baseline_ (d,): mean position over whole periods.
    * period_ [s].
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

        period [s]: when None it is estimated from each demonstration, which must then span about
        two periods. ValueError also if a demonstration does not repeat. position, velocity,
        acceleration, weights, noise: as of `DiscretePrimitive.fit`.
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

        It is the state that is the same again after one period. baseline, amplitude: of the cycle;
        None for the baseline that was learned.
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
            self._as_dims(start, "start", position),
            self._as_dims(velocity, "velocity", speed),
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
        baseline = self._as_dims(baseline, "baseline", self.baseline_)
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
