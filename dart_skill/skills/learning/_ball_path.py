"""Where a held ball is along a movement, and how fast: the state in which it would leave the hand
at each step.

The hand is turned by R_z(azimuth) R_y(-alpha) R_z(beta) R_x(roll) R_y(90 degrees) (8.4.1), of
which only alpha and beta change.
"""

import math

import numpy as np


def ball_states(
    position: np.ndarray, velocity: np.ndarray, azimuth: float, roll: float, centre: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Places and velocities (n, 3) of the ball in the world [m], [m/s].

    Parameters
    ----------
    position
        (n, 5), x, y, z [m] of the hand in the world, alpha, beta [rad] in axes turned by the
        azimuth.
    velocity
        (n, 5), of these, per s.
    azimuth, roll
        [rad].
    centre
        (3,) of the ball in the frame of the hand [m].
    """
    # turned by R_x(roll) R_y(90 degrees)
    ahead = centre[2]
    left = centre[1] * math.cos(roll) + centre[0] * math.sin(roll)
    up = centre[1] * math.sin(roll) - centre[0] * math.cos(roll)
    (ca, cb), (sa, sb) = np.cos(position[:, 3:].T), np.sin(position[:, 3:].T)
    far, y = ahead * cb - left * sb, ahead * sb + left * cb
    x, z = far * ca - up * sa, far * sa + up * ca
    # the angular velocity: -y at the rate of alpha, and the axis of beta at that of beta
    rate, turning = velocity[:, 3:].T
    about_x, about_y, about_z = -sa * turning, -rate, ca * turning
    lever = np.stack([x, y, z], axis=1)
    swing = np.stack(
        [about_y * z - about_z * y, about_z * x - about_x * z, about_x * y - about_y * x], axis=1
    )
    cos, sin = math.cos(azimuth), math.sin(azimuth)
    to_world = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return position[:, :3] + lever @ to_world, velocity[:, :3] + swing @ to_world
