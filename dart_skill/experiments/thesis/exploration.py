"""Figure 5.1: one update of PoWER. Samples and their weights, the best of them, and the mean (5.1)
and covariance (5.2) that they make.

Figure 5.2: exploration noise as a constant diagonal matrix, which makes a long covariance
rounder.

Figure 5.3: as much exploration noise as in figure 5.2, shared out as the eigenvalues are, which
keeps the shape of the covariance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.figures import (
    BLACK,
    BLUE,
    GAUSSIAN,
    GREY,
    LIGHT,
    VERMILION,
    gaussian_ellipse,
    house_style,
    legend_below,
    letter_panels,
    save,
)
from dart_skill.policy_search import (
    PoWER,
    return_weights,
    with_constant_noise,
    with_proportional_noise,
)

TITLE_5_1 = "One update of PoWER: samples, the best of them, new mean and covariance"
START, SPREAD, OPTIMUM = np.zeros(2), 1.0, np.array([1.6, 1.0])
N_SAMPLES, N_BEST = 40, 10
DEVIATIONS = 2.0


@dataclass(frozen=True, eq=False)
class Update:
    """Parameters (n, 2) that were tried, their returns (n,), the weights (n,) of the best, and
    mean (2,) and covariance (2, 2) before and after.
    """

    tried: np.ndarray
    returns: np.ndarray
    weights: np.ndarray
    before: tuple[np.ndarray, np.ndarray]
    after: tuple[np.ndarray, np.ndarray]


def reward(parameters: np.ndarray) -> float:
    """A hill, longer in one direction than in the other."""
    along, across = (parameters - OPTIMUM) @ np.array([[0.8, 0.6], [-0.6, 0.8]]).T
    return float(np.exp(-0.5 * (along / 1.6) ** 2 - 0.5 * (across / 0.8) ** 2))


def compute_5_1(seed: int = 0) -> Update:
    """The first update of a search by (5.1) and (5.2) to the letter: returns are weights."""
    options: dict[str, Any] = {
        "exploration": "constant",
        "weighting": "returns",
        "batch": N_SAMPLES,
        "best": N_BEST,
        "latest": N_SAMPLES,
    }
    search = PoWER(START, SPREAD, rng=np.random.default_rng(seed), **options)
    before = search.parameters, search.covariance
    trials = list(search.trials(N_SAMPLES))
    returns = np.array([reward(trial.parameters) for trial in trials])
    for trial, earned in zip(trials, returns, strict=True):
        search.tell(trial, earned)
    weights = return_weights(returns, N_BEST, "returns")
    return Update(
        np.array([trial.parameters for trial in trials]),
        returns,
        weights,
        before,
        (search.parameters, search.covariance),
    )


def draw_5_1(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    update = compute_5_1(seed)
    best = update.weights > 0
    with house_style():
        figure = Figure(figsize=(10.5, 4.3), layout="constrained")
        samples, elite, updated = figure.subplots(1, 3, sharex=True, sharey=True)
        for axes, shown in (
            (samples, np.ones(N_SAMPLES, dtype=bool)),
            (elite, best),
            (updated, best),
        ):
            _hill(axes)
            size = 120 * update.returns[shown] / update.returns.max()
            axes.scatter(
                *update.tried[shown].T,
                s=size,
                facecolor="none",
                edgecolor=BLACK,
                linewidth=0.9,
                label="sample, area by its return",
            )
        for axes in (samples, elite):
            _policy(axes, *update.before)
        _policy(updated, *update.after)
        samples.set_title(f"The policy and {N_SAMPLES} samples of it")
        elite.set_title(f"The best {N_BEST} of them")
        updated.set_title("New mean (5.1) and covariance (5.2)")
        samples.set_ylabel("second parameter [1]")
        for axes in (samples, elite, updated):
            axes.set(xlabel="first parameter [1]", aspect="equal")
        letter_panels(samples, elite, updated)
        handles, labels = samples.get_legend_handles_labels()
        legend_below(figure, handles, labels, 5)
        return save(figure, folder, "figure_5_1"), measured_5_1(update)


def measured_5_1(update: Update) -> dict:
    """Return of the mean before and after."""
    return {
        "return_before": round(reward(update.before[0]), 3),
        "return_after": round(reward(update.after[0]), 3),
    }


def _hill(axes: Axes) -> None:
    x, y = np.meshgrid(np.linspace(-3.2, 4.2, 75), np.linspace(-3.2, 3.6, 69))
    height = np.array(
        [reward(point) for point in np.column_stack([x.ravel(), y.ravel()])]
    ).reshape(x.shape)
    axes.contour(x, y, height, levels=[0.1, 0.3, 0.5, 0.7, 0.9], colors=LIGHT, linewidths=0.7)
    axes.plot([], [], color=LIGHT, linewidth=0.7, label="return 0.1, 0.3, ..., 0.9")
    axes.plot(*OPTIMUM, "x", color=GREY, markersize=7, linestyle="none", label="best parameters")


def _policy(axes: Axes, mean: np.ndarray, covariance: np.ndarray) -> None:
    name = f"policy, {DEVIATIONS:g} standard deviations"
    axes.add_patch(
        gaussian_ellipse(
            mean,
            covariance,
            DEVIATIONS,
            facecolor="none",
            edgecolor=GAUSSIAN,
            linewidth=2.0,
            label=name,
        )
    )
    axes.plot(
        *mean,
        "o",
        color=GAUSSIAN,
        markeredgecolor=BLACK,
        markersize=7,
        linestyle="none",
        label="its mean",
    )


TITLE_5_2 = "Exploration noise, constant: the covariance becomes rounder"
ANGLE, LONG, SHORT = np.radians(35.0), 1.0, 0.25
NOISE = 0.5
"""Standard deviations of the covariance along its axes, and of the noise, in units of the
parameters.
"""


def draw_5_2(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    """The same for every seed: there is nothing random in it."""
    return draw_noise(folder, "figure_5_2", with_constant_noise, "constant diagonal matrix added")


def draw_noise(
    folder: str | Path, name: str, add: Callable, title: str
) -> tuple[list[Path], dict]:
    """A covariance before and after its eigenvalues (2,) get noise; how much longer than wide it
    is.
    """
    axes = np.array([[np.cos(ANGLE), -np.sin(ANGLE)], [np.sin(ANGLE), np.cos(ANGLE)]])
    before = np.array([LONG, SHORT]) ** 2
    after = add(before, NOISE)
    with house_style():
        figure = Figure(figsize=(8.0, 4.0), layout="constrained")
        panels = figure.subplots(1, 2, sharex=True, sharey=True)
        for panel, variances, what in zip(panels, (before, after), ("before", title), strict=True):
            covariance = (axes * variances) @ axes.T
            panel.add_patch(
                gaussian_ellipse(
                    np.zeros(2), covariance, 1.0, facecolor=LIGHT, edgecolor=BLUE, alpha=0.6
                )
            )
            for axis, variance in zip(axes.T, variances, strict=True):
                panel.plot(*np.outer([0.0, np.sqrt(variance)], axis).T, color=VERMILION)
            panel.set(
                xlim=(-1.5, 1.5),
                ylim=(-1.5, 1.5),
                aspect="equal",
                xlabel="first parameter",
                title=what,
            )
        panels[0].set_ylabel("second parameter")
        return save(figure, folder, name), {
            "long_over_short_before": LONG / SHORT,
            "after": round(float(np.sqrt(after[0] / after[1])), 3),
        }


TITLE_5_3 = "Exploration noise, proportional to the eigenvalues: the covariance keeps its shape"


def draw_5_3(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    """The same for every seed: there is nothing random in it."""
    return draw_noise(
        folder, "figure_5_3", with_proportional_noise, "eigenvalues increased in proportion"
    )
