"""DS-GMR: a task-parameterised mixture of attractor trajectories, retrieved by regression on time and
executed as a spring-damper (thesis 7.5).

Demonstrations become attractors by (7.20), are encoded by (7.21), retrieved by (3.4) and (3.5), and
reproduced by (7.19).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.checks import as_samples
from dart_skill.movement._placement import FrameCourse
from dart_skill.movement._time import as_stamps, uniform_step
from dart_skill.movement.attractor import as_gains, attractor_from_motion, critical_damping, follow_attractor
from dart_skill.movement.differentiation import smooth_derivatives
from dart_skill.movement.task_parameterised import TaskParameterisedMixture


@dataclass(frozen=True, eq=False)
class Reproduction:
    """A planned movement: time (n,), attractor (n, d) with covariance (n, d, d), and the motion (n, d) of
    (7.19) towards it.
    """

    time: np.ndarray
    attractor: np.ndarray
    covariance: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class DSGMR:
    """Movement primitive over d movement variables, in features [t, y] with m = d + 1 columns.

    stiffness kp in 1/s^2 and damping kv in 1/s are one number or one per movement variable; damping None is
    critical, 2 sqrt(kp). Further options go to `TaskParameterisedMixture`; `mixture_` holds the fitted one.
    """

    def __init__(
        self,
        n_components: int,
        stiffness: ArrayLike = 200.0,
        damping: ArrayLike | None = None,
        **mixture_options,
    ):
        self.stiffness = as_gains(stiffness, None, "stiffness", strict=True)
        self.damping = critical_damping(self.stiffness) if damping is None else as_gains(damping, None, "damping", strict=False)
        self._mixture = TaskParameterisedMixture(n_components, **mixture_options)

    @classmethod
    def from_mixture(cls, mixture: TaskParameterisedMixture, stiffness: ArrayLike = 200.0, damping: ArrayLike | None = None) -> DSGMR:
        """Model around a mixture that is already fitted."""
        model = cls(len(mixture.priors_), stiffness, damping)
        model._mixture = model.mixture_ = mixture
        return model

    def encode(
        self,
        time: ArrayLike,
        positions: ArrayLike,
        *,
        noise: float | ArrayLike | None = None,
        at: ArrayLike | None = None,
    ) -> np.ndarray:
        """Attractor features [t, y] (m, 1 + d) of noisy movement variables (n, d) at stamps (n,); noise and
        at as in `smooth_derivatives`.
        """
        motion = smooth_derivatives(time, positions, noise=noise, at=at)
        attractor = attractor_from_motion(*motion, self.stiffness, self.damping)
        return np.column_stack([time if at is None else at, attractor])

    def fit(
        self,
        attractors: Sequence[ArrayLike],
        frames: Sequence[Sequence[FrameCourse]],
        weights: Sequence | None = None,
        *,
        rng: np.random.Generator | None = None,
    ) -> DSGMR:
        """Learn from attractor features [t, y] (n_i, m) per demonstration; frames, weights and rng as in
        `TaskParameterisedMixture.fit`.
        """
        self.mixture_ = self._mixture.fit(attractors, frames, weights, rng=rng)
        return self

    def retrieve(self, frames: Sequence[FrameCourse], time: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Attractor mean (n, d) and covariance (n, d, d) in new frames at stamps (n,); a frame that moves is given by a list
        with one for each stamp, a missing one by None.
        """
        if not hasattr(self, "mixture_"):
            raise ValueError("this DSGMR holds no model yet; call fit first")
        time = as_stamps(time)
        return self.mixture_.regress(frames, time[:, None], [0], np.arange(1, self.mixture_.n_dims))

    def reproduce(
        self,
        frames: Sequence[FrameCourse],
        time: ArrayLike,
        position0: ArrayLike,
        velocity0: ArrayLike,
        push: ArrayLike | None = None,
    ) -> Reproduction:
        """Movement in new frames at equally spaced stamps (n,), n >= 2, from position0 and velocity0 (d,) at
        the first of them. push: acceleration (n, d) that acts from outside, straight between the stamps.
        """
        time = as_stamps(time, minimum=2)
        attractor, covariance = self.retrieve(frames, time)
        push = np.zeros_like(attractor) if push is None else as_samples(push, "push", attractor.shape[1])
        if len(push) != len(time):
            raise ValueError(f"push must have {len(time)} rows, one per stamp, got {len(push)}")
        # A push acts as if the attractor were moved by push / kp.
        pulled = attractor + push / self.stiffness
        motion = follow_attractor(pulled, uniform_step(time), position0, velocity0, self.stiffness, self.damping)
        return Reproduction(time, attractor, covariance, *motion)
