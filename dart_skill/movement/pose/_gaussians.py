"""Gaussians on the manifold: a mean (n + 4,) and a covariance (n + 3, n + 3) in the tangent space
there (Zeestraten 2017; Calinon 2020).

log N(x) = log N(v; 0, S) with v = log_mean(x). The factor of the volume of S3 is left out, as
there; it is one to second order in the spread.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import (
    LARGEST_LEARNABLE,
    as_covariances,
    as_dims,
    as_finite,
    as_samples,
    require_near,
)
from dart_skill.mixture import checked_priors, cholesky, normalise_log, symmetric
from dart_skill.movement.pose._manifold import (
    as_points,
    exp_at,
    log_at,
    settle,
    transport_matrices,
    turn_covariances,
)
from dart_skill.movement.pose._rotation_vectors import bend, inverse_jacobians

LOG_2PI = float(np.log(2.0 * np.pi))
"""Logarithm of 2 pi."""
MAX_STEPS = 100
"""Most steps of the search for the mode of a product; two to five are usual."""
ROUNDING = 1e-11
"""Rounding error of the cost, a sum of squares, relative to itself."""
LEAST_CURVATURE = 0.1
"""Least curvature of the cost in any direction, relative to that of the linear equations; its
inverse limits a step.
"""
LEAST_SHARE = 1e-10
"""A search whose steps must be shortened further than this has ended."""
SETTLED = 1e-12
"""The mode is found when the step is shorter than this [rad]."""


def log_normals(tangents: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """log N(v; 0, S_k), (..., n), of tangent vectors (..., n, d) with covariances (..., d, d)."""
    factors = cholesky(covariances, "covariance of component")
    log_volumes = (
        np.log(np.diagonal(factors, axis1=-2, axis2=-1)).sum(-1)
        + 0.5 * tangents.shape[-1] * LOG_2PI
    )
    white = tangents @ np.swapaxes(np.linalg.inv(factors), -1, -2)
    return -0.5 * np.einsum("...i,...i->...", white, white) - log_volumes[..., None]


# --- product ---


def product_at(
    means: np.ndarray, covariances: np.ndarray, seen: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mode (..., n + 4) and covariance (..., d, d) of the product of P Gaussians.

    The mode minimises the sum of r' S^-1 r with r = log_mean(x), by Newton's method (Zeestraten
    2017 iterates with parallel transport in the place of the derivative of the logarithm; for near
    factors that is the same). The search begins at each factor's mean, and the best end counts:
    two factors that differ by nearly half a turn have two minima.

    Parameters
    ----------
    means : (..., P, n + 4)
    covariances : (..., P, d, d)
    seen : (..., P)
        Which factors are there.
    """
    whiteners = seen[..., None, None] * np.linalg.inv(
        cholesky(covariances, "covariance of factor")
    )
    points = np.moveaxis(means, -2, 0)
    cost = _cost(points, means, whiteners)
    share = np.ones_like(cost)
    for _ in range(MAX_STEPS):
        step = _newton(points, means, whiteners)[0]
        moved = exp_at(points, share[..., None] * step)
        moved_cost = _cost(moved, means, whiteners)
        # Near the mode a step changes the cost by less than its rounding.
        better = moved_cost <= cost * (1.0 + ROUNDING)
        points, cost = (
            np.where(better[..., None], moved, points),
            np.where(better, moved_cost, cost),
        )
        share = np.where(better, np.minimum(2.0 * share, 1.0), 0.5 * share)
        # A search may end at half a turn from a factor, where the cost jumps; there its share of
        # the step shrinks.
        if ((np.abs(step[..., -3:]).max(-1) < SETTLED) | (share < LEAST_SHARE)).all():
            break
    best = np.take_along_axis(points, cost.argmin(0)[None, ..., None], axis=0)
    step, covariance = _newton(best, means, whiteners)
    return exp_at(best, step)[0], covariance[0]


def _cost(points: np.ndarray, means: np.ndarray, whiteners: np.ndarray) -> np.ndarray:
    """Sum of r' S^-1 r (S, ...) at points (S, ..., n + 4)."""
    return np.square(whiteners @ log_at(means, points[..., None, :])[..., None]).sum((-3, -2, -1))


