"""Figure 6.3: how many Gaussians the mixture keeps, and what is lost when learning stops half-way,
over 20 runs.

The thesis claims about 3 components on average and that learning on beats stopping after 1500
throws. Both can be read off, and beside them what one Gaussian (PoWER with a floor) loses on the
same throws.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dart_skill.experiments.studies.dart_search import BLOCK, Run, Task, run_tasks
from dart_skill.figures import BLACK, BLUE, VERMILION, house_style, letter_panels, save

TITLE = "Number of Gaussians, and learning on against stopping half-way"
N_SEEDS, STOP = 20, 1500
CURVES = {
    "mixture, learning on": (("mixture", 0), BLACK),
    f"mixture, stopped after {STOP}": (("mixture", STOP), VERMILION),
    "one Gaussian, learning on": (("power", 0), BLUE),
}


def compute(seed: int = 0, jobs: int = 0) -> dict[str, list[Run]]:
    """Runs of every curve."""
    tasks = {
        name: [Task(method, "thesis", seed + n, "expected", stop) for n in range(N_SEEDS)]
        for name, ((method, stop), _) in CURVES.items()
    }
    runs = iter(run_tasks([task for group in tasks.values() for task in group], jobs=jobs))
    return {name: [next(runs) for _ in group] for name, group in tasks.items()}


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    runs = compute(seed)
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
            title=f"How many Gaussians the mixture has, n = {N_SEEDS} runs",
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
        return save(figure, folder, "figure_6_3"), measured(runs)


def measured(runs: dict[str, list[Run]]) -> dict:
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
