"""Learning where to aim while the thrower gets better: thesis 6.3, for every method, schedule and
kind of reward. The same searches run on other landscapes (`landscapes`), under whose name as a
schedule.

A search is told the reward of each throw and nothing else. Regret is measured beside it, with the
exact expected score: what the best aim of the moment would have earned more, of the throw that was
made and of the aim that the search holds for the best (its `parameters`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import numpy as np
import scipy

from dart_skill.darts import ModelBasedAgent, expected_score, optimum_path, score
from dart_skill.experiments.studies.baselines import (
    CMAES,
    CrossEntropy,
    MonteCarlo,
    RandomRestarts,
)
from dart_skill.experiments.studies.landscapes import LANDSCAPES
from dart_skill.experiments.studies.policy_gradients import EpisodicNaturalActorCritic, Reinforce
from dart_skill.policy_search import MixturePoWER, Niches, PoWER, Readings, SearchTrial, Sharpening

SPREAD = 75.0
"""Spread of the first aims about the bull, that of the thrower at the beginning [mm]."""
BLOCK = 10
"""Throws whose mean regret is kept as one number."""
END = 50
"""Throws at the end by which a search is judged."""
SCHEDULES = {
    "thesis": np.linspace(75.0, 16.0, 3000),
    "extended": np.linspace(75.0, 6.0, 3000),
    "thesis_12000": np.linspace(75.0, 16.0, 12_000),
    "extended_12000": np.linspace(75.0, 6.0, 12_000),
}
"""The thrower's standard deviation at each throw [mm]."""
REWARDS = ("expected", "thrown")
"""Expected score, or the score of one dart."""


class DartLandscape:
    """The board as a landscape (`landscapes.StagedLandscape`): the expected score of an aim (2,)
    [mm] for the thrower of the moment.

    Parameters
    ----------
    schedule
        Of the thrower, by name.
    """

    def __init__(self, schedule: str):
        self.start, self.spread = np.zeros(2), SPREAD
        self.changes: tuple[int, ...] = ()
        self.best, self._sigmas = best_scores(schedule), SCHEDULES[schedule]

    def rewards(self, parameters: np.ndarray, trial: int) -> np.ndarray:
        return expected_score(parameters, self._sigmas[trial])


class _Informed:
    """The model-based agent with the interface of a search: each trial is its best aim."""

    def __init__(self, *_: Any, rng: np.random.Generator) -> None:
        self._agent = ModelBasedAgent()

    @property
    def parameters(self) -> np.ndarray:
        return self._agent.aim

    def ask(self) -> SearchTrial:
        return SearchTrial(0, self.parameters)

    def tell(self, trial: SearchTrial, reward: float) -> None:
        self._agent.tell(int(reward))


def _begun(factor: float, **options: Any) -> Callable[..., MixturePoWER]:
    """The mixture with a first spread that is wrong by a factor, as a user without knowledge of the
    spread would choose it.
    """
    return lambda start, spread, *, rng: MixturePoWER(start, factor * spread, rng=rng, **options)


METHODS: dict[str, Callable[..., Any]] = {
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
    "model_based": _Informed,
}
"""Made with the first parameters (d,), the spread of the first trials and rng; all settings are in
units of that spread.
"""


def search_task(
    method: str, schedule: str, seed: int, reward: str = "expected", stop_after: int = 0
) -> dict:
    """A task of `run`.

    Parameters
    ----------
    schedule
        Of the thrower, or the name of another landscape.
    stop_after
        Throws after which the search learns no more and throws at its best guess, 0 for never.
    reward
        One of REWARDS.

    Raises
    ------
    ValueError
        For what does not exist, or does not go together.
    """
    for name, value, choices in (
        ("method", method, METHODS),
        ("schedule", schedule, {**SCHEDULES, **LANDSCAPES}),
        ("reward", reward, REWARDS),
    ):
        if value not in choices:
            raise ValueError(f"there is no {name} '{value}': choose one of {', '.join(choices)}")
    if schedule in LANDSCAPES and (reward == "thrown" or method == "model_based"):
        raise ValueError(
            "the reward 'thrown' and the model-based agent are for darts, and not for"
            f" '{schedule}': choose others"
        )
    if method == "model_based" and reward != "thrown":
        raise ValueError(
            "the model-based agent learns from the scores of single darts: give it the reward"
            " 'thrown'"
        )
    where = {"method": method, "schedule": schedule, "seed": seed}
    return {**where, "reward": reward, "stop_after": stop_after}


@lru_cache(maxsize=8)
def best_scores(schedule: str) -> np.ndarray:
    """Expected score (n,) of the best aim at every throw, interpolated between the knots of the
    exact path, piece by piece.

    Parameters
    ----------
    schedule
        Of the thrower, by name.
    """
    sigmas = SCHEDULES[schedule]
    path = optimum_path(sigmas.min(), sigmas.max())
    best = np.full(len(sigmas), -np.inf)
    for piece in path.pieces:
        known, value = path.sigmas[piece], path.expected_scores[piece]
        inside = (sigmas >= known[0] - 1e-9) & (sigmas <= known[-1] + 1e-9)
        curve = scipy.interpolate.PchipInterpolator(known, value, extrapolate=True)
        best[inside] = np.maximum(best[inside], curve(sigmas[inside]))
    return best


