"""Movement primitives (thesis 7.3) as representations: discrete ones, learned from one
demonstration or several, whose start is the hand and whose goal stands in the last task frame.

A movement is learned as the last task frame sees it, so that its shape turns with that frame. The
goal is the mean of where the hand ended there. The arm acts on the clock (7.6): C of (7.5) is how
far the hand is ahead along its way, or behind, and a hand that is held makes the movement wait. A
skill whose bodies rest gets a plan with such a clock (`Pace`); one whose bodies move
(`Skill.bodies_move`) is asked at every state of the arm (`PrimitiveCourse`).
"""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

import numpy as np

from dart_skill.arm import HandPath, Pace
from dart_skill.common import quaternions
from dart_skill.common.checks import to_the_nanosecond
from dart_skill.common.situation import Pose, Situation
from dart_skill.mixture import GaussianMixture
from dart_skill.movement import (
    DiscretePrimitive,
    PrimitiveCourse,
    SeenMovement,
    TaskFrame,
    ahead_gain,
    answers,
    choose_goal_window,
    goal_share,
)
from dart_skill.movement.pose import (
    DiscretePosePrimitive,
    PoseMotion,
    PosePrimitiveCourse,
    pose_answers,
    pose_attractor,
    pose_motion,
)
from dart_skill.recording import HAND
from dart_skill.skills.learning._policy import phase_rule
from dart_skill.skills.learning._pose_features import pose_features
from dart_skill.skills.learning._prepared import RATE, PreparedMovement
from dart_skill.skills.learning._representation import ClockedRepresentation, path_of_axes
from dart_skill.skills.learning._shown_frames import frames_along
from dart_skill.skills.protocol import Skill, SkillSettings

if TYPE_CHECKING:
    from dart_skill.skills.learning._learned import LearnedSkill

COURSE_STEP = 0.005
"""Between two instants at which the answers of a primitive are known to the arm [s]."""
ALIKE = 0.003
"""Standard deviation of what was shown about the movement at least [m]: one demonstration says
nothing of it, and several agree by chance.
"""
MEETS = 0.1
"""Way to the goal on which a hand that carries something may meet what the goal stands in [m]: there
the movement does not wait, so that contact is felt."""
SHORT = np.square([1e-3, 1e-3])
"""Least variances of the Gaussians of kernels, of time [s^2] and of a coordinate [m^2]."""

AnyPrimitive = TypeVar("AnyPrimitive", DiscretePrimitive, DiscretePosePrimitive)


class Shown(NamedTuple):
    """A demonstration as the last task frame sees it at the instants of the clock: places, and
    orientations (m, 4).
    """

    places: SeenMovement
    turns: np.ndarray


