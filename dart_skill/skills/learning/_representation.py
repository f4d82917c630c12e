"""How the movements of a skill are encoded, chosen by the setting `representation`: fitted to
demonstrations once, asked for each new situation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dart_skill.arm import HandPath, Pace
from dart_skill.common.checks import to_the_nanosecond
from dart_skill.common.situation import Situation
from dart_skill.mixture import GaussianMixture
from dart_skill.movement import (
    DSGMR,
    Motion,
    PhaseModel,
    TaskFrame,
    angular_velocity,
    attractor_from_motion,
    smooth_derivatives,
)
from dart_skill.movement.pose import PerStepPoses, PoseDSGMR, PoseFrame, follow_pose_attractor
from dart_skill.recording import HAND
from dart_skill.skills.learning._pose_features import (
    VECTORS,
    frame_of,
    orientations,
    pose_features,
    shrunk,
    with_free_length,
    with_prior,
)
from dart_skill.skills.learning._prepared import RATE, PreparedMovement
from dart_skill.skills.observation import position_noise
from dart_skill.skills.protocol import Part, Skill, SkillSettings, ThrowSettings, model_type

if TYPE_CHECKING:
    from dart_skill.movement import AutonomousDSGMR
    from dart_skill.skills.learning._learned import LearnedSkill

SHOWN_OVERLAP = 0.7
"""Standard deviation of the Gaussians that stand for many steps, in their intervals."""
TIMES_FOUND = 1e-3
"""EM stops at this rise of the mean log-likelihood where components are fitted anew: only their
times and shares are taken from it.
"""


class Encoded(NamedTuple):
    """A model as the demonstrations alone make it, and the features and frames of these."""

    model: DSGMR
    features: list[np.ndarray]
    frames: list[list[TaskFrame]]


def learns_throws(skill: Skill) -> bool:
    """Whether what a skill learns are throws, over the position and two angles of the hand."""
    from dart_skill.skills.learning._throwing import ThrowingSkill

    return issubclass(model_type(skill), ThrowingSkill)


class Representation(Part):
    """Base of the representations: of poses of the hand, made of a `LearnedSkill`, and of throws,
    which ask for `of_throws` alone.

    Parameters
    ----------
    shown
        Demonstrations that were prepared, with their skill.

    Attributes
    ----------
    drive
        "time" or "state" of the arm, which moves the model on.
    model
        Of one that the state drives: what is asked at every state of the arm.
    partition
        How components divide time: "time", at equal intervals, or "em".
    tells_covariance
        Whether the covariance of the attractor is known.
    encodes_throws
        Whether it has a model of throws (`of_throws`).
    """

    drive = "time"
    model: PhaseModel
    partition = "time"
    tells_covariance = True
    encodes_throws = False

    @classmethod
    def refusal(cls, skill: Skill) -> str:
        if learns_throws(skill) and not cls.encodes_throws:
            return "throws are learned over the position and two angles of the hand"
        return ""

    @classmethod
    def driven_by(cls, skill: Skill) -> str:
        """What moves the model of a skill on, "time" or "state" of the arm. Default: `drive`."""
        return cls.drive

    @classmethod
    def least(cls, settings: SkillSettings) -> int:
        """Number of demonstrations that are needed. Default: what the settings say."""
        return settings.least_demonstrations

    @classmethod
    def packed(cls, model: Any) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        """What is asked at every state of the arm, as `unpacked` takes it: what JSON has, and
        arrays, by name.
        """
        raise NotImplementedError

    @classmethod
    def unpacked(
        cls, settings: SkillSettings, about: dict[str, Any], arrays: dict[str, np.ndarray]
    ) -> PhaseModel:
        """What `packed` took apart, for a skill with these settings; ValueError or KeyError for
        what does not fit.
        """
        raise NotImplementedError

    @classmethod
    def of_throws(cls, settings: ThrowSettings) -> DSGMR | AutonomousDSGMR:
        """The model that is fitted to throws: over time, the distance where the settings say so,
        and attractors of x, y, z, alpha, beta.
        """
        raise NotImplementedError

    @classmethod
    def overlap(cls, settings: SkillSettings) -> float | None:
        """Width of components that are fitted anew about the times that EM found; None: they stay
        as EM made them.
        """
        return settings.overlap or None if cls.partition == "em" else None

    @classmethod
    def mixture_of_throws(cls, settings: ThrowSettings) -> dict[str, Any]:
        """Hyper-parameters of the mixture of a model of throws."""
        overlap = cls.overlap(settings)
        n_inputs = int(settings.distance_input)
        how: dict[str, Any] = {
            "n_inputs": n_inputs,
            "partition": cls.partition,
            "overlap": overlap,
        }
        how |= {"n_shared": 1 + n_inputs} if settings.inputs_once else {}
        return how | ({"tolerance": TIMES_FOUND} if overlap else {})

    def __init__(self, shown: LearnedSkill):
        self.shown, self.settings = shown, shown.skill.settings

    def _inputs(self, situation: Situation) -> list[float]:
        return list(self.shown.skill.inputs(situation))

    def bic(self) -> float:
        """Bayesian information criterion of the mixtures as the demonstrations alone make them:
        lower is better.
        """
        raise NotImplementedError

    def mixture(self, situation: Situation) -> GaussianMixture:
        """The mixture (7.21) of time and position in the world for a situation that says where the
        hand starts.
        """
        raise NotImplementedError

    def way(self, movement: PreparedMovement, clock: np.ndarray) -> np.ndarray:
        """Where the hand would be led in the situation of a movement (m, 3) [m], at instants (m,)
        of the clock on which the mean movement takes as long as it does.
        """
        raise NotImplementedError


class ClockedRepresentation(Representation):
    """Base of those that make a path beforehand."""

    def movement(self, situation: Situation) -> tuple[HandPath, np.ndarray, np.ndarray]:
        """The path of the hand, and its attractor: positions (n, 3) and quaternions (n, 4).

        Parameters
        ----------
        situation
            Says where the hand starts.

        Raises
        ------
        ValueError
            If there is none.
        """
        raise NotImplementedError

    def pace(self, path: HandPath, held: np.ndarray) -> Pace | None:
        """How the state of the arm drives the clock of a plan with such a path. Default: None, it
        goes as fast as time.

        Parameters
        ----------
        held
            (n,) whether the hand holds something at an instant of the path.
        """
        return None

    def shown_at(self, situation: Situation, time: np.ndarray) -> np.ndarray:
        """Instants (n,) [s] of the mean movement at which was shown what a plan for a situation does
        at others (n,). Default: the same.
        """
        return time

    def covariance(self, situation: Situation, time: np.ndarray) -> np.ndarray:
        """Covariance of the attractor's position (n, 3, 3) [m^2] at instants (n,) [s], (3.5)."""
        raise NotImplementedError

    def way(self, movement: PreparedMovement, clock: np.ndarray) -> np.ndarray:
        path = self.shown.plan(movement.situation).path
        return np.column_stack([np.interp(clock, path.time, one) for one in path.position.T])


