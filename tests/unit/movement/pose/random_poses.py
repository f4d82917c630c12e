"""Poses at random, and laws that hold for all of them."""

import numpy as np
from scipy.spatial.transform import Rotation


def orientations(n, rng):
    """(n, 4), spread over all orientations."""
    quaternions = rng.normal(size=(n, 4))
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def near(quaternion, spread, n, rng):
    """(n, 4) about one quaternion (4,); spread [rad] of each coordinate of the rotation vectors."""
    return (
        Rotation.from_rotvec(rng.normal(0.0, spread, (n, 3))) * Rotation.from_quat(quaternion)
    ).as_quat()


def flipped(rows, rng):
    """The same points (..., n + 4), half of them with the other sign of the quaternion."""
    rows = np.array(rows)
    rows[..., -4:] *= rng.choice([-1.0, 1.0], rows.shape[:-1])[..., None]
    return rows


def turned(rows, rotation, first=0, shift=0.0):
    """Rows (..., first + 7) with position and orientation turned by a rotation of scipy and
    shifted; the first columns stay.
    """
    rows = np.array(rows)
    flat = rows.reshape(-1, rows.shape[-1])
    flat[:, first : first + 3] = rotation.apply(flat[:, first : first + 3]) + shift
    flat[:, -4:] = (rotation * Rotation.from_quat(flat[:, -4:])).as_quat()
    return flat.reshape(rows.shape)


def blocks(rotation, first=0):
    """Matrix (first + 6, first + 6) that turns tangent vectors as `turned` turns poses."""
    whole = np.eye(first + 6)
    whole[first : first + 3, first : first + 3] = whole[-3:, -3:] = rotation.as_matrix()
    return whole


def apart(one, other):
    """Largest angle [rad] between orientations (..., 4) in the last columns of two arrays of
    points.
    """
    pair = [
        Rotation.from_quat(np.reshape(np.asarray(rows)[..., -4:], (-1, 4)))
        for rows in (one, other)
    ]
    return (pair[0] * pair[1].inv()).magnitude().max()
