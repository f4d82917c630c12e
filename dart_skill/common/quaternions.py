"""Unit quaternions x, y, z, w of any leading shape, without checks: for cameras, steps of the arm
and models of poses.

SciPy's `Rotation` does the same with checks, and takes two to twenty times longer for a few
rotations. `dart_skill.movement` has functions for callers of the library (`multiply`, `rotate`,
...), which check what they get.

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
NEXT, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
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


def rotate_one(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """One vector (3,) turned by one unit quaternion, in a seventh of the time that `rotate` takes.

    It adds in another order than `rotate`, so the last bits may differ.

    Parameters
    ----------
    quaternion
        (4,).
    vector
        (3,), any unit.
    """
    (x, y, z, w), (a, b, c) = quaternion.tolist(), vector.tolist()
    p, q, r = y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c
    return np.array(
        [a + 2.0 * (y * r - z * q), b + 2.0 * (z * p - x * r), c + 2.0 * (x * q - y * p)]
    )


def matrices(quaternions: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    return np.stack([rotate(quaternions, axis) for axis in np.eye(3)], axis=-1)


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
