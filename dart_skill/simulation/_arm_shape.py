"""The arm as capsules in the world: what of it hides bodies from cameras.

Every frame of the cameras asks it. So it is compiled (docs/development.md): _arm_shape.pxd beside it has the types.
"""

from __future__ import annotations

import math

import numpy as np

from dart_skill.constants import N_JOINTS
from dart_skill.robot import WamDescription, fixed_transforms, wam_description


class ArmShape:
    """Kinematics from the frames of the URDF's joints: each stands at `xyz`, rolled about x, in that of its parent, and turns about z.

    * description: of the arm, default the WAM.
    """

    def __init__(self, description: WamDescription | None = None):
        description = description or wam_description()
        base, hand = fixed_transforms(description)
        frames = [base.child, *(joint.child for joint in description.joints), hand.child]
        self._steps = np.array([base.translation, *(joint.xyz for joint in description.joints), hand.translation])
        self._roll = np.array([(round(math.cos(joint.roll), 15), round(math.sin(joint.roll), 15)) for joint in description.joints])
        self._frame_of = np.array([frames.index(capsule.link) for capsule in description.capsules], dtype=np.intp)
        self._local = np.array([(capsule.start, capsule.end) for capsule in description.capsules])
        self._radii = np.array([capsule.radius for capsule in description.capsules])
        self._axes, self._origin = np.zeros((len(frames), 3, 3)), np.zeros((len(frames), 3))

    def capsules(self, position: np.ndarray, base_turn: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """End points (c, 2, 3) and radii (c,) [m] at angles (7,) [rad]; the base may stand turned about the vertical [rad].

        ValueError for angles of another number.
        """
        angles = np.asarray(position, dtype=float)
        if angles.shape != (N_JOINTS,):
            raise ValueError(f"position = {position}: give {N_JOINTS} joint angles [rad]")
        self._place_frames(angles, base_turn)
        return self._ends(), self._radii

    def _place_frames(self, angles: np.ndarray, base_turn: float) -> None:
        """Origins and axes, as columns, of all frames in the world: base, joints, hand."""
        axes, n = self._axes, angles.shape[0]
        self._origin[0, 2] = self._steps[0, 2]
        axes[0, 0, 0] = axes[0, 1, 1] = math.cos(base_turn)
        axes[0, 1, 0] = math.sin(base_turn)
        axes[0, 0, 1] = -axes[0, 1, 0]
        axes[0, 2, 2] = 1.0
        for k in range(1, n + 1):
            self._step_to(k)
            cosine, sine = math.cos(angles[k - 1]), math.sin(angles[k - 1])
            level, tilted = self._roll[k - 1, 0], self._roll[k - 1, 1]
            for i in range(3):
                rolled = level * axes[k - 1, i, 1] + tilted * axes[k - 1, i, 2]
                axes[k, i, 0] = cosine * axes[k - 1, i, 0] + sine * rolled
                axes[k, i, 1] = cosine * rolled - sine * axes[k - 1, i, 0]
                axes[k, i, 2] = level * axes[k - 1, i, 2] - tilted * axes[k - 1, i, 1]
        self._step_to(n + 1)
        for i in range(3):
            for j in range(3):
                axes[n + 1, i, j] = axes[n, i, j]

    def _step_to(self, k: int) -> None:
        """The origin of a frame, from the frame before it."""
        for i in range(3):
            self._origin[k, i] = self._origin[k - 1, i]
            for j in range(3):
                self._origin[k, i] += self._axes[k - 1, i, j] * self._steps[k, j]

    def _ends(self) -> np.ndarray:
        """End points of the capsules in the world (c, 2, 3)."""
        n_capsules = self._frame_of.shape[0]
        result = np.empty((n_capsules, 2, 3))
        ends = result
        for c in range(n_capsules):
            k = self._frame_of[c]
            for end in range(2):
                for i in range(3):
                    ends[c, end, i] = self._origin[k, i]
                    for j in range(3):
                        ends[c, end, i] += self._axes[k, i, j] * self._local[c, end, j]
        return result
