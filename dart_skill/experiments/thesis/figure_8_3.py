"""Figure 8.3: the error falls with experience. Many runs of practice from different
demonstrations, with median and quartiles.

The thesis shows one run without saying at what it throws; here are runs at aims all over the
board, and at one aim again and again. With 4 demonstrations instead of 8, one of the 20 runs at
one aim never gets going: two frames see four points in three dimensions, and their product is an
extrapolation that throws backwards.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.experiments.thesis import dart_throws as darts
from dart_skill.figures import BLUE, LIGHT, VERMILION, house_style, save

TITLE = "The error of dart throws falls with experience"
N_SEEDS, N_DEMONSTRATIONS, N_ATTEMPTS = 20, 8, 30


def errors(seed: int, one_aim: bool) -> np.ndarray:
    """Error (n_attempts,) [m] of the attempts of one run."""
    rng = np.random.default_rng(seed)
    shown = darts.demonstrate(N_DEMONSTRATIONS, rng)
    aims = (
        np.tile(darts.random_aims(1, rng), (N_ATTEMPTS, 1))
        if one_aim
        else darts.random_aims(N_ATTEMPTS, rng)
    )
    return np.array([throw.error for throw in darts.practise(shown, aims)])


def compute(seed: int = 0) -> dict[str, np.ndarray]:
    """Errors (n_seeds, n_attempts) [m] at new aims and at one aim."""
    seeds = range(seed, seed + N_SEEDS)
    return {
        name: np.array([errors(one, same) for one in seeds])
        for name, same in (("new aims", False), ("one aim", True))
    }


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    runs = compute(seed)
    with house_style():
        figure = Figure(figsize=(10.5, 4.2), layout="constrained")
        for axes, (name, error), colour in zip(
            figure.subplots(1, 2, sharey=True), runs.items(), (BLUE, VERMILION), strict=True
        ):
            _draw_runs(axes, 1000 * error, colour)
            what = "a new aim each time" if name == "new aims" else "the same aim each time"
            axes.set_title(f"{what}, {N_DEMONSTRATIONS} demonstrations before, n = {N_SEEDS} runs")
            axes.set(xlabel="attempt", yscale="log")
        figure.axes[0].set_ylabel("distance from aim to hit [mm]")
        figure.axes[0].legend(loc="upper right")
        return save(figure, folder, "figure_8_3"), measured(runs)


def measured(runs: dict[str, np.ndarray]) -> dict:
    """Median error [mm] of the first and the last five attempts."""
    parts = (("first_five", slice(0, 5)), ("last_five", slice(-5, None)))
    return {
        name: {part: round(float(np.median(1000 * error[:, where])), 3) for part, where in parts}
        for name, error in runs.items()
    }


def _draw_runs(axes: Axes, error: np.ndarray, colour: str) -> None:
    attempt = 1 + np.arange(error.shape[1])
    low, middle, high = np.percentile(error, [25, 50, 75], axis=0)
    axes.plot(attempt, error.T, color=LIGHT, linewidth=0.5)
    axes.fill_between(attempt, low, high, color=colour, alpha=0.25, linewidth=0, label="quartiles")
    axes.plot(attempt, middle, color=colour, linewidth=2.0, label="median")
