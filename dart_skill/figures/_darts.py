"""Figure `arm_darts`: spread, aim and score of an arm that practises darts, throw by throw, and
where its darts went.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dart_skill.darts import name_at
from dart_skill.figures._board import draw_board, draw_wires
from dart_skill.figures._style import (
    BLACK,
    BLUE,
    FEW_LEVELS,
    GREY,
    LIGHT,
    NARROW,
    ORANGE,
    RELEASE,
    VERMILION,
    WHITE,
    close_gaps,
    house_style,
    letter_panels,
    quantity_colours,
)
from dart_skill.session import Dart, DartsRun

RUNNING = 25
"""Throws of a running mean."""
MOST_BEDS = 12
"""Largest number of beds that the panel of aims names."""
FEW = 60
"""Largest number of throws that are drawn with large marks."""
NEARER = (15.0, 60.0)
"""Half the width of the picture of the board about the last aim, at least and at most [mm]."""
BOARD_HEIGHT = {"h": 5.0, "n": 5.0, "s": 1.9, "a": 1.5, "c": 1.9}
"""Heights of rows, by their first panel: hits, nearer, spread, aim, scores."""
BROAD_ROWS, NARROW_ROWS = ["hn", "ss", "aa", "cc"], ["h", "n", "s", "a", "c"]
"""Panels side by side, and one below the other."""


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
    size, rows = ((NARROW, 15.6), NARROW_ROWS) if narrow else ((12.0, 11.6), BROAD_ROWS)
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplot_mosaic(
        "\n".join(rows), height_ratios=[BOARD_HEIGHT[row[0]] for row in rows]
    )
    hits, nearer, spread, aim, scores = (panels[name] for name in "hnsac")
    for axes in (aim, scores):
        axes.sharex(spread)
    shades = _draw_hits(hits, throws, run.darts)
    _draw_nearer(nearer, throws, run.darts)
    bar = figure.colorbar(
        shades,
        ax=nearer if narrow else [hits, nearer],
        label="throw",
        location="bottom",
        aspect=40,
        ticks=MaxNLocator(integer=True),
    )
    close_gaps(bar)
    _draw_spread(spread, throws, run.darts)
    _draw_aim(aim, throws, run.darts)
    _draw_scores(scores, throws, run.darts)
    letter_panels(hits, nearer, spread, aim, scores)
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


def _draw_hits(axes: Axes, throws: np.ndarray, darts: Sequence[Dart]) -> ScalarMappable:
    """The whole board with every hit; the shades of the throws."""
    draw_board(axes, GREY)
    hits = np.array([dart.hit for dart in darts])
    axes.set_title(
        f"Where {int(np.isfinite(hits).all(axis=1).sum())} darts hit, as the thrower sees the board"
    )
    return _scatter(axes, throws, hits, 22)


def _draw_nearer(axes: Axes, throws: np.ndarray, darts: Sequence[Dart]) -> None:
    """The hits of the darts that were aimed as the last one, and the board about it, larger."""
    aims, hits = (np.array([getattr(dart, what) for dart in darts]) for what in ("aim", "hit"))
    bed = name_at(darts[-1].aim)
    alike = np.array([name_at(aim) == bed for aim in aims])
    middle, misses = aims[-1], hits[alike] - aims[-1]
    half = np.clip(5.0 * np.ceil(1.1 * np.nanmax(np.abs(misses), initial=0.0) / 5.0), *NEARER)
    draw_wires(axes, GREY)
    _scatter(axes, throws[alike], hits[alike], 55, len(throws))
    axes.plot(*middle, "+", color=BLACK, markersize=16, markeredgewidth=1.5, label="aim")
    axes.set(
        xlim=(middle[0] - half, middle[0] + half),
        ylim=(middle[1] - half, middle[1] + half),
        aspect="equal",
        xticks=[],
        yticks=[],
        title=f"{int(alike.sum())} darts at {bed}, as the last, \N{PLUS-MINUS SIGN}{half:g} mm",
    )
    for spine in axes.spines.values():
        spine.set(visible=True, color=GREY)


def _scatter(
    axes: Axes, throws: np.ndarray, hits: np.ndarray, size: float, last: int | None = None
) -> ScalarMappable:
    """Hits (n, 2) [mm] of throws (n,), those that were seen, shaded from the first to the last."""
    seen = np.isfinite(hits).all(axis=1)
    look: dict[str, Any] = {
        "cmap": quantity_colours(FEW_LEVELS),
        "vmin": 1,
        "vmax": max(2, last or len(throws)),
        "zorder": 3,
        "edgecolors": WHITE,
        "linewidths": 0.5,
    }
    x, y = hits[seen].T
    return axes.scatter(x, y, c=throws[seen], s=size, **look)
