"""Section 6.5: a landscape modelled with all data. The thesis has no figure of it; it says that
the search for several optima "can also be used for modeling a solution landscape if we consider
multi optima search algorithm with all data points (without importance sampling)", which is EM with
an adaptive number of components.

Aims all over the board, each with its expected score as its weight. The mixture begins as one
Gaussian. EM and one split and one merge (5.7)-(5.12) take turns until nothing changes. How well a
mixture models the landscape: the share of its density that is elsewhere than that of the scores,
both scaled to sum one over the board.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dart_skill.darts import RADII, expected_score
from dart_skill.figures import (
    BLUE,
    GREY,
    VERMILION,
    draw_board,
    gaussian_ellipse,
    house_style,
    letter_panels,
    quantity_colours,
    save,
)
from dart_skill.mixture import GaussianMixture, SplitMerge, split_and_merge

TITLE_landscape = "A landscape modelled by a mixture that is told all of it"
SIGMA, APART, SPACING = 10.0, 7.0, 2.0
"""Standard deviation of the thrower, distance between aims, spacing of the picture [mm]."""
THRESHOLDS = ((0.16, 0.01), (0.02, 0.005), (0.01, 0.002), (0.005, 0.001))
"""T^S and T^M, the thesis's first."""
SHOWN = 3
"""Which of them is drawn."""
MOST_ROUNDS = 80
FLOOR = 4.0
"""Least variance of a component along any axis [mm^2]."""


@dataclass(frozen=True, eq=False)
class Model:
    """A mixture, and how well it models the landscape: misplaced, share of its density;
    correlation with the scores over the board.
    """

    thresholds: tuple[float, float]
    mixture: GaussianMixture
    misplaced: float
    correlation: float


def adapted(
    aims: np.ndarray, scores: np.ndarray, thresholds: tuple[float, float], rng: np.random.Generator
) -> GaussianMixture:
    """The mixture of all aims (n, 2) [mm] with their scores (n,) as weights.

    Parameters
    ----------
    thresholds
        Of splits and of merges.
    """
    rule = SplitMerge(*thresholds, refine=2, covariance_floor=FLOOR)
    mixture = GaussianMixture(1).fit(aims, scores, rng=rng)
    for _ in range(MOST_ROUNDS):
        change = split_and_merge(mixture, aims, scores, rule)
        if change.split is None and change.merged is None:
            break
        mixture = GaussianMixture(len(change.mixture.priors_)).fit(
            aims, scores, start=change.mixture
        )
    return mixture


def compute_landscape(seed: int = 0) -> tuple[list[Model], float]:
    """The model of each pair of thresholds, and what a uniform density misplaces; hardly anything
    of it depends on the seed.
    """
    rng, aims, places = np.random.default_rng(seed), _places(APART), _places(SPACING)
    scores = expected_score(aims, SIGMA)
    wanted = _shares(expected_score(places, SIGMA))
    models = []
    for thresholds in THRESHOLDS:
        mixture = adapted(aims, scores, thresholds, rng)
        found = _shares(np.exp(mixture.log_density(places)))
        models.append(
            Model(
                thresholds,
                mixture,
                _misplaced(found, wanted),
                float(np.corrcoef(found, wanted)[0, 1]),
            )
        )
    return models, _misplaced(np.full(len(places), 1.0 / len(places)), wanted)


