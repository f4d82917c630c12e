"""What a registration leaves of sightings of the hand, and its derivatives: R_i = X A_i Y and p_i
= X (a_i + A_i s) + t.
"""

import numpy as np

from dart_skill.common.quaternions import (
    CONJUGATE,
    from_vectors,
    matrices,
    product,
    rotate,
    to_vectors,
)

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
    """What is left of positions (n, 3) and rotations (n, 3), and the first derivatives (n, 3, 13)
    of both.

    * position, quaternion: as cameras see the hand, (n, 3) [m] and (n, 4).
    * arm_position, arm_quaternion, arm_velocity: as the arm's kinematics has it, (n, 3), (n, 4)
      and (n, 6).
    * unknown: (13,), the deviations at which the equations are linear.
    """
    turn, shift, hand_turn, hand_shift, delay = (
        unknown[:3],
        unknown[3:6],
        unknown[6:9],
        unknown[9:12],
        unknown[12],
    )
    base = from_vectors(turn)
    arm = product(from_vectors(-delay * arm_velocity[:, 3:]), arm_quaternion)
    lever = arm_position - delay * arm_velocity[:, :3] + rotate(arm, hand_shift)
    expected = product(product(base, arm), from_vectors(hand_turn))
    off = position - shift - rotate(base, lever)
    twist = to_vectors(product(quaternion, expected * CONJUGATE))
    rows, turned = np.zeros((2, len(position), 3, UNKNOWNS))
    rows[:, :, 0:3] = np.cross(np.eye(3), lever[:, None]).swapaxes(1, 2)  # turn x lever
    rows[:, :, 3:6] = turned[:, :, 0:3] = np.eye(3)
    rows[:, :, 9:12] = turned[:, :, 6:9] = matrices(arm)
    rows[:, :, 12], turned[:, :, 12] = -arm_velocity[:, :3], -arm_velocity[:, 3:]
    return off, twist, rows, turned
