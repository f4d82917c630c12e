"""Weighted EM in the log domain for Gaussian mixtures whose components are seen in one or several blocks of
columns.

A block is what one task frame sees of the samples, (n, d); responsibilities are shared: the density of a
component is the product of its densities in all blocks (the tensor GMM of Calinon). One block is the ordinary
mixture of thesis 3.2.1. Samples are standardised per column first, so that the covariance floor is relative
to the scale of the data and a change of units changes nothing but units. The floor bounds the eigenvalues of
each covariance from below, which is the constrained maximum of the M step: the likelihood still rises with
every iteration.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ._gaussian import LOG_2PI, symmetric

# A component with less than this share of one sample's weight explains nothing.
DEAD_SHARE = 1e-3


@dataclass(frozen=True, eq=False)
class Parameters:
    """Priors (K,) and, per block, means (K, d) and covariances (K, d, d)."""

    priors: np.ndarray
    means: list[np.ndarray]
    covariances: list[np.ndarray]

    @property
    def n_components(self) -> int:
        return len(self.priors)


@dataclass(frozen=True)
class Settings:
    """When to stop, and how thin a component may become (variance relative to that of the data)."""

    covariance_floor: float
    tolerance: float
    max_iterations: int


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of EM; the log-likelihood is the mean per unit of weight."""

    parameters: Parameters
    log_likelihood: float
    n_iterations: int
    converged: bool


