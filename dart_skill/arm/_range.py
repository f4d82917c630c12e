"""Joints that come near the ends of their ranges: the others take over what the hand needs.

A joint approaches the end of its range no faster than it can be stopped before it (the velocity
damper of Faverjon and Tournassoud, 1987). What it cannot do for that, the other joints do, as far
as they can: saturation in the null space (Flacco, De Luca and Khatib, IEEE Transactions on
Robotics, 2015), one joint after the other.
"""

import numpy as np

from dart_skill.arm._model import ArmModel

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
"""A direction in which joints move the hand less easily is left to itself gradually [1/kg]."""


def held_in_range(
    model: ArmModel, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, step: float
) -> np.ndarray:
    """Accelerations (n,) [rad/s^2] with which no joint runs into the end of its range, and the hand
    accelerates as before where the other joints can do it; the same object where none has to.

    Parameters
    ----------
    model
        Of the arm.
    q, qd, qdd
        Angles, speeds and the accelerations that are wanted (n,).
    step
        Time for which the accelerations hold [s].
    """
    lower, upper = model.description.ends
    least = (np.minimum(lower + ROOM - q, 0.0) / APPROACH - qd) / step
    most = (np.maximum(upper - ROOM - q, 0.0) / APPROACH - qd) / step
    result, held = qdd, np.zeros(len(q), dtype=bool)
    while (beyond := np.where(held, 0.0, np.maximum(result - most, least - result))).max() > 0.0:
        held[beyond.argmax()] = True
        result = _replaced(model, q, qdd, np.clip(result, least, most), held)
    return result


def time_to_end(q: np.ndarray, qd: np.ndarray, ends: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Time (n,) [s] after which joints at angles (n,) with speeds (n,) come near the ends of their
    ranges (n,) each, at least `SOONEST`.
    """
    lower, upper = ends
    room = np.where(qd > 0.0, upper - ROOM - q, q - lower - ROOM)
    return np.maximum(SOONEST, room / np.maximum(np.abs(qd), 1e-9))


def _replaced(
    model: ArmModel, q: np.ndarray, wanted: np.ndarray, bounded: np.ndarray, held: np.ndarray
) -> np.ndarray:
    """Accelerations (n,) of which those held (n,) are bounded, and the others make up for it with
    the least kinetic energy of their own.
    """
    change, free = np.where(held, bounded - wanted, 0.0), ~held
    if not free.any():
        return bounded
    jacobian = LENGTHS[:, None] * model.jacobian(q)
    moves = jacobian[:, free]
    eased = np.linalg.solve(model.mass_matrix(q)[np.ix_(free, free)], moves.T)
    mobile, directions = np.linalg.eigh(moves @ eased)
    # the share min(mobile / least, 1)^2 of what is missing, divided by the mobility
    along = mobile / np.maximum(mobile, LEAST_MOBILITY) ** 2 * (directions.T @ jacobian @ change)
    change[free] = -eased @ (directions @ along)
    return wanted + change
