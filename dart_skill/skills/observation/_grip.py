"""Where the hand holds the ball, told from their poses: a held ball does not move in the frame of
the hand.
"""

from __future__ import annotations

import numpy as np

from dart_skill.common.checks import check_samples, check_unit_quaternions
from dart_skill.common.quantiles import quantile
from dart_skill.movement import rotate

HELD = (0.8, 0.05)
"""From so long to so long before the release [s] the ball is looked at in the hand."""
ENOUGH = 10
"""Samples of both bodies in that time."""
FRAME = 0.025
"""A ball that was not seen for longer than this [s] is not interpolated."""


def grip_path(
    time: np.ndarray, position: np.ndarray, quaternion: np.ndarray, grip_offset: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Time (m,) and position (m, 3) of a point of the hand.

    Raises
    ------
    ValueError
        If the poses are none.
    """
    time, position = check_samples("hand", time, position, least=8)
    quaternion = check_unit_quaternions("hand", quaternion, len(time))
    offset = np.asarray(grip_offset, dtype=float)
    if offset.shape != (3,) or not np.all(np.isfinite(offset)):
        raise ValueError(
            f"grip_offset must be a finite (3,) point in the hand frame, got {grip_offset}"
        )
    return time, position + rotate(quaternion, offset[None])


def seen_grip(
    ball: tuple[np.ndarray, np.ndarray],
    hand: tuple[np.ndarray, np.ndarray, np.ndarray],
    released: float,
    nominal: np.ndarray,
    farthest: float,
) -> np.ndarray:
    """Centre of the held ball in the hand's frame (3,) [m]: the median of what was seen before the
    release.

    It holds the seat of the ball, and what the markers of both bodies are off. `nominal` where the
    ball was hidden in the hand, or was seen more than `farthest` [m] from it.

    Parameters
    ----------
    ball
        Time (n,) [s], position (n, 3) [m].
    hand
        Time (m,) [s], position (m, 3) [m], quaternion (m, 4).
    released
        About when it left the hand [s].
    """
    time, position, quaternion = hand
    held = (time > released - HELD[0]) & (time < released - HELD[1]) & _seen(ball[0], time)
    if np.sum(held) < ENOUGH:
        return nominal
    there = rows_at(time[held], *ball)
    inverse = quaternion[held] * [-1.0, -1.0, -1.0, 1.0]
    grip = quantile(rotate(inverse, there - position[held]), 0.5)
    return grip if np.linalg.norm(grip - nominal) < farthest else nominal


def rows_at(when: np.ndarray, stamps: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows (m, d) at instants (m,), linear between rows (n, d) at increasing stamps (n,), n >= 2,
    of which none is earlier or later.
    """
    after = _later(stamps, when)
    before = after - 1
    share = (when - stamps[before]) / (stamps[after] - stamps[before])
    return rows[before] + share[:, None] * (rows[after] - rows[before])


def _seen(stamps: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Whether there are samples shortly before and shortly after instants (m,)."""
    after = _later(stamps, time)
    return (
        (stamps[after] - stamps[after - 1] < FRAME)
        & (stamps[after - 1] <= time)
        & (time <= stamps[after])
    )


def _later(stamps: np.ndarray, time: np.ndarray) -> np.ndarray:
    """The first of increasing stamps (n,), but for the very first, that is not before instants
    (m,); else the last.
    """
    # of integers, clip takes five times as long
    return np.minimum(np.maximum(np.searchsorted(stamps, time), 1), len(stamps) - 1)
