"""Numbers of a plan between its instants.

They are asked for at every step of the arm. So this is compiled (docs/development.md):
_plan_rows.pxd beside it has the types.
"""

import numpy as np


class PlanRows:
    """What the hand shall do at n instants: linear between them, a share of the turn from each
    orientation to the next.

    Parameters
    ----------
    time
        (n,), increasing [s].
    linear
        (n, 18): position of the attractor and of the hand, velocity (6) and acceleration (6) of
        the hand.
    rotation
        Of the attractor and of the hand (n, 2, 3, 3).
    first, second
        What a share s of the way to the next instant adds to a rotation, s first + s^2 second, (n
        - 1, 2, 3, 3).
    """

    def __init__(
        self,
        time: np.ndarray,
        linear: np.ndarray,
        rotation: np.ndarray,
        first: np.ndarray,
        second: np.ndarray,
    ):
        self._time, self._linear, self._rotation, self._first, self._second = (
            time,
            linear,
            rotation,
            first,
            second,
        )

    def place(self, time: float) -> tuple[int, float]:
        """Index of the instant before a time [s], and the share of the way from there to the next
        one; beyond the ends it goes on.
        """
        k = self._before(time)
        return k, (time - self._time[k]) / (self._time[k + 1] - self._time[k])

    def at(
        self, time: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """At a time [s]: position (3,) and rotation (3, 3) of the attractor, the same of the hand,
        its velocity and acceleration (6,).
        """
        k = self._before(time)
        share = (time - self._time[k]) / (self._time[k + 1] - self._time[k])
        numbers, turned = np.empty(18), np.empty((2, 3, 3))
        row, turns = numbers, turned
        for i in range(18):
            row[i] = self._linear[k, i] + share * (self._linear[k + 1, i] - self._linear[k, i])
        for m in range(2):
            for i in range(3):
                for j in range(3):
                    turns[m, i, j] = self._rotation[k, m, i, j] + share * (
                        self._first[k, m, i, j] + share * self._second[k, m, i, j]
                    )
        return numbers[:3], turned[0], numbers[3:6], turned[1], numbers[6:12], numbers[12:]

    def _before(self, time: float) -> int:
        """Index of the last instant that is not later, at most the last but one."""
        low, high = 0, self._time.shape[0]
        while low < high:
            middle = (low + high) // 2
            if time < self._time[middle]:
                high = middle
            else:
                low = middle + 1
        return min(max(low - 1, 0), self._time.shape[0] - 2)
