"""Poses of one tracked body over time, and what it takes to bring them from a laboratory's axes into ours.

Motive's axes (x right, y up, z towards the viewer) become Z-up by a quarter turn about x, (x, y, z) -> (x, -z, y): positions and
orientations are turned alike, and the body's own axes stay where they were fixed to it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from dart_skill.constants import UNTURNED
from dart_skill.world import the_world

UP_AXES = {"z": UNTURNED, "y": (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))}
"""Quaternion that turns axes with this one up into axes with z up."""


@dataclass(frozen=True)
class RigidTransform:
    """p -> R(quaternion) p + position.

    * position: (3,) [m].
    * quaternion: (4,), x, y, z, w, of norm 1.
    """

    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    quaternion: np.ndarray = field(default_factory=lambda: np.array(UNTURNED))

    def __post_init__(self) -> None:
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

    * body: its name.
    * stamp_ns: (n,) int64.
    * position: (n, 3) [m].
    * quaternion: (n, 4), x, y, z, w.
    * frame_id: name of the axes.
    """

    body: str
    stamp_ns: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    frame_id: str = the_world().frame_id

    def __post_init__(self) -> None:
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
    """The poses in other axes. Norms of quaternions stay as they were: they tell faults.

    world: takes the old axes into the new ones.
    offset: our body's frame in the axes of the tracked body.
    """
    from scipy.spatial.transform import Rotation  # our own bags need none

    turn, norm = Rotation.from_quat(world.quaternion), np.linalg.norm(stream.quaternion, axis=1, keepdims=True)
    position = turn.apply(stream.position) + world.position
    turned = turn * Rotation.from_quat(np.where(norm == 0.0, turn.inv().as_quat(), stream.quaternion))  # without one: that of the new axes
    if offset is not None:
        position = position + turned.apply(offset.position)
        turned = turned * Rotation.from_quat(offset.quaternion)
    return replace(stream, position=position, quaternion=norm * turned.as_quat())


def with_continuous_signs(stream: PoseStream) -> PoseStream:
    """The same orientations, each quaternion with the sign that is nearer to its predecessor: q and -q are one orientation."""
    flips = np.einsum("ij,ij->i", stream.quaternion[1:], stream.quaternion[:-1]) < 0.0
    signs = np.where(np.cumsum(np.concatenate([[0], flips])) % 2, -1.0, 1.0)[: len(stream)]
    return replace(stream, quaternion=stream.quaternion * signs[:, None])
