"""The policy of PoWER, a Gaussian over parameters (d,), and its update from weighted trials:
(5.1), (5.2), 5.2.1.

Inside, a parameter is measured from the start of the search, in units of the spread at the start.
So the units of the parameters make no difference.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_finite
from dart_skill.policy_search._exploration import NOISE, PathLength
from dart_skill.policy_search._search import Settings


def as_spread(spread: ArrayLike, shape: tuple[int, ...]) -> np.ndarray:
    """Standard deviations as an array of the given shape, from one number or an array of that
    shape.
    """
    spread = as_finite(spread, "spread")
    if spread.shape not in ((), shape):
        raise ValueError(f"spread must be one number or have shape {shape}, got {spread.shape}")
    if (spread <= 0).any():
        raise ValueError(
            f"spread must be above 0, got {spread.min():g}: give the size of a sensible first"
            " exploration"
        )
    return np.broadcast_to(spread, shape).copy()


class GaussianPolicy:
    """The Gaussian N(start + scale * mean, size^2 scale shape scale).

    start, scale and mean are (d,), size is a number, shape is (d, d). The shape is stored as
    variances (d,) along axes (d, d). With `diagonal` the axes are those of the parameters.
    """

    def __init__(self, start: np.ndarray, scale: np.ndarray, settings: Settings, diagonal: bool):
        d = start.size
        self.start, self.scale, self._settings = start, scale, settings
        self.mean: np.ndarray = np.zeros(d)
        self.variances: np.ndarray = np.ones(d)
        self.axes: np.ndarray = np.eye(d)
        self.size = 1.0
        self.path = PathLength(d, diagonal)

    @property
    def parameters(self) -> np.ndarray:
        return self.start + self.scale * self.mean

    @property
    def covariance(self) -> np.ndarray:
        root = self.scale[:, None] * self.axes * np.sqrt(self.variances) * self.size
        return root @ root.T

    @property
    def longest(self) -> float:
        """Standard deviation along the longest axis, in units of the spread at the start."""
        return self.size * float(np.sqrt(self.variances.max()))

    def begin(self, mean: np.ndarray, covariance: np.ndarray) -> None:
        """Go on from another Gaussian with an empty path: mean (d,) and covariance (d, d), in
        spreads from the start.
        """
        variances, axes = np.linalg.eigh(covariance)
        low, high = self._settings.limits
        variances = np.clip(variances, low**2, high**2)
        self.mean, self.size = mean, float(np.sqrt(variances.max()))
        self.path = PathLength(mean.size, self.path.diagonal)
        self._set_shape(variances / self.size**2, axes)

    def draw(self, noise: np.ndarray) -> np.ndarray:
        """Parameters (n, d) from standard normal noise (n, d)."""
        return self.start + self.scale * (self.mean + self.size * self._coloured(noise))

    def update(self, noise: np.ndarray, tried: np.ndarray, weights: np.ndarray) -> None:
        """Update from n trials: the noise (n, d) they were drawn from, the parameters tried (n,
        d), and weights (n, d).

        For each parameter the weights sum to one, or are all zero if the returns say nothing about
        it.
        """
        relative = (tried - self.start) / self.scale - self.mean
        if self._settings.exploration == "automatic":
            self._adapt(noise, weights)
        elif self._settings.exploration != "fixed":
            self._set_covariance(
                self._weighted_covariance(relative, weights), np.any(weights, axis=0)
            )
        self.mean = self.mean + (weights * relative).sum(axis=0)  # (5.1), (7.17)

    def _set_covariance(self, covariance: np.ndarray, known: np.ndarray) -> None:
        """(5.2) with the noise of 5.2.1 added to the eigenvalues; only parameters in the mask
        known (d,) change.
        """
        variances, axes = self._decomposed(covariance)
        variances = NOISE[self._settings.exploration](
            variances, self._settings.minimum_exploration
        )
        self._set_shape(np.where(known, variances, self.variances), axes)

    def _adapt(self, noise: np.ndarray, weights: np.ndarray) -> None:
        """Size and shape from the noise of the trials; this is right for trials drawn before the
        last update, too.
        """
        length = np.linalg.norm(weights, axis=0)
        known = length > 0
        step = (weights * noise).sum(axis=0) / np.where(known, length, 1.0)
        effective = float((1 / length[known] ** 2).mean())
        factor = self.path.advance(step, self._coloured(step), effective, known)
        along_path, of_trials = self.path.shape_rates(effective)
        shape = (
            1 - along_path - of_trials
        ) * self._shape() + of_trials * self._weighted_covariance(self._coloured(noise), weights)
        variances, axes = self._decomposed(shape + along_path * self._outer(self.path.shape_path))
        self.size = float(np.clip(self.size * factor, *self._settings.limits))
        self._set_shape(np.where(known, variances, self.variances), axes)

    def _set_shape(self, variances: np.ndarray, axes: np.ndarray) -> None:
        low, high = (limit / self.size for limit in self._settings.limits)
        self.variances, self.axes = np.clip(variances, low**2, high**2), axes

    def _coloured(self, noise: np.ndarray) -> np.ndarray:
        """Noise (..., d) multiplied by the symmetric square root of the shape."""
        if self.path.diagonal:
            return noise * np.sqrt(self.variances)
        return noise @ (self.axes * np.sqrt(self.variances)) @ self.axes.T

    def _shape(self) -> np.ndarray:
        return self.variances if self.path.diagonal else (self.axes * self.variances) @ self.axes.T

    def _outer(self, vector: np.ndarray) -> np.ndarray:
        return vector**2 if self.path.diagonal else np.outer(vector, vector)

    def _weighted_covariance(self, deviations: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """(5.2) without Sigma_0: (d, d), or its diagonal (d,)."""
        if self.path.diagonal:
            return (weights * deviations**2).sum(axis=0)
        weighted = np.sqrt(weights) * deviations
        return weighted.T @ weighted

    def _decomposed(self, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Variances (d,) along axes (d, d)."""
        return (covariance, self.axes) if self.path.diagonal else np.linalg.eigh(covariance)

    def state(self) -> dict:
        arrays = {
            name: getattr(self, name).tolist()
            for name in ("start", "scale", "mean", "variances", "axes")
        }
        return {
            **arrays,
            "size": self.size,
            "path": self.path.path.tolist(),
            "shape_path": self.path.shape_path.tolist(),
        }

    def restore(self, state: dict) -> None:
        d = self.start.size
        self.mean, self.variances, self.axes = (
            np.array(state[name], dtype=float) for name in ("mean", "variances", "axes")
        )
        self.axes = self.axes.reshape(d, d)
        self.size = float(state["size"])
        self.path.path, self.path.shape_path = (
            np.array(state[name], dtype=float) for name in ("path", "shape_path")
        )
