"""Lines of sight: how many cameras see a point, past the capsules of an arm and the wall of a
basket.
"""

from __future__ import annotations

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
        self._positions, self._ranges, self._clearance = positions, ranges, clearance

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
        rays = points[:, :, None] - self._positions  # (f, n, k, 3)
        distance = np.linalg.norm(rays, axis=-1)
        sees = (distance > 0.0) & (distance <= self._ranges)
        sees &= (np.einsum("ksi,fnki->fnks", self._sides, rays) >= 0.0).all(axis=-1)
        if walls is not None:
            sees &= ~_is_behind_wall(self._positions, rays, walls[:, None, None])
        # A line of sight ends `clearance` before the body, so that neither its holder nor itself
        # hides it.
        shorten = np.maximum(0.0, 1.0 - self._clearance / np.maximum(distance, TINY))
        gaps = _squared_gaps(self._positions, shorten[..., None] * rays, ends[:, None, None])
        sees &= (gaps >= np.square(radii)[:, None, None]).all(axis=-1)
        return np.minimum(sees.sum(axis=-1), enough)


def _squared_gaps(start: np.ndarray, ray: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Squared distances (f, n, k, c) between lines of sight start + s ray, (k, 3) and (f, n, k,
    3), and the axes of capsules (f, 1, 1, c, 2, 3), a + t axis, s and t in [0, 1].

    Minimise over s, clamp, over t, clamp, over s again (Ericson, Real-Time Collision Detection,
    5.1.9).
    """
    ray = ray[..., None, :]
    axis, offset = ends[..., 1, :] - ends[..., 0, :], start[:, None] - ends[..., 0, :]
    length, thick, apart = ((one * one).sum(axis=-1) for one in (ray, axis, offset))
    along, behind, across = (
        (one * other).sum(axis=-1) for one, other in ((ray, axis), (ray, offset), (axis, offset))
    )
    det = length * thick - along * along
    s = np.where(det > TINY, (along * across - behind * thick) / np.maximum(det, TINY), 0.0)
    t = np.clip((along * np.clip(s, 0.0, 1.0) + across) / np.maximum(thick, TINY), 0.0, 1.0)
    s = np.clip((along * t - behind) / np.maximum(length, TINY), 0.0, 1.0)
    return apart + s * (s * length + 2.0 * behind) + t * (t * thick - 2.0 * (across + s * along))


def _is_behind_wall(start: np.ndarray, ray: np.ndarray, wall: np.ndarray) -> np.ndarray:
    """Whether rays from cameras (k, 3), (f, n, k, 3), pass through the wall of the basket (f, 1,
    1, 5), a cylinder below its rim.
    """
    offset, rim, radius = start[:, :2] - wall[..., :2], wall[..., 2], wall[..., 3]
    a = np.maximum(np.square(ray[..., :2]).sum(axis=-1), TINY)
    b = (offset * ray[..., :2]).sum(axis=-1)
    discriminant = b * b - a * (np.square(offset).sum(axis=-1) - radius * radius)
    root = np.sqrt(np.maximum(discriminant, 0.0))
    behind = np.zeros(root.shape, dtype=bool)
    for share in ((-b - root) / a, (-b + root) / a):
        height = start[:, 2] + share * ray[..., 2]
        behind |= (
            (0.0 < share) & (share < 1.0) & (height > rim - wall[..., 4]) & (height < rim - 1e-9)
        )
    return behind & (discriminant >= 0.0)
