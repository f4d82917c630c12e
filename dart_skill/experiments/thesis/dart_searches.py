"""Figure 6.2: the search for optima of 5.3 while the thrower gets better, at four moments: the
heat map of the moment, the last 150 trials and the Gaussians. The thesis shows the most common of
its runs, in which splits came at throws 1060 and 1757; here is the run of the seed, with its own.

Figure 6.3: how many Gaussians the mixture keeps, and what is lost when learning stops half-way,
over 20 runs. The thesis claims about 3 components on average and that learning on beats stopping
after 1500 throws. Both can be read off, and beside them what one Gaussian (PoWER with a floor)
loses on the same throws.

`regrets`: the table of regrets of 6.3 as a picture: every method, on the thesis's schedule and the
extended one, over 20 runs. The thesis has no such figure. Runs are kept in `regrets.jsonl` beside
the picture, and those that stand there are not run again: take the file away when a method has
changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import MaxNLocator

from dart_skill.darts import RADII, HeatMap, expected_score, heat_map
from dart_skill.experiments.parallel import run_tasks
from dart_skill.experiments.studies.dart_search import (
    BLOCK,
    END,
    SCHEDULES,
    SPREAD,
    run,
    search_task,
    summarise,
    table_of,
)
from dart_skill.figures import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LIGHT,
    VERMILION,
    add_gaussians,
    draw_board,
    legend_below,
    letter_panels,
    quantity_colours,
)
from dart_skill.mixture import GaussianMixture
from dart_skill.policy_search import MixturePoWER

MOMENTS = (150, 1060, 1757, 3000)
"""Numbers of throws after which figure 6.2 shows the search."""
LATEST = 150
"""Number of the last trials that it shows."""
SPACING = 2.0
"""Spacing of its heat maps [mm]."""


class SearchMoment(NamedTuple):
    """After so many throws: sigma [mm], the last trials (n, 2) [mm], and the mixture."""

    throws: int
    sigma: float
    trials: np.ndarray
    mixture: GaussianMixture


def moments_of_search(
    seed: int = 0, moments: tuple[int, ...] = MOMENTS
) -> tuple[list[SearchMoment], list[int]]:
    """The moments of one run on the thesis's schedule, and the throws after which the number of
    components changed.
    """
    search = MixturePoWER(np.zeros(2), SPREAD, rng=np.random.default_rng([seed, 0]))
    shown: list[SearchMoment] = []
    tried: list[np.ndarray] = []
    counts = [1]
    for n, sigma in enumerate(SCHEDULES["thesis"], start=1):
        trial = search.ask()
        tried.append(trial.parameters)
        search.tell(trial, float(expected_score(trial.parameters[None], sigma)[0]))
        counts.append(search.n_components)
        if n in moments:
            latest = np.array(tried[-LATEST:])
            shown.append(SearchMoment(n, float(sigma), latest, search.mixture))
    return shown, (np.flatnonzero(np.diff(counts)) + 1).tolist()


def draw_6_2(seed: int = 0, moments: tuple[int, ...] = MOMENTS) -> tuple[Figure, dict]:
    shown, changes = moments_of_search(seed, moments)
    figure = Figure(figsize=(13.0, 4.3), layout="constrained")
    panels = figure.subplots(1, len(shown))
    heats = [heat_map(moment.sigma, SPACING) for moment in shown]
    highest = max(heat.expected_score.max() for heat in heats)
    for axes, moment, heat in zip(panels, shown, heats, strict=True):
        image = _draw_moment(axes, moment, heat, highest)
    figure.colorbar(image, ax=panels, label="expected score [points per dart]", shrink=0.8)
    letter_panels(*panels)
    handles, labels = panels[0].get_legend_handles_labels()
    legend_below(figure, handles, labels, 2)
    return figure, {
        "components": {str(one.throws): len(one.mixture.priors_) for one in shown},
        "changes": len(changes),
        "first_changes": changes[:5],
    }


def _draw_moment(axes: Axes, moment: SearchMoment, heat: HeatMap, highest: float) -> AxesImage:
    edge = heat.x[-1] + 0.5 * SPACING
    look: dict[str, Any] = {"cmap": quantity_colours(), "interpolation": "nearest"}
    look |= {"origin": "lower", "extent": (-edge, edge, -edge, edge), "vmin": 0.0}
    inside = np.hypot(heat.x, heat.y[:, None]) <= RADII[-1]
    image = axes.imshow(np.where(inside, heat.expected_score, np.nan), vmax=highest, **look)
    draw_board(axes, "#FFFFFF60")
    dots: dict[str, Any] = {"color": BLACK, "markersize": 2.5, "linestyle": "none"}
    label = f"aim of one of the last {LATEST} throws"
    axes.plot(*moment.trials.T, ".", label=label, **dots)
    shapes = moment.mixture.means_, moment.mixture.covariances_
    for colour, width in ((GREY, 3.2), ("white", 1.6)):
        line: dict[str, Any] = {"facecolor": "none", "edgecolor": colour, "linewidth": width}
        add_gaussians(axes, *shapes, 2.0, zorder=3, **line)
    ring: dict[str, Any] = {"markerfacecolor": "white", "markeredgecolor": GREY, "markersize": 9}
    label = "Gaussian of the mixture, 2 standard deviations"
    axes.plot([], [], "o", linestyle="none", label=label, **ring)
    said = f"spread {moment.sigma:.1f} mm, {len(shapes[0])} Gaussians"
    axes.set_title(f"After {moment.throws} throws\n{said}")
    return image


STOP = 1500
"""Number of throws after which a curve of figure 6.3 stops learning."""
ON = "mixture, learning on"
CURVES = {
    ON: (("mixture", 0), BLACK),
    f"mixture, stopped after {STOP}": (("mixture", STOP), VERMILION),
    "one Gaussian, learning on": (("power", 0), BLUE),
}
"""Method and stop of each curve, and its colour."""


def draw_6_3(seed: int = 0, n_seeds: int = 20) -> tuple[Figure, dict]:
    """Measured: mean number of components, of all throws and at the end, and median regret of the
    best known aim of each curve.
    """
    tasks = [
        search_task(method, "thesis", seed + n, "expected", stop)
        for (method, stop), _ in CURVES.values()
        for n in range(n_seeds)
    ]
    done = run_tasks(run, tasks)
    runs = {name: done[k * n_seeds : (k + 1) * n_seeds] for k, name in enumerate(CURVES)}
    figure = Figure(figsize=(10.5, 4.2), layout="constrained")
    count, loss = figure.subplots(1, 2)
    components = np.array([one["components"] for one in runs[ON]])
    _band(count, components, BLACK, "median and quartiles of the runs")
    for name, (_, colour) in CURVES.items():
        _band(loss, np.array([one["best_regrets"] for one in runs[name]]), colour, name)
    title = f"How many Gaussians the mixture has, n = {n_seeds} runs"
    count.set(xlabel="throw", ylabel="number of Gaussians", ylim=(0, None), title=title)
    count.yaxis.set_major_locator(MaxNLocator(integer=True))
    lost = "lost by the best known aim [points per throw]"
    loss.set(xlabel="throw", ylabel=lost, yscale="log", ylim=(1e-3, 20.0))
    loss.set_title("What is lost: median and quartiles")
    loss.legend(loc="upper left")
    count.legend(loc="lower right")
    letter_panels(count, loss)
    return figure, {
        "mean_components": round(float(components.mean()), 2),
        "at_the_end": round(float(components[:, -1].mean()), 2),
        **{
            regret: {
                name: round(float(np.median([one[regret] for one in group])), 3)
                for name, group in runs.items()
            }
            for regret in ("best_regret", "end_regret")
        },
    }


def _band(axes: Axes, values: np.ndarray, colour: str, label: str) -> None:
    """Median and quartiles over runs of values (n_runs, n_blocks)."""
    throw = BLOCK * (0.5 + np.arange(values.shape[1]))
    low, middle, high = np.percentile(values, [25, 50, 75], axis=0)
    axes.fill_between(throw, low, high, color=colour, alpha=0.25, linewidth=0)
    axes.plot(throw, middle, color=colour, label=label)


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
"""What each method of `regrets` is called."""
REGRETS = {
    "throw_regret": ("each throw", VERMILION, "o"),
    "best_regret": ("best known aim", BLUE, "s"),
    "end_regret": (f"best known aim, last {END} throws", GREEN, "D"),
}
"""Label, colour and marker of each regret."""
DRAWN = ("thesis", "extended")
"""Schedules, a panel each."""
LOWEST = 1e-3
"""What is less is drawn here [points per throw]."""


def regret_tasks(
    seed: int = 0, n_seeds: int = 20, methods: Sequence[str] = tuple(METHODS)
) -> list[dict]:
    """Every method on both schedules; only the one that knows the board learns from what was
    thrown.
    """
    return [
        search_task(
            method, schedule, seed + n, "thrown" if method == "model_based" else "expected"
        )
        for schedule in DRAWN
        for method in methods
        for n in range(n_seeds)
    ]


def draw_regrets(
    seed: int = 0,
    n_seeds: int = 20,
    methods: Sequence[str] = tuple(METHODS),
    folder: Path = Path(),
) -> tuple[Figure, dict]:
    folder.mkdir(parents=True, exist_ok=True)
    tasks = regret_tasks(seed, n_seeds, methods)
    rows = summarise(run_tasks(run, tasks, folder / "regrets.jsonl"))
    figure = Figure(figsize=(10.5, 5.2), layout="constrained")
    for axes, name in zip(figure.subplots(1, len(DRAWN), sharey=True), DRAWN, strict=True):
        sigmas = SCHEDULES[name]
        _draw_schedule(axes, [row for row in rows if row["schedule"] == name])
        said = f"{sigmas[0]:g} to {sigmas[-1]:g} mm in {len(sigmas)} throws"
        axes.set_title(f"{name}: sigma {said}")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    title = f"median and quartiles, n = {n_seeds} runs; at the left edge: {LOWEST:g} or less"
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), title=title)
    return figure, {"rows": rows}


def describe_regrets(measured: dict) -> str:
    """The table."""
    return table_of(measured["rows"])


def _draw_schedule(axes: Axes, rows: list[dict]) -> None:
    places = np.arange(len(rows))
    line: dict[str, Any] = {"transform": axes.get_yaxis_transform(), "zorder": 0}
    axes.hlines(places, 0, 1, color=LIGHT, linewidth=0.5, **line)
    shifted = zip((-0.24, 0.0, 0.24), REGRETS.items(), strict=True)
    for shift, (name, (label, colour, marker)) in shifted:
        low, middle, high = np.maximum([row[name] for row in rows], LOWEST).T
        axes.hlines(places + shift, low, high, color=colour, linewidth=2.0)
        look: dict[str, Any] = {"color": colour, "markersize": 4.5, "clip_on": False}
        axes.plot(middle, places + shift, marker, label=label, **look)
    axes.set(xscale="log", xlim=(LOWEST, 30.0), ylim=(len(rows) - 0.4, -0.6))
    axes.set_xlabel("regret [points per throw]")
    axes.set_yticks(places, [METHODS[row["method"]] for row in rows])
    axes.tick_params(axis="y", length=0)
