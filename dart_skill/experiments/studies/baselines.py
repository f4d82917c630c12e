"""Searches with which those of the thesis are compared, with the same `ask` and `tell`; they
cannot be saved.

The cross-entropy method, PoWER with random restarts, Monte-Carlo search, and CMA-ES through the
package `cma`.

    search = CrossEntropy(aim, spread, rng=rng)
    for trial in search.trials(3000):
        search.tell(trial, score(trial.parameters))
"""

from __future__ import annotations

import importlib
import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_number
from dart_skill.policy_search import (
    GaussianPolicy,
    PoWER,
    SearchSettings,
    ToldTrial,
    VectorSearch,
    among_best,
    population,
)

LIMITS = (1e-8, 1e4)
"""Limits of the exploration, relative to the spread at the start."""


def _settings(
    batch: int, best: int, latest: int, minimum_exploration: float = 0.0
) -> SearchSettings:
    return SearchSettings("constant", "rank", batch, best, latest, minimum_exploration, LIMITS)


class CrossEntropy(VectorSearch):
    """Cross-entropy method: after every `batch` returns the Gaussian gets mean and covariance of
    the `best` M of them.

    P. T. de Boer et al., A tutorial on the cross-entropy method, Annals of OR 134, 2005. Noise: I.
    Szita and A. Loerincz, Learning Tetris using the noisy cross-entropy method, Neural Computation
    18, 2006.

    Parameters
    ----------
    parameters : (d,)
        First guess, the mean of the first Gaussian.
    spread
        One number or (d,). Standard deviations of the first Gaussian.
    rng
        Numpy Generator.
    batch
        Int, number of returns between updates; default None: 10 + 5 d.
    best
        Int, M; default None: batch / 4.
    smoothing
        Float in (0, 1], default 1. Share of the way to the new mean and covariance that one update
        goes.
    minimum_exploration
        Float, default 0.03. Standard deviation of the noise that is added to the covariance,
        relative to `spread`; without it the method stops learning.
    """

    def __init__(
        self,
        parameters: ArrayLike,
        spread: ArrayLike,
        *,
        rng: np.random.Generator,
        batch: int | None = None,
        best: int | None = None,
        smoothing: float = 1.0,
        minimum_exploration: float = 0.03,
    ):
        batch = 10 + 5 * np.size(parameters) if batch is None else as_count(batch, "batch", 2)
        best = max(batch // 4, 1) if best is None else as_count(best, "best")
        super().__init__(
            parameters, spread, _settings(batch, best, batch, minimum_exploration), rng
        )
        self._smoothing = as_number(smoothing, "smoothing")
        if self._smoothing > 1:
            raise ValueError(f"smoothing must be at most 1, got {smoothing:g}")
        self._policy = GaussianPolicy(self._start, self._scale, self.settings, diagonal=False)

    @property
    def parameters(self) -> np.ndarray:
        """Mean (d,) of the Gaussian."""
        return self._policy.parameters

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (d, d) of the next trial."""
        return self._policy.covariance

    @property
    def exploration_size(self) -> float:
        return self._policy.longest

    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        noise = self._rng.standard_normal(self._start.size)
        return noise, self._policy.draw(noise)

    def _update(self, told: list[ToldTrial]) -> bool:
        returns = np.array([trial.outcome for trial in told])
        if returns.min() == returns.max():
            return False
        weights = among_best(returns, self.settings.best) / self.settings.best
        points, policy, share = self._relative(told), self._policy, self._smoothing
        mean = weights @ points
        deviations = (points - mean) * np.sqrt(weights)[:, None]
        covariance = share * deviations.T @ deviations + (1 - share) * policy.shape()
        policy.mean = policy.mean + share * (mean - policy.mean)
        policy.set_covariance(covariance, np.ones(self._start.size, dtype=bool))
        return True


class RandomRestarts(PoWER):
    """PoWER that restarts at random places.

    The result of a finished run is kept with the mean return of its last batch. `parameters` is
    the best of these results and of the present run. A result is not tried again. So where returns
    change, its value may be out of date.

    Parameters
    ----------
    parameters : (d,)
        As in `PoWER`.
    spread
        As in `PoWER`.
    rng
        As in `PoWER`.
    restart_below
        Float, default 0.05. A run ends when its exploration, relative to `spread`, is below this.
    longest_run
        Int, default 500. A run ends at the first update after so many returns.
    reach
        Float, default 1. A new run starts at a place from a Gaussian about `parameters` with
        `reach` times `spread`.
    options
        The other options of `PoWER`.
    """

    def __init__(
        self,
        parameters: ArrayLike,
        spread: ArrayLike,
        *,
        rng: np.random.Generator,
        restart_below: float = 0.05,
        longest_run: int = 500,
        reach: float = 1.0,
        **options: Any,
    ) -> None:
        super().__init__(parameters, spread, rng=rng, **options)
        self._origin = self._policy.start.copy()
        self._restart_below = as_number(restart_below, "restart_below", strict=False)
        self._longest_run = as_count(longest_run, "longest_run")
        self._reach = as_number(reach, "reach")
        self._runs, self._began, self._present_return = 0, 0, -np.inf
        self._found: list[tuple[np.ndarray, float]] = []

    @property
    def optima(self) -> tuple[np.ndarray, np.ndarray]:
        """Results (n, d) of the finished runs, and the mean returns (n,) of their last batches."""
        places = np.reshape([place for place, _ in self._found], (-1, self._origin.size))
        return places, np.array([value for _, value in self._found])

    @property
    def parameters(self) -> np.ndarray:
        """Mean (d,) of the best run, finished or not."""
        if not self._found:
            return self._policy.parameters
        place, value = max(self._found, key=lambda found: found[1])
        return place.copy() if value > self._present_return else self._policy.parameters

    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        noise, tried = super()._draw()
        return np.append(noise, self._runs), tried

    def _update(self, told: list[ToldTrial]) -> bool:
        ours = [
            ToldTrial(one.number, one.noise[:-1], one.tried, one.outcome)
            for one in told
            if one.noise[-1] == self._runs
        ]
        changed = len(ours) >= self.settings.best and super()._update(ours)
        if changed:
            latest = [one.outcome for one in ours[-self.settings.batch :]]
            self._present_return = float(np.mean(latest))
        too_long = self.n_told - self._began >= self._longest_run
        if too_long or self._policy.longest < self._restart_below:
            if np.isfinite(self._present_return):
                self._found.append((self._policy.parameters, self._present_return))
            scale, noise = self._policy.scale, self._rng.standard_normal(self._origin.size)
            start = self._origin + self._reach * scale * noise
            self._policy = GaussianPolicy(start, scale, self.settings, diagonal=False)
            self._runs, self._began, self._present_return = self._runs + 1, self.n_told, -np.inf
        return changed

    def _policy_state(self) -> dict:
        raise TypeError("a search with restarts cannot be saved")


class MonteCarlo(VectorSearch):
    """Monte-Carlo search: uniform trials. It does not learn where to try, so it shows what this
    learning is worth.

    The neighbourhood of a trial is the M nearest of the `latest` S trials, itself included, with
    distances in units of `spread`. The best guess is the middle of the neighbourhood with the
    highest mean return.

    Parameters
    ----------
    parameters : (d,)
        Middle of the trials.
    spread
        One number or (d,), the unit of distances.
    rng
        Numpy Generator.
    reach
        Float, default 2. Trials are uniform within `reach` times `spread` of `parameters`, along
        each parameter.
    batch
        Int, default 25. The best neighbourhood is looked for after so many returns.
    best
        Int, default 15. M.
    latest
        Int, default 500. S.
    """

    def __init__(
        self,
        parameters: ArrayLike,
        spread: ArrayLike,
        *,
        rng: np.random.Generator,
        reach: float = 2.0,
        batch: int = 25,
        best: int = 15,
        latest: int = 500,
    ):
        super().__init__(parameters, spread, _settings(batch, best, latest), rng)
        self._reach = as_number(reach, "reach")
        self._mean: np.ndarray = np.zeros(self._start.size)
        self.neighbourhood_return = -np.inf

    @property
    def parameters(self) -> np.ndarray:
        """Middle (d,) of the best neighbourhood."""
        return self._start + self._scale * self._mean

    @property
    def exploration_size(self) -> float:
        return self._reach / np.sqrt(3.0)

    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        noise = self._rng.uniform(-self._reach, self._reach, self._start.size)
        return noise, self._start + self._scale * noise

    def _update(self, told: list[ToldTrial]) -> bool:
        points, returns = self._relative(told), np.array([trial.outcome for trial in told])
        squares = np.square(points).sum(axis=1)
        near = np.argsort(
            squares[:, None] - 2 * points @ points.T + squares, axis=1, kind="stable"
        )[:, : self.settings.best]
        means = returns[near].mean(axis=1)
        best = int(means.argmax())
        self._mean, self.neighbourhood_return = points[near[best]].mean(axis=0), float(means[best])
        return True


class CMAES(VectorSearch):
    """CMA-ES of the package `cma` (pip install cma), with its own defaults.

    Parameters
    ----------
    parameters : (d,)
        First guess.
    spread
        One number or (d,). Standard deviations of the first trials.
    rng
        Numpy Generator.
    batch
        Int, the population; default None: 4 + 3 log d.
    minimum_exploration
        Float, default 0 as in `cma`. Least standard deviation of any parameter, relative to
        `spread`. With 0 the search stops learning once it has converged.
    """

    def __init__(
        self,
        parameters: ArrayLike,
        spread: ArrayLike,
        *,
        rng: np.random.Generator,
        batch: int | None = None,
        minimum_exploration: float = 0.0,
    ):
        batch = population(np.size(parameters)) if batch is None else as_count(batch, "batch", 3)
        super().__init__(parameters, spread, _settings(batch, 1, batch, minimum_exploration), rng)
        # A generator of its own, so that other draws from `rng` do not change the trials.
        self._rng = np.random.default_rng(rng.integers(2**63))
        options = {
            "popsize": self.settings.batch,
            "verbose": -9,
            "seed": np.nan,
            "minstd": self.settings.minimum_exploration,
            "randn": lambda *shape: self._rng.standard_normal(shape),
        }
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about plots, and one dimension
            try:
                strategy = importlib.import_module("cma").CMAEvolutionStrategy
            except ImportError as error:
                raise ImportError(
                    "CMAES needs the package cma: pip install cma, or take CrossEntropy, which"
                    " needs nothing"
                ) from error
            self._strategy = strategy(np.zeros(self._start.size), 1.0, options)

    @property
    def parameters(self) -> np.ndarray:
        """Mean (d,) of the distribution."""
        return self._start + self._scale * self._strategy.result.xfavorite

    @property
    def exploration_size(self) -> float:
        return float(np.max(self._strategy.result.stds))

    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        noise = np.array(self._strategy.ask(1)[0])
        return noise, self._start + self._scale * noise

    def _update(self, told: list[ToldTrial]) -> bool:
        losses = [-float(one.outcome) for one in told]
        self._strategy.tell([one.noise for one in told], losses)
        return True
