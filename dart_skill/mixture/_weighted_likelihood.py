"""Average log-likelihood of weighted data: in closed form (thesis (6.4)), and of data resampled by
their weights (6.3).

The second approaches the first as more samples are drawn (figure 6.5). In the first line of (6.4)
the weights are exponents inside the sum. Its second line is meant: the sum of weights times
logarithms.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_vector, as_weights
from dart_skill.mixture._mixture import GaussianMixture


def mean_log_likelihood(
    mixture: GaussianMixture, samples: ArrayLike, weights: ArrayLike | None = None
) -> float:
    """(6.4): sum of w_n log P(x_n) over samples (n, d); the weights (n,) are scaled to sum one,
    and are equal when None.

    mixture: that gives P.
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

    mixture: that gives P.
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
