"""Lines of sight: how many cameras see a point, past the capsules of an arm and the wall of a
basket.

Every frame of the cameras asks it of each body. So it is compiled (docs/development.md):
_lines_of_sight.pxd beside it has the types.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

TINY = 1e-12
"""Squares below this are taken as 0 [m^2]."""


class LinesOfSight:
    """From all cameras at once.

    Parameters
    ----------
    positions
        Of the cameras (k, 3) [m].
    axes
        (k, 3, 3) right, down and viewing direction of each as rows.
    half_angles
        (k, 2) of the field of view, horizontal and vertical [rad].
    ranges
        Of sight (k,) [m].
    clearance
        What is nearer to a point than this does not hide it [m].
    """

    def __init__(
        self,
        positions: np.ndarray,
        axes: np.ndarray,
        half_angles: np.ndarray,
        ranges: np.ndarray,
        clearance: float,
    ):
        right, down, forward = axes[:, 0], axes[:, 1], axes[:, 2]
        wide, high = (tangent[:, None] * forward for tangent in np.tan(half_angles).T)
        # their normals, inwards
        self._sides = np.stack([wide - right, wide + right, high - down, high + down], axis=1)
        self._positions, self._ranges, self._clearance = (
            np.array(positions),
            np.array(ranges),
            clearance,
        )
        self._start, self._ray = np.zeros(3), np.zeros(3)

    def count(
        self,
        points: np.ndarray,
        ends: np.ndarray,
        radii: np.ndarray,
        walls: np.ndarray | None,
        enough: int,
    ) -> np.ndarray:
        """How many cameras see each point (f, n) of f frames, or `enough` where there are more.

        Parameters
        ----------
        points
            (f, n, 3) [m].
        ends, radii
            Of the capsules (f, c, 2, 3), (f, c) [m].
        walls
            Centre of the rim, radius and depth of the basket (f, 5) [m]; None if there is none.
        """
        self._points, self._ends, self._radii = points, ends, radii
        self._walls: Any = walls
        n_frames, n_points, n_cameras = points.shape[0], points.shape[1], self._positions.shape[0]
        result = np.zeros((n_frames, n_points), dtype=np.intp)
        counts = result
        for f in range(n_frames):
            for i in range(n_points):
                for k in range(n_cameras):
                    if counts[f, i] < enough and self._sees(k, f, i):
                        counts[f, i] += 1
        return result

    def _sees(self, k: int, f: int, i: int) -> bool:
        """Whether a camera sees a point in a frame."""
        start, ray, squared = self._start, self._ray, 0.0
        for axis in range(3):
            start[axis] = self._positions[k, axis]
            ray[axis] = self._points[f, i, axis] - start[axis]
            squared += ray[axis] * ray[axis]
        distance = math.sqrt(squared)
        if not 0.0 < distance <= self._ranges[k] or not self._is_in_view(k):
            return False
        if self._walls is not None and self._is_behind_wall(f):
            return False
        # A line of sight ends `clearance` before the body, so that neither its holder nor itself
        # hides it.
        shorten = max(0.0, 1.0 - self._clearance / distance)
        for axis in range(3):
            ray[axis] *= shorten
        for c in range(self._radii.shape[1]):
            if self._squared_gap(f, c) < self._radii[f, c] * self._radii[f, c]:
                return False
        return True

    def _is_in_view(self, k: int) -> bool:
        """Whether the ray leads into the field of view of a camera."""
        sides, ray = self._sides, self._ray
        for side in range(4):
            if (
                sides[k, side, 0] * ray[0]
                + sides[k, side, 1] * ray[1]
                + sides[k, side, 2] * ray[2]
                < 0.0
            ):
                return False
        return True

    def _squared_gap(self, f: int, c: int) -> float:
        """Squared distance between the line of sight start + s ray and the axis of a capsule a + t
        axis, s and t in [0, 1].

        Minimise over s, clamp, over t, clamp, over s again (Ericson, Real-Time Collision
        Detection, 5.1.9).
        """
        length = thick = along = behind = across = apart = 0.0
        for i in range(3):
            ray, end = self._ray[i], self._ends[f, c, 0, i]
            axis, offset = self._ends[f, c, 1, i] - end, self._start[i] - end
            length += ray * ray
            thick += axis * axis
            along += ray * axis
            behind += ray * offset
            across += axis * offset
            apart += offset * offset
        det = length * thick - along * along
        s = unit_interval((along * across - behind * thick) / det) if det > TINY else 0.0
        t = unit_interval((along * s + across) / max(thick, TINY))
        s = unit_interval((along * t - behind) / max(length, TINY))
        return (
            apart + s * (s * length + 2.0 * behind) + t * (t * thick - 2.0 * (across + s * along))
        )

    def _is_behind_wall(self, f: int) -> bool:
        """Whether the ray passes through the wall of the basket, a cylinder below its rim."""
        start, ray, wall = self._start, self._ray, self._walls
        x, y, radius = start[0] - wall[f, 0], start[1] - wall[f, 1], wall[f, 3]
        a = max(ray[0] * ray[0] + ray[1] * ray[1], TINY)
        b = x * ray[0] + y * ray[1]
        discriminant = b * b - a * (x * x + y * y - radius * radius)
        if discriminant < 0.0:  # the line misses the cylinder
            return False
        root = math.sqrt(discriminant)
        return self._meets_wall(f, (-b - root) / a) or self._meets_wall(f, (-b + root) / a)

    def _meets_wall(self, f: int, share: float) -> bool:
        """Whether the point start + share ray, as far from the basket's axis as its wall is, is on
        the ray, and between rim and floor.
        """
        rim, height = self._walls[f, 2], self._start[2] + share * self._ray[2]
        return 0.0 < share < 1.0 and rim - self._walls[f, 4] < height < rim - 1e-9


def unit_interval(value: float) -> float:
    """The nearest number that is neither below 0 nor above 1."""
    return min(max(value, 0.0), 1.0)