def log_densities(block: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """(n, K) log N(x; mu_k, S_k) of samples (n, d), means (K, d), positive definite covariances (K, d, d)."""
    factors = np.linalg.cholesky(covariances)
    whiteners = np.linalg.inv(factors)
    white = (block[None] - means[:, None]) @ np.swapaxes(whiteners, 1, 2)
    log_volumes = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(1)
    constants = 0.5 * block.shape[1] * LOG_2PI + log_volumes
    return (-0.5 * np.einsum("kni,kni->kn", white, white) - constants[:, None]).T


def joint_log_densities(blocks: list[np.ndarray], parameters: Parameters) -> np.ndarray:
    """(n, K) log of prior times density, densities multiplied over blocks."""
    terms = [log_densities(*one) for one in zip(blocks, parameters.means, parameters.covariances, strict=True)]
    return sum(terms) + np.log(parameters.priors)


def normalise_log(log_values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shares (n, K) and log of the sum (n,) of exp(log_values (n, K)), without under- or overflow."""
    top = log_values.max(axis=1, keepdims=True)
    shares = np.exp(log_values - top)
    total = shares.sum(axis=1, keepdims=True)
    return shares / total, (top + np.log(total))[:, 0]


def expectation(blocks: list[np.ndarray], parameters: Parameters) -> tuple[np.ndarray, np.ndarray]:
    """E step: responsibilities (n, K) and log densities of the mixture (n,)."""
    return normalise_log(joint_log_densities(blocks, parameters))


def maximisation(blocks: list[np.ndarray], counts: np.ndarray, floor: float) -> Parameters:
    """M step from counts (n, K), responsibilities times weights; every component must own something."""
    mass = counts.sum(0)
    shares = counts / mass
    moments = [_moments(block, shares, floor) for block in blocks]
    return Parameters(mass / mass.sum(), [mean for mean, _ in moments], [covariance for _, covariance in moments])


def _moments(block: np.ndarray, shares: np.ndarray, floor: float) -> tuple[np.ndarray, np.ndarray]:
    means = shares.T @ block
    deviations = block[None] - means[:, None]
    covariances = np.swapaxes(deviations * shares.T[:, :, None], 1, 2) @ deviations
    return means, raise_to_floor(symmetric(covariances), floor)


def raise_to_floor(covariances: np.ndarray, floor: float) -> np.ndarray:
    """Covariances (K, d, d) with eigenvalues below the floor raised to it."""
    try:
        np.linalg.cholesky(covariances - floor * np.eye(covariances.shape[-1]))
        return covariances
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(covariances)
        raised = (vectors * np.maximum(values, floor)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
        return symmetric(raised)


def column_scales(block: np.ndarray, weights: np.ndarray, least: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weighted mean and standard deviation (d,); for a constant column its magnitude (1 for zeros) stands in
    for the deviation.
    """
    magnitude = np.abs(block).max(0)
    unit = np.where(magnitude > 0, magnitude, 1.0)
    share = weights / weights.sum()
    centre = block[0] + share @ (block - block[0])
    deviation = unit * np.sqrt(share @ np.square((block - centre) / unit))
    scale = np.maximum(deviation, least)
    return centre, np.where(scale > 8 * np.finfo(float).eps * unit, scale, unit)


def _revive(blocks, counts, log_density, dead, floor) -> Parameters:
    """M step with each dead component moved onto a badly explained sample, as wide as all the data."""
    worst = np.argsort(log_density, kind="stable")[: len(dead)]
    weight = counts.sum(1, keepdims=True)
    pooled = maximisation(blocks, weight, floor)
    counts = counts.copy()
    counts[:, dead] = 0.0
    counts[worst, dead[: len(worst)]] = weight.sum() / counts.shape[1]
    fitted = maximisation(blocks, counts, floor)
    for covariances, overall in zip(fitted.covariances, pooled.covariances, strict=True):
        covariances[dead] = overall[0]
    return fitted


class _Run:
    """One EM run on standardised blocks; when its revivals are used up, dead components are dropped."""

    def __init__(self, blocks, weights, settings, n_components):
        self.blocks, self.weights, self.settings = blocks, weights, settings
        self.revivals_left = n_components

    def update(self, responsibilities: np.ndarray, log_density: np.ndarray) -> Parameters:
        """M step that never divides by the mass of a component nobody owns."""
        floor = self.settings.covariance_floor
        counts = responsibilities * self.weights[:, None]
        mass = counts.sum(0) / self.weights.sum()
        dead = np.flatnonzero(mass < DEAD_SHARE / len(self.weights))
        if dead.size == 0:
            return maximisation(self.blocks, counts, floor)
        if dead.size <= self.revivals_left:
            self.revivals_left -= dead.size
            return _revive(self.blocks, counts, log_density, dead, floor)
        return maximisation(self.blocks, np.delete(counts, dead, axis=1), floor)

    def iterate(self, responsibilities: np.ndarray) -> Fit:
        """EM from the given responsibilities (n, K) until the mean log-likelihood stops changing."""
        parameters = self.update(responsibilities, np.zeros(len(self.weights)))
        share = self.weights / self.weights.sum()
        previous, converged, n_iterations = -np.inf, False, 0
        while not converged and n_iterations < self.settings.max_iterations:
            n_iterations += 1
            responsibilities, log_density = expectation(self.blocks, parameters)
            likelihood = float(share @ log_density)
            converged = abs(likelihood - previous) <= self.settings.tolerance
            if not converged:
                previous, parameters = likelihood, self.update(responsibilities, log_density)
        likelihood = float(share @ expectation(self.blocks, parameters)[1])
        return Fit(parameters, likelihood, n_iterations, converged)


def expectation_maximisation(blocks: list[np.ndarray], weights: np.ndarray, start, settings: Settings, least_scales=0.0) -> Fit:
    """EM on blocks (n, d) with weights (n,), in the units of the data.

    `start(blocks, weights)` gets the standardised blocks and returns responsibilities (n, K). Samples of
    weight zero play no part. `least_scales` (P, d) bounds the scale of the columns from below.
    """
    least_scales = np.broadcast_to(least_scales, (len(blocks), blocks[0].shape[1]))
    counted = weights > 0
    weights = weights[counted] / weights[counted].mean()
    scales = [column_scales(block[counted], weights, least) for block, least in zip(blocks, least_scales, strict=True)]
    standard = [(block[counted] - centre) / scale for block, (centre, scale) in zip(blocks, scales, strict=True)]
    responsibilities = start(standard, weights)
    fit = _Run(standard, weights, settings, responsibilities.shape[1]).iterate(responsibilities)
    return replace(
        fit,
        parameters=_in_units(fit.parameters, scales),
        log_likelihood=fit.log_likelihood - sum(float(np.log(scale).sum()) for _, scale in scales),
    )


def _in_units(parameters: Parameters, scales) -> Parameters:
    means = [means * scale + centre for means, (centre, scale) in zip(parameters.means, scales, strict=True)]
    covariances = [matrices * np.outer(scale, scale) for matrices, (_, scale) in zip(parameters.covariances, scales, strict=True)]
    return Parameters(parameters.priors, means, covariances)


def best_fit(blocks: list[np.ndarray], weights: np.ndarray, start, settings: Settings, n_starts: int, least_scales=0.0) -> Fit:
    """The most likely of several EM runs; the first wins a tie."""
    fits = [expectation_maximisation(blocks, weights, start, settings, least_scales) for _ in range(n_starts)]
    return max(fits, key=lambda fit: fit.log_likelihood)
