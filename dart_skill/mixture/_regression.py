"""Gaussian mixture regression: thesis (3.3) to (3.5), with the full covariance of the conditional mixture.

The covariance is sum_k h_k (S_k + (m_k - m)(m_k - m)'), spread between the components included.
Responsibilities are formed from log densities, so that a query far from the data goes to the component that
decays slowest instead of to 0 / 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ._checks import as_dims, as_samples
from ._expectation_maximisation import log_densities, normalise_log
from ._gaussian import symmetric
from ._mixture import GaussianMixture


def regress(mixture: GaussianMixture, inputs: ArrayLike, input_dims: ArrayLike, output_dims: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Mean (n, o) and covariance (n, o, o) of the output dimensions given inputs (n, i) of the input
    dimensions.

    A 1-D array of inputs is taken as n queries of one input dimension.
    """
    into, out = _split(mixture, input_dims, output_dims)
    inputs = np.asarray(inputs)
    inputs = as_samples(inputs[:, None] if inputs.ndim == 1 and len(into) == 1 else inputs, "inputs", len(into))
    shares = input_responsibilities(mixture, inputs, into)
    means, covariances = conditionals(mixture, inputs, into, out)
    return collapse(shares, means, covariances)


def _split(mixture: GaussianMixture, input_dims: ArrayLike, output_dims: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    into = as_dims(input_dims, mixture.n_dims, "input_dims")
    out = as_dims(output_dims, mixture.n_dims, "output_dims")
    both = np.intersect1d(into, out)
    if both.size:
        raise ValueError(f"dimensions {both.tolist()} are both input and output; choose one")
    return into, out


def input_responsibilities(mixture: GaussianMixture, inputs: np.ndarray, into: np.ndarray) -> np.ndarray:
    """h_k of (3.5): (n, K)."""
    marginal = mixture.covariances_[:, into[:, None], into]
    with np.errstate(over="ignore", invalid="ignore"):
        log_values = log_densities(inputs, mixture.means_[:, into], marginal) + np.log(mixture.priors_)
        shares = normalise_log(log_values)[0]
    if not np.isfinite(shares).all():
        worst = int(np.argmax(~np.isfinite(shares).all(1)))
        raise ValueError(f"inputs row {worst}, {inputs[worst].tolist()}, is so far away that its log density overflows")
    return shares


def conditionals(mixture: GaussianMixture, inputs: np.ndarray, into: np.ndarray, out: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3.4) for every component: means (K, n, o) and covariances (K, o, o)."""
    factors = np.linalg.cholesky(mixture.covariances_[:, into[:, None], into])
    half = np.linalg.solve(factors, mixture.covariances_[:, into[:, None], out])
    slopes = np.linalg.solve(np.swapaxes(factors, 1, 2), half)
    means = mixture.means_[:, None, out] + (inputs[None] - mixture.means_[:, None, into]) @ slopes
    return means, mixture.covariances_[:, out[:, None], out] - np.swapaxes(half, 1, 2) @ half


def collapse(shares: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean (n, o) and total covariance (n, o, o) of mixtures with shares (n, K), means (K, n, o), covariances
    (K, o, o).
    """
    mean = np.einsum("nk,kno->no", shares, means)
    spread = (means - mean) * np.sqrt(shares.T)[:, :, None]
    between = np.einsum("kni,knj->nij", spread, spread)
    within = np.tensordot(shares, covariances, axes=1)
    return mean, symmetric(within + between)
