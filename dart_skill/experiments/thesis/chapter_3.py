"""Figure 3.1: planar demonstrations, the mixture fitted to them, and the mean and spread that
regression retrieves (3.4), (3.5).

Section 3.2: a gesture is recognised by the mixture under which its log-likelihood (3.1) is
largest.

The thesis says so in a sentence and has no figure of it. Here three gestures begin in the same
direction, the wave faster. Each is shown a few times and encoded in one mixture over time and
place; new ones are recognised after more and more of them has been seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

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
    VERMILION,
    gaussian_ellipse,
    house_style,
    legend_below,
    letter_panels,
    plot_mixture,
    save,
)
from dart_skill.mixture import GaussianMixture, Selection, regress, select_by_bic

TITLE_3_1 = "Gaussian mixture model and regression on planar data"
N_DEMONSTRATIONS_3_1, N_SAMPLES_3_1 = 6, 100
CANDIDATES = range(1, 11)
DEVIATIONS = 2.0


@dataclass(frozen=True, eq=False)
class PlanarData:
    """x1 (n_demonstrations, n) and x2 of the demonstrations.

    Parameters
    ----------
    selection
        Mixtures by BIC.
    grid : (m,)
    mean : (m,)
    deviation : (m,)
        Of x2.
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


def compute_3_1(seed: int = 0) -> PlanarData:
    """Demonstrations that agree in the middle and at the ends less so, the mixture whose number of
    components BIC chose, and its GMR.
    """
    rng = np.random.default_rng(seed)
    x1 = np.tile(np.linspace(0.0, 1.0, N_SAMPLES_3_1), (N_DEMONSTRATIONS_3_1, 1))
    # Each differs by an offset and a slope about the middle.
    offset, slope = (
        rng.normal(0.0, 0.05, (N_DEMONSTRATIONS_3_1, 1)),
        rng.normal(0.0, 0.35, (N_DEMONSTRATIONS_3_1, 1)),
    )
    x2 = curve(x1) + offset + slope * (x1 - 0.5) + rng.normal(0.0, 0.02, x1.shape)
    samples = np.column_stack([x1.ravel(), x2.ravel()])
    selection = select_by_bic(samples, CANDIDATES, rng=rng, n_starts=5)
    grid = np.linspace(0.0, 1.0, 201)
    mean, covariance = regress(selection.mixture, grid[:, None], [0], [1])
    return PlanarData(x1, x2, selection, grid, mean[:, 0], np.sqrt(covariance[:, 0, 0]))


