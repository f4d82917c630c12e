"""Weighted EM in the log domain for Gaussian mixtures over one or several blocks of columns.

A block (n, d) holds the samples as one task frame sees them. All blocks share the
responsibilities: the density of a component is the product of its densities in all blocks (the
tensor GMM of Calinon). With one block this is the ordinary mixture of thesis 3.2.1. A row of nan
means that the block does not see this sample. There the block adds no factor to the density, and
nothing is learned for this block from this sample.

First each column of the samples is standardised. So the covariance floor is relative to the scale
of the data, and a change of units changes the result only by that unit. The floor is a lower bound
of the eigenvalues of each covariance. The M step is the maximum under this constraint, so the
likelihood still rises with every iteration.

A prior on the covariances (C. Fraley and A. Raftery, "Bayesian regularization for normal mixture
estimation and model-based clustering", Journal of Classification 24, 2007) is inverse Wishart. Its
weight is given in samples, so the M step averages what the samples say with the prior, and the
posterior rises.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import LARGEST_LEARNABLE, require_near
from dart_skill.mixture._gaussian import LOG_2PI, cholesky, raise_to_floor, symmetric
from dart_skill.mixture._sweep import DEAD_SHARE, Components, Sums, Sweep, seen_rows


@dataclass(frozen=True, eq=False)
class Parameters:
    """Priors (K,) and, per block, means (K, d) and covariances (K, d, d)."""

    priors: np.ndarray
    means: list[np.ndarray]
    covariances: list[np.ndarray]

    @property
    def n_components(self) -> int:
        return len(self.priors)


Start = Parameters | Callable[[list[np.ndarray], np.ndarray], np.ndarray]
"""Where EM starts: at parameters in the units of the data, or at responsibilities (n, K) that a
function makes of blocks and weights.
"""
Scales = list[tuple[np.ndarray, np.ndarray]]
"""For each block the centre and the scale (d,) of its columns."""


@dataclass(frozen=True)
class EmSettings:
    """When EM stops, and how narrow a component may become.

    Parameters
    ----------
    covariance_floor
        Smallest variance of a component, relative to the variance of the data.
    tolerance
        EM has converged if the mean log-likelihood rises by less.
    max_iterations
        EM stops after so many.
    covariance_prior
        Weight of `prior_covariance` in each covariance, in samples; 0 for none.
    """

    covariance_floor: float
    tolerance: float
    max_iterations: int
    covariance_prior: float = 0.0


@dataclass(frozen=True, eq=False)
class EmFit:
    """Result of EM.

    Parameters
    ----------
    parameters
        Weights, means and covariances.
    log_likelihood
        Mean over the samples, weighted.
    n_iterations
        How many were made.
    converged
        False if `max_iterations` came first.
    log_prior
        Of the covariances, up to a constant, per sample; 0 without a prior.
    """

    parameters: Parameters
    log_likelihood: float
    n_iterations: int
    converged: bool
    log_prior: float = 0.0


def log_densities(block: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """(n, K) log N(x; mu_k, S_k) of samples (n, d), means (K, d), positive definite covariances
    (K, d, d).
    """
    factors = cholesky(covariances, "covariance of component")
    whiteners = np.swapaxes(np.linalg.inv(factors), 1, 2)
    log_volumes = (
        np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(1) + 0.5 * block.shape[1] * LOG_2PI
    )
    logs = np.empty((len(means), len(block)))
    for k, (mean, whitener, log_volume) in enumerate(
        zip(means, whiteners, log_volumes, strict=True)
    ):
        white = (block - mean) @ whitener
        logs[k] = -0.5 * np.einsum("ni,ni->n", white, white) - log_volume
    logs[:, ~seen_rows(block)] = 0.0
    return logs.T


def joint_log_densities(blocks: list[np.ndarray], parameters: Parameters) -> np.ndarray:
    """(n, K) log of the prior times the product of the densities in all blocks."""
    terms = [
        log_densities(*one)
        for one in zip(blocks, parameters.means, parameters.covariances, strict=True)
    ]
    return sum(terms, np.zeros(())) + np.log(parameters.priors)


def normalise_log(log_values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """exp(log_values) (n, K) divided by their sum over K, and the log of that sum (n,), without
    under- or overflow.

    Parameters
    ----------
    log_values
        (n, K).
    """
    top = log_values.max(axis=1, keepdims=True)
    shares = np.exp(log_values - top)
    total = shares.sum(axis=1, keepdims=True)
    return shares / total, (top + np.log(total))[:, 0]


def expectation(blocks: list[np.ndarray], parameters: Parameters) -> tuple[np.ndarray, np.ndarray]:
    """E step: responsibilities (n, K) and log densities of the mixture (n,)."""
    return normalise_log(joint_log_densities(blocks, parameters))


def expectation_at(
    points: np.ndarray, blocks: list[np.ndarray], parameters: Parameters
) -> tuple[np.ndarray, np.ndarray]:
    """`expectation` for any points (n, d), given as blocks, too.

    Parameters
    ----------
    parameters
        Of the mixture.

    Raises
    ------
    ValueError
        For a point whose log density overflows.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        shares, log_density = expectation(blocks, parameters)
    require_near(log_density, points, "samples")
    return shares, log_density


