"""How far the hand is seen from where the arm takes it to be: encoders read wrong, and cables
give.
"""

from __future__ import annotations

from collections import deque

import numpy as np

FILTER_TIME = 0.2
"""Time constant with which the distance is followed [s]: it changes with the posture, and each
pose has its noise.
"""
ARM_MEMORY = 0.1
"""Poses are compared with the arm of so long ago at most [s]."""


class HandSeen:
    """The distance between two accounts of the hand: of cameras, which are late, and of the arm,
    which is wrong.

    Parameters
    ----------
    name
        Of the hand's body; empty: it is not looked at.
    """

    def __init__(self, name: str):
        self.name = name
        self._arm: deque[tuple[int, np.ndarray]] = deque()
        self._beside, self._poses, self._newest_ns = np.zeros(3), 0, 0

    def see(self, stamp_ns: int, position: np.ndarray) -> None:
        """Where cameras see the hand (3,) [m], in the world of the arm; left out if the arm was
        not heard around that instant.
        """
        if (
            len(self._arm) < 2
            or not self._arm[0][0] <= stamp_ns <= self._arm[-1][0]
            or stamp_ns <= self._newest_ns
        ):
            return
        stamps = np.array([stamp for stamp, _ in self._arm], dtype=float)
        places = np.array([place for _, place in self._arm])
        there = np.array([np.interp(stamp_ns, stamps, column) for column in places.T])
        since = (stamp_ns - self._newest_ns) * 1e-9
        self._poses, self._newest_ns = self._poses + 1, stamp_ns
        # The mean of the first poses, until there are so many that the time constant asks for
        # less.
        self._beside = self._beside + max(1.0 / self._poses, min(since / FILTER_TIME, 1.0)) * (
            position - there - self._beside
        )

    def beside(self, stamp_ns: int, position: np.ndarray) -> np.ndarray:
        """Where the hand is seen from where the arm takes it to be (3,) [m].

        Parameters
        ----------
        position
            By the arm (3,), at an instant [ns].
        """
        self._arm.append((stamp_ns, position))
        while (stamp_ns - self._arm[0][0]) * 1e-9 > ARM_MEMORY:
            self._arm.popleft()
        return self._beside
