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

from dart_skill.mixture import GaussianMixture
from dart_skill.mixture._checks import as_number, as_samples
from dart_skill.movement._attractor_model import AttractorModel
from dart_skill.movement._placement import Frame, FrameCourse
from dart_skill.movement._time import as_stamps, uniform_step
from dart_skill.movement.attractor import attractor_from_motion, follow_attractor
from dart_skill.movement.differentiation import smooth_derivatives
from dart_skill.movement.task_parameterised import TaskParameterisedMixture

SAME_STEP = 1e-6
"""Share by which a given step may differ from that of the stamps."""


@dataclass(frozen=True, eq=False)
class Reproduction:
    """A planned movement: time (n,), attractor (n, d) with covariance (n, d, d), None if nobody asked for it, and the motion (n, d) of
    (7.19) towards it.
    """

    time: np.ndarray
    attractor: np.ndarray
    covariance: np.ndarray | None
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class DSGMR(AttractorModel):
    """Movement primitive over d movement variables, in features [t, u, y] with m = 1 + q + d columns: time, q further inputs such as the
    distance of a target, attractor.

    * n_components: int; K of the mixture.
    * stiffness: one number or (d,) [1/s^2], default 200; kp of (7.19).
    * damping: one number or (d,) [1/s], default None; kv of (7.19), None for critical, 2 sqrt(kp).
    * n_inputs: int, default 0; q, how many inputs of the regression stand beside time. Within a component the attractor is linear in them.
    * partition: "em" or "time", default "em"; EM decides what belongs to a component, or each has its own interval of time.
    * overlap: float, default 0.7; deviation of a component in units of its interval, for partition "time".
    * mixture_options: further hyper-parameters of `TaskParameterisedMixture`, such as start or covariance_floor, of which partition "time"
      takes only the latter.

    Fitted: mixture_, the `TaskParameterisedMixture` over [t, u, y].
    """

    @classmethod
    def from_mixture(
        cls, mixture: TaskParameterisedMixture, stiffness: ArrayLike = 200.0, damping: ArrayLike | None = None, n_inputs: int = 0
    ) -> DSGMR:
        """Model around a mixture that is already fitted."""
        model = cls(len(mixture.priors_), stiffness, damping, n_inputs=n_inputs)
        model._mixture = model.mixture_ = model._with_outputs(mixture)
        return model

    def encode(
        self,
        time: ArrayLike,
        positions: ArrayLike,
        *,
        noise: float | ArrayLike | None = None,
        at: ArrayLike | None = None,
        inputs: ArrayLike | None = None,
    ) -> np.ndarray:
        """Features [t, u, y] (n, m) of noisy movement variables: their attractor (7.20).

        * time: (n_0,) [s]; stamps of the samples.
        * positions: (n_0, d).
        * noise, at: as in `smooth_derivatives`; at (n,) are the stamps of the features, default those of the samples.
        * inputs: (q,) or (n, q), default None for q = 0; what the movement depends on beside time.
        """
        motion = smooth_derivatives(time, positions, noise=noise, at=at)
        return self.features(time if at is None else at, attractor_from_motion(*motion, self.stiffness, self.damping), inputs)

    def features(self, time: ArrayLike, attractor: ArrayLike, inputs: ArrayLike | None = None) -> np.ndarray:
        """Features [t, u, y] (n, m) of an attractor (n, d) that is known already, at stamps (n,) [s]; inputs as in `encode`."""
        attractor = as_samples(attractor, "attractor")
        return np.column_stack([self._with_inputs(time, inputs, len(attractor)), attractor])

    def fit(
        self,
        attractors: Sequence[ArrayLike],
        frames: Sequence[Sequence[FrameCourse]],
        weights: Sequence | None = None,
        *,
        rng: np.random.Generator | None = None,
    ) -> DSGMR:
        """Learn from demonstrations.

        * attractors: one array (n_i, m) per demonstration, features [t, u, y] as `encode` or `features` give them.
        * frames: P task frames per demonstration, over the m features, as in `TaskParameterisedMixture.fit`.
        * weights: one number or (n_i,) per demonstration, default None for all alike; how much each counts (8.4.2), none if 0.
        * rng: needed where the mixture_options draw random centres.
        """
        self._learn(attractors, frames, weights, rng)
        return self

    def product(self, frames: Sequence[Frame | None]) -> GaussianMixture:
        """(7.21): the mixture over [t, u, y] in the world for P new frames; None leaves a frame out of the product."""
        return self._fitted.product(frames)

    def retrieve(
        self, frames: Sequence[FrameCourse], time: ArrayLike, inputs: ArrayLike | None = None, *, covariance: bool = True
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Attractor mean (n, d) and covariance (n, d, d) in new frames, (3.4) and (3.5).

        * frames: P of them; a frame that moves is given by a list with one for each stamp, a missing one by None.
        * time: (n,) [s].
        * inputs: as in `encode`.
        * covariance: bool, default True; whether it is computed, or None.
        """
        mixture, queries = self._fitted, self._with_inputs(time, inputs)
        n_inputs = queries.shape[1]
        return mixture.regress(frames, queries, np.arange(n_inputs), np.arange(n_inputs, mixture.n_dims), covariance)

    def reproduce(
        self,
        frames: Sequence[FrameCourse],
        time: ArrayLike,
        position0: ArrayLike,
        velocity0: ArrayLike,
        push: ArrayLike | None = None,
        *,
        inputs: ArrayLike | None = None,
        step: float | None = None,
        covariance: bool = True,
    ) -> Reproduction:
        """Movement in new frames, the unit mass of (7.19) standing in for the robot.

        * frames, inputs, covariance: as in `retrieve`.
        * time: (n,) [s], n >= 2, equally spaced.
        * position0, velocity0: (d,); the state at the first stamp.
        * push: (n, d) [1/s^2 of the movement variables], default None for none; acceleration from outside, straight between the stamps.
        * step: float [s], default None for that of the stamps; the exact one, which summed-up stamps lose in the last digits.
        """
        time = as_stamps(time, minimum=2)
        attractor, spread = self.retrieve(frames, time, inputs, covariance=covariance)
        motion = follow_attractor(self._pulled(attractor, push), _step(time, step), position0, velocity0, self.stiffness, self.damping)
        return Reproduction(time, attractor, spread, *motion)

    def _pulled(self, attractor: np.ndarray, push: ArrayLike | None) -> np.ndarray:
        """Where the attractor (n, d) seems to be under a push: it acts as if that were moved by push / kp."""
        if push is None:
            return attractor
        push = as_samples(push, "push", attractor.shape[1])
        if len(push) != len(attractor):
            raise ValueError(f"push must have {len(attractor)} rows, one per stamp, got {len(push)}")
        return attractor + push / self.stiffness


def _step(time: np.ndarray, given: float | None) -> float:
    """The step of equally spaced stamps (n,) [s]: the given one if they agree."""
    measured = uniform_step(time)
    if given is None:
        return measured
    step = as_number(given, "step")
    if abs(step - measured) > SAME_STEP * step:
        raise ValueError(f"step is {step:g} s, but the stamps are {measured:g} s apart; leave it out, or give such stamps")
    return step
