"""Figure 5.1: one update of PoWER. Samples and their weights, the best of them, and the mean (5.1)
and covariance (5.2) that they make.

Figures 5.2 and 5.3: exploration noise as a constant diagonal matrix, which makes a long covariance
rounder, and as much noise shared out as the eigenvalues are, which keeps its shape.

Figure 5.4: a Gaussian split in two along its longest axis (5.7) to (5.12), and the two merged
again. With alpha = beta = 1/2 and u^2 = 3/4, as the thesis has them, mean and covariance of the
two together are those of the one.

Figure 5.5: data spectroscopy with weights (5.13). Points of one Gaussian, weighted by the density
of a mixture of four (5.14), and the groups that their weights make. The thesis does not print its
bandwidth. With the kernel as (5.13) prints it, w_i k w_j, and its threshold 1 / n, the four are
found with one thing added: only eigenvectors above 1 % of the largest eigenvalue count (`least`).
Those of points far out, which weigh next to nothing, would be groups of their own: with all
eigenvectors no seed gives the four. At bandwidths 0.45, 0.5, 0.55 and 0.6 the four come from 20,
20, 19 and 19 of the seeds 5000 to 5019, which no setting was chosen on. As a weight is not a
number of copies there, `data_spectroscopy` has another kernel by default, sqrt(w_i) k sqrt(w_j).
With it the four Gaussians are closer together, and the four are found with a larger threshold
only (0.1, at bandwidth 0.65: 18 of these seeds).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.figures import (
    BLACK,
    BLUE,
    GAUSSIAN,
    GREEN,
    GREY,
    LIGHT,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    add_gaussians,
    legend_below,
    letter_panels,
    plot_mixture,
)
from dart_skill.mixture import GaussianMixture, Spectroscopy, data_spectroscopy, split
from dart_skill.policy_search import (
    PoWER,
    return_weights,
    with_constant_noise,
    with_proportional_noise,
)

OPTIMUM = np.array([1.6, 1.0])
"""Best parameters of figure 5.1."""
N_SAMPLES = 40
"""Number of samples of figure 5.1."""
N_BEST = 10
"""Number of samples that count."""
DEVIATIONS = 2.0
"""Size of ellipses [standard deviations]."""


def reward(parameters: np.ndarray) -> np.ndarray:
    """Rewards (...,) of parameters (..., 2): a hill, longer in one direction than in the other."""
    turned = (parameters - OPTIMUM) @ np.array([[0.8, 0.6], [-0.6, 0.8]]).T
    return np.exp(-0.5 * (turned[..., 0] / 1.6) ** 2 - 0.5 * (turned[..., 1] / 0.8) ** 2)


def power_update(
    seed: int = 0,
) -> tuple[np.ndarray, np.ndarray, list[tuple[np.ndarray, np.ndarray]]]:
    """Parameters (n, 2) that were tried, their returns (n,), and mean (2,) and covariance (2, 2)
    before and after the first update of a search by (5.1) and (5.2) to the letter: returns are
    weights.
    """
    options: dict[str, Any] = {
        "exploration": "constant",
        "weighting": "returns",
        "batch": N_SAMPLES,
        "best": N_BEST,
        "latest": N_SAMPLES,
    }
    search = PoWER(np.zeros(2), 1.0, rng=np.random.default_rng(seed), **options)
    policies = [(search.parameters, search.covariance)]
    trials = list(search.trials(N_SAMPLES))
    returns = [float(reward(trial.parameters)) for trial in trials]
    for trial, earned in zip(trials, returns, strict=True):
        search.tell(trial, earned)
    policies.append((search.parameters, search.covariance))
    return np.array([trial.parameters for trial in trials]), np.array(returns), policies


def draw_5_1(seed: int = 0) -> tuple[Figure, dict]:
    """Measured: return of the mean before and after."""
    tried, returns, (before, after) = power_update(seed)
    best = return_weights(returns, N_BEST, "returns") > 0
    figure = Figure(figsize=(10.5, 4.3), layout="constrained")
    panels = figure.subplots(1, 3, sharex=True, sharey=True)
    all_of_them = np.ones(N_SAMPLES, dtype=bool)
    titles = (
        f"The policy and {N_SAMPLES} samples of it",
        f"The best {N_BEST} of them",
        "New mean (5.1) and covariance (5.2)",
    )
    shown = zip(panels, (all_of_them, best, best), (before, before, after), titles, strict=True)
    for axes, kept, policy, title in shown:
        _draw_hill(axes)
        look: dict[str, Any] = {"facecolor": "none", "edgecolor": BLACK, "linewidth": 0.9}
        size = 120 * returns[kept] / returns.max()
        axes.scatter(*tried[kept].T, s=size, label="sample, area by its return", **look)
        _draw_policy(axes, *policy)
        axes.set(xlabel="first parameter [1]", aspect="equal", title=title)
    panels[0].set_ylabel("second parameter [1]")
    letter_panels(*panels)
    handles, labels = panels[0].get_legend_handles_labels()
    legend_below(figure, handles, labels, 5)
    return figure, {
        "return_before": round(float(reward(before[0])), 3),
        "return_after": round(float(reward(after[0])), 3),
    }


def _draw_hill(axes: Axes) -> None:
    x, y = np.meshgrid(np.linspace(-3.2, 4.2, 75), np.linspace(-3.2, 3.6, 69))
    height = reward(np.stack([x, y], axis=-1))
    axes.contour(x, y, height, levels=[0.1, 0.3, 0.5, 0.7, 0.9], colors=LIGHT, linewidths=0.7)
    axes.plot([], [], color=LIGHT, linewidth=0.7, label="return 0.1, 0.3, ..., 0.9")
    axes.plot(*OPTIMUM, "x", color=GREY, markersize=7, linestyle="none", label="best parameters")


def _draw_policy(axes: Axes, mean: np.ndarray, covariance: np.ndarray) -> None:
    look = {"facecolor": "none", "edgecolor": GAUSSIAN, "linewidth": 2.0}
    (ellipse,) = add_gaussians(axes, [mean], [covariance], DEVIATIONS, **look)
    ellipse.set_label(f"policy, {DEVIATIONS:g} standard deviations")
    dot: dict[str, Any] = {"color": GAUSSIAN, "markeredgecolor": BLACK, "markersize": 7}
    axes.plot(*mean, "o", linestyle="none", label="its mean", **dot)


LONG = 1.0
"""Standard deviation of the covariance of figures 5.2 and 5.3 along its longer axis."""
SHORT = 0.25
"""Standard deviation of that covariance along its shorter axis."""


def draw_5_2(seed: int = 0) -> tuple[Figure, dict]:
    """The same for every seed: there is nothing random in it."""
    return _noise(with_constant_noise, "constant diagonal matrix added")


def draw_5_3(seed: int = 0) -> tuple[Figure, dict]:
    """The same for every seed: there is nothing random in it."""
    return _noise(with_proportional_noise, "eigenvalues increased in proportion")


def _noise(add: Callable, title: str) -> tuple[Figure, dict]:
    """A covariance before and after its eigenvalues (2,) get noise of half a unit; measured: how
    much longer than wide it is.
    """
    angle = np.radians(35.0)
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    before = np.array([LONG, SHORT]) ** 2
    after = add(before, 0.5)
    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    look = {"facecolor": LIGHT, "edgecolor": BLUE, "alpha": 0.6}
    for panel, variances, what in zip(panels, (before, after), ("before", title), strict=True):
        add_gaussians(panel, [np.zeros(2)], [(axes * variances) @ axes.T], 1.0, **look)
        for axis, variance in zip(axes.T, variances, strict=True):
            panel.plot(*np.outer([0.0, np.sqrt(variance)], axis).T, color=VERMILION)
        panel.set(xlim=(-1.5, 1.5), ylim=(-1.5, 1.5), aspect="equal")
        panel.set(xlabel="first parameter", title=what)
    panels[0].set_ylabel("second parameter")
    longer = round(float(np.sqrt(after[0] / after[1])), 3)
    return figure, {"long_over_short_before": LONG / SHORT, "after": longer}


def draw_5_4(seed: int = 0) -> tuple[Figure, dict]:
    """A Gaussian of a random shape, its two halves, and what they are merged; measured: how far
    apart the halves are, in deviations of the whole along its axis, and the largest difference
    after the merger.
    """
    root = np.random.default_rng(seed).normal(size=(2, 2)) + np.diag([2.0, 0.5])
    one = GaussianMixture.from_parameters([1.0], [[0.0, 0.0]], [root @ root.T + 0.2 * np.eye(2)])
    two = split(one, 0)
    merged = two.merge([0, 1])
    figure = Figure(figsize=(10.0, 3.6), layout="constrained")
    panels = figure.subplots(1, 3, sharex=True, sharey=True)
    titles = "One Gaussian", "split along its longest axis", "merged again"
    for axes, mixture, title in zip(panels, (one, two, merged), titles, strict=True):
        plot_mixture(axes, one, colour=BLUE)
        if mixture is not one:
            plot_mixture(axes, mixture, colour=VERMILION)
        axes.set(title=title, xlabel="first coordinate", aspect="equal")
    panels[0].set_ylabel("second coordinate")
    letter_panels(*panels)
    apart = np.linalg.norm(two.means_[0] - two.means_[1])
    change = float(np.abs(merged.covariances_ - one.covariances_).max())
    deviation = np.sqrt(np.linalg.eigvalsh(one.covariances_[0])[-1])
    return figure, {
        "halves_apart_over_deviation": round(float(apart / deviation), 6),
        "largest_change_of_the_covariance": round(change, 12),
    }


SAMPLED = 9.0 * np.eye(2)
"""Covariance of the Gaussian from which the points of figure 5.5 are drawn."""
MIXTURE = GaussianMixture.from_parameters(
    [0.25] * 4, [[3, 3], [-3, 3], [3, -3], [-3, -3]], [2.0 * np.eye(2)] * 4
)
"""Its density is the weight of the points."""
PRINTED: dict[str, Any] = {"bandwidth": 0.5, "reading": "printed"}
"""Options for (5.13) as it is printed."""
COPIES: dict[str, Any] = {"bandwidth": 0.65, "tolerance": 0.1}
"""Options for a weight that is a number of copies."""
COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY)
"""Colours of the groups."""


def weighted_points(seed: int = 0) -> tuple[np.ndarray, np.ndarray, Spectroscopy]:
    """Points (n, 2), their weights (n,), and what data spectroscopy makes of them."""
    rng = np.random.default_rng(seed)
    points = rng.multivariate_normal(np.zeros(2), SAMPLED, 1000, method="cholesky")
    weights = np.exp(MIXTURE.log_density(points))  # (5.14)
    return points, weights, data_spectroscopy(points, weights, **PRINTED)


def draw_5_5(seed: int = 0) -> tuple[Figure, dict]:
    """Measured: number of groups; share of all weight whose label is the Gaussian that most likely
    weighs it, the groups matched with Gaussians.
    """
    points, weights, groups = weighted_points(seed)
    figure = Figure(figsize=(9.0, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    size = 24 * weights / weights.max()
    left.scatter(*points.T, s=size, color=GREY, linewidth=0)
    look: dict[str, Any] = {"facecolor": "none", "linewidth": 2.0}
    add_gaussians(left, [np.zeros(2)], [SAMPLED], DEVIATIONS, edgecolor=VERMILION, **look)
    means, covariances = MIXTURE.means_, MIXTURE.covariances_
    add_gaussians(left, means, covariances, DEVIATIONS, edgecolor=BLUE, **look)
    left.set_title(
        "points of one Gaussian (red), area by weight:\nthe density of four (blue),"
        f" {DEVIATIONS:g} s.d."
    )
    colours = np.array(COLOURS)[groups.labels % len(COLOURS)]
    right.scatter(*points.T, s=size, color=colours, linewidth=0)
    bandwidth = PRINTED["bandwidth"]
    right.set_title(f"{groups.n_groups} groups at bandwidth {bandwidth:g},\n(5.13) as printed")
    for axes in (left, right):
        axes.set(xlabel="first coordinate", aspect="equal", xlim=(-9, 9), ylim=(-9, 9))
    left.set_ylabel("second coordinate")
    likely = MIXTURE.responsibilities(points).argmax(axis=1)
    together = np.zeros((groups.n_groups, len(means)))
    np.add.at(together, (groups.labels, likely), weights / weights.sum())
    everything = data_spectroscopy(points, weights, **{**PRINTED, "least": 0.0})
    return figure, {
        "groups": groups.n_groups,
        "groups_if_all_eigenvectors_count": everything.n_groups,
        "groups_if_weights_are_copies": data_spectroscopy(points, weights, **COPIES).n_groups,
        "weight_labelled_as_its_gaussian": round(float(together.max(axis=1).sum()), 3),
    }
