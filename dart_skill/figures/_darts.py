"""Figure `arm_darts`: spread, aim and score of an arm that practises darts, throw by throw, and
where its darts went.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dart_skill.darts import name_at
from dart_skill.figures._board import LIMIT, draw_board, draw_wires
from dart_skill.figures._style import (
    BLACK,
    BLUE,
    GREY,
    LIGHT,
    NARROW,
    ORANGE,
    RELEASE,
    VERMILION,
    house_style,
    letter_panels,
    quantity_colours,
    zoomed_inset,
)
from dart_skill.session import Dart, DartsRun

RUNNING = 25
"""Throws of a running mean."""
MOST_BEDS = 12
"""Largest number of beds that the panel of aims names."""
FEW = 60
"""Largest number of throws that are drawn with large marks."""
BLOB = 40.0
"""Hits that are all so near to the bull are shown larger, too [mm]."""


@house_style()
def arm_darts_figure(run: DartsRun, narrow: bool = False) -> Figure:
    """The figure itself.

    Parameters
    ----------
    narrow
        Its panels stand one below the other.

    Raises
    ------
    ValueError
        For a run without throws.
    """
    if not run.darts:
        raise ValueError("a run without throws: there is nothing to draw")
    throws = np.arange(1, len(run.darts) + 1)
    figure = Figure(figsize=(NARROW, 12.0) if narrow else (12.0, 7.2), layout="constrained")
    if narrow:
        grid = figure.add_gridspec(4, 1, height_ratios=(1, 1, 1, 1.5))
    else:
        grid = figure.add_gridspec(3, 2, width_ratios=(1.55, 1.0))
    spread = figure.add_subplot(grid[0, 0])
    aim, scores = (figure.add_subplot(grid[k, 0], sharex=spread) for k in (1, 2))
    hits = figure.add_subplot(grid[3, 0] if narrow else grid[:, 1])
    _draw_spread(spread, throws, run.darts)
    _draw_aim(aim, throws, run.darts)
    _draw_scores(scores, throws, run.darts)
    _draw_hits(figure, hits, throws, run.darts)
    letter_panels(spread, aim, scores, hits)
    for axes in (spread, scores):
        _legend_between(axes, 2 if narrow else 4)
    x, _, height = run.board
    where = f"bull {x:.2f} m from the base axis and {height:.2f} m high"
    between = "\n" if narrow else " "
    figure.suptitle(f"Darts by the arm, seed {run.seed}:{between}{where}", x=0.01, ha="left")
    return figure


def running(values: np.ndarray, n: int = RUNNING) -> np.ndarray:
    """Mean of the last n finite values (m,) at each place; nan before there are n."""
    known = np.cumsum(np.concatenate([[0.0], np.nan_to_num(values)]))
    count = np.cumsum(np.concatenate([[0], np.isfinite(values)]))
    result = np.full(len(values), np.nan)
    inside = count[n:] - count[:-n]
    result[n - 1 :] = np.divide(
        known[n:] - known[:-n], inside, out=np.full(len(inside), np.nan), where=inside > 0
    )
    return result


def _draw_spread(axes: Axes, throws: np.ndarray, darts: Sequence[Dart]) -> None:
    sigmas = np.sqrt(np.array([np.diag(dart.covariance) for dart in darts]))
    sigmas[sigmas == 0.0] = np.nan
    miss = np.abs([np.subtract(dart.hit, dart.aim) for dart in darts])
    for axis, (label, colour, marker) in enumerate(
        (("across", ORANGE, "x"), ("up and down", BLUE, "."))
    ):
        look: dict[str, Any] = {
            "color": colour,
            "markersize": 3.5 * _larger(throws),
            "alpha": 0.45 if len(throws) > FEW else 1.0,
            "linestyle": "none",
        }
        axes.plot(throws, miss[:, axis], marker, label=f"miss {label}", **look)
        line: dict[str, Any] = {"color": colour, "linewidth": 1.8, "label": f"sigma {label}"}
        _plot_known(axes, throws, sigmas[:, axis], **line)
    axes.set(
        ylabel="spread [mm]",
        ylim=(0, 1.05 * np.nanpercentile(miss, 99) + 1),
        title="Misses, and their sigma as estimated",
    )
    moved = 1e3 * np.array([dart.release_shift for dart in darts])
    if np.isfinite(moved).any():
        release = axes.twinx()
        release.step(throws, moved, where="mid", color=RELEASE, linewidth=1.0, linestyle="--")
        release.set_ylabel("release moved by [ms]", color=RELEASE)
        release.spines["right"].set_visible(True)
        release.set_ylim(3.0 * min(np.nanmin(moved), -1.0), 0.0)


def _draw_aim(axes: Axes, throws: np.ndarray, darts: Sequence[Dart]) -> None:
    beds = [name_at(dart.aim) for dart in darts]
    names = list(dict.fromkeys(beds))[:MOST_BEDS]
    level = [names.index(bed) if bed in names else np.nan for bed in beds]
    size = 2.5 * _larger(throws)
    axes.plot(throws, level, "s", color=BLACK, markersize=size, linestyle="none")
    axes.set_yticks(range(len(names)), names)
    axes.set(
        ylabel="bed aimed at",
        ylim=(-0.6, len(names) - 0.4),
        title="Aim: the best one for the spread as estimated so far",
    )
    axes.grid(axis="y", color=LIGHT, linewidth=0.5)


def _draw_scores(axes: Axes, throws: np.ndarray, darts: Sequence[Dart]) -> None:
    scores = np.array([dart.score for dart in darts], dtype=float)
    look: dict[str, Any] = {
        "color": LIGHT if len(throws) > FEW else GREY,
        "markersize": 4 * _larger(throws),
        "linestyle": "none",
    }
    axes.plot(throws, scores, ".", label="each dart", zorder=1, **look)
    _plot_known(
        axes, throws, running(scores), color=BLUE, linewidth=1.8, label=f"mean of {RUNNING}"
    )
    _plot_known(
        axes,
        throws,
        np.array([dart.expected for dart in darts], dtype=float),
        color=VERMILION,
        linewidth=1.2,
        label="expected",
    )
    axes.set(
        xlabel="throw",
        ylabel="score of a dart",
        ylim=(-2, 68),
        xlim=(0, len(throws) + 1),
        title="Score, as seen",
    )
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def _larger(throws: np.ndarray) -> float:
    """By how much the marks of few throws are larger, which would be specks."""
    return 1.0 if len(throws) > FEW else 1.6


def _plot_known(axes: Axes, throws: np.ndarray, values: np.ndarray, **look: Any) -> None:
    """A line, and its entry in the legend, where enough is known (m,) to draw one."""
    if np.isfinite(values).sum() > 1:
        axes.plot(throws, values, **look)


def _legend_between(axes: Axes, columns: int) -> None:
    """A legend of its own between the title of a panel and its axes."""
    handles, labels = axes.get_legend_handles_labels()
    rows = -(-len(labels) // columns)
    look: dict[str, Any] = {"handlelength": 1.2, "columnspacing": 1.2}
    legend = axes.legend(
        handles,
        labels,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        borderaxespad=0.0,
        **look,
    )
    # it would make the panel narrower; the title keeps its height free
    legend.set_in_layout(False)
    axes.set_title(axes.get_title(loc="left"), loc="left", pad=6.0 + 14.0 * rows)


def _draw_hits(figure: Figure, axes: Axes, throws: np.ndarray, darts: Sequence[Dart]) -> None:
    draw_board(axes, GREY)
    hits = np.array([dart.hit for dart in darts])
    seen = np.isfinite(hits).all(axis=1)
    look: dict[str, Any] = {
        "cmap": quantity_colours(),
        "vmin": 1,
        "vmax": max(2, len(throws)),
        "zorder": 3,
    }
    x, y = hits[seen].T
    image = axes.scatter(x, y, c=throws[seen], s=9 * _larger(throws), **look)
    figure.colorbar(image, ax=axes, label="throw", shrink=0.6, ticks=MaxNLocator(integer=True))
    axes.set_title(f"Where {int(seen.sum())} darts hit,\nas the thrower sees the board")
    half = float(5.0 * np.ceil(1.1 * np.abs(hits[seen]).max(initial=0.0) / 5.0))
    if 0.0 < half <= BLOB:
        axes.set_ylim(-LIMIT, 1.6 * LIMIT)
        inset = zoomed_inset(axes, half, (0.68, 0.69, 0.32, 0.25), "mm")
        draw_wires(inset, GREY)
        inset.scatter(x, y, c=throws[seen], s=18, **look)
