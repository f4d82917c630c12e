"""Figure 5.4: a Gaussian split in two along its longest axis (5.7) to (5.12), and the two merged
again.

With alpha = beta = 1/2 and u^2 = 3/4, as the thesis has them, mean and covariance of the two
together are those of the one.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dart_skill.figures import BLUE, VERMILION, house_style, letter_panels, plot_mixture, save
from dart_skill.mixture import GaussianMixture, split

TITLE = "A Gaussian split in two, and merged again"


def compute(seed: int = 0) -> tuple[GaussianMixture, GaussianMixture, GaussianMixture]:
    """A Gaussian of a random shape, its two halves, and what they are merged."""
    root = np.random.default_rng(seed).normal(size=(2, 2)) + np.diag([2.0, 0.5])
    one = GaussianMixture.from_parameters([1.0], [[0.0, 0.0]], [root @ root.T + 0.2 * np.eye(2)])
    two = split(one, 0)
    return one, two, two.merge([0, 1])


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    one, two, merged = compute(seed)
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
        return save(figure, folder, "figure_5_4"), measured(one, two, merged)


def measured(one: GaussianMixture, two: GaussianMixture, merged: GaussianMixture) -> dict:
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
