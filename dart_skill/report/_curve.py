"""Landing errors: of each throw of the arm in the order in which they were made, and at fixed
baskets before and after practice.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dart_skill.common.world import the_world
from dart_skill.figures import (
    BLACK,
    FAILURE,
    GREY,
    LIGHT,
    SUCCESS,
    house_style,
    legend_below,
    letter_panels,
    panels,
)
from dart_skill.session import TrialResult

CURVE_WINDOW = 5
"""Throws of a running median and its quartiles."""


def curve_figure(
    throws: Sequence[TrialResult],
    narrow: bool = False,
    marks: Mapping[int, str] | None = None,
    learned: bool = False,
) -> Figure:
    """Error of each throw, and median and quartiles of the last five, or of all.

    Parameters
    ----------
    marks
        What happened, by the number of throws before it.
    narrow
        For a narrow screen.
    learned
        Whether the arm learned from each throw.

    Raises
    ------
    ValueError
        If no landing was seen.
    """
    errors = np.array(
        [np.nan if throw.error_m is None else 100.0 * throw.error_m for throw in throws]
    )
    if not np.isfinite(errors).any():
        raise ValueError("no landing was seen: there is no error to draw")
    with house_style():
        figure, (axes,) = panels([(10.5, 3.6)], narrow)
        numbers = np.arange(1, len(errors) + 1)
        if not learned:
            _draw_quartiles(axes, errors)
        elif len(errors) >= CURVE_WINDOW:
            low, middle, high = running_quartiles(errors)
            axes.fill_between(
                numbers,
                low,
                high,
                color=LIGHT,
                alpha=0.5,
                linewidth=0,
                label=f"quartiles of the last {CURVE_WINDOW} throws",
            )
            axes.plot(
                numbers,
                middle,
                color=BLACK,
                linewidth=1.8,
                label=f"median of the last {CURVE_WINDOW} throws",
            )
        _draw_throws(axes, numbers, errors, np.array([throw.success for throw in throws]))
        _draw_rim(axes, errors)
        axes.set(
            xlabel="throw",
            ylabel="landing error [cm]",
            xlim=(0.5, len(errors) + 0.5),
            ylim=(0.0, 1.15 * np.nanmax(errors) + 0.1),
            title=headline(errors).replace(": ", ":\n", 1) if narrow else headline(errors),
        )
        for after, what in (marks or {}).items():
            axes.axvline(after + 0.5, color=GREY, linestyle=":", linewidth=1.2)
            place: dict[str, Any] = {
                "xycoords": ("data", "axes fraction"),
                "xytext": (4, -10),
                "textcoords": "offset points",
            }
            axes.annotate(what.replace("_", " "), (after + 0.5, 1.0), color=GREY, **place)
        axes.xaxis.set_major_locator(MaxNLocator(12, integer=True))
        axes.grid(axis="y", color=LIGHT, linewidth=0.5)
        axes.set_axisbelow(True)
        handles, labels = axes.get_legend_handles_labels()
        legend_below(figure, handles, labels, 6, narrow)
        return figure


def compared_figure(
    tests: Sequence[tuple[str, Sequence[TrialResult]]], narrow: bool = False
) -> Figure:
    """Errors at the same baskets in each test, basket by basket, and all of them together.

    Parameters
    ----------
    tests
        What each is called, and its throws; the same number at the same baskets.

    Raises
    ------
    ValueError
        For less than two tests.
    """
    if len(tests) < 2 or len({len(throws) for _, throws in tests}) != 1:
        raise ValueError(
            f"{len(tests)} tests: it takes two or more with the same number of throws to compare"
            " them"
        )
    errors = np.array(
        [
            [np.nan if one.error_m is None else 100.0 * one.error_m for one in throws]
            for _, throws in tests
        ]
    )
    inside = np.array([[one.success for one in throws] for _, throws in tests])
    if not np.isfinite(errors).any():
        raise ValueError("no landing was seen: there is no error to draw")
    with house_style():
        figure, (paired, ordered) = panels([(4.6, 3.8), (5.9, 3.8)], narrow, sharey=True)
        _draw_pairs(paired, [name for name, _ in tests], errors, inside)
        _draw_by_basket(ordered, tests, errors, inside)
        for axes in (paired, ordered) if narrow else (paired,):
            axes.set_ylabel("landing error [cm]")
            axes.set_ylim(0.0, 1.15 * np.nanmax(errors) + 0.1)
        letter_panels(paired, ordered)
        handles, labels = paired.get_legend_handles_labels()
        legend_below(figure, handles, labels, 5, narrow)
        return figure


def _draw_quartiles(axes: Axes, errors: np.ndarray) -> None:
    """Draw the quartiles of all throws: where nothing is learned, their order means nothing."""
    low, middle, high = np.nanpercentile(errors, [25, 50, 75])
    axes.axhspan(low, high, color=LIGHT, alpha=0.5, linewidth=0, label="quartiles")
    axes.axhline(middle, color=BLACK, linewidth=1.8, label="median")


def _draw_pairs(axes: Axes, names: Sequence[str], errors: np.ndarray, inside: np.ndarray) -> None:
    places = np.arange(len(names))
    for column, one in enumerate(errors.T):
        axes.plot(
            places,
            one,
            color=LIGHT,
            linewidth=1.0,
            zorder=1,
            label="one basket" if not column else None,
        )
    for place, row, which in zip(places, errors, inside, strict=True):
        _draw_marks(axes, np.full(len(row), float(place)), row, which, labelled=not place)
    medians = [np.nanmedian(row) if np.isfinite(row).any() else np.nan for row in errors]
    axes.plot(places, medians, "_", color=BLACK, markersize=34, markeredgewidth=2.2, zorder=4)
    axes.plot([], [], color=BLACK, linewidth=2.2, label="median")
    for place, median in zip(places, medians, strict=True):
        axes.annotate(
            f"{median:.2f}",
            (place, median),
            xytext=(20, 0),
            textcoords="offset points",
            va="center",
        )
    _draw_rim(axes, errors)
    axes.set(xticks=places, xlim=(-0.5, len(names) - 0.4), title="All baskets of the test")
    axes.set_xticklabels(names)
    axes.grid(axis="y", color=LIGHT, linewidth=0.5)
    axes.set_axisbelow(True)


def _draw_by_basket(
    axes: Axes,
    tests: Sequence[tuple[str, Sequence[TrialResult]]],
    errors: np.ndarray,
    inside: np.ndarray,
) -> None:
    """One column a basket, the nearest first: an arrow to the last test from the one before."""
    throws = tests[0][1]
    order = np.argsort([throw.distance for throw in throws])
    for place, k in enumerate(order):
        first, last = errors[-2, k], errors[-1, k]
        if np.isfinite([first, last]).all():
            axes.annotate(
                "",
                (place, last),
                (place, first),
                arrowprops={"arrowstyle": "->", "color": GREY, "shrinkA": 3, "shrinkB": 3},
            )
    for row, which in ((errors[-2], inside[-2]), (errors[-1], inside[-1])):
        _draw_marks(
            axes, np.arange(len(order), dtype=float), row[order], which[order], labelled=False
        )
    labels = [
        f"{throws[k].distance:.1f} m\n{np.degrees(throws[k].azimuth):+.0f}\N{DEGREE SIGN}"
        for k in order
    ]
    axes.set(
        xlabel="basket of the test: distance and azimuth",
        title="Basket by basket, the nearest first",
    )
    axes.set_xticks(range(len(order)), labels)
    axes.tick_params(axis="x", labelsize=8.0)
    axes.grid(axis="y", color=LIGHT, linewidth=0.5)
    axes.set_axisbelow(True)


def _draw_rim(axes: Axes, errors: np.ndarray) -> None:
    """Where an error begins that is out; not where it would only make everything small [cm]."""
    if np.nanmax(errors) > 50.0 * the_world().basket_radius:
        axes.axhline(
            100.0 * the_world().basket_radius,
            color=GREY,
            linestyle="--",
            linewidth=1.0,
            label="rim of the basket",
        )


def running_quartiles(errors: np.ndarray, window: int = CURVE_WINDOW) -> np.ndarray:
    """Quartiles (3, n) of the finite ones of the last `window` errors (n,) at each place; nan
    before there are `window` of them, or without any.
    """
    result = np.full((3, len(errors)), np.nan)
    views = (
        np.lib.stride_tricks.sliding_window_view(errors, window)
        if len(errors) >= window
        else np.empty((0, window))
    )
    known = np.isfinite(views).any(axis=1)
    result[:, window - 1 :][:, known] = np.nanpercentile(views[known], [25, 50, 75], axis=1)
    return result


def headline(errors: np.ndarray) -> str:
    """How many there are, and median and quartiles of those that were seen [cm]."""
    seen = errors[np.isfinite(errors)]
    low, middle, high = np.percentile(seen, [25, 50, 75])
    count = f"n = {len(errors)} throws" + (
        f", {len(seen)} landings seen" if len(seen) < len(errors) else ""
    )
    return f"Landing error: median {middle:.1f} cm, quartiles {low:.1f} and {high:.1f} cm, {count}"


def _draw_throws(axes: Axes, numbers: np.ndarray, errors: np.ndarray, inside: np.ndarray) -> None:
    _draw_marks(axes, numbers.astype(float), errors, inside, labelled=True)
    unseen = numbers[np.isnan(errors)]
    if len(unseen):
        look: dict[str, Any] = {
            "color": GREY,
            "markersize": 6,
            "linestyle": "none",
            "clip_on": False,
        }
        axes.plot(unseen, np.zeros(len(unseen)), "|", label="landing not seen", **look)


def _draw_marks(
    axes: Axes, places: np.ndarray, errors: np.ndarray, inside: np.ndarray, labelled: bool
) -> None:
    """A ring for each throw that went in, a cross for each other one that was seen; labelled: in
    the legend.
    """
    look: dict[str, Any] = {"linestyle": "none", "zorder": 3}
    ring: dict[str, Any] = {"color": SUCCESS, "markerfacecolor": "white", "markersize": 5}
    axes.plot(
        places[inside], errors[inside], "o", label="in" if labelled else None, **ring, **look
    )
    out = ~inside & np.isfinite(errors)
    if out.any():
        axes.plot(
            places[out],
            errors[out],
            "X",
            color=FAILURE,
            markersize=6.5,
            label="out" if labelled else None,
            **look,
        )
