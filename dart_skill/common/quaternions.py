"""Unit quaternions x, y, z, w of any leading shape, without checks: for cameras, steps of the arm
and models of poses.

SciPy's `Rotation` does the same with checks, and takes two to twenty times longer for a few
rotations. `dart_skill.movement` has functions with checks for callers of the library (`multiply`,
`rotate`, ...).

A rotation vector v turns by |v| [rad] about v. Its quaternion is (sin(|v|/2) v/|v|, cos(|v|/2)).
"""

from __future__ import annotations

import numpy as np

AT_HALF_A_TURN = 1e-14
"""A real part below this is half a turn: which way is then chosen by the axis, so that q and -q
agree.
"""
CONJUGATE = np.array([-1.0, -1.0, -1.0, 1.0])
"""A unit quaternion times this, number by number, is the inverse rotation."""
SHIFTED = np.array([[3, 2, 1, 0], [2, 3, 0, 1], [1, 0, 3, 2]])
SIGNS = np.array([[1.0, -1.0, 1.0, -1.0], [1.0, 1.0, -1.0, -1.0], [-1.0, 1.0, 1.0, -1.0]])
"""i, j and k times a quaternion: which number stands where, and its sign."""
NEXT = np.array([1, 2, 0])
"""Axis after each axis."""
LAST = np.array([2, 0, 1])
"""Axis before each axis."""
"""Numbers of the coordinate after each one, and before it."""


def unit(quaternions: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4) with length 1.

    Parameters
    ----------
    quaternions
        (..., 4), none of them zero.
    """
    return quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)


def product(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Hamilton products (..., 4): the rotation by `right`, then by `left`; leading shapes are
    broadcast.

    Parameters
    ----------
    left
        (..., 4), need not have length 1.
    right
        (..., 4), likewise.
    """
    parts = left[..., :3, None] * (right.take(SHIFTED, axis=-1) * SIGNS)
    return left[..., 3:] * right + parts[..., 0, :] + parts[..., 1, :] + parts[..., 2, :]


def rotate(quaternions: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) turned by unit quaternions; leading shapes are broadcast.

    Parameters
    ----------
    quaternions
        (..., 4).
    vectors
        (..., 3), any unit.
    """
    after, before = quaternions.take(NEXT, axis=-1), quaternions.take(LAST, axis=-1)
    twice = 2.0 * (after * vectors.take(LAST, axis=-1) - before * vectors.take(NEXT, axis=-1))
    return (
        vectors
        + quaternions[..., 3:] * twice
        + after * twice.take(LAST, axis=-1)
        - before * twice.take(NEXT, axis=-1)
    )


def matrices(quaternions: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    return np.stack([rotate(quaternions, axis) for axis in np.eye(3)], axis=-1)


def of_matrices(matrices: np.ndarray) -> np.ndarray:
    """Unit quaternions (n, 4) of rotation matrices (n, 3, 3); the largest of the four numbers is
    positive.
    """
    from scipy.spatial.transform import Rotation  # a plan is carried out without it

    return Rotation.from_matrix(matrices).as_quat()


def from_vectors(vectors: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4) of rotation vectors (..., 3) [rad]."""
    half = 0.5 * np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]
    angle = np.maximum(half, 1e-20)  # of no rotation: sin(x) / x is 1
    return np.concatenate([0.5 * (np.sin(angle) / angle) * vectors, np.cos(half)], axis=-1)


def to_vectors(quaternions: np.ndarray) -> np.ndarray:
    """Rotation vectors (..., 3) of unit quaternions (..., 4), at most half a turn long: q and -q
    have the same one.
    """
    vector, real = quaternions[..., :3], quaternions[..., 3:]
    sign = np.where(np.abs(real) > AT_HALF_A_TURN, np.sign(real), _sign_of_axis(vector))
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    # Near the identity 2 atan(s / c) / s = 2 / c to second order, and s^2 is below rounding.
    small = length < 1e-9
    factor = np.where(
        small, 2.0, 2.0 * np.arctan2(length, np.abs(real)) / np.where(small, 1.0, length)
    )
    return sign * factor * vector


def _sign_of_axis(vectors: np.ndarray) -> np.ndarray:
    """Sign (..., 1) of the largest component of vectors (..., 3), the first of equal ones; 1 for
    zero.
    """
    place = np.abs(vectors).argmax(-1)[..., None]
    return np.where(np.take_along_axis(vectors, place, -1) < 0, -1.0, 1.0)