def draw_landscape(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    models, uniform = compute_landscape(seed)
    shown = models[SHOWN]
    with house_style():
        figure = Figure(figsize=(13.0, 4.6), layout="constrained")
        scores, density, misplaced = figure.subplots(1, 3)
        places = _places(SPACING)
        for axes, values in (
            (scores, expected_score(places, SIGMA)),
            (density, np.exp(shown.mixture.log_density(places))),
        ):
            image = axes.imshow(_on_grid(_shares(values) * len(places)), **_look())
            draw_board(axes, "#FFFFFF60")
        for number, part in enumerate(shown.mixture.components):
            name = None if number else "components, one standard deviation"
            density.add_patch(
                gaussian_ellipse(
                    part.mean,
                    part.covariance,
                    1.0,
                    facecolor="none",
                    edgecolor="white",
                    linewidth=1.2,
                )
            )
            density.plot(
                [],
                [],
                "o",
                markerfacecolor="white",
                markeredgecolor=GREY,
                markersize=9,
                linestyle="none",
                label=name,
            )
        figure.colorbar(
            image, ax=[scores, density], label="in parts of the mean over the board", shrink=0.8
        )
        scores.set_title(f"Expected score of an aim, spread {SIGMA:g} mm")
        density.set_title(
            f"{len(shown.mixture.priors_)} Gaussians of {len(_places(APART))} aims, splits from"
            f" {shown.thresholds[0]:g}"
        )
        density.legend(loc="upper center", bbox_to_anchor=(0.5, 0.02))
        _draw_misplaced(misplaced, models, uniform)
        letter_panels(scores, density, misplaced)
        return save(figure, folder, "landscape"), measured_landscape(models, uniform)


def measured_landscape(models: list[Model], uniform: float) -> dict:
    """Components and fit by the threshold of splits."""
    return {
        "components": {f"{one.thresholds[0]:g}": len(one.mixture.priors_) for one in models},
        "misplaced": {f"{one.thresholds[0]:g}": round(one.misplaced, 3) for one in models},
        "correlation": {f"{one.thresholds[0]:g}": round(one.correlation, 2) for one in models},
        "misplaced_by_a_uniform_density": round(uniform, 3),
    }


def _draw_misplaced(axes: Any, models: list[Model], uniform: float) -> None:
    counts, shares = (
        [len(one.mixture.priors_) for one in models],
        [100.0 * one.misplaced for one in models],
    )
    axes.plot(counts, shares, "o-", color=BLUE, label="mixture")
    for count, share, one in zip(counts, shares, models, strict=True):
        axes.annotate(
            f"{one.thresholds[0]:g}",
            (count, share),
            xytext=(4, 5),
            textcoords="offset points",
            fontsize=8.5,
            color=GREY,
        )
    axes.axhline(
        100.0 * uniform, color=VERMILION, linestyle="--", label="the same density everywhere"
    )
    axes.set(
        xlabel="number of Gaussians",
        ylabel="density that is elsewhere than the scores [%]",
        xlim=(0, None),
    )
    axes.set_ylim(0, 1.12 * max(shares))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_title("Fit, by the threshold of splits")
    axes.legend(loc="lower left")


def _grid(spacing: float) -> np.ndarray:
    """A square grid (m, m, 2) that holds the board [mm]."""
    edge = spacing * np.floor(RADII[-1] / spacing)
    axis = np.arange(-edge, edge + 0.5 * spacing, spacing)
    return np.stack(np.meshgrid(axis, axis), axis=-1)


def _places(spacing: float) -> np.ndarray:
    """What of the grid is on the board (n, 2) [mm]."""
    grid = _grid(spacing)
    return grid[np.hypot(*np.moveaxis(grid, -1, 0)) <= RADII[-1]]


def _on_grid(values: np.ndarray) -> np.ndarray:
    """Values of the places as a picture (m, m), nan beside the board."""
    grid = _grid(SPACING)
    picture = np.full(grid.shape[:2], np.nan)
    picture[np.hypot(*np.moveaxis(grid, -1, 0)) <= RADII[-1]] = values
    return picture


def _look() -> dict[str, Any]:
    edge = float(np.abs(_grid(SPACING)).max() + 0.5 * SPACING)
    return {
        "cmap": quantity_colours(),
        "interpolation": "nearest",
        "origin": "lower",
        "extent": (-edge, edge, -edge, edge),
        "vmin": 0,
        "vmax": 2.5,
    }


def _shares(values: np.ndarray) -> np.ndarray:
    return values / values.sum()


def _misplaced(found: np.ndarray, wanted: np.ndarray) -> float:
    """Half the sum of absolute differences of two densities (n,): the share that would have to be
    moved.
    """
    return float(0.5 * np.abs(found - wanted).sum())
