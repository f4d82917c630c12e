"""Figure 5.4: a Gaussian split in two along its longest axis (5.7) to (5.12), and the two merged
again.

With alpha = beta = 1/2 and u^2 = 3/4, as the thesis has them, mean and covariance of the two
together are those of the one.

Figure 5.5: data spectroscopy with weights (5.13). Points of one Gaussian, weighted by the
density of a mixture of four (5.14), and the groups that their weights make.

The thesis does not print its bandwidth. With the kernel as (5.13) prints it, w_i k w_j, and its
threshold 1 / n, the four are found at bandwidths 0.45 to 0.6 with one thing added: what 1 % of the
weight does is not counted (`core`). Points far out weigh next to nothing, and would be groups of
their own: with all weight (core = 1) hardly any seed gives the four.

As a weight is not a number of copies there, `data_spectroscopy` has another kernel by default,
sqrt(w_i) k sqrt(w_j). With it the four Gaussians are closer together, and the four are found with
a larger threshold only (0.1, at bandwidth 0.65: 19 of 20 seeds).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from dart_skill.figures import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    gaussian_ellipse,
    house_style,
    letter_panels,
    plot_mixture,
    save,
)
from dart_skill.mixture import GaussianMixture, Spectroscopy, data_spectroscopy, split

TITLE_5_4 = "A Gaussian split in two, and merged again"


def compute_5_4(seed: int = 0) -> tuple[GaussianMixture, GaussianMixture, GaussianMixture]:
    """A Gaussian of a random shape, its two halves, and what they are merged."""
    root = np.random.default_rng(seed).normal(size=(2, 2)) + np.diag([2.0, 0.5])
    one = GaussianMixture.from_parameters([1.0], [[0.0, 0.0]], [root @ root.T + 0.2 * np.eye(2)])
    two = split(one, 0)
    return one, two, two.merge([0, 1])


def draw_5_4(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    one, two, merged = compute_5_4(seed)
    with house_style():
        figure = Figure(figsize=(10.0, 3.6), layout="constrained")
        panels = figure.subplots(1, 3, sharex=True, sharey=True)
        titles = "One Gaussian", "split along its longest axis", "merged again"
        for axes, mixture, title in zip(panels, (one, two, merged), titles, strict=True):
            if mixture is not one:
                plot_mixture(axes, one, colour=BLUE)
            plot_mixture(axes, mixture, colour=BLUE if mixture is one else VERMILION)
            axes.set(title=title, xlabel="first coordinate", aspect="equal")
        panels[0].set_ylabel("second coordinate")
        letter_panels(*panels)
        return save(figure, folder, "figure_5_4"), measured_5_4(one, two, merged)


def measured_5_4(one: GaussianMixture, two: GaussianMixture, merged: GaussianMixture) -> dict:
    """How far apart the halves are, in deviations of the whole along its axis, and the largest
    difference after the merger.
    """
    variance = np.linalg.eigvalsh(one.covariances_[0])[-1]
    return {
        "halves_apart_over_deviation": round(
            float(np.linalg.norm(two.means_[0] - two.means_[1]) / np.sqrt(variance)), 6
        ),
        "largest_change_of_the_covariance": round(
            float(np.abs(merged.covariances_ - one.covariances_).max()), 12
        ),
    }


TITLE_5_5 = "Data spectroscopy finds the groups of weighted points"
N_POINTS, SAMPLED = 1000, 9.0 * np.eye(2)
MIXTURE = GaussianMixture.from_parameters(
    [0.25] * 4, [[3, 3], [-3, 3], [3, -3], [-3, -3]], [2.0 * np.eye(2)] * 4
)
BANDWIDTH, CORE, READING = 0.55, 0.99, "printed"
COPIES: dict[str, Any] = {"bandwidth": 0.65, "core": CORE, "tolerance": 0.1, "reading": "copies"}
"""For a weight that is a number of copies."""
DEVIATIONS = 2.0
COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY)


@dataclass(frozen=True, eq=False)
class Grouping:
    """Points (n, 2), their weights (n,), and what data spectroscopy makes of them."""

    points: np.ndarray
    weights: np.ndarray
    groups: Spectroscopy


def compute_5_5(seed: int = 0) -> Grouping:
    points = np.random.default_rng(seed).multivariate_normal(
        np.zeros(2), SAMPLED, N_POINTS, method="cholesky"
    )
    weights = np.exp(MIXTURE.log_density(points))  # (5.14)
    return Grouping(
        points,
        weights,
        data_spectroscopy(points, weights, bandwidth=BANDWIDTH, core=CORE, reading=READING),
    )


def draw_5_5(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    grouping = compute_5_5(seed)
    with house_style():
        figure = Figure(figsize=(9.0, 4.4), layout="constrained")
        left, right = figure.subplots(1, 2, sharex=True, sharey=True)
        size = 24 * grouping.weights / grouping.weights.max()
        left.scatter(*grouping.points.T, s=size, color=GREY, linewidth=0)
        left.add_patch(
            gaussian_ellipse(
                np.zeros(2),
                SAMPLED,
                DEVIATIONS,
                facecolor="none",
                edgecolor=VERMILION,
                linewidth=2.0,
            )
        )
        for component in MIXTURE.components:
            ellipse = gaussian_ellipse(
                component.mean,
                component.covariance,
                DEVIATIONS,
                facecolor="none",
                edgecolor=BLUE,
                linewidth=2.0,
            )
            left.add_patch(ellipse)
        left.set_title(
            "points of one Gaussian (red), area by weight:\nthe density of four (blue),"
            f" {DEVIATIONS:g} s.d."
        )
        for group in range(grouping.groups.n_groups):
            own = grouping.groups.labels == group
            right.scatter(
                *grouping.points[own].T,
                s=size[own],
                color=COLOURS[group % len(COLOURS)],
                linewidth=0,
            )
        right.set_title(
            f"{grouping.groups.n_groups} groups at bandwidth {BANDWIDTH:g},\n(5.13) as printed"
        )
        for axes in (left, right):
            axes.set(xlabel="first coordinate", aspect="equal", xlim=(-9, 9), ylim=(-9, 9))
        left.set_ylabel("second coordinate")
        return save(figure, folder, "figure_5_5"), measured_5_5(grouping)


def measured_5_5(grouping: Grouping) -> dict:
    """Number of groups; share of all weight whose label is the Gaussian that most likely weighs
    it, the groups matched with Gaussians.
    """
    likely = MIXTURE.responsibilities(grouping.points).argmax(axis=1)
    together = np.zeros((grouping.groups.n_groups, len(MIXTURE.priors_)))
    np.add.at(
        together, (grouping.groups.labels, likely), grouping.weights / grouping.weights.sum()
    )
    return {
        "groups": grouping.groups.n_groups,
        "groups_if_all_weight_counts": (
            data_spectroscopy(
                grouping.points, grouping.weights, bandwidth=BANDWIDTH, core=1.0, reading=READING
            ).n_groups
        ),
        "groups_if_weights_are_copies": (
            data_spectroscopy(grouping.points, grouping.weights, **COPIES).n_groups
        ),
        "weight_labelled_as_its_gaussian": round(float(together.max(axis=1).sum()), 3),
    }
