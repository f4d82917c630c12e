"""Figure 6.1: the dart board, drawn to scale from what scores are computed with, each field in the
colour of its score.

Figure 6.4: stochastic universal sampling. Weights are laid end to end, and pointers at equal
distances choose among them. Beside it the counts of many draws, with those of as many independent
draws: the expected number is the same, the spread is not.

Figure 6.5: the average log-likelihood (6.3) of data resampled by their weights tends to that of
the weighted data in closed form (6.4), as more is drawn. The thesis does not say which data and
mixture it used (its limit is 1.8621); here they are those of figure 5.5, with fewer points.

Section 6.5, `landscape`: a landscape modelled with all data. The thesis has no figure of it; it
says that the search for several optima "can also be used for modeling a solution landscape if we
consider multi optima search algorithm with all data points (without importance sampling)", which
is EM with an adaptive number of components. Aims all over the board, each with its expected score
as its weight. The mixture begins as one Gaussian. EM and one split and one merge (5.7)-(5.12) take
turns until nothing changes. How well a mixture models the landscape: the share of its density that
is elsewhere than that of the scores, both scaled to sum one over the board.

Figure 6.6: where to aim, for every precision: the path of the best aim over sigma and the sigma
at which it jumps. The thesis gives 16.4 mm for the jump from treble 20 to treble 19, from a map on
a grid of millimetres; the value here does not depend on a grid.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dart_skill.darts import RADII, expected_score, optimum_path, score
from dart_skill.experiments.thesis.chapter_5 import COLOURS, MIXTURE, SAMPLED
from dart_skill.figures import (
    BLUE,
    GREY,
    LIGHT,
    VERMILION,
    add_gaussians,
    draw_board,
    letter_panels,
    path_figure,
    quantity_colours,
)
from dart_skill.mixture import (
    GaussianMixture,
    SplitMerge,
    mean_log_likelihood,
    resampled_mean_log_likelihood,
    split_and_merge,
    stochastic_universal_sampling,
)


def board_grid(spacing: float, limit: float = RADII[-1]) -> tuple[np.ndarray, np.ndarray]:
    """A square grid (m, m, 2) [mm] up to a limit, and which of its nodes are on the board."""
    edge = spacing * np.floor(limit / spacing)
    axis = np.arange(-edge, edge + 0.5 * spacing, spacing)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1)
    return grid, np.linalg.norm(grid, axis=-1) <= RADII[-1]


def draw_6_1(seed: int = 0) -> tuple[Figure, dict]:
    """Measured: the largest score, and the share of treble 20 in the area of the board [%]: of a
    dart that hits the board anywhere alike. The same for every seed.
    """
    spacing, limit = 0.5, 200.0
    points, inside = board_grid(spacing, limit)
    values = np.asarray(score(points), dtype=float)
    figure = Figure(figsize=(6.8, 5.8), layout="constrained")
    axes = figure.subplots()
    image = axes.imshow(
        np.where(inside, values, np.nan),
        origin="lower",
        extent=(-limit, limit, -limit, limit),
        cmap=quantity_colours(),
        interpolation="nearest",
    )
    draw_board(axes, LIGHT)
    figure.colorbar(image, ax=axes, label="score of one dart [points]", shrink=0.8)
    share = 100.0 * float((values == 60).sum()) * spacing**2 / (np.pi * RADII[-1] ** 2)
    return figure, {
        "largest_score": float(values.max()),
        "treble_20_share_percent": round(float(share), 3),
    }


N_DRAWN = 10
"""Number of draws of figure 6.4."""


def draws(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Shares (6,), indices that are drawn once (10,), and how often each is drawn (2000, 6) by
    universal sampling and by independent draws.
    """
    rng = np.random.default_rng(seed)
    shares = rng.dirichlet(np.full(len(COLOURS), 2.0))
    drawn = [stochastic_universal_sampling(shares, N_DRAWN, rng) for _ in range(2001)]
    counts = [np.bincount(one, minlength=len(shares)) for one in drawn[1:]]
    return shares, drawn[0], np.array(counts), rng.multinomial(N_DRAWN, shares, len(counts))


def pointers(ends: np.ndarray, once: np.ndarray) -> np.ndarray:
    """Places of pointers that choose as was drawn: the middle of all that do."""
    steps = np.arange(N_DRAWN) / N_DRAWN
    first = max(0.0, float((ends[once] - steps).max()))
    last = min(1.0 / N_DRAWN, float((ends[once + 1] - steps).min()))
    return steps + 0.5 * (first + last)


