"""Figure 6.5: the average log-likelihood (6.3) of data resampled by their weights tends to that of
the weighted data in closed form (6.4), as more is drawn.

The thesis does not say which data and mixture it used (its limit is 1.8621); here they are those
of figure 5.5, with fewer points.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dart_skill.experiments.thesis.figure_5_5 import MIXTURE, SAMPLED
from dart_skill.figures import BLUE, VERMILION, house_style, save
from dart_skill.mixture import mean_log_likelihood, resampled_mean_log_likelihood

TITLE = "Average log-likelihood of resampled data tends to that of weighted data"
N_POINTS, FACTORS = 100, np.arange(1, 61)


@dataclass(frozen=True, eq=False)
class Convergence:
    """(6.3) of data drawn `factors` (n,) times as many as there are, and (6.4)."""

    factors: np.ndarray
    resampled: np.ndarray
    closed_form: float


def compute(seed: int = 0) -> Convergence:
    rng = np.random.default_rng(seed)
    points = rng.multivariate_normal(np.zeros(2), SAMPLED, N_POINTS, method="cholesky")
    weights = np.exp(MIXTURE.log_density(points))
    resampled = [
        resampled_mean_log_likelihood(MIXTURE, points, weights, int(factor) * N_POINTS, rng)
        for factor in FACTORS
    ]
    return Convergence(FACTORS, np.array(resampled), mean_log_likelihood(MIXTURE, points, weights))


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    convergence = compute(seed)
    with house_style():
        figure = Figure(figsize=(6.4, 3.8), layout="constrained")
        axes = figure.subplots()
        axes.axhline(
            convergence.closed_form,
            color=VERMILION,
            linewidth=1.5,
            label="weighted data, closed form (6.4)",
        )
        axes.plot(
            convergence.factors,
            convergence.resampled,
            ".-",
            color=BLUE,
            linewidth=1.0,
            label="resampled data (6.3)",
        )
        axes.set(xlabel="resampled data over data", ylabel="average log-likelihood [nat]")
        axes.legend(loc="upper right")
        return save(figure, folder, "figure_6_5"), measured(convergence)


def measured(convergence: Convergence) -> dict:
    """(6.4), and the largest error of (6.3) with the fewest and with the most data, five factors
    each.
    """
    errors = np.abs(convergence.resampled - convergence.closed_form)
    return {
        "closed_form": round(convergence.closed_form, 4),
        "error_at_first": round(float(errors[:5].max()), 5),
        "error_in_the_end": round(float(errors[-5:].max()), 5),
    }
