"""Combinations of neighbouring samples that are zero on polynomials of degree 5, so that they contain only noise.

These are divided differences of seven samples, scaled to unit norm: sample k of them has the weight 1 / prod_j (t_k - t_j), j != k. This
module is compiled (docs/development.md): _contrasts.pxd beside it has the types.
"""

import math

import numpy as np

NEIGHBOURS = 7


def contrasts(time: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Absolute values (d, n - 6) of the combinations of samples (n, d), n >= 7, at increasing stamps (n,)."""
    n, n_dims = time.shape[0] - NEIGHBOURS + 1, samples.shape[1]
    found, own = np.empty((n_dims, n)), np.empty(NEIGHBOURS)
    result, weight = found, own
    for i in range(n):
        _weigh(time, i, weight)
        for dim in range(n_dims):
            total = 0.0
            for k in range(NEIGHBOURS):
                total += weight[k] * samples[i + k, dim]
            result[dim, i] = abs(total)
    return found


def _weigh(time: np.ndarray, first: int, weight: np.ndarray) -> None:
    """Write the weights (7,) of the samples from `first` on."""
    unit, total = 1.0 / (time[first + NEIGHBOURS - 1] - time[first]), 0.0
    for k in range(NEIGHBOURS):
        product = 1.0
        for j in range(NEIGHBOURS):
            if j != k:
                product *= (time[first + k] - time[first + j]) * unit
        weight[k] = 1.0 / product
        total += weight[k] * weight[k]
    norm = math.sqrt(total)
    for k in range(NEIGHBOURS):
        weight[k] /= norm
