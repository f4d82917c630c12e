"""Learning where to aim while the thrower gets better: thesis 6.3, for every method, schedule and
kind of reward. The same searches run on other landscapes (`landscapes`), under whose name as a
schedule.

A search is told the reward of each throw and nothing else. Regret is measured beside it, with the
exact expected score: what the best aim of the moment would have earned more, of the throw that was
made and of the aim that the search holds for the best (its `parameters`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, Protocol

import numpy as np
import scipy

from dart_skill.darts import ModelBasedAgent, expected_score, optimum_path, score
from dart_skill.experiments.studies.baselines import (
    CMAES,
    CrossEntropy,
    MonteCarlo,
    RandomRestarts,
)
from dart_skill.experiments.studies.landscapes import LANDSCAPES, Landscape
from dart_skill.experiments.studies.policy_gradients import EpisodicNaturalActorCritic, Reinforce
from dart_skill.policy_search import MixturePoWER, Niches, PoWER, Readings, SearchTrial, Sharpening

START = np.zeros(2)
"""First aim, the bull [mm]."""
SPREAD = 75.0
"""Spread of the first aims, that of the thrower at the beginning [mm]."""
BLOCK = 10
"""Throws whose mean regret is kept as one number."""
END = 50
"""Throws at the end by which a search is judged."""


@dataclass(frozen=True)
class Schedule:
    """The thrower's standard deviation [mm] falls linearly from `first` to `last` over so many
    throws.
    """

    first: float
    last: float
    n_throws: int

    @property
    def sigmas(self) -> np.ndarray:
        return np.linspace(self.first, self.last, self.n_throws)


class DartLandscape:
    """The board as a landscape: the expected score of an aim (2,) [mm] for the thrower of the
    moment.

    Parameters
    ----------
    schedule
        Of the thrower, by name.
    """

    start, spread = START, SPREAD
    changes: tuple[int, ...] = ()

    def __init__(self, schedule: str):
        self.best, self._sigmas = best_scores(schedule), SCHEDULES[schedule].sigmas

    def rewards(self, parameters: np.ndarray, trial: int) -> np.ndarray:
        return expected_score(parameters, self._sigmas[trial])

    def thrown(self, aim: np.ndarray, trial: int, rng: np.random.Generator) -> float:
        """Score of one dart.

        Parameters
        ----------
        aim
            (2,) [mm].
        trial
            Its number.
        """
        return float(score(aim + self._sigmas[trial] * rng.standard_normal(2)))


class Method(Protocol):
    """What a landscape asks of a search."""

    @property
    def parameters(self) -> np.ndarray: ...

    def ask(self) -> SearchTrial: ...

    def tell(self, trial: SearchTrial, outcome: float, /) -> object: ...


class _Informed:
    """The model-based agent with the interface of a search: each trial is its best aim."""

    def __init__(self) -> None:
        self._agent, self._n = ModelBasedAgent(), 0

    @property
    def parameters(self) -> np.ndarray:
        return self._agent.aim

    def ask(self) -> SearchTrial:
        self._n += 1
        return SearchTrial(self._n, self.parameters)

    def tell(self, trial: SearchTrial, reward: float) -> None:
        self._agent.tell(int(reward))


def _begun(factor: float, **options: Any) -> Callable[..., Method]:
    """The mixture with a first spread that is wrong by a factor, as a user without knowledge of the
    spread would choose it.
    """
    return lambda start, spread, *, rng: MixturePoWER(start, factor * spread, rng=rng, **options)


SCHEDULES = {
    "thesis": Schedule(75.0, 16.0, 3000),
    "extended": Schedule(75.0, 6.0, 3000),
    "thesis_12000": Schedule(75.0, 16.0, 12_000),
    "extended_12000": Schedule(75.0, 6.0, 12_000),
}
REWARDS = ("expected", "thrown")
METHODS: dict[str, Callable[..., Method]] = {
    "mixture": MixturePoWER,
    "mixture_daspec": partial(MixturePoWER, readings=Readings(structure="spectroscopy")),
    "mixture_automatic": partial(MixturePoWER, exploration="automatic", limits=(0.03, 10.0)),
    "mixture_automatic_free": partial(MixturePoWER, exploration="automatic"),
    "mixture_tenth": _begun(0.1),
    "mixture_automatic_tenth": _begun(0.1, exploration="automatic"),
    "mixture_tenfold": _begun(10.0),
    "mixture_automatic_tenfold": _begun(10.0, exploration="automatic"),
    "power": partial(PoWER, limits=(0.03, 10.0)),
    "power_constant": partial(PoWER, exploration="constant"),
    "power_proportional": partial(PoWER, exploration="proportional"),
    "cem": CrossEntropy,
    "cma": partial(CMAES, minimum_exploration=0.03),
    "cma_default": CMAES,
    "reinforce": partial(Reinforce, limits=(0.03, 10.0)),
    "enac": partial(EpisodicNaturalActorCritic, limits=(0.03, 10.0)),
    "restarts": RandomRestarts,
    "monte_carlo": MonteCarlo,
    "niches": Niches,
    "sharpening": Sharpening,
    "model_based": lambda *_, **__: _Informed(),
}
"""Made with the first parameters (d,), the spread of the first trials and rng; all settings are in
units of that spread.
"""


@dataclass(frozen=True)
class SearchTask:
    """One run.

    Parameters
    ----------
    schedule
        Of the thrower, or the name of another landscape.
    stop_after
        Throws after which the search learns no more and throws at its best guess, 0 for never.
    reward
        "expected", the expected score, or "thrown", the score of one dart.
    """

    method: str
    schedule: str
    seed: int
    reward: str = "expected"
    stop_after: int = 0

    def __post_init__(self) -> None:
        for name, choices in (
            ("method", METHODS),
            ("schedule", {**SCHEDULES, **LANDSCAPES}),
            ("reward", REWARDS),
        ):
            if getattr(self, name) not in choices:
                raise ValueError(
                    f"there is no {name} '{getattr(self, name)}': choose one of"
                    f" {', '.join(choices)}"
                )
        if self.schedule in LANDSCAPES and (
            self.reward == "thrown" or self.method == "model_based"
        ):
            raise ValueError(
                "the reward 'thrown' and the model-based agent are for darts, and not for"
                f" '{self.schedule}': choose others"
            )
        if self.method == "model_based" and self.reward != "thrown":
            raise ValueError(
                "the model-based agent learns from the scores of single darts: give it the reward"
                " 'thrown'"
            )


@dataclass(frozen=True)
class SearchRun:
    """What came of a task: mean regret [points] of all throws and of the aim held for the best, of
    the latter in the last 50 throws, and the same per block of 10 throws; components of the
    mixture per block, 1 for others. offline_error, where a landscape changes at a blow: mean over
    trials of what the best trial since the last change lost (Branke 1999).

    Parameters
    ----------
    end_regret
        The one in the last 50 throws.
    """

    task: SearchTask
    throw_regret: float
    best_regret: float
    end_regret: float
    throw_regrets: tuple[float, ...]
    best_regrets: tuple[float, ...]
    components: tuple[float, ...]
    offline_error: float | None = None


@lru_cache(maxsize=8)
def best_scores(schedule: str) -> np.ndarray:
    """Expected score (n,) of the best aim at every throw, interpolated between the knots of the
    exact path, piece by piece.

    Parameters
    ----------
    schedule
        Of the thrower, by name.
    """
    sigmas = SCHEDULES[schedule].sigmas
    path = optimum_path(sigmas.min(), sigmas.max())
    best = np.full(len(sigmas), -np.inf)
    for piece in path.pieces:
        known, value = path.sigmas[piece], path.expected_scores[piece]
        inside = (sigmas >= known[0] - 1e-9) & (sigmas <= known[-1] + 1e-9)
        best[inside] = np.maximum(
            best[inside],
            scipy.interpolate.PchipInterpolator(known, value, extrapolate=True)(sigmas[inside]),
        )
    return best


def run(task: SearchTask) -> SearchRun:
    """One search over one landscape. Seeds of the search, of the thrower's hand and of the
    landscape are independent.
    """
    searching, throwing, drawing = (np.random.default_rng([task.seed, part]) for part in range(3))
    landscape = _landscape(task.schedule, drawing)
    best, search = (
        landscape.best,
        METHODS[task.method](landscape.start, landscape.spread, rng=searching),
    )
    tried, held, components = np.empty(len(best)), np.empty(len(best)), np.ones(len(best))
    for n, highest in enumerate(best):
        learning = not task.stop_after or n < task.stop_after
        trial = search.ask() if learning else None
        both = np.stack(
            [search.parameters if trial is None else trial.parameters, search.parameters]
        )
        rewards = landscape.rewards(both, n)
        tried[n], held[n] = highest - rewards
        components[n] = getattr(search, "n_components", 1)
        if trial is not None:
            earned = float(rewards[0])
            if task.reward == "thrown":
                assert isinstance(landscape, DartLandscape)  # as the task has checked
                earned = landscape.thrown(both[0], n, throwing)
            search.tell(trial, earned)
    return SearchRun(
        task,
        float(tried.mean()),
        float(held.mean()),
        float(held[-END:].mean()),
        _in_blocks(tried),
        _in_blocks(held),
        _in_blocks(components),
        _offline_error(tried, landscape.changes),
    )


def _in_blocks(values: np.ndarray) -> tuple[float, ...]:
    return tuple(np.mean(values.reshape(-1, BLOCK), axis=1).round(4).tolist())


def _landscape(name: str, rng: np.random.Generator) -> Landscape:
    return LANDSCAPES[name](rng) if name in LANDSCAPES else DartLandscape(name)


def _offline_error(regrets: np.ndarray, changes: tuple[int, ...]) -> float | None:
    least = [np.minimum.accumulate(period) for period in np.split(regrets, changes)]
    return float(np.concatenate(least).mean()) if changes else None


def summarise(results: list[SearchRun]) -> list[dict]:
    """One row per method, schedule, reward and stop: runs, and [lower quartile, median, upper
    quartile] over seeds of the regrets.
    """
    groups: dict[tuple, list[SearchRun]] = {}
    for one in results:
        groups.setdefault(
            (one.task.method, one.task.schedule, one.task.reward, one.task.stop_after), []
        ).append(one)
    rows = []
    for (method, schedule, reward, stop), group in groups.items():
        row = {
            "method": method,
            "schedule": schedule,
            "reward": reward,
            "stop_after": stop,
            "runs": len(group),
        }
        for name in REGRETS:
            row[name] = _quartiles([getattr(one, name) for one in group])
        errors = [one.offline_error for one in group if one.offline_error is not None]
        row["offline_error"] = _quartiles(errors) if errors else None
        row["components"] = round(float(np.mean([one.components for one in group])), 2)
        row["components_at_the_end"] = round(
            float(np.mean([one.components[-1] for one in group])), 2
        )
        rows.append(row)
    return rows


def _quartiles(values: list[float]) -> list[float]:
    return np.percentile(values, [25, 50, 75]).round(4).tolist()


REGRETS = {
    "throw_regret": "of each trial",
    "best_regret": "of the best guess",
    "end_regret": "at the end",
}


def table(results: list[SearchRun]) -> str:
    """The rows of `summarise` as text."""
    return table_of(summarise(results))


def table_of(rows: list[dict]) -> str:
    """Rows as `summarise` gives them as text; the offline error where one has it."""
    heads = {
        **REGRETS,
        **(
            {"offline_error": "offline error"} if any(row["offline_error"] for row in rows) else {}
        ),
    }
    lines = [
        f"{'method':<20}{'schedule':<16}{'reward':<10}{'runs':>5}{''.join(f'{head:>24}' for head in heads.values())}{'K':>6}"
    ]
    for row in rows:
        regrets = "".join(_cell(row[name]) for name in heads)
        name = row["method"] + (f" to {row['stop_after']}" if row["stop_after"] else "")
        lines.append(
            f"{name:<20}{row['schedule']:<16}{row['reward']:<10}{row['runs']:>5}{regrets}{row['components_at_the_end']:>6.1f}"
        )
    return "\n".join(
        [
            *lines,
            (
                "regret: reward lost per trial, median and quartiles over the runs; K: components at"
                " the end"
            ),
        ]
    )


def _cell(quartiles: list[float] | None) -> str:
    return (
        f"{quartiles[1]:>10.3f} ({quartiles[0]:.3f}-{quartiles[2]:.3f})".rjust(24)
        if quartiles
        else f"{'-':>24}"
    )