def run(task: dict) -> dict:
    """One search over one landscape. Seeds of the search, of the thrower's hand and of the
    landscape are independent.

    Returns
    -------
    dict
        Mean regret [points] of all throws (throw_regret) and of the aim held for the best
        (best_regret), of the latter in the last 50 throws (end_regret), and the first two per
        block of 10 throws; components of the mixture per block, 1 for others. offline_error, where
        a landscape changes at a blow: mean over trials of what the best trial since the last
        change lost (Branke 1999).
    """
    searching, throwing, drawing = (
        np.random.default_rng([task["seed"], part]) for part in range(3)
    )
    name, stop = task["schedule"], task["stop_after"]
    landscape = LANDSCAPES[name](drawing) if name in LANDSCAPES else DartLandscape(name)
    search = METHODS[task["method"]](landscape.start, landscape.spread, rng=searching)
    best = landscape.best
    tried, held, components = np.empty(len(best)), np.empty(len(best)), np.ones(len(best))
    for n, highest in enumerate(best):
        trial = search.ask() if not stop or n < stop else None
        aim = search.parameters if trial is None else trial.parameters
        rewards = landscape.rewards(np.stack([aim, search.parameters]), n)
        tried[n], held[n] = highest - rewards
        components[n] = getattr(search, "n_components", 1)
        if trial is not None:
            earned = float(rewards[0])
            if task["reward"] == "thrown":
                earned = float(score(aim + SCHEDULES[name][n] * throwing.standard_normal(2)))
            search.tell(trial, earned)
    return {
        "task": task,
        "throw_regret": float(tried.mean()),
        "best_regret": float(held.mean()),
        "end_regret": float(held[-END:].mean()),
        "throw_regrets": _in_blocks(tried),
        "best_regrets": _in_blocks(held),
        "components": _in_blocks(components),
        "offline_error": offline_error(tried, landscape.changes),
    }


def _in_blocks(values: np.ndarray) -> list[float]:
    return np.mean(values.reshape(-1, BLOCK), axis=1).round(4).tolist()


def offline_error(regrets: np.ndarray, changes: tuple[int, ...]) -> float | None:
    """Mean over trials (n,) of what the best trial since the last change lost; None without
    changes.
    """
    least = [np.minimum.accumulate(period) for period in np.split(regrets, changes)]
    return float(np.concatenate(least).mean()) if changes else None


REGRETS = {
    "throw_regret": "of each trial",
    "best_regret": "of the best guess",
    "end_regret": "at the end",
    "offline_error": "offline error",
}
"""What is summarised, and its name in a table."""


def summarise(results: list[dict]) -> list[dict]:
    """One row per method, schedule, reward and stop: runs, and [lower quartile, median, upper
    quartile] over seeds of the regrets.
    """
    groups: dict[tuple, list[dict]] = {}
    names = ("method", "schedule", "reward", "stop_after")
    for one in results:
        groups.setdefault(tuple(one["task"][name] for name in names), []).append(one)
    rows = []
    for kind, group in groups.items():
        row: dict[str, Any] = {**dict(zip(names, kind, strict=True)), "runs": len(group)}
        for name in REGRETS:
            values = [one[name] for one in group if one[name] is not None]
            quartiles = np.percentile(values, [25, 50, 75]).round(4).tolist() if values else None
            row[name] = quartiles
        components = np.array([one["components"] for one in group])
        row["components"] = round(float(components.mean()), 2)
        row["components_at_the_end"] = round(float(components[:, -1].mean()), 2)
        rows.append(row)
    return rows


def table_of(rows: list[dict]) -> str:
    """Rows as `summarise` gives them as text; the offline error where one has it."""
    heads = {name: head for name, head in REGRETS.items() if any(row[name] for row in rows)}
    titles = "".join(f"{head:>24}" for head in heads.values())
    lines = [f"{'method':<20}{'schedule':<16}{'reward':<10}{'runs':>5}{titles}{'K':>6}"]
    for row in rows:
        regrets = "".join(_cell(row[name]) for name in heads)
        name = row["method"] + (f" to {row['stop_after']}" if row["stop_after"] else "")
        lines.append(
            f"{name:<20}{row['schedule']:<16}{row['reward']:<10}{row['runs']:>5}{regrets}{row['components_at_the_end']:>6.1f}"
        )
    said = "regret: reward lost per trial, median and quartiles over the runs"
    return "\n".join([*lines, f"{said}; K: components at the end"])


def _cell(quartiles: list[float] | None) -> str:
    if not quartiles:
        return f"{'-':>24}"
    low, middle, high = quartiles
    return f"{middle:>10.3f} ({low:.3f}-{high:.3f})".rjust(24)
