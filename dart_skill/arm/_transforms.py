"""Where the links of the arm are as the transforms of /tf: what robot_state_publisher computes
from a URDF.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dart_skill.arm._description import WamDescription
from dart_skill.arm._urdf import HAND_LINK
from dart_skill.common.constants import N_JOINTS

UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Transform:
    """Pose of frame `child` in frame `parent`: translation (3,) [m], quaternion (4,) x, y, z, w."""

    parent: str
    child: str
    translation: np.ndarray
    quaternion: np.ndarray


def fixed_transforms(description: WamDescription, world: str = "world") -> list[Transform]:
    """Those that never change: the base in the world, and the hand on the last link."""
    joints = description.joints
    return [
        Transform(
            world, joints[0].parent, np.array([0.0, 0.0, description.mount_height]), UPRIGHT
        ),
        Transform(joints[-1].child, HAND_LINK, description.tool_plate, UPRIGHT),
    ]


def joint_transforms(description: WamDescription, position: np.ndarray) -> list[Transform]:
    """Those of the joints at angles `position` (7,) [rad]: a turn about the parent's x by the
    joint's roll, then about z by the angle.

    Raises
    ------
    ValueError
        For angles of another number, or not finite.
    """
    position = np.asarray(position, dtype=float)
    if position.shape != (N_JOINTS,) or not np.all(np.isfinite(position)):
        raise ValueError(f"position = {position}: give {N_JOINTS} finite joint angles [rad]")
    roll = description.of_joints("roll")
    (sin_roll, cos_roll), (sin, cos) = (
        (np.sin(angle / 2), np.cos(angle / 2)) for angle in (roll, position)
    )
    quaternion = np.stack(
        [sin_roll * cos, -sin_roll * sin, cos_roll * sin, cos_roll * cos], axis=1
    )
    return [
        Transform(j.parent, j.child, j.xyz, q)
        for j, q in zip(description.joints, quaternion, strict=True)
    ]
