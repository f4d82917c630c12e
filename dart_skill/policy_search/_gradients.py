"""Gradients of the expected return of a policy from trials (thesis 4.2): REINFORCE and the
episodic natural actor-critic.

With the score psi_k (p,) of trial k, the derivative of the log-probability of what was tried by
the parameters of the policy:

    g_h = mean_k psi_kh (R_k - b_kh)                                                                                        (G1)
    b_kh = sum_j psi_jh^2 R_j / sum_j psi_jh^2        over all trials but k                                                 (G2)
    (w, J) = argmin mean_k (R_k - J - w' psi_k)^2 + ridge w' F w                                                            (G3)

(G1) is REINFORCE (R. Williams, Machine Learning 8, 1992). Of all constant baselines (G2), over all
trials, gives the gradient the least variance (J. Peters and S. Schaal, Reinforcement learning of
motor skills with policy gradients, Neural Networks 21, 2008). Trial k is left out here because a
baseline that depends on its return makes (G1) biased. (G3) is the episodic natural actor-critic
(J. Peters and S. Schaal, Natural actor-critic, Neurocomputing 71, 2008): the weights of the
compatible function approximation are the natural gradient F^-1 g, with F = E[psi psi'], the Fisher
information. F in the ridge keeps the result independent of the parametrisation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_number, as_samples, as_vector

# share of the squared scores of all trials below which the others say nothing about a baseline
NOTHING = 1e-12


def optimal_baseline(scores: ArrayLike, returns: ArrayLike) -> np.ndarray:
    """The constant (p,), in the unit of the returns, with which each element of the gradient has
    the least variance: (G2).

    Parameters:

    * scores (n, p): psi, in one over the units of the policy's parameters.
    * returns (n,): of any sign.

    Raises ValueError for values that are not finite, and for a number of returns that is not that
    of the scores.
    """
    scores, returns = _read(scores, returns, 1)
    squares = np.square(scores)
    total = squares.sum(axis=0)
    middle = returns.mean()
    return middle + (returns - middle) @ squares / np.where(total > 0, total, 1.0)


def reinforce_gradient(scores: ArrayLike, returns: ArrayLike) -> np.ndarray:
    """Unbiased gradient (p,) of the expected return by REINFORCE: (G1) with the optimal baseline
    (G2).

    Parameters:

    * scores (n, p): psi, in one over the units of the policy's parameters, of n independent
      trials, at least 2.
    * returns (n,): of any sign.

    Raises ValueError as `optimal_baseline`, and for less than 2 trials.
    """
    scores, returns = _read(scores, returns, 2)
    centred = (returns - returns.mean())[
        :, None
    ]  # changes nothing but rounding: the baseline moves along
    squares = np.square(scores)
    total = squares.sum(axis=0)
    others = total - squares
    informed = others > NOTHING * total
    baselines = np.where(
        informed, (squares * centred).sum(axis=0) - squares * centred, 0.0
    ) / np.where(informed, others, 1.0)
    return np.mean(scores * (centred - baselines), axis=0)


def natural_gradient(
    scores: ArrayLike, returns: ArrayLike, fisher: ArrayLike, ridge: float = 0.0
) -> tuple[np.ndarray, float]:
    """Natural gradient (p,) of the expected return, and the baseline J, by the regression (G3).

    Parameters:

    * scores (n, p): psi, in one over the units of the policy's parameters, of n trials, at least p
      + 1.
    * returns (n,): of any sign.
    * fisher (p, p): Fisher information of the policy.
    * ridge: float, default 0. Weight of the penalty w' F w. Small values matter only when n is
      hardly above p + 1.

    Raises ValueError as `optimal_baseline`, for less than p + 1 trials, and for a Fisher
    information that is not positive.
    """
    scores = as_samples(scores, "scores")
    n, p = scores.shape
    scores, returns = _read(scores, returns, p + 1)
    ridge, root = as_number(ridge, "ridge", strict=False), _root(fisher, p)
    white = np.linalg.solve(root, scores.T).T
    middle, mean = white.mean(axis=0), returns.mean()
    penalised = np.vstack([(white - middle) / np.sqrt(n), np.sqrt(ridge) * np.eye(p)])
    weights = np.linalg.lstsq(
        penalised, np.append((returns - mean) / np.sqrt(n), np.zeros(p)), rcond=None
    )[0]
    return np.linalg.solve(root.T, weights), float(mean - middle @ weights)


def _read(scores: ArrayLike, returns: ArrayLike, least: int) -> tuple[np.ndarray, np.ndarray]:
    scores = as_samples(scores, "scores")
    returns = as_vector(returns, "returns", len(scores))
    if len(returns) < least:
        needed = (
            f"{scores.shape[1]} elements of a gradient need at least {least}: make more trials"
        )
        raise ValueError(f"scores has {len(returns)} rows, one per trial, but {needed}")
    return scores, returns


def _root(fisher: ArrayLike, p: int) -> np.ndarray:
    """Lower triangular L (p, p) with L L' = F."""
    fisher = as_samples(fisher, "fisher", p)
    try:
        return np.linalg.cholesky(fisher)
    except np.linalg.LinAlgError:
        reason = (
            "must be a symmetric matrix with positive eigenvalues: give that of the policy,"
            " without parameters that do nothing"
        )
        raise ValueError(f"fisher, shape {fisher.shape}, {reason}") from None
