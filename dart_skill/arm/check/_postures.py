"""Postures that a person leads the arm through: counted while they come."""

from __future__ import annotations

import numpy as np

REST, RESTING = 0.05, 0.3
"""An arm rests whose joints have been slower than this [rad/s] for so long [s]."""
NEW = 0.2
"""A posture is new if a joint is so far from where it was in all others [rad]."""


class PostureCounter:
    """Counts the different postures in which an arm rested."""

    def __init__(self) -> None:
        self._found: list[np.ndarray] = []
        self._last: tuple[float, np.ndarray] | None = None
        self._since: float | None = None

    def __len__(self) -> int:
        return len(self._found)

    def add(self, time: float, position: np.ndarray) -> bool:
        """Take the joints (7,) [rad] at an instant [s]; whether that makes a new posture."""
        last = self._last
        self._last = (time, position)
        if last is None or not time > last[0]:
            self._since = time
            return False
        if np.abs(position - last[1]).max() > REST * (time - last[0]):
            self._since = time
        if (
            self._since is None
            or time - self._since < RESTING
            or any(np.abs(position - one).max() < NEW for one in self._found)
        ):
            return False
        self._found.append(position.copy())
        return True
