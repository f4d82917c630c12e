"""Figure 3.1: planar demonstrations, the mixture fitted to them, and the mean and spread that
regression retrieves (3.4), (3.5).

Section 3.2: a gesture is recognised by the mixture under which its log-likelihood (3.1) is
largest.

The thesis says so in a sentence and has no figure of it. Here three gestures begin in the same
direction, the wave faster. Each is shown a few times and encoded in one mixture over time and
place; new ones are recognised after more and more of them has been seen.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from dart_skill.figures import (
    BLACK,
    BLUE,
    GAUSSIAN,
    GREEN,
    GREY,
    LIGHT,
    VERMILION,
    add_gaussians,
    legend_below,
    letter_panels,
    plot_mixture,
)
from dart_skill.mixture import GaussianMixture, Selection, regress, select_by_bic

N_SHOWN = 6
"""Number of demonstrations, of each gesture in section 3.2."""
DEVIATIONS = 2.0
"""Size of ellipses and bands [standard deviations]."""


def planar_regression(
    seed: int = 0, candidates: Sequence[int] = range(1, 11)
) -> tuple[np.ndarray, np.ndarray, Selection, np.ndarray, np.ndarray, np.ndarray]:
    """x1 and x2 (n_demonstrations, n) of demonstrations that agree in the middle and at the ends
    less so; the mixture whose number of components BIC chose among the candidates; and its GMR:
    grid (m,) of x1, mean (m,) and standard deviation (m,) of x2.
    """
    rng = np.random.default_rng(seed)
    x1 = np.tile(np.linspace(0.0, 1.0, 100), (N_SHOWN, 1))
    # Each differs by an offset and a slope about the middle.
    offset = rng.normal(0.0, 0.05, (N_SHOWN, 1))
    slope = rng.normal(0.0, 0.35, (N_SHOWN, 1))
    shared = np.sin(2.0 * np.pi * x1) + 0.6 * x1
    x2 = shared + offset + slope * (x1 - 0.5) + rng.normal(0.0, 0.02, x1.shape)
    samples = np.column_stack([x1.ravel(), x2.ravel()])
    selection = select_by_bic(samples, candidates, rng=rng, n_starts=5)
    grid = np.linspace(0.0, 1.0, 201)
    mean, covariance = regress(selection.mixture, grid[:, None], [0], [1])
    return x1, x2, selection, grid, mean[:, 0], np.sqrt(covariance[:, 0, 0])


def draw_3_1(seed: int = 0, candidates: Sequence[int] = range(1, 11)) -> tuple[Figure, dict]:
    """Measured: number of components, and how far the retrieved mean is from the mean of the
    demonstrations, relative to its range.
    """
    x1, x2, selection, grid, mean, deviation = planar_regression(seed, candidates)
    mixture = selection.mixture
    figure = Figure(figsize=(10.5, 3.8), layout="constrained")
    shown, fitted, retrieved = figure.subplots(1, 3, sharey=True)
    shown.plot(x1.T, x2.T, color=GREY, linewidth=1.0)
    fitted.plot(x1.T, x2.T, color=GREY, linewidth=0.6, alpha=0.6)
    look = {"facecolor": GAUSSIAN, "edgecolor": GAUSSIAN, "alpha": 0.5}
    add_gaussians(fitted, mixture.means_, mixture.covariances_, DEVIATIONS, **look)
    fitted.plot(*mixture.means_.T, "o", color=BLACK, markersize=4)
    band = DEVIATIONS * deviation
    retrieved.fill_between(grid, mean - band, mean + band, color=GAUSSIAN, alpha=0.35, linewidth=0)
    retrieved.plot(grid, mean, color=BLACK)
    shown.set(title=f"Demonstrations, n = {N_SHOWN}", xlabel="x1 [1]", ylabel="x2 [1]")
    chosen = f"Mixture, K = {selection.best} (lowest BIC of 1 to {candidates[-1]})"
    fitted.set(title=chosen, xlabel="x1 [1]")
    retrieved.set(title="Regression of x2 on x1", xlabel="x1 [1]")
    letter_panels(shown, fitted, retrieved)
    spread = f"{DEVIATIONS:g} standard deviations"
    entries = {
        "demonstration": shown.lines[0],
        f"Gaussian, {spread}": fitted.patches[0],
        "its mean": fitted.lines[-1],
        "regression, mean": retrieved.lines[0],
        f"its {spread}": retrieved.collections[0],
    }
    legend_below(figure, [*entries.values()], [*entries], columns=5)
    error = np.interp(x1[0], grid, mean) - x2.mean(0)
    return figure, {
        "components": selection.best,
        "rms_error_over_range": float(np.sqrt(np.mean(error**2)) / np.ptp(x2.mean(0))),
    }


GESTURES = {"arch": BLUE, "wave": VERMILION, "loop": GREEN}
"""Colour of each gesture."""
N_NEW = 100
"""Number of new gestures of each kind."""
N_SAMPLES = 60
"""Number of samples of a gesture."""
SEEN = np.arange(0.1, 1.01, 0.1)
"""Shares of a gesture after which it is recognised."""


def gestures(kind: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """(n, N_SAMPLES, 3) [t, x, y], each of another size, at another place, and with noise, in
    units of a gesture's width.
    """
    t = np.linspace(0.0, 1.0, N_SAMPLES)
    up = np.sin(np.pi * t)
    wave = np.where(t < 0.5, np.sin(2.0 * np.pi * t), 0.6 * np.sin(2.0 * np.pi * t))
    back = t - 0.25 * np.sin(4.0 * np.pi * t) * (t > 0.25)
    shapes = {
        "arch": np.column_stack([t, up]),
        "wave": np.column_stack([t, wave]),
        "loop": np.column_stack([back, up * (1.0 + 0.2 * np.sin(3.0 * np.pi * t))]),
    }
    size = np.exp(rng.normal(0.0, 0.12, (n, 1, 1)))
    offset = rng.normal(0.0, 0.06, (n, 1, 2))
    moved = size * shapes[kind] + offset + rng.normal(0.0, 0.02, (n, N_SAMPLES, 2))
    return np.concatenate([np.broadcast_to(t[:, None], (n, N_SAMPLES, 1)), moved], axis=2)


def recognised(seed: int = 0) -> tuple[list[np.ndarray], list[GaussianMixture], np.ndarray]:
    """Demonstrations (n, N_SAMPLES, 3) of each gesture, their mixtures, and counts (shares, 3, 3):
    how many new gestures of each kind (rows) were taken for which (columns) after each share of
    `SEEN`.
    """
    rng = np.random.default_rng(seed)
    shown = [gestures(kind, N_SHOWN, rng) for kind in GESTURES]
    mixtures = [GaussianMixture(6, n_starts=3).fit(one.reshape(-1, 3), rng=rng) for one in shown]
    counts = np.zeros((len(SEEN), len(GESTURES), len(GESTURES)), dtype=int)
    for row, kind in enumerate(GESTURES):
        new = gestures(kind, N_NEW, rng).reshape(-1, 3)
        densities = np.array([one.log_density(new) for one in mixtures])
        sums = np.cumsum(densities.reshape(-1, N_NEW, N_SAMPLES), axis=2)  # (3.1)
        for k, share in enumerate(SEEN):
            taken_for = sums[:, :, round(share * N_SAMPLES) - 1].argmax(axis=0)
            counts[k, row] = np.bincount(taken_for, minlength=len(GESTURES))
    return shown, mixtures, counts


def draw_3_2(seed: int = 0) -> tuple[Figure, dict]:
    """Measured: share of new gestures that are recognised after a tenth, a half and all of them
    [%], and what the whole ones were taken for.
    """
    demonstrations, mixtures, counts = recognised(seed)
    figure = Figure(figsize=(9.6, 4.4), layout="constrained")
    places, shares = figure.subplots(1, 2, width_ratios=(1.0, 1.3))
    for row, (kind, colour) in enumerate(GESTURES.items()):
        for one in demonstrations[row]:
            places.plot(one[:, 1], one[:, 2], color=LIGHT, linewidth=0.7, zorder=1)
        plot_mixture(places, mixtures[row], dims=(1, 2), colour=colour, label=kind)
        share = 100 * counts[:, row, row] / N_NEW
        shares.plot(100 * SEEN, share, ".-", color=colour, label=kind)
    title = f"{N_SHOWN} demonstrations each, mixtures, 2 s.d."
    places.set(xlabel="x", ylabel="y", aspect="equal", title=title)
    places.legend(loc="lower left")
    by_chance = 100 / len(GESTURES)
    shares.axhline(by_chance, color=BLACK, linestyle=":", linewidth=1.0, label="by chance")
    shares.set(xlabel="seen of the gesture [%]", ylabel="recognised [%]", ylim=(0, 103))
    shares.set_title(f"{N_NEW} new gestures of each kind")
    shares.legend(loc="lower right")
    letter_panels(places, shares)
    right = 100.0 * np.einsum("kii->k", counts) / counts[0].sum()
    return figure, {
        "recognised_percent": {
            f"{100 * SEEN[k]:.0f} % seen": round(float(right[k]), 1) for k in (0, 4, 9)
        },
        "taken_for": {
            kind: dict(zip(GESTURES, row.tolist(), strict=True))
            for kind, row in zip(GESTURES, counts[-1], strict=True)
        },
    }
