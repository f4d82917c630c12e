"""The normal distribution and its algebra: thesis table 3.1 with (3.6) corrected (A1 S1 A1' + A2
S2 A2').

The functions work on stacks of Gaussians: means (..., d) with covariances (..., d, d). The class
`Gaussian` is a single one. A covariance may be singular as long as nothing has to be inverted; for
example, a linear map with more rows than columns makes it singular.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import (
    as_count,
    as_covariances,
    as_dims,
    as_finite,
    as_samples,
    as_vector,
    require_near,
)

LOG_2PI = float(np.log(2.0 * np.pi))
"""Logarithm of 2 pi."""


def cholesky(covariances: np.ndarray, what: str = "covariance") -> np.ndarray:
    """Lower factors (..., d, d) of positive definite matrices.

    Parameters
    ----------
    covariances
        (..., d, d).
    what
        They are called in the message.

    Raises
    ------
    ValueError
        Names the first that is not.
    """
    try:
        return np.linalg.cholesky(covariances)
    except np.linalg.LinAlgError:
        raise ValueError(_describe_singular(covariances, what)) from None


def _describe_singular(covariances: np.ndarray, what: str) -> str:
    stack = covariances.reshape(-1, *covariances.shape[-2:])
    spread = np.sqrt(np.maximum(np.diagonal(stack, axis1=1, axis2=2), np.finfo(float).tiny))
    smallest = np.linalg.eigvalsh(stack / (spread[:, :, None] * spread[:, None, :]))[:, 0]
    worst = int(smallest.argmin())
    where = f" {worst}" if len(stack) > 1 else ""
    return (
        f"{what}{where} is not positive definite (smallest eigenvalue of its correlation matrix "
        f"{smallest[worst]:.3g}); add variance along the flat direction"
    )


def square_root(covariances: np.ndarray) -> np.ndarray:
    """Square roots R (..., d, d), R R' = S, of positive semi-definite matrices S: the Cholesky
    factor where it exists.
    """
    try:
        return np.linalg.cholesky(covariances)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(covariances)
        return vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]


def split_dims(dims: ArrayLike, n_dims: int) -> tuple[np.ndarray, np.ndarray]:
    """The given dimensions, and the other ones in ascending order.

    Raises
    ------
    ValueError
        If there are no other ones.
    """
    dims = as_dims(dims, n_dims, "dims")
    rest = np.setdiff1d(np.arange(n_dims), dims)
    if rest.size == 0:
        raise ValueError(f"dims {dims.tolist()} are all dimensions; conditioning leaves nothing")
    return dims, rest


def log_normal(deviations: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """log N(deviation; 0, S), (..., n), for deviations (..., n, d) and covariances (..., d, d).

    It is nan or -inf where a square overflows.
    """
    factors = cholesky(covariances)
    whitener = np.linalg.inv(factors)
    log_volume = np.log(np.diagonal(factors, axis1=-2, axis2=-1)).sum(-1)
    constant = 0.5 * deviations.shape[-1] * LOG_2PI + log_volume
    with np.errstate(over="ignore", invalid="ignore"):
        white = deviations @ np.swapaxes(whitener, -1, -2)
        return -0.5 * np.einsum("...i,...i->...", white, white) - constant[..., None]


def symmetric(matrices: np.ndarray) -> np.ndarray:
    """Symmetric part of matrices (..., d, d): removes the asymmetry that rounding leaves."""
    return 0.5 * (matrices + matrices.swapaxes(-1, -2))


@lru_cache(maxsize=64)
def upper_triangle(n_dims: int) -> tuple[np.ndarray, np.ndarray]:
    """Two index arrays to store only the upper triangle of a symmetric matrix (d, d), q = d (d +
    1) / 2 entries.

    First (q,): indices of these entries, by rows, in the flattened matrix. Second (d, d): for each
    entry of the whole matrix, its index among the q.
    """
    rows, columns = np.triu_indices(n_dims)
    square = np.empty((n_dims, n_dims), dtype=int)
    square[rows, columns] = square[columns, rows] = np.arange(len(rows))
    upper = rows * n_dims + columns
    for shared in (upper, square):
        shared.flags.writeable = False
    return upper, square


def raise_to_floor(covariances: np.ndarray, floor: float) -> np.ndarray:
    """Covariances (..., d, d) whose eigenvalues are at least `floor`: smaller ones are raised to
    it.
    """
    try:
        np.linalg.cholesky(covariances - floor * np.eye(covariances.shape[-1]))
        return covariances
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(covariances)
        raised = (vectors * np.maximum(values, floor)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
        return symmetric(raised)


def product_of_two(
    mean1: np.ndarray, covariance1: np.ndarray, mean2: np.ndarray, covariance2: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(3.8) for stacks: mean, covariance and log constant N(mu1; mu2, S1 + S2).

    The gain S1 (S1 + S2)^-1 needs the inverse of the sum only. So one of the two covariances may
    be singular.
    """
    total = covariance1 + covariance2
    step = mean2 - mean1
    log_constant = log_normal(step[..., None, :], total)[..., 0]
    gain = np.swapaxes(np.linalg.solve(total, covariance1), -1, -2)
    rest = np.eye(mean1.shape[-1]) - gain
    mean = mean1 + (gain @ step[..., None])[..., 0]
    # Joseph form: a sum of two positive semi-definite terms. S1 - K S1 would lose digits.
    covariance = rest @ covariance1 @ np.swapaxes(rest, -1, -2) + gain @ covariance2 @ np.swapaxes(
        gain, -1, -2
    )
    return mean, symmetric(covariance), log_constant


