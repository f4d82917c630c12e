"""A skill that was learned from demonstrations of poses of the hand: what these have in common,
the representation that its settings choose, and plans for new situations.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from dart_skill.arm import (
    ArmModel,
    Gains,
    GainsOverTime,
    Grip,
    GripEvent,
    HandPath,
    MotionPlan,
    fit_registration,
)
from dart_skill.common.checks import to_the_nanosecond
from dart_skill.common.situation import Pose, Situation
from dart_skill.common.words import counted
from dart_skill.mixture import GaussianMixture
from dart_skill.movement import (
    Motion,
    attractor_with_gains,
    stable_gains,
    stiffness_from_covariance,
)
from dart_skill.recording import HAND, Demonstration
from dart_skill.skills.learning._outliers import unlike, unlike_movement
from dart_skill.skills.learning._policy import Policy
from dart_skill.skills.learning._prepared import PreparedMovement, prepare_movement
from dart_skill.skills.learning._representation import ClockedRepresentation, Representation
from dart_skill.skills.protocol import Skill, TaskOutcome, part_of

LOWER = 0.1
"""A body that stands so much lower than where it was shown stands below what it stood on there [m]:
docs/skills.md has why this is looked at, and no covariance.
"""
OUT_OF_HAND = 0.1
"""What is farther than this from where it was shown in the hand is not there [m]."""


class NoPlan(ValueError):
    """No plan for this situation; the message says why."""


class LearnedSkill:
    """A skill learned from demonstrations.

    Parameters
    ----------
    skill
        What is particular to it, with the settings that choose its representation.
    demonstrations
        At least as many as the representation needs (`Representation.least`).

    Attributes
    ----------
    demonstrations
        Tuple, as they were given.
    movements
        The same as numbers.
    duration
        Float [s], of a movement, the mean of those that were shown. All are stretched to it before
        they are learned.
    start
        Pose of the hand before the movement, the median.
    start_posture
        Joints then (7,) [rad].
    events
        What the fingers do.
    registration
        Of cameras and arm, told from the demonstrations.
    encoded
        The fitted representation.

    Raises
    ------
    ValueError
        Names one that cannot be learned from.
    """

    def __init__(self, skill: Skill, demonstrations: Sequence[Demonstration]):
        skill.check_settings()
        part: type[Representation] = part_of(skill, "representation")
        least = part.least(skill.settings)
        if len(demonstrations) < least:
            raise ValueError(
                f"only {counted(len(demonstrations), 'demonstration')} of '{skill.name}': record at"
                f" least {least}"
            )
        self.skill = skill
        self.demonstrations = tuple(demonstrations)
        arm = ArmModel()
        self.movements = tuple(prepare_movement(skill, one, arm) for one in demonstrations)
        self.duration = float(np.mean([one.duration for one in self.movements]))
        self.events = _events(
            self.movements,
            self.duration,
            skill.settings.grip_time,
            self.clock_end - 2.0 * skill.settings.step,
        )
        self.start = _middle([one.situation.pose(HAND) for one in self.movements])
        self._with_joints = [one for one in self.movements if len(one.joint_time)]
        if not self._with_joints:
            raise ValueError(
                "no demonstration has the joints of the arm, and a plan must say in which posture"
                " it starts: record /joint_states"
            )
        self.start_posture = np.median(
            [one.postures(np.zeros(1))[0] for one in self._with_joints], axis=0
        )
        self.registration = fit_registration(
            [one.sightings for one in self.movements], skill.settings.registration
        )
        self._check_inputs()
        self._misses: list[np.ndarray] = []
        self.encoded: Representation = part(self)

    @classmethod
    def learned(cls, skill: Skill, demonstrations: Sequence[Demonstration]) -> LearnedSkill:
        """What demonstrations teach; ValueError names one that cannot be learned from."""
        return cls(skill, demonstrations)

    @staticmethod
    def prepared(skill: Skill, demonstration: Demonstration) -> PreparedMovement:
        """A demonstration as numbers; ValueError says why it cannot be learned from."""
        return prepare_movement(skill, demonstration, ArmModel())

    @property
    def ids(self) -> tuple[str, ...]:
        """Names of the demonstrations."""
        return tuple(one.id for one in self.demonstrations)

    @property
    def clock_end(self) -> float:
        """The model knows the hand's rest after the movement, too, as far as all recordings go
        [s].
        """
        rest = min(
            self.skill.settings.settle,
            *(one.after * self.duration / one.duration for one in self.movements),
        )
        return self.duration + rest

    def _check_inputs(self) -> None:
        first, *others = self.movements
        wanted = len(self.skill.inputs(first.situation))
        for one in others:
            if (given := len(self.skill.inputs(one.situation))) != wanted:
                raise ValueError(
                    f"demonstration {one.id} has {given} further inputs, demonstration {first.id}"
                    f" {wanted}: give all the same"
                )

    @cached_property
    def held(self) -> Situation:
        """Where the body in the hand is at the start, in the frame of the hand: the median of what
        was shown; nothing for a skill whose hand is empty.
        """
        role = self.skill.in_hand
        if not role:
            return Situation({})
        shown = [one.situation for one in self.movements]
        return Situation({role: _middle([one.pose(HAND).sees(one.pose(role)) for one in shown])})

    @cached_property
    def model_id(self) -> str:
        """Digest of what the model was made from: equal demonstrations and settings give an equal
        name.
        """
        digest = hashlib.sha256(f"{self.skill.name} {self.skill.settings!r}".encode())
        for movement in self.movements:
            for part in (movement.time, movement.features):
                digest.update(np.ascontiguousarray(part).tobytes())
        return digest.hexdigest()[:16]

    @property
    def facts(self) -> tuple[str, ...]:
        """What there is to say of the model."""
        return (f"a movement takes {self.duration:.1f} s",)

    def bic(self) -> float:
        """Bayesian information criterion of the mixtures as the demonstrations alone make them:
        lower is better.
        """
        return self.encoded.bic()

    def left_out_error(self) -> float:
        """Distance of the way of each demonstration from what the others teach in its place: root
        mean square [m]; nan where there are too few.
        """
        return float(np.sqrt(np.mean(np.square(unlike(self)))))

    def unlike_the_others(self, i: int) -> float:
        """Distance of the way of demonstration i from what the others teach for its situation [m];
        nan where they teach nothing for it.
        """
        return unlike_movement(self, i)

    def mixture(self, situation: Situation) -> GaussianMixture:
        """The mixture (7.21) of time and position in the world for a situation that says where the
        hand starts.
        """
        return self.encoded.mixture(situation)

    # practice

    def tell(self, outcome: TaskOutcome) -> None:
        """Learn from what became of a plan of this skill."""
        if self.skill.corrects and np.isfinite(outcome.miss).all():
            self._misses.append(self.offset + outcome.miss)

    @property
    def misses(self) -> np.ndarray:
        """What trials told so far (n, 3) [m], each with the offset that was corrected then."""
        return np.array(self._misses).reshape(-1, 3)

    def remember(self, misses: np.ndarray) -> None:
        """Take what trials told another model of the same demonstrations (n, 3) [m]."""
        self._misses = [np.array(miss) for miss in np.asarray(misses, dtype=float).reshape(-1, 3)]

    @property
    def offset(self) -> np.ndarray:
        """What practice has found to repeat in the misses (3,) [m], in the axes of the body that
        the skill corrects.
        """
        # Shrunk as if there had been one more movement, without a miss: one that missed by chance
        # must not move all that follow.
        return (
            np.sum(self._misses, axis=0) / (len(self._misses) + 1) if self._misses else np.zeros(3)
        )

    # planning

    @property
    def policy(self) -> Policy:
        """What it takes to carry out a skill that reacts, without what it was learned from."""
        assert self.skill.reacts, "only a model that the state drives has one"
        return Policy(
            self.skill,
            self.encoded.model,
            self.start,
            self.start_posture,
            self.events,
            self.registration,
            self.offset,
        )

    def plan(self, situation: Situation) -> MotionPlan:
        """A movement for a situation, which need not say where the hand starts, and how it holds
        what it holds.

        Raises
        ------
        NoPlan
            If there is none.
        ValueError
            If what the hand shall hold is elsewhere.
        """
        assert isinstance(self.encoded, ClockedRepresentation), "a policy is asked on the way"
        self._check_heights(situation)
        situation = situation if HAND in situation.poses else situation.moved(HAND, self.start)
        for role, pose in self.held.poses.items():
            if role not in situation.poses:
                situation = situation.moved(role, situation.pose(HAND).place(pose))
            lies = situation.pose(HAND).sees(situation.pose(role))
            away = float(np.linalg.norm(lies.position - pose.position))
            if away > OUT_OF_HAND:
                raise ValueError(
                    f"the {role} is {away:.2f} m from where the hand takes it: put it there (in"
                    " simulation /simulation/reset does)"
                )
        aimed = self.skill.corrected(situation, self.offset)
        try:
            path, attractor, turned = self.encoded.movement(aimed)
        except ValueError as error:
            raise NoPlan(str(error)) from error
        s = self.skill.settings
        attractor, gains = (
            self._with_gains(self.encoded, aimed, path)
            if s.stiffness_range
            else (attractor, Gains.critical(s.stiffness))
        )
        plan = MotionPlan(
            path=path,
            attractor_position=attractor,
            attractor_quaternion=turned,
            position_gains=gains,
            orientation_gains=Gains.critical(s.rotational_stiffness),
            start_posture=self.start_posture,
            end=path.duration,
            what=self.skill.name,
            events=self.events,
            speed=self.skill.speed,
            pace=self.encoded.pace(path, _held(self.events, path.time)),
            registration=self.registration,
            posture=self._postures(path, self.encoded.shown_at(aimed, path.time)),
        )
        return self.skill.refine(plan, aimed, self)

    def _check_heights(self, situation: Situation) -> None:
        """NoPlan for a body below what it stood on when the skill was shown: the hand would go
        through that.
        """
        for role in self.skill.standing:
            if role not in situation.poses:
                continue
            height = float(situation.pose(role).position[2])
            lowest = min(float(one.situation.pose(role).position[2]) for one in self.movements)
            if height < lowest - LOWER:
                raise NoPlan(
                    f"the {role} stands at a height of {height:.2f} m, {lowest - height:.2f} m lower"
                    f" than the lowest that was shown ({lowest:.2f} m), and the hand would go"
                    " through what it stood on there: put it higher, or show one there"
                )

    def _with_gains(
        self, encoded: ClockedRepresentation, situation: Situation, path: HandPath
    ) -> tuple[np.ndarray, GainsOverTime]:
        """Other attractors (n, 3), and gains with which they make the same path: the firmer the
        more the demonstrations agreed.
        """
        covariance = encoded.covariance(situation, path.time)
        wanted = stiffness_from_covariance(covariance, *self.skill.settings.stiffness_range)
        stiffness, damping = stable_gains(path.time, wanted)
        motion = Motion(path.position, path.velocity[:, :3], path.acceleration[:, :3])
        return attractor_with_gains(motion, stiffness, damping), GainsOverTime(stiffness, damping)

    def _postures(self, path: HandPath, shown_at: np.ndarray) -> np.ndarray:
        """What the arm's free motion aims at along a path (n, 7): the mean of what was shown at
        instants (n,) [s], turned about the base to where the hand is.

        The hand leaves one freedom to seven joints. The person who guided the arm decided on it,
        too.
        """
        shown = []
        for one in self._with_joints:
            time = shown_at * one.duration / self.duration
            postures, at = (
                one.postures(time),
                np.searchsorted(one.time, time).clip(max=len(one.time) - 1),
            )
            postures[:, 0] = _near(postures[:, 0] - _azimuths(one.features[at]), 0.0)
            shown.append(postures)
        mean = np.mean(shown, axis=0)
        mean[:, 0] = _near(mean[:, 0] + _azimuths(path.position), self.start_posture[0])
        return mean


def _events(
    movements: Sequence[PreparedMovement], duration: float, grip_time: float, end: float
) -> tuple[GripEvent, ...]:
    """When the fingers open and close: at the mean of the stretched instants, and done by the end
    of a plan at the latest [s].

    ValueError if the fingers did different things in the demonstrations.
    """
    grips = [tuple(grip for _, grip in one.told) for one in movements]
    for one, told in zip(movements, grips, strict=True):
        if told != grips[0]:
            raise ValueError(
                f"demonstration {one.id} tells the fingers {_in_words(told)}, demonstration"
                f" {movements[0].id} {_in_words(grips[0])}: show the same each time, or drop one"
            )
    shared = np.mean(
        [[time * duration / one.duration for time, _ in one.told] for one in movements], axis=0
    )
    times = to_the_nanosecond(np.atleast_1d(np.clip(shared, 0.0, end)))
    return tuple(
        GripEvent(float(t), grip, min(float(t) + grip_time, end))
        for t, grip in zip(times, grips[0], strict=True)
    )


def _held(events: Sequence[GripEvent], time: np.ndarray) -> np.ndarray:
    """Whether the hand holds something at instants (n,) [s]: it was closed last."""
    held = np.zeros(len(time), dtype=bool)
    for event in events:
        held[time >= event.time] = event.grip == Grip.CLOSE
    return held


def _in_words(told: Sequence[Grip]) -> str:
    return " and ".join(grip.name.lower() for grip in told) or "nothing"


def _middle(poses: Sequence[Pose]) -> Pose:
    return Pose.middle([one.position for one in poses], [one.quaternion for one in poses])


def _azimuths(positions: np.ndarray) -> np.ndarray:
    """Azimuths (n,) of places (n, 3 or more) about the axis of the base [rad], without jumps."""
    return np.unwrap(np.arctan2(positions[:, 1], positions[:, 0]))


def _near(angles: np.ndarray, first: float) -> np.ndarray:
    """The same angles (n,) by so many full turns less or more that the first one is near to
    `first` [rad].
    """
    return angles + 2.0 * np.pi * np.round((first - angles[0]) / (2.0 * np.pi))
