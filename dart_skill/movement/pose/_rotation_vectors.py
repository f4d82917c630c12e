"""Rotation vectors as coordinates of orientations about a base: q = exp(e) base, up to nearly a
full turn; and their derivatives, without checks.

A unit quaternion with its sign tells a turn by 200 degrees from one by 160 the other way. So a
path that turns through half a turn has no jump in e, if signs are continuous along it. With J of
`inverse_jacobians`, w = J(e) e' is the angular velocity in world axes.
"""

from __future__ import annotations

import numpy as np

from dart_skill.common import quaternions
from dart_skill.movement._orientation import make_continuous

LARGEST_TURN = np.radians(345.0)
"""Coordinates are singular at a full turn from the base; this is the farthest that is learned
[rad].
"""
SERIES = 0.1
"""Below this angle [rad] series are used."""
SMALL = 1e-4
"""Below this angle [rad] series take the place of quotients that tend to 0 / 0; their next term is
below rounding.
"""


def relative(rotations: np.ndarray, base: np.ndarray) -> np.ndarray:
    """q base* (..., 4)."""
    return quaternions.product(rotations, base * quaternions.CONJUGATE)


def long_vectors(rotations: np.ndarray) -> np.ndarray:
    """Rotation vectors (..., 3) of quaternions (..., 4) with signs, up to a full turn long: 2
    atan2(|v|, w) v / |v|.
    """
    length = np.linalg.norm(rotations[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(length, rotations[..., 3:])
    return (
        np.where(length > 1e-12, angle / np.where(length > 1e-12, length, 1.0), 2.0)
        * rotations[..., :3]
    )


def path_about(rotations: np.ndarray, base: np.ndarray, last: bool) -> np.ndarray:
    """Coordinates e (n, 3) of a path (n, 4) without jumps; at its last sample, or its first one,
    at most half a turn.

    Raises
    ------
    ValueError
        If the path comes near a full turn from the base.
    """
    rows = relative(rotations, base)[:: -1 if last else 1]
    rows = make_continuous(rows * (1.0 if rows[0, 3] >= 0 else -1.0))[:: -1 if last else 1]
    vectors = long_vectors(rows)
    angles = np.linalg.norm(vectors, axis=1)
    if angles.max() > LARGEST_TURN:
        row = int(angles.argmax())
        raise ValueError(
            f"sample {row} is turned by {np.degrees(angles[row]):.0f} degrees against the goal or"
            " baseline; a primitive learns less than a full turn: cut the movement into two, or"
            " learn it as a PoseDSGMR"
        )
    return vectors


def nearest(rotation: np.ndarray, base: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Coordinates e (3,) of an orientation (4,): of the two turns that lead there the one that is
    nearer to `near` (3,).
    """
    one = relative(rotation, base)
    ways = long_vectors(np.array([one, -one]))
    return ways[np.linalg.norm(ways - near, axis=1).argmin()]


def turning(
    vectors: np.ndarray, first: np.ndarray, second: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Quaternion exp(e) (..., 4), angular velocity and acceleration (..., 3) of e with its
    derivatives e' and e'' (..., 3).

    w = e' + a e x e' + b e x (e x e'),  a = (1 - cos t) / t^2,  b = (t - sin t) / t^3,  t = |e|,
    and its derivative.
    """
    a, b, a_slope, b_slope = _coefficients(np.linalg.norm(vectors, axis=-1, keepdims=True))
    along = (vectors * first).sum(-1, keepdims=True)
    once = cross(vectors, first)
    twice = cross(vectors, once)
    rate = first + a * once + b * twice
    pull = cross(vectors, second)
    change = second + a * pull + b * cross(vectors, pull)
    change = change + along * (a_slope * once + b_slope * twice) + b * cross(first, once)
    return quaternions.from_vectors(vectors), rate, change


def _coefficients(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """a and b of `turning`, and their derivatives by the angle, divided by the angle."""
    small, square = angle < SERIES, angle * angle
    t = np.where(small, 1.0, angle)
    sin, cos = np.sin(t), np.cos(t)
    a = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    b = np.where(
        small,
        1.0 / 6.0 - square / 120.0 + square**2 / 5040.0 - square**3 / 362880.0,
        (t - sin) / t**3,
    )
    a_slope = np.where(
        small,
        -1.0 / 12.0 + square / 180.0 - square**2 / 6720.0,
        (t * sin - 2.0 * (1.0 - cos)) / t**4,
    )
    b_slope = np.where(
        small,
        -1.0 / 60.0 + square / 1260.0 - square**2 / 60480.0,
        (3.0 * sin - 2.0 * t - t * cos) / t**5,
    )
    return a, b, a_slope, b_slope


def slope_of(vectors: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """e' (3,) that belongs to an angular velocity (3,) at e (3,)."""
    return inverse_jacobians(vectors) @ rate


# --- derivatives ---


def cross(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Cross products (..., 3); leading shapes are broadcast. np.cross would take several times
    longer for a single one.
    """
    x, y, z = left[..., 0], left[..., 1], left[..., 2]
    u, v, w = right[..., 0], right[..., 1], right[..., 2]
    first = y * w - z * v
    product = np.empty((*first.shape, 3))
    product[..., 0], product[..., 1], product[..., 2] = first, z * u - x * w, x * v - y * u
    return product


def skew(vectors: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) of the cross product with vectors (..., 3) from the left."""
    made = np.zeros((*vectors.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        made[..., i, j], made[..., j, i] = -vectors[..., k], vectors[..., k]
    return made


def inverse_jacobians(vectors: np.ndarray) -> np.ndarray:
    """J^-1 (..., 3, 3): a rotation vector v becomes v + J^-1(v) d when a small turn d [rad, world
    axes] is put before it.

    J^-1 = 1 - [v] / 2 + c [v]^2 with c = (1 - (a/2) cot(a/2)) / a^2, a = |v| (Chirikjian,
    "Stochastic Models, Information Theory, and Lie Groups", volume 2, 2012). It is singular at a
    full turn.
    """
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    safe = np.where(angle < SMALL, 1.0, angle)
    c = np.where(
        angle < SMALL,
        1.0 / 12.0 + angle**2 / 720.0,
        (1.0 - 0.5 * safe / np.tan(0.5 * safe)) / safe**2,
    )
    cross_matrix = skew(vectors)
    return np.eye(3) - 0.5 * cross_matrix + c * (cross_matrix @ cross_matrix)


def bend(vectors: np.ndarray, covectors: np.ndarray) -> np.ndarray:
    """Symmetric matrices (..., 3, 3): the second derivative of l . v by a small turn before
    rotation vectors v (..., 3).

    covectors l (..., 3). It is that of l' J^-1(v), with dv = J^-1 d.
    """
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    small = angle < 0.05
    half = 0.5 * np.where(small, 1.0, angle)
    c = np.where(
        small, 1.0 / 12.0 + angle**2 / 720.0, (1.0 - half / np.tan(half)) / (4.0 * half**2)
    )
    # The derivative of c by the angle, divided by the angle.
    slope = np.where(
        small,
        1.0 / 360.0 + angle**2 / 7560.0,
        (0.5 * half / np.sin(half) ** 2 - 0.5 / np.tan(half)) / (8.0 * half**3)
        - c / (2.0 * half**2),
    )
    v, moves = vectors[..., None, :], np.swapaxes(inverse_jacobians(vectors), -1, -2)
    first = covectors[..., None, :]
    # Rows of l' dJ^-1 for the moves of v, one for each axis of the turn: l' [a] = -a x l, and [a]
    # [b] likewise.
    along = cross(v, cross(v, first)) * (moves @ vectors[..., None]) * slope
    rows = (
        0.5 * cross(moves, first)
        + along
        + c * (cross(v, cross(moves, first)) + cross(moves, cross(v, first)))
    )
    return 0.5 * (rows + np.swapaxes(rows, -1, -2))