def product_of_gaussians(
    means: np.ndarray, covariances: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(3.8) for P factors: the product over the first axis of means (P, ..., d) and covariances
    (P, ..., d, d).

    Returns mean (..., d), covariance (..., d, d) and log constant (...).
    """
    mean, covariance = means[0], covariances[0]
    log_constant = np.zeros(mean.shape[:-1])
    for other_mean, other_covariance in zip(means[1:], covariances[1:], strict=True):
        mean, covariance, log_factor = product_of_two(
            mean, covariance, other_mean, other_covariance
        )
        log_constant = log_constant + log_factor
    return mean, covariance, log_constant


@dataclass(frozen=True, eq=False)
class Gaussian:
    """The normal distribution N(mean, covariance), thesis table 3.1.

    Parameters
    ----------
    mean : (d,)
        d at least 1, finite.
    covariance : (d, d)
        Symmetric and positive semi-definite. It may be singular as long as nothing has to be
        inverted.
    """

    mean: np.ndarray
    covariance: np.ndarray

    def __post_init__(self) -> None:
        mean = as_vector(self.mean, "mean")
        if mean.size == 0:
            raise ValueError("mean is empty; a Gaussian has at least one dimension")
        covariance = as_covariances(self.covariance, "covariance", (mean.size, mean.size))
        _require_semidefinite(covariance)
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "covariance", covariance)

    @property
    def n_dims(self) -> int:
        return self.mean.size

    def linear_map(self, matrix: ArrayLike, offset: ArrayLike | None = None) -> Gaussian:
        """Distribution of A x + b for any A (e, d) and b (e,), zero by default.

        Parameters
        ----------
        matrix, offset
            A and b.
        """
        matrix = as_samples(matrix, "matrix", self.n_dims)
        offset = (
            np.zeros(len(matrix)) if offset is None else as_vector(offset, "offset", len(matrix))
        )
        return Gaussian(
            matrix @ self.mean + offset, symmetric(matrix @ self.covariance @ matrix.T)
        )

    def marginal(self, dims: ArrayLike) -> Gaussian:
        """Distribution of some dimensions, in the order in which they are named.

        Parameters
        ----------
        dims
            Their indices (k,), from 0.
        """
        dims = as_dims(dims, self.n_dims, "dims")
        return Gaussian(self.mean[dims], self.covariance[np.ix_(dims, dims)])

    def condition(self, dims: ArrayLike, values: ArrayLike) -> Gaussian:
        """(3.7): distribution of the other dimensions, in ascending order, given x[dims] = values."""
        dims, rest = split_dims(dims, self.n_dims)
        return self._condition(rest, dims, as_vector(np.atleast_1d(values), "values", len(dims)))

    def _condition(self, rest: np.ndarray, dims: np.ndarray, values: np.ndarray) -> Gaussian:
        factor = cholesky(
            self.covariance[np.ix_(dims, dims)], "covariance of the given dimensions"
        )
        half = np.linalg.solve(factor, self.covariance[np.ix_(dims, rest)])
        mean = self.mean[rest] + half.T @ np.linalg.solve(factor, values - self.mean[dims])
        return Gaussian(mean, symmetric(self.covariance[np.ix_(rest, rest)] - half.T @ half))

    def sample(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """(n, d) independent draws; a singular covariance is allowed."""
        noise = rng.standard_normal((as_count(n, "n", 0), self.n_dims))
        return self.mean + noise @ square_root(self.covariance).T

    def log_density(self, points: ArrayLike) -> np.ndarray:
        """log N(x; mean, covariance) of points (..., d): (...).

        Raises
        ------
        ValueError
            For points of another dimension.
        """
        points = as_finite(points, "points")
        if points.ndim == 0 or points.shape[-1] != self.n_dims:
            raise ValueError(f"points must have {self.n_dims} columns, got shape {points.shape}")
        flat = points.reshape(-1, self.n_dims) - self.mean
        log_density = log_normal(flat, self.covariance)
        require_near(log_density, points.reshape(-1, self.n_dims), "points")
        return log_density.reshape(points.shape[:-1])


def _require_semidefinite(covariance: np.ndarray) -> None:
    variances = np.diagonal(covariance)
    if variances.min() < 0:
        raise ValueError(
            f"covariance has variance {variances.min():.3g} in dimension {int(variances.argmin())}"
        )
    spread = np.sqrt(np.where(variances > 0, variances, 1.0))
    smallest = np.linalg.eigvalsh(covariance / np.outer(spread, spread))[0]
    if smallest < -1e-8:
        raise ValueError(
            "covariance is not positive semi-definite: its correlation matrix has eigenvalue"
            f" {smallest:.3g}"
        )


def linear_combination(
    gaussians: Sequence[Gaussian], matrices: Sequence[ArrayLike], offset: ArrayLike | None = None
) -> Gaussian:
    """(3.6): distribution of A1 x1 + A2 x2 + ... + c for independent x1, x2, ...

    Parameters
    ----------
    gaussians
        Of x1, x2, ...
    matrices
        A1, A2, ...
    offset
        c, default zero.

    Raises
    ------
    ValueError
        If these do not fit together.
    """
    if len(gaussians) == 0 or len(gaussians) != len(matrices):
        raise ValueError(
            f"one matrix per Gaussian is needed, got {len(matrices)} for {len(gaussians)}"
        )
    terms = [
        gaussian.linear_map(matrix) for gaussian, matrix in zip(gaussians, matrices, strict=True)
    ]
    if len({term.n_dims for term in terms}) > 1:
        raise ValueError(
            f"matrices must have equally many rows, got {[term.n_dims for term in terms]}"
        )
    offset = (
        np.zeros(terms[0].n_dims)
        if offset is None
        else as_vector(offset, "offset", terms[0].n_dims)
    )
    nothing = np.zeros(())
    return Gaussian(
        sum((term.mean for term in terms), nothing) + offset,
        sum((term.covariance for term in terms), nothing),
    )


def product(gaussians: Sequence[Gaussian]) -> tuple[Gaussian, float]:
    """(3.8): Gaussian N and log C with C N(x) = N1(x) N2(x) ... for every x.

    Covariances may be singular as long as each sum S1 + S2 on the way can be inverted.

    Raises
    ------
    ValueError
        For none, for different dimensions, or for factors so far apart that C overflows.
    """
    if len(gaussians) == 0:
        raise ValueError("gaussians is empty; a product needs at least one factor")
    if len({gaussian.n_dims for gaussian in gaussians}) > 1:
        raise ValueError(
            f"gaussians must agree in dimension, got {[gaussian.n_dims for gaussian in gaussians]}"
        )
    mean, covariance, log_constant = product_of_gaussians(
        np.stack([gaussian.mean for gaussian in gaussians]),
        np.stack([gaussian.covariance for gaussian in gaussians]),
    )
    if not np.isfinite(log_constant):
        raise ValueError("the factors of the product are so far apart that its constant overflows")
    return Gaussian(mean, covariance), float(log_constant)


def moments(
    shares: np.ndarray, means: np.ndarray, covariances: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (d,) and covariance (d, d) of a mixture with shares (K,) that sum to one."""
    mean = shares @ means
    spread = (means - mean) * np.sqrt(shares)[:, None]
    return mean, symmetric(np.tensordot(shares, covariances, axes=1) + spread.T @ spread)
