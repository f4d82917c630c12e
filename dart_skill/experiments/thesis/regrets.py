"""The table of regrets of 6.3 as a picture: every method, on the thesis's schedule and the
extended one, over 20 runs.

The thesis has no such figure. Runs are kept in `regrets.jsonl` beside the picture, and those that
stand there are not run again: take the file away when a method has changed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.experiments.studies.dart_search import (
    END,
    SCHEDULES,
    Run,
    Task,
    run_tasks,
    summarise,
    table_of,
)
from dart_skill.figures import BLUE, GREEN, LIGHT, VERMILION, house_style, save

TITLE = "Regrets of all methods, thesis's schedule and the extended one"
N_SEEDS = 20
METHODS = {
    "model_based": "knows the board, own darts' scores",
    "sharpening": "sharpening",
    "niches": "niches",
    "cma": "CMA-ES, floor",
    "power": "PoWER, floor",
    "cem": "cross-entropy method",
    "power_constant": "PoWER, constant noise",
    "power_proportional": "PoWER, proportional noise",
    "mixture": "the thesis's mixture",
    "cma_default": "CMA-ES as it comes",
    "enac": "natural actor-critic, floor",
    "reinforce": "REINFORCE, floor",
    "restarts": "PoWER with restarts",
    "monte_carlo": "Monte Carlo",
}
REGRETS = {
    "throw_regret": ("each throw", VERMILION, "o"),
    "best_regret": ("best known aim", BLUE, "s"),
    "end_regret": (f"best known aim, last {END} throws", GREEN, "D"),
}
DRAWN = ("thesis", "extended")
"""Schedules, a panel each."""
LOWEST = 1e-3
"""What is less is drawn here [points per throw]."""


def compute(results: Path | None = None, seed: int = 0, jobs: int = 0) -> list[Run]:
    """Runs of every method on both schedules; those in the file of results are taken from there."""
    rewards = {method: "thrown" if method == "model_based" else "expected" for method in METHODS}
    kinds = [(method, schedule) for schedule in DRAWN for method in METHODS]
    return run_tasks(
        [Task(*kind, seed + n, rewards[kind[0]]) for kind in kinds for n in range(N_SEEDS)],
        results,
        jobs,
    )


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    Path(folder).mkdir(parents=True, exist_ok=True)
    rows = summarise(compute(Path(folder) / "regrets.jsonl", seed))
    with house_style():
        figure = Figure(figsize=(10.5, 5.2), layout="constrained")
        for axes, name in zip(figure.subplots(1, len(DRAWN), sharey=True), DRAWN, strict=True):
            schedule = SCHEDULES[name]
            _draw_schedule(axes, [row for row in rows if row["schedule"] == name])
            axes.set_title(
                f"{name}: sigma {schedule.first:g} to {schedule.last:g} mm in {schedule.n_throws}"
                " throws"
            )
        handles, labels = figure.axes[0].get_legend_handles_labels()
        title = f"median and quartiles, n = {N_SEEDS} runs; at the left edge: {LOWEST:g} or less"
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), title=title)
        return save(figure, folder, "regrets"), {"rows": rows}


def describe(measured: dict) -> str:
    """The table."""
    return table_of(measured["rows"])


def _draw_schedule(axes: Axes, rows: list[dict]) -> None:
    places = np.arange(len(rows))
    axes.hlines(
        places, 0, 1, color=LIGHT, linewidth=0.5, transform=axes.get_yaxis_transform(), zorder=0
    )
    for shift, (name, (label, colour, marker)) in zip(
        (-0.24, 0.0, 0.24), REGRETS.items(), strict=True
    ):
        low, middle, high = np.maximum([row[name] for row in rows], LOWEST).T
        axes.hlines(places + shift, low, high, color=colour, linewidth=2.0)
        axes.plot(
            middle,
            places + shift,
            marker,
            color=colour,
            markersize=4.5,
            label=label,
            clip_on=False,
        )
    axes.set(
        xscale="log",
        xlim=(LOWEST, 30.0),
        ylim=(len(rows) - 0.4, -0.6),
        xlabel="regret [points per throw]",
    )
    axes.set_yticks(places, [METHODS[row["method"]] for row in rows])
    axes.tick_params(axis="y", length=0)
