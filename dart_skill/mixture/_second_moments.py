"""The small matrices of an iteration of EM: components from sums over the samples, and the
coefficients of their log densities.

Both are about products of two entries of (1, z), with a sample z (d,). Of a symmetric matrix (1 +
d, 1 + d) of them only the upper triangle is stored, by rows: q = (1 + d) (2 + d) / 2 numbers. This
module is compiled (docs/development.md): _second_moments.pxd beside it has the types.
"""

import math

import numpy as np

from dart_skill.common.small_matrices import invert_into
from dart_skill.mixture._gaussian import LOG_2PI


def write_components(
    sums: np.ndarray,
    means: np.ndarray,
    affine: np.ndarray,
    log_volumes: np.ndarray,
    precisions: np.ndarray,
) -> bool:
    """Write the components whose counts have these sums, as of `Components`; False if a covariance
    is not positive definite.

    The means of the products are [[1, mean'], [mean, S + mean mean']]. The covariance is S = L L'.

    Parameters
    ----------
    sums
        (P, K, q), of count times products of (1, z); the first of each is the sum of counts, and
        is above zero.
    means
        (P, K, d), are written, as all that follow.
    affine
        (P, K, d, 1 + d), [-L^-1 mean, L^-1].
    log_volumes
        (P, K), log of sqrt(det(2 pi S)).
    precisions
        (P, K), traces of the inverse covariances.
    """
    d = means.shape[2]
    lower = np.empty((d, d))
    for p in range(means.shape[0]):
        for k in range(means.shape[1]):
            if not _factor_moments(sums[p, k], means[p, k], lower):
                return False
            log_volumes[p, k] = 0.5 * d * LOG_2PI + _log_diagonal(lower)
            precisions[p, k] = _write_affine(means[p, k], lower, affine[p, k])
    return True


def _factor_moments(sums: np.ndarray, mean: np.ndarray, lower: np.ndarray) -> bool:
    """Write the mean (d,), and the Cholesky factor of the covariance to the lower triangle (d, d);
    False if there is none.
    """
    d, mass, place = mean.shape[0], sums[0], mean.shape[0] + 1
    for i in range(d):
        mean[i] = sums[1 + i] / mass
    for j in range(d):
        for i in range(j, d):
            rest = sums[place] / mass - mean[i] * mean[j]
            place += 1
            for m in range(j):
                rest -= lower[i, m] * lower[j, m]
            if i > j:
                lower[i, j] = rest / lower[j, j]
            elif rest > 0.0:
                lower[j, j] = math.sqrt(rest)
            else:
                return False
    return True


def _log_diagonal(lower: np.ndarray) -> float:
    """Sum of the logs of the diagonal of a matrix (d, d)."""
    total = 0.0
    for i in range(lower.shape[0]):
        total += math.log(lower[i, i])
    return total


def _write_affine(mean: np.ndarray, lower: np.ndarray, affine: np.ndarray) -> float:
    """Write [-L^-1 mean, L^-1] (d, 1 + d) of a lower triangle L (d, d), and return the sum of the
    squares of L^-1.
    """
    d, squares = mean.shape[0], 0.0
    invert_into(lower, affine[:, 1:])
    for i in range(d):
        total = 0.0
        for j in range(i + 1):
            entry = affine[i, 1 + j]
            total += entry * mean[j]
            squares += entry * entry
        affine[i, 0] = -total
    return squares


def write_coefficients(
    affine: np.ndarray,
    log_volumes: np.ndarray,
    log_volumes_of_blocks: np.ndarray,
    least_peaks: np.ndarray,
    highest: np.ndarray,
    columns: np.ndarray,
    coefficients: np.ndarray,
) -> None:
    """Add the coefficients of the products of (1, z) in the log densities: those of log peak - |A
    (1, z)|^2 / 2.

    Parameters
    ----------
    affine, log_volumes
        A (P, K, d, 1 + d) and (P, K), as `write_components` writes them.
    log_volumes_of_blocks, least_peaks
        (P,), as of `WhiteBlocks`.
    highest
        (K,), to which the peaks of all blocks are added, or their least ones.
    columns
        (P, q), of each product in the coefficients; blocks may have some in common.
    coefficients
        (K, n) or more rows, to which these are added. Squares count half, mixed products twice
        half.
    """
    d = affine.shape[2]
    for k in range(affine.shape[1]):
        for p in range(affine.shape[0]):
            place = 0
            log_peak = -log_volumes_of_blocks[p] - log_volumes[p, k]
            highest[k] += max(log_peak, least_peaks[p])
            for i in range(1 + d):
                for j in range(i, 1 + d):
                    total = 0.0
                    # L^-1 is a lower triangle, whose column j begins in row j - 1 of A.
                    for m in range(max(j - 1, 0), d):
                        total += affine[p, k, m, i] * affine[p, k, m, j]
                    if i == j:
                        total *= 0.5
                    coefficients[k, columns[p, place]] -= total
                    place += 1
            coefficients[k, columns[p, 0]] += log_peak
