"""Poses of one tracked body over time: what it takes to bring them from a laboratory's axes into
ours, and where their orientations leap.

Motive's axes (x right, y up, z towards the viewer) become Z-up by a quarter turn about x, (x, y,
z) -> (x, -z, y).

A body whose markers look the same after a turn is seen in either of two orientations, q and q L
with one turn L in the axes of the body. Which samples leapt is told by continuity, and which of
the two is right by how often it was seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations
from itertools import product as combinations_of
from typing import TypeAlias

import numpy as np

from dart_skill.common.checks import floats
from dart_skill.common.constants import UNTURNED
from dart_skill.common.quaternions import CONJUGATE, product
from dart_skill.common.world import the_world

Axes: TypeAlias = tuple[str, str, str]
"""Where our axes x, y, z point in other axes: each is x, y or z, with a minus where it points the
other way.
"""
AS_OURS: Axes = ("x", "y", "z")
"""Axes that point like ours."""
UP_AXES: dict[str, Axes] = {"z": AS_OURS, "y": ("x", "-z", "y"), "x": ("y", "z", "x")}
"""Where our axes point in axes of which this one is up."""
_MIRROR = np.diag([1.0, 1.0, -1.0])


def nearest_axes(matrix: np.ndarray) -> Axes:
    """The signed axes whose matrix is nearest to an orthogonal one (3, 3).

    Parameters
    ----------
    matrix
        Takes vectors of other axes into ours.
    """

    def likeness(axes: Axes) -> float:
        return float(np.sum(matrix * axes_matrix(axes)))

    x, y, z = ([name, f"-{name}"] for name in AS_OURS)
    signed = (one for order in permutations((x, y, z)) for one in combinations_of(*order))
    return max(((a, b, c) for a, b, c in signed), key=likeness)


def axes_matrix(axes: Sequence[str]) -> np.ndarray | None:
    """The matrix (3, 3) that takes vectors of other axes into ours, None unless these are three
    different axes.

    Parameters
    ----------
    axes
        As `Axes`.
    """
    if sorted(one.lstrip("-+") for one in axes) != ["x", "y", "z"] or any(
        len(one) > 2 for one in axes
    ):
        return None
    signs = [-1.0 if one.startswith("-") else 1.0 for one in axes]
    return np.array(
        [
            np.where(np.array(AS_OURS) == one[-1], sign, 0.0)
            for one, sign in zip(axes, signs, strict=True)
        ]
    )


@dataclass(frozen=True)
class RigidTransform:
    """p -> R(quaternion) p + position.

    Parameters
    ----------
    position
        (3,) [m].
    quaternion
        (4,), x, y, z, w, of norm 1.
    """

    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    quaternion: np.ndarray = field(default_factory=lambda: np.array(UNTURNED))

    def __post_init__(self) -> None:
        position, quaternion = (floats(value) for value in (self.position, self.quaternion))
        if position.shape != (3,) or not np.isfinite(position).all():
            raise ValueError(f"position is {self.position}: give three finite numbers in metres")
        if quaternion.shape != (4,) or not abs(np.linalg.norm(quaternion) - 1.0) < 1e-3:
            raise ValueError(f"quaternion is {self.quaternion}: give x, y, z, w of norm 1")
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "quaternion", quaternion / np.linalg.norm(quaternion))


@dataclass(frozen=True, eq=False)
class PoseStream:
    """Poses as they were recorded, in their order, good or bad.

    Parameters
    ----------
    body
        Its name.
    stamp_ns
        (n,) int64.
    position
        (n, 3) [m].
    quaternion
        (n, 4), x, y, z, w.
    frame_id
        Name of the axes.
    """

    body: str
    stamp_ns: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    frame_id: str = the_world().frame_id

    def __post_init__(self) -> None:
        stamps = np.asarray(self.stamp_ns, dtype=np.int64)
        position, quaternion = floats(self.position), floats(self.quaternion)
        if (
            stamps.ndim != 1
            or position.shape != (len(stamps), 3)
            or quaternion.shape != (len(stamps), 4)
        ):
            shapes = f"{stamps.shape}, {position.shape}, {quaternion.shape}"
            raise ValueError(
                f"poses of {self.body}: need stamps (n,), positions (n, 3), quaternions (n, 4),"
                f" got {shapes}"
            )
        for name, value in (
            ("stamp_ns", stamps),
            ("position", position),
            ("quaternion", quaternion),
        ):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def take(self, index: np.ndarray) -> PoseStream:
        """The samples of an index array or mask."""
        return replace(
            self,
            stamp_ns=self.stamp_ns[index],
            position=self.position[index],
            quaternion=self.quaternion[index],
        )


def transformed(
    stream: PoseStream,
    world: RigidTransform,
    offset: RigidTransform | None = None,
    axes: Axes = AS_OURS,
    orientation_axes: Axes | None = None,
    is_inverse: bool = False,
) -> PoseStream:
    """The poses in our axes. Norms of quaternions stay as they were, for they tell faults.

    Orientations are turned as positions are: the body keeps its own axes. Of a body in left-handed
    axes the z axis is mirrored, too.

    Parameters
    ----------
    world
        Takes axes that point like ours into ours.
    offset
        Our body's frame in the axes of the tracked body.
    axes
        Where ours point in those of the stream.
    orientation_axes
        The same for the orientations; None: as for the positions.
    is_inverse
        Whether the quaternions are those of the inverse rotation.
    """
    from scipy.spatial.transform import Rotation  # our own bags need none

    matrix, of_turns = axes_matrix(axes), axes_matrix(orientation_axes or axes)
    # as they were checked when the mapping was read
    assert matrix is not None and of_turns is not None
    turn = Rotation.from_quat(world.quaternion)
    position = turn.apply(stream.position @ matrix.T) + world.position
    norm = np.linalg.norm(stream.quaternion, axis=1, keepdims=True)
    known = np.isfinite(norm[:, 0]) & (norm[:, 0] > 0.0)
    recorded = Rotation.from_quat(np.where(known[:, None], stream.quaternion, UNTURNED))
    recorded = recorded.inv() if is_inverse else recorded
    mirror = _MIRROR if np.linalg.det(of_turns) < 0.0 else np.eye(3)
    turned = (turn * Rotation.from_matrix(of_turns @ recorded.as_matrix() @ mirror)).as_matrix()
    turned = Rotation.from_matrix(np.where(known[:, None, None], turned, np.eye(3)))
    if offset is not None:
        position = position + turned.apply(offset.position)
        turned = turned * Rotation.from_quat(offset.quaternion)
    quaternion = np.where(known[:, None], norm * turned.as_quat(), stream.quaternion)
    return replace(stream, position=position, quaternion=quaternion)


def with_continuous_signs(stream: PoseStream) -> PoseStream:
    """The same orientations, each quaternion with the sign that is nearer to its predecessor: q
    and -q are one orientation.
    """
    flips = np.einsum("ij,ij->i", stream.quaternion[1:], stream.quaternion[:-1]) < 0.0
    signs = np.where(np.cumsum(np.concatenate([[0], flips])) % 2, -1.0, 1.0)[: len(stream)]
    return replace(stream, quaternion=stream.quaternion * signs[:, None])


LEAP = 0.5
"""Least angle between the two solutions [rad]."""
ALIKE = 0.35
"""Difference between two leaps that may come from the movement between frames and from noise
[rad].
"""
AT_ONCE = 0.05
"""Longest time between two frames of a leap [s]."""
LEAST_STRETCH = 3
"""Samples of a stretch that leapt; fewer, only once, are an outlier."""
CLEARLY = 0.4
"""Largest share of samples that leapt of which it is sure that they are the wrong ones."""


def find_leaps(stream: PoseStream) -> tuple[PoseStream, np.ndarray, float] | None:
    """Where an orientation leaps between two solutions; None where it does not, or leaps
    otherwise.

    Parameters
    ----------
    stream
        Quaternions of norm 1, in order of time.

    Returns
    -------
    tuple[PoseStream, np.ndarray, float] | None
        The stream with all samples in the solution that was seen more often, whether each sample
        showed the other one (n,), and the angle between the two [rad].
    """
    if len(stream) < 2 * LEAST_STRETCH:
        return None
    q = stream.quaternion
    steps = product(q[:-1] * CONJUGATE, q[1:])
    at_once = np.diff(stream.stamp_ns) < 1e9 * AT_ONCE
    sudden = at_once & (_angles(steps) > LEAP)
    if not sudden.any():
        return None
    turn = steps[np.argmax(sudden)]
    there, back = (np.broadcast_to(one, steps.shape) for one in (turn * CONJUGATE, turn))
    if np.any(
        np.minimum(_angles(product(steps, there)), _angles(product(steps, back)))[sudden] > ALIKE
    ):
        return None  # each leap is another one
    leapt = _leapt(steps, turn)
    stretches = np.diff(
        np.flatnonzero(np.diff(np.concatenate([[0], leapt.astype(int), [0]])))
    ).tolist()[::2]
    if np.mean(leapt) > 0.5:
        leapt, turn = ~leapt, turn * CONJUGATE
    if len(stretches) < 2 and max(stretches, default=0) < LEAST_STRETCH:
        return None
    back = product(q, np.broadcast_to(turn * CONJUGATE, q.shape))
    mended = replace(stream, quaternion=np.where(leapt[:, None], back, q))
    return mended, leapt, float(_angles(turn[None])[0])


def _leapt(steps: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Which samples (n,) show the other solution than the first one, so that the body turns as
    little as it can between two of them.
    """
    n = len(steps)
    # the step, if the second sample has leapt
    away = product(steps, np.broadcast_to(turn * CONJUGATE, steps.shape))
    home = product(np.broadcast_to(turn, steps.shape), steps)  # ... and if the first one has
    both = product(home, np.broadcast_to(turn * CONJUGATE, steps.shape))
    stays, goes, comes, remains = map(_angles, (steps, away, home, both))
    found = np.zeros(n + 1, dtype=bool)
    for k in range(n):  # each depends on the one before it
        found[k + 1] = remains[k] <= comes[k] if found[k] else goes[k] < stays[k]
    return found


def _angles(quaternion: np.ndarray) -> np.ndarray:
    """Angles (n,) of turns (n, 4) [rad]."""
    return 2.0 * np.arctan2(np.linalg.norm(quaternion[:, :3], axis=1), np.abs(quaternion[:, 3]))
