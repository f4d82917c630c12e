"""How a tracked body moves now, from the noisy poses that have come of it so far."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

POSE_WINDOW = 0.2
"""Poses of so long a time tell how a body moves [s]: at 100 Hz and 0.3 mm its speed to 5 mm/s."""
FEWEST_POSES = 6
"""Poses that an estimate of speed and acceleration needs; with fewer a body is taken to be at
rest.
"""


class BodyMotion(NamedTuple):
    """At an instant: position (3,) [m], velocity (3,) [m/s], acceleration (3,) [m/s^2]; of the
    newest pose quaternion (4,) and age [s].
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    quaternion: np.ndarray
    age: float


class MovingBody:
    """The newest poses of one body. A parabola through them by least squares bridges the time
    until now.
    """

    def __init__(self, name: str):
        self.name = name
        self._poses: deque[tuple[int, np.ndarray, np.ndarray]] = deque()
        self._parabola: np.ndarray | None = None  # (3, 3), of the present poses

    def see(self, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A pose: (3,) [m] and (4,). One that is not newer than the last is left out."""
        if self._poses and stamp_ns <= self._poses[-1][0]:
            return
        self._poses.append(
            (stamp_ns, np.asarray(position, dtype=float), np.asarray(quaternion, dtype=float))
        )
        while (stamp_ns - self._poses[0][0]) * 1e-9 > POSE_WINDOW:
            self._poses.popleft()
        self._parabola = None

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest pose [ns]; None before any has come."""
        return self._poses[-1][0] if self._poses else None

    def at(self, stamp_ns: int) -> BodyMotion:
        """The motion at an instant [ns].

        Raises
        ------
        ValueError
            Before any pose has come.
        """
        if not self._poses:
            raise ValueError(f"the {self.name} has not been seen yet")
        newest_ns, position, quaternion = self._poses[-1]
        ahead = (stamp_ns - newest_ns) * 1e-9
        if len(self._poses) < FEWEST_POSES:
            return BodyMotion(position, np.zeros(3), np.zeros(3), quaternion, ahead)
        if self._parabola is None:
            self._parabola = self._fit(newest_ns)
        constant, linear, quadratic = self._parabola
        velocity = linear + 2.0 * ahead * quadratic
        return BodyMotion(
            constant + ahead * linear + ahead**2 * quadratic,
            velocity,
            2.0 * quadratic,
            quaternion,
            ahead,
        )

    def _fit(self, newest_ns: int) -> np.ndarray:
        """Coefficients of the parabola, lowest first (3, 3)."""
        positions = np.array([position for _, position, _ in self._poses])
        time = (np.array([ns for ns, *_ in self._poses]) - newest_ns) * 1e-9
        return np.linalg.lstsq(np.vander(time, 3, increasing=True), positions, rcond=None)[0]
