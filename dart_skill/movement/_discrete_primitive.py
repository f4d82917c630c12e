"""The point attractor: a primitive that goes from a start to a goal."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.checks import as_count, as_number
from dart_skill.movement._demonstrations import as_demonstrations, shares
from dart_skill.movement._forcing import GaussianKernels
from dart_skill.movement._goal_path import BlendAttractor, blend
from dart_skill.movement._primitive import Execution, Primitive, PrimitiveState

# Share of the duration over which a forcing term that does not fade with z is released after the end.
RELEASE = 0.25
MAX_DECAY = 100.0


class DiscretePrimitive(Primitive):
    """Point attractor: a movement from a start to a goal, in d dimensions that share the phase z.

    n_basis: kernels of (7.11). stiffness: alpha_x beta_x of (7.8), in units of the duration; damping is critical.
    canonical_decay: alpha_z of (7.6), so that z ends at exp(-alpha_z). phase_scaled: whether f is multiplied by z
    and so fades. goal_path: "smooth" or "fixed". regression: "joint" or "local". The head of `primitives` says more.

    After `fit`: weights_ (n_basis, d), start_ and goal_ (d,), duration_ in seconds, and start_velocity_ (d,) in 1/s,
    means over the demonstrations.
    """

    def __init__(
        self,
        n_basis: int = 50,
        *,
        stiffness: float = 156.25,
        canonical_decay: float = 4.6,
        phase_scaled: bool = False,
        goal_path: str = "smooth",
        regression: str = "joint",
    ):
        n_basis, decay = as_count(n_basis, "n_basis", 2), as_number(canonical_decay, "canonical_decay")
        if decay > MAX_DECAY:
            raise ValueError(f"canonical_decay must be at most {MAX_DECAY:g}, got {decay:g}: z would vanish before the end")
        if goal_path not in ("smooth", "fixed"):
            raise ValueError(f"goal_path must be 'smooth' or 'fixed', got {goal_path!r}")
        super().__init__(GaussianKernels(n_basis, decay), n_basis, stiffness, regression)
        self.canonical_decay, self.phase_scaled, self.goal_path = decay, phase_scaled, goal_path
        self._smooth_path = BlendAttractor(self.stiffness, self._damping)

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
        """Learn from time (n,) in seconds, n >= 2, and position (n, d), or from sequences of demonstrations.

        Missing derivatives come from differences of clean samples and from `smooth_derivatives` of noisy ones;
        noise: their standard deviation, estimated when None. weights: one per sample, or one (or one per sample)
        for each demonstration. ValueError for what is not finite, not increasing, or of the wrong shape.
        """
        demonstrations = as_demonstrations(time, position, velocity, acceleration, weights, noise)
        durations = np.array([demo.time[-1] for demo in demonstrations])
        starts = np.array([demo.motion.position[0] for demo in demonstrations])
        goals = np.array([demo.motion.position[-1] for demo in demonstrations])
        speeds = np.array([demo.motion.velocity[0] for demo in demonstrations]) * durations[:, None]
        self._learn(demonstrations, starts, goals, durations)
        share = shares(demonstrations)
        self.start_, self.goal_, self.duration_ = share @ starts, share @ goals, float(share @ durations)
        self.start_velocity_ = share @ speeds / self.duration_
        return self

    def begin(
        self,
        start: ArrayLike | None = None,
        *,
        goal: ArrayLike | None = None,
        duration: float | None = None,
        amplitude: ArrayLike = 1.0,
        velocity: ArrayLike | None = None,
    ) -> PrimitiveState:
        """State from which `open_loop` lays out and `step` executes the movement.

        start, goal and velocity (d,), duration in seconds: as demonstrated unless given. amplitude, one number or
        (d,), is A of (7.8): it scales what the movement does apart from going to the goal.
        """
        self._fitted()
        duration = self.duration_ if duration is None else as_number(duration, "duration")
        amplitude = self._as_amplitude(amplitude)
        start, goal = self._as_dims(start, "start", self.start_), self._as_dims(goal, "goal", self.goal_)
        demonstrated = amplitude * self.start_velocity_ * (self.duration_ / duration)
        velocity = self._as_dims(velocity, "velocity", demonstrated)
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

        goal, duration, amplitude: new values from now on. coupling (d,): C of (7.5), an acceleration during this
        step such as that of a push. tracking_error (d,), actual minus planned position, slows the movement down to
        the share 1 / (1 + |error|^2 / tolerance^2) of its pace, so that a robot that is held is waited for; tolerance,
        in units of the position, halves it. A position or velocity that was measured enters by
        `dataclasses.replace(state, position=...)`.
        """
        state = self._with_wishes(state, goal, duration, amplitude, ("goal", "duration"))
        return self._advance(state, dt, coupling, tracking_error, tolerance)

    def _gate(self, progress: np.ndarray) -> np.ndarray:
        if self.phase_scaled:
            return self._kernels.phase(progress)
        if progress.max(initial=0.0) <= 1.0:
            return np.ones(len(progress))
        return 1.0 - blend((progress - 1.0) / RELEASE)

    def _goal_path(self, progress: np.ndarray) -> np.ndarray:
        """g of (7.8) as a share of the way from start to goal."""
        return np.ones(len(progress)) if self.goal_path == "fixed" else self._smooth_path(progress)