def path_of_axes(
    clock: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    acceleration: np.ndarray,
    axes: np.ndarray,
) -> HandPath:
    """The path of a hand of which position, velocity and acceleration (n, 3) are known, and two
    axes (n, 6), at instants (n,) [s].

    Raises
    ------
    ValueError
        Where the axes say no orientation.
    """
    from scipy.spatial.transform import Rotation  # throws do without

    turn = Rotation.from_matrix(orientations(axes)).as_quat()
    spin = angular_velocity(clock, turn)
    growth = np.gradient(spin, clock, axis=0)
    return HandPath(
        time=clock,
        position=position,
        quaternion=turn,
        velocity=np.hstack([velocity, spin]),
        acceleration=np.hstack([acceleration, growth]),
    )


def turned_ahead(path: HandPath, stiffness: float) -> np.ndarray:
    """(7.20) for the turn of a path: quaternions (n, 4) so far ahead of the hand, as a rotation
    vector, that the hand turns as planned.

    Parameters
    ----------
    stiffness
        Of the orientation [1/s^2], critically damped.
    """
    from scipy.spatial.transform import Rotation  # throws do without

    spin, growth = path.velocity[:, 3:], path.acceleration[:, 3:]
    lead = attractor_from_motion(np.zeros_like(spin), spin, growth, stiffness)
    return (Rotation.from_rotvec(lead) * Rotation.from_quat(path.quaternion)).as_quat()


