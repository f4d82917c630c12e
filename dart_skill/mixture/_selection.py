"""Number of components of a mixture, by the Bayesian information criterion or by cross-validation
(thesis 3.2.2).

Both return the scores of all numbers that were tried. If they differ little, the number hardly
matters.

Cross-validation compares average log-likelihoods of weighted data. Here they are in closed form
(6.4), and of data resampled by their weights (6.3), which approaches the first as more samples are
drawn (figure 6.5). In the first line of (6.4) the weights are exponents inside the sum. Its second
line is meant: the sum of weights times logarithms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_samples, as_vector, as_weights
from dart_skill.mixture._mixture import GaussianMixture


def mean_log_likelihood(
    mixture: GaussianMixture, samples: ArrayLike, weights: ArrayLike | None = None
) -> float:
    """(6.4): sum of w_n log P(x_n) over samples (n, d); the weights (n,) are scaled to sum one,
    and are equal when None.

    Parameters
    ----------
    mixture
        That gives P.
    """
    log_density = mixture.log_density(samples)
    weights = as_weights(weights, len(log_density))
    return float(weights / weights.sum() @ log_density)


def resampled_mean_log_likelihood(
    mixture: GaussianMixture,
    samples: ArrayLike,
    weights: ArrayLike,
    n_drawn: int,
    rng: np.random.Generator,
) -> float:
    """(6.3): mean of log P over n_drawn of the samples (n, d), drawn by stochastic universal
    sampling with weights (n,).

    Parameters
    ----------
    mixture
        That gives P.
    """
    log_density = mixture.log_density(samples)
    drawn = stochastic_universal_sampling(as_weights(weights, len(log_density)), n_drawn, rng)
    return float(log_density[drawn].mean())


def stochastic_universal_sampling(
    weights: ArrayLike, n_drawn: int, rng: np.random.Generator
) -> np.ndarray:
    """Indices (n_drawn,), ascending, drawn with probabilities proportional to the weights (n,)
    (figure 6.4).

    The weights are laid end to end. Pointers at equal distances, the first one at random, choose
    the indices. An index with the share p of all weight is drawn floor(p n_drawn) or ceil(p
    n_drawn) times, and p n_drawn times on average. (J. E. Baker, Reducing bias and inefficiency in
    the selection algorithm, ICGA 1987.) ValueError for no weights.
    """
    weights = as_vector(weights, "weights")
    if weights.size == 0:
        raise ValueError("weights is empty; there is nothing to draw from")
    weights, n_drawn = as_weights(weights, len(weights)), as_count(n_drawn, "n_drawn", 0)
    # Ends of the weights in units of the pointers' distance: n_drawn equal weights end at whole
    # numbers.
    ends = np.cumsum(weights / weights.max())
    ends *= n_drawn / ends[-1]
    drawn = np.searchsorted(ends, np.arange(n_drawn) + rng.random(), side="right")
    return np.minimum(drawn, int(np.flatnonzero(weights)[-1]))


@dataclass(frozen=True, eq=False)
class Selection:
    """Result of a selection among C numbers of components.

    Parameters
    ----------
    n_components : (C,)
        The numbers that were tried, ascending.
    scores : (C,)
        Lower is better.
    standard_errors : (C,)
        Of the scores; zero where there is no estimate (BIC).
    mixture
        GaussianMixture with the best number, fitted to all samples.
    """

    n_components: np.ndarray
    scores: np.ndarray
    standard_errors: np.ndarray
    mixture: GaussianMixture

    @property
    def best(self) -> int:
        """The number with the lowest score; the smaller one wins a tie."""
        return int(self.n_components[self.scores.argmin()])

    @property
    def simplest_within_error(self) -> int:
        """The smallest number whose score is within one standard error of the best."""
        lowest = self.scores.argmin()
        return int(
            self.n_components[
                self.scores <= self.scores[lowest] + self.standard_errors[lowest]
            ].min()
        )


def best_number(candidates: Sequence[int], score: Callable[[int], float]) -> int:
    """The number of components whose score is lowest, the first one of equals.

    Parameters
    ----------
    candidates
        Numbers of components.
    score
        Gives that of one.

    Raises
    ------
    ValueError
        If no score is finite.
    """
    scores = np.array([score(candidate) for candidate in candidates], dtype=float)
    scores[~np.isfinite(scores)] = np.inf
    if np.isinf(scores).all():
        raise ValueError(
            f"no model with {', '.join(map(str, candidates))} components can be scored"
        )
    return candidates[int(scores.argmin())]


def select_by_bic(
    samples: ArrayLike,
    n_components: Sequence[int],
    weights: ArrayLike | None = None,
    *,
    rng: np.random.Generator,
    **options: Any,
) -> Selection:
    """Fit a mixture with each number of components to samples (n, d) with weights (n,), and score
    it by BIC.

    In the BIC the sum of the weights counts as the number of samples.

    Parameters
    ----------
    options
        Hyper-parameters of `GaussianMixture`.
    """
    candidates = _as_candidates(n_components)
    samples, weights = _with_weight(samples, weights)
    mixtures = [GaussianMixture(k, **options).fit(samples, weights, rng=rng) for k in candidates]
    scores = np.array([mixture.bic(samples, weights) for mixture in mixtures])
    return Selection(candidates, scores, np.zeros(len(scores)), mixtures[int(scores.argmin())])


def select_by_cross_validation(
    samples: ArrayLike,
    n_components: Sequence[int],
    weights: ArrayLike | None = None,
    *,
    groups: ArrayLike | None = None,
    n_folds: int = 5,
    rng: np.random.Generator,
    **options: Any,
) -> Selection:
    """Score each number of components by the weighted mean of the negative log density of samples
    that were left out.

    Parameters
    ----------
    groups : (n,)
        Samples with the same label are left out together; each sample is a group by default. Use
        the number of the demonstration: otherwise the neighbours in time of a sample that is left
        out show the fit where it is. If there are no more groups than n_folds, each group is left
        out once.
    options
        Hyper-parameters of `GaussianMixture`.
    n_folds
        Parts of the samples that are left out in turn, default 5.

    Raises
    ------
    ValueError
        For groups of another shape.
    """
    candidates, n_folds = _as_candidates(n_components), as_count(n_folds, "n_folds", 2)
    counted = as_weights(weights, len(as_samples(samples, "samples"))) > 0
    groups = np.arange(len(counted)) if groups is None else np.asarray(groups)
    if groups.shape != counted.shape:
        raise ValueError(
            f"groups must have shape {counted.shape}, one label per sample, got {groups.shape}"
        )
    samples, weights = _with_weight(samples, weights)
    folds = _folds(groups[counted], n_folds, rng)
    scores = np.array(
        [
            [
                _left_out_score(samples, weights, folds == f, k, rng, options)
                for f in range(folds.max() + 1)
            ]
            for k in candidates
        ]
    )
    shares = np.bincount(folds, weights=weights) / weights.sum()
    means = scores @ shares
    errors = np.sqrt(np.square(scores - means[:, None]) @ shares / (len(shares) - 1))
    best = GaussianMixture(int(candidates[means.argmin()]), **options).fit(
        samples, weights, rng=rng
    )
    return Selection(candidates, means, errors, best)


def _as_candidates(n_components: Sequence[int]) -> np.ndarray:
    candidates = sorted({as_count(k, "n_components") for k in n_components})
    if not candidates:
        raise ValueError("n_components is empty; name at least one number to try")
    return np.array(candidates)


def _with_weight(samples: ArrayLike, weights: ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
    samples = as_samples(samples, "samples")
    weights = as_weights(weights, len(samples))
    return samples[weights > 0], weights[weights > 0]


def _folds(groups: np.ndarray, n_folds: int, rng: np.random.Generator) -> np.ndarray:
    """Fold (n,) of each sample: the groups are distributed over the folds in random order."""
    labels, members = np.unique(groups, return_inverse=True)
    if len(labels) < 2:
        raise ValueError(
            "cross-validation needs at least two groups of samples with weight, got one"
        )
    return (rng.permutation(len(labels)) % n_folds)[members.ravel()]


def _left_out_score(
    samples: np.ndarray,
    weights: np.ndarray,
    left_out: np.ndarray,
    n_components: int,
    rng: np.random.Generator,
    options: dict,
) -> float:
    mixture = GaussianMixture(int(n_components), **options).fit(
        samples[~left_out], weights[~left_out], rng=rng
    )
    return float(-np.average(mixture.log_density(samples[left_out]), weights=weights[left_out]))
