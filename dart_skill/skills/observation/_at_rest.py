"""What rests where, as the cameras see it: the ball in the hand before a throw, and the basket. A
person puts both there.
"""

from __future__ import annotations

import numpy as np

from dart_skill.movement import rotate
from dart_skill.skills.observation._cutting import ThrowLog

REST_NS = 500_000_000
"""So long a body is looked at [ns]."""
ENOUGH = 10
"""Samples of a body in that time."""
STILL = 0.008
"""A body that goes less far from the first half of that time to the second one is at rest [m]:
medians, because cameras are noisy.
"""


def basket_at_rest(log: ThrowLog, until_ns: int) -> np.ndarray:
    """Where the basket stood up to an instant (3,) [m].

    Raises
    ------
    ValueError
        If it was not seen, or was moved.
    """
    _, place = _seen(log, "basket", until_ns)
    return _resting("the basket", place)


def check_ball_in_hand(log: ThrowLog, until_ns: int, seat: np.ndarray, tolerance: float) -> None:
    """The seat is in the frame of the hand's tracked body. The message says what is missing: the
    ball, the hand, or how far off the ball is.

    Raises
    ------
    ValueError
        Unless the ball rested in a resting hand up to an instant, nearer to its seat (3,) there
        than `tolerance` [m].
    """
    ball_time, ball = _seen(log, "ball", until_ns)
    hand_time, hand = _seen(log, "hand", until_ns)
    _resting("the hand", hand[:, :3])
    nearest = np.clip(np.searchsorted(hand_time, ball_time), 0, len(hand_time) - 1)
    inverse = hand[nearest, 3:] * [-1.0, -1.0, -1.0, 1.0]
    held = _resting("the ball", rotate(inverse, ball - hand[nearest, :3]))
    away = float(np.linalg.norm(held - seat))
    if away > tolerance:
        raise ValueError(f"the ball is {away:.2f} m from its place in the hand")


def _seen(log: ThrowLog, body: str, until_ns: int) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (n,) [ns] and rows (n, d) of a body in the time before an instant; ValueError if
    there are too few.
    """
    part = getattr(log, body).part(until_ns - REST_NS, until_ns)
    if len(part.stamps) < ENOUGH:
        raise ValueError(f"the {body} is not seen")
    return np.array(part.stamps, dtype=np.int64), np.array(part.rows)


def _resting(what: str, place: np.ndarray) -> np.ndarray:
    """Median (d,) of places (n, d) in order of time; ValueError if they go on."""
    half = len(place) // 2
    if np.linalg.norm(np.median(place[:half], axis=0) - np.median(place[half:], axis=0)) > STILL:
        raise ValueError(f"{what} moves")
    return np.median(place, axis=0)
