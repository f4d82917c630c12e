"""Figure 8.2: practice. Every attempt, with the place that the dart really hit, becomes a
demonstration, and the model is learned again.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dart_skill.experiments.thesis import dart_throws as darts
from dart_skill.experiments.thesis.figure_8_1 import draw_board, draw_side
from dart_skill.figures import DEMONSTRATION, house_style, legend_below, letter_panels, save

TITLE = "Dart throws get better with every attempt"
N_DEMONSTRATIONS, N_AIMS, N_ROUNDS = 8, 6, 3


def compute(seed: int = 0) -> tuple[list[darts.DartThrow], list[list[darts.DartThrow]]]:
    """Demonstrations, and rounds of attempts at the same aims."""
    rng = np.random.default_rng(seed)
    shown, aims = darts.demonstrate(N_DEMONSTRATIONS, rng), darts.random_aims(N_AIMS, rng)
    attempts = darts.practise(shown, np.tile(aims, (N_ROUNDS, 1)))
    return shown, [attempts[n * N_AIMS : (n + 1) * N_AIMS] for n in range(N_ROUNDS)]


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    shown, rounds = compute(seed)
    with house_style():
        figure = Figure(figsize=(10.2, 7.0), layout="constrained")
        panels = figure.subplot_mosaic(
            [["side", "side"], ["first", "last"]], height_ratios=(1.0, 1.8)
        )
        side, first, last = panels["side"], panels["first"], panels["last"]
        draw_side(side, shown, DEMONSTRATION, f"Demonstrations, n = {len(shown)}")
        draw_board(first, rounds[0], f"First attempts, n = {N_AIMS}: {_miss(rounds[0])}")
        draw_board(
            last,
            rounds[-1],
            f"The same aims after {N_AIMS * (N_ROUNDS - 1)} attempts: {_miss(rounds[-1])}",
        )
        handles, labels = side.get_legend_handles_labels()
        board_handles, board_labels = first.get_legend_handles_labels()
        letter_panels(side, first, last)
        legend_below(figure, [*handles, *board_handles], [*labels, *board_labels], 5)
        return save(figure, folder, "figure_8_2"), measured(rounds)


def _miss(throws: list[darts.DartThrow]) -> str:
    return f"{1000 * np.mean([throw.error for throw in throws]):.1f} mm off"


def measured(rounds: list[list[darts.DartThrow]]) -> dict:
    """Mean error of each round [mm]."""
    return {
        "mean_error_mm": [
            round(float(np.mean([1000 * throw.error for throw in some])), 2) for some in rounds
        ]
    }
