"""What rests where, as the cameras see it: bodies that a person has put somewhere, and the one in
the hand, before a trial.
"""

from __future__ import annotations

import numpy as np

from dart_skill.common.situation import Pose
from dart_skill.recording import HAND
from dart_skill.skills.observation._sensor_log import SensorLog

REST_NS = 500_000_000
"""So long a body is looked at [ns]."""
ENOUGH = 10
"""Samples of a body in that time."""
STILL = 0.008
"""A body that goes less far from the first half of that time to the second one is at rest [m]:
medians, because cameras are noisy.
"""
TURNED = 0.35
"""A body that is turned by less is turned as it shall be [rad]."""


def at_rest(log: SensorLog, role: str, until_ns: int) -> Pose:
    """Where a body stood up to an instant; not turned where the log does not tell.

    Raises
    ------
    ValueError
        If it was not seen, or was moved.
    """
    part = log.bodies[role].part(until_ns - REST_NS, until_ns)
    if len(part.stamps) < ENOUGH:
        raise ValueError(f"the {role} is not seen")
    rows, half = np.array(part.rows), len(part.rows) // 2
    first, second = (np.median(some[:, :3], axis=0) for some in (rows[:half], rows[half:]))
    if np.linalg.norm(first - second) > STILL:
        raise ValueError(f"the {role} moves")
    if role not in log.turned:
        return Pose(np.median(rows[:, :3], axis=0))
    return Pose.middle(rows[:, :3], rows[:, 3:])


def check_in_hand(log: SensorLog, role: str, until_ns: int, seat: Pose, tolerance: float) -> None:
    """The seat is in the frame of the hand's tracked body. The message says what is missing: the
    body, the hand, or how far off the body is.

    Raises
    ------
    ValueError
        Unless the body rested in a resting hand up to an instant, nearer to its seat there than
        `tolerance` [m], and turned as there by less than `TURNED`.
    """
    hand, body = at_rest(log, HAND, until_ns), at_rest(log, role, until_ns)
    away, turn = seat.apart(hand.sees(body))
    if away > tolerance:
        raise ValueError(f"the {role} is {away:.2f} m from its place in the hand")
    if role in log.turned and turn > TURNED:
        raise ValueError(
            f"the {role} is turned by {np.degrees(turn):.0f} degrees from how it was in the hand"
            " when it was shown"
        )
