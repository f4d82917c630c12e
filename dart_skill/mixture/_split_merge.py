"""Number of components by split and merge (thesis 5.3.1). Both keep the weight, the mean and the
second moment.

A component is split if this raises the average log-likelihood of weighted data (6.4) by more than
T^S. Two components are merged if this lowers it by less than T^M. (Z. Zhang, C. Chen, J. Sun and
K. L. Chan, EM algorithms for Gaussian mixtures with split-and-merge operation, Pattern Recognition
36, 2003.) In (5.7) to (5.12) the two means move in opposite directions; the printed signs are
corrected here.

All candidates are compared at once: arrays of c mixtures with k components have priors (c, k),
means (c, k, d) and covariances (c, k, d, d).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_number, as_samples, as_weights
from dart_skill.mixture._gaussian import log_normal, raise_to_floor, symmetric
from dart_skill.mixture._mixture import GaussianMixture

HALF_WAY = float(np.sqrt(0.75))
"""Distance of two means that explains three quarters of the variance."""

Components = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Priors, means and covariances."""


@dataclass(frozen=True)
class SplitMerge:
    """When and how components are split and merged.

    Parameters
    ----------
    split_threshold
        Float, default 0.16. T^S, in units of the average log-likelihood.
    merge_threshold
        Float, default 0.01. T^M, in the same units.
    n_axes
        Int, default 1 as in the thesis. D: a split is tried along so many of a component's longest
        axes.
    alpha
        Float in (0, 1), default 0.5. Share of the prior that the first of the two new components
        gets.
    beta
        Float in (0, 1), default 0.5. Share of the remaining variance along the axis that the first
        one gets.
    u
        Float in (0, 1), default sqrt(3/4). Distance of the two means; u^2 is the share of the
        variance that it explains.
    normalise
        Bool, default True. Weights are scaled to sum one, as in (6.4); the thesis's thresholds
        need this.
    refine
        Int, default 0. Steps of EM for each candidate, and for the mixture that it is compared
        with, before they are judged. The refined candidate is the one that is kept.
    covariance_floor
        Float, default 1e-6. Least variance of a refined component along any axis.
    """

    split_threshold: float = 0.16
    merge_threshold: float = 0.01
    n_axes: int = 1
    alpha: float = 0.5
    beta: float = 0.5
    u: float = HALF_WAY
    normalise: bool = True
    refine: int = 0
    covariance_floor: float = 1e-6

    def __post_init__(self) -> None:
        for name in ("split_threshold", "merge_threshold"):
            as_number(getattr(self, name), name, strict=False)
        as_count(self.n_axes, "n_axes")
        as_count(self.refine, "refine", 0)
        as_number(self.covariance_floor, "covariance_floor")
        for name in ("alpha", "beta", "u"):
            if as_number(getattr(self, name), name) >= 1:
                raise ValueError(
                    f"{name} must be below 1, got {getattr(self, name):g}; at 1 a component would"
                    " vanish or be flat"
                )


@dataclass(frozen=True, eq=False)
class Adapted:
    """A mixture after one round of split and merge.

    Parameters
    ----------
    components
        Its priors, means and covariances.
    split
        Index of the component that was split, or None. The two new ones are at that index and at
        the end.
    merged
        Indices, counted after the split, of the two components that were merged, or None. The new
        one is at the first of the two indices.
    split_gain
        Gain of the average log-likelihood by the best split, done or not; -inf if none was tried.
    merge_loss
        Loss of the average log-likelihood by the best merger, done or not; inf if none was tried.
    """

    components: Components
    split: int | None
    merged: tuple[int, int] | None
    split_gain: float
    merge_loss: float

    @property
    def mixture(self) -> GaussianMixture:
        """The mixture of the components."""
        return _mixture(self.components)


def split(
    mixture: GaussianMixture, index: int, axis: int = 0, rule: SplitMerge | None = None
) -> GaussianMixture:
    """(5.7)-(5.12): the mixture with one component split in two along an axis, 0 for the longest.

    The two new components are at `index` and at the end.

    Parameters
    ----------
    rule
        Thresholds and sizes, default those of `SplitMerge`.
    """
    n_dims, n_components = mixture.n_dims, len(mixture.means_)
    _require_below(index, "index", n_components)
    _require_below(axis, "axis", n_dims)
    candidates = split_candidates(
        _components(mixture), rule or SplitMerge(), as_count(axis, "axis", 0) + 1
    )
    return _mixture(_candidate(candidates, axis * n_components + index))


