"""Figure 6.1: the dart board, drawn to scale from what scores are computed with, each field in the
colour of its score.

Figure 6.2: the search for optima of 5.3 while the thrower gets better, at four moments: the
heat map of the moment, the last 150 trials and the Gaussians.

The thesis shows the most common of its runs, in which splits came at throws 1060 and 1757; here is
the run of the seed, with its own.

Figure 6.6: where to aim, for every precision: the path of the best aim over sigma and the sigma
at which it jumps.

The thesis gives 16.4 mm for the jump from treble 20 to treble 19, from a map on a grid of
millimetres; the value here does not depend on a grid.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from dart_skill.darts import (
    RADII,
    HeatMap,
    OptimumPath,
    expected_score,
    heat_map,
    optimum_path,
    score,
)
from dart_skill.experiments.studies.dart_search import SCHEDULES, SPREAD, START
from dart_skill.figures import (
    BLACK,
    GREY,
    LIGHT,
    draw_board,
    draw_path,
    gaussian_ellipse,
    house_style,
    legend_below,
    letter_panels,
    quantity_colours,
    save,
)
from dart_skill.mixture import GaussianMixture
from dart_skill.policy_search import MixturePoWER

TITLE_6_1 = "The dart board, and what its fields score"
SPACING_6_1, LIMIT = 0.5, 200.0
"""Spacing and limits of the picture [mm]."""


def draw_6_1(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    side = np.arange(-LIMIT, LIMIT + SPACING_6_1, SPACING_6_1)
    points = np.stack(np.meshgrid(side, side), axis=-1)
    values = np.asarray(score(points.reshape(-1, 2)), dtype=float).reshape(points.shape[:2])
    with house_style():
        figure = Figure(figsize=(6.8, 5.8), layout="constrained")
        axes = figure.subplots()
        shown = np.where(np.linalg.norm(points, axis=-1) <= RADII[-1], values, np.nan)
        image = axes.imshow(
            shown,
            origin="lower",
            extent=(-LIMIT, LIMIT, -LIMIT, LIMIT),
            cmap=quantity_colours(),
            interpolation="nearest",
        )
        draw_board(axes, LIGHT)
        figure.colorbar(image, ax=axes, label="score of one dart [points]", shrink=0.8)
        return save(figure, folder, "figure_6_1"), measured_6_1(values)


def measured_6_1(values: np.ndarray) -> dict:
    """The largest score, and its share of the area of the board [%]: of a dart that hits the board
    anywhere alike.
    """
    board = np.pi * RADII[-1] ** 2
    treble_20 = float((values == 60).sum()) * SPACING_6_1**2
    return {
        "largest_score": float(values.max()),
        "treble_20_share_percent": round(100.0 * treble_20 / board, 3),
    }


TITLE_6_2 = "The mixture's search over the board while the thrower gets better"
MOMENTS, LATEST = (150, 1060, 1757, 3000), 150
SPACING_6_2 = 2.0


@dataclass(frozen=True, eq=False)
class SearchMoment:
    """After so many throws: sigma [mm], the last trials (n, 2) [mm], and the mixture."""

    throws: int
    sigma: float
    trials: np.ndarray
    mixture: GaussianMixture


def compute_6_2(seed: int = 0) -> tuple[list[SearchMoment], list[int]]:
    """The moments of one run on the thesis's schedule, and the throws after which the number of
    components changed.
    """
    search, sigmas = (
        MixturePoWER(START, SPREAD, rng=np.random.default_rng([seed, 0])),
        SCHEDULES["thesis"].sigmas,
    )
    tried, before = np.empty((len(sigmas), 2)), 1
    moments: list[SearchMoment] = []
    changes: list[int] = []
    for n, sigma in enumerate(sigmas, start=1):
        trial = search.ask()
        tried[n - 1] = trial.parameters
        search.tell(trial, float(expected_score(trial.parameters[None], sigma)[0]))
        if search.n_components != before:
            changes.append(n)
            before = search.n_components
        if n in MOMENTS:
            moments.append(
                SearchMoment(n, float(sigma), tried[max(0, n - LATEST) : n].copy(), search.mixture)
            )
    return moments, changes


def draw_6_2(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    moments, changes = compute_6_2(seed)
    with house_style():
        figure = Figure(figsize=(13.0, 4.3), layout="constrained")
        panels = figure.subplots(1, len(moments))
        heats = [heat_map(moment.sigma, SPACING_6_2) for moment in moments]
        highest = max(heat.expected_score.max() for heat in heats)
        for axes, moment, heat in zip(panels, moments, heats, strict=True):
            image = _draw_moment(axes, moment, heat, highest)
        figure.colorbar(image, ax=panels, label="expected score [points per dart]", shrink=0.8)
        letter_panels(*panels)
        handles, labels = panels[0].get_legend_handles_labels()
        legend_below(figure, handles, labels, 2)
        return save(figure, folder, "figure_6_2"), measured_6_2(moments, changes)


def measured_6_2(moments: list[SearchMoment], changes: list[int]) -> dict:
    return {
        "components": {str(one.throws): len(one.mixture.priors_) for one in moments},
        "changes": len(changes),
        "first_changes": changes[:5],
    }


def _draw_moment(axes: Axes, moment: SearchMoment, heat: HeatMap, highest: float) -> AxesImage:
    edge = heat.x[-1] + 0.5 * SPACING_6_2
    look: dict[str, Any] = {
        "cmap": quantity_colours(),
        "interpolation": "nearest",
        "vmin": 0.0,
        "vmax": highest,
    }
    score = np.where(np.hypot(heat.x, heat.y[:, None]) <= RADII[-1], heat.expected_score, np.nan)
    image = axes.imshow(score, origin="lower", extent=(-edge, edge, -edge, edge), **look)
    draw_board(axes, "#FFFFFF60")
    axes.plot(
        *moment.trials.T,
        ".",
        color=BLACK,
        markersize=2.5,
        linestyle="none",
        label=f"aim of one of the last {LATEST} throws",
    )
    for number, (mean, covariance) in enumerate(
        zip(moment.mixture.means_, moment.mixture.covariances_, strict=True)
    ):
        name = None if number else "Gaussian of the mixture, 2 standard deviations"
        look = {"facecolor": "none", "zorder": 3}
        axes.add_patch(
            gaussian_ellipse(mean, covariance, 2.0, edgecolor=GREY, linewidth=3.2, **look)
        )
        axes.add_patch(
            gaussian_ellipse(mean, covariance, 2.0, edgecolor="white", linewidth=1.6, **look)
        )
        axes.plot(
            [],
            [],
            "o",
            markerfacecolor="white",
            markeredgecolor=GREY,
            markersize=9,
            linestyle="none",
            label=name,
        )
    axes.set_title(
        f"After {moment.throws} throws\nspread {moment.sigma:.1f} mm,"
        f" {len(moment.mixture.priors_)} Gaussians"
    )
    return image


TITLE_6_6 = "The best aim over the thrower's standard deviation"
LOWEST, HIGHEST = 1.0, 100.0


def draw_6_6(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    """The same for every seed: there is nothing random in it."""
    path = optimum_path(LOWEST, HIGHEST)
    return draw_path(path, folder, "figure_6_6"), measured_6_6(path)


def measured_6_6(path: OptimumPath) -> dict:
    """Jumps [mm], and best aims [mm] at both ends of the range."""
    return {
        "jumps": [
            {"sigma_mm": round(jump.sigma, 3), "below": jump.below.bed, "above": jump.above.bed}
            for jump in path.jumps
        ],
        "aim_at_lowest_mm": path.aims[0].round(1).tolist(),
        "aim_at_highest_mm": path.aims[-1].round(1).tolist(),
    }
