"""Task frames, world = A local + b (thesis 7.5.2), and the frames of chapter 8 for features t, x,
y, z, alpha, beta.

The constructors of these frames take `n_angles`, the number of angle columns after the position: 2
by default, 0 for the features t, x, y, z of (8.1). For the frames of the thesis, (8.1) to (8.3),
alpha and beta must be relative to the axes of the world: `features(..., azimuth=0)`. The azimuth
frames turn with the target. For them alpha and beta must be relative to axes turned by the same
azimuth: `features(..., azimuth=azimuth)`. Then a throw to another side is the same throw.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_finite, as_samples, as_vector
from dart_skill.movement._orientation import angles_from_quaternions, pointing_angles, turn_about_z
from dart_skill.movement._time import as_stamps


@dataclass(frozen=True, eq=False)
class TaskFrame:
    """Task frame over m features: a local point p (m,) is A p + b in the world (thesis 7.5.2).

    Parameters
    ----------
    A : (m, m)
        Invertible.
    b : (m,)
        Origin of the frame in the world.
    """

    A: np.ndarray
    b: np.ndarray

    def __post_init__(self) -> None:
        matrix = as_samples(self.A, "A")
        if matrix.shape[0] != matrix.shape[1]:
            raise ValueError(f"A must be square, got shape {matrix.shape}")
        # Each row is scaled to length 1, so that the units of the features do not matter.
        lengths = np.linalg.norm(matrix, axis=1, keepdims=True)
        if lengths.min() == 0 or _condition_is_above(1e12, matrix / lengths):
            raise ValueError(f"A is not invertible: {matrix.tolist()}")
        object.__setattr__(self, "A", matrix)
        object.__setattr__(self, "b", as_vector(self.b, "b", len(matrix)))

    @classmethod
    def _made(cls, A: np.ndarray, b: np.ndarray) -> TaskFrame:
        """Frame of parameters that have been checked."""
        frame = object.__new__(cls)
        object.__setattr__(frame, "A", A)
        object.__setattr__(frame, "b", b)
        return frame

    @property
    def n_dims(self) -> int:
        return self.b.size

    def at(self, origin: ArrayLike) -> TaskFrame:
        """A frame with the same axes at another origin (m,).

        Raises
        ------
        ValueError
            For one that is none.
        """
        return self._made(self.A, as_vector(origin, "origin", len(self.A)))

    def with_input(self, column: int) -> TaskFrame:
        """The frame with one more input, which passes through.

        Parameters
        ----------
        column
            Where it stands, in front of the column that was there.
        """
        m, n = column, self.n_dims + 1
        A, b = np.zeros((n, n)), np.zeros(n)
        A[:m, :m], A[:m, m + 1 :], A[m + 1 :, :m], A[m + 1 :, m + 1 :] = (
            self.A[:m, :m],
            self.A[:m, m:],
            self.A[m:, :m],
            self.A[m:, m:],
        )
        A[m, m] = 1.0
        b[:m], b[m + 1 :] = self.b[:m], self.b[m:]
        return self._made(A, b)

    def to_frame(self, points: ArrayLike) -> np.ndarray:
        """Points (n, m) of the world in local coordinates of this frame."""
        return np.linalg.solve(self.A, (as_samples(points, "points", self.n_dims) - self.b).T).T

    def from_frame(self, points: ArrayLike) -> np.ndarray:
        """Local points (n, m) of this frame in the world."""
        return as_samples(points, "points", self.n_dims) @ self.A.T + self.b


def _condition_is_above(limit: float, matrix: np.ndarray) -> bool:
    """Whether a matrix (m, m) of unit rows has a larger condition number. It is below 2 / |det|
    (Guggenheimer, Edelman and Johnson 1995), which takes a quarter of the time of the singular
    values and settles it for all frames in practice.
    """
    return abs(np.linalg.det(matrix)) < 2.0 / limit and bool(np.linalg.cond(matrix) > limit)


@dataclass(frozen=True, eq=False)
class MovingFrame:
    """A task frame over [t, u, y] at one instant of its own motion. What moves with it is seen at
    rest.

    Parameters
    ----------
    frame
        TaskFrame, its axes A, and b with the position (d,) of its origin in the last d features.
    velocity
        (d,), of the origin, in the units of the movement per s.
    attractor
        (d,), the attractor of the origin's own motion by (7.20), for the gains of the model. Since
        (7.20) is linear, an attractor that is seen from there is the attractor of the motion
        relative to the frame.
    """

    frame: TaskFrame
    velocity: np.ndarray
    attractor: np.ndarray

    def __post_init__(self) -> None:
        velocity, attractor = (
            as_vector(self.velocity, "velocity"),
            as_vector(self.attractor, "attractor"),
        )
        if not len(velocity) == len(attractor) < self.frame.n_dims:
            raise ValueError(
                f"velocity and attractor have {len(velocity)} and {len(attractor)} entries, the"
                f" frame {self.frame.n_dims}"
            )
        object.__setattr__(self, "velocity", velocity)
        object.__setattr__(self, "attractor", attractor)


def _frame(axes: np.ndarray, position: np.ndarray, angles: np.ndarray) -> TaskFrame:
    """Frame that leaves time as it is, has the axes (3, 3), a rotation, at `position` (3,), and
    adds `angles` to the angle columns.
    """
    matrix = np.eye(4 + len(angles))
    matrix[1:4, 1:4] = axes
    # turns are invertible
    return TaskFrame._made(matrix, np.concatenate([[0.0], position, angles]))


def turn_matrix(azimuth: float) -> np.ndarray:
    """Rotation (3, 3) by an azimuth, radians, about z."""
    azimuth = float(as_finite(azimuth, "azimuth", 0))
    cos, sin = np.cos(azimuth), np.sin(azimuth)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def azimuth_of(target: ArrayLike, origin: ArrayLike = (0.0, 0.0, 0.0)) -> float:
    """Azimuth, radians, of a target (3,) about the vertical through the origin (3,).

    Raises
    ------
    ValueError
        For a target on the vertical.
    """
    x, y, _ = as_vector(target, "target", 3) - as_vector(origin, "origin", 3)
    if np.hypot(x, y) < 1e-9:
        raise ValueError(
            f"target {np.asarray(target).tolist()} lies on the vertical through the origin, it has"
            " no azimuth"
        )
    return float(np.arctan2(y, x))


def pointing_axes(direction: ArrayLike) -> np.ndarray:
    """Rotation (3, 3) whose first column is the direction (3,) and whose second column is
    horizontal.

    It turns continuously with the direction.
    """
    direction = as_vector(direction, "direction", 3)
    along = turn_matrix(azimuth_of(direction))
    elevation = np.arctan2(direction[2], np.hypot(direction[0], direction[1]))
    cos, sin = np.cos(elevation), np.sin(elevation)
    return along @ np.array([[cos, 0.0, -sin], [0.0, 1.0, 0.0], [sin, 0.0, cos]])


def base_frame(n_angles: int = 2) -> TaskFrame:
    """(8.2), first frame: the identity.

    Parameters
    ----------
    n_angles
        Of the features, after the position.
    """
    return _frame(np.eye(3), np.zeros(3), np.zeros(as_count(n_angles, "n_angles", 0)))


def start_frame(start: ArrayLike, n_angles: int = 2) -> TaskFrame:
    """(8.3): world axes at the starting position (3,).

    Parameters
    ----------
    start
        The position.
    n_angles
        Of the features, after the position.
    """
    return _frame(
        np.eye(3), as_vector(start, "start", 3), np.zeros(as_count(n_angles, "n_angles", 0))
    )


def target_frame(
    target: ArrayLike, pointing: ArrayLike = (0.0, 0.0), origin: ArrayLike = (0.0, 0.0, 0.0)
) -> TaskFrame:
    """(8.1) and (8.2), second frame: at the target (3,), first axis from the origin to the target,
    second axis horizontal.

    Parameters
    ----------
    pointing : (2,) [rad]
        Target_alpha and Target_beta, see `pointing_at`; () for features without angles.
    """
    target = as_vector(target, "target", 3)
    return _frame(
        pointing_axes(target - as_vector(origin, "origin", 3)),
        target,
        as_vector(pointing, "pointing"),
    )


def azimuth_frame(
    azimuth: float, origin: ArrayLike = (0.0, 0.0, 0.0), n_angles: int = 2
) -> TaskFrame:
    """Frame at the origin (3,), turned about z by an azimuth [rad]; time and angles are not
    transformed.
    """
    return _frame(
        turn_matrix(azimuth),
        as_vector(origin, "origin", 3),
        np.zeros(as_count(n_angles, "n_angles", 0)),
    )


def azimuth_target_frame(
    target: ArrayLike, origin: ArrayLike = (0.0, 0.0, 0.0), n_angles: int = 2
) -> TaskFrame:
    """Frame at the target (3,), turned about z by the target's azimuth as seen from the origin
    (3,).

    Time and angles are not transformed.
    """
    return azimuth_frame(azimuth_of(target, origin), target, n_angles)


def pointing_at(target: ArrayLike, position: ArrayLike, azimuth: float = 0.0) -> np.ndarray:
    """Target_alpha and Target_beta of (8.2): angles (2,) [rad] of the direction from a position
    (3,) to the target (3,).

    They are relative to axes turned by the azimuth [rad].
    """
    direction = as_vector(target, "target", 3) - as_vector(position, "position", 3)
    return pointing_angles((direction @ turn_matrix(azimuth))[None])[0]


def features(
    time: ArrayLike, positions: ArrayLike, quaternions: ArrayLike, azimuth: float = 0.0
) -> np.ndarray:
    """Features t, x, y, z, alpha, beta (n, 6) of hand poses in the world: stamps (n,), positions
    (n, 3), quaternions (n, 4).

    Positions stay in the world. The angles are relative to axes turned by the azimuth [rad]. A
    frame that is used with these features must have the same azimuth. The roll is
    `angles_from_quaternions(turn_about_z(quaternions, -azimuth))[:, 2]`.

    Raises
    ------
    ValueError
        If these are not equally many.
    """
    positions = as_samples(positions, "positions", 3)
    time = as_stamps(time, len(positions))
    azimuth = float(as_finite(azimuth, "azimuth", 0))
    angles = angles_from_quaternions(
        turn_about_z(as_samples(quaternions, "quaternions", 4), -azimuth)
    )
    if len(angles) != len(positions):
        raise ValueError(
            f"one quaternion per position is needed, got {len(angles)} for {len(positions)}"
        )
    return np.column_stack([time, positions, angles[:, :2]])
