"""Joints that come near the ends of their ranges: the others take over what the hand needs.

A joint approaches the end of its range no faster than it can be stopped before it (the velocity
damper of Faverjon and Tournassoud, 1987). What it cannot do for that, the other joints do, as far
as they can: saturation in the null space (Flacco, De Luca and Khatib, IEEE Transactions on
Robotics, 2015), one joint after the other.
"""

import numpy as np

APPROACH = 0.05
"""A joint that is so fast that it would be at the end within this time is slowed down [s]."""
ROOM = 0.05
"""What is left free before the end of a joint's range: an arm that is soft goes on a little [rad]."""
SOONEST = 0.02
"""No joint is braked within less time [s]."""
LENGTHS = np.array([1.0, 1.0, 1.0, 0.18, 0.18, 0.18])
"""Metres that a metre, or a radian, of the hand's motion counts for when directions are compared:
0.18 m from the wrist to the ball.
"""
LEAST_MOBILITY = 0.08
"""A direction in which the other joints move the hand less easily is left to itself gradually
[1/kg].
"""


def held_in_range(
    q: np.ndarray,
    qd: np.ndarray,
    qdd: np.ndarray,
    ends: tuple[np.ndarray, np.ndarray],
    step: float,
    terms: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Accelerations (n,) [rad/s^2] with which no joint runs into the end of its range, and the hand
    accelerates as before where the other joints can do it.

    Parameters
    ----------
    q, qd, qdd
        Angles, speeds and the accelerations that are wanted (n,).
    ends
        Lower and upper ends of the ranges (n,) [rad].
    step
        Time for which the accelerations hold [s].
    terms
        Jacobian of the hand (6, n) and inertia of the joints (n, n).
    """
    lower, upper = ends
    least = (np.minimum(lower + ROOM - q, 0.0) / APPROACH - qd) / step
    most = (np.maximum(upper - ROOM - q, 0.0) / APPROACH - qd) / step
    result, held = qdd, np.zeros(len(q), dtype=bool)
    for _ in range(len(q)):
        beyond = np.where(held, 0.0, np.maximum(result - most, least - result))
        worst = int(beyond.argmax())
        if beyond[worst] <= 0.0:
            return result
        held[worst] = True
        result = _replaced(qdd, np.clip(result, least, most), held, *terms)
    return np.clip(result, least, most)


def time_to_end(q: np.ndarray, qd: np.ndarray, ends: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Time (n,) [s] after which joints at angles (n,) with speeds (n,) come near the ends of their
    ranges (n,) each, at least `SOONEST`.
    """
    lower, upper = ends
    room = np.where(qd > 0.0, upper - ROOM - q, q - lower - ROOM)
    return np.maximum(SOONEST, room / np.maximum(np.abs(qd), 1e-9))


def _replaced(
    wanted: np.ndarray,
    bounded: np.ndarray,
    held: np.ndarray,
    jacobian: np.ndarray,
    inertia: np.ndarray,
) -> np.ndarray:
    """Accelerations (n,) of which those held (n,) are bounded, and the others make up for it with
    the least kinetic energy of their own.
    """
    change = np.where(held, bounded - wanted, 0.0)
    free = ~held
    if free.any():
        moves = LENGTHS[:, None] * jacobian[:, free]
        eased = np.linalg.solve(inertia[np.ix_(free, free)], moves.T)
        mobile, directions = np.linalg.eigh(moves @ eased)
        share = np.minimum(np.maximum(mobile, 0.0) / LEAST_MOBILITY, 1.0) ** 2
        missing = directions.T @ (LENGTHS * (jacobian @ change))
        force = directions @ (share / np.maximum(mobile, 1e-12) * missing)
        change[free] = -eased @ force
    return wanted + change
