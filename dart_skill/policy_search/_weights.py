"""How returns become the weights of (5.1), (5.2) and (7.17).

PoWER takes returns for improper probabilities. Only "returns" does so to the letter; it needs returns that are
not negative, and depends on where their zero lies. The others hold for any sign:

    "returns"      w = r                                             unchanged by r -> a r, a > 0
    "exponential"  w = exp(-10 (r_max - r) / (r_max - r_min))        unchanged by r -> a r + b, a > 0
    "rank"         w = log(M + 1/2) - log(rank)                      unchanged by any increasing function of r

"exponential" is the weighting of PI2 with its constant 10 (E. Theodorou, J. Buchli and S. Schaal, A generalized path
integral control approach to reinforcement learning, JMLR 11, 2010), r_min the worst of the M best; "rank" that of
CMA-ES (N. Hansen and A. Ostermeier, Evolutionary Computation 9(2), 2001).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.checks import as_count, as_finite

CONTRAST = 10.0  # "exponential": the worst of the best M weighs exp(-10) of the best


def check_weighting(weighting: str) -> None:
    if weighting not in WEIGHTINGS:
        raise ValueError(f"weighting must be one of {tuple(WEIGHTINGS)}, got {weighting!r}")


def return_weights(returns: ArrayLike, best: int, weighting: str = "rank") -> np.ndarray:
    """Weights (n,) or (n, n_steps) of returns of that shape, zero beyond the `best` M of the n; over n they sum to one.

    Equal returns get equal weights, also across the limit of the best, so that the order of trials does not
    matter. All zeros where there is nothing to prefer: "rank" and "exponential" when all returns are equal, "returns"
    when all are zero.
    """
    returns = as_finite(returns, "returns")
    if returns.ndim not in (1, 2):
        raise ValueError(f"returns must have shape (n,) or (n, n_steps), got {returns.shape}")
    check_weighting(weighting)
    best = min(as_count(best, "best"), len(returns))
    if returns.size == 0:
        return np.zeros(returns.shape)
    if weighting == "returns" and returns.min() < 0:
        raise ValueError(f"returns holds {returns.min():g}; weighting 'returns' needs returns of at least 0, use 'rank' or 'exponential'")
    weights = WEIGHTINGS[weighting](returns, best)
    total = weights.sum(axis=0)
    return weights / np.where(total > 0, total, 1.0)


def among_best(returns: np.ndarray, best: int) -> np.ndarray:
    """Part (n, ...) of each trial that is among the `best` M: 1 or 0, in between for equals that share the last places."""
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
    weights = among_best(returns, best) * np.exp(-CONTRAST * np.minimum((highest - returns) / reach, 1.0))
    return np.where(_differ(returns), weights, 0.0)


def _by_return(returns: np.ndarray, best: int) -> np.ndarray:
    return among_best(returns, best) * _scaled(returns)


WEIGHTINGS = {"rank": _by_rank, "exponential": _by_exponential, "returns": _by_return}


def _differ(returns: np.ndarray) -> np.ndarray:
    return returns.max(axis=0) > returns.min(axis=0)


def _scaled(returns: np.ndarray) -> np.ndarray:
    """Returns within (-1, 1), so that sums and differences of them are finite."""
    size = np.abs(returns).max(axis=0)
    return returns / np.where(size > 0, size, 1.0)


def _standing(returns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How many trials earned more than each, and how many the same, itself included."""
    others, own = returns[None], returns[:, None]
    return (others > own).sum(axis=1), (others == own).sum(axis=1)
