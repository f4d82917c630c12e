"""Task frames of a skill at a moment in which its bodies move."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dart_skill.common.situation import Pose, Situation
from dart_skill.movement import MovingFrame, attractor_from_motion
from dart_skill.skills.execution import BodyMotion
from dart_skill.skills.learning._pose_features import frame_of
from dart_skill.skills.protocol import Skill

AROUND = 0.02
"""Frames are asked for so long before and after an instant, to tell how they move [s]; exact where
a body keeps its acceleration.
"""
NOTHING = np.zeros(3)


def moving_frames(
    skill: Skill,
    situation: Situation,
    bodies: Mapping[str, BodyMotion],
    stiffness: float,
    offset: np.ndarray = NOTHING,
) -> list[MovingFrame]:
    """The task frames of a skill over [t, u, x, y, z] at a moment in which bodies move: each with
    the motion of its origin.

    Parameters
    ----------
    offset
        What practice corrects (3,) [m], as of `Skill.corrected`.
    """
    before, now, after = (
        skill.chosen_frames(skill.corrected(_ahead(situation, bodies, time), offset))
        for time in (-AROUND, 0.0, AROUND)
    )
    n_inputs = len(skill.inputs(situation))
    return [_moving(*poses, stiffness, n_inputs) for poses in zip(before, now, after, strict=True)]


def _ahead(situation: Situation, bodies: Mapping[str, BodyMotion], time: float) -> Situation:
    """The situation so long after a moment [s], if all bodies keep their accelerations."""
    for role, body in bodies.items():
        place = body.position + time * body.velocity + 0.5 * time**2 * body.acceleration
        situation = situation.moved(role, Pose(place, body.quaternion))
    return situation


def _moving(before: Pose, now: Pose, after: Pose, stiffness: float, n_inputs: int) -> MovingFrame:
    velocity = (after.position - before.position) / (2.0 * AROUND)
    acceleration = (after.position - 2.0 * now.position + before.position) / AROUND**2
    attractor = attractor_from_motion(
        now.position[None], velocity[None], acceleration[None], stiffness
    )[0]
    return MovingFrame(frame_of(now, "position", n_inputs), velocity, attractor)
