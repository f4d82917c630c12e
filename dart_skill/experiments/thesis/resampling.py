"""Figure 6.4: stochastic universal sampling. Weights are laid end to end, and pointers at equal
distances choose among them.

Beside it the counts of many draws, with those of as many independent draws: the expected number is
the same, the spread is not.

Figure 6.5: the average log-likelihood (6.3) of data resampled by their weights tends to that of
the weighted data in closed form (6.4), as more is drawn.

The thesis does not say which data and mixture it used (its limit is 1.8621); here they are those
of figure 5.5, with fewer points.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dart_skill.experiments.thesis.components import MIXTURE, SAMPLED
from dart_skill.figures import (
    BLUE,
    GREEN,
    GREY,
    LIGHT,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    house_style,
    letter_panels,
    save,
)
from dart_skill.mixture import (
    mean_log_likelihood,
    resampled_mean_log_likelihood,
    stochastic_universal_sampling,
)

TITLE_6_4 = "Stochastic universal sampling"
N_POINTS_6_4, N_DRAWN, N_REPEATS = 6, 10, 2000
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION)


def compute_6_4(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Shares (6,), indices that are drawn once (10,), and how often each is drawn (2000, 6) by it
    and by independent draws.
    """
    rng = np.random.default_rng(seed)
    shares = rng.dirichlet(np.full(N_POINTS_6_4, 2.0))
    once = stochastic_universal_sampling(shares, N_DRAWN, rng)
    drawn = [
        np.bincount(stochastic_universal_sampling(shares, N_DRAWN, rng), minlength=N_POINTS_6_4)
        for _ in range(N_REPEATS)
    ]
    return shares, once, np.array(drawn), rng.multinomial(N_DRAWN, shares, N_REPEATS)


def draw_6_4(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    shares, once, universal, independent = compute_6_4(seed)
    with house_style():
        figure = Figure(figsize=(10.0, 3.4), layout="constrained")
        laid, spread = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
        ends = np.concatenate([[0.0], np.cumsum(shares)])
        for k, colour in enumerate(COLOURS):
            laid.barh(
                0.0,
                shares[k],
                left=ends[k],
                height=0.5,
                color=colour,
                alpha=0.6,
                edgecolor="white",
            )
            laid.text(0.5 * (ends[k] + ends[k + 1]), 0.0, f"{k + 1}", ha="center", va="center")
            laid.text(
                0.5 * (ends[k] + ends[k + 1]),
                -0.42,
                f"{(once == k).sum()} x",
                ha="center",
                color=GREY,
            )
        pointers = _pointers(ends, once)
        laid.plot(pointers, np.full(N_DRAWN, 0.42), "v", color="black", markersize=7.0)
        laid.set(
            xlabel="share of all weight [-]",
            yticks=[],
            ylim=(-0.65, 0.65),
            xlim=(0, 1),
            title=f"{N_DRAWN} pointers at equal distances",
        )
        at = np.arange(1, N_POINTS_6_4 + 1)
        spread.bar(at - 0.18, independent.std(0), 0.34, color=LIGHT, label="independent draws")
        spread.bar(at + 0.18, universal.std(0), 0.34, color=BLUE, label="universal sampling")
        spread.set(
            xlabel="point",
            ylabel="standard deviation of its number [-]",
            title=f"{N_REPEATS} times {N_DRAWN} draws",
        )
        spread.legend(loc="upper left")
        spread.set_ylim(0.0, 1.45 * independent.std(0).max())
        letter_panels(laid, spread)
        return save(figure, folder, "figure_6_4"), measured_6_4(shares, universal, independent)


def _pointers(ends: np.ndarray, once: np.ndarray) -> np.ndarray:
    """Places of pointers that choose as was drawn: the middle of all that do."""
    steps = np.arange(N_DRAWN) / N_DRAWN
    first = (
        max(0.0, float((ends[once] - steps).max())),
        min(1.0 / N_DRAWN, float((ends[once + 1] - steps).min())),
    )
    return steps + 0.5 * (first[0] + first[1])


def measured_6_4(shares: np.ndarray, universal: np.ndarray, independent: np.ndarray) -> dict:
    """Largest distance of a number from its expected one, and the mean standard deviation over the
    points, of both.
    """
    expected = N_DRAWN * shares
    return {
        name: {
            "farthest_from_expected": round(float(np.abs(counts - expected).max()), 3),
            "mean_deviation": round(float(counts.std(0).mean()), 3),
        }
        for name, counts in (("universal", universal), ("independent", independent))
    }


TITLE_6_5 = "Average log-likelihood of resampled data tends to that of weighted data"
N_POINTS_6_5, FACTORS = 100, np.arange(1, 61)


@dataclass(frozen=True, eq=False)
class Convergence:
    """(6.3) of data drawn `factors` (n,) times as many as there are, and (6.4)."""

    factors: np.ndarray
    resampled: np.ndarray
    closed_form: float


def compute_6_5(seed: int = 0) -> Convergence:
    rng = np.random.default_rng(seed)
    points = rng.multivariate_normal(np.zeros(2), SAMPLED, N_POINTS_6_5, method="cholesky")
    weights = np.exp(MIXTURE.log_density(points))
    resampled = [
        resampled_mean_log_likelihood(MIXTURE, points, weights, int(factor) * N_POINTS_6_5, rng)
        for factor in FACTORS
    ]
    return Convergence(FACTORS, np.array(resampled), mean_log_likelihood(MIXTURE, points, weights))


def draw_6_5(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    convergence = compute_6_5(seed)
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
        return save(figure, folder, "figure_6_5"), measured_6_5(convergence)


def measured_6_5(convergence: Convergence) -> dict:
    """(6.4), and the largest error of (6.3) with the fewest and with the most data, five factors
    each.
    """
    errors = np.abs(convergence.resampled - convergence.closed_form)
    return {
        "closed_form": round(convergence.closed_form, 4),
        "error_at_first": round(float(errors[:5].max()), 5),
        "error_in_the_end": round(float(errors[-5:].max()), 5),
    }
