"""Distance of paths along their best alignment: dynamic time warping (Sakoe and Chiba 1978)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_samples, floats


def warped_distance(first: ArrayLike, second: ArrayLike) -> tuple[float, int]:
    """Least sum of distances over monotone alignments of two paths, and how many pairs of samples
    that alignment has.

    D(i, j) = |a_i - b_j| + min(D(i-1, j), D(i, j-1), D(i-1, j-1)).

    * first: (n, d).
    * second: (m, d).
    """
    first = as_samples(first, "first")
    second = as_samples(second, "second", first.shape[1])
    totals, pairs = _aligned(np.linalg.norm(first[:, None] - second, axis=2)[None])
    return float(totals[0]), int(pairs[0])


def mean_warped_distances(paths: Sequence[np.ndarray]) -> np.ndarray:
    """Mean distance of any two of N paths along their best alignment (N, N). paths: (n, d) each,
    of the same length.
    """
    stacked = floats(paths)
    rows, columns = np.triu_indices(len(stacked), 1)
    totals, pairs = _aligned(
        np.linalg.norm(stacked[rows, :, None] - stacked[columns, None], axis=3)
    )
    distances = np.zeros((len(stacked), len(stacked)))
    distances[rows, columns] = distances[columns, rows] = totals / pairs
    return distances


def _aligned(distances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """D(n, m), and the number of pairs, of the best alignment (N,) for N matrices of distances (N,
    n, m); one antidiagonal at a time.
    """
    count, n, m = distances.shape
    total = np.full((count, n + 1, m + 1), np.inf)
    total[:, 0, 0] = 0.0
    pairs = np.zeros((count, n + 1, m + 1), dtype=int)
    for diagonal in range(2, n + m + 1):
        i = np.arange(max(1, diagonal - m), min(n, diagonal - 1) + 1)
        j = diagonal - i
        before = np.stack([total[:, i - 1, j - 1], total[:, i - 1, j], total[:, i, j - 1]])
        steps = np.stack([pairs[:, i - 1, j - 1], pairs[:, i - 1, j], pairs[:, i, j - 1]])
        best = np.argmin(before, axis=0)[None]
        total[:, i, j] = distances[:, i - 1, j - 1] + np.take_along_axis(before, best, 0)[0]
        pairs[:, i, j] = 1 + np.take_along_axis(steps, best, 0)[0]
    return total[:, n, m], pairs[:, n, m]
