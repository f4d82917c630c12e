"""The whole table, with the lines about numbers of safety in config/: limits of the commander, and
of the arm itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dart_skill.arm import ArmDescription, ArmModel, RegistrationFit
from dart_skill.arm.check._cameras import RATE, camera_lines
from dart_skill.arm.check._hand import hand_lines
from dart_skill.arm.check._heard import Grade, Heard, HeardPoses, Line, graded, line
from dart_skill.arm.check._joints import joint_lines
from dart_skill.arm.check._topics import (
    command_line,
    frame_line,
    publisher_line,
    quality_line,
    rate_line,
    silent_line,
    stamps_line,
    time_base_line,
)
from dart_skill.common.configuration import node_parameters
from dart_skill.common.world import the_world

VELOCITY_LIMIT = 1.0
"""At which the WAM's safety system stops the arm (fault VL2), measured at the elbow, unless
setVelocityLimit raises it [m/s].
"""
FIRST_FORCE = 100.0
"""Strongest force for first throws [N]."""
STRONGEST_FORCE = 250.0
"""Strongest force for any throws [N]."""
FASTEST = 5.5
"""Speed of the hand that throws at 2.5 m need [m/s]."""
ERROR = 0.15
"""Error of the hand's position that throws at 2.5 m need [m]."""
STATE_RATE = 500.0
"""Rate of the joint states [Hz]."""
SLOWEST_STATES = 250.0
"""Lowest rate of the joint states with which a skill was shown, learned and executed [Hz]."""


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
        return all(one.verdict is not Grade.NO_GO for one in self.lines)


def check_arm(
    heard: Heard, limits: Mapping | None = None, model: ArmModel | None = None
) -> ArmReport:
    """What speaks for and against moving the arm, from what was heard of it.

    Parameters
    ----------
    limits
        Parameters of the commander, default those of config/commander.yaml.
    model
        Of the arm, default that of config/wam.yaml.
    """
    limits = node_parameters("commander.yaml", "commander") if limits is None else limits
    model = model or ArmModel()
    joints = heard.joints
    of_joints = joint_lines(joints, model.description, float(limits["joint_overrun"]))
    lines = [*_of_states(heard, limits), *of_joints] if len(joints) else [silent_line(joints)]
    for stream in heard.poses.values():
        lines += _of_poses(stream, heard.simulated) if len(stream) else [silent_line(stream)]
    lines += [time_base_line(heard), command_line(heard)]
    right = all(one.verdict is not Grade.NO_GO for one in of_joints[:2])
    of_hand, fit = hand_lines(heard, model, right)
    lines += [
        *of_hand,
        *camera_lines(heard, model, right),
        *_safety_lines(limits, model.description, heard.simulated),
    ]
    return ArmReport(tuple(lines), fit)


def _of_states(heard: Heard, limits: Mapping) -> list[Line]:
    """Lines about the joint states as messages."""
    joints = heard.joints
    # a reset leaves a gap
    longest_gap = None if heard.simulated else float(limits["longest_gap"])
    return [
        publisher_line(joints),
        quality_line(joints, better_reliable=True),
        rate_line(joints, STATE_RATE, longest_gap, SLOWEST_STATES),
        stamps_line(joints, heard.simulated),
    ]


def _of_poses(stream: HeardPoses, simulated: bool) -> list[Line]:
    """Lines about the poses of a body as messages."""
    return [
        publisher_line(stream),
        quality_line(stream, better_reliable=False),
        rate_line(stream, RATE, None),
        stamps_line(stream, simulated),
        frame_line(stream, the_world().frame_id),
    ]


def _safety_lines(limits: Mapping, description: ArmDescription, simulated: bool) -> list[Line]:
    """Lines about the commander's parameters `limits` (config/commander.yaml) and the description
    of the arm.
    """
    force, hand, error = (
        float(limits[name]) for name in ("strongest_force", "fastest_hand", "farthest_error")
    )
    firmest = STRONGEST_FORCE if simulated else FIRST_FORCE
    lower, upper = description.ends
    margin = float(limits["joint_margin"])
    inside = bool(np.all(upper - lower > 2.0 * margin))
    height = description.mount_height
    return [
        line(
            "strongest force", graded(force, firmest, STRONGEST_FORCE), f"{force:g} N", f"at most {firmest:g} N at first",
            "begin with a low strongest_force in config/limits.yaml, an empty hand and the nearest basket",
        ),
        _speed_line(hand, simulated),
        line(
            "farthest error", graded(error, ERROR, 0.3), f"{error:g} m", f"at most {ERROR:g} m",
            "lower farthest_error in config/commander.yaml: a throw is stopped that far from its plan",
        ),
        line(
            "joint limits", Grade.GO if inside else Grade.NO_GO, f"of {len(lower)} joints, margin {margin:g} rad",
            "lower below upper, with the margin between", "correct lower and upper of config/wam.yaml",
        ),
        line(
            "mount height in config/wam.yaml", graded(abs(height - 0.9), 0.9, 2.0), f"{height:g} m", "0 to 1.8 m above the floor",
            "measure it: the base of the arm above the floor",
        ),
    ]  # fmt: skip


def _speed_line(hand: float, simulated: bool) -> Line:
    asked = f"at most {FASTEST:g} m/s" + (
        "" if simulated else f"; {VELOCITY_LIMIT:g} m/s until the arm's limit is raised"
    )
    verdict = graded(hand, FASTEST, 8.0)
    if verdict is Grade.GO and not simulated and hand > VELOCITY_LIMIT:
        verdict = Grade.WARN
    remedy = (
        "the arm stops at its own limit (fault VL2): raise it with setVelocityLimit after each"
        " power-up, begin with less in fastest_hand"
    )
    return line("fastest hand", verdict, f"{hand:g} m/s", asked, remedy)
