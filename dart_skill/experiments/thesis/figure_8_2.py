"""Figure 8.2: practice. Every attempt, with the place that the dart really hit, becomes a demonstration, and the model is learned again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dart_skill.experiments.thesis import dart_throws as darts
from dart_skill.experiments.thesis.figure_8_1 import draw_board, draw_side
from dart_skill.figures import house_style, save

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
        figure = Figure(figsize=(9.0, 6.4), layout="constrained")
        panels = figure.subplot_mosaic([["side", "side"], ["first", "last"]], height_ratios=(1.0, 1.8))
        side, first, last = panels["side"], panels["first"], panels["last"]
        draw_side(side, shown, f"Demonstrations, n = {len(shown)}")
        draw_board(first, rounds[0], f"First attempts, n = {N_AIMS}")
        draw_board(last, rounds[-1], f"The same aims after {N_AIMS * (N_ROUNDS - 1)} attempts")
        handles, labels = side.get_legend_handles_labels()
        board_handles, board_labels = first.get_legend_handles_labels()
        figure.legend([*handles, *board_handles], [*labels, *board_labels], loc="outside lower center", ncols=4)
        return save(figure, folder, "figure_8_2"), measured(rounds)


def measured(rounds: list[list[darts.DartThrow]]) -> dict:
    """Mean error of each round [mm]."""
    return {"mean_error_mm": [round(float(np.mean([1000 * throw.error for throw in some])), 2) for some in rounds]}