def split_and_merge(
    mixture: GaussianMixture,
    samples: ArrayLike,
    weights: ArrayLike | None = None,
    rule: SplitMerge | None = None,
) -> Adapted:
    """One round of the thesis's algorithm (lines 4 to 21) on samples (n, d) with weights (n,).

    First comes the best split, if it gains more than its threshold, then the best merger, if it
    costs less than its own.

    Parameters
    ----------
    mixture
        At the start.
    rule
        As in `split`.
    """
    samples = as_samples(samples, "samples", mixture.n_dims)
    weights = as_weights(weights, len(samples))
    return adapt(_components(mixture), samples, weights, rule or SplitMerge())


def adapt(
    components: Components,
    samples: np.ndarray,
    weights: np.ndarray,
    rule: SplitMerge,
    most: int | None = None,
) -> Adapted:
    """`split_and_merge` on arrays that have been checked, up to `most` components.

    Parameters
    ----------
    samples
        (n, d).
    """
    weights = weights / weights.sum() if rule.normalise else weights
    split_one: int | None = None
    merged: tuple[int, int] | None = None
    merge_loss, split_gain = np.inf, -np.inf
    n_components = len(components[0])
    priors, means, covariances = components
    present = _judged((priors[None], means[None], covariances[None]), samples, weights, rule)[1][0]
    if most is None or n_components < most:
        candidates, likelihoods = _judged(
            split_candidates(components, rule, rule.n_axes), samples, weights, rule
        )
        best = int(likelihoods.argmax())
        split_gain = float(likelihoods[best] - present)
        if split_gain > rule.split_threshold:
            components, present = _candidate(candidates, best), likelihoods[best]
            split_one = best % n_components
    if len(components[0]) > 1:
        pairs = np.stack(np.triu_indices(len(components[0]), 1), axis=1)
        candidates, likelihoods = _judged(
            merge_candidates(components, pairs), samples, weights, rule
        )
        best = int(likelihoods.argmax())
        merge_loss = float(present - likelihoods[best])
        if merge_loss < rule.merge_threshold:
            first, second = pairs[best].tolist()
            components, merged = _candidate(candidates, best), (first, second)
    return Adapted(components, split_one, merged, split_gain, merge_loss)


def _candidate(candidates: Components, index: int) -> Components:
    priors, means, covariances = candidates
    return priors[index], means[index], covariances[index]


def split_candidates(components: Components, rule: SplitMerge, n_axes: int) -> Components:
    """All c = k n_axes mixtures of k + 1 components with one component split along one of its
    longest axes, axis by axis.
    """
    priors, means, covariances = components
    n_components, n_dims = means.shape
    n_axes = min(n_axes, n_dims)
    (priors1, means1, covariances1), second = _halves(priors, means, covariances, rule, n_axes)
    where = np.arange(n_axes * n_components)
    which = where % n_components
    parts = []
    for part, one, other in zip(components, (priors1, means1, covariances1), second, strict=True):
        tiled = np.repeat(part[None], len(where), axis=0)
        tiled[where, which] = one
        parts.append(np.concatenate([tiled, other[:, None]], axis=1))
    return parts[0], parts[1], parts[2]


def _halves(
    priors: np.ndarray, means: np.ndarray, covariances: np.ndarray, rule: SplitMerge, n_axes: int
) -> tuple[Components, Components]:
    """The two parts into which each component would be split, axis by axis: (n_axes k, ...) each."""
    variances, axes = np.linalg.eigh(covariances)
    # a = sqrt(lambda) v (n_axes, k, d), the longest first.
    along = np.moveaxis(axes * np.sqrt(np.maximum(variances, 0.0))[:, None, :], 2, 0)[::-1][
        :n_axes
    ]
    rest = 1.0 - rule.alpha
    outer = along[..., :, None] * along[..., None, :]
    keeps1, keeps2 = rest / rule.alpha, rule.alpha / rest
    along1 = 1.0 + (rule.beta - rule.beta * rule.u**2 - 1.0) / rule.alpha
    along2 = 1.0 + (rule.beta * rule.u**2 - rule.beta - rule.u**2) / rest
    first = (
        priors * rule.alpha,
        means - np.sqrt(keeps1) * rule.u * along,
        symmetric(keeps1 * covariances + along1 * outer),
    )
    second = (
        priors * rest,
        means + np.sqrt(keeps2) * rule.u * along,
        symmetric(keeps2 * covariances + along2 * outer),
    )
    return _flat(first, along.shape), _flat(second, along.shape)


