"""Weights of (5.1), (5.2) and (7.17) from the returns.

PoWER treats returns as improper probabilities. Only "returns" does so literally. It needs returns
that are not negative, and its result depends on where the zero of the returns is. The other two
allow any sign:

    "returns"      w = r                                             unchanged by r -> a r, a > 0
    "exponential"  w = exp(-10 (r_max - r) / (r_max - r_min))        unchanged by r -> a r + b, a > 0
    "rank"         w = log(M + 1/2) - log(rank)                      unchanged by any increasing function of r

"exponential" is the weighting of PI2 with its constant 10 (E. Theodorou, J. Buchli and S. Schaal,
A generalized path integral control approach to reinforcement learning, JMLR 11, 2010); r_min is
the lowest return of the M best. "rank" is the weighting of CMA-ES (N. Hansen and A. Ostermeier,
Evolutionary Computation 9(2), 2001).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_finite

CONTRAST = 10.0
"""Exponent of "exponential": the worst of the best M has exp(-10) times the weight of the best."""


def check_weighting(weighting: str) -> None:
    if weighting not in WEIGHTINGS:
        raise ValueError(f"weighting must be one of {tuple(WEIGHTINGS)}, got {weighting!r}")


def return_weights(returns: ArrayLike, best: int, weighting: str = "rank") -> np.ndarray:
    """Weights (n,) or (n, n_steps) from returns of that shape; they sum to one over the n trials.

    Only the `best` M trials have a weight; the others have zero. Equal returns get equal weights,
    also if only some of them are among the best M, so that the order of the trials does not
    matter. The weights are all zero if no trial is better than another: with "rank" and
    "exponential" if all returns are equal, with "returns" if all are zero.

    Parameters
    ----------
    weighting
        "rank", "returns" or "exponential".

    Raises
    ------
    ValueError
        For another shape, or for returns that it does not allow.
    """
    returns = as_finite(returns, "returns")
    if returns.ndim not in (1, 2):
        raise ValueError(f"returns must have shape (n,) or (n, n_steps), got {returns.shape}")
    check_weighting(weighting)
    best = min(as_count(best, "best"), len(returns))
    if returns.size == 0:
        return np.zeros(returns.shape)
    if weighting == "returns" and returns.min() < 0:
        raise ValueError(
            f"returns holds {returns.min():g}; weighting 'returns' needs returns of at least 0,"
            " use 'rank' or 'exponential'"
        )
    weights = WEIGHTINGS[weighting](returns, best)
    total = weights.sum(axis=0)
    return weights / np.where(total > 0, total, 1.0)


def among_best(returns: np.ndarray, best: int) -> np.ndarray:
    """Whether each trial (n, ...) is among the `best` M: 1 or 0; a fraction for equal returns that
    share the last places.
    """
    greater, equal = _standing(returns)
    return np.clip(best - greater, 0, equal) / equal


def _by_rank(returns: np.ndarray, best: int) -> np.ndarray:
    profile = np.zeros(len(returns))
    profile[:best] = np.log(best + 0.5) - np.log(np.arange(1, best + 1))
    up_to = np.append(0.0, np.cumsum(profile))
    greater, equal = _standing(returns)
    return np.where(_differ(returns), (up_to[greater + equal] - up_to[greater]) / equal, 0.0)


def _by_exponential(returns: np.ndarray, best: int) -> np.ndarray:
    returns = _scaled(returns)
    highest, lowest = returns.max(axis=0), -np.sort(-returns, axis=0)[best - 1]
    reach = np.where(highest > lowest, highest - lowest, 1.0)
    weights = among_best(returns, best) * np.exp(
        -CONTRAST * np.minimum((highest - returns) / reach, 1.0)
    )
    return np.where(_differ(returns), weights, 0.0)


def _by_return(returns: np.ndarray, best: int) -> np.ndarray:
    return among_best(returns, best) * _scaled(returns)


WEIGHTINGS = {"rank": _by_rank, "exponential": _by_exponential, "returns": _by_return}


def _differ(returns: np.ndarray) -> np.ndarray:
    return returns.max(axis=0) > returns.min(axis=0)


def _scaled(returns: np.ndarray) -> np.ndarray:
    """Returns divided by the largest magnitude, so that their sums and differences are finite."""
    size = np.abs(returns).max(axis=0)
    return returns / np.where(size > 0, size, 1.0)


def _standing(returns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each trial, the number of trials with a higher return, and with the same return, itself
    included.
    """
    others, own = returns[None], returns[:, None]
    return (others > own).sum(axis=1), (others == own).sum(axis=1)
