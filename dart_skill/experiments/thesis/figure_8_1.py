"""Figure 8.1: simulated dart throws, demonstrated and reproduced at new aims, with the Gaussians
of one of them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.common.constants import BULL_DISTANCE, BULL_HEIGHT
from dart_skill.experiments.thesis import dart_throws as darts
from dart_skill.figures import (
    BALL,
    BASKET,
    BLACK,
    DEMONSTRATION,
    GAUSSIAN,
    GREY,
    HAND,
    LIGHT,
    gaussian_ellipse,
    house_style,
    legend_below,
    letter_panels,
    save,
)
from dart_skill.figures import draw_board as draw_wires
from dart_skill.movement import DSGMR

TITLE = "Dart throws, demonstrated and reproduced"
N_DEMONSTRATIONS, N_AIMS = 8, 12
MISSES = 8
"""To either side in the picture of where hits lie from their aims [mm]."""


def compute(seed: int = 0) -> tuple[list[darts.DartThrow], DSGMR, list[darts.DartThrow]]:
    """Demonstrations, the model, and throws at new aims."""
    rng = np.random.default_rng(seed)
    shown = darts.demonstrate(N_DEMONSTRATIONS, rng)
    model = darts.learn(shown)
    return shown, model, [darts.throw_at(model, aim) for aim in darts.random_aims(N_AIMS, rng)]


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    shown, model, made = compute(seed)
    with house_style():
        figure = Figure(figsize=(11.6, 5.0), layout="constrained")
        panels = figure.subplot_mosaic(
            [["demonstrated", "board"], ["reproduced", "board"]], width_ratios=(1.5, 1.0)
        )
        demonstrated, reproduced, board = (
            panels["demonstrated"],
            panels["reproduced"],
            panels["board"],
        )
        draw_side(
            demonstrated, shown, DEMONSTRATION, f"Demonstrations from the side, n = {len(shown)}"
        )
        draw_side(reproduced, made, HAND, f"Reproductions at new aims, n = {len(made)}")
        assert made[0].aim is not None  # a reproduction has one
        draw_components(reproduced, model, made[0].aim)
        draw_board(board, made, "On the board, as the thrower sees it")
        letter_panels(demonstrated, reproduced, board)
        side_by_side = (demonstrated, reproduced, board)
        named = {
            label: handle
            for axes in side_by_side
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        legend_below(figure, [*named.values()], [*named], 4)
        return save(figure, folder, "figure_8_1"), measured(made)


def measured(made: list[darts.DartThrow]) -> dict:
    errors = [1000 * throw.error for throw in made]
    return {
        "median_error_mm": round(float(np.median(errors)), 2),
        "largest_error_mm": round(max(errors), 2),
    }


def draw_side(axes: Axes, throws: list[darts.DartThrow], colour: str, title: str) -> None:
    """Movements of the hand, in a colour, and flights, forward and up."""
    name = "hand, demonstrated" if colour == DEMONSTRATION else "hand, reproduced"
    for number, throw in enumerate(throws):
        first = number == 0
        axes.plot(
            *throw.position[:, [0, 2]].T,
            color=colour,
            linewidth=1.4,
            label=name if first else None,
        )
        axes.plot(
            *throw.flight()[:, [0, 2]].T,
            color=BALL,
            linewidth=0.7,
            label="dart in flight" if first else None,
        )
    ends = [BULL_HEIGHT - darts.BOARD_RADIUS, BULL_HEIGHT + darts.BOARD_RADIUS]
    axes.plot(
        [BULL_DISTANCE] * 2, ends, color=BLACK, linewidth=3.0, solid_capstyle="butt", label="board"
    )
    axes.set(xlabel="forward [m]", ylabel="up [m]", title=title, aspect="equal", ylim=(1.45, 2.05))


def draw_components(axes: Axes, model: DSGMR, aim: np.ndarray) -> None:
    """The products (7.21) for one aim."""
    product = model.mixture_.product(darts.frames_for(aim))
    for number, (mean, covariance) in enumerate(
        zip(product.means_, product.covariances_, strict=True)
    ):
        side = np.array([1, 3])
        look = {"facecolor": GAUSSIAN, "edgecolor": GAUSSIAN, "alpha": 0.6, "zorder": 3}
        axes.add_patch(gaussian_ellipse(mean[side], covariance[np.ix_(side, side)], 2.0, **look))
        name = None if number else "Gaussian of the attractor (7.21), one throw"
        axes.plot(*mean[side], "+", color=GAUSSIAN, markersize=9, linestyle="none", label=name)


def draw_board(axes: Axes, throws: list[darts.DartThrow], title: str) -> None:
    """Aims and hits in the plane of the board [mm], and, larger, where each hit lies from its aim."""
    draw_wires(axes, LIGHT)
    aims, hits = (
        on_board(np.array([getattr(throw, which) for throw in throws])) for which in ("aim", "hit")
    )
    axes.plot(
        *aims.T, "o", color=BASKET, markersize=5.0, linestyle="none", label="aim", gid="aims"
    )
    axes.plot(*hits.T, "o", color=BALL, markersize=3.0, linestyle="none", label="hit", gid="hits")
    axes.set_title(title)
    _draw_misses(axes, hits - aims)


def _draw_misses(axes: Axes, misses: np.ndarray) -> None:
    """Where hits lie from their aims (n, 2) [mm], in a corner of a board."""
    inset = axes.inset_axes(
        (1.03, 0.0, 0.25, 0.25), xlim=(-MISSES, MISSES), ylim=(-MISSES, MISSES), aspect="equal"
    )
    inset.axhline(0.0, color=LIGHT, linewidth=0.8)
    inset.axvline(0.0, color=LIGHT, linewidth=0.8)
    inset.plot(0.0, 0.0, "o", color=BASKET, markersize=5.0)
    inset.plot(
        *misses.T, "o", color=BALL, markersize=3.0, linestyle="none", gid="misses", clip_on=False
    )
    inset.set(xticks=(-MISSES, 0, MISSES), yticks=(-MISSES, 0, MISSES))
    inset.tick_params(labelsize=7.5, length=2)
    inset.set_title("hit from aim [mm]", fontsize=8.0, color=GREY, loc="center")


def on_board(points: np.ndarray) -> np.ndarray:
    """(n, 2) [mm] to the right and up from the centre of the board, of points (n, 3)."""
    return 1000.0 * np.column_stack([-points[:, 1], points[:, 2] - BULL_HEIGHT])
