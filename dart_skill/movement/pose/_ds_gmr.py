"""DS-GMR on poses: a task-parameterised mixture of attractor poses, retrieved by regression on
time, and followed by a spring-damper on the manifold (thesis 7.5, with R^3 x S3 in the place of
R^d).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.movement._ds_gmr import OVERLAP, AttractorModel, step_of
from dart_skill.movement._placement import Weights
from dart_skill.movement._time import as_stamps
from dart_skill.movement.pose._em import PoseCourse
from dart_skill.movement.pose._gaussians import PoseMixture
from dart_skill.movement.pose._motion import (
    PoseMotion,
    as_pair,
    follow_pose_attractor,
    pose_attractor,
    pose_motion,
)
from dart_skill.movement.pose._task_parameterised import PoseFrames, TaskParameterisedPoseMixture


@dataclass(frozen=True, eq=False)
class PoseReproduction:
    """A planned movement: time (n,) [s].

    Parameters
    ----------
    attractor : (n, 7)
        With its covariance (n, 6, 6) in the tangent space, [m] and [rad] in world axes.
    pose : (n, 7)
        Velocity and acceleration (n, 6) of the motion that follows it.
    """

    time: np.ndarray
    attractor: np.ndarray
    covariance: np.ndarray
    pose: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class PoseDSGMR(AttractorModel):
    """Movement of position and orientation that is driven by a clock.

    The features are rows [t, u, y] with q + 8 columns: time, q further inputs, and the attractor
    pose.

    Attribute after `fit`: mixture_, the fitted TaskParameterisedPoseMixture over [t, u, y].

    Parameters
    ----------
    n_components
        Int, number of components of the mixture; at least one for each third of a turn.
    stiffness
        Kp [1/s^2], default 200; one number, or two for position and orientation.
    damping
        Kv [1/s], likewise; default None: critical, 2 sqrt(kp).
    n_inputs
        Int, default 0. q, the number of further inputs.
    partition
        "time" (default) or "em". Each component has its own interval of time, or EM finds which
        samples belong to it. Where frames are turned in all directions, the demonstrations are far
        apart in each of them. With few of them EM then separates demonstrations from each other
        instead of parts of the movement.
    overlap
        Float, default 0.7. Standard deviation of a component, relative to its interval; for
        partition "time".
    mixture_options
        Hyper-parameters of `TaskParameterisedPoseMixture`.
    """

    _MIXTURE = TaskParameterisedPoseMixture
    _GROWS = False
    mixture_: TaskParameterisedPoseMixture

    def __init__(
        self,
        n_components: int,
        stiffness: ArrayLike = 200.0,
        damping: ArrayLike | None = None,
        *,
        n_inputs: int = 0,
        partition: str = "time",
        overlap: float = OVERLAP,
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

    @staticmethod
    def _gains(value: ArrayLike, name: str, strict: bool) -> np.ndarray:
        return as_pair(value, name, strict)

    def _with_outputs(self, mixture: TaskParameterisedPoseMixture) -> TaskParameterisedPoseMixture:
        if mixture.n_numbers != self.n_inputs + 1:
            raise ValueError(
                f"features must have {self.n_inputs + 8} columns: time, {self.n_inputs} further"
                f" inputs (n_inputs) and a pose, got {mixture.n_numbers + 7}; make them with encode"
            )
        return mixture

    def _fitted_to(self) -> str:
        if not hasattr(self, "mixture_"):
            return ""
        inputs = f" and {self.n_inputs} further inputs" if self.n_inputs else ""
        return f"{self._shown()}positions and orientations{inputs}, {self.mixture_._fitted_to()}"

    def encode(
        self,
        time: ArrayLike,
        poses: ArrayLike,
        *,
        noise: ArrayLike | None = None,
        at: ArrayLike | None = None,
        inputs: ArrayLike | None = None,
    ) -> np.ndarray:
        """Features [t, u, y] (n, q + 8) of one demonstration, from noisy poses: the attractor is
        computed by (7.20).

        Parameters
        ----------
        time
            Stamps (k,) of the samples [s].
        poses
            (k, 7), position and unit quaternion; signs do not matter.
        noise
            Standard deviations of position [m] and orientation [rad], as in `pose_motion`;
            default: estimated.
        at
            Stamps (n,) of the features [s], default those of the samples.
        inputs
            The further inputs u, (q,) or (n, q); default: there are none.
        """
        motion = pose_motion(time, poses, noise=noise, at=at)
        return self.features(time if at is None else at, motion, inputs)

    def features(
        self, time: ArrayLike, motion: PoseMotion, inputs: ArrayLike | None = None
    ) -> np.ndarray:
        """Features [t, u, y] (n, q + 8) of a motion whose velocity and acceleration are known, at
        stamps (n,) [s].

        Parameters
        ----------
        inputs
            The further inputs u, (q,) or (n, q).
        """
        attractor = pose_attractor(motion, self.stiffness, self.damping)
        return np.column_stack([self._with_inputs(time, inputs, len(attractor)), attractor])

    def fit(
        self,
        attractors: Sequence[ArrayLike],
        frames: PoseFrames,
        weights: Weights = None,
        *,
        rng: np.random.Generator | None = None,
    ) -> PoseDSGMR:
        """Learn from demonstrations.

        Parameters
        ----------
        attractors
            For each demonstration its features [t, u, y] (n_i, q + 8), from `encode` or
            `features`.
        frames
            For each demonstration P task frames, as in `TaskParameterisedPoseMixture`.
        weights
            For each demonstration one number or one per sample (n_i,); default: all count alike.
        rng
            Random generator, only for the hyper-parameter start="kmeans".

        Returns
        -------
        PoseDSGMR
            Self.
        """
        self._learn(attractors, frames, weights, rng)
        return self

    def bic(
        self, attractors: Sequence[ArrayLike], frames: PoseFrames, weights: Weights = None
    ) -> float:
        """Bayesian information criterion for demonstrations, which are given as to `fit`: lower is
        better.
        """
        return self._fitted.bic(attractors, frames, weights)

    def product(self, frames: Sequence[PoseCourse]) -> PoseMixture:
        """(7.21): the mixture over [t, u, y] in the world, for P new frames; None for a missing
        one.
        """
        return self._fitted.product(frames)

    def retrieve(
        self, frames: Sequence[PoseCourse], time: ArrayLike, inputs: ArrayLike | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Attractor (n, 7) and its covariance (n, 6, 6) in the tangent space, in new frames.

        Parameters
        ----------
        frames
            P task frames. A moving frame is a list with one frame for each stamp, a missing frame
            is None.
        time
            Stamps (n,) [s].
        inputs
            The further inputs u, (q,) or (n, q); default: there are none.
        """
        return self._fitted.regress(frames, self._with_inputs(time, inputs))

    def reproduce(
        self,
        frames: Sequence[PoseCourse],
        time: ArrayLike,
        pose0: ArrayLike,
        velocity0: ArrayLike | None = None,
        push: ArrayLike | None = None,
        *,
        inputs: ArrayLike | None = None,
        step: float | None = None,
    ) -> PoseReproduction:
        """Movement of a hand of unit mass and inertia in place of the robot, in new frames.

        Parameters
        ----------
        frames, inputs
            As in `retrieve`.
        time
            Equally spaced stamps (n,) [s], n >= 2.
        pose0, velocity0
            Pose (7,) and velocity (6,) [m/s, rad/s] at the first stamp; by default it is at rest.
        push
            Acceleration (n, 6) [m/s^2, rad/s^2] from outside, in world axes, linear between the
            stamps; default: none.
        step
            Float [s], default: computed from the stamps.
        """
        time = as_stamps(time, minimum=2)
        attractor, covariance = self.retrieve(frames, time, inputs)
        start = np.zeros(6) if velocity0 is None else velocity0
        motion = follow_pose_attractor(
            attractor, step_of(time, step), pose0, start, self.stiffness, self.damping, push
        )
        return PoseReproduction(time, attractor, covariance, *motion)
