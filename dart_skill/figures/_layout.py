"""Where the panels of a figure stand: rows and columns between the margins that their titles, ticks and labels need.

The layout of matplotlib draws a figure several times to find this out. Here texts are measured by their font alone, so the layout of a
figure takes a few milliseconds, and it is the same to the last bit each time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.layout_engine import LayoutEngine
from matplotlib.transforms import Affine2D, ScaledTranslation

from dart_skill.figures._texts import text_size
from dart_skill.figures._ticks import seen_ticks

LINE = 1.2
"""From one line of text to the next, over the size of the font."""
EDGE, GAP = 4.0, 9.0
"""Free at the edges of a figure, and between panels [points]."""
OVERHANG = 10.0
"""Of the label of the last tick beyond its panel [points]."""
BAR = 10.0
"""Thickness of a colour bar [points]."""
FIRST_GUESS = 40.0
"""Width of the margin for ticks and their labels, by which ticks are found [points]."""


@dataclass(frozen=True)
class ColourBar:
    """The axes of a colour bar, and the side of all panels on which it stands: it is as long as they are together."""

    axes: Axes
    side: Literal["right", "top"]


@dataclass(frozen=True)
class _Look:
    """What was set when a figure was made: whoever shows it later may have other settings.

    * tick_size: of their labels [points]; tick_length: of a tick and the space to its label [points]; title_pad: below a title [points].
    * family: of the font.
    """

    tick_size: float
    tick_length: float
    title_pad: float
    family: tuple[str, ...]

    @classmethod
    def now(cls) -> _Look:
        """As matplotlib is set."""
        params = matplotlib.rcParams
        size = FontProperties(size=params["xtick.labelsize"]).get_size_in_points()
        length = params["xtick.major.size"] + params["xtick.major.pad"]
        return cls(float(size), float(length), float(params["axes.titlepad"]), tuple(params["font.family"]))


@dataclass
class _Margins:
    """Around a panel [points]."""

    left: float = 0.0
    right: float = 0.0
    bottom: float = 0.0
    top: float = 0.0


class PanelLayout(LayoutEngine):
    """Panels whose sizes are in given ratios, as large as titles, labels, legend and colour bar leave room.

    * grid: the panels (n_rows, n_columns).
    * widths, heights: of the columns and of the rows, in any unit: only their ratios count.

    Attributes: bar, the colour bar for all panels, None without one; legend_height, of the legend below them [points].
    """

    # what matplotlib asks of a layout engine
    _adjust_compatible = False
    _colorbar_gridspec = False

    def __init__(self, grid: Sequence[Sequence[Axes]] | np.ndarray, widths: Sequence[float], heights: Sequence[float]) -> None:
        super().__init__()
        self.bar: ColourBar | None = None
        self.legend_height = 0.0
        self._look = _Look.now()
        self._grid = [list(row) for row in grid]
        self._widths, self._heights = np.asarray(widths, dtype=float), np.asarray(heights, dtype=float)

    @property
    def panels(self) -> list[Axes]:
        """All of them, row by row."""
        return [axes for row in self._grid for axes in row]

    def execute(self, fig: Figure) -> None:
        """Put the panels of a figure where they belong. fig: of these panels."""
        self._place(fig, [[_margins(axes, self._look, FIRST_GUESS) for axes in row] for row in self._grid])
        self._place(fig, [[_margins(axes, self._look, None) for axes in row] for row in self._grid])
        if self._wrap_titles(fig):
            self._place(fig, [[_margins(axes, self._look, None) for axes in row] for row in self._grid])
        for axes in self.panels:
            _fix_texts(axes, self._look, fig.dpi_scale_trans)

    def _wrap_titles(self, figure: Figure) -> bool:
        """Titles in as many lines as they need to end before the next panel, or the edge; whether any has become longer."""
        longer = False
        for row in self._grid:
            begins = [72.0 * figure.get_figwidth() * axes.get_position().x0 for axes in row]
            ends = [begin - GAP for begin in begins[1:]] + [72.0 * figure.get_figwidth() - EDGE]
            for axes, begin, end in zip(row, begins, ends, strict=True):
                title = axes.get_title(loc="left")
                text = wrapped(title, end - begin, axes.title.get_fontsize(), self._look.family)
                if text != title:
                    axes.set_title(text, loc="left")
                    longer = True
        return longer

    def _place(self, figure: Figure, margins: list[list[_Margins]]) -> None:
        """Panels within their margins; of those with an aspect the limits, or the box."""
        width, height = 72.0 * figure.get_figwidth(), 72.0 * figure.get_figheight()
        outer = self._outer(figure)
        left = np.array([max(row[k].left for row in margins) for k in range(len(self._widths))])
        right = np.array([max(row[k].right for row in margins) for k in range(len(self._widths))])
        top = np.array([max(one.top for one in row) for row in margins])
        bottom = np.array([max(one.bottom for one in row) for row in margins])
        inner_width = width - outer.left - outer.right - (left + right).sum() - GAP * (len(left) - 1)
        inner_height = height - outer.top - outer.bottom - (top + bottom).sum() - GAP * (len(top) - 1)
        widths = self._widths / self._widths.sum() * max(inner_width, 1.0)
        heights = self._heights / self._heights.sum() * max(inner_height, 1.0)
        x = outer.left + np.cumsum(left) + np.concatenate([[0.0], np.cumsum(widths + right + GAP)[:-1]])
        y = height - outer.top - np.cumsum(top + heights) - np.concatenate([[0.0], np.cumsum(bottom + GAP)[:-1]])
        scale = 1.0 / np.array([width, height, width, height])
        for i, row in enumerate(self._grid):
            for j, axes in enumerate(row):
                axes.set_position(tuple(np.array([x[j], y[i], widths[j], heights[i]]) * scale))
                axes.apply_aspect()
        if self.bar is not None:
            self.bar.axes.set_position(tuple(self._bar_box(outer, height, x, y, widths, heights) * scale))

    def _bar_box(self, outer: _Margins, height: float, x: np.ndarray, y: np.ndarray, widths: np.ndarray, heights: np.ndarray) -> np.ndarray:
        """Left, bottom, width and height of the colour bar [points]."""
        right, top = x[-1] + widths[-1], y[0] + heights[0]
        if self.bar is not None and self.bar.side == "top":
            return np.array([x[0], height - outer.top + GAP, right - x[0], BAR])
        return np.array([right + OVERHANG + GAP, y[-1], BAR, top - y[-1]])

    def _outer(self, figure: Figure) -> _Margins:
        """What stands around all panels: edges, headline, legend and colour bar."""
        outer = _Margins(EDGE, EDGE, EDGE, EDGE)
        for headline in figure.texts:
            headline.set_y(1.0 - outer.top / (72.0 * figure.get_figheight()))
            outer.top += _height(headline.get_text(), headline.get_fontsize()) + GAP
        outer.bottom += self.legend_height
        if self.bar is not None:
            axis = self.bar.axes.xaxis if self.bar.side == "top" else self.bar.axes.yaxis
            beside = _ticks_size(axis, self._look, None) + _label_size(axis)
            if self.bar.side == "top":
                outer.top += beside + BAR + 2.0 * GAP
            else:
                outer.right += beside + BAR + GAP
        return outer


def _margins(axes: Axes, look: _Look, ticks: float | None) -> _Margins:
    """What a panel needs around it; ticks: width of the margin for them, None: as wide as their labels are."""
    title = axes.get_title(loc="left") or axes.get_title()
    top = _height(title, axes.title.get_fontsize()) + look.title_pad if title else OVERHANG / 2.0
    if not axes.axison:
        return _Margins(top=top)
    left = _label_size(axes.yaxis) + (_ticks_size(axes.yaxis, look, ticks) if _has_labels(axes.yaxis) else 0.0)
    bottom = _label_size(axes.xaxis) + (_ticks_size(axes.xaxis, look, ticks) if _has_labels(axes.xaxis) else 0.0)
    return _Margins(left, OVERHANG, bottom, top)


def _has_labels(axis: XAxis | YAxis) -> bool:
    """Whether ticks have labels: of panels that share an axis, one has."""
    shown = axis.get_tick_params(which="major")
    return bool(shown.get("labelleft", True) if axis.axis_name == "y" else shown.get("labelbottom", True))


def _ticks_size(axis: XAxis | YAxis, look: _Look, guess: float | None) -> float:
    """From the spine to the far end of the labels of ticks [points]; guess: of labels of y, None: they are measured."""
    size = axis.get_tick_params(which="major").get("labelsize", look.tick_size)
    if axis.axis_name == "x":
        return look.tick_length + max((_height(text, size) for text in seen_ticks(axis)[1]), default=0.0)
    if guess is not None:
        return guess
    lines = [line for text in seen_ticks(axis)[1] for line in text.split("\n")]
    return look.tick_length + max((_width(line, size, look.family) for line in lines), default=0.0)


def _label_size(axis: XAxis | YAxis) -> float:
    """Of the label of an axis, with the space between it and the ticks [points]."""
    text = axis.get_label_text()
    return _height(text, axis.label.get_fontsize()) + axis.labelpad if text else 0.0


def legend_height(rows: int) -> float:
    """Of a legend of so many rows, as matplotlib is set [points]."""
    params: Any = matplotlib.rcParams
    look = {name: params[f"legend.{name}"] for name in ("fontsize", "labelspacing", "borderpad", "borderaxespad")}
    size = FontProperties(size=look["fontsize"]).get_size_in_points()
    return float(size * (rows * (LINE + look["labelspacing"]) + 2.0 * look["borderpad"] + look["borderaxespad"]))


def _height(text: str, size: Any) -> float:
    """Of a text of one or more lines [points]."""
    return FontProperties(size=size).get_size_in_points() * (1.0 + LINE * text.count("\n"))


@lru_cache(maxsize=4096)
def _width(text: str, size: float, family: tuple[str, ...]) -> float:
    """Of a line of text [points]."""
    return text_size(text, FontProperties(family=list(family), size=size))[0]


def wrapped(text: str, width: float, size: float, family: tuple[str, ...]) -> str:
    """A text whose lines are no wider than so many points, unless a single word is; size, family: of its font.

    Where a line is too long, it ends at its last comma, if that is in its second half, or else between two words.
    """
    lines: list[str] = []
    for line in text.split("\n"):
        lines.append("")
        for word in line.split(" "):
            longer = f"{lines[-1]} {word}" if lines[-1] else word
            if lines[-1] and _width(longer, size, family) > width:
                comma = lines[-1].rfind(", ")
                end = comma + 1 if comma > len(lines[-1]) / 2 else len(lines[-1])
                longer = f"{lines[-1][end:]} {word}".strip()
                lines[-1] = lines[-1][:end]
                lines.append("")
            lines[-1] = longer
    return "\n".join(lines)


def _fix_texts(axes: Axes, look: _Look, inches: Affine2D) -> None:
    """Titles and labels of axes where they belong, so that matplotlib need not look for a place when it draws."""
    titles: tuple[Literal["left", "center", "right"], ...] = ("left", "center", "right")
    for loc in titles:
        if text := axes.get_title(loc=loc):
            axes.set_title(text, loc=loc, y=1.0)
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_label_text() and axes.axison:
            away = -(_ticks_size(axis, look, None) if _has_labels(axis) else 0.0) - axis.labelpad
            shift = (0.0, away / 72.0) if axis.axis_name == "x" else (away / 72.0, 0.0)
            place = (0.5, 0.0) if axis.axis_name == "x" else (0.0, 0.5)
            axis.set_label_coords(*place, transform=axes.transAxes + ScaledTranslation(*shift, inches))
