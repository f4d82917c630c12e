"""A Gaussian process for a landscape seen through a blur that changes: white noise, blurred with a Gaussian of variance b per axis.

    cov(f(x, b), f(x', b')) = A (2 c / (b + b'))^(d/2) exp(-|x - x'|^2 / (2 (b + b')))

so all that was seen through any blur informs one hidden landscape, and what was seen broadly foretells what is seen sharply, with more
doubt the sharper. Every sample obeys the heat equation df/db = laplacian(f) / 2. c is the blur at which the variance of the landscape is A.
Constant mean, by generalised least squares; A is the one of highest likelihood. M. Gibbs, Bayesian Gaussian processes for regression and
classification, 1997 (the covariance); J. Koenderink, The structure of images, 1984 (the heat equation).
"""

from __future__ import annotations

import numpy as np

JITTER = 1e-9  # of the variance; two trials at one place are no contradiction


class BlurredNoise:
    """Posterior after values (n,) at points (n, d), seen through blurs (n,), variances in the square of their unit.

    error: variance of a value, over that of the landscape at its blur. The reference blur c is the last of `blurs`.
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
        self.log_likelihood = (
            -0.5 * (len(values) - 1) * float(np.log(self.variance)) - volume
        )  # less a constant; the mean is integrated out

    def predict(self, places: np.ndarray, blur: float) -> tuple[np.ndarray, np.ndarray]:
        """Mean (m,) and standard deviation (m,) at places (m, d), seen through that blur; the doubt about the constant mean counts."""
        kernel = self._kernel(places, np.full(len(places), blur))
        whitened = kernel @ self._whiten.T
        prior = (self._reference / blur) ** (0.5 * places.shape[1])
        left = prior - np.square(whitened).sum(axis=1) + np.square(1 - whitened @ self._ones) / self._left
        return self.mean + kernel @ self._scores, np.sqrt(self.variance * np.maximum(left, 1e-12 * prior))

    def _kernel(self, places: np.ndarray, blurs: np.ndarray) -> np.ndarray:
        """Covariance (m, n) of places (m, d) through blurs (m,) with the points, over A."""
        both = blurs[:, None] + self._blurs
        return (2 * self._reference / both) ** (0.5 * places.shape[1]) * np.exp(-squared_distances(places, self._points) / (2 * both))


def squared_distances(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Between points (m, d) and (n, d): (m, n)."""
    squares = np.square(first).sum(axis=1)[:, None] - 2 * first @ second.T + np.square(second).sum(axis=1)
    return np.maximum(squares, 0.0)
