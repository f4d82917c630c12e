"""Rotations of a whole recording: rows of quaternions x, y, z, w, vectors turned by them, and the
angles of the hand.

SciPy and NumPy take three to ten times longer for some hundred rows. Arguments are trusted;
`dart_skill.movement` has functions for callers of the library, which check them. This module is
compiled (docs/development.md): rotations.pxd beside it has the types.
"""

import math

import numpy as np


def least_length(quaternions: np.ndarray, unit: np.ndarray) -> float:
    """Write quaternions (n, 4) scaled to length 1 (n, 4)

    Parameters
    ----------
    quaternions
        (n, 4), n >= 1.
    unit
        (n, 4), is written.

    Returns
    -------
    float
        The least of their lengths.
    """
    least = 0.0
    for i in range(quaternions.shape[0]):
        x, y, z, w = quaternions[i, 0], quaternions[i, 1], quaternions[i, 2], quaternions[i, 3]
        length = math.sqrt(x * x + y * y + z * z + w * w)
        least = length if i == 0 else min(least, length)
        for k in range(4):
            unit[i, k] = quaternions[i, k] / length if length > 0.0 else 0.0
    return least


def turned(quaternions: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) turned by unit quaternions (n, 4); one of them may have one row for all rows
    of the other.

    Parameters
    ----------
    quaternions
        (n, 4) or (1, 4).
    vectors
        (n, 3) or (1, 3).
    """
    n_quaternions, n_vectors = quaternions.shape[0], vectors.shape[0]
    n = n_vectors if n_quaternions == 1 else n_quaternions
    found = np.empty((n, 3))
    result = found
    for i in range(n):
        q, v = 0 if n_quaternions == 1 else i, 0 if n_vectors == 1 else i
        x, y, z, w = quaternions[q, 0], quaternions[q, 1], quaternions[q, 2], quaternions[q, 3]
        a, b, c = vectors[v, 0], vectors[v, 1], vectors[v, 2]
        p, r, s = y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c
        result[i, 0] = a + 2.0 * (y * s - z * r)
        result[i, 1] = b + 2.0 * (z * p - x * s)
        result[i, 2] = c + 2.0 * (x * r - y * p)
    return found


def hand_angles(quaternions: np.ndarray) -> np.ndarray:
    """Angles alpha, beta, roll (n, 3) [rad] of hand orientations in a task frame (8.4.1), each in
    half a turn to either side of zero.

    Parameters
    ----------
    quaternions
        (n, 4), of unit length.
    """
    found = np.empty((quaternions.shape[0], 3))
    angles = found
    for i in range(angles.shape[0]):
        x, y, z, w = quaternions[i, 0], quaternions[i, 1], quaternions[i, 2], quaternions[i, 3]
        # half the hand's z axis, and half its y axis
        ahead_x, ahead_y, ahead_z = x * z + w * y, y * z - w * x, 0.5 - x * x - y * y
        side_x, side_y, side_z = x * y - w * z, 0.5 - x * x - z * z, y * z + w * x
        across = math.sqrt(ahead_x * ahead_x + ahead_z * ahead_z)
        length = math.sqrt(ahead_x * ahead_x + ahead_y * ahead_y + ahead_z * ahead_z)
        # With roll = 0 the y axis would be `left`; roll turns it towards `up`.
        cos_alpha, sin_alpha = (ahead_x / across, ahead_z / across) if across > 0.0 else (1.0, 0.0)
        cos_beta, sin_beta = across / length, ahead_y / length
        left = -sin_beta * cos_alpha * side_x + cos_beta * side_y - sin_beta * sin_alpha * side_z
        up = cos_alpha * side_z - sin_alpha * side_x
        angles[i, 0], angles[i, 1], angles[i, 2] = (
            math.atan2(ahead_z, ahead_x),
            math.atan2(ahead_y, across),
            math.atan2(up, left),
        )
    return found


def of_hand_angles(angles: np.ndarray) -> np.ndarray:
    """Unit quaternions (n, 4) of angles alpha, beta, roll: neighbours have a non-negative dot
    product.

    Parameters
    ----------
    angles
        (n, 3) [rad], as of `hand_angles`.
    """
    found, half_root = np.empty((angles.shape[0], 4)), math.sqrt(0.5)
    result = found
    for i in range(result.shape[0]):
        sa, ca = math.sin(0.5 * angles[i, 0]), math.cos(0.5 * angles[i, 0])
        sb, cb = math.sin(0.5 * angles[i, 1]), math.cos(0.5 * angles[i, 1])
        sr, cr = math.sin(0.5 * angles[i, 2]), math.cos(0.5 * angles[i, 2])
        # R_y(-alpha) R_z(beta), then R_x(roll), then R_y(90 degrees), each as a quaternion.
        a, b, c, d = -sa * sb, -sa * cb, ca * sb, ca * cb
        x, y, z, w = d * sr + a * cr, b * cr + c * sr, c * cr - b * sr, d * cr - a * sr
        a, b, c, d = (
            half_root * (x - z),
            half_root * (w + y),
            half_root * (z + x),
            half_root * (w - y),
        )
        if (
            i > 0
            and a * result[i - 1, 0]
            + b * result[i - 1, 1]
            + c * result[i - 1, 2]
            + d * result[i - 1, 3]
            < 0.0
        ):
            a, b, c, d = -a, -b, -c, -d
        result[i, 0], result[i, 1], result[i, 2], result[i, 3] = a, b, c, d
    return found


def unwrap(angles: np.ndarray, near: float) -> None:
    """Add full turns to angles, so that they have no jumps and the first is within half a turn of
    `near`.

    Parameters
    ----------
    angles
        (n,) [rad], n >= 1, is written.
    near
        [rad].
    """
    half = math.atan2(0.0, -1.0)  # half a turn
    turn = 2.0 * half
    last, added = angles[0], turn * math.ceil((near - angles[0]) / turn - 0.5)
    for i in range(angles.shape[0]):
        jump, last = angles[i] - last, angles[i]
        if abs(jump) >= half:
            added -= turn * math.ceil(jump / turn - 0.5)
        angles[i] += added


def of_matrices(matrices: np.ndarray) -> np.ndarray:
    """Unit quaternions (n, 4) of rotation matrices; the largest of the four numbers is positive.

    Parameters
    ----------
    matrices
        (n, 3, 3).
    """
    found = np.empty((matrices.shape[0], 4))
    result = found
    for i in range(result.shape[0]):
        _of_matrix(matrices[i], result[i])
    least_length(result, result)
    return found


def quaternion_into(vector: np.ndarray, quaternion: np.ndarray) -> None:
    """Write the quaternion of a rotation vector.

    Parameters
    ----------
    vector
        (3,) [rad].
    quaternion
        (4,), is written.
    """
    half = 0.5 * math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
    share = 0.5 * math.sin(half) / half if half > 1e-20 else 0.5
    for k in range(3):
        quaternion[k] = share * vector[k]
    quaternion[3] = math.cos(half)


def vector_into(quaternion: np.ndarray, vector: np.ndarray) -> None:
    """Write the rotation vector of a unit quaternion, at most half a turn long.

    Parameters
    ----------
    quaternion
        (4,).
    vector
        (3,) [rad], is written.
    """
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    length = math.sqrt(x * x + y * y + z * z)
    sign = -1.0 if w < 0.0 else 1.0
    share = sign * (2.0 * math.atan2(length, abs(w)) / length if length > 1e-9 else 2.0)
    vector[0], vector[1], vector[2] = share * x, share * y, share * z


def product_into(left: np.ndarray, right: np.ndarray, result: np.ndarray) -> None:
    """Write the Hamilton product: the rotation by `right`, then by `left`.

    Parameters
    ----------
    left, right
        (4,).
    result
        (4,), is written, and is neither of them.
    """
    a, b, c, d = left[0], left[1], left[2], left[3]
    x, y, z, w = right[0], right[1], right[2], right[3]
    result[0] = d * x + a * w + b * z - c * y
    result[1] = d * y - a * z + b * w + c * x
    result[2] = d * z + a * y - b * x + c * w
    result[3] = d * w - a * x - b * y - c * z


def matrix_into(quaternion: np.ndarray, matrix: np.ndarray) -> None:
    """Write the rotation matrix of a unit quaternion.

    Parameters
    ----------
    quaternion
        (4,).
    matrix
        (3, 3), is written.
    """
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    matrix[0, 0], matrix[1, 1], matrix[2, 2] = (
        1.0 - 2.0 * (y * y + z * z),
        1.0 - 2.0 * (x * x + z * z),
        1.0 - 2.0 * (x * x + y * y),
    )
    matrix[0, 1], matrix[1, 0] = 2.0 * (x * y - z * w), 2.0 * (x * y + z * w)
    matrix[0, 2], matrix[2, 0] = 2.0 * (x * z + y * w), 2.0 * (x * z - y * w)
    matrix[1, 2], matrix[2, 1] = 2.0 * (y * z - x * w), 2.0 * (y * z + x * w)


def _of_matrix(matrix: np.ndarray, quaternion: np.ndarray) -> None:
    """Write a quaternion (4,) of any length with the rotation of a matrix (3, 3): from the largest
    of its numbers (Shepperd, 1978).
    """
    trace = matrix[0, 0] + matrix[1, 1] + matrix[2, 2]
    largest, i = trace, 3
    for k in range(3):
        if matrix[k, k] > largest:
            largest, i = matrix[k, k], k
    if i == 3:
        quaternion[0] = matrix[2, 1] - matrix[1, 2]
        quaternion[1] = matrix[0, 2] - matrix[2, 0]
        quaternion[2] = matrix[1, 0] - matrix[0, 1]
        quaternion[3] = 1.0 + trace
        return
    j, k = (i + 1) % 3, (i + 2) % 3
    quaternion[i] = 1.0 + 2.0 * matrix[i, i] - trace
    quaternion[j] = matrix[j, i] + matrix[i, j]
    quaternion[k] = matrix[k, i] + matrix[i, k]
    quaternion[3] = matrix[k, j] - matrix[j, k]
