"""Figure 6.3: how many Gaussians the mixture keeps, and what is lost when learning stops half-way,
over 20 runs.

The thesis claims about 3 components on average and that learning on beats stopping after 1500
throws. Both can be read off, and beside them what one Gaussian (PoWER with a floor) loses on the
same throws.

The table of regrets of 6.3 as a picture: every method, on the thesis's schedule and the
extended one, over 20 runs.

The thesis has no such figure. Runs are kept in `regrets.jsonl` beside the picture, and those that
stand there are not run again: take the file away when a method has changed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dart_skill.experiments.parallel import run_tasks
from dart_skill.experiments.studies.dart_search import (
    BLOCK,
    END,
    SCHEDULES,
    SearchRun,
    SearchTask,
    run,
    summarise,
    table_of,
)
from dart_skill.figures import (
    BLACK,
    BLUE,
    GREEN,
    LIGHT,
    VERMILION,
    house_style,
    letter_panels,
    save,
)

TITLE_6_3 = "Number of Gaussians, and learning on against stopping half-way"
N_SEEDS_6_3, STOP = 20, 1500
CURVES = {
    "mixture, learning on": (("mixture", 0), BLACK),
    f"mixture, stopped after {STOP}": (("mixture", STOP), VERMILION),
    "one Gaussian, learning on": (("power", 0), BLUE),
}


def compute_6_3(seed: int = 0, jobs: int = 0) -> dict[str, list[SearchRun]]:
    """Runs of every curve."""
    tasks = {
        name: [
            SearchTask(method, "thesis", seed + n, "expected", stop) for n in range(N_SEEDS_6_3)
        ]
        for name, ((method, stop), _) in CURVES.items()
    }
    runs = iter(
        run_tasks(run, [task for group in tasks.values() for task in group], SearchRun, jobs=jobs)
    )
    return {name: [next(runs) for _ in group] for name, group in tasks.items()}


def draw_6_3(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    runs = compute_6_3(seed)
    with house_style():
        figure = Figure(figsize=(10.5, 4.2), layout="constrained")
        count, loss = figure.subplots(1, 2)
        components = np.array([one.components for one in runs["mixture, learning on"]])
        _band(count, components, BLACK, "median and quartiles of the runs")
        for name, (_, colour) in CURVES.items():
            _band(loss, np.array([one.best_regrets for one in runs[name]]), colour, name)
        count.set(
            xlabel="throw",
            ylabel="number of Gaussians",
            ylim=(0, None),
            title=f"How many Gaussians the mixture has, n = {N_SEEDS_6_3} runs",
        )
        count.yaxis.set_major_locator(MaxNLocator(integer=True))
        loss.set(
            xlabel="throw",
            ylabel="lost by the best known aim [points per throw]",
            yscale="log",
            ylim=(1e-3, 20.0),
        )
        loss.set_title("What is lost: median and quartiles")
        loss.legend(loc="upper left")
        count.legend(loc="lower right")
        letter_panels(count, loss)
        return save(figure, folder, "figure_6_3"), measured_6_3(runs)


def measured_6_3(runs: dict[str, list[SearchRun]]) -> dict:
    """Mean number of components, of all throws and at the end, and median regret of the best known
    aim of each curve.
    """
    components = np.array([one.components for one in runs["mixture, learning on"]])
    return {
        "mean_components": round(float(components.mean()), 2),
        "at_the_end": round(float(components[:, -1].mean()), 2),
        "best_regret": {
            name: round(float(np.median([one.best_regret for one in group])), 3)
            for name, group in runs.items()
        },
        "end_regret": {
            name: round(float(np.median([one.end_regret for one in group])), 3)
            for name, group in runs.items()
        },
    }


def _band(axes: Axes, values: np.ndarray, colour: str, label: str) -> None:
    """Median and quartiles over runs of values (n_runs, n_blocks)."""
    throw = BLOCK * (0.5 + np.arange(values.shape[1]))
    low, middle, high = np.percentile(values, [25, 50, 75], axis=0)
    axes.fill_between(throw, low, high, color=colour, alpha=0.25, linewidth=0)
    axes.plot(throw, middle, color=colour, label=label)


TITLE_regrets = "Regrets of all methods, thesis's schedule and the extended one"
N_SEEDS_regrets = 20
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


def compute_regrets(results: Path | None = None, seed: int = 0, jobs: int = 0) -> list[SearchRun]:
    """Runs of every method on both schedules; those in the file of results are taken from there."""
    rewards = {method: "thrown" if method == "model_based" else "expected" for method in METHODS}
    kinds = [(method, schedule) for schedule in DRAWN for method in METHODS]
    return run_tasks(
        run,
        [
            SearchTask(*kind, seed + n, rewards[kind[0]])
            for kind in kinds
            for n in range(N_SEEDS_regrets)
        ],
        SearchRun,
        results,
        jobs,
    )


def draw_regrets(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    Path(folder).mkdir(parents=True, exist_ok=True)
    rows = summarise(compute_regrets(Path(folder) / "regrets.jsonl", seed))
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
        title = f"median and quartiles, n = {N_SEEDS_regrets} runs; at the left edge: {LOWEST:g} or less"
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), title=title)
        return save(figure, folder, "regrets"), {"rows": rows}


def describe_regrets(measured: dict) -> str:
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
