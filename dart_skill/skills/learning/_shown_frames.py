"""Task frames along what was shown among bodies that move."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from dart_skill.common.situation import Situation
from dart_skill.movement import Motion, MovingFrame, smooth_derivatives
from dart_skill.recording import Track
from dart_skill.skills.execution import BodyMotion
from dart_skill.skills.learning._moving_frames import moving_frames
from dart_skill.skills.learning._prepared import PreparedMovement
from dart_skill.skills.observation import position_noise

if TYPE_CHECKING:
    from dart_skill.skills.learning._learned import LearnedSkill


def motion_shown(
    shown: LearnedSkill,
    movement: PreparedMovement,
    time: np.ndarray,
    position: np.ndarray,
    clock: np.ndarray,
) -> Motion:
    """What was seen at stamps (n,), (n, 3), stretched to the mean duration, at the instants of the
    clock (m,).
    """
    try:
        noise = position_noise(time, position)
        stretched = time * shown.duration / movement.duration
        return smooth_derivatives(stretched, position, noise=noise, at=clock)
    except ValueError as error:
        raise ValueError(f"demonstration {movement.id}: {error}") from error


def frames_along(
    shown: LearnedSkill, movement: PreparedMovement, clock: np.ndarray
) -> list[list[MovingFrame]]:
    """The task frames at each instant of the clock (m,): a list of m for each frame.

    Parameters
    ----------
    movement
        What was prepared of a demonstration.
    """
    moved = {
        role: _body_motions(shown, movement, track, clock)
        for role, track in movement.bodies.items()
    }
    instants = [
        dict(zip(moved, motions, strict=True)) for motions in zip(*moved.values(), strict=True)
    ]
    frames = [frames_of(shown, movement.situation, motions) for motions in instants]
    return [list(one) for one in zip(*frames, strict=True)]


def frames_of(
    shown: LearnedSkill, situation: Situation, bodies: Mapping[str, BodyMotion]
) -> list[MovingFrame]:
    """The task frames of a moment, in which the bodies move so."""
    return moving_frames(shown.skill, situation, bodies, shown.skill.settings.stiffness)


def _body_motions(
    shown: LearnedSkill, movement: PreparedMovement, track: Track, clock: np.ndarray
) -> list[BodyMotion]:
    motion = motion_shown(shown, movement, track.time, track.position, clock)
    turns = track.resampled(clock * movement.duration / shown.duration).quaternion
    return [BodyMotion(*row, age=0.0) for row in zip(*motion, turns, strict=True)]
