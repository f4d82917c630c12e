"""A skill that was learned: DS-GMR over poses of the hand in the task frames of the skill, and
plans for new situations.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dart_skill.arm import Gains, GainsOverTime, HandPath, MotionPlan
from dart_skill.common.checks import to_the_nanosecond
from dart_skill.common.situation import Situation
from dart_skill.mixture import GaussianMixture
from dart_skill.movement import (
    DSGMR,
    Motion,
    TaskFrame,
    angular_velocity,
    attractor_from_motion,
    attractor_with_gains,
    smooth_derivatives,
    stable_gains,
    stiffness_from_covariance,
)
from dart_skill.recording import HAND, Demonstration
from dart_skill.skills.learning._movement_model import RATE, MovementModel
from dart_skill.skills.learning._pose_features import (
    VECTORS,
    frame_of,
    orientations,
    pose_features,
    with_free_length,
    with_prior,
)
from dart_skill.skills.learning._prepared import PreparedMovement
from dart_skill.skills.observation import position_noise
from dart_skill.skills.protocol import Skill

Encoded = tuple[DSGMR, list[np.ndarray], list[list[TaskFrame]]]
"""A model, and the features and frames of the demonstrations to which it was fitted."""


class NoPlan(ValueError):
    """No plan for this situation; the message says why."""


class LearnedSkill(MovementModel):
    """A skill learned from demonstrations.

    Parameters
    ----------
    skill
        What is particular to it.
    demonstrations
        At least `skill.settings.least_demonstrations`.
    demonstrations
        Tuple, as they were given.

    Attributes
    ----------
    movements
        The same as numbers.
    duration
        Float [s], of a movement, the mean of those that were shown. All are stretched to it before
        they are learned.
    start
        Pose of the hand before the movement, the median.
    registration
        Of cameras and arm, told from the demonstrations.
    offset
        (3,) [m], what practice has found to repeat in the misses, in the axes of the body that the
        skill corrects.

    Raises
    ------
    ValueError
        Names one that cannot be learned from.
    """

    def __init__(self, skill: Skill, demonstrations: Sequence[Demonstration]):
        super().__init__(skill, demonstrations)
        self._misses: list[np.ndarray] = []
        self._models = self._fit()

    # learning

    def _fit(self) -> dict[str, DSGMR]:
        """A model of each vector of the features, which does not believe what few demonstrations
        have in common by chance.
        """
        models = {}
        for vector, (model, _, _) in self._fitted().items():
            mixture = with_prior(model.mixture_, len(self.movements), self.skill.settings.prior)
            mixture = mixture if vector == "position" else with_free_length(mixture)
            models[vector] = DSGMR.from_mixture(
                mixture, self._stiffness(vector), n_inputs=model.n_inputs
            )
        return models

    def bic(self) -> float:
        """Bayesian information criterion of the mixtures as the demonstrations alone make them:
        lower is better.
        """
        return sum(
            model.bic(features, frames) for model, features, frames in self._fitted().values()
        )

    def _fitted(self) -> dict[str, Encoded]:
        clock = np.arange(0.0, self._clock_end, 1.0 / RATE)
        motions = [
            smooth_derivatives(
                one.time * self.duration / one.duration, one.features, noise=_noise(one), at=clock
            )
            for one in self.movements
        ]
        return {vector: self._fit_vector(vector, clock, motions) for vector in VECTORS}

    def _fit_vector(self, vector: str, clock: np.ndarray, motions: Sequence[Motion]) -> Encoded:
        inputs = [list(self.skill.inputs(one.situation)) for one in self.movements]
        s, stiffness = self.skill.settings, self._stiffness(vector)
        model = DSGMR(
            s.components,
            stiffness,
            n_inputs=len(inputs[0]),
            partition=s.partition,
            overlap=s.overlap,
        )
        own = [Motion(*(part[:, VECTORS[vector]] for part in motion)) for motion in motions]
        attractors = [
            attractor_from_motion(one.position, one.velocity, one.acceleration, stiffness)
            for one in own
        ]
        features = [
            model.features(clock, one, given or None)
            for one, given in zip(attractors, inputs, strict=True)
        ]
        frames = [self._frames(one.situation, vector) for one in self.movements]
        return model.fit(features, frames), features, frames

    def _stiffness(self, vector: str) -> float:
        s = self.skill.settings
        return s.stiffness if vector == "position" else s.orientation_stiffness

    def _frames(self, situation: Situation, vector: str) -> list[TaskFrame]:
        return [
            frame_of(pose, vector, len(self.skill.inputs(situation)))
            for pose in self.skill.chosen_frames(situation)
        ]

    # planning

    def plan(self, situation: Situation) -> MotionPlan:
        """A movement for a situation, which need not say where the hand starts.

        Raises
        ------
        NoPlan
            If there is none.
        """
        situation = situation if HAND in situation.poses else situation.moved(HAND, self.start)
        aimed = self.skill.corrected(situation, self.offset)
        try:
            path, attractor, turned = self._movement(aimed)
        except ValueError as error:
            raise NoPlan(str(error)) from error
        s = self.skill.settings
        attractor, gains = (
            self._with_gains(aimed, path)
            if s.stiffness_range
            else (attractor, Gains.critical(s.stiffness))
        )
        plan = MotionPlan(
            path=path,
            attractor_position=attractor,
            attractor_quaternion=turned,
            position_gains=gains,
            orientation_gains=Gains.critical(s.orientation_stiffness),
            start_posture=self._start_posture,
            end=path.duration,
            what=self.skill.name,
            events=self._events,
            speed=self.skill.speed,
            registration=self.registration,
            posture=self._postures(path),
        )
        return self.skill.refine(plan, aimed, self)

    def mixture(self, situation: Situation) -> GaussianMixture:
        """The mixture (7.21) of time and position in the world for a situation that says where the
        hand starts.
        """
        return self._models["position"].product(self._frames(situation, "position"))

    def _movement(self, situation: Situation) -> tuple[HandPath, np.ndarray, np.ndarray]:
        """The path of the hand, and its attractor: positions (n, 3) and quaternions (n, 4)."""
        s, given, start = (
            self.skill.settings,
            list(self.skill.inputs(situation)),
            situation.pose(HAND),
        )
        clock = to_the_nanosecond(np.arange(0.0, self._clock_end, s.step))
        begin = pose_features(start.position[None], start.quaternion[None])[0]
        moved, x_axis, z_axis = (
            self._models[vector].reproduce(
                self._frames(situation, vector),
                clock,
                begin[columns],
                np.zeros(3),
                inputs=given or None,
                step=s.step,
                covariance=False,
            )
            for vector, columns in VECTORS.items()
        )
        # throws do without
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_matrix(orientations(np.hstack([x_axis.position, z_axis.position])))
        spin = angular_velocity(clock, turn.as_quat())
        growth = np.gradient(spin, clock, axis=0)
        path = HandPath(
            time=clock,
            position=moved.position,
            quaternion=turn.as_quat(),
            velocity=np.hstack([moved.velocity, spin]),
            acceleration=np.hstack([moved.acceleration, growth]),
        )
        # (7.20) for a turn: so far ahead of the hand, as a rotation vector, that the hand turns as
        # planned.
        lead = attractor_from_motion(np.zeros_like(spin), spin, growth, s.orientation_stiffness)
        return path, moved.attractor, (Rotation.from_rotvec(lead) * turn).as_quat()

    def _with_gains(
        self, situation: Situation, path: HandPath
    ) -> tuple[np.ndarray, GainsOverTime]:
        """Other attractors (n, 3), and gains with which they make the same path: the firmer the
        more the demonstrations agreed.
        """
        inputs = list(self.skill.inputs(situation)) or None
        covariance = self._models["position"].retrieve(
            self._frames(situation, "position"), path.time, inputs
        )[1]
        assert covariance is not None
        wanted = stiffness_from_covariance(covariance, *self.skill.settings.stiffness_range)
        stiffness, damping = stable_gains(path.time, wanted)
        motion = Motion(path.position, path.velocity[:, :3], path.acceleration[:, :3])
        return attractor_with_gains(motion, stiffness, damping), GainsOverTime(stiffness, damping)

    def _postures(self, path: HandPath) -> np.ndarray:
        """What the arm's free motion aims at along a path (n, 7): the mean of what was shown,
        turned about the base to where the hand is.

        The hand leaves one freedom to seven joints. The person who guided the arm decided on it,
        too.
        """
        shown = []
        for one in self._with_joints:
            time = path.time * one.duration / self.duration
            postures, at = (
                one.postures(time),
                np.searchsorted(one.time, time).clip(max=len(one.time) - 1),
            )
            postures[:, 0] = _near(postures[:, 0] - _azimuths(one.features[at]), 0.0)
            shown.append(postures)
        mean = np.mean(shown, axis=0)
        mean[:, 0] = _near(mean[:, 0] + _azimuths(path.position), self._start_posture[0])
        return mean


def _noise(movement: PreparedMovement) -> np.ndarray:
    """Standard deviation of each feature (9,) as it was recorded: the three of a vector alike."""
    return np.repeat(
        [
            position_noise(movement.time, movement.features[:, columns])
            for columns in VECTORS.values()
        ],
        3,
    )


def _azimuths(positions: np.ndarray) -> np.ndarray:
    """Azimuths (n,) of places (n, 3 or more) about the axis of the base [rad], without jumps."""
    return np.unwrap(np.arctan2(positions[:, 1], positions[:, 0]))


def _near(angles: np.ndarray, first: float) -> np.ndarray:
    """The same angles (n,) by so many full turns less or more that the first one is near to
    `first` [rad].
    """
    return angles + 2.0 * np.pi * np.round((first - angles[0]) / (2.0 * np.pi))
