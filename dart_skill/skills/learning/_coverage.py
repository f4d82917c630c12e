"""Which of many places is the most crowded: what a memory that is full forgets, so that the region
stays covered.
"""

import numpy as np

NO_POINTS = np.empty((0, 3))


class Coverage:
    """Points that come and go, oldest first. A point costs work and memory in proportion to how
    many there are.

    Parameters
    ----------
    points
        (n, 3), those at the beginning; default none.
    """

    def __init__(self, points: np.ndarray = NO_POINTS):
        self._points = np.array(points, dtype=float)
        self._nearest = np.full(len(points), np.inf)
        self._measure(np.arange(len(points)))

    def __len__(self) -> int:
        return len(self._points)

    def add(self, point: np.ndarray) -> None:
        """The newest one comes.

        Parameters
        ----------
        point
            (3,).
        """
        self._nearest = np.append(
            np.minimum(self._nearest, np.linalg.norm(self._points - point, axis=1)), np.inf
        )
        self._points = np.vstack([self._points, point])

    def remove(self, index: int) -> None:
        """A point goes, and those after it move up.

        Parameters
        ----------
        index
            Of the point.
        """
        apart = np.linalg.norm(self._points[:index] - self._points[index], axis=1)
        alone = np.flatnonzero(apart <= self._nearest[:index])
        self._points, self._nearest = (
            np.delete(self._points, index, axis=0),
            np.delete(self._nearest, index),
        )
        self._measure(alone)

    def most_crowded(self) -> int:
        """Index of the older of the two that are nearest to each other."""
        return int(np.argmin(self._nearest))

    def _measure(self, rows: np.ndarray) -> None:
        """The distance of each of some points to the nearest one that is newer."""
        for row in rows:
            self._nearest[row] = np.linalg.norm(
                self._points[row + 1 :] - self._points[row], axis=1
            ).min(initial=np.inf)
