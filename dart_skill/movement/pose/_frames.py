"""Task frames that turn: each sees positions and orientations in its own axes.

A frame at b with orientation r sees a pose (p, q) of the world at (r^-1 (p - b), r^-1 q). Turning
a frame turns tangent vectors and covariances with it, whatever the angle: log_(r m)(r q) = r
log_m(q).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common import quaternions
from dart_skill.common.checks import LARGEST_LEARNABLE, as_vector
from dart_skill.common.constants import UNTURNED
from dart_skill.movement._placement import moments_of
from dart_skill.movement.pose._manifold import as_points, turn_covariances

IDENTITY = np.array(UNTURNED)


@dataclass(frozen=True, eq=False)
class PoseFrame:
    """Task frame of poses: a place and axes of its own. Columns before the pose, such as time,
    pass through.

    Parameters
    ----------
    position : (3,)
        Origin of the frame in the world [m].
    orientation : (4,)
        Of its axes in the world, unit quaternion x, y, z, w; default: the axes of the world.

    Raises
    ------
    ValueError
        For what is not finite, has another shape, or for a quaternion whose length is not 1.
    """

    position: np.ndarray
    orientation: np.ndarray = field(default_factory=IDENTITY.copy)

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", as_vector(self.position, "position", 3))
        object.__setattr__(self, "orientation", as_points(self.orientation, "orientation", 4, 1))

    def to_frame(self, rows: ArrayLike) -> np.ndarray:
        """Rows (n, q + 7) of the world as the frame sees them."""
        return see(as_rows(rows, "rows"), self.position, self.orientation)

    def from_frame(self, rows: ArrayLike) -> np.ndarray:
        """Rows (n, q + 7) of this frame in the world."""
        return place(as_rows(rows, "rows"), self.position, self.orientation)


PoseCourse = PoseFrame | Sequence[PoseFrame | None] | None
"""A frame: one for all samples, or one for each of them; None where it is missing."""


def as_rows(value: ArrayLike, name: str) -> np.ndarray:
    """Rows (n, q + 7) of q numbers, a position and a unit quaternion."""
    rows = as_points(value, name, ndim=2)
    if rows.shape[1] < 7:
        raise ValueError(
            f"{name} must have columns x, y, z and a quaternion x, y, z, w, after any numbers, got"
            f" shape {rows.shape}"
        )
    if np.abs(rows).max() > LARGEST_LEARNABLE:
        raise ValueError(
            f"{name} holds {np.abs(rows).max():g}, too large for a variance; choose a larger unit"
        )
    return rows


def see(rows: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """Rows (..., q + 7) of the world in frames at positions (..., 3) with orientations (..., 4)."""
    back = orientation * quaternions.CONJUGATE
    local = quaternions.rotate(back, rows[..., -7:-4] - position)
    return _joined(rows, local, quaternions.product(back, rows[..., -4:]))


def place(rows: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """Rows (..., q + 7) of frames at positions (..., 3) with orientations (..., 4) in the world."""
    world = quaternions.rotate(orientation, rows[..., -7:-4]) + position
    return _joined(rows, world, quaternions.product(orientation, rows[..., -4:]))


def _joined(rows: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    numbers = np.broadcast_to(rows[..., :-7], (*orientation.shape[:-1], rows.shape[-1] - 7))
    return np.concatenate([numbers, position, orientation], axis=-1)


@dataclass(frozen=True, eq=False)
class Stage:
    """P frames at m moments: position (m, P, 3), orientation (m, P, 4), seen (m, P)."""

    position: np.ndarray
    orientation: np.ndarray
    seen: np.ndarray

    @classmethod
    def of(
        cls, courses: Sequence[PoseCourse], n: int, name: str, n_frames: int | None = None
    ) -> Stage:
        """Frames as given for n moments; a single moment if none of them moves."""
        moments = moments_of(courses, n, name, n_frames, (PoseFrame,))
        seen = np.array([[frame is not None for frame in row] for row in moments])
        if not seen.any(1).all():
            raise ValueError(
                f"all task frames are missing at moment {int(seen.any(1).argmin())} of {name};"
                " give one at least"
            )
        frames = [[frame or PoseFrame(np.zeros(3)) for frame in row] for row in moments]
        return cls(
            np.array([[frame.position for frame in row] for row in frames]),
            np.array([[frame.orientation for frame in row] for row in frames]),
            seen,
        )

    def place(self, means: np.ndarray, covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gaussians of the frames in the world: means (P, K, w) as (m, K, P, w), covariances (P,
        K, d, d) as (m, K, P, d, d).
        """
        world = place(means, self.position[:, :, None], self.orientation[:, :, None])
        turned = turn_covariances(
            covariances,
            quaternions.matrices(self.orientation)[:, :, None],
            covariances.shape[-1] - 6,
        )
        return np.swapaxes(world, 1, 2), np.swapaxes(turned, 1, 2)
