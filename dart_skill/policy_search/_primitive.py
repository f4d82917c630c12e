"""PoWER on the weights of a movement primitive, with state-dependent exploration (thesis 7.4,
(7.14)-(7.17)).

The output of the primitive is a = (theta + eps_t)' phi_t (7.14). The noise eps_t is added to the
weights and multiplied by the activations of the basis functions over time. So the exploration is
smooth, and each weight explores only its part of the movement. T. Rueckstiess, M. Felder and J.
Schmidhuber, State-dependent exploration for policy gradient methods, ECML 2008.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_samples
from dart_skill.policy_search._policy import GaussianPolicy
from dart_skill.policy_search._power import population, with_defaults
from dart_skill.policy_search._search import (
    Search,
    SearchSettings,
    SearchTrial,
    ToldTrial,
    as_spread,
    read_returns,
)
from dart_skill.policy_search._weights import among_best, return_weights

CREDITS = ("activation", "uniform")


@dataclass(frozen=True, eq=False)
class PrimitiveTrial(SearchTrial):
    """A primitive to try.

    Parameters
    ----------
    parameters : (d,)
        d = n_basis n_dims: for `with_parameters` of a movement primitive.
    output : (n_steps, n_dims)
        (7.14). With `hold` the parameters are (n_stretches, d), one row for each stretch of `hold`
        steps.
    number
        Counts from 0.
    """

    output: np.ndarray


class PrimitivePoWER(Search):
    """Search for the weights of a movement primitive, by PoWER with state-dependent exploration
    (7.14)-(7.17).

    The outcome of a trial is its rewards (n_steps,), which become returns to go (7.16), or one
    number, a return that counts for all steps alike. The best M trials are chosen by their whole
    return. Each weight has a variance of its own and no covariance with others; for the full
    covariance use `PoWER` on the parameters (d,), d = n_basis n_dims.

    Parameters
    ----------
    weights : (n_basis, n_dims)
        First guess.
    activations : (n_steps, n_basis)
        Of the primitive, phi of (7.14).
    spread
        One number or (n_basis, n_dims). Standard deviations of the first trials.
    rng
        Numpy Generator.
    hold
        Int, number of steps with the same noise; default None: the whole trial (state-dependent
        exploration). 1 is new noise at every step as in (7.15), which learns much more slowly and
        shakes an arm.
    credit
        How steps count for a basis in (7.17). "activation" (default): step t counts phi_tb^2 /
        sum_j phi_tj^2, the diagonal of W of Kober and Peters (2011) for equal variances, so that a
        basis learns from the returns to go while it is active. "uniform": (7.17) as printed; with
        weighting "returns", literally. With rewards along the whole movement "activation" learns
        up to twice as fast; for a few via points both are equally good (benchmarks/power.py).
    exploration, weighting, batch, best, latest, minimum_exploration, limits
        As in `PoWER`, but latest is 2 (4 + 3 log d) by default if trials are used several times.
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
            start.size,
            exploration,
            weighting,
            batch,
            best,
            latest,
            minimum_exploration,
            limits,
            2 * population(start.size),
        )
        super().__init__(settings, rng)
        self._policy = GaussianPolicy(
            start.ravel(), as_spread(spread, start.shape).ravel(), settings, diagonal=True
        )
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
        return (self._policy.size * np.sqrt(self._policy.variances) * self._policy.scale).reshape(
            -1, self._n_dims
        )

    @property
    def exploration_size(self) -> float:
        """Largest standard deviation, in units of the spread at the start."""
        return self._policy.longest

    def maximise(
        self, return_function: Callable, n_trials: int, tolerance: float = 0.0
    ) -> np.ndarray:
        """As `PoWER.maximise`, with return_function(output (n_steps, n_dims)) giving rewards
        (n_steps,) or a number.
        """
        return super().maximise(return_function, n_trials, tolerance)

    def _argument(self, trial: SearchTrial) -> np.ndarray:
        assert isinstance(trial, PrimitiveTrial)
        return trial.output

    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        # (7.15)
        noise = self._rng.standard_normal((len(self._stretches), self._policy.start.size))
        tried = self._policy.draw(noise)
        return noise, tried[0] if len(tried) == 1 else tried

    def _present(self, number: int, tried: np.ndarray) -> PrimitiveTrial:
        weights = tried.reshape(len(self._stretches), -1, self._n_dims)
        over_time = weights[np.arange(len(self._activations)) // self._hold]
        # (7.14)
        return PrimitiveTrial(number, tried, np.einsum("tb,tbd->td", self._activations, over_time))

    def _read(self, outcome: ArrayLike) -> np.ndarray:
        """Returns to go (n_steps,)."""
        n_steps = len(self._activations)
        if np.ndim(outcome) == 0:
            return np.full(n_steps, read_returns(outcome, (), self.settings.weighting))
        return read_returns(
            returns_to_go(read_returns(outcome, (n_steps,), "rank")),
            (n_steps,),
            self.settings.weighting,
        )

    def _update(self, told: list[ToldTrial]) -> bool:
        to_go = np.array([trial.outcome for trial in told])
        weights = self._noise_weights(
            weights_over_time(to_go, self.settings.best, self.settings.weighting)
        )
        if not weights.any():
            return False
        d = self._policy.start.size
        noise, tried = (
            np.array([getattr(trial, name) for trial in told]).reshape(-1, d)
            for name in ("noise", "tried")
        )
        self._policy.update(noise, tried, np.repeat(weights, self._n_dims, axis=1))
        return True

    def _noise_weights(self, over_time: np.ndarray) -> np.ndarray:
        """Weights (n_trials n_stretches, n_basis) of each noise in (7.17), from weights (n_trials,
        n_steps).

        For each basis they sum to one, or are all zero if the returns say nothing about it.
        """
        by_basis = over_time[:, :, None] * self._credits()
        weights = np.add.reduceat(by_basis, self._stretches, axis=1).reshape(-1, by_basis.shape[2])
        total = weights.sum(axis=0)
        return weights / np.where(total > 0, total, 1.0)

    def _credits(self) -> np.ndarray:
        """Credit (n_steps, n_basis) of each basis at each step."""
        if self._credit == "uniform":
            return np.ones(self._activations.shape)
        power = self._activations**2
        total = power.sum(axis=1, keepdims=True)
        return power / np.where(total > 0, total, 1.0)

    def _policy_state(self) -> dict:
        choices = {
            "n_dims": self._n_dims,
            "hold": self._hold,
            "credit": self._credit,
            "activations": self._activations,
        }
        return {**choices, **self._policy.state()}

    @classmethod
    def _from_policy_state(
        cls, state: dict, settings: SearchSettings, rng: np.random.Generator
    ) -> PrimitivePoWER:
        start, scale = (
            np.reshape(state[name], (-1, state["n_dims"])) for name in ("start", "scale")
        )
        choices = {name: state[name] for name in ("activations", "hold", "credit")}
        search = cls(start, spread=scale, rng=rng, **choices, **vars(settings))
        search._policy.restore(state)
        return search


def as_activations(activations: ArrayLike, n_basis: int) -> np.ndarray:
    activations = as_samples(activations, "activations", n_basis)
    active = activations.any(axis=0)
    if not active.all():
        raise ValueError(
            f"activations are zero at all times for basis {int(active.argmin())}; leave out basis"
            " functions that do nothing"
        )
    return activations


def returns_to_go(rewards: np.ndarray) -> np.ndarray:
    """(7.16): at each step the sum of the rewards (n_steps,) from there on."""
    return np.cumsum(rewards[::-1])[::-1]


def weights_over_time(to_go: np.ndarray, best: int, weighting: str) -> np.ndarray:
    """Weights (n_trials, n_steps) from returns to go of that shape, for the `best` trials by whole
    return, which comes first.

    A step has no weight if all trials earn the same after it. With "returns" the weights are Q of
    (7.17) itself.
    """
    chosen = among_best(to_go[:, 0], best)
    if weighting == "returns":
        return chosen[:, None] * to_go
    weights = np.zeros(to_go.shape)
    weights[chosen > 0] = return_weights(to_go[chosen > 0], int((chosen > 0).sum()), weighting)
    return weights
