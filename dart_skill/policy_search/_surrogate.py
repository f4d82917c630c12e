"""A Gaussian process over all of a landscape that changes: what is known of places where nobody looked lately?

    k = (2 l m / (l^2 + m^2))^d exp(-r^2 / (l^2 + m^2)) exp(-|age difference|)

between returns at distance r, seen when hills had lengths l and m: as hills sharpen, what was seen of broad ones tells less. That is the
covariance of one noise blurred with l and with m (M. Gibbs, Bayesian Gaussian processes for regression and classification, 1997), squared
in its first factor; the last one is from I. Bogunovic et al., Time-varying Gaussian process bandit optimization, AISTATS 2016. Constant
mean and noise. All lengths in common, and noise, climb the likelihood by a step of a grid at a time.
"""

from __future__ import annotations

import numpy as np

LENGTHS = 2.0 ** np.arange(-3.0, 1.5, 0.5)  # [spreads per root of the dimension]
NOISES = 10.0 ** np.arange(-4, 2)  # variance of a return, over that of the landscape
EXACT = 2  # largest index into these for returns without noise
SURE = 0.25  # octaves by which lengths are expected to differ from what was told
FIRST = (5, 1)  # indices into lengths and noises to begin with


class Surrogate:
    """Posterior after values (n,) at points (n, d), each the mean of so many trials (n,), `ages` (n,) lifetimes old.

    lengths: of hills when these were seen (n,), and now: of hills now, in the unit of LENGTHS. exact: the returns are without noise.
    """

    def __init__(
        self,
        points: np.ndarray,
        values: np.ndarray,
        ages: np.ndarray,
        counts: np.ndarray,
        indices: tuple[int, int],
        lengths: np.ndarray | None = None,
        now: float = float(LENGTHS[FIRST[0]]),
        exact: bool = False,
    ):
        self._points, self._values, self._counts, self._now = points, values, counts, now
        self._lengths = np.full(len(values), now) if lengths is None else lengths
        self._squares = _squared_distances(points, points)
        self._together, self._fresh = np.exp(-np.abs(ages[:, None] - ages)), np.exp(-ages)
        near = [(i, j) for i, j in _neighbours(indices) if j <= EXACT or not exact]
        self.indices = max(near, key=self._condition)
        self._condition(self.indices)

    @property
    def relief(self) -> float:
        """Standard deviation of the landscape."""
        return float(np.sqrt(self._variance))

    def predict(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean (m,) and standard deviation (m,) at places (m, d), now."""
        kernel = self._kernel(_squared_distances(places, self._points), self._now) * self._fresh
        left = 1 - np.sum(kernel @ self._inverse * kernel, axis=1)
        return self._mean + kernel @ self._scores, self.relief * np.sqrt(np.maximum(left, 1e-12))

    def _kernel(self, squares: np.ndarray, lengths: np.ndarray | float) -> np.ndarray:
        """Of squared distances (m, n) from places with such lengths, (m, 1) or one for all, to the points; without age."""
        d = self._points.shape[1]
        both = np.square(lengths) + np.square(self._lengths)
        return (2 * lengths * self._lengths / both) ** d * np.exp(-squares * self._now**2 / (both * self.length**2))

    def _condition(self, indices: tuple[int, int]) -> float:
        """Posterior with length and noise of these indices; its log likelihood with the best mean and variance, and a prior."""
        length, noise = float(LENGTHS[indices[0]]), float(NOISES[indices[1]])
        self.length, n = length * np.sqrt(self._points.shape[1]), len(self._values)
        covariance = self._kernel(self._squares, self._lengths[:, None]) * self._together
        covariance[np.diag_indices(n)] += noise / self._counts + 1e-8
        root = np.linalg.cholesky(covariance)
        inverse = np.linalg.inv(root)
        self._inverse = inverse.T @ inverse
        self._mean = float(self._inverse.sum(axis=0) @ self._values / self._inverse.sum())
        self._scores = self._inverse @ (self._values - self._mean)
        self._variance = max(float(self._scores @ (self._values - self._mean)) / n, 1e-300)
        unusual = 0.5 * (np.log2(length / self._now) / SURE) ** 2
        return -unusual - 0.5 * n * np.log(self._variance) - float(np.log(np.diag(root)).sum())


def _neighbours(indices: tuple[int, int]) -> list[tuple[int, int]]:
    i, j = indices
    near = [(i, j), (i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)]
    return [(i, j) for i, j in near if 0 <= i < len(LENGTHS) and 0 <= j < len(NOISES)]


def _squared_distances(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    squares = np.square(first).sum(axis=1)[:, None] - 2 * first @ second.T + np.square(second).sum(axis=1)
    return np.maximum(squares, 0.0)