class EqualIntervals(ClockedRepresentation):
    """DS-GMR of the position and of two axes of the hand, a model for each, whose components have
    equal intervals of time.
    """

    encodes_throws = True

    @classmethod
    def of_throws(cls, settings: ThrowSettings) -> DSGMR:
        return DSGMR(
            settings.components, settings.stiffness_of_features, **cls.mixture_of_throws(settings)
        )

    def __init__(self, shown: LearnedSkill):
        super().__init__(shown)
        self._models = {vector: self._learned(vector) for vector in VECTORS}

    def _learned(self, vector: str) -> DSGMR:
        """A model of a vector which does not believe what few demonstrations have in common by
        chance.
        """
        model = self._fitted(vector).model
        mixture = with_prior(model.mixture_, len(self.shown.movements), self.settings.prior)
        mixture = mixture if vector == "position" else with_free_length(mixture)
        return DSGMR.from_mixture(mixture, self._stiffness(vector), n_inputs=model.n_inputs)

    def _fitted(self, vector: str) -> Encoded:
        movements, stiffness = self.shown.movements, self._stiffness(vector)
        clock = np.arange(0.0, self.shown.clock_end, 1.0 / RATE)
        inputs = [self._inputs(one.situation) for one in movements]
        model = DSGMR(
            self.settings.components,
            stiffness,
            n_inputs=len(inputs[0]),
            partition=self.partition,
            overlap=self.overlap(self.settings),
        )
        motions = [self._motion(one, vector, clock) for one in movements]
        attractors = [attractor_from_motion(*one, stiffness) for one in motions]
        features = [
            model.features(clock, one, given or None)
            for one, given in zip(attractors, inputs, strict=True)
        ]
        frames = [self._frames(one.situation, vector) for one in movements]
        return Encoded(model.fit(features, frames), features, frames)

    def _motion(self, movement: PreparedMovement, vector: str, clock: np.ndarray) -> Motion:
        """What was seen of a vector, stretched to the mean duration, at instants of the clock."""
        features = movement.features[:, VECTORS[vector]]
        noise = position_noise(movement.time, features)
        stretched = movement.time * self.shown.duration / movement.duration
        return smooth_derivatives(stretched, features, noise=noise, at=clock)

    def bic(self) -> float:
        return sum(one.model.bic(one.features, one.frames) for one in map(self._fitted, VECTORS))

    def _stiffness(self, vector: str) -> float:
        s = self.settings
        return s.stiffness if vector == "position" else s.rotational_stiffness

    def _frames(self, situation: Situation, vector: str) -> list[TaskFrame]:
        n_inputs = len(self._inputs(situation))
        poses = self.shown.skill.chosen_frames(situation)
        return [frame_of(pose, vector, n_inputs) for pose in poses]

    def mixture(self, situation: Situation) -> GaussianMixture:
        return self._models["position"].product(self._frames(situation, "position"))

    def covariance(self, situation: Situation, time: np.ndarray) -> np.ndarray:
        found = self._models["position"].retrieve(
            self._frames(situation, "position"), time, self._inputs(situation) or None
        )[1]
        assert found is not None
        return found

    def movement(self, situation: Situation) -> tuple[HandPath, np.ndarray, np.ndarray]:
        s, start = self.settings, situation.pose(HAND)
        clock = to_the_nanosecond(np.arange(0.0, self.shown.clock_end, s.step))
        begin = pose_features(start.position[None], start.quaternion[None])[0]
        moved, x_axis, z_axis = (
            self._models[vector].reproduce(
                self._frames(situation, vector),
                clock,
                begin[columns],
                np.zeros(3),
                inputs=self._inputs(situation) or None,
                step=s.step,
                covariance=False,
            )
            for vector, columns in VECTORS.items()
        )
        axes = np.hstack([x_axis.position, z_axis.position])
        path = path_of_axes(clock, moved.position, moved.velocity, moved.acceleration, axes)
        return path, moved.attractor, turned_ahead(path, s.rotational_stiffness)


class FoundComponents(EqualIntervals):
    """The same with components whose times EM finds, which then get even widths."""

    partition = "em"


