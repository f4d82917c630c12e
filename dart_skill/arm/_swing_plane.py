"""An arm in a vertical plane: which of its joints move the hand in one, and how.

With the other joints at rest, joints whose axes are horizontal and parallel make a planar chain.
In the plane a point is (e, z): e horizontal, square to the axes, z up, and a positive turn about
the axes leads e to z.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from dart_skill.arm._urdf_arm import UrdfArm

RESTS = (0.0, 0.5 * np.pi, -0.5 * np.pi)
"""Angles that joints are tried at [rad]."""
SQUARE = 1e-3
"""Cosine below which two directions are square to each other."""
SHORT = 1e-3
"""Distance from the last axes to the hand below which they do not move it [m]."""
MARGIN = 0.15
"""Distance that the joints keep to the ends of their ranges [rad]."""
LEAST = 2
"""Number of joints of a plane at least."""


@dataclass(frozen=True)
class SwingPlane:
    """The planar chain of an arm.

    Parameters
    ----------
    joints
        Indices of the joints of the chain (m,), from the base to the hand.
    rest
        Angles of all joints (n,) [rad] at which the chain was measured; those that are not of the
        chain stay there.
    senses
        1 or -1: of each joint of the chain about the common axis (m,).
    first
        The first axis (2,) [m] from the axis of the base and above the floor.
    lengths
        From each axis to the next, and from the last to the hand, at `rest` (m, 2) [m].
    points
        Direction in which the hand points there (2,), its z axis; shorter than 1 where it points
        out of the plane.
    """

    joints: np.ndarray
    rest: np.ndarray
    senses: np.ndarray
    first: np.ndarray
    lengths: np.ndarray
    points: np.ndarray

    def places(self, angles: np.ndarray) -> np.ndarray:
        """The axes and the hand (k, m + 1, 2) [m] at angles of the chain (k, m) [rad]."""
        turned = _turned(self.lengths, self._turns(angles))
        way = np.cumsum(turned, axis=1)
        return np.concatenate([np.zeros((len(angles), 1, 2)), way], axis=1) + self.first

    def directions(self, angles: np.ndarray) -> np.ndarray:
        """Where the hand points (k, 2) at angles (k, m)."""
        return _turned(self.points[None], self._turns(angles)[:, -1:])[:, 0]

    def jacobian(self, angles: np.ndarray) -> np.ndarray:
        """Velocity of the hand in the plane for the speeds of the chain (k, 2, m)."""
        places = self.places(angles)
        arms = places[:, -1:] - places[:, :-1]
        return np.stack([-arms[..., 1], arms[..., 0]], axis=1) * self.senses

    def whole(self, angles: np.ndarray) -> np.ndarray:
        """Angles of all joints (k, n) for those of the chain (k, m)."""
        result = np.repeat(self.rest[None], len(angles), axis=0)
        result[:, self.joints] = angles
        return result

    def _turns(self, angles: np.ndarray) -> np.ndarray:
        return np.cumsum(self.senses * (angles - self.rest[self.joints]), axis=1)


def _turned(vectors: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Vectors (m, 2) turned by angles (k, m): (k, m, 2)."""
    cosine, sine = np.cos(angles), np.sin(angles)
    x, y = vectors[:, 0], vectors[:, 1]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)


def swing_plane(arm: UrdfArm, points_along: bool = False) -> SwingPlane:
    """The plane in which the hand is fastest with all joints of the chain at their largest speeds and
    the arm stretched.

    Parameters
    ----------
    arm
        Any.
    points_along
        Only planes in which the hand points count.

    Raises
    ------
    ValueError
        If no two joints have horizontal and parallel axes.
    """
    lower, upper = arm.lower, arm.upper
    rests = [
        sorted({float(np.clip(rest, *ends)) for rest in RESTS}, key=abs)
        for ends in zip(lower[1:], upper[1:], strict=True)
    ]
    first = float(np.clip(0.0, lower[0], upper[0]))
    best, fastest = None, 0.0
    for others in product(*rests):
        plane = _plane_at(arm, np.array([first, *others]))
        if plane is None or (points_along and np.linalg.norm(plane.points) < 1.0 - SQUARE):
            continue
        reach = np.cumsum(np.linalg.norm(plane.lengths, axis=1)[::-1])[::-1]
        if (speed := float(arm.speeds[plane.joints] @ reach)) > fastest * (1.0 + SQUARE):
            best, fastest = plane, speed
    if best is None:
        raise ValueError(f"arm {arm.name}: no two of its joints move the hand in a vertical plane")
    return best


def _plane_at(arm: UrdfArm, rest: np.ndarray) -> SwingPlane | None:
    """The plane of the first horizontal axis at angles (n,); None if it has too few joints."""
    places, axes = arm.axes(rest)
    level = np.flatnonzero(np.abs(axes[:, 2]) < SQUARE)
    if not len(level):
        return None
    axis = axes[level[0]]
    across = np.cross([0.0, 0.0, 1.0], axis)
    joints = np.flatnonzero(np.abs(axes @ axis) > 1.0 - SQUARE**2)
    hand = arm.hand(rest)
    points = np.vstack([places[joints], hand.translation])
    flat = np.column_stack([points @ across, points[:, 2]])
    while len(joints) and np.linalg.norm(flat[-1] - flat[len(joints) - 1]) < SHORT:
        joints, flat = joints[:-1], np.delete(flat, len(joints) - 1, axis=0)
    if len(joints) < LEAST:
        return None
    forward = hand.rotation[:, 2]
    return SwingPlane(
        joints,
        rest,
        np.sign(axes[joints] @ axis),
        flat[0],
        np.diff(flat, axis=0),
        np.array([forward @ across, forward[2]]),
    )
