"""The manifold R^n x S3 of n numbers and a unit quaternion: exponential map, logarithm, parallel
transport and mean.

A point is a row of n numbers (time, further inputs, position) and a quaternion x, y, z, w. q and
-q are the same orientation: every function here gives the same result for both, and a quaternion
that it returns has the sign that suits its neighbour. A tangent vector is a row of n numbers and a
rotation vector [rad] in the axes of the world: it leads from q to exp(v) q along the shortest way.
So lengths are angles of rotation, which is twice the arc on S3.

M. Zeestraten, I. Havoutis, J. Silverio, S. Calinon and D. Caldwell, "An approach for imitation
learning on Riemannian manifolds", IEEE RA-L 2 (2017); S. Calinon, "Gaussians on Riemannian
manifolds", IEEE RAM 27 (2020). Their tangent vectors have the four coordinates of R^4 and half the
length.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common import quaternions
from dart_skill.common.checks import as_finite, as_weights

LENGTH_TOLERANCE = 1e-3
"""A quaternion may be so far from length 1: then it is rounded, and is normalised."""
SETTLED = 1e-14
"""A mean has settled when its step is shorter than this [rad]."""
MAX_STEPS = 100
"""Largest number of steps to a mean."""
LEAST_GAP = 1e-9
"""The two largest eigenvalues of the scatter of quaternions (sum 1) differ at least by this, or no
mean is unique.
"""


# --- for users ---


def exponential(base: ArrayLike, tangent: ArrayLike) -> np.ndarray:
    """Points (..., n + 4) where tangent vectors (..., n + 3) lead from base points (..., n + 4).

    Parameters
    ----------
    base
        Points, whose last four columns are unit quaternions; leading shapes are broadcast.
    tangent
        Vectors, whose last three columns are rotation vectors [rad] of any length, in world axes.

    Raises
    ------
    ValueError
        For what is not finite, has another shape, or for a quaternion whose length is not 1.
    """
    base = as_points(base, "base")
    return exp_at(base, _as_tangent(tangent, base.shape[-1] - 1))


def logarithm(base: ArrayLike, points: ArrayLike) -> np.ndarray:
    """Tangent vectors (..., n + 3) that lead from base points (..., n + 4) to points (..., n + 4)
    by the shorter turn.

    The rotation vector is at most half a turn long. At exactly half a turn both ways are equally
    short. Then the largest component of the axis is positive. Errors as in `exponential`.
    """
    base = as_points(base, "base")
    return log_at(base, as_points(points, "points", base.shape[-1]))


def parallel_transport(start: ArrayLike, end: ArrayLike, tangent: ArrayLike) -> np.ndarray:
    """Tangent vectors (..., n + 3) at `start` (..., n + 4), carried along the shortest way to
    `end` (..., n + 4).

    In world axes that turns the rotation vector by half the way. Errors as in `exponential`.
    """
    start = as_points(start, "start")
    way = log_at(start, as_points(end, "end", start.shape[-1]))
    tangent = _as_tangent(tangent, way.shape[-1])
    turned = quaternions.rotate(quaternions.from_vectors(0.5 * way[..., -3:]), tangent[..., -3:])
    return np.concatenate(
        [np.broadcast_to(tangent[..., :-3], (*turned.shape[:-1], way.shape[-1] - 3)), turned],
        axis=-1,
    )


def mean_point(points: ArrayLike, weights: ArrayLike | None = None) -> np.ndarray:
    """Intrinsic mean (n + 4,) of points (m, n + 4) with weights (m,), equal by default.

    It is where the tangent vectors to all points sum to zero. The search begins at the eigenvector
    of the scatter of the quaternions (Markley et al., "Averaging quaternions", J. Guidance 30,
    2007), which no sign changes.

    Raises
    ------
    ValueError
        If the orientations are spread so evenly that there is no unique mean, such as two that
        differ by half a turn.
    """
    points = as_points(points, "points", ndim=2)
    shares = as_weights(weights, len(points))[:, None]
    shares = shares / shares.sum()
    values = np.linalg.eigvalsh(_scatter(points[:, -4:], shares)[0])
    if values[-1] - values[-2] < LEAST_GAP:
        raise ValueError(
            f"the {len(points)} orientations are spread so evenly that no mean is unique; give"
            " other points or weights"
        )
    return means_of(points, shares)[0]


def angles_between(points: ArrayLike, others: ArrayLike) -> np.ndarray:
    """Angles (...) [rad], at most pi, between the orientations of points (..., n + 4) and others
    (..., n + 4).
    """
    points = as_points(points, "points")
    return np.linalg.norm(
        log_at(points, as_points(others, "others", points.shape[-1]))[..., -3:], axis=-1
    )


# --- checks ---


def as_points(
    value: ArrayLike, name: str, width: int | None = None, ndim: int | None = None
) -> np.ndarray:
    """Points (..., n + 4), finite and not empty, with their quaternions normalised.

    Raises
    ------
    ValueError
        Names what is wrong.
    """
    points = as_finite(value, name, ndim)
    if (
        points.ndim == 0
        or points.shape[-1] < 4
        or points.size == 0
        or points.shape[-1] != (width or points.shape[-1])
    ):
        columns = f"{width} columns" if width else "at least four columns"
        raise ValueError(
            f"{name} must have {columns}, the last four a quaternion x, y, z, w, got shape"
            f" {points.shape}"
        )
    lengths = np.linalg.norm(points[..., -4:], axis=-1)
    wrong = np.abs(lengths - 1.0) > LENGTH_TOLERANCE
    if wrong.any():
        place = tuple(int(i) for i in np.argwhere(wrong)[0])
        where = f" at index {place}" if place else ""
        raise ValueError(
            f"{name}: the quaternion{where} has length {lengths[place]:.4g}; need length 1, order"
            " x, y, z, w"
        )
    points[..., -4:] /= lengths[..., None]
    return points


def _as_tangent(value: ArrayLike, width: int) -> np.ndarray:
    tangent = as_finite(value, "tangent")
    if tangent.ndim == 0 or tangent.shape[-1] != width:
        raise ValueError(
            f"tangent must have {width} columns, one less than the points, got shape"
            f" {tangent.shape}"
        )
    return tangent


# --- without checks, for whole arrays ---


def exp_at(base: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """`exponential` without checks."""
    turned = quaternions.product(quaternions.from_vectors(tangent[..., -3:]), base[..., -4:])
    return np.concatenate(
        [
            np.broadcast_to(
                base[..., :-4] + tangent[..., :-3], (*turned.shape[:-1], base.shape[-1] - 4)
            ),
            turned,
        ],
        axis=-1,
    )


def log_at(base: np.ndarray, points: np.ndarray) -> np.ndarray:
    """`logarithm` without checks."""
    way = quaternions.to_vectors(
        quaternions.product(points[..., -4:], base[..., -4:] * quaternions.CONJUGATE)
    )
    return np.concatenate([points[..., :-4] - base[..., :-4], way], axis=-1)


def transport_matrices(way: np.ndarray) -> np.ndarray:
    """Parallel transport (..., 3, 3) of rotation vectors along a way (..., n + 3): half its turn."""
    return quaternions.matrices(quaternions.from_vectors(0.5 * way[..., -3:]))


def turn_covariances(covariances: np.ndarray, rotations: np.ndarray, first: int) -> np.ndarray:
    """Covariances (..., d, d) whose groups of three columns from `first` on are turned by
    rotations (..., 3, 3).
    """
    whole = np.array(
        np.broadcast_to(
            np.eye(covariances.shape[-1]), (*rotations.shape[:-2], *covariances.shape[-2:])
        )
    )
    for start in range(first, covariances.shape[-1], 3):
        whole[..., start : start + 3, start : start + 3] = rotations
    return whole @ covariances @ np.swapaxes(whole, -1, -2)


def _scatter(rotations: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Scatter matrices (K, 4, 4) of quaternions (m, 4) with shares (m, K)."""
    outer = (rotations[:, :, None] * rotations[:, None, :]).reshape(-1, 16)
    return (shares.T @ outer).reshape(-1, 4, 4)


def means_of(points: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Intrinsic means (K, n + 4) of points (m, n + 4) with shares (m, K) that sum to one over m."""
    start = np.linalg.eigh(_scatter(points[:, -4:], shares))[1][..., -1]
    return settle(np.concatenate([shares.T @ points[:, :-4], start], axis=-1), points, shares.T)


def settle(start: np.ndarray, points: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Intrinsic means (..., n + 4) of points (..., m, n + 4) with shares (..., m), from a start:
    Gauss-Newton.
    """
    mean, step = start, np.inf
    for _ in range(MAX_STEPS):
        move = (shares[..., None, :] @ log_at(mean[..., None, :], points))[..., 0, :]
        mean, last, step = exp_at(mean, move), step, float(np.abs(move[..., -3:]).max(initial=0.0))
        # Rounding may keep the step just above the limit.
        if step < SETTLED or (step < 1e3 * SETTLED and step >= last):
            break
    mean[..., -4:] /= np.linalg.norm(mean[..., -4:], axis=-1, keepdims=True)
    return mean
