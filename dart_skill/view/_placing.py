"""Where the basket may be put with the mouse: the sector that the arm throws to."""

from __future__ import annotations

import numpy as np

from dart_skill.common.regions import Region


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