def draw_6_4(seed: int = 0) -> tuple[Figure, dict]:
    """Measured: largest distance of a number from its expected one, and the mean standard
    deviation over the points, of both.
    """
    shares, once, universal, independent = draws(seed)
    figure = Figure(figsize=(10.0, 3.4), layout="constrained")
    laid, spread = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
    ends = np.concatenate([[0.0], np.cumsum(shares)])
    look: dict[str, Any] = {"height": 0.5, "alpha": 0.6, "edgecolor": "white"}
    laid.barh(np.zeros(len(shares)), shares, left=ends[:-1], color=COLOURS, **look)
    for k, middle in enumerate(0.5 * (ends[:-1] + ends[1:])):
        laid.text(middle, 0.0, f"{k + 1}", ha="center", va="center")
        laid.text(middle, -0.42, f"{(once == k).sum()} x", ha="center", color=GREY)
    laid.plot(pointers(ends, once), np.full(N_DRAWN, 0.42), "v", color="black", markersize=7.0)
    laid.set(xlabel="share of all weight [-]", yticks=[], ylim=(-0.65, 0.65), xlim=(0, 1))
    laid.set_title(f"{N_DRAWN} pointers at equal distances")
    at, deviation = np.arange(1, len(shares) + 1), independent.std(0)
    spread.bar(at - 0.18, deviation, 0.34, color=LIGHT, label="independent draws")
    spread.bar(at + 0.18, universal.std(0), 0.34, color=BLUE, label="universal sampling")
    spread.set(xlabel="point", ylabel="standard deviation of its number [-]")
    spread.set_title(f"{len(universal)} times {N_DRAWN} draws")
    spread.legend(loc="upper left")
    spread.set_ylim(0.0, 1.45 * deviation.max())
    letter_panels(laid, spread)
    return figure, {
        name: {
            "farthest_from_expected": round(float(np.abs(counts - N_DRAWN * shares).max()), 3),
            "mean_deviation": round(float(counts.std(0).mean()), 3),
        }
        for name, counts in (("universal", universal), ("independent", independent))
    }


def draw_6_5(seed: int = 0) -> tuple[Figure, dict]:
    """Measured: (6.4), and the largest error of (6.3) with the fewest and with the most data, five
    factors each.
    """
    n, factors = 100, np.arange(1, 61)
    rng = np.random.default_rng(seed)
    points = rng.multivariate_normal(np.zeros(2), SAMPLED, n, method="cholesky")
    weights = np.exp(MIXTURE.log_density(points))
    resampled = [
        resampled_mean_log_likelihood(MIXTURE, points, weights, int(factor) * n, rng)
        for factor in factors
    ]
    exact = mean_log_likelihood(MIXTURE, points, weights)
    figure = Figure(figsize=(6.4, 3.8), layout="constrained")
    axes = figure.subplots()
    closed = "weighted data, closed form (6.4)"
    axes.axhline(exact, color=VERMILION, linewidth=1.5, label=closed)
    axes.plot(factors, resampled, ".-", color=BLUE, linewidth=1.0, label="resampled data (6.3)")
    axes.set(xlabel="resampled data over data", ylabel="average log-likelihood [nat]")
    axes.legend(loc="upper right")
    errors = np.abs(np.array(resampled) - exact)
    return figure, {
        "closed_form": round(exact, 4),
        "error_at_first": round(float(errors[:5].max()), 5),
        "error_in_the_end": round(float(errors[-5:].max()), 5),
    }


def draw_6_6(seed: int = 0, lowest: float = 1.0, highest: float = 100.0) -> tuple[Figure, dict]:
    """Measured: jumps [mm], and best aims [mm] at both ends of the range. The same for every seed:
    there is nothing random in it.
    """
    path = optimum_path(lowest, highest)
    return path_figure(path), {
        "jumps": [
            {"sigma_mm": round(jump.sigma, 3), "below": jump.below.bed, "above": jump.above.bed}
            for jump in path.jumps
        ],
        "aim_at_lowest_mm": path.aims[0].round(1).tolist(),
        "aim_at_highest_mm": path.aims[-1].round(1).tolist(),
    }


SIGMA = 10.0
"""Standard deviation of the thrower of `landscape` [mm]."""
SPACING = 2.0
"""Spacing of the picture of `landscape` [mm]."""
THRESHOLDS = ((0.16, 0.01), (0.02, 0.005), (0.01, 0.002), (0.005, 0.001))
"""T^S and T^M, the thesis's first; the last one is drawn."""


