"""The learning curve: landing error of each throw of the arm in the order in which they were made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dart_skill.figures import BLUE, GREY, LIGHT, SKY, VERMILION, house_style
from dart_skill.session import ThrowResult
from dart_skill.world import the_world

WINDOW = 5
"""Throws of a running median and its quartiles."""


def curve_figure(throws: Sequence[ThrowResult], marks: Mapping[int, str] | None = None) -> Figure:
    """Error of each throw, and median and quartiles of the last five; ValueError if no landing was seen.

    marks: what happened after so many throws.
    """
    errors = np.array([np.nan if throw.error_m is None else 100.0 * throw.error_m for throw in throws])
    if not np.isfinite(errors).any():
        raise ValueError("no landing was seen: there is no error to draw")
    with house_style():
        figure = Figure(figsize=(10.5, 3.6), layout="constrained")
        axes = figure.subplots()
        numbers = np.arange(1, len(errors) + 1)
        if len(errors) >= WINDOW:
            low, middle, high = running_quartiles(errors)
            axes.fill_between(numbers, low, high, color=SKY, alpha=0.35, linewidth=0, label=f"quartiles of the last {WINDOW} throws")
            axes.plot(numbers, middle, color=BLUE, linewidth=1.8, label=f"median of the last {WINDOW} throws")
        _draw_throws(axes, numbers, errors, np.array([throw.in_basket for throw in throws]))
        if np.nanmax(errors) > 50.0 * the_world().basket_radius:  # else it would only make everything small
            axes.axhline(100.0 * the_world().basket_radius, color=GREY, linestyle="--", linewidth=1.0, label="rim of the basket")
        axes.set(
            xlabel="throw",
            ylabel="landing error [cm]",
            xlim=(0.5, len(errors) + 0.5),
            ylim=(0.0, 1.15 * np.nanmax(errors) + 0.1),
            title=headline(errors),
        )
        for after, what in (marks or {}).items():
            axes.axvline(after + 0.5, color=GREY, linestyle=":", linewidth=1.2)
            place: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "xytext": (4, -10), "textcoords": "offset points"}
            axes.annotate(what.replace("_", " "), (after + 0.5, 1.0), color=GREY, **place)
        axes.xaxis.set_major_locator(MaxNLocator(12, integer=True))
        axes.grid(axis="y", color=LIGHT, linewidth=0.5)
        axes.set_axisbelow(True)
        figure.legend(loc="outside lower center", ncols=6)
        return figure


def running_quartiles(errors: np.ndarray, window: int = WINDOW) -> np.ndarray:
    """Quartiles (3, n) of the finite ones of the last `window` errors (n,) at each place; nan before there are so many, or without any."""
    result = np.full((3, len(errors)), np.nan)
    views = np.lib.stride_tricks.sliding_window_view(errors, window) if len(errors) >= window else np.empty((0, window))
    known = np.isfinite(views).any(axis=1)
    result[:, window - 1 :][:, known] = np.nanpercentile(views[known], [25, 50, 75], axis=1)
    return result


def headline(errors: np.ndarray) -> str:
    """How many there are, and median and quartiles of those that were seen [cm]."""
    seen = errors[np.isfinite(errors)]
    low, middle, high = np.percentile(seen, [25, 50, 75])
    count = f"n = {len(errors)} throws" + (f", {len(seen)} landings seen" if len(seen) < len(errors) else "")
    return f"Landing error: median {middle:.1f} cm, quartiles {low:.1f} and {high:.1f} cm, {count}"


def _draw_throws(axes: Axes, numbers: np.ndarray, errors: np.ndarray, inside: np.ndarray) -> None:
    axes.plot(numbers[inside], errors[inside], "o", color=BLUE, markerfacecolor="white", markersize=5, linestyle="none", label="in")
    if (~inside & np.isfinite(errors)).any():
        axes.plot(numbers[~inside], errors[~inside], "X", color=VERMILION, markersize=6.5, linestyle="none", label="out")
    unseen = numbers[np.isnan(errors)]
    if len(unseen):
        look: dict[str, Any] = {"color": GREY, "markersize": 6, "linestyle": "none", "clip_on": False}
        axes.plot(unseen, np.zeros(len(unseen)), "|", label="landing not seen", **look)
