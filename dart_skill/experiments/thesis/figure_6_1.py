"""Figure 6.1: the dart board, drawn to scale from what scores are computed with, each field in the
colour of its score.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dart_skill.darts import RADII, score
from dart_skill.figures import LIGHT, draw_board, house_style, quantity_colours, save

TITLE = "The dart board, and what its fields score"
SPACING, LIMIT = 0.5, 200.0
"""Spacing and limits of the picture [mm]."""


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    side = np.arange(-LIMIT, LIMIT + SPACING, SPACING)
    points = np.stack(np.meshgrid(side, side), axis=-1)
    values = np.asarray(score(points.reshape(-1, 2)), dtype=float).reshape(points.shape[:2])
    with house_style():
        figure = Figure(figsize=(6.8, 5.8), layout="constrained")
        axes = figure.subplots()
        shown = np.where(np.linalg.norm(points, axis=-1) <= RADII[-1], values, np.nan)
        image = axes.imshow(
            shown,
            origin="lower",
            extent=(-LIMIT, LIMIT, -LIMIT, LIMIT),
            cmap=quantity_colours(),
            interpolation="nearest",
        )
        draw_board(axes, LIGHT)
        figure.colorbar(image, ax=axes, label="score of one dart [points]", shrink=0.8)
        return save(figure, folder, "figure_6_1"), measured(values)


def measured(values: np.ndarray) -> dict:
    """The largest score, and its share of the area of the board [%]: of a dart that hits the board
    anywhere alike.
    """
    board = np.pi * RADII[-1] ** 2
    treble_20 = float((values == 60).sum()) * SPACING**2
    return {
        "largest_score": float(values.max()),
        "treble_20_share_percent": round(100.0 * treble_20 / board, 3),
    }
