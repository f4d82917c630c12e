"""The path of something that moves, as it becomes known."""

from __future__ import annotations

import numpy as np


class Trail:
    """The newest points of a path, thinned.

    Parameters
    ----------
    step
        What moves less adds nothing [m].
    jump
        What moves farther at once begins a new path, as of a world that is reset [m].
    capacity
        How many points are kept.
    """

    def __init__(self, step: float = 0.01, jump: float = 0.5, capacity: int = 400):
        self._step, self._jump, self._capacity = step, jump, capacity
        self._points: list[np.ndarray] = []

    def __len__(self) -> int:
        return len(self._points)

    def extend(self, points: np.ndarray) -> bool:
        """Add points (n, 3) in their order.

        Returns
        -------
        bool
            Whether the path has changed.
        """
        changed = False
        for point in points:
            away = np.inf if not self._points else float(np.linalg.norm(point - self._points[-1]))
            if away > self._jump:
                self._points.clear()
            if away >= self._step:
                self._points.append(point)
                changed = True
        del self._points[: -self._capacity]
        return changed

    def clear(self) -> None:
        """Begin anew."""
        self._points.clear()

    @property
    def segments(self) -> np.ndarray:
        """From point to point (m, 2, 3)."""
        return segments(np.array(self._points).reshape(-1, 3))


def segments(points: np.ndarray) -> np.ndarray:
    """A path (n, 3) as the lines between its points (n - 1, 2, 3); none for fewer than two points."""
    return np.stack([points[:-1], points[1:]], axis=1) if len(points) > 1 else np.empty((0, 2, 3))
