"""Two Gaussian processes over a landscape that changes while it is searched.

`Surrogate` describes hills that change their lengths and heights.

    k = (2 l m / (l^2 + m^2))^d exp(-r^2 / (l^2 + m^2)) exp(-|age difference|)

is the covariance of two returns at distance r that were seen when hills had the lengths l and m.
So returns of broad hills tell less after the hills have sharpened. The first two factors are the
covariance of one noise that is blurred with l and with m (M. Gibbs, Bayesian Gaussian processes
for regression and classification, 1997), the first factor squared. The last factor is from I.
Bogunovic et al., Time-varying Gaussian process bandit optimization, AISTATS 2016. Mean and noise
are constant. A common factor of all lengths, and the noise, are on a grid; each fit moves at most
one step up the likelihood.

`BlurredNoise` describes a landscape that is seen through a changing blur: white noise, blurred by
a Gaussian of variance b per axis.

    cov(f(x, b), f(x', b')) = A (2 c / (b + b'))^(d/2) exp(-|x - x'|^2 / (2 (b + b')))

is the covariance of two values. So all values, seen through any blur, inform one hidden landscape.
Values that were seen through a wide blur predict what is seen through a narrow one; the prediction
is less certain the narrower the blur. Every sample of the process obeys the heat equation df/db =
laplacian(f) / 2. c is the blur at which the variance of the landscape is A. The mean is constant,
by generalised least squares. A has the highest likelihood. M. Gibbs, Bayesian Gaussian processes
for regression and classification, 1997 (the covariance); J. Koenderink, The structure of images,
1984 (the heat equation).
"""

from __future__ import annotations

import numpy as np

LENGTHS = 2.0 ** np.arange(-3.0, 1.5, 0.5)
"""Possible lengths of hills [spreads per root of the dimension]."""
NOISES = 10.0 ** np.arange(-4, 2)
"""Possible variances of the noise of a return, relative to that of the landscape."""
EXACT = 2
"""Largest index into NOISES for returns without noise."""
SURE = 0.25
"""Standard deviation of the length about the one that was given [octaves]."""
FIRST = (5, 1)
"""First indices into LENGTHS and NOISES."""
JITTER = 1e-9
"""Share that is added to the variance, so that the covariance of two trials at one place can be
inverted.
"""


class Surrogate:
    """Posterior of the landscape.

    Parameters
    ----------
    points : (n, d)
        Where returns were seen.
    values : (n,)
        Means of the returns.
    ages : (n,)
        In lifetimes.
    counts : (n,)
        Number of trials of each mean.
    indices
        Of the last fit, into LENGTHS and NOISES.
    lengths : (n,)
        Of hills when the values were seen.
    now
        Of hills now; both in the unit of LENGTHS.
    exact
        Whether the returns are without noise.
    """

    def __init__(
        self,
        points: np.ndarray,
        values: np.ndarray,
        ages: np.ndarray,
        counts: np.ndarray,
        indices: tuple[int, int] = FIRST,
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
        """Kernel (m, n) without age, from squared distances (m, n); lengths: of hills at the m
        places, (m, 1) or one for all.
        """
        d = self._points.shape[1]
        both = np.square(lengths) + np.square(self._lengths)
        return (2 * lengths * self._lengths / both) ** d * np.exp(
            -squares * self._now**2 / (both * self.length**2)
        )

    def _condition(self, indices: tuple[int, int]) -> float:
        """Compute the posterior for these indices; returns its log likelihood, with the best mean
        and variance, plus a log prior.
        """
        length, noise = float(LENGTHS[indices[0]]), float(NOISES[indices[1]])
        self.length = length * np.sqrt(self._points.shape[1])
        n = len(self._values)
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
    squares = (
        np.square(first).sum(axis=1)[:, None]
        - 2 * first @ second.T
        + np.square(second).sum(axis=1)
    )
    return np.maximum(squares, 0.0)


class BlurredNoise:
    """Posterior of the landscape.

    Parameters
    ----------
    points : (n, d)
        Where values were seen.
    values : (n,)
        The values.
    blurs : (n,)
        Variance per axis of the blur of each, in the squared unit of the points; the last one is
        c.
    error
        Variance of the error of a value, relative to the variance of the landscape at its blur.
    """

    def __init__(self, points: np.ndarray, blurs: np.ndarray, values: np.ndarray, error: float):
        self._points, self._blurs, self._reference = points, blurs, float(blurs[-1])
        covariance = self._kernel(points, blurs)
        covariance[np.diag_indices(len(values))] *= 1 + JITTER + error
        root = np.linalg.cholesky(covariance)
        self._whiten = np.linalg.inv(root)
        ones, seen = self._whiten.sum(axis=1), self._whiten @ values
        self._left = float(ones @ ones)
        self.mean = float(ones @ seen / self._left)
        residual = seen - self.mean * ones
        self._ones, self._scores = ones, self._whiten.T @ residual
        self.variance = max(float(residual @ residual) / max(len(values) - 1, 1), 1e-300)
        volume = float(np.log(root.diagonal()).sum() + 0.5 * np.log(self._left))
        # less a constant; the mean is integrated out
        self.log_likelihood = -0.5 * (len(values) - 1) * float(np.log(self.variance)) - volume

    def predict(self, places: np.ndarray, blur: float) -> tuple[np.ndarray, np.ndarray]:
        """Mean (m,) and standard deviation (m,) at places (m, d), seen through that blur.

        The standard deviation includes the uncertainty of the constant mean.
        """
        kernel = self._kernel(places, np.full(len(places), blur))
        whitened = kernel @ self._whiten.T
        prior = (self._reference / blur) ** (0.5 * places.shape[1])
        left = (
            prior
            - np.square(whitened).sum(axis=1)
            + np.square(1 - whitened @ self._ones) / self._left
        )
        return self.mean + kernel @ self._scores, np.sqrt(
            self.variance * np.maximum(left, 1e-12 * prior)
        )

    def _kernel(self, places: np.ndarray, blurs: np.ndarray) -> np.ndarray:
        """Covariance (m, n), divided by A, of the points with places (m, d) seen through blurs
        (m,).
        """
        both = blurs[:, None] + self._blurs
        return (2 * self._reference / both) ** (0.5 * places.shape[1]) * np.exp(
            -_squared_distances(places, self._points) / (2 * both)
        )
