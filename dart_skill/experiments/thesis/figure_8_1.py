"""Figure 8.1: simulated dart throws, demonstrated and reproduced at new aims, with the Gaussians of one of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.experiments.thesis import dart_throws as darts
from dart_skill.figures import BLACK, GREEN, GREY, LIGHT, VERMILION, gaussian_ellipse, house_style, save
from dart_skill.movement import DSGMR

TITLE = "Dart throws, demonstrated and reproduced"
N_DEMONSTRATIONS, N_AIMS = 8, 12


def compute(seed: int = 0) -> tuple[list[darts.DartThrow], DSGMR, list[darts.DartThrow]]:
    """Demonstrations, the model, and throws at new aims."""
    rng = np.random.default_rng(seed)
    shown = darts.demonstrate(N_DEMONSTRATIONS, rng)
    model = darts.learn(shown)
    return shown, model, [darts.throw_at(model, aim) for aim in darts.random_aims(N_AIMS, rng)]


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    shown, model, made = compute(seed)
    with house_style():
        figure = Figure(figsize=(10.5, 4.6), layout="constrained")
        panels = figure.subplot_mosaic([["demonstrated", "board"], ["reproduced", "board"]], width_ratios=(1.5, 1.0))
        demonstrated, reproduced, board = panels["demonstrated"], panels["reproduced"], panels["board"]
        draw_side(demonstrated, shown, f"Demonstrations from the side, n = {len(shown)}")
        draw_side(reproduced, made, f"Reproductions at new aims, n = {len(made)}")
        assert made[0].aim is not None  # a reproduction has one
        draw_components(reproduced, model, made[0].aim)
        draw_board(board, made, "On the board, as the thrower sees it")
        handles, labels = board.get_legend_handles_labels()
        side_handles, side_labels = reproduced.get_legend_handles_labels()
        figure.legend([*side_handles, *handles], [*side_labels, *labels], loc="outside lower center", ncols=5)
        return save(figure, folder, "figure_8_1"), measured(made)


def measured(made: list[darts.DartThrow]) -> dict:
    errors = [1000 * throw.error for throw in made]
    return {"median_error_mm": round(float(np.median(errors)), 2), "largest_error_mm": round(max(errors), 2)}


def draw_side(axes: Axes, throws: list[darts.DartThrow], title: str) -> None:
    """Movements of the hand and flights, forward and up."""
    for number, throw in enumerate(throws):
        first = number == 0
        axes.plot(*throw.position[:, [0, 2]].T, "--", color=VERMILION, linewidth=1.2, label="movement of the hand" if first else None)
        axes.plot(*throw.flight()[:, [0, 2]].T, color=GREY, linewidth=0.7, label="flight" if first else None)
    ends = [darts.BOARD_HEIGHT - darts.BOARD_RADIUS, darts.BOARD_HEIGHT + darts.BOARD_RADIUS]
    axes.plot([darts.BOARD_DISTANCE] * 2, ends, color=BLACK, linewidth=3.0, solid_capstyle="butt")
    axes.set(xlabel="forward [m]", ylabel="up [m]", title=title, aspect="equal", ylim=(1.45, 2.05))


def draw_components(axes: Axes, model: DSGMR, aim: np.ndarray) -> None:
    """The products (7.21) for one aim."""
    product = model.mixture_.product(darts.frames_for(aim))
    for mean, covariance in zip(product.means_, product.covariances_, strict=True):
        side = np.array([1, 3])
        look = {"facecolor": GREEN, "edgecolor": GREEN, "alpha": 0.6, "zorder": 3}
        axes.add_patch(gaussian_ellipse(mean[side], covariance[np.ix_(side, side)], 2.0, **look))
        axes.plot(*mean[side], "+", color=GREEN, markersize=9)


def draw_board(axes: Axes, throws: list[darts.DartThrow], title: str) -> None:
    """Aims and hits in the plane of the board [cm]."""
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    for radius in (0.170, 0.162, 0.107, 0.099, 0.0159, 0.00635):
        axes.plot(100 * radius * np.cos(turn), 100 * radius * np.sin(turn), color=LIGHT, linewidth=0.8)
    aims, hits = (on_board(np.array([getattr(throw, which) for throw in throws])) for which in ("aim", "hit"))
    for aim, hit in zip(aims, hits, strict=True):
        axes.plot(*np.stack([aim, hit]).T, color=VERMILION, linewidth=0.8)
    axes.plot(*aims.T, "o", color=BLACK, markersize=4.5, label="aim", gid="aims")
    axes.plot(*hits.T, "o", color=VERMILION, markersize=3.0, label="hit", gid="hits")
    axes.set(xlabel="right [cm]", ylabel="up from the centre [cm]", title=title, aspect="equal")


def on_board(points: np.ndarray) -> np.ndarray:
    """(n, 2) [cm] to the right and up from the centre of the board, of points (n, 3)."""
    return 100.0 * np.column_stack([-points[:, 1], points[:, 2] - darts.BOARD_HEIGHT])
