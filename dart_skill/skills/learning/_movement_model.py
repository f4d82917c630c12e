"""What demonstrations of a skill have in common, whatever is made of them: where they start, how
long they take, what the fingers do.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from dart_skill.arm import ArmModel, Grip, GripEvent, fit_registration
from dart_skill.common.checks import to_the_nanosecond
from dart_skill.common.situation import Pose
from dart_skill.recording import HAND, Demonstration
from dart_skill.skills.learning._prepared import PreparedMovement, prepare_movement
from dart_skill.skills.protocol import Skill, TaskOutcome

RATE = 100.0
"""Rate of the samples that are learned from [1/s]."""


class MovementModel:
    """Demonstrations of a skill, ready to be learned from.

    Parameters and attributes as of `LearnedSkill` and `ReactiveSkill`, which derive from it.
    """

    def __init__(self, skill: Skill, demonstrations: Sequence[Demonstration]):
        skill.check_settings()
        least = skill.settings.least_demonstrations
        if len(demonstrations) < least:
            raise ValueError(
                f"{len(demonstrations)} demonstrations are too few for '{skill.name}': record at"
                f" least {least}"
            )
        self.skill = skill
        self.demonstrations = tuple(demonstrations)
        arm = ArmModel()
        self.movements = tuple(prepare_movement(skill, one, arm) for one in demonstrations)
        self.duration = float(np.mean([one.duration for one in self.movements]))
        self._events = _events(
            self.movements,
            self.duration,
            skill.settings.grip_time,
            self._clock_end - 2.0 * skill.settings.step,
        )
        starts = [one.situation.pose(HAND) for one in self.movements]
        self.start = Pose(
            np.median([one.position for one in starts], axis=0),
            _mean_orientation([one.quaternion for one in starts]),
        )
        self._with_joints = [one for one in self.movements if len(one.joint_time)]
        if not self._with_joints:
            raise ValueError(
                "no demonstration has the joints of the arm, and a plan must say in which posture"
                " it starts: record /joint_states"
            )
        self._start_posture = np.median(
            [one.postures(np.zeros(1))[0] for one in self._with_joints], axis=0
        )
        self.registration = fit_registration([one.sightings for one in self.movements])
        self._check_inputs()
        self._misses: list[np.ndarray] = []

    # practice

    def tell(self, outcome: TaskOutcome) -> None:
        """Learn from what became of a plan of this skill."""
        if self.skill.corrects and np.isfinite(outcome.miss).all():
            self._misses.append(self.offset + outcome.miss)

    @property
    def misses(self) -> np.ndarray:
        """What trials told so far (n, 3) [m], each with the offset that was corrected then."""
        return np.array(self._misses).reshape(-1, 3)

    @property
    def practised(self) -> int:
        """How many trials that were."""
        return len(self._misses)

    def remember(self, misses: np.ndarray) -> None:
        """Take what trials told another model of the same demonstrations (n, 3) [m]."""
        self._misses = [np.array(miss) for miss in np.asarray(misses, dtype=float).reshape(-1, 3)]

    @property
    def offset(self) -> np.ndarray:
        """What is corrected now (3,) [m], in the axes of the body that the skill corrects."""
        # Shrunk as if there had been one more movement, without a miss: one that missed by chance
        # must not move all that follow.
        return (
            np.sum(self._misses, axis=0) / (len(self._misses) + 1) if self._misses else np.zeros(3)
        )

    @property
    def _clock_end(self) -> float:
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
    def model_id(self) -> str:
        """Digest of what the model was made from: equal demonstrations and settings give an equal
        name.
        """
        digest = hashlib.sha256(f"{self.skill.name} {self.skill.settings!r}".encode())
        if given := self.skill.settings.rarely_given:
            digest.update(repr(given).encode())
        for movement in self.movements:
            for part in (movement.time, movement.features):
                digest.update(np.ascontiguousarray(part).tobytes())
        return digest.hexdigest()[:16]


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


def _in_words(told: Sequence[Grip]) -> str:
    return " and ".join(grip.name.lower() for grip in told) or "nothing"


def _mean_orientation(quaternions: Sequence[np.ndarray]) -> np.ndarray:
    from scipy.spatial.transform import Rotation  # throws do without

    return Rotation.from_quat(np.array(quaternions)).mean().as_quat()
