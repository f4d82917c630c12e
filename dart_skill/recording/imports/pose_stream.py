"""Poses of one tracked body over time, and what it takes to bring them from a laboratory's axes into ours.

Motive's axes (x right, y up, z towards the viewer) become Z-up by a quarter turn about x, (x, y, z) -> (x, -z, y): positions and
orientations are turned alike, and the body's own axes stay where they were fixed to it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

IDENTITY = (0.0, 0.0, 0.0, 1.0)
UP_AXES = {"z": IDENTITY, "y": (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))}
"""Quaternion that turns axes with this one up into axes with z up."""


@dataclass(frozen=True)
class RigidTransform:
    """p -> R(quaternion) p + position; position (3,) [m], quaternion (4,) x, y, z, w."""

    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    quaternion: np.ndarray = field(default_factory=lambda: np.array(IDENTITY))

    def __post_init__(self):
        position, quaternion = (np.asarray(value, dtype=float) for value in (self.position, self.quaternion))
        if position.shape != (3,) or not np.isfinite(position).all():
            raise ValueError(f"position is {self.position}: give three finite numbers in metres")
        if quaternion.shape != (4,) or not abs(np.linalg.norm(quaternion) - 1.0) < 1e-3:
            raise ValueError(f"quaternion is {self.quaternion}: give x, y, z, w of norm 1")
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "quaternion", quaternion / np.linalg.norm(quaternion))


@dataclass(frozen=True, eq=False)
class PoseStream:
    """Poses as they were recorded, in their order, good or bad.

    stamp_ns (n,) int64; position (n, 3) [m]; quaternion (n, 4) x, y, z, w; all in frame_id.
    """

    body: str
    stamp_ns: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    frame_id: str = "world"

    def __post_init__(self):
        stamps = np.asarray(self.stamp_ns, dtype=np.int64)
        position, quaternion = np.asarray(self.position, dtype=float), np.asarray(self.quaternion, dtype=float)
        if stamps.ndim != 1 or position.shape != (len(stamps), 3) or quaternion.shape != (len(stamps), 4):
            shapes = f"{stamps.shape}, {position.shape}, {quaternion.shape}"
            raise ValueError(f"poses of {self.body}: need stamps (n,), positions (n, 3), quaternions (n, 4), got {shapes}")
        for name, value in (("stamp_ns", stamps), ("position", position), ("quaternion", quaternion)):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def take(self, index: np.ndarray) -> PoseStream:
        """The samples of an index array or mask."""
        return replace(self, stamp_ns=self.stamp_ns[index], position=self.position[index], quaternion=self.quaternion[index])


def transformed(stream: PoseStream, world: RigidTransform, offset: RigidTransform | None = None) -> PoseStream:
    """The poses in other axes: `world` takes the old axes into the new ones; offset: our body's frame in the axes of the tracked body."""
    position = rotated(world.quaternion, stream.position) + world.position
    quaternion = multiplied(world.quaternion, stream.quaternion)
    if offset is not None:
        position = position + rotated(quaternion, offset.position)
        quaternion = multiplied(quaternion, offset.quaternion)
    return replace(stream, position=position, quaternion=quaternion)


def with_continuous_signs(stream: PoseStream) -> PoseStream:
    """The same orientations, each quaternion with the sign that is nearer to its predecessor: q and -q are one orientation."""
    flips = np.einsum("ij,ij->i", stream.quaternion[1:], stream.quaternion[:-1]) < 0.0
    signs = np.where(np.cumsum(np.concatenate([[0], flips])) % 2, -1.0, 1.0)[: len(stream)]
    return replace(stream, quaternion=stream.quaternion * signs[:, None])


def multiplied(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Products of quaternions (..., 4), x, y, z, w: the second rotation is made first."""
    first, second = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    a, b, s, t = first[..., :3], second[..., :3], first[..., 3:], second[..., 3:]
    vector = s * b + t * a + np.cross(a, b)
    return np.concatenate([vector, s * t - np.sum(a * b, axis=-1, keepdims=True)], axis=-1)


def rotated(quaternion: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) turned by unit quaternions (..., 4)."""
    quaternion = np.asarray(quaternion, dtype=float)
    axis, scalar = quaternion[..., :3], quaternion[..., 3:]
    twist = 2.0 * np.cross(axis, vectors)
    return vectors + scalar * twist + np.cross(axis, twist)
