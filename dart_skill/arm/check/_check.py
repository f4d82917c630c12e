"""The whole table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dart_skill.arm import ArmModel, RegistrationFit
from dart_skill.arm.check._cameras import RATE, camera_lines
from dart_skill.arm.check._hand import hand_lines
from dart_skill.arm.check._heard import Heard
from dart_skill.arm.check._joints import joint_lines
from dart_skill.arm.check._line import Line, Verdict
from dart_skill.arm.check._safety import safety_lines
from dart_skill.arm.check._topics import (
    command_line,
    frame_line,
    publisher_line,
    quality_line,
    rate_line,
    stamps_line,
    time_base_line,
)
from dart_skill.common.configuration import node_parameters
from dart_skill.common.world import the_world

STATE_RATE = 500.0
"""Rate of the joint states [Hz]."""


@dataclass(frozen=True)
class ArmReport:
    """The lines of the table, and the registration of cameras and arm; None where the postures did
    not tell it.
    """

    lines: tuple[Line, ...]
    registration: RegistrationFit | None

    @property
    def is_go(self) -> bool:
        """Whether no line says NO-GO."""
        return all(one.verdict is not Verdict.NO_GO for one in self.lines)


def check_arm(
    heard: Heard, limits: Mapping | None = None, model: ArmModel | None = None
) -> ArmReport:
    """What speaks for and against moving the arm, from what was heard of it.

    limits: parameters of the commander, default those of config/commander.yaml. model: of the arm,
    default that of config/wam.yaml.
    """
    limits = node_parameters("commander.yaml", "commander") if limits is None else limits
    model = model or ArmModel()
    joints = heard.joints
    lines = [
        publisher_line(joints, "the arm's driver"),
        quality_line(joints, better_reliable=True),
        rate_line(
            joints, STATE_RATE, None if heard.simulated else float(limits["longest_gap"])
        ),  # a reset leaves a gap
        stamps_line(joints, heard.simulated),
    ]
    of_joints = joint_lines(joints, model.description)
    lines += of_joints
    for stream in heard.poses.values():
        lines += [
            publisher_line(stream, "the cameras' driver (vrpn_mocap)"),
            quality_line(stream, better_reliable=False),
        ]
        lines += [
            rate_line(stream, RATE, None),
            stamps_line(stream, heard.simulated),
            frame_line(stream, the_world().frame_id),
        ]
    lines += [time_base_line(heard), command_line(heard)]
    right = all(one.verdict is not Verdict.NO_GO for one in of_joints[:2])
    of_hand, fit = hand_lines(heard, model, right)
    lines += [
        *of_hand,
        *camera_lines(heard, model, right),
        *safety_lines(limits, model.description, heard.simulated),
    ]
    return ArmReport(tuple(lines), fit)
