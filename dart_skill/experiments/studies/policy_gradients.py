"""Policy gradients (thesis 4.2) as searches: what PoWER was proposed against. They need a learning
rate.

The policy is N(mean, diag(sigma^2)), each parameter with a standard deviation of its own. What is
learned, theta (p,), is mean and log sigma in units of the spread at the start. A trial is mean +
sigma eps with noise eps ~ N(0, I), so

    scores    d log p / d mean = eps / sigma,    d log p / d log sigma = eps^2 - 1                                          (G4)
    F = diag(1 / sigma^2, 2)                                                                                                (G5)

The direction D is the gradient (G1) or the natural gradient (G3). With a learning rate a the step
is one of

    "normalised"    a D / sqrt(D' F D)    a KL divergence of about a^2 / 2, in whatever unit the return is                  (G6)
    "plain"         a D                   with a in the unit of theta^2 per return for (G1), and one per return for (G3)    (G7)

A step of constant length is that of N. Kohl and P. Stone, Policy gradient reinforcement learning
for fast quadrupedal locomotion, ICRA 2004; its length is measured as by J. Bagnell and J.
Schneider, Covariant policy search, IJCAI 2003.

    search = Reinforce(parameters, spread, rng=rng)
    for trial in search.trials(3000):
        search.tell(trial, throw(trial.parameters))

Gradients of the expected return of a policy from trials (thesis 4.2): REINFORCE and the
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

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_number, as_samples, as_vector
from dart_skill.experiments.studies.baselines import LIMITS
from dart_skill.policy_search import SearchSettings, ToldTrial, VectorSearch

NOTHING = 1e-12
"""Share of the squared scores of all trials below which the others say nothing about a baseline."""


def optimal_baseline(scores: ArrayLike, returns: ArrayLike) -> np.ndarray:
    """The constant (p,), in the unit of the returns, with which each element of the gradient has
    the least variance: (G2).

    Parameters
    ----------
    scores : (n, p)
        Psi, in one over the units of the policy's parameters.
    returns : (n,)
        Of any sign.

    Raises
    ------
    ValueError
        For values that are not finite, and for a number of returns that is not that of the scores.
    """
    scores, returns = _read(scores, returns, 1)
    squares, middle = np.square(scores), returns.mean()
    total = squares.sum(axis=0)
    return middle + (returns - middle) @ squares / np.where(total > 0, total, 1.0)


def reinforce_gradient(scores: ArrayLike, returns: ArrayLike) -> np.ndarray:
    """Unbiased gradient (p,) of the expected return by REINFORCE: (G1) with the optimal baseline
    (G2).

    Parameters
    ----------
    scores : (n, p)
        Psi, in one over the units of the policy's parameters, of n independent trials, at least 2.
    returns : (n,)
        Of any sign.

    Raises
    ------
    ValueError
        As `optimal_baseline`, and for less than 2 trials.
    """
    scores, returns = _read(scores, returns, 2)
    # changes nothing but rounding: the baseline moves along
    centred = (returns - returns.mean())[:, None]
    squares = np.square(scores)
    total = squares.sum(axis=0)
    others = total - squares
    informed = others > NOTHING * total
    known = np.where(informed, (squares * centred).sum(axis=0) - squares * centred, 0.0)
    return np.mean(scores * (centred - known / np.where(informed, others, 1.0)), axis=0)


def natural_gradient(
    scores: ArrayLike, returns: ArrayLike, fisher: ArrayLike, ridge: float = 0.0
) -> tuple[np.ndarray, float]:
    """Natural gradient (p,) of the expected return, and the baseline J, by the regression (G3).

    Parameters
    ----------
    scores : (n, p)
        Psi, in one over the units of the policy's parameters, of n trials, at least p + 1.
    returns : (n,)
        Of any sign.
    fisher : (p, p)
        Fisher information of the policy, symmetric and positive definite.
    ridge
        Float, default 0. Weight of the penalty w' F w. Small values matter only when n is hardly
        above p + 1.

    Raises
    ------
    ValueError
        As `optimal_baseline`, and for less than p + 1 trials.
    """
    p = as_samples(scores, "scores").shape[1]
    scores, returns = _read(scores, returns, p + 1)
    root, n = np.linalg.cholesky(as_samples(fisher, "fisher", p)), len(returns)
    white = np.linalg.solve(root, scores.T).T
    middle, mean = white.mean(axis=0), returns.mean()
    rows = np.vstack([(white - middle) / np.sqrt(n), np.sqrt(ridge) * np.eye(p)])
    wanted = np.append((returns - mean) / np.sqrt(n), np.zeros(p))
    weights = np.linalg.lstsq(rows, wanted, rcond=None)[0]
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


EXPLORATIONS = ("automatic", "fixed")
"""Whether log sigma is learned by the same gradient, or sigma is kept."""
STEPS = ("normalised", "plain")
"""Steps (G6) and (G7)."""


class Reinforce(VectorSearch):
    """Episodic REINFORCE (G1) with the optimal baseline (G2) of each element of the gradient.

    The gradient depends on the units of theta, and its variance grows as the exploration shrinks.
    docs/policy_gradients.md shows what this costs; benchmarks/power.py --gradients measures it.

    `tell` raises ValueError when a plain step leaves all numbers.

    Parameters
    ----------
    parameters : (d,)
        First guess, the mean of the first policy.
    spread
        One number or (d,). Standard deviations of the first trials.
    rng
        Numpy Generator.
    learning_rate
        Float, default 0.3. a of (G6) and (G7).
    step
        "normalised" (default) or "plain".
    exploration
        "automatic" (default) learns log sigma by the same gradient; "fixed" keeps sigma.
    batch
        Int, number of returns between updates, each of which is used once; default None: 2 (p +
        1), p = 2 d, or d with "fixed". At least 2.
    limits : (2,)
        Smallest and largest sigma, relative to `spread`; default 1e-8 and 1e4. Without a floor the
        exploration may vanish before the search has arrived.
    """

    def __init__(
        self,
        parameters: ArrayLike,
        spread: ArrayLike,
        *,
        rng: np.random.Generator,
        learning_rate: float = 0.3,
        step: str = "normalised",
        exploration: str = "automatic",
        batch: int | None = None,
        limits: tuple[float, float] = LIMITS,
    ):
        for name, value, choices in (
            ("exploration", exploration, EXPLORATIONS),
            ("step", step, STEPS),
        ):
            if value not in choices:
                raise ValueError(f"{name} must be one of {choices}, got {value!r}")
        self._learning_rate, self._step = as_number(learning_rate, "learning_rate"), step
        p = np.size(parameters) * (2 if exploration == "automatic" else 1)
        batch = 2 * (p + 1) if batch is None else as_count(batch, "batch")
        if batch < self._least(p):
            raise ValueError(
                f"batch is {batch}, but {p} elements of a gradient need at least {self._least(p)}"
                " trials: raise it"
            )
        low, high = as_vector(limits, "limits", 2).tolist()
        settings = SearchSettings(exploration, "rank", batch, batch, batch, 0.0, (low, high))
        super().__init__(parameters, spread, settings, rng)
        self._n_elements = p
        self._mean, self._sigma = np.zeros(self._start.size), np.ones(self._start.size)

    def _least(self, p: int) -> int:
        """Least number of trials from which p elements of a gradient can be estimated."""
        return 2

    def _direction(
        self, scores: np.ndarray, returns: np.ndarray, fisher: np.ndarray
    ) -> np.ndarray:
        """Direction (p,) of the step from scores (n, p), returns (n,) and the diagonal (p,) of the
        Fisher information.
        """
        return reinforce_gradient(scores, returns)

    @property
    def parameters(self) -> np.ndarray:
        """Mean (d,) of the policy."""
        return self._start + self._scale * self._mean

    @property
    def spread(self) -> np.ndarray:
        """Standard deviations (d,) of the next trial."""
        return self._scale * self._sigma

    @property
    def exploration_size(self) -> float:
        """Largest standard deviation, in units of the spread at the start."""
        return float(self._sigma.max())

    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        noise = self._rng.standard_normal(self._start.size)
        return noise, self._start + self._scale * (self._mean + self._sigma * noise)

    def _update(self, told: list[ToldTrial]) -> bool:
        returns = np.array([float(trial.outcome) for trial in told])
        if returns.min() == returns.max():
            return False
        if self._step == "normalised":
            returns = returns / np.abs(returns).max()  # so that no square overflows
        # (G4), (G5); a trial that was asked before the last update counts with its noise of then
        noise, d = np.array([trial.noise for trial in told]), self._start.size
        scores = np.hstack([noise / self._sigma, noise**2 - 1])[:, : self._n_elements]
        fisher = np.append(1 / self._sigma**2, np.full(d, 2.0))[: self._n_elements]
        with np.errstate(over="ignore", invalid="ignore"):  # what comes of it is refused
            direction, length = self._direction(scores, returns, fisher), self._learning_rate
            if self._step == "normalised":
                size = max(np.abs(direction).max(), 1e-300)
                length /= size * max(np.sqrt(fisher @ (direction / size) ** 2), 1e-300)
            step = length * direction
        mean = self._mean + step[:d]
        if not np.isfinite(step).all() or not np.isfinite(self._start + self._scale * mean).all():
            raise ValueError(
                f"the step of update {self.n_updates} is {step.tolist()} with learning_rate"
                f" {self._learning_rate:g}, and leaves all numbers: lower it for returns of this"
                " size, or choose step 'normalised'"
            )
        self._mean = mean
        low, high = self.settings.limits
        if len(step) > d:
            # No step changes log sigma by more than the distance of the limits, so exp does not
            # overflow.
            growth = np.exp(np.clip(step[d:], -np.log(high / low), np.log(high / low)))
            self._sigma = np.clip(self._sigma * growth, low, high)
        return bool(step.any())


class EpisodicNaturalActorCritic(Reinforce):
    """Episodic natural actor-critic: steps along the natural gradient, by the regression (G3).

    `tell` raises ValueError when a plain step leaves all numbers.

    Parameters
    ----------
    parameters, spread, rng, learning_rate, step, exploration, limits
        As in `Reinforce`.
    batch
        Int, as in `Reinforce`, but at least p + 1, the number of unknowns of the regression.
    ridge
        Float, default 0.01. Weight of the penalty w' F w in (G3).
    """

    def __init__(
        self,
        parameters: ArrayLike,
        spread: ArrayLike,
        *,
        rng: np.random.Generator,
        ridge: float = 0.01,
        **options: Any,
    ):
        self._ridge = as_number(ridge, "ridge", strict=False)
        super().__init__(parameters, spread, rng=rng, **options)

    def _least(self, p: int) -> int:
        return p + 1

    def _direction(
        self, scores: np.ndarray, returns: np.ndarray, fisher: np.ndarray
    ) -> np.ndarray:
        return natural_gradient(scores, returns, np.diag(fisher), self._ridge)[0]
