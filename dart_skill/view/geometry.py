"""Places of the basket that the mouse can choose, and paths of moving bodies as line segments."""

from __future__ import annotations

import numpy as np

from dart_skill.common.regions import Region

STRIPE = 0.06
"""Length of a stripe of a line of two colours [m]."""


def nearest_in(region: Region, point: np.ndarray) -> np.ndarray:
    """The place of a region nearest to a point (>= 2,), at the height of the rim: (3,) [m].

    Raises
    ------
    ValueError
        For what is no point.
    """
    x, y = np.asarray(point, dtype=float)[:2]
    if not (np.isfinite(x) and np.isfinite(y)):
        raise ValueError(f"a basket at {point}: give finite coordinates in metres")
    azimuth = float(np.arctan2(y, x))
    if abs(azimuth) <= region.side:
        distance = np.clip(np.hypot(x, y), region.near, region.far)
        return _at(region, distance, azimuth)
    edges = [
        _at(region, np.clip(x * np.cos(a) + y * np.sin(a), region.near, region.far), a)
        for a in (-region.side, region.side)
    ]
    return min(edges, key=lambda place: float(np.hypot(place[0] - x, place[1] - y)))


def on_plane(eye: np.ndarray, pointer: np.ndarray, height: float) -> np.ndarray | None:
    """Where the sight from an eye (3,) through a point (3,) meets the horizontal plane at a height
    [m]: (3,); None if it does not.
    """
    sight = pointer - eye
    fall = eye[2] - height
    if not np.isfinite(sight).all() or abs(sight[2]) < 1e-9 or -fall / sight[2] <= 0.0:
        return None
    return eye - fall / sight[2] * sight


def outline(region: Region, n: int = 33) -> np.ndarray:
    """The edge of a region on the floor (2 n + 1, 3), closed."""
    azimuths = np.linspace(-region.side, region.side, n)
    arcs = [
        np.column_stack([r * np.cos(a), r * np.sin(a)])
        for r, a in ((region.near, azimuths), (region.far, azimuths[::-1]))
    ]
    edge = np.concatenate([*arcs, arcs[0][:1]])
    return np.column_stack([edge, np.zeros(len(edge))])


def _at(region: Region, distance: float, azimuth: float) -> np.ndarray:
    return np.array([distance * np.cos(azimuth), distance * np.sin(azimuth), region.rim])


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


def stripes(lines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pieces (n, 2, 3) of a path by turns: those of one colour and those of the other. A stripe ends
    with the first piece that goes beyond a multiple of `STRIPE`.
    """
    lengths = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
    second = (np.cumsum(lengths) - lengths) // STRIPE % 2 == 1
    return lines[~second], lines[second]
