"""PoWER: policy learning by weighting exploration with returns, on any vector of parameters
(thesis 5.1, 5.2).

The policy is a Gaussian over parameters. Trials are drawn from it. Its mean moves by the
reward-weighted average of the relative exploration (5.1). Its covariance becomes the
reward-weighted covariance about the old mean, plus exploration noise (5.2, 5.2.1). J. Kober and J.
Peters, Policy search for motor primitives in robotics, 2011.

    search = PoWER(parameters, spread, rng=rng)
    for trial in search.trials(200):
        search.tell(trial, throw(trial.parameters))      # NaN when it failed
    throw(search.parameters)
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_number, as_vector
from dart_skill.policy_search._policy import GaussianPolicy
from dart_skill.policy_search._search import (
    Search,
    SearchSettings,
    ToldTrial,
    as_spread,
    first_guess,
)
from dart_skill.policy_search._weights import return_weights

SMALLEST = 1e-8
"""Smallest exploration, relative to the spread at the start."""
LARGEST = 1e4
"""Largest exploration, relative to the spread at the start."""


def with_defaults(
    d: int,
    exploration: str,
    weighting: str,
    batch: int | None,
    best: int | None,
    latest: int | None,
    minimum_exploration: float,
    limits: tuple[float, float] | None,
    usual: int,
) -> SearchSettings:
    """Settings in which batch, best, latest and limits have their defaults if they are None.

    Parameters
    ----------
    usual
        Default of `latest` for the modes that use trials several times. Twice or half of the
        defaults works as well: benchmarks/power.py --defaults.
    """
    given = {"batch": batch, "best": best, "latest": latest}
    batch, best, latest = (
        None if count is None else as_count(count, name) for name, count in given.items()
    )
    automatic = exploration == "automatic"
    if latest is None:
        usual = population(d) if automatic else usual
        latest = batch if automatic and batch else max(usual, batch or 0, 2 * (best or 0))
    if batch is None:
        batch = latest if automatic else max(latest // 2, 1)
    if best is None:
        best = max(latest // (2 if automatic else 4), 1)
    minimum = as_number(minimum_exploration, "minimum_exploration", strict=False)
    if limits is None:
        limits = (max(minimum, SMALLEST) if exploration == "proportional" else SMALLEST, LARGEST)
    low, high = as_vector(limits, "limits", 2).tolist()
    settings = SearchSettings(exploration, weighting, batch, best, latest, minimum, (low, high))
    if automatic and latest != batch:
        raise ValueError(
            f"exploration 'automatic' learns from each trial once, but latest = {latest} and batch"
            f" = {batch}: give one of them, or choose 'constant' or 'proportional'"
        )
    return settings


def population(d: int) -> int:
    """Number of trials between updates for d parameters, as in CMA-ES."""
    return 4 + int(3 * np.log(d))


AnyPoWER = TypeVar("AnyPoWER", bound="PoWER")


class PoWER(Search):
    """Search for parameters (d,) with a high return, by PoWER (5.1), (5.2).

    An update comes after every `batch` returns, from the `best` M of the `latest` S trials
    (importance sampling), as soon as there are M. Other units of a parameter, in `parameters` and
    `spread`, change only the units of the result.

    Parameters
    ----------
    parameters : (d,)
        First guess.
    spread
        One number or (d,). Standard deviations of the first trials.
    rng
        Numpy Generator.
    exploration
        "automatic" (default) sets its size by the length of the path of updates; "constant" adds
        Sigma_0 to (5.2); "proportional" adds as much in total, in proportion to the eigenvalues
        (5.2.1); "fixed" keeps the spread, so that only (5.1) is left.
    weighting
        "rank" (default), "exponential" or "returns", see `return_weights`. "returns" is (5.1) and
        (5.2) literally.
    batch
        Int, number of returns between updates; default None: 4 + 3 log d with "automatic", else
        latest / 2.
    best
        Int, M; default None: latest / 2 with "automatic", else latest / 4.
    latest
        Int, S; default None: batch with "automatic", which uses each trial once, else 4 (d + 2).
    minimum_exploration
        Float, default 0.1. Root of Sigma_0 relative to `spread`, for "constant" and
        "proportional".
    limits : (2,)
        Smallest and largest exploration along any axis, relative to `spread`; default None: 1e-8
        and 1e4. For "proportional" the smallest is at least minimum_exploration: proportional
        noise alone lets short axes shrink to zero.
    """

    def __init__(
        self,
        parameters: ArrayLike,
        spread: ArrayLike,
        *,
        rng: np.random.Generator,
        exploration: str = "automatic",
        weighting: str = "rank",
        batch: int | None = None,
        best: int | None = None,
        latest: int | None = None,
        minimum_exploration: float = 0.1,
        limits: tuple[float, float] | None = None,
    ):
        start = first_guess(parameters)
        settings = with_defaults(
            start.size,
            exploration,
            weighting,
            batch,
            best,
            latest,
            minimum_exploration,
            limits,
            4 * (start.size + 2),
        )
        super().__init__(settings, rng)
        self._policy = GaussianPolicy(
            start, as_spread(spread, start.shape), settings, diagonal=False
        )

    @property
    def parameters(self) -> np.ndarray:
        """Mean (d,) of the policy: the best guess, even if returns are noisy."""
        return self._policy.parameters

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (d, d) of the next trial."""
        return self._policy.covariance

    @property
    def spread(self) -> np.ndarray:
        """Standard deviations (d,) of the next trial."""
        return np.sqrt(np.diagonal(self.covariance))

    @property
    def exploration_size(self) -> float:
        """Standard deviation along the longest axis, in units of the spread at the start."""
        return self._policy.longest

    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        noise = self._rng.standard_normal(self._policy.start.size)
        return noise, self._policy.draw(noise)

    def _update(self, told: list[ToldTrial]) -> bool:
        weights = return_weights(
            [trial.outcome for trial in told], self.settings.best, self.settings.weighting
        )
        if not weights.any():
            return False
        noise, tried = (
            np.array([trial.noise for trial in told]),
            np.array([trial.tried for trial in told]),
        )
        self._policy.update(noise, tried, np.broadcast_to(weights[:, None], tried.shape))
        return True

    def _policy_state(self) -> dict:
        return self._policy.state()

    @classmethod
    def _from_policy_state(
        cls: type[AnyPoWER], state: dict, settings: SearchSettings, rng: np.random.Generator
    ) -> AnyPoWER:
        search = cls(state["start"], state["scale"], rng=rng, **vars(settings))
        search._policy.restore(state)
        return search
