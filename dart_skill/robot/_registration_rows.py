"""What a registration leaves of sightings of the hand, and its derivatives: R_i = X A_i Y and p_i = X (a_i + A_i s) + t.

This module is compiled (docs/development.md): _registration_rows.pxd beside it has the types.
"""

import numpy as np

from dart_skill.rotations import matrix_into, product_into, quaternion_into, vector_into

UNKNOWNS = 13
"""turn, shift, hand_turn, hand_shift, three each, and delay."""


def linearised(
    position: np.ndarray,
    quaternion: np.ndarray,
    arm_position: np.ndarray,
    arm_quaternion: np.ndarray,
    arm_velocity: np.ndarray,
    unknown: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What is left of positions (n, 3) and rotations (n, 3), and the first derivatives (n, 3, 13) of both.

    * position, quaternion: as cameras see the hand, (n, 3) [m] and (n, 4).
    * arm_position, arm_quaternion, arm_velocity: as the arm's kinematics has it, (n, 3), (n, 4) and (n, 6).
    * unknown: (13,), the deviations at which the equations are linear.
    """
    n = position.shape[0]
    off, twist, rows, turned = np.empty((n, 3)), np.empty((n, 3)), np.zeros((n, 3, UNKNOWNS)), np.zeros((n, 3, UNKNOWNS))
    left, angles, moved, rotated = off, twist, rows, turned
    base, hand, late, arm, expected = np.empty(4), np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    vector, lever, axes, base_axes = np.empty(3), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    delay = unknown[12]
    quaternion_into(unknown[0:3], base)
    quaternion_into(unknown[6:9], hand)
    matrix_into(base, base_axes)
    for i in range(n):
        for k in range(3):
            vector[k] = -delay * arm_velocity[i, 3 + k]
        quaternion_into(vector, late)
        product_into(late, arm_quaternion[i], arm)
        matrix_into(arm, axes)
        for k in range(3):
            lever[k] = arm_position[i, k] - delay * arm_velocity[i, k]
            for j in range(3):
                lever[k] += axes[k, j] * unknown[9 + j]
        product_into(base, arm, late)
        product_into(late, hand, expected)
        for k in range(3):
            left[i, k] = position[i, k] - unknown[3 + k]
            for j in range(3):
                left[i, k] -= base_axes[k, j] * lever[j]
            expected[k] = -expected[k]
        product_into(quaternion[i], expected, late)
        vector_into(late, angles[i])
        _write_rows(axes, lever, arm_velocity[i], moved[i], rotated[i])
    return off, twist, rows, turned


def _write_rows(axes: np.ndarray, lever: np.ndarray, velocity: np.ndarray, moved: np.ndarray, rotated: np.ndarray) -> None:
    """Write the derivatives (3, 13) of a position and of a rotation."""
    x, y, z = lever[0], lever[1], lever[2]
    moved[0, 1], moved[0, 2] = z, -y  # turn x lever
    moved[1, 0], moved[1, 2] = -z, x
    moved[2, 0], moved[2, 1] = y, -x
    for k in range(3):
        moved[k, 3 + k] = rotated[k, k] = 1.0
        for j in range(3):
            moved[k, 9 + j] = rotated[k, 6 + j] = axes[k, j]
        moved[k, 12], rotated[k, 12] = -velocity[k], -velocity[3 + k]
