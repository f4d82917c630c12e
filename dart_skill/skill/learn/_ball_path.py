"""Where a held ball is along a movement, and how fast: the state in which it would leave the hand at each step.

The hand is turned by R_z(azimuth) R_y(-alpha) R_z(beta) R_x(roll) R_y(90 degrees) (8.4.1), of which only alpha and beta change. This module
is compiled (docs/development.md): _ball_path.pxd beside it has the types.
"""

import math

import numpy as np


def ball_states(
    position: np.ndarray, velocity: np.ndarray, azimuth: float, roll: float, centre: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Places and velocities (n, 3) of the ball in the world [m], [m/s].

    * position: (n, 5), x, y, z [m] of the hand in the world, alpha, beta [rad] in axes turned by the azimuth.
    * velocity: (n, 5), of these, per s.
    * azimuth, roll: [rad].
    * centre: (3,) of the ball in the frame of the hand [m].
    """
    n = position.shape[0]
    places, speeds = np.empty((n, 3)), np.empty((n, 3))
    place, speed, cos, sin = places, speeds, math.cos(azimuth), math.sin(azimuth)
    # turned by R_x(roll) R_y(90 degrees)
    ahead = centre[2]
    left = centre[1] * math.cos(roll) + centre[0] * math.sin(roll)
    up = centre[1] * math.sin(roll) - centre[0] * math.cos(roll)
    for i in range(n):
        ca, sa, cb, sb = math.cos(position[i, 3]), math.sin(position[i, 3]), math.cos(position[i, 4]), math.sin(position[i, 4])
        far, y = ahead * cb - left * sb, ahead * sb + left * cb
        x, z = far * ca - up * sa, far * sa + up * ca
        # the angular velocity: -y at the rate of alpha, and the axis of beta at that of beta
        wx, wy, wz = -sa * velocity[i, 4], -velocity[i, 3], ca * velocity[i, 4]
        vx, vy, vz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
        place[i, 0], place[i, 1], place[i, 2] = position[i, 0] + cos * x - sin * y, position[i, 1] + sin * x + cos * y, position[i, 2] + z
        speed[i, 0], speed[i, 1] = velocity[i, 0] + cos * vx - sin * vy, velocity[i, 1] + sin * vx + cos * vy
        speed[i, 2] = velocity[i, 2] + vz
    return places, speeds