def maximisation(blocks: list[np.ndarray], counts: np.ndarray, floor: float) -> Parameters:
    """M step from counts (n, K), which are responsibilities times weights; no component may have a
    total count of zero.

    If a component has almost no count among the samples that a block sees, it gets mean and
    covariance of all samples in that block.

    Parameters
    ----------
    floor
        The covariance floor of `EMEstimator`.
    """
    mass = counts.sum(0)
    moments = [_moments(*_only_seen(block, counts), floor) for block in blocks]
    return Parameters(
        mass / mass.sum(), [mean for mean, _ in moments], [covariance for _, covariance in moments]
    )


def _only_seen(block: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rows that the block sees, and the values that belong to them."""
    seen = seen_rows(block)
    return (block, values) if seen.all() else (block[seen], values[seen])


def _moments(block: np.ndarray, counts: np.ndarray, floor: float) -> tuple[np.ndarray, np.ndarray]:
    mass = counts.sum(0)
    unowned = mass < DEAD_SHARE * counts.sum() / len(counts)
    if unowned.any():
        counts = np.where(unowned, counts.sum(1, keepdims=True), counts)
        mass = counts.sum(0)
    shares = counts / mass
    means = shares.T @ block
    covariances = np.empty((*means.shape, block.shape[1]))
    for mean, share, covariance in zip(means, shares.T, covariances, strict=True):
        deviations = block - mean
        covariance[:] = (deviations * share[:, None]).T @ deviations
    return means, raise_to_floor(symmetric(covariances), floor)


def column_scales(
    block: np.ndarray, weights: np.ndarray, least: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """Weighted mean and standard deviation (d,) of the columns, the latter at least `least`.

    For a constant column its magnitude, or 1 for zeros, replaces the standard deviation.

    Parameters
    ----------
    block
        Samples (n, d).

    Raises
    ------
    ValueError
        For a column that spreads too little for a variance.
    """
    block, weights = _only_seen(block, weights)
    magnitude = np.abs(block).max(0)
    unit = np.where(magnitude > 0, magnitude, 1.0)
    share = weights / weights.sum()
    centre = block[0] + share @ (block - block[0])
    deviation = unit * np.sqrt(share @ np.square((block - centre) / unit))
    scale = np.maximum(deviation, least)
    scale = np.where(scale > 8 * np.finfo(float).eps * unit, scale, unit)
    if scale.min() < 1.0 / LARGEST_LEARNABLE:
        raise ValueError(
            f"column {int(scale.argmin())} of the samples spreads over {scale.min():g}, too little"
            " for a variance; choose a smaller unit"
        )
    return centre, scale


def _revive(
    blocks: list[np.ndarray],
    counts: np.ndarray,
    log_density: np.ndarray,
    dead: np.ndarray,
    floor: float,
) -> Parameters:
    """M step in which each dead component moves to a badly explained sample and gets the
    covariance of all data.
    """
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
    """One EM run on standardised blocks. A dead component is revived; after n_components revivals
    it is dropped.
    """

    def __init__(
        self,
        blocks: list[np.ndarray],
        weights: np.ndarray,
        settings: EmSettings,
        n_components: int,
    ) -> None:
        self.blocks, self.weights, self.settings = blocks, weights, settings
        self.sweep = Sweep(
            blocks, weights, settings.covariance_floor, settings.tolerance, n_components
        )
        self.revivals_left, self.least_mass = n_components, DEAD_SHARE * weights.mean()

    def dead(self, mass: np.ndarray) -> np.ndarray:
        """Indices of the dead components: those with almost no count."""
        return np.flatnonzero(mass < self.least_mass)

    def update(self, responsibilities: np.ndarray, log_density: np.ndarray) -> Parameters:
        """M step in which dead components are revived or dropped, so that it never divides by
        zero.
        """
        floor = self.settings.covariance_floor
        counts = responsibilities * self.weights[:, None]
        dead = self.dead(counts.sum(0))
        if 0 < dead.size <= self.revivals_left:
            self.revivals_left -= dead.size
            return _revive(self.blocks, counts, log_density, dead, floor)
        counts = np.delete(counts, dead, axis=1) if dead.size else counts
        found, strength = maximisation(self.blocks, counts, floor), self.settings.covariance_prior
        return with_prior(found, masses_of(self.blocks, counts), strength) if strength else found

    def begin(self, responsibilities: np.ndarray) -> tuple[np.ndarray, list[Components]]:
        """Priors and components of the first M step: by the sweep, unless a component is dead, or
        too narrow for its sums.
        """
        sums = self.sweep.sums_of(responsibilities * self.weights[:, None])
        if min(sums.mass.tolist()) >= self.least_mass:
            components = self._maximise(self.sweep, sums)
            if self.sweep.is_exact_by_products(components):
                return sums.mass / sums.mass.sum(), components
        return self.at(self.update(responsibilities, np.zeros(len(self.weights))))

    def at(self, parameters: Parameters) -> tuple[np.ndarray, list[Components]]:
        """Priors and components of given parameters."""
        return parameters.priors, self.sweep.to_white(parameters.means, parameters.covariances)

    def iterate(self, priors: np.ndarray, components: list[Components]) -> EmFit:
        """EM until the mean log-likelihood stops changing."""
        sweep, share = self.sweep, self.weights / self.weights.sum()
        previous, last = -np.inf, self.settings.max_iterations
        for iteration in range(1, last + 1):
            sums = sweep(priors, components)
            likelihood, log_prior = (
                float(share.dot(sums.log_density)),
                self._log_prior(sweep, components),
            )
            if abs(likelihood + log_prior - previous) <= self.settings.tolerance:
                return EmFit(
                    Parameters(priors, *sweep.from_white(components)),
                    likelihood,
                    iteration,
                    True,
                    log_prior,
                )
            if min(sums.mass.tolist()) >= self.least_mass:
                previous, priors, components = (
                    likelihood + log_prior,
                    sums.mass / sums.mass.sum(),
                    self._maximise(sweep, sums),
                )
            else:
                # A revived component needs further iterations, so in the last one it is dropped
                # instead.
                self.revivals_left *= iteration < last
                parameters = self.update(
                    *expectation(self.blocks, Parameters(priors, *sweep.from_white(components)))
                )
                previous, (priors, components) = -np.inf, self.at(parameters)
        likelihood = float(share @ sweep(priors, components).log_density)
        return EmFit(
            Parameters(priors, *sweep.from_white(components)),
            likelihood,
            last,
            False,
            self._log_prior(sweep, components),
        )

    def _maximise(self, sweep: Sweep, sums: Sums) -> list[Components]:
        """M step of the sweep, with the prior if there is one."""
        components = sweep.maximise(sums)
        strength = self.settings.covariance_prior
        if not strength:
            return components
        masses = [mass for products in sums.products for mass in products[..., 0]]
        found = with_prior(Parameters(sums.mass, *sweep.from_white(components)), masses, strength)
        return sweep.to_white(found.means, found.covariances)

    def _log_prior(self, sweep: Sweep, components: list[Components]) -> float:
        """Logarithm of the prior of the covariances, per sample and up to a constant: -(strength /
        2) sum_k log |S_k| + tr(S_k^-1 P).
        """
        strength = self.settings.covariance_prior
        if not strength:
            return 0.0
        _, covariances = sweep.from_white(components)
        terms = [
            # [None], as NumPy 1 takes a single matrix on the right side for a stack of vectors
            np.linalg.slogdet(one)[1].sum()
            + np.trace(
                np.linalg.solve(one, prior_covariance(*one.shape[:2])[None]), axis1=1, axis2=2
            ).sum()
            for one in covariances
        ]
        return float(-0.5 * strength * sum(terms) / self.weights.sum())


def masses_of(blocks: list[np.ndarray], counts: np.ndarray) -> list[np.ndarray]:
    """Total counts (K,) of the samples that each block sees.

    Parameters
    ----------
    blocks
        (n, d) each, with nan in rows that it does not see.
    counts
        (n, K).
    """
    return [_only_seen(block, counts)[1].sum(0) for block in blocks]


def with_prior(parameters: Parameters, masses: list[np.ndarray], strength: float) -> Parameters:
    """Each covariance averaged with that of the prior: the mode of the inverse Wishart posterior.

    Parameters
    ----------
    parameters
        Of standardised samples, as `maximisation` finds them.
    masses
        Total counts (K,) in each block.
    strength
        Weight of the prior, in samples; 0 for none.
    """
    if not strength:
        return parameters
    covariances = [
        (mass[:, None, None] * one + strength * prior_covariance(*one.shape[:2]))
        / (mass + strength)[:, None, None]
        for one, mass in zip(parameters.covariances, masses, strict=True)
    ]
    return replace(parameters, covariances=covariances)


def prior_covariance(n_components: int, n_dims: int) -> np.ndarray:
    """P (d, d) of standardised columns: K ellipsoids of it fill the volume of the data (Fraley and
    Raftery 2007, section 4.2).

    Diagonal, as the covariance of few samples would bring the correlations back that they have by
    chance.
    """
    return n_components ** (-2.0 / n_dims) * np.eye(n_dims)


def expectation_maximisation(
    blocks: list[np.ndarray],
    weights: np.ndarray,
    start: Start,
    settings: EmSettings,
    least_scales: Sequence[ArrayLike] | None = None,
) -> EmFit:
    """EM on blocks (n, d_p) with weights (n,), in the units of the data; samples with weight zero
    are ignored.

    Parameters
    ----------
    start
        Parameters in the units of the data, or a function that gets the standardised blocks and
        the weights and returns responsibilities (n, K).
    least_scales
        For each block an array (d_p,), a lower bound of the standard deviations by which its
        columns are standardised.
    """
    least_scales = [0.0] * len(blocks) if least_scales is None else least_scales
    if not (weights > 0).all():
        blocks, weights = [block[weights > 0] for block in blocks], weights[weights > 0]
    # Fortran order: all that follows runs along the columns.
    settings = replace(
        settings, covariance_prior=settings.covariance_prior / float(weights.mean())
    )
    blocks, weights = [np.asfortranarray(block) for block in blocks], weights / weights.mean()
    scales = [
        column_scales(block, weights, least)
        for block, least in zip(blocks, least_scales, strict=True)
    ]
    standard = [
        (block - centre) / scale for block, (centre, scale) in zip(blocks, scales, strict=True)
    ]
    if isinstance(start, Parameters):
        run = _Run(standard, weights, settings, start.n_components)
        fit = run.iterate(*run.at(_standardised(start, scales, settings.covariance_floor)))
    else:
        responsibilities = start(standard, weights)
        run = _Run(standard, weights, settings, responsibilities.shape[1])
        fit = run.iterate(*run.begin(responsibilities))
    mass = weights.sum()
    log_volume = sum(
        weights.dot(seen_rows(block)) / mass * np.log(scale).sum()
        for block, (_, scale) in zip(blocks, scales, strict=True)
    )
    return replace(
        fit,
        parameters=in_units(fit.parameters, scales),
        log_likelihood=fit.log_likelihood - float(log_volume),
    )


def _standardised(parameters: Parameters, scales: Scales, floor: float) -> Parameters:
    means = [
        (means - centre) / scale
        for means, (centre, scale) in zip(parameters.means, scales, strict=True)
    ]
    covariances = [
        matrices / np.outer(scale, scale)
        for matrices, (_, scale) in zip(parameters.covariances, scales, strict=True)
    ]
    return Parameters(
        parameters.priors, means, [raise_to_floor(one, floor) for one in covariances]
    )


def in_units(parameters: Parameters, scales: Scales) -> Parameters:
    means = [
        means * scale + centre
        for means, (centre, scale) in zip(parameters.means, scales, strict=True)
    ]
    covariances = [
        matrices * np.outer(scale, scale)
        for matrices, (_, scale) in zip(parameters.covariances, scales, strict=True)
    ]
    return Parameters(parameters.priors, means, covariances)


def best_fit(
    blocks: list[np.ndarray],
    weights: np.ndarray,
    start: Start,
    settings: EmSettings,
    n_starts: int,
    least_scales: Sequence[ArrayLike] | None = None,
) -> EmFit:
    """The most likely of n_starts EM runs, the first of equals; from given parameters there is
    only one run.
    """
    n_starts = 1 if isinstance(start, Parameters) else n_starts
    fits = [
        expectation_maximisation(blocks, weights, start, settings, least_scales)
        for _ in range(n_starts)
    ]
    return max(fits, key=lambda fit: fit.log_likelihood + fit.log_prior)