def adapted_mixture(
    aims: np.ndarray, scores: np.ndarray, thresholds: tuple[float, float], rng: np.random.Generator
) -> GaussianMixture:
    """The mixture of all aims (n, 2) [mm] with their scores (n,) as weights.

    Parameters
    ----------
    thresholds
        Of splits and of merges.
    """
    rule = SplitMerge(*thresholds, refine=2, covariance_floor=4.0)
    mixture = GaussianMixture(1).fit(aims, scores, rng=rng)
    for _ in range(80):
        change = split_and_merge(mixture, aims, scores, rule)
        if change.split is None and change.merged is None:
            break
        n = len(change.mixture.priors_)
        mixture = GaussianMixture(n).fit(aims, scores, start=change.mixture)
    return mixture


def draw_landscape(seed: int = 0) -> tuple[Figure, dict]:
    """Measured: components and fit by the threshold of splits, and what a uniform density
    misplaces; hardly anything of it depends on the seed.
    """
    rng = np.random.default_rng(seed)
    grid, inside = board_grid(SPACING)
    coarse, on_board = board_grid(7.0)
    places, aims = grid[inside], coarse[on_board]
    weights, wanted = expected_score(aims, SIGMA), expected_score(places, SIGMA)
    mixtures = [adapted_mixture(aims, weights, one, rng) for one in THRESHOLDS]
    densities = [np.exp(one.log_density(places)) for one in mixtures]
    wanted, *found = (values / values.sum() for values in (wanted, *densities))
    # Half the sum of absolute differences: the share that would have to be moved.
    uniform, *misplaced = (
        float(0.5 * np.abs(one - wanted).sum())
        for one in (np.full(len(places), 1.0 / len(places)), *found)
    )
    figure = Figure(figsize=(13.0, 4.6), layout="constrained")
    scores, density, fit = figure.subplots(1, 3)
    picture = np.full(inside.shape, np.nan)
    for axes, values in ((scores, wanted), (density, found[-1])):
        picture[inside] = values * len(places)
        edge = grid.max() + 0.5 * SPACING
        look: dict[str, Any] = {"cmap": quantity_colours(), "interpolation": "nearest"}
        look |= {"origin": "lower", "extent": (-edge, edge, -edge, edge), "vmin": 0, "vmax": 2.5}
        image = axes.imshow(picture.copy(), **look)
        draw_board(axes, "#FFFFFF60")
    _draw_components(density, mixtures[-1])
    mean = "in parts of the mean over the board"
    figure.colorbar(image, ax=[scores, density], label=mean, shrink=0.8)
    scores.set_title(f"Expected score of an aim, spread {SIGMA:g} mm")
    counts = [len(one.priors_) for one in mixtures]
    said = f"{len(aims)} aims, splits from {THRESHOLDS[-1][0]:g}"
    density.set_title(f"{counts[-1]} Gaussians of {said}")
    names = [f"{one[0]:g}" for one in THRESHOLDS]
    _draw_fit(fit, names, counts, misplaced, uniform)
    letter_panels(scores, density, fit)
    correlations = [round(float(np.corrcoef(one, wanted)[0, 1]), 2) for one in found]
    return figure, {
        "components": dict(zip(names, counts, strict=True)),
        "misplaced": {name: round(one, 3) for name, one in zip(names, misplaced, strict=True)},
        "correlation": dict(zip(names, correlations, strict=True)),
        "misplaced_by_a_uniform_density": round(uniform, 3),
    }


def _draw_components(axes: Axes, mixture: GaussianMixture) -> None:
    look: dict[str, Any] = {"facecolor": "none", "edgecolor": "white", "linewidth": 1.2}
    add_gaussians(axes, mixture.means_, mixture.covariances_, 1.0, **look)
    dot: dict[str, Any] = {"markerfacecolor": "white", "markeredgecolor": GREY, "markersize": 9}
    label = "components, one standard deviation"
    axes.plot([], [], "o", linestyle="none", label=label, **dot)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.02))


def _draw_fit(
    axes: Axes, names: list[str], counts: list[int], misplaced: list[float], uniform: float
) -> None:
    shares = [100.0 * one for one in misplaced]
    axes.plot(counts, shares, "o-", color=BLUE, label="mixture")
    look: dict[str, Any] = {"xytext": (4, 5), "textcoords": "offset points", "fontsize": 8.5}
    for name, place in zip(names, zip(counts, shares, strict=True), strict=True):
        axes.annotate(name, place, color=GREY, **look)
    everywhere = "the same density everywhere"
    axes.axhline(100.0 * uniform, color=VERMILION, linestyle="--", label=everywhere)
    elsewhere = "density that is elsewhere than the scores [%]"
    axes.set(xlabel="number of Gaussians", ylabel=elsewhere, xlim=(0, None))
    axes.set_ylim(0, 1.12 * max(shares))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_title("Fit, by the threshold of splits")
    axes.legend(loc="lower left")
