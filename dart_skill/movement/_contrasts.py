"""Combinations of neighbouring samples that are zero on polynomials of degree 5, so that they
contain only noise.

These are divided differences of seven samples, scaled to unit norm: sample k of them has the
weight 1 / prod_j (t_k - t_j), j != k.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

NEIGHBOURS = 7


def contrasts(time: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Absolute values (d, n - 6) of the combinations of samples (n, d), n >= 7, at increasing
    stamps (n,).
    """
    windows = sliding_window_view(time, NEIGHBOURS)
    windows = windows / (windows[:, -1:] - windows[:, :1])
    apart = windows[:, :, None] - windows[:, None, :] + np.eye(NEIGHBOURS)
    weights = 1.0 / apart.prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    return np.abs(
        np.einsum("nk,ndk->dn", weights, sliding_window_view(samples, NEIGHBOURS, axis=0))
    )
