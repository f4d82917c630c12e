"""A Gaussian process for a landscape that is seen through a changing blur: white noise, blurred by
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

# added to the variance, as a share of it, so that the covariance of two trials at one place can be
# inverted
JITTER = 1e-9


class BlurredNoise:
    """Posterior of the landscape.

    * points (n, d), values (n,): where values were seen.
    * blurs (n,): variance per axis of the blur of each, in the squared unit of the points; the
      last one is c.
    * error: variance of the error of a value, relative to the variance of the landscape at its
      blur.
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
            -squared_distances(places, self._points) / (2 * both)
        )


def squared_distances(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Between points (m, d) and (n, d): (m, n)."""
    squares = (
        np.square(first).sum(axis=1)[:, None]
        - 2 * first @ second.T
        + np.square(second).sum(axis=1)
    )
    return np.maximum(squares, 0.0)
