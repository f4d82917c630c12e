"""A Gaussian process over all of a landscape that changes: what is known of places where nobody looked lately?

Squared exponential kernel in place times an exponential one in age, a constant mean and noise, as in I. Bogunovic et al., Time-varying
Gaussian process bandit optimization, AISTATS 2016. Length and noise climb the likelihood by a step of a grid at a time.
"""

from __future__ import annotations

import numpy as np

LENGTHS = 2.0 ** np.arange(-3.0, 1.5, 0.5)  # [spreads per root of the dimension]
NOISES = 10.0 ** np.arange(-4, 2)  # variance of a return, over that of the landscape
FIRST = (5, 1)  # indices into these to begin with; lengths far from this one need evidence


class Surrogate:
    """Posterior after values (n,) at points (n, d), each the mean of so many trials (n,), `ages` (n,) lifetimes old."""

    def __init__(self, points: np.ndarray, values: np.ndarray, ages: np.ndarray, counts: np.ndarray, indices: tuple[int, int]):
        self._points, self._values, self._counts = points, values, counts
        self._squares = _squared_distances(points, points)
        self._together, self._fresh = np.exp(-np.abs(ages[:, None] - ages)), np.exp(-ages)
        self.indices = max(_neighbours(indices), key=self._condition)
        self._condition(self.indices)

    @property
    def relief(self) -> float:
        """Standard deviation of the landscape."""
        return float(np.sqrt(self._variance))

    def predict(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean (m,) and standard deviation (m,) at places (m, d), now."""
        kernel = np.exp(-0.5 * _squared_distances(places, self._points) / self.length**2) * self._fresh
        left = 1 - np.sum(kernel @ self._inverse * kernel, axis=1)
        return self._mean + kernel @ self._scores, self.relief * np.sqrt(np.maximum(left, 1e-12))

    def _condition(self, indices: tuple[int, int]) -> float:
        """Posterior with length and noise of these indices; its log likelihood with the best mean and variance, and a prior."""
        length, noise = float(LENGTHS[indices[0]]), float(NOISES[indices[1]])
        self.length, n = length * np.sqrt(self._points.shape[1]), len(self._values)
        covariance = np.exp(-0.5 * self._squares / self.length**2) * self._together
        covariance[np.diag_indices(n)] += noise / self._counts + 1e-8
        root = np.linalg.cholesky(covariance)
        inverse = np.linalg.inv(root)
        self._inverse = inverse.T @ inverse
        self._mean = float(self._inverse.sum(axis=0) @ self._values / self._inverse.sum())
        self._scores = self._inverse @ (self._values - self._mean)
        self._variance = max(float(self._scores @ (self._values - self._mean)) / n, 1e-300)
        unusual = 0.5 * np.log2(length / LENGTHS[FIRST[0]]) ** 2
        return -unusual - 0.5 * n * np.log(self._variance) - float(np.log(np.diag(root)).sum())


def _neighbours(indices: tuple[int, int]) -> list[tuple[int, int]]:
    i, j = indices
    near = [(i, j), (i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)]
    return [(i, j) for i, j in near if 0 <= i < len(LENGTHS) and 0 <= j < len(NOISES)]


def _squared_distances(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    squares = np.square(first).sum(axis=1)[:, None] - 2 * first @ second.T + np.square(second).sum(axis=1)
    return np.maximum(squares, 0.0)
