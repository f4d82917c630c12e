"""Figure 5.1: one update of PoWER. Samples and their weights, the best of them, and the mean (5.1)
and covariance (5.2) that they make.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.figures import (
    BLACK,
    GAUSSIAN,
    GREY,
    LIGHT,
    gaussian_ellipse,
    house_style,
    legend_below,
    letter_panels,
    save,
)
from dart_skill.policy_search import PoWER, return_weights

TITLE = "One update of PoWER: samples, the best of them, new mean and covariance"
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


def compute(seed: int = 0) -> Update:
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


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    update = compute(seed)
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
        return save(figure, folder, "figure_5_1"), measured(update)


def measured(update: Update) -> dict:
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
