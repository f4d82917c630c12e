"""PoWER on the weights of a movement primitive, with state-dependent exploration (thesis 7.4, (7.14)-(7.17)).

The primitive's output is a = (theta + eps_t)' phi_t (7.14): noise on the weights, multiplied by the activations of
the basis functions over time, so that what is explored is smooth and bound to a place in the movement. T. Rueckstiess,
M. Felder and J. Schmidhuber, State-dependent exploration for policy gradient methods, ECML 2008.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.checks import as_count, as_samples
from dart_skill.policy_search._policy import GaussianPolicy, as_spread
from dart_skill.policy_search._search import Search, Settings, Told, Trial, read_returns
from dart_skill.policy_search._weights import among_best, return_weights
from dart_skill.policy_search.power import population, with_defaults

CREDITS = ("activation", "uniform")


@dataclass(frozen=True, eq=False)
class PrimitiveTrial(Trial):
    """A primitive to try: parameters (d,), d = n_basis n_dims, for `with_parameters` of a movement primitive, and the
    output (n_steps, n_dims) of (7.14). With `hold`, parameters (n_stretches, d) that follow each other.
    """

    output: np.ndarray


class PrimitivePoWER(Search):
    """Search for weights (n_basis, n_dims) of a movement primitive with activations (n_steps, n_basis), from a
    first guess and its `spread` (one number or (n_basis, n_dims)).

    A trial is told its rewards (n_steps,), which become returns to go (7.16), or one return, a number, which counts
    for all steps alike.
    hold: steps for which noise is kept; None for the whole trial (state-dependent exploration), 1 for new noise
    at every step as in (7.15), which learns far slower and shakes an arm.
    credit: how a basis shares in (7.17). "activation" weighs step t by phi_tb^2 / sum_j phi_tj^2, the diagonal of W
    of Kober and Peters (2011) for equal variances, so that a basis learns from the returns to go while it is active; "uniform" is (7.17) as
    printed, with weighting "returns" to the letter. Rewards along the whole movement are learned up to twice as fast with
    "activation"; for a few via points, either and their sum are as good (benchmarks/power.py).
    The best M are chosen by their whole return. The other options are those of `PoWER`, except that each weight has
    a variance of its own and no covariance with others, and trials that are used again are S = 2 (4 + 3 log d). For the
    full covariance, use `PoWER` on the parameters (d,).
    """

    def __init__(
        self,
        weights: ArrayLike,
        activations: ArrayLike,
        spread: ArrayLike,
        *,
        rng: np.random.Generator,
        hold: int | None = None,
        credit: str = "activation",
        exploration: str = "automatic",
        weighting: str = "rank",
        batch: int | None = None,
        best: int | None = None,
        latest: int | None = None,
        minimum_exploration: float = 0.1,
        limits: tuple[float, float] | None = None,
    ):
        start = as_samples(weights, "weights")
        self._activations = as_activations(activations, len(start))
        if credit not in CREDITS:
            raise ValueError(f"credit must be one of {CREDITS}, got {credit!r}")
        settings = with_defaults(
            start.size, exploration, weighting, batch, best, latest, minimum_exploration, limits, 2 * population(start.size)
        )
        super().__init__(settings, rng)
        self._policy = GaussianPolicy(start.ravel(), as_spread(spread, start.shape).ravel(), settings, diagonal=True)
        n_steps = len(self._activations)
        self._hold = n_steps if hold is None else min(as_count(hold, "hold"), n_steps)
        self._n_dims, self._credit = start.shape[1], credit
        self._stretches = np.arange(0, n_steps, self._hold)

    @property
    def parameters(self) -> np.ndarray:
        """Mean (d,) of the policy, basis by basis, for `with_parameters` of a movement primitive."""
        return self._policy.parameters

    @property
    def weights(self) -> np.ndarray:
        """Mean (n_basis, n_dims) of the policy."""
        return self.parameters.reshape(-1, self._n_dims)

    @property
    def spread(self) -> np.ndarray:
        """Standard deviations (n_basis, n_dims) of the next trial's noise."""
        return (self._policy.size * np.sqrt(self._policy.variances) * self._policy.scale).reshape(-1, self._n_dims)

    @property
    def exploration_size(self) -> float:
        """Largest standard deviation, in units of the spread at the start."""
        return self._policy.longest

    def maximise(self, return_function: Callable, n_trials: int, tolerance: float = 0.0) -> np.ndarray:
        """As `PoWER.maximise`, with return_function(output (n_steps, n_dims)) giving rewards (n_steps,) or a number."""
        return super().maximise(return_function, n_trials, tolerance)

    def _argument(self, trial: PrimitiveTrial) -> np.ndarray:
        return trial.output

    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        noise = self._rng.standard_normal((len(self._stretches), self._policy.start.size))  # (7.15)
        tried = self._policy.draw(noise)
        return noise, tried[0] if len(tried) == 1 else tried

    def _present(self, number: int, tried: np.ndarray) -> PrimitiveTrial:
        weights = tried.reshape(len(self._stretches), -1, self._n_dims)
        over_time = weights[np.arange(len(self._activations)) // self._hold]
        return PrimitiveTrial(number, tried, np.einsum("tb,tbd->td", self._activations, over_time))  # (7.14)

    def _read(self, outcome: ArrayLike) -> np.ndarray:
        """Returns to go (n_steps,)."""
        n_steps = len(self._activations)
        if np.ndim(outcome) == 0:
            return np.full(n_steps, read_returns(outcome, (), self.settings.weighting))
        return read_returns(returns_to_go(read_returns(outcome, (n_steps,), "rank")), (n_steps,), self.settings.weighting)

    def _update(self, told: list[Told]) -> bool:
        to_go = np.array([trial.outcome for trial in told])
        weights = self._noise_weights(weights_over_time(to_go, self.settings.best, self.settings.weighting))
        if not weights.any():
            return False
        d = self._policy.start.size
        noise, tried = (np.array([getattr(trial, name) for trial in told]).reshape(-1, d) for name in ("noise", "tried"))
        self._policy.update(noise, tried, np.repeat(weights, self._n_dims, axis=1))
        return True

    def _noise_weights(self, over_time: np.ndarray) -> np.ndarray:
        """Weights (n_trials n_stretches, n_basis) of each noise in (7.17), from weights (n_trials, n_steps); for each
        basis they sum to one, or are zero when nothing is known about it.
        """
        by_basis = over_time[:, :, None] * self._credits()
        weights = np.add.reduceat(by_basis, self._stretches, axis=1).reshape(-1, by_basis.shape[2])
        total = weights.sum(axis=0)
        return weights / np.where(total > 0, total, 1.0)

    def _credits(self) -> np.ndarray:
        """Part (n_steps, n_basis) that each basis has in a step."""
        if self._credit == "uniform":
            return np.ones(self._activations.shape)
        power = self._activations**2
        total = power.sum(axis=1, keepdims=True)
        return power / np.where(total > 0, total, 1.0)

    def _policy_state(self) -> dict:
        choices = {"n_dims": self._n_dims, "hold": self._hold, "credit": self._credit, "activations": self._activations.tolist()}
        return {**choices, **self._policy.state()}

    @classmethod
    def _from_policy_state(cls, state: dict, settings: Settings, rng: np.random.Generator) -> PrimitivePoWER:
        start, scale = (np.reshape(state[name], (-1, state["n_dims"])) for name in ("start", "scale"))
        choices = {name: state[name] for name in ("activations", "hold", "credit")}
        search = cls(start, spread=scale, rng=rng, **choices, **vars(settings))
        search._policy.restore(state)
        return search


def as_activations(activations: ArrayLike, n_basis: int) -> np.ndarray:
    activations = as_samples(activations, "activations", n_basis)
    active = activations.any(axis=0)
    if not active.all():
        raise ValueError(f"activations are zero at all times for basis {int(active.argmin())}; leave out basis functions that do nothing")
    return activations


def returns_to_go(rewards: np.ndarray) -> np.ndarray:
    """(7.16): at each step the sum of the rewards (n_steps,) from there on."""
    return np.cumsum(rewards[::-1])[::-1]


def weights_over_time(to_go: np.ndarray, best: int, weighting: str) -> np.ndarray:
    """Weights (n_trials, n_steps) from returns to go of that shape, for the `best` trials by whole return, which is the
    first. A step after which all earn the same has none, save with "returns", which takes Q of (7.17) as it is.
    """
    chosen = among_best(to_go[:, 0], best)
    if weighting == "returns":
        return chosen[:, None] * to_go
    weights = np.zeros(to_go.shape)
    weights[chosen > 0] = return_weights(to_go[chosen > 0], int((chosen > 0).sum()), weighting)
    return weights
