"""Figure 3.1: planar demonstrations, the mixture fitted to them, and the mean and spread that
regression retrieves (3.4), (3.5).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.figures import (
    BLACK,
    GAUSSIAN,
    GREY,
    gaussian_ellipse,
    house_style,
    legend_below,
    letter_panels,
    save,
)
from dart_skill.mixture import GaussianMixture, Selection, regress, select_by_bic

TITLE = "Gaussian mixture model and regression on planar data"
N_DEMONSTRATIONS, N_SAMPLES = 6, 100
CANDIDATES = range(1, 11)
DEVIATIONS = 2.0


@dataclass(frozen=True, eq=False)
class PlanarData:
    """x1 (n_demonstrations, n) and x2 of the demonstrations; selection: mixtures by BIC; grid
    (m,), mean (m,) and deviation (m,) of x2.
    """

    x1: np.ndarray
    x2: np.ndarray
    selection: Selection
    grid: np.ndarray
    mean: np.ndarray
    deviation: np.ndarray

    @property
    def mixture(self) -> GaussianMixture:
        return self.selection.mixture


def curve(x1: np.ndarray) -> np.ndarray:
    """What all demonstrations have in common."""
    return np.sin(2.0 * np.pi * x1) + 0.6 * x1


def compute(seed: int = 0) -> PlanarData:
    """Demonstrations that agree in the middle and at the ends less so, the mixture whose number of
    components BIC chose, and its GMR.
    """
    rng = np.random.default_rng(seed)
    x1 = np.tile(np.linspace(0.0, 1.0, N_SAMPLES), (N_DEMONSTRATIONS, 1))
    # Each differs by an offset and a slope about the middle.
    offset, slope = (
        rng.normal(0.0, 0.05, (N_DEMONSTRATIONS, 1)),
        rng.normal(0.0, 0.35, (N_DEMONSTRATIONS, 1)),
    )
    x2 = curve(x1) + offset + slope * (x1 - 0.5) + rng.normal(0.0, 0.02, x1.shape)
    samples = np.column_stack([x1.ravel(), x2.ravel()])
    selection = select_by_bic(samples, CANDIDATES, rng=rng, n_starts=5)
    grid = np.linspace(0.0, 1.0, 201)
    mean, covariance = regress(selection.mixture, grid[:, None], [0], [1])
    return PlanarData(x1, x2, selection, grid, mean[:, 0], np.sqrt(covariance[:, 0, 0]))


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    data = compute(seed)
    with house_style():
        figure = Figure(figsize=(10.5, 3.8), layout="constrained")
        shown, fitted, retrieved = figure.subplots(1, 3, sharey=True)
        _demonstrations(shown, data)
        _demonstrations(fitted, data, LIGHTLY)
        for number, (mean, covariance) in enumerate(
            zip(data.mixture.means_, data.mixture.covariances_, strict=True), start=1
        ):
            look = {
                "facecolor": GAUSSIAN,
                "edgecolor": GAUSSIAN,
                "alpha": 0.5,
                "gid": f"component_{number}",
            }
            fitted.add_patch(gaussian_ellipse(mean, covariance, DEVIATIONS, **look))
        fitted.plot(*data.mixture.means_.T, "o", color=BLACK, markersize=4)
        band = DEVIATIONS * data.deviation
        retrieved.fill_between(
            data.grid, data.mean - band, data.mean + band, color=GAUSSIAN, alpha=0.35, linewidth=0
        )
        retrieved.plot(data.grid, data.mean, color=BLACK, gid="retrieved")
        n = data.selection.best
        shown.set_title(f"Demonstrations, n = {N_DEMONSTRATIONS}")
        fitted.set_title(f"Mixture, K = {n} (lowest BIC of 1 to {CANDIDATES[-1]})")
        retrieved.set_title("Regression of x2 on x1")
        letter_panels(shown, fitted, retrieved)
        for axes in (shown, fitted, retrieved):
            axes.set_xlabel("x1 [1]")
        shown.set_ylabel("x2 [1]")
        spread = f"{DEVIATIONS:g} standard deviations"
        names = [
            "demonstration",
            f"Gaussian, {spread}",
            "its mean",
            "regression, mean",
            f"its {spread}",
        ]
        marks = [
            shown.lines[0],
            fitted.patches[0],
            fitted.lines[-1],
            retrieved.lines[0],
            retrieved.collections[0],
        ]
        legend_below(figure, marks, names, columns=5)
        return save(figure, folder, "figure_3_1"), measured(data)


LIGHTLY = {"linewidth": 0.6, "alpha": 0.6}


def measured(data: PlanarData) -> dict:
    """Number of components, and how far the retrieved mean is from the mean of the demonstrations,
    relative to its range.
    """
    shared = data.x2.mean(0)
    error = np.interp(data.x1[0], data.grid, data.mean) - shared
    return {
        "components": data.selection.best,
        "rms_error_over_range": float(np.sqrt(np.mean(error**2)) / np.ptp(shared)),
    }


def _demonstrations(axes: Axes, data: PlanarData, look: dict | None = None) -> None:
    for number, (x1, x2) in enumerate(zip(data.x1, data.x2, strict=True), start=1):
        axes.plot(
            x1, x2, color=GREY, **(look or {"linewidth": 1.0}), gid=f"demonstration_{number}"
        )
