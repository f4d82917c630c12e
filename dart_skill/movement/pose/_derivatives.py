"""Derivatives of rotation vectors of any leading shape, without checks: what the manifold is
computed with beside `quaternions`.
"""

from __future__ import annotations

import numpy as np

SMALL = 1e-4
"""Below this angle [rad] series take the place of quotients that tend to 0 / 0; their next term is
below rounding.
"""


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