class Primitives(ClockedRepresentation, Generic[AnyPrimitive]):
    """Base of the two: `fit`, what it says of the demonstrations, and how the arm drives it.

    Attributes
    ----------
    primitive
        The fitted one, over what `_features` makes of poses in the last task frame.
    model
        Its answers, for a skill that reacts.
    """

    tells_covariance = False
    primitive: AnyPrimitive
    _kind: type[AnyPrimitive]
    _asked: type[PrimitiveCourse]

    @classmethod
    def driven_by(cls, skill: Skill) -> str:
        return "state" if skill.bodies_move else "time"

    @classmethod
    def least(cls, settings: SkillSettings) -> int:
        return 1

    @classmethod
    def packed(cls, model: Any) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        return {}, model.arrays()

    @classmethod
    def unpacked(
        cls, settings: SkillSettings, about: dict[str, Any], arrays: dict[str, np.ndarray]
    ) -> PrimitiveCourse:
        kind = cls._asked
        return kind(
            **_fields(kind, arrays), stiffness=settings.stiffness, rule=phase_rule(settings)
        )

    def __init__(self, shown: LearnedSkill):
        super().__init__(shown)
        self.reacts = shown.skill.reacts
        if any(self._inputs(one.situation) for one in shown.movements):
            raise ValueError(
                "a primitive has no further inputs, and the demonstrations have numbers: choose"
                " another representation"
            )
        self._clock = np.arange(0.0, shown.clock_end, 1.0 / RATE)
        seen = [self._seen(one) for one in shown.movements]
        progress = self._clock / self._clock[-1]
        window = choose_goal_window(progress, [one.places for one in seen])
        share = goal_share(progress, window)
        self._learned = [
            self._features(np.hstack([one.places.at_rest(share), one.turns])) for one in seen
        ]
        # among bodies that move a movement is cut where the hand moves already, and it begins at rest
        how = "path" if self.reacts else "joint"
        self.primitive = self._kind(self.settings.components, goal_window=window, regression=how)
        self.primitive.fit([self._clock] * len(seen), self._learned)
        self._left = [rows - self._again(rows) for rows in self._learned]
        self._spread = np.sqrt(
            np.mean([np.square(one[:, :3]).mean(1) for one in self._left], axis=0) + ALIKE**2
        )
        self.model = self._course()

    # demonstrations

    def _seen(self, movement: PreparedMovement) -> Shown:
        stretched = movement.time * self.shown.duration / movement.duration
        try:
            poses = pose_motion(stretched, movement.poses, at=self._clock).pose
        except ValueError as error:
            raise ValueError(f"demonstration {movement.id}: {error}") from error
        axes, origin = self._goal_frames(movement)
        back = quaternions.of_matrices(axes) * quaternions.CONJUGATE
        places = SeenMovement.among(poses[:, :3], axes, origin)
        return Shown(places, quaternions.product(back, poses[:, 3:]))

    def _goal_frames(self, movement: PreparedMovement) -> tuple[np.ndarray, np.ndarray]:
        """Axes (m, 3, 3) and origin (m, 3) of the last task frame along a demonstration."""
        n = len(self._clock)
        if not self.reacts:
            frame = self._goal_frame(movement.situation)
            return np.tile(frame.rotation, (n, 1, 1)), np.tile(frame.position, (n, 1))
        along = [one.frame for one in frames_along(self.shown, movement, self._clock)[-1]]
        axes, origin = (np.array([part(one) for one in along]) for part in (_axes, _origin))
        # far from the frame its noise of orientation would be one of the place
        turns = np.hstack([origin, quaternions.of_matrices(axes)])
        smooth = pose_motion(self._clock, turns).pose
        return quaternions.matrices(smooth[:, 3:]), smooth[:, :3]

    def _goal_frame(self, situation: Situation) -> Pose:
        return self.shown.skill.chosen_frames(situation)[-1]

    def _features(self, poses: np.ndarray) -> np.ndarray:
        """What is learned of poses (m, 7) in the last task frame; its first three columns are the
        position.
        """
        raise NotImplementedError

    def _again(self, shown: np.ndarray) -> np.ndarray:
        """What the primitive makes between the ends of a demonstration (m, d)."""
        begin = self._begin(shown[0], shown[-1])
        return self._laid_out(begin, self._clock)

    def _begin(self, start: np.ndarray, goal: np.ndarray | None = None) -> Any:
        """From rest."""
        rest = np.zeros(self.primitive.n_dims)
        return self.primitive.begin(start, goal=goal, velocity=rest)

    def _laid_out(self, begin: Any, time: np.ndarray) -> np.ndarray:
        """Features (m, d) at instants (m,) of a movement that begins so."""
        raise NotImplementedError

    def _course(self) -> PrimitiveCourse:
        """What is asked at every state of the arm."""
        raise NotImplementedError

    # what it says

    def bic(self) -> float:
        """See `Representation`: of independent errors of each coordinate along the movements, which
        those of neighbouring samples are not. So it chooses many kernels.
        """
        errors = np.concatenate(self._left)
        n, d = errors.shape
        squares = np.maximum(np.square(errors).mean(0), 1e-12)
        kernels = self.settings.components * d
        return float(n * np.log(2.0 * np.pi * np.e * squares).sum() + kernels * np.log(n))

    def mixture(self, situation: Situation) -> GaussianMixture:
        """See `Representation`: a Gaussian for each kernel (7.11), of the demonstrations as they
        would have been in the situation.
        """
        frame = self._goal_frame(situation)
        local = self._features(row(frame.sees(situation.pose(HAND))))[0]
        path = self._laid_out(self._begin(local), self._clock)[:, :3]
        rows: np.ndarray = np.stack([path + left[:, :3] for left in self._left])
        rows = frame.position + rows @ frame.rotation.T
        time = np.broadcast_to(self._clock[:, None], (*rows.shape[:2], 1))
        samples = np.concatenate([time, rows], axis=2).reshape(-1, 4)
        weights = self.primitive.activations(self._clock / self._clock[-1])
        return gaussians(samples, np.tile(weights, (len(rows), 1)))

    def way(self, movement: PreparedMovement, clock: np.ndarray) -> np.ndarray:
        if not self.reacts:
            return super().way(movement, clock)
        frames = zip(*frames_along(self.shown, movement, clock), strict=True)
        return np.array(
            [
                self.model.moment(list(here), phase).state[:3]
                for here, phase in zip(frames, clock, strict=True)
            ]
        )

    # plans

    def movement(self, situation: Situation) -> tuple[HandPath, np.ndarray, np.ndarray]:
        frame, start = self._goal_frame(situation), situation.pose(HAND)
        clock = to_the_nanosecond(np.arange(0.0, self.shown.clock_end, self.settings.step))
        local = self._path(self._features(row(frame.sees(start)))[0], clock)
        path = placed(local, frame)
        motion = PoseMotion(
            np.hstack([path.position, path.quaternion]), path.velocity, path.acceleration
        )
        s = self.settings
        pulled = pose_attractor(motion, (s.stiffness, s.rotational_stiffness))
        return path, pulled[:, :3], pulled[:, 3:]

    def _path(self, start: np.ndarray, clock: np.ndarray) -> HandPath:
        """The movement from features of the start to the goal, in the last task frame."""
        raise NotImplementedError

    def pace(self, path: HandPath, held: np.ndarray) -> Pace | None:
        """The clock waits for a hand that is held, and not for one that carries something into its
        goal.
        """
        spread = np.interp(path.time, self._clock, self._spread)
        away = np.linalg.norm(path.position - path.position[-1], axis=1)
        meets = held & (away < MEETS)
        gain = np.zeros((len(path.time), 12))
        gain[:, :3] = ahead_gain(path.velocity[:, :3], spread) * ~meets[:, None]
        return Pace(gain)

    def _answers_at(self) -> tuple[np.ndarray, np.ndarray]:
        """Instants at which the answers are known to the arm, and the spread there."""
        n = int(np.ceil(self._clock[-1] / COURSE_STEP)) + 1
        time = np.linspace(0.0, self._clock[-1], n)
        return time, np.interp(time, self._clock, self._spread)


