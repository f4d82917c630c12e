"""Where an arm can point its hand straight down, as skills that put and reach need it: in the plane
of three of its joints (`SwingPlane`), in closed form.

The direction of the hand gives the sum of the turns, and with it the place of the last axis; the first
two joints reach that as the two sides of a triangle do.
"""

from __future__ import annotations

import numpy as np

from dart_skill.arm._swing_plane import MARGIN, SwingPlane, swing_plane
from dart_skill.arm._urdf_arm import UrdfArm

STEP = 0.01
"""Distances are tried so far from each other [m]."""


def postures(
    plane: SwingPlane, places: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Angles of a chain of three joints (2, k, 3) [rad] that bring the hand to places (k, 2) [m],
    pointing in a direction (2,), with the elbow on either side; and whether that is near enough
    (k,). Full turns are not taken off.

    Raises
    ------
    ValueError
        If the chain has another number of joints, or its hand points out of the plane.
    """
    if len(plane.joints) != 3 or np.linalg.norm(plane.points) < 0.5:
        raise ValueError(
            f"{len(plane.joints)} joints move the hand in a plane; three of which it points along"
            " it are needed"
        )
    turn = _angle(direction) - _angle(plane.points)
    cosine, sine = np.cos(turn), np.sin(turn)
    last = np.array([[cosine, -sine], [sine, cosine]]) @ plane.lengths[2]
    way = places - last - plane.first
    upper, fore = np.linalg.norm(plane.lengths[:2], axis=1)
    bent = (np.square(way).sum(axis=1) - upper**2 - fore**2) / (2.0 * upper * fore)
    elbow = np.array([[1.0], [-1.0]]) * np.arccos(bent.clip(-1.0, 1.0))
    shoulder = _angle(way) - np.arctan2(fore * np.sin(elbow), upper + fore * np.cos(elbow))
    begins = [_angle(length) for length in plane.lengths[:2]]
    first, second = shoulder - begins[0], shoulder + elbow - begins[1]
    turns = np.stack([first, second - first, turn - second], axis=-1)
    return plane.rest[plane.joints] + plane.senses * turns, np.abs(bent) <= 1.0


def pointing_region(
    arm: UrdfArm, height: float, direction: tuple[float, float] = (0.0, -1.0)
) -> tuple[float, float]:
    """Nearest and farthest distance from the axis of the base [m] at which the hand, at a height
    above the floor [m], points in a direction; without a gap between them.

    Parameters
    ----------
    direction
        In the plane: away from the base, and up; default: straight down.

    Raises
    ------
    ValueError
        If there is none.
    """
    plane = swing_plane(arm, points_along=True)
    distances, angles, fits = _pointing(arm, plane, height, direction)
    reached = fits.any(axis=0)
    if not reached.any():
        raise ValueError(
            f"arm {arm.name}: the hand points there nowhere at a height of {height:.2f} m"
        )
    edges = np.flatnonzero(np.diff(np.concatenate([[False], reached, [False]])))
    begin, end = max(edges.reshape(-1, 2), key=lambda ends: ends[1] - ends[0])
    return float(distances[begin]), float(distances[end - 1])


def _pointing(
    arm: UrdfArm, plane: SwingPlane, height: float, direction: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distances (k,) [m] that are tried, the angles of the chain there on either side of the base,
    with the elbow on either side (4, k, m) [rad], and whether the joints allow them (4, k).
    """
    lower, upper = arm.lower[plane.joints] + MARGIN, arm.upper[plane.joints] - MARGIN
    distances = np.arange(STEP, _longest(plane), STEP)
    found, fits = [], []
    for side in (1.0, -1.0):
        places = np.column_stack([side * distances, np.full(len(distances), height)])
        angles, near = postures(plane, places, np.array([side, 1.0]) * direction)
        # the turn nearest to the middle of the range
        middle = 0.5 * (lower + upper)
        angles = middle + np.mod(angles - middle + np.pi, 2.0 * np.pi) - np.pi
        found.append(angles)
        fits.append(near & ((angles >= lower) & (angles <= upper)).all(axis=2))
    return distances, np.concatenate(found), np.concatenate(fits)


def pointing_posture(arm: UrdfArm, height: float) -> np.ndarray:
    """Angles of all joints (n,) [rad] with which the hand, at a height above the base [m], points
    straight down, in the middle of where it can: rather before the base than behind it, and far
    from the ends of the joints' ranges.

    Raises
    ------
    ValueError
        If there are none.
    """
    plane = swing_plane(arm, points_along=True)
    distances, angles, fits = _pointing(arm, plane, arm.mount_height + height, (0.0, -1.0))
    if not fits.any():
        raise ValueError(
            f"arm {arm.name}: its hand points down nowhere {height:.2f} m above its base; give a"
            " posture `home` in its file"
        )
    middle = int(np.abs(distances - distances[fits.any(axis=0)].mean()).argmin())
    lower, upper = arm.lower[plane.joints], arm.upper[plane.joints]

    def merit(row: int) -> tuple[bool, float]:
        posture = angles[row, middle]
        before = arm.hand(plane.whole(posture[None])[0]).translation[0] > 0.0
        return bool(before), float(np.minimum(posture - lower, upper - posture).min())

    best = max(np.flatnonzero(fits[:, middle]).tolist(), key=merit)
    return plane.whole(angles[best, middle][None])[0]


def _longest(plane: SwingPlane) -> float:
    return float(np.linalg.norm(plane.first) + np.linalg.norm(plane.lengths, axis=1).sum())


def _angle(vector: np.ndarray) -> np.ndarray:
    """Angle of vectors (..., 2) against the first axis [rad]."""
    return np.arctan2(vector[..., 1], vector[..., 0])
