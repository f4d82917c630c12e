"""Where the links of the arm are, from the joints of its URDF: what of it hides bodies from
cameras, and what a wrench does to its joints.

It is asked at every step of the arm. So it is compiled (docs/development.md): _arm_geometry.pxd
beside it has the types.
"""

from __future__ import annotations

import math

import numpy as np

from dart_skill.arm import ArmDescription, fixed_transforms, rotation_of, the_arm


class ArmGeometry:
    """Frames in the world: that of a joint stands at `xyz`, turned by `rpy`, in the frame before
    it, and turns about its own z axis.

    Parameters
    ----------
    description
        Of the arm, default the WAM.
    """

    def __init__(self, description: ArmDescription | None = None):
        description = description or the_arm()
        base, hand = fixed_transforms(description)
        frames = [base.child, *(joint.child for joint in description.joints), hand.child]
        self._steps = np.array(
            [base.translation, *(joint.xyz for joint in description.joints), hand.translation]
        )
        self._turns = np.array(
            [
                np.eye(3),
                *(joint.rotation for joint in description.joints),
                rotation_of(description.tool_rpy),
            ]
        )
        self._turned = np.zeros((3, 3))
        self._frame_of = np.array(
            [frames.index(capsule.link) for capsule in description.capsules], dtype=np.intp
        )
        self._local = np.array([(capsule.start, capsule.end) for capsule in description.capsules])
        self._radii = np.array([capsule.radius for capsule in description.capsules])
        self._axes, self._origin = np.zeros((len(frames), 3, 3)), np.zeros((len(frames), 3))

    def capsules(
        self, position: np.ndarray, base_turn: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """End points (c, 2, 3) and radii (c,) [m] at angles (n,) [rad]; the base may stand turned
        about the vertical [rad].

        Raises
        ------
        ValueError
            For angles of another number.
        """
        angles = np.asarray(position, dtype=float)
        n = len(self._steps) - 2
        if angles.shape != (n,):
            raise ValueError(f"position = {position}: give {n} joint angles [rad]")
        self._place_frames(angles, base_turn)
        return self._ends(), self._radii

    def in_joints(self, position: np.ndarray, wrench: np.ndarray) -> np.ndarray | None:
        """A wrench at the hand as torques of the joints, J' wrench (n,) [N m]; None for none,
        which spares the kinematics.

        About the axis z of a joint at p, force f and moment m at the hand turn with z . (m + (hand
        - p) x f).

        Parameters
        ----------
        position
            Angles (n,) [rad].
        wrench
            (6,), force [N] over moment [N m], world axes.
        """
        if is_zero(wrench):
            return None
        self._place_frames(position, 0.0)
        n, axes, origin = position.shape[0], self._axes, self._origin
        result = np.empty(n)
        torque = result
        for k in range(1, n + 1):
            x, y, z = (
                origin[n + 1, 0] - origin[k, 0],
                origin[n + 1, 1] - origin[k, 1],
                origin[n + 1, 2] - origin[k, 2],
            )
            torque[k - 1] = axes[k, 0, 2] * (wrench[3] + y * wrench[2] - z * wrench[1])
            torque[k - 1] += axes[k, 1, 2] * (wrench[4] + z * wrench[0] - x * wrench[2])
            torque[k - 1] += axes[k, 2, 2] * (wrench[5] + x * wrench[1] - y * wrench[0])
        return result

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
            self._turn_at(k)
            cosine, sine = math.cos(angles[k - 1]), math.sin(angles[k - 1])
            for i in range(3):
                axes[k, i, 0] = cosine * self._turned[i, 0] + sine * self._turned[i, 1]
                axes[k, i, 1] = cosine * self._turned[i, 1] - sine * self._turned[i, 0]
                axes[k, i, 2] = self._turned[i, 2]
        self._step_to(n + 1)
        self._turn_at(n + 1)
        for i in range(3):
            for j in range(3):
                axes[n + 1, i, j] = self._turned[i, j]

    def _turn_at(self, k: int) -> None:
        """The axes of a frame before its joint turns, from those of the frame before it."""
        for i in range(3):
            for j in range(3):
                total = 0.0
                for m in range(3):
                    total += self._axes[k - 1, i, m] * self._turns[k, m, j]
                self._turned[i, j] = total

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


def is_zero(values: np.ndarray) -> bool:
    """Whether all numbers (n,) are 0."""
    for i in range(values.shape[0]):
        if values[i] != 0.0:
            return False
    return True