def draw_3_1(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    data = compute_3_1(seed)
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
        shown.set_title(f"Demonstrations, n = {N_DEMONSTRATIONS_3_1}")
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
        return save(figure, folder, "figure_3_1"), measured_3_1(data)


LIGHTLY = {"linewidth": 0.6, "alpha": 0.6}


def measured_3_1(data: PlanarData) -> dict:
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


TITLE_3_2 = "Gestures recognised by the likelihood of the mixtures of demonstrated ones"
GESTURES = {"arch": BLUE, "wave": VERMILION, "loop": GREEN}
N_DEMONSTRATIONS_3_2, N_NEW, N_SAMPLES_3_2, N_COMPONENTS = 6, 100, 60, 6
SEEN = np.arange(0.1, 1.01, 0.1)
"""Shares of a gesture after which it is recognised."""
OFFSET, SCALE, NOISE = 0.06, 0.12, 0.02
"""Standard deviations from gesture to gesture, and of a sample, in units of a gesture's width; of
its size, relative.
"""


@dataclass(frozen=True, eq=False)
class Recognition:
    """demonstrations: of each gesture (N_DEMONSTRATIONS, n, 3), [t, x, y]; its mixture; counts
    (shares, 3, 3): how many new gestures of each kind (rows) were taken for which (columns) after
    each share of `SEEN`.
    """

    demonstrations: list[np.ndarray]
    mixtures: list[GaussianMixture]
    counts: np.ndarray


def gestures(kind: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """(n, N_SAMPLES, 3) [t, x, y], each of another size, at another place, and with noise."""
    t = np.linspace(0.0, 1.0, N_SAMPLES_3_2)
    up = np.sin(np.pi * t)
    shapes = {
        "arch": np.column_stack([t, up]),
        "wave": np.column_stack(
            [t, np.where(t < 0.5, np.sin(2.0 * np.pi * t), 0.6 * np.sin(2.0 * np.pi * t))]
        ),
        "loop": np.column_stack(
            [
                t - 0.25 * np.sin(4.0 * np.pi * t) * (t > 0.25),
                up * (1.0 + 0.2 * np.sin(3.0 * np.pi * t)),
            ]
        ),
    }
    size = np.exp(rng.normal(0.0, SCALE, (n, 1, 1)))
    moved = (
        size * shapes[kind]
        + rng.normal(0.0, OFFSET, (n, 1, 2))
        + rng.normal(0.0, NOISE, (n, N_SAMPLES_3_2, 2))
    )
    return np.concatenate([np.broadcast_to(t[:, None], (n, N_SAMPLES_3_2, 1)), moved], axis=2)


def compute_3_2(seed: int = 0) -> Recognition:
    rng = np.random.default_rng(seed)
    shown = [gestures(kind, N_DEMONSTRATIONS_3_2, rng) for kind in GESTURES]
    mixtures = [
        GaussianMixture(N_COMPONENTS, n_starts=3).fit(one.reshape(-1, 3), rng=rng) for one in shown
    ]
    counts = np.zeros((len(SEEN), len(GESTURES), len(GESTURES)), dtype=int)
    for row, kind in enumerate(GESTURES):
        new = gestures(kind, N_NEW, rng)
        densities = np.array(
            [one.log_density(new.reshape(-1, 3)).reshape(N_NEW, N_SAMPLES_3_2) for one in mixtures]
        )
        for k, share in enumerate(SEEN):
            likelihoods = densities[:, :, : round(share * N_SAMPLES_3_2)].sum(axis=2)  # (3.1)
            counts[k, row] = np.bincount(likelihoods.argmax(axis=0), minlength=len(GESTURES))
    return Recognition(shown, mixtures, counts)


def draw_3_2(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    found = compute_3_2(seed)
    with house_style():
        figure = Figure(figsize=(9.6, 4.4), layout="constrained")
        places, shares = figure.subplots(1, 2, width_ratios=(1.0, 1.3))
        for (kind, colour), shown, mixture in zip(
            GESTURES.items(), found.demonstrations, found.mixtures, strict=True
        ):
            for one in shown:
                places.plot(one[:, 1], one[:, 2], color=LIGHT, linewidth=0.7, zorder=1)
            plot_mixture(places, mixture, dims=(1, 2), colour=colour, label=kind)
        places.set(
            xlabel="x",
            ylabel="y",
            aspect="equal",
            title=f"{N_DEMONSTRATIONS_3_2} demonstrations each, mixtures, 2 s.d.",
        )
        places.legend(loc="lower left")
        for row, (kind, colour) in enumerate(GESTURES.items()):
            shares.plot(
                100 * SEEN, 100 * found.counts[:, row, row] / N_NEW, ".-", color=colour, label=kind
            )
        shares.axhline(
            100 / len(GESTURES), color=BLACK, linestyle=":", linewidth=1.0, label="by chance"
        )
        shares.set(
            xlabel="seen of the gesture [%]",
            ylabel="recognised [%]",
            ylim=(0, 103),
            title=f"{N_NEW} new gestures of each kind",
        )
        shares.legend(loc="lower right")
        letter_panels(places, shares)
        return save(figure, folder, "figure_3_2"), measured_3_2(found)


def measured_3_2(found: Recognition) -> dict:
    """Share of new gestures that are recognised after a tenth, a half and all of them [%], and
    what the whole ones were taken for.
    """
    right = 100.0 * np.einsum("kii->k", found.counts) / found.counts[0].sum()
    return {
        "recognised_percent": {
            f"{100 * share:.0f} % seen": round(float(right[k]), 1)
            for k, share in enumerate(SEEN)
            if k in (0, 4, 9)
        },
        "taken_for": {
            kind: dict(zip(GESTURES, found.counts[-1, row].tolist(), strict=True))
            for row, kind in enumerate(GESTURES)
        },
    }
