"""Gaussian mixture regression: thesis (3.3) to (3.5), with the full covariance of the conditional mixture.

The covariance is sum_k h_k (S_k + (m_k - m)(m_k - m)'). It includes the spread between the components. It is computed
from the deviations m_k - m, so that no digits are lost. The responsibilities h_k are computed from log densities: far
from the data they would otherwise be 0 / 0. There a query belongs to the component whose density falls most slowly.
Queries lie along the last axis of the arrays and are processed in slices that fit into the cache.
"""

from __future__ import annotations

from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.checks import as_dims, as_finite, as_samples, require_near
from dart_skill.mixture._expectation_maximisation import normalise_log
from dart_skill.mixture._gaussian import LOG_2PI, cholesky, symmetric, upper_triangle
from dart_skill.mixture._mixture import GaussianMixture
from dart_skill.mixture._sweep import to_counts

SLICE = 1024


class Regression:
    """Gaussian mixture regression of some dimensions on others, prepared for many calls: (3.3) to (3.5).

    A call `regression(inputs)` with inputs (n, i) returns mean (n, o) and covariance (n, o, o) of the outputs. With one
    input dimension, inputs (n,) are n queries.

    Parameters:

    * mixture: GaussianMixture, fitted or made from parameters.
    * input_dims: i distinct column indices of the mixture, in any order.
    * output_dims: o distinct column indices, none of them an input. Other columns may be left out of both.
    """

    def __init__(self, mixture: GaussianMixture, input_dims: ArrayLike, output_dims: ArrayLike):
        into, out = _split(mixture.n_dims, input_dims, output_dims)
        self.n_inputs, self.n_outputs = len(into), len(out)
        rows = mixture.covariances_[:, into]
        factors, self._whiteners = _factors(rows[:, :, into])
        # With one input, products of matrices with it are products of numbers, and those are quicker.
        self._times = np.multiply if self.n_inputs == 1 else np.matmul
        half = self._times(self._whiteners, rows[:, :, out])
        self._input_means, self._output_means = mixture.means_[:, into, None], mixture.means_[:, out, None]
        self._slopes = self._times(np.swapaxes(half, 1, 2), self._whiteners)
        self._half, self._among_outputs = half, (mixture.covariances_, out)
        log_volumes = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(1) + 0.5 * len(into) * LOG_2PI
        self._constants = (np.log(mixture.priors_) - log_volumes)[:, None]

    @cached_property
    def _collector(self) -> np.ndarray:
        """What makes the covariance of shares, and of the upper triangle of the spread between the components; a mean does without."""
        covariances, out = self._among_outputs
        within = covariances[:, out[:, None], out] - np.swapaxes(self._half, 1, 2) @ self._half
        return np.concatenate([within.reshape(len(within), -1), _unpacking(self.n_outputs)])

    def __call__(self, inputs: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        inputs = self._checked(inputs)
        mean, covariance = np.empty((len(inputs), self.n_outputs)), np.empty((len(inputs), self.n_outputs, self.n_outputs))
        for start in range(0, len(inputs), SLICE):
            span = slice(start, start + SLICE)
            deviations = self._deviations(inputs[span])
            shares, _ = self._shares(deviations, inputs[span], start)
            self._collapse(shares, self._means(deviations), mean[span], covariance[span])
        return mean, covariance

    def mean(self, inputs: ArrayLike) -> np.ndarray:
        """Mean (n, o) of the outputs (3.4) without their covariance; equal to the mean of a call to the last bit. inputs: (n, i)."""
        inputs = self._checked(inputs)
        mean = np.empty((len(inputs), self.n_outputs))
        for start in range(0, len(inputs), SLICE):
            span = slice(start, start + SLICE)
            deviations = self._deviations(inputs[span])
            shares, _ = self._shares(deviations, inputs[span], start)
            mean[span] = _centre(shares, self._means(deviations)).T
        return mean

    def responsibilities(self, inputs: ArrayLike) -> np.ndarray:
        """h_k of (3.5): (n, K). inputs: (n, i)."""
        inputs = self._checked(inputs)
        return self._shares(self._deviations(inputs), inputs)[0].T

    def log_density(self, inputs: ArrayLike) -> np.ndarray:
        """(n,) log density of the inputs alone: it is low for a query that is far from the demonstrations."""
        inputs = self._checked(inputs)
        return self._shares(self._deviations(inputs), inputs)[1]

    def _checked(self, inputs: ArrayLike) -> np.ndarray:
        given = inputs if isinstance(inputs, np.ndarray) else as_finite(inputs, "inputs")
        return as_samples(given[:, None] if given.ndim == 1 and self.n_inputs == 1 else given, "inputs", self.n_inputs)

    def _deviations(self, inputs: np.ndarray) -> np.ndarray:
        """Deviations (K, i, n) of the inputs from the means of the components."""
        return inputs.T - self._input_means

    def _means(self, deviations: np.ndarray) -> np.ndarray:
        """Means (K, o, n) of the outputs by each component."""
        means = self._times(self._slopes, deviations)
        means += self._output_means
        return means

    def _shares(self, deviations: np.ndarray, inputs: np.ndarray, first_row: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Responsibilities (K, n) and log densities (n,) from the inputs (n, i) and their deviations (K, i, n)."""
        with np.errstate(over="ignore", invalid="ignore"):
            white = self._times(self._whiteners, deviations)
            shares = self._constants - 0.5 * np.einsum("kin,kin->kn", white, white)
            log_density = to_counts(shares, 1.0)
        require_near(log_density, inputs, "inputs", first_row)
        return shares, log_density

    def _collapse(self, shares: np.ndarray, means: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> None:
        """Mean (n, o) and total covariance (n, o, o), in place, of mixtures with shares (K, n) and means (K, o, n); the last are
        overwritten.
        """
        centre = _centre(shares, means)
        mean[:] = centre.T
        means -= centre
        means *= np.sqrt(shares)[:, None, :]
        row, parts = len(shares), np.empty((len(self._collector), len(mean)))
        parts[:row] = shares
        for i in range(self.n_outputs):
            np.einsum("kn,kon->on", means[:, i], means[:, i:], out=parts[row : row + self.n_outputs - i])
            row += self.n_outputs - i
        np.matmul(parts.T, self._collector, out=covariance.reshape(len(mean), -1))


@lru_cache(maxsize=64)
def _unpacking(n_dims: int) -> np.ndarray:
    """Zeros and ones (q, d d) that make a symmetric matrix of its upper triangle: a product with them is faster than copying."""
    return np.equal.outer(np.arange(n_dims * (n_dims + 1) // 2), upper_triangle(n_dims)[1].ravel()).astype(float)


def _factors(covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """L and L^-1 (K, i, i) of the covariances L L' of the inputs."""
    if covariances.shape[1] == 1 and covariances.min() > 0:
        factors = np.sqrt(covariances)
        return factors, 1.0 / factors
    factors = cholesky(covariances, "covariance of the inputs of component")
    return factors, np.linalg.inv(factors)


def regress(mixture: GaussianMixture, inputs: ArrayLike, input_dims: ArrayLike, output_dims: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """(3.3) to (3.5): mean (n, o) and covariance (n, o, o) of the output dimensions, given inputs (n, i).

    With one input dimension, inputs (n,) are n queries. For more than one call, prepare a `Regression`.

    * mixture: over inputs and outputs.
    * input_dims: indices (i,) of the dimensions of the mixture that are given, from 0, such as [0] for time.
    * output_dims: those (o,) that are asked for, in the order of the result.
    """
    return Regression(mixture, input_dims, output_dims)(inputs)


def regress_each(
    priors: np.ndarray, means: np.ndarray, covariances: np.ndarray, inputs: np.ndarray, input_dims: ArrayLike, output_dims: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """`regress` with a mixture of its own for each query: means (n, K, d), covariances (n, K, d, d), inputs (n, i); the priors (K,)
    are common to all.

    input_dims, output_dims: indices (i,) and (o,) of the dimensions that are given and asked for, from 0.
    """
    into, out = _split(means.shape[-1], input_dims, output_dims)
    whiteners = np.linalg.inv(cholesky(covariances[..., into[:, None], into], "covariance of the inputs of component"))
    log_volumes = np.log(np.diagonal(whiteners, axis1=-2, axis2=-1)).sum(-1)
    inputs = as_samples(inputs, "inputs", len(into))
    with np.errstate(over="ignore", invalid="ignore"):
        white = (whiteners @ (inputs[:, None] - means[..., into])[..., None])[..., 0]
        shares, log_density = normalise_log(np.log(priors) + log_volumes - 0.5 * np.square(white).sum(-1))
    require_near(log_density, inputs, "inputs")
    half = whiteners @ covariances[..., into[:, None], out]
    conditional = means[..., out] + (white[..., None, :] @ half)[..., 0, :]
    within = covariances[..., out[:, None], out] - np.swapaxes(half, -1, -2) @ half
    mean = np.einsum("nk,nko->no", shares, conditional)
    spread = (conditional - mean[:, None]) * np.sqrt(shares)[..., None]
    return mean, symmetric(np.einsum("nk,nkop->nop", shares, within) + np.swapaxes(spread, 1, 2) @ spread)


def _centre(shares: np.ndarray, means: np.ndarray) -> np.ndarray:
    """Mean (o, n) of mixtures with shares (K, n) and means (K, o, n)."""
    return np.einsum("kn,kon->on", shares, means)


def _split(n_dims: int, input_dims: ArrayLike, output_dims: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    into = as_dims(input_dims, n_dims, "input_dims")
    out = as_dims(output_dims, n_dims, "output_dims")
    both = sorted(set(into.tolist()) & set(out.tolist()))
    if both:
        raise ValueError(f"dimensions {both} are both input and output; choose one")
    return into, out
