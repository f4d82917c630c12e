"""Figure 8.1: simulated dart throws, demonstrated and reproduced at new aims, with the Gaussians
of one of them.

Figure 8.2: practice. Every attempt, with the place that the dart really hit, becomes a
demonstration, and the model is learned again.

Figure 8.3: the error falls with experience. Many runs of practice from different
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

from dart_skill.common.constants import BULL_DISTANCE, BULL_HEIGHT
from dart_skill.experiments.thesis import dart_throws as darts
from dart_skill.figures import (
    BALL,
    BASKET,
    BLACK,
    BLUE,
    DEMONSTRATION,
    GAUSSIAN,
    GREY,
    HAND,
    LIGHT,
    VERMILION,
    gaussian_ellipse,
    house_style,
    legend_below,
    letter_panels,
    save,
)
from dart_skill.figures import draw_board as draw_wires
from dart_skill.movement import DSGMR

TITLE_8_1 = "Dart throws, demonstrated and reproduced"
N_DEMONSTRATIONS_8_1, N_AIMS_8_1 = 8, 12
MISSES = 8
"""To either side in the picture of where hits lie from their aims [mm]."""


def compute_8_1(seed: int = 0) -> tuple[list[darts.DartThrow], DSGMR, list[darts.DartThrow]]:
    """Demonstrations, the model, and throws at new aims."""
    rng = np.random.default_rng(seed)
    shown = darts.demonstrate(N_DEMONSTRATIONS_8_1, rng)
    model = darts.learn(shown)
    return shown, model, [darts.throw_at(model, aim) for aim in darts.random_aims(N_AIMS_8_1, rng)]


def draw_8_1(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    shown, model, made = compute_8_1(seed)
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
        return save(figure, folder, "figure_8_1"), measured_8_1(made)


def measured_8_1(made: list[darts.DartThrow]) -> dict:
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


TITLE_8_2 = "Dart throws get better with every attempt"
N_DEMONSTRATIONS_8_2, N_AIMS_8_2, N_ROUNDS = 8, 6, 3


def compute_8_2(seed: int = 0) -> tuple[list[darts.DartThrow], list[list[darts.DartThrow]]]:
    """Demonstrations, and rounds of attempts at the same aims."""
    rng = np.random.default_rng(seed)
    shown, aims = darts.demonstrate(N_DEMONSTRATIONS_8_2, rng), darts.random_aims(N_AIMS_8_2, rng)
    attempts = darts.practise(shown, np.tile(aims, (N_ROUNDS, 1)))
    return shown, [attempts[n * N_AIMS_8_2 : (n + 1) * N_AIMS_8_2] for n in range(N_ROUNDS)]


def draw_8_2(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    shown, rounds = compute_8_2(seed)
    with house_style():
        figure = Figure(figsize=(10.2, 7.0), layout="constrained")
        panels = figure.subplot_mosaic(
            [["side", "side"], ["first", "last"]], height_ratios=(1.0, 1.8)
        )
        side, first, last = panels["side"], panels["first"], panels["last"]
        draw_side(side, shown, DEMONSTRATION, f"Demonstrations, n = {len(shown)}")
        draw_board(first, rounds[0], f"First attempts, n = {N_AIMS_8_2}: {_miss(rounds[0])}")
        draw_board(
            last,
            rounds[-1],
            f"The same aims after {N_AIMS_8_2 * (N_ROUNDS - 1)} attempts: {_miss(rounds[-1])}",
        )
        handles, labels = side.get_legend_handles_labels()
        board_handles, board_labels = first.get_legend_handles_labels()
        letter_panels(side, first, last)
        legend_below(figure, [*handles, *board_handles], [*labels, *board_labels], 5)
        return save(figure, folder, "figure_8_2"), measured_8_2(rounds)


def _miss(throws: list[darts.DartThrow]) -> str:
    return f"{1000 * np.mean([throw.error for throw in throws]):.1f} mm off"


def measured_8_2(rounds: list[list[darts.DartThrow]]) -> dict:
    """Mean error of each round [mm]."""
    return {
        "mean_error_mm": [
            round(float(np.mean([1000 * throw.error for throw in some])), 2) for some in rounds
        ]
    }


TITLE_8_3 = "The error of dart throws falls with experience"
N_SEEDS, N_DEMONSTRATIONS_8_3, N_ATTEMPTS = 20, 8, 30


def errors(seed: int, one_aim: bool) -> np.ndarray:
    """Error (n_attempts,) [m] of the attempts of one run."""
    rng = np.random.default_rng(seed)
    shown = darts.demonstrate(N_DEMONSTRATIONS_8_3, rng)
    aims = (
        np.tile(darts.random_aims(1, rng), (N_ATTEMPTS, 1))
        if one_aim
        else darts.random_aims(N_ATTEMPTS, rng)
    )
    return np.array([throw.error for throw in darts.practise(shown, aims)])


def compute_8_3(seed: int = 0) -> dict[str, np.ndarray]:
    """Errors (n_seeds, n_attempts) [m] at new aims and at one aim."""
    seeds = range(seed, seed + N_SEEDS)
    return {
        name: np.array([errors(one, same) for one in seeds])
        for name, same in (("new aims", False), ("one aim", True))
    }


def draw_8_3(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    runs = compute_8_3(seed)
    with house_style():
        figure = Figure(figsize=(10.5, 4.2), layout="constrained")
        for axes, (name, error), colour in zip(
            figure.subplots(1, 2, sharey=True), runs.items(), (BLUE, VERMILION), strict=True
        ):
            _draw_runs(axes, 1000 * error, colour)
            what = "a new aim each time" if name == "new aims" else "the same aim each time"
            axes.set_title(
                f"{what}, {N_DEMONSTRATIONS_8_3} demonstrations before, n = {N_SEEDS} runs"
            )
            axes.set(xlabel="attempt", yscale="log")
        figure.axes[0].set_ylabel("distance from aim to hit [mm]")
        figure.axes[0].legend(loc="upper right")
        return save(figure, folder, "figure_8_3"), measured_8_3(runs)


def measured_8_3(runs: dict[str, np.ndarray]) -> dict:
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