class OnManifold(ClockedRepresentation):
    """DS-GMR of position and orientation together, on R^3 x S3."""

    def __init__(self, shown: LearnedSkill):
        super().__init__(shown)
        self._model, *_ = self._fitted()
        self._model.mixture_.covariances_ = shrunk(
            self._model.mixture_.covariances_, len(shown.movements), self.settings.prior, vectors=2
        )

    def _fitted(self) -> tuple[PoseDSGMR, list[np.ndarray], list[list[PoseFrame]]]:
        s, movements = self.settings, self.shown.movements
        clock = np.arange(0.0, self.shown.clock_end, 1.0 / RATE)
        inputs = [self._inputs(one.situation) for one in movements]
        model = PoseDSGMR(
            s.components, (s.stiffness, s.rotational_stiffness), n_inputs=len(inputs[0])
        )
        features = [
            model.encode(
                one.time * self.shown.duration / one.duration,
                one.poses,
                at=clock,
                inputs=given or None,
            )
            for one, given in zip(movements, inputs, strict=True)
        ]
        frames = [self._frames(one.situation) for one in movements]
        return model.fit(features, frames), features, frames

    def _frames(self, situation: Situation) -> list[PoseFrame]:
        poses = self.shown.skill.chosen_frames(situation)
        return [PoseFrame(pose.position, pose.quaternion) for pose in poses]

    def bic(self) -> float:
        model, features, frames = self._fitted()
        return model.bic(features, frames)

    def mixture(self, situation: Situation) -> GaussianMixture:
        product, first = self._model.product(self._frames(situation)), 1 + self._model.n_inputs
        kept = [0, *range(first, first + 3)]
        return GaussianMixture.from_parameters(
            product.priors_,
            product.means_[:, kept],
            product.covariances_[:, kept][:, :, kept],
        )

    def covariance(self, situation: Situation, time: np.ndarray) -> np.ndarray:
        found = self._model.retrieve(
            self._frames(situation), time, self._inputs(situation) or None
        )[1]
        return found[:, :3, :3]

    def movement(self, situation: Situation) -> tuple[HandPath, np.ndarray, np.ndarray]:
        start, step = situation.pose(HAND), self.settings.step
        clock = to_the_nanosecond(np.arange(0.0, self.shown.clock_end, step))
        made = self._model.reproduce(
            self._frames(situation),
            clock,
            np.concatenate([start.position, start.quaternion]),
            inputs=self._inputs(situation) or None,
            step=step,
        )
        path = HandPath(
            clock, made.pose[:, :3], made.pose[:, 3:], made.velocity, made.acceleration
        )
        return path, made.attractor[:, :3], made.attractor[:, 3:]


class PerStep(ClockedRepresentation):
    """A Gaussian at each step of time, of the attractor of position and orientation together, on
    R^3 x S3. It has no components, and no further inputs.
    """

    def __init__(self, shown: LearnedSkill):
        super().__init__(shown)
        if self._inputs(shown.movements[0].situation):
            raise ValueError(
                f"the skill '{shown.skill.name}' has further inputs beside time, and 'per_step'"
                " learns none: choose another representation"
            )
        s, clock = self.settings, np.arange(0.0, shown.clock_end, 1.0 / RATE)
        self._gains = (s.stiffness, s.rotational_stiffness)
        encode = PoseDSGMR(1, self._gains).encode
        self._features = [
            encode(one.time * shown.duration / one.duration, one.poses, at=clock)
            for one in shown.movements
        ]
        self._learned_in = [self._frames(one.situation) for one in shown.movements]
        self._model = PerStepPoses(len(clock), covariance_prior=s.prior)
        self._model.fit(self._features, self._learned_in)

    def _frames(self, situation: Situation) -> list[PoseFrame]:
        poses = self.shown.skill.chosen_frames(situation)
        return [PoseFrame(pose.position, pose.quaternion) for pose in poses]

    def bic(self) -> float:
        likelihood = self._model.log_likelihood(self._features, self._learned_in)
        n = sum(len(one) for one in self._features)
        return -2.0 * likelihood + self._model.n_parameters * float(np.log(n))

    def mixture(self, situation: Situation) -> GaussianMixture:
        """Each of `components` equal intervals of time has one Gaussian: that of its middle, along
        the path.
        """
        poses, covariance = self._model.retrieve(self._frames(situation))
        time, k = self._model.time_, self.settings.components
        interval = (time[-1] - time[0]) / k
        middles = np.searchsorted(time, time[0] + interval * (0.5 + np.arange(k)))
        slopes = np.gradient(poses[:, :3], time, axis=0)[middles]
        along = np.hstack([np.ones((k, 1)), slopes]) * SHOWN_OVERLAP * interval
        spread = along[:, :, None] * along[:, None, :]
        spread[:, 1:, 1:] += covariance[middles, :3, :3]
        means = np.column_stack([time[middles], poses[middles, :3]])
        return GaussianMixture.from_parameters(np.full(k, 1.0 / k), means, spread)

    def covariance(self, situation: Situation, time: np.ndarray) -> np.ndarray:
        return self._model.retrieve(self._frames(situation), time)[1][:, :3, :3]

    def movement(self, situation: Situation) -> tuple[HandPath, np.ndarray, np.ndarray]:
        start, step = situation.pose(HAND), self.settings.step
        clock = to_the_nanosecond(np.arange(0.0, self.shown.clock_end, step))
        attractor = self._model.retrieve(self._frames(situation), clock)[0]
        begin = np.concatenate([start.position, start.quaternion])
        moved = follow_pose_attractor(attractor, step, begin, np.zeros(6), self._gains)
        path = HandPath(
            clock, moved.pose[:, :3], moved.pose[:, 3:], moved.velocity, moved.acceleration
        )
        return path, attractor[:, :3], attractor[:, 3:]
