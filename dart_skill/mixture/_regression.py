"""Gaussian mixture regression: thesis (3.3) to (3.5), with the full covariance of the conditional mixture.

The covariance is sum_k h_k (S_k + (m_k - m)(m_k - m)'), spread between the components included and formed from
the deviations, so that nothing cancels. Responsibilities h_k are formed from log densities, so that a query far
from the data goes to the component that decays slowest instead of to 0 / 0. Queries lie along the last axis and
pass in slices that stay in the cache.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.checks import as_dims, as_finite, as_samples, require_near
from dart_skill.mixture._expectation_maximisation import normalise_log
from dart_skill.mixture._gaussian import LOG_2PI, cholesky, symmetric, upper_triangle
from dart_skill.mixture._mixture import GaussianMixture
from dart_skill.mixture._sweep import to_counts

SLICE = 1024


class Regression:
    """Regression of some dimensions of a mixture on others, prepared for many calls.

    input_dims, output_dims: distinct column indices of the mixture, in any order; they need not cover it. A call
    `regression(inputs)` with inputs (n, i) returns mean (n, o) and covariance (n, o, o) of the outputs; a 1-D
    array of inputs is taken as n queries of one input dimension.
    """

    def __init__(self, mixture: GaussianMixture, input_dims: ArrayLike, output_dims: ArrayLike):
        into, out = _split(mixture.n_dims, input_dims, output_dims)
        factors = cholesky(mixture.covariances_[:, into[:, None], into], "covariance of the inputs of component")
        self._whiteners = np.linalg.inv(factors)
        half = self._whiteners @ mixture.covariances_[:, into[:, None], out]
        self._input_means, self._output_means = mixture.means_[:, into, None], mixture.means_[:, out, None]
        self._slopes = np.swapaxes(half, 1, 2) @ self._whiteners
        within = mixture.covariances_[:, out[:, None], out] - np.swapaxes(half, 1, 2) @ half
        upper, self._square = upper_triangle(len(out))
        self._within = within.reshape(len(within), -1).take(upper, axis=1).T
        log_volumes = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(1) + 0.5 * len(into) * LOG_2PI
        self._constants = (np.log(mixture.priors_) - log_volumes)[:, None]
        self.n_inputs, self.n_outputs = len(into), len(out)

    def __call__(self, inputs: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        inputs = self._checked(inputs)
        mean, covariance = np.empty((len(inputs), self.n_outputs)), np.empty((len(inputs), self.n_outputs, self.n_outputs))
        for start in range(0, len(inputs), SLICE):
            span = slice(start, start + SLICE)
            deviations = self._deviations(inputs[span])
            shares, _ = self._shares(deviations, inputs[span], start)
            self._collapse(shares, self._output_means + self._slopes @ deviations, mean[span], covariance[span])
        return mean, covariance

    def responsibilities(self, inputs: ArrayLike) -> np.ndarray:
        """h_k of (3.5): (n, K)."""
        inputs = self._checked(inputs)
        return self._shares(self._deviations(inputs), inputs)[0].T

    def log_density(self, inputs: ArrayLike) -> np.ndarray:
        """(n,) log density of the inputs alone: how far from what was demonstrated a query is."""
        inputs = self._checked(inputs)
        return self._shares(self._deviations(inputs), inputs)[1]

    def _checked(self, inputs: ArrayLike) -> np.ndarray:
        inputs = as_finite(inputs, "inputs")
        return as_samples(inputs[:, None] if inputs.ndim == 1 and self.n_inputs == 1 else inputs, "inputs", self.n_inputs)

    def _deviations(self, inputs: np.ndarray) -> np.ndarray:
        """(K, i, n) from the means of the components."""
        return inputs.T - self._input_means

    def _shares(self, deviations: np.ndarray, inputs: np.ndarray, first_row: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Responsibilities (K, n) and log densities (n,) of inputs (n, i), and their deviations from the means."""
        with np.errstate(over="ignore", invalid="ignore"):
            white = self._whiteners @ deviations
            shares = self._constants - 0.5 * np.einsum("kin,kin->kn", white, white)
            log_density = to_counts(shares, 1.0)
        require_near(log_density, inputs, "inputs", first_row)
        return shares, log_density

    def _collapse(self, shares: np.ndarray, means: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> None:
        """Mean (n, o) and total covariance (n, o, o), in place, of mixtures with shares (K, n) and means (K, o, n)."""
        centre = np.einsum("kn,kon->on", shares, means)
        spread = (means - centre) * np.sqrt(shares)[:, None, :]
        upper, row = self._within @ shares, 0
        for i in range(self.n_outputs):
            upper[row : row + self.n_outputs - i] += np.einsum("kn,kon->on", spread[:, i], spread[:, i:])
            row += self.n_outputs - i
        mean[:] = centre.T
        covariance[:] = upper.take(self._square, axis=0).transpose(2, 0, 1)


def regress(mixture: GaussianMixture, inputs: ArrayLike, input_dims: ArrayLike, output_dims: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Mean (n, o) and covariance (n, o, o) of the output dimensions given inputs (n, i) of the input
    dimensions.

    A 1-D array of inputs is taken as n queries of one input dimension. To ask more than once see `Regression`.
    """
    return Regression(mixture, input_dims, output_dims)(inputs)


def regress_each(
    priors: np.ndarray, means: np.ndarray, covariances: np.ndarray, inputs: np.ndarray, input_dims: ArrayLike, output_dims: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """The same with a mixture for each input: priors (K,), means (n, K, d), covariances (n, K, d, d), inputs (n, i)."""
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


def _split(n_dims: int, input_dims: ArrayLike, output_dims: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    into = as_dims(input_dims, n_dims, "input_dims")
    out = as_dims(output_dims, n_dims, "output_dims")
    both = sorted(set(into.tolist()) & set(out.tolist()))
    if both:
        raise ValueError(f"dimensions {both} are both input and output; choose one")
    return into, out
