"""Pictures of the board: heat maps, the path of the best aim over sigma, an estimate, and the aims
of a leg.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Circle

from dart_skill.darts import (
    HIGHEST_CHECKOUT,
    RADII,
    SECTORS,
    Aim,
    Jump,
    LegPolicy,
    OptimumPath,
    Spread,
    SpreadEstimate,
    direction,
    heat_map,
    local_optima,
)
from dart_skill.figures._style import (
    BASKET,
    BLACK,
    BLUE,
    GREY,
    LIGHT,
    PALE,
    VERMILION,
    house_style,
    legend_below,
    letter_panels,
    quantity_colours,
)

NUMBERS_AT = 185.0
"""Radius at which the numbers of the sectors stand [mm]."""
LIMIT = 196.0
"""Limit of the picture to every side [mm]."""
HALO = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8}


@house_style()
def heat_map_figure(spread: Spread, spacing: float = 1.0) -> Figure:
    """The expected score over the board with all local optima, the best one as a cross.

    Parameters
    ----------
    spread
        Of the thrower.
    spacing
        Of the grid [mm].
    """
    figure = Figure(figsize=(7.2, 6.3), layout="constrained")
    axes = figure.subplots()
    image = _heat(axes, spread, local_optima(spread), spacing)
    figure.colorbar(image, ax=axes, label="expected score of one dart [points]", shrink=0.8)
    bias = f", bias ({spread.bias[0]:g}, {spread.bias[1]:g}) mm" if spread.bias.any() else ""
    narrow, wide = spread.deviations
    said = f"sigma = {wide:.1f} and {narrow:.1f} mm along its axes"
    said = f"sigma = {spread.sigma:g} mm" if spread.is_isotropic else said
    axes.set_title(f"Expected score by aim, {said}{bias}")
    handles, labels = axes.get_legend_handles_labels()
    legend_below(figure, handles, labels, 2)
    return figure


@house_style()
def path_figure(path: OptimumPath) -> Figure:
    """The best aim over sigma on the board, and its expected score; the curves end where the
    optimum jumps.
    """
    figure = Figure(figsize=(10.5, 5.0), layout="constrained")
    board, scores = figure.subplots(1, 2, width_ratios=(1.15, 1.0))
    draw_board(board, aims=path.aims)
    look: dict[str, Any] = {"vmin": path.sigmas[0], "vmax": path.sigmas[-1], "s": 12, "zorder": 3}
    for piece in path.pieces:
        sigmas, aims = path.sigmas[piece], path.aims[piece].T
        board.plot(*aims, color=GREY, linewidth=0.8, zorder=2)
        image = board.scatter(*aims, c=sigmas, cmap=quantity_colours(), **look)
        scores.plot(sigmas, path.expected_scores[piece], color=BLUE)
    for jump in path.jumps:
        _mark_jump(board, scores, jump)
    figure.colorbar(image, ax=board, label="sigma [mm]", shrink=0.8)
    board.set_title("Best aim for each sigma")
    scores.set(xlabel="sigma [mm]", ylabel="expected score of one dart [points]")
    scores.set(title="What it scores", ylim=(0, None))
    letter_panels(board, scores)
    return figure


@house_style()
def estimate_figure(estimate: SpreadEstimate, best: Aim) -> Figure:
    """The likelihood of sigma with its 95 % interval, and where to aim.

    Parameters
    ----------
    estimate
        Of the spread.
    best
        Where to aim.
    """
    figure = Figure(figsize=(10.5, 4.8), layout="constrained")
    curve, board = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
    _profile(curve, estimate)
    image = _heat(board, estimate.spread, [best], 1.0)
    figure.colorbar(image, ax=board, label="expected score of one dart [points]", shrink=0.8)
    board.set_title(f"Aim at {best.bed}: {best.expected_score:.2f} points per dart")
    letter_panels(curve, board)
    return figure


@house_style()
def leg_figure(policy: LegPolicy) -> Figure:
    """The expected turns or darts to the finish, and the aims of the first dart of a turn.

    Parameters
    ----------
    policy
        From `solve_leg`.
    """
    remaining = np.arange(2, policy.start + 1)
    aims = policy.aims[policy.choices[0][remaining, 0]]
    late, what = remaining <= HIGHEST_CHECKOUT, policy.objective
    figure = Figure(figsize=(10.5, 5.0), layout="constrained")
    curve, board = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
    curve.plot(remaining, policy.expected[remaining], color=BLUE)
    curve.set(xlabel="remaining score [points]", ylabel=f"expected {what} to the finish")
    curve.set(ylim=(0, None), xlim=(0, policy.start))
    curve.set_title(f"Double out from {policy.start}: {policy.expected[-1]:.2f} {what}")
    draw_board(board, aims=aims)
    if not late.all():
        cross: dict[str, Any] = {"color": BASKET, "markersize": 5, "linestyle": "none"}
        many = f"aim with more than {HIGHEST_CHECKOUT} left"
        board.plot(*aims[~late].T, "x", label=many, zorder=4, **cross)
    look = {"cmap": quantity_colours(), "vmin": 2, "vmax": HIGHEST_CHECKOUT, "zorder": 3}
    few = "aim with a score left that one turn can finish"
    image = board.scatter(*aims[late].T, c=remaining[late], s=18, label=few, **look)
    figure.colorbar(image, ax=board, label="remaining score [points]", shrink=0.8)
    board.set_title("Where the first dart of a turn is aimed")
    letter_panels(curve, board)
    handles, labels = board.get_legend_handles_labels()
    legend_below(figure, handles, labels, 2)
    return figure


def draw_board(axes: Axes, colour: str = LIGHT, aims: np.ndarray | None = None) -> None:
    """Draw the wires and numbers of the board [mm], as the thrower sees it.

    Parameters
    ----------
    aims : (n, 2)
        Beyond the board widen the picture.
    colour
        Of wires and numbers.
    """
    limit = LIMIT if aims is None else max(LIMIT, float(np.abs(aims).max()) + 10.0)
    draw_wires(axes, colour)
    for sector, number in enumerate(SECTORS):
        x, y = NUMBERS_AT * direction(sector)
        axes.text(x, y, str(number), ha="center", va="center", color=GREY, fontsize=8.5)
    axes.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal")
    axes.axis("off")


def draw_wires(axes: Axes, colour: str = LIGHT) -> None:
    """Draw the rings and the borders of the sectors alone [mm].

    Parameters
    ----------
    colour
        Of both.
    """
    for radius in RADII:
        axes.add_patch(
            Circle((0.0, 0.0), radius, facecolor="none", edgecolor=colour, linewidth=0.7)
        )
    for sector in range(len(SECTORS)):
        axes.plot(
            *np.outer(direction(sector + 0.5), RADII[[1, -1]]),
            color=colour,
            linewidth=0.7,
            zorder=1,
            scalex=False,
            scaley=False,
        )


def _heat(axes: Axes, spread: Spread, optima: list[Aim], spacing: float) -> AxesImage:
    heat = heat_map(spread, spacing)
    values = np.where(np.hypot(heat.x, heat.y[:, None]) <= RADII[-1], heat.expected_score, np.nan)
    edge = heat.x[-1] + 0.5 * spacing
    image = axes.imshow(
        values,
        origin="lower",
        extent=(-edge, edge, -edge, edge),
        cmap=quantity_colours(),
        interpolation="nearest",
    )
    draw_board(axes, "#FFFFFF60", np.array([optimum.point for optimum in optima]))
    dot: dict[str, Any] = {"color": "white", "markeredgecolor": BLACK, "markersize": 5}
    for number, optimum in enumerate(optima[1:]):
        name = None if number else "other local optimum"
        axes.plot(*optimum.point, "o", linestyle="none", label=name, **dot)
    best, (x, y) = optima[0], optima[0].point
    cross: dict[str, Any] = {"color": BASKET, "markeredgecolor": "white", "markersize": 11}
    axes.plot(x, y, "P", linestyle="none", label="best aim", **cross)
    said, beside = f"{best.bed}: {best.expected_score:.2f}", y + (14.0 if y < 0 else -14.0)
    axes.text(x, beside, said, ha="center", va="center", bbox=HALO)
    return image


def _mark_jump(board: Axes, scores: Axes, jump: Jump) -> None:
    ring: dict[str, Any] = {"markerfacecolor": "none", "markeredgecolor": VERMILION}
    for aim, side in ((jump.below, "<"), (jump.above, ">")):
        board.plot(*aim.point, "o", markersize=9, zorder=4, **ring)
        text = f"{aim.bed}, sigma {side} {jump.sigma:.2f}"
        look: dict[str, Any] = {"color": VERMILION, "va": "center", "fontsize": 8.5}
        board.text(aim.point[0] + 14.0, aim.point[1], text, bbox=HALO, zorder=5, **look)
    scores.axvline(jump.sigma, color=VERMILION, linewidth=0.9)
    label = f" {jump.sigma:.2f} mm: {jump.below.bed} to {jump.above.bed}"
    place: dict[str, Any] = {"transform": scores.get_xaxis_transform(), "va": "top"}
    scores.text(jump.sigma, 0.97, label, color=VERMILION, **place)


def _profile(axes: Axes, estimate: SpreadEstimate) -> None:
    low, high = estimate.confidence_interval()
    left = 0.85 * (low if low > 0 else 0.5 * estimate.sigma)
    right = 1.15 * (high if np.isfinite(high) else 3.0 * estimate.sigma)
    sigmas = np.linspace(left, right, 61)
    axes.plot(sigmas, estimate.profile(sigmas) - estimate.log_likelihood, color=BLUE)
    axes.axvspan(max(low, left), min(high, right), color=PALE, zorder=0)
    axes.axvline(estimate.sigma, color=VERMILION, linewidth=1.0)
    for end in (low, high):
        if left < end < right:
            axes.axvline(end, color=GREY, linewidth=0.8, linestyle="--")
    axes.set(xlabel="sigma [mm]", ylabel="log-likelihood below its maximum")
    axes.set(ylim=(-4.0, 0.15), xlim=(left, right))
    found = f"sigma = {estimate.sigma:.1f} mm, 95 % from {low:.1f} to {high:.1f} mm"
    axes.set_title(f"{estimate.n_throws} darts, {estimate.model} spread\n{found}")