def _newton(
    points: np.ndarray, means: np.ndarray, whiteners: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Newton step (S, ..., d) from points (S, ..., n + 4), and covariance (S, ..., d, d): that of
    the linear equations alone.

    The linear equations r + J d = 0, whitened, are solved by QR, R d = c. In the coordinates R d
    the Hessian is the identity and a term for the curvature. Where it is not positive definite,
    its eigenvalues are made so.
    """
    residuals = log_at(means, points[..., None, :])
    white = whiteners @ residuals[..., None]
    jacobians = np.array(
        np.broadcast_to(np.eye(residuals.shape[-1]), (*residuals.shape, residuals.shape[-1]))
    )
    jacobians[..., -3:, -3:] = inverse_jacobians(residuals[..., -3:])
    rows = np.concatenate([whiteners @ jacobians, -white], axis=-1)
    triangle = np.asarray(
        np.linalg.qr(rows.reshape(*rows.shape[:-3], -1, rows.shape[-1]), mode="r")
    )
    size = residuals.shape[-1]
    root = np.linalg.inv(triangle[..., :size, :size])
    pull = (np.swapaxes(whiteners, -1, -2) @ white)[..., -3:, 0]
    curvature = bend(residuals[..., -3:], pull).sum(-3)
    inner = root[..., -3:, :]
    values, vectors = np.linalg.eigh(np.eye(size) + np.swapaxes(inner, -1, -2) @ curvature @ inner)
    scaled = (
        np.swapaxes(vectors, -1, -2)
        @ triangle[..., :size, size:]
        / np.maximum(np.abs(values), LEAST_CURVATURE)[..., None]
    )
    return (root @ (vectors @ scaled))[..., 0], symmetric(root @ np.swapaxes(root, -1, -2))


# --- regression ---


def regress_at(
    priors: np.ndarray,
    means: np.ndarray,
    covariances: np.ndarray,
    inputs: np.ndarray,
    into: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (n, o + 4) and covariance (n, o + 3, o + 3) of the columns that are not `into`, given
    those: inputs (n, i).

    Each component is conditioned in the tangent space of its own mean and is carried to where it
    is then expected; the result is the mean on the manifold, found by iteration, and the
    covariance in its tangent space (Calinon 2020 conditions in the tangent space of the result.
    For one component both are the same. Here a component may turn farther than half a turn).

    Parameters
    ----------
    priors : (K,)
    means : (m, K, w)
    covariances : (m, K, d, d)
        Where m is n or 1; `into` are columns of numbers.
    """
    out, columns = _others(into, means.shape[-1]), _others(into, covariances.shape[-1])
    deviations = inputs[:, None] - means[..., into]
    input_covariances = covariances[..., into[:, None], into]
    with np.errstate(over="ignore", invalid="ignore"):
        densities = log_normals(deviations[..., None, :], input_covariances)[..., 0]
        shares, log_density = normalise_log(densities + np.log(priors))
    require_near(log_density, inputs, "inputs")
    slopes = np.linalg.solve(input_covariances, covariances[..., into[:, None], columns])
    within = (
        covariances[..., columns[:, None], columns]
        - covariances[..., columns[:, None], into] @ slopes
    )
    ways = (deviations[..., None, :] @ slopes)[..., 0, :]
    ends = exp_at(means[..., out], ways)
    return moments_at(ends, _turned_half(within, ways), shares)


def moments_at(
    points: np.ndarray, covariances: np.ndarray, shares: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (n, w) and covariance (n, d, d) of mixtures: points (n, K, w), covariances (n, K, d,
    d), shares (n, K).
    """
    scatter = np.einsum("nk,nki,nkj->nij", shares, points[..., -4:], points[..., -4:])
    start = np.concatenate(
        [np.einsum("nk,nki->ni", shares, points[..., :-4]), np.linalg.eigh(scatter)[1][..., -1]],
        axis=-1,
    )
    mean = settle(start, points, shares)
    ways = log_at(points, mean[:, None])
    # The tangent vectors at the mean are the ways back: in world axes the way is the same at both
    # ends.
    spread = ways * np.sqrt(shares)[..., None]
    inside = np.einsum("nk,nkij->nij", shares, _turned_half(covariances, ways))
    return mean, symmetric(inside + np.swapaxes(spread, 1, 2) @ spread)


def _turned_half(covariances: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Covariances (..., d, d) after parallel transport along ways (..., d)."""
    return turn_covariances(covariances, transport_matrices(ways), ways.shape[-1] - 3)


def _others(into: np.ndarray, size: int) -> np.ndarray:
    return np.setdiff1d(np.arange(size), into)


# --- for users ---


def product_of_poses(means: ArrayLike, covariances: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Product of P Gaussians on R^n x S3: its mode (n + 4,) and its covariance (n + 3, n + 3) in
    the tangent space there.

    The mode is where the product of the densities is largest; the covariance is that of its
    quadratic approximation. With little spread and near means both are those of (3.8).

    Parameters
    ----------
    means
        (P, n + 4), the last four columns unit quaternions.
    covariances
        (P, n + 3, n + 3), positive definite, each in the tangent space at its own mean, in world
        axes.

    Raises
    ------
    ValueError
        For what is not finite, of another shape, not positive definite, or for a quaternion whose
        length is not 1.
    """
    means = as_points(means, "means", ndim=2)
    size = means.shape[1] - 1
    spreads = as_covariances(covariances, "covariances", (len(means), size, size))
    return product_at(means, spreads, np.ones(len(means), dtype=bool))


@dataclass(frozen=True, eq=False)
class PoseMixture:
    """Mixture of K Gaussians over rows of q numbers, a position [m] and a unit quaternion x, y, z,
    w.

    Parameters
    ----------
    priors_ : (K,)
        Positive, with sum one.
    means_ : (K, q + 7)
    covariances_ : (K, q + 6, q + 6)
        Positive definite, in the tangent space at the mean: numbers, position [m], rotation vector
        [rad] in world axes.

    Raises
    ------
    ValueError
        For other shapes or values.
    """

    priors_: np.ndarray
    means_: np.ndarray
    covariances_: np.ndarray

    def __post_init__(self) -> None:
        priors, means = checked_priors(self.priors_), as_rows(self.means_, "means")
        if len(means) != len(priors):
            raise ValueError(f"one mean per prior is needed, got {len(means)} for {len(priors)}")
        size = means.shape[1] - 1
        covariances = as_covariances(self.covariances_, "covariances", (len(means), size, size))
        cholesky(covariances, "covariance of component")
        for name, value in zip(
            ("priors_", "means_", "covariances_"), (priors, means, covariances), strict=True
        ):
            object.__setattr__(self, name, value)

    def regress(
        self, inputs: ArrayLike, input_dims: ArrayLike | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean (n, o + 4) and covariance (n, o + 3, o + 3) of all other columns, given inputs (n,
        i): regression on the manifold.

        The mean is a row of the columns that are left, in order, and a unit quaternion. The
        covariance is in the tangent space there: within the components, and between them.

        Parameters
        ----------
        inputs
            (n, i), or (n,) for one input column.
        input_dims
            i columns of numbers or position, no quaternion; default: the q numbers, so that poses
            (n, 7) are returned.

        Raises
        ------
        ValueError
            For columns that there are not, or inputs that are not finite or so far away that their
            density overflows.
        """
        return regress_rows(
            self.priors_, self.means_[None], self.covariances_[None], inputs, input_dims
        )


def regress_rows(
    priors: np.ndarray,
    means: np.ndarray,
    covariances: np.ndarray,
    inputs: ArrayLike,
    input_dims: ArrayLike | Sequence[int] | None,
) -> tuple[np.ndarray, np.ndarray]:
    """`PoseMixture.regress` with checks, for one mixture or one for each query: means (m, K, w),
    covariances (m, K, d, d).
    """
    n_numbers = means.shape[-1] - 7
    if input_dims is None and n_numbers == 0:
        raise ValueError(
            "the mixture has no number such as time before the pose; give input_dims, columns of"
            " the position"
        )
    into = as_dims(
        np.arange(n_numbers) if input_dims is None else input_dims,
        means.shape[-1] - 4,
        "input_dims",
    )
    given = as_finite(inputs, "inputs")
    rows = as_samples(
        given[:, None] if given.ndim == 1 and len(into) == 1 else given, "inputs", len(into)
    )
    return regress_at(priors, means, covariances, rows, into)


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