def _flat(parts: Components, shape: tuple[int, ...]) -> Components:
    """Parts with leading axes (n_axes, k), or (k,) for the priors, as (n_axes k, ...)."""
    n_axes, n_components, d = shape
    return np.tile(parts[0], n_axes), parts[1].reshape(-1, d), parts[2].reshape(-1, d, d)


def merge_candidates(components: Components, pairs: np.ndarray) -> Components:
    """Mixtures of k - 1 components, one for each of the pairs (c, 2), with that pair merged: total
    prior, mean and second moment.
    """
    priors, means, covariances = components
    shares = priors[pairs] / priors[pairs].sum(1, keepdims=True)
    step = means[pairs[:, 1]] - means[pairs[:, 0]]
    together = (
        priors[pairs].sum(1),
        means[pairs[:, 0]] + shares[:, 1:] * step,
        np.einsum("cp,cpij->cij", shares, covariances[pairs])
        + shares.prod(1)[:, None, None] * step[:, :, None] * step[:, None, :],
    )
    every = np.arange(len(priors))
    kept = np.array([every[every != second] for second in pairs[:, 1]])
    parts = []
    for part, merged in zip(components, together, strict=True):
        left = part[kept]
        left[np.arange(len(pairs)), pairs[:, 0]] = merged
        parts.append(left)
    return tuple(parts)


def _judged(
    candidates: Components, samples: np.ndarray, weights: np.ndarray, rule: SplitMerge
) -> tuple[Components, np.ndarray]:
    """Candidates after `refine` steps of EM, and their log-likelihoods (c,) (6.4)."""
    for _ in range(rule.refine):
        candidates = _em_step(candidates, samples, weights, rule.covariance_floor)
    return candidates, _shares(candidates, samples)[1] @ weights


def _shares(candidates: Components, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Responsibilities (c, k, n) and log densities (c, n) of samples (n, d)."""
    priors, means, covariances = candidates
    logs = log_normal(samples - means[:, :, None], covariances) + np.log(priors)[..., None]
    top = logs.max(axis=1, keepdims=True)
    shares = np.exp(logs - top)
    total = shares.sum(axis=1, keepdims=True)
    return shares / total, (top + np.log(total))[:, 0]


def _em_step(
    candidates: Components, samples: np.ndarray, weights: np.ndarray, floor: float
) -> Components:
    """One step of weighted EM; a component without any count keeps mean and covariance, and its
    prior becomes tiny.
    """
    counts = _shares(candidates, samples)[0] * (weights / weights.sum())
    mass = counts.sum(axis=2)
    owned = mass > np.finfo(float).tiny * 1e10
    shares = counts / np.where(owned, mass, 1.0)[..., None]
    means = np.where(owned[..., None], shares @ samples, candidates[1])
    deviations = samples - means[:, :, None]
    covariances = np.swapaxes(deviations * shares[..., None], 2, 3) @ deviations
    covariances = np.where(owned[..., None, None], covariances, candidates[2])
    priors = np.maximum(mass, np.finfo(float).tiny * 1e10)
    return (
        priors / priors.sum(axis=1, keepdims=True),
        means,
        raise_to_floor(symmetric(covariances), floor),
    )


def _require_below(value: int, name: str, bound: int) -> None:
    if as_count(value, name, 0) >= bound:
        raise ValueError(f"{name} must be below {bound}, got {value}")


def _components(mixture: GaussianMixture) -> Components:
    return mixture.priors_, mixture.means_, mixture.covariances_


def _mixture(components: Components) -> GaussianMixture:
    return GaussianMixture.from_parameters(*components)
