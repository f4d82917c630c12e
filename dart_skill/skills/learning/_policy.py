"""What it takes to carry out a skill that reacts: the fitted model, and where the movement starts.

The learner gives it to the commander as bytes.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

from dart_skill.arm import ArmModel, Grip, GripEvent, Registration
from dart_skill.common.archive import read_arrays
from dart_skill.common.pace import PhaseRule
from dart_skill.common.situation import Pose, Situation
from dart_skill.movement import PhaseModel
from dart_skill.recording import HAND
from dart_skill.skills.execution import BodyMotion, ReactiveGuide, ReactiveSettings
from dart_skill.skills.learning._moving_frames import moving_frames
from dart_skill.skills.protocol import Skill, SkillSettings, part_of

FORMAT = "dart_skill policy 1"


def phase_rule(settings: SkillSettings) -> PhaseRule:
    """How the state of the hand drives the movement of a skill."""
    s = settings
    return PhaseRule(
        slowest=s.slowest,
        fastest=s.fastest,
        time_constant=s.time_constant,
        ignored=s.ignored,
        tolerated=s.tolerated,
    )


@dataclass(frozen=True, eq=False)
class Policy:
    """A learned skill that reacts, without its demonstrations.

    Parameters
    ----------
    skill
        With the settings that it was learned with.
    model
        In the task frames of the skill, as its representation makes it.
    start
        Pose of the hand before the movement, as the cameras see it.
    start_posture
        Joint angles then (7,) [rad].
    events
        What the fingers are told, on the clock of the model's phase.
    registration
        Of the cameras and the arm, as the demonstrations have it.
    offset
        What practice corrects (3,) [m], in the axes of the body that the skill corrects.
    """

    skill: Skill
    model: PhaseModel
    start: Pose
    start_posture: np.ndarray
    events: tuple[GripEvent, ...]
    registration: Registration
    offset: np.ndarray

    def guide(
        self, situation: Situation | None = None, registration: Registration | None = None
    ) -> ReactiveGuide:
        """What guides the hand through a movement; the situation need not say where the hand
        starts, or where the bodies are.

        Parameters
        ----------
        registration
            Of cameras and arm, where that of the demonstrations does not count.

        Raises
        ------
        ValueError
            For another number of inputs.
        """
        situation, s = situation or Situation({}), self.skill.settings
        registration = registration or self.registration
        situation = situation if HAND in situation.poses else situation.moved(HAND, self.start)
        place, turned = registration.poses(
            situation.pose(HAND).position[None], situation.pose(HAND).quaternion[None]
        )
        inputs = list(self.skill.inputs(situation))
        if len(inputs) != self.model.n_inputs:
            raise ValueError(
                f"the situation has {len(inputs)} further inputs, the skill was shown with"
                f" {self.model.n_inputs}"
            )
        return ReactiveGuide(
            self.model,
            partial(self._frames, situation.moved(HAND, Pose(place[0], turned[0]))),
            self.skill.bodies,
            self.start_posture,
            ArmModel().hand_pose(self.start_posture)[1],
            what=self.skill.name,
            speed=self.skill.speed,
            events=self.events,
            inputs=inputs or None,
            registration=registration,
            hand=HAND,
            settings=ReactiveSettings(s.oldest, s.rotational_stiffness, s.follow_on, s.catch_up),
        )

    def _frames(self, situation: Situation, bodies: Mapping[str, BodyMotion]) -> list:
        stiffness = self.skill.settings.stiffness
        return moving_frames(self.skill, situation, bodies, stiffness, self.offset)

    def to_bytes(self) -> bytes:
        """A NumPy archive (.npz) without pickle."""
        about = {
            "skill": self.skill.name,
            "settings": asdict(self.skill.settings),
            "events": [(one.time, int(one.grip), one.done) for one in self.events],
            "registration": asdict(self.registration),
        }
        file, (said, fitted) = (
            io.BytesIO(),
            part_of(self.skill, "representation").packed(self.model),
        )
        arrays: dict[str, Any] = {
            "offset": self.offset,
            "start_position": self.start.position,
            "start_quaternion": self.start.quaternion,
            "start_posture": self.start_posture,
        }
        np.savez(
            file,
            format=np.array(FORMAT),
            about=np.array(json.dumps(about | said)),
            **arrays,
            **fitted,
        )
        return file.getvalue()

    @classmethod
    def from_bytes(cls, data: bytes, skill: Skill) -> Policy:
        """What `to_bytes` wrote of the same skill.

        Parameters
        ----------
        data
            The bytes.

        Raises
        ------
        ValueError
            If it is none.
        """
        try:
            content = read_arrays(io.BytesIO(data))
            if str(content["format"]) != FORMAT:
                raise ValueError(f"its format is not '{FORMAT}'")
            about = json.loads(str(content["about"]))
            if about["skill"] != skill.name:
                raise ValueError(f"it is of the skill '{about['skill']}', not of '{skill.name}'")
            settings = skill.settings_type.from_saved(about["settings"], "it")
            return cls._of(content, about, skill.with_settings(settings))
        except Exception as error:  # zip, zlib, JSON and NumPy each have their own for bytes that they do not expect
            raise ValueError(
                f"these {len(data)} bytes are not the policy of a skill:"
                f" {error or type(error).__name__}"
            ) from error

    @classmethod
    def _of(cls, content: dict[str, np.ndarray], about: dict[str, Any], skill: Skill) -> Policy:
        return cls(
            skill,
            part_of(skill, "representation").unpacked(skill.settings, about, content),
            Pose(content["start_position"], content["start_quaternion"]),
            content["start_posture"],
            tuple(GripEvent(time, Grip(grip), done) for time, grip, done in about["events"]),
            Registration(**about["registration"]),
            content["offset"],
        )
