"""Task frames: world = A local + b (thesis 7.5.2), and the named ones of chapter 8 for features t, x, y, z,
alpha, beta.

Named frames take `n_angles`, the number of angle columns after the position: 2 by default, 0 for the features
t, x, y, z of (8.1). The thesis frames (8.1) to (8.3) expect alpha and beta relative to the world's axes,
`features(..., azimuth=0)`. The azimuth frames turn with the target, and expect them relative to the same
azimuth, `features(..., azimuth=azimuth)`: a throw towards another side is then the same throw.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.checks import as_count, as_finite, as_samples, as_vector
from dart_skill.movement._time import as_stamps
from dart_skill.movement.orientation import angles_from_quaternions, pointing_angles, turn_about_z


@dataclass(frozen=True, eq=False)
class TaskFrame:
    """Frame with matrix A (m, m), invertible, and offset b (m,): a local point p is A p + b in the world."""

    A: np.ndarray
    b: np.ndarray

    def __post_init__(self):
        matrix = as_samples(self.A, "A")
        if matrix.shape[0] != matrix.shape[1]:
            raise ValueError(f"A must be square, got shape {matrix.shape}")
        # Rows in their own units, so that only the directions decide.
        lengths = np.linalg.norm(matrix, axis=1, keepdims=True)
        if lengths.min() == 0 or np.linalg.cond(matrix / lengths) > 1e12:
            raise ValueError(f"A is not invertible: {matrix.tolist()}")
        object.__setattr__(self, "A", matrix)
        object.__setattr__(self, "b", as_vector(self.b, "b", len(matrix)))

    @property
    def n_dims(self) -> int:
        return self.b.size

    def to_frame(self, points: ArrayLike) -> np.ndarray:
        """World points (n, m) as this frame sees them."""
        return np.linalg.solve(self.A, (as_samples(points, "points", self.n_dims) - self.b).T).T

    def from_frame(self, points: ArrayLike) -> np.ndarray:
        """Points (n, m) of this frame in the world."""
        return as_samples(points, "points", self.n_dims) @ self.A.T + self.b


def _frame(axes: np.ndarray, position: np.ndarray, angles: np.ndarray) -> TaskFrame:
    """Frame in which time passes through, positions turn by axes (3, 3) about `position`, and angles are
    offset.
    """
    matrix = np.eye(4 + len(angles))
    matrix[1:4, 1:4] = axes
    return TaskFrame(matrix, np.concatenate([[0.0], position, angles]))


def turn_matrix(azimuth: float) -> np.ndarray:
    """Rotation (3, 3) by an azimuth, radians, about z."""
    azimuth = float(as_finite(azimuth, "azimuth", 0))
    cos, sin = np.cos(azimuth), np.sin(azimuth)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def azimuth_of(target: ArrayLike, origin: ArrayLike = (0.0, 0.0, 0.0)) -> float:
    """Azimuth, radians, of a target (3,) about the vertical through the origin (3,)."""
    x, y, _ = as_vector(target, "target", 3) - as_vector(origin, "origin", 3)
    if np.hypot(x, y) < 1e-9:
        raise ValueError(f"target {np.asarray(target).tolist()} lies on the vertical through the origin, it has no azimuth")
    return float(np.arctan2(y, x))


def pointing_axes(direction: ArrayLike) -> np.ndarray:
    """Rotation (3, 3) with the direction as first column and a horizontal second one: it turns continuously
    with the direction.
    """
    direction = as_vector(direction, "direction", 3)
    along = turn_matrix(azimuth_of(direction))
    elevation = np.arctan2(direction[2], np.hypot(direction[0], direction[1]))
    cos, sin = np.cos(elevation), np.sin(elevation)
    return along @ np.array([[cos, 0.0, -sin], [0.0, 1.0, 0.0], [sin, 0.0, cos]])


def base_frame(n_angles: int = 2) -> TaskFrame:
    """(8.2), first frame: the identity."""
    return _frame(np.eye(3), np.zeros(3), np.zeros(as_count(n_angles, "n_angles", 0)))


def start_frame(start: ArrayLike, n_angles: int = 2) -> TaskFrame:
    """(8.3): world axes at the starting position (3,)."""
    return _frame(np.eye(3), as_vector(start, "start", 3), np.zeros(as_count(n_angles, "n_angles", 0)))


def target_frame(target: ArrayLike, pointing: ArrayLike = (0.0, 0.0), origin: ArrayLike = (0.0, 0.0, 0.0)) -> TaskFrame:
    """(8.1) and (8.2), second frame: at the target (3,), first axis from the origin to the target, second
    axis horizontal.

    pointing: Target_alpha and Target_beta, see `pointing_at`; () for features without angles.
    """
    target = as_vector(target, "target", 3)
    return _frame(pointing_axes(target - as_vector(origin, "origin", 3)), target, as_vector(pointing, "pointing"))


def azimuth_frame(azimuth: float, origin: ArrayLike = (0.0, 0.0, 0.0), n_angles: int = 2) -> TaskFrame:
    """Frame at the origin (3,) turned about z to an azimuth, radians; time and angles pass through."""
    return _frame(turn_matrix(azimuth), as_vector(origin, "origin", 3), np.zeros(as_count(n_angles, "n_angles", 0)))


def azimuth_target_frame(target: ArrayLike, origin: ArrayLike = (0.0, 0.0, 0.0), n_angles: int = 2) -> TaskFrame:
    """Frame at the target (3,) turned about z to its azimuth as seen from the origin; time and angles pass
    through.
    """
    return azimuth_frame(azimuth_of(target, origin), target, n_angles)


def pointing_at(target: ArrayLike, position: ArrayLike, azimuth: float = 0.0) -> np.ndarray:
    """Target_alpha and Target_beta of (8.2): angles (2,) of the direction from a position to the target, in
    axes turned by an azimuth.
    """
    direction = as_vector(target, "target", 3) - as_vector(position, "position", 3)
    return pointing_angles((direction @ turn_matrix(azimuth))[None])[0]


def features(time: ArrayLike, positions: ArrayLike, quaternions: ArrayLike, azimuth: float = 0.0) -> np.ndarray:
    """(n, 6) t, x, y, z, alpha, beta of hand poses in the world: stamps (n,), positions (n, 3), quaternions
    (n, 4).

    Positions stay in the world; the angles are relative to axes turned by the azimuth, and a frame that is to
    be used with these features must be of the same azimuth. The roll is in
    `angles_from_quaternions(turn_about_z(quaternions, -azimuth))[:, 2]`.
    """
    positions = as_samples(positions, "positions", 3)
    time = as_stamps(time, len(positions))
    azimuth = float(as_finite(azimuth, "azimuth", 0))
    angles = angles_from_quaternions(turn_about_z(as_samples(quaternions, "quaternions", 4), -azimuth))
    if len(angles) != len(positions):
        raise ValueError(f"one quaternion per position is needed, got {len(angles)} for {len(positions)}")
    return np.column_stack([time, positions, angles[:, :2]])
