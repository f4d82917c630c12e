"""A motion on an arm that is not there. Whatever a motion needs is loaded by it: modules, tables,
caches. The first motion of a commander that has just started is late otherwise, by half a second.
"""

from __future__ import annotations

import numpy as np

from dart_skill.arm._command import ArmState, Speed
from dart_skill.arm._commander import Commander, Mode
from dart_skill.arm._description import ArmDescription
from dart_skill.arm._model import ArmModel
from dart_skill.arm._motion_plan import Gains, HandPath, MotionPlan
from dart_skill.common.arm_choice import joint_count
from dart_skill.common.quaternions import of_matrices

DURATION = 0.1
"""Length of the motion [s]."""
STEP_NS = 10_000_000
"""Time between two states [ns]."""
MOST_STATES = 500
"""After so many states a rehearsal is over, whatever the commander does."""


def still_plan(description: ArmDescription, speed: Speed = Speed.CAREFUL) -> MotionPlan:
    """A plan of a hand that stays where it is, with all joints in the middle of their ranges.

    Parameters
    ----------
    description
        Of the arm.
    speed
        Level of speed that it asks for.
    """
    posture = 0.5 * (description.of_joints("lower") + description.of_joints("upper"))
    position, rotation = ArmModel(description).hand_pose(posture)
    places, turns = np.tile(position, (2, 1)), of_matrices(np.stack([rotation, rotation]))
    rest, gains = np.zeros((2, 6)), Gains.critical(400.0)
    path = HandPath(np.array([0.0, DURATION]), places, turns, rest, rest)
    return MotionPlan(path, places, turns, gains, gains, posture, DURATION, speed=speed)


def rehearse(commander: Commander, plan: MotionPlan) -> list[Mode]:
    """Carry out a plan of a hand that stays where it is, on an arm that obeys: the modes that the
    commander went through.

    Parameters
    ----------
    commander
        One that no arm listens to.
    plan
        Of `still_plan`.

    Raises
    ------
    PlanRefused
        As of `Commander.execute`.
    """
    modes: list[Mode] = []
    commander.execute(plan)
    for k in range(MOST_STATES):
        commander.step(ArmState(k * STEP_NS, plan.start_posture, np.zeros(joint_count())))
        if commander.mode not in modes:
            modes.append(commander.mode)
        if not commander.executing:
            break
    return modes