class VectorPrimitive(Primitives[DiscretePrimitive]):
    """`dmp`: a primitive over the position and two axes of the hand; over the position alone for a
    skill whose bodies move, where the hand keeps the orientation of the start.
    """

    _kind, _asked = DiscretePrimitive, PrimitiveCourse

    @classmethod
    def refusal(cls, skill: Skill) -> str:
        if skill.bodies_move and skill.turns_hand:
            return "the hand would keep the orientation of the start, and this skill turns it"
        return super().refusal(skill)

    def _features(self, poses: np.ndarray) -> np.ndarray:
        return poses[:, :3] if self.reacts else pose_features(poses[:, :3], poses[:, 3:])

    def _laid_out(self, begin: Any, time: np.ndarray) -> np.ndarray:
        return self.primitive.open_loop(time, begin).position

    def _path(self, start: np.ndarray, clock: np.ndarray) -> HandPath:
        made = self.primitive.open_loop(clock, self._begin(start))
        place, axes = made.position[:, :3], made.position[:, 3:]
        return path_of_axes(clock, place, made.velocity[:, :3], made.acceleration[:, :3], axes)

    def _course(self) -> PrimitiveCourse:
        time, spread = self._answers_at()
        s = self.settings
        share, rest = answers(self.primitive, time)
        return PrimitiveCourse(
            time, share, rest, self.primitive.goal_, spread, s.stiffness, phase_rule(s)
        )


class PosePrimitive(Primitives[DiscretePosePrimitive]):
    """`pose_dmp`: a primitive over the position and the orientation of the hand, the rotation
    vector from the goal.
    """

    _kind, _asked = DiscretePosePrimitive, PosePrimitiveCourse

    def _features(self, poses: np.ndarray) -> np.ndarray:
        return poses

    def _again(self, shown: np.ndarray) -> np.ndarray:
        """See `Primitives`; quaternions with the signs of the demonstration."""
        made = super()._again(shown)
        signs = np.where(np.einsum("ni,ni->n", made[:, 3:], shown[:, 3:]) < 0.0, -1.0, 1.0)
        return np.hstack([made[:, :3], signs[:, None] * made[:, 3:]])

    def _laid_out(self, begin: Any, time: np.ndarray) -> np.ndarray:
        return self.primitive.open_loop(time, begin).pose

    def _path(self, start: np.ndarray, clock: np.ndarray) -> HandPath:
        made = self.primitive.open_loop(clock, self._begin(start))
        return HandPath(
            clock, made.pose[:, :3], made.pose[:, 3:], made.velocity, made.acceleration
        )

    def _course(self) -> PosePrimitiveCourse:
        time, spread = self._answers_at()
        s, primitive = self.settings, self.primitive
        share, rest = pose_answers(primitive, time)
        return PosePrimitiveCourse(
            *(time, share, rest, primitive.goal_, spread, s.stiffness, phase_rule(s)),
            start_turn=primitive.start_turn_,
        )


def _axes(frame: TaskFrame) -> np.ndarray:
    return frame.A[-3:, -3:]


def _origin(frame: TaskFrame) -> np.ndarray:
    return frame.b[-3:]


def row(pose: Pose) -> np.ndarray:
    return np.concatenate([pose.position, pose.quaternion])[None]


def placed(path: HandPath, frame: Pose) -> HandPath:
    """A path in a frame, in the world."""
    turn = frame.quaternion
    rates = (
        np.hstack([quaternions.rotate(turn, one[:, :3]), quaternions.rotate(turn, one[:, 3:])])
        for one in (path.velocity, path.acceleration)
    )
    position = frame.position + quaternions.rotate(turn, path.position)
    return HandPath(path.time, position, quaternions.product(turn, path.quaternion), *rates)


def _fields(kind: type[PrimitiveCourse], arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """Those of a course that were saved."""
    return {
        one.name: arrays[one.name] for one in fields(kind) if one.name not in ("stiffness", "rule")
    }


def gaussians(samples: np.ndarray, weights: np.ndarray) -> GaussianMixture:
    """A Gaussian for each column of weights (n, k) of samples (n, d)."""
    shares = weights / weights.sum(0)
    means = shares.T @ samples
    apart = samples[:, None] - means
    covariances = np.einsum("nk,nki,nkj->kij", shares, apart, apart)
    covariances += np.diag(np.append(SHORT[0], np.full(samples.shape[1] - 1, SHORT[1])))
    priors = weights.sum(0) / weights.sum()
    return GaussianMixture.from_parameters(priors, means, covariances)
