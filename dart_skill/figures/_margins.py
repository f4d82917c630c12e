"""Panels in rows and columns within margins that are fixed: room for so many lines of text,
whatever they say.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import LayoutEngine

LINE = 0.17
"""Height of a line of text [inches]."""
EDGE = 0.1
"""Free at the edges of a figure [inches]."""
TICKS_X = 0.45
"""Room below a panel for ticks, their labels and the label of the axis [inches]."""
TICKS_Y = 0.68
"""Room beside a panel for ticks, their labels and the label of the axis [inches]."""
BETWEEN = 0.2
"""Free between panels, and for the label of the last tick beyond its panel [inches]."""
BAR = 0.14
"""Thickness of a colour bar [inches]."""
LETTER = 0.52
"""Mean width of a letter, over the size of its font."""


class FixedMargins(LayoutEngine):
    """Panels whose sizes are in given ratios.

    Parameters
    ----------
    rows, columns
        How many there are.

    Attributes
    ----------
    bar
        Axes of the colour bar of all panels, None without one: above panels that stand in one
        column, else beside them.
    legend_rows
        Rows of the legend below all panels.
    """

    # what matplotlib asks of a layout engine
    _adjust_compatible = True
    _colorbar_gridspec = False

    def __init__(self, rows: int, columns: int) -> None:
        super().__init__()
        self.bar: Axes | None = None
        self.legend_rows = 0
        self._rows, self._columns = rows, columns

    def execute(self, fig: Figure) -> None:
        """Put the panels of a figure where they belong."""
        width, height = fig.get_size_inches()
        panels = [axes for axes in fig.axes if axes is not self.bar]
        lines = self._wrapped(panels, width)
        headline = sum(2 + text.get_text().count("\n") for text in fig.texts) * LINE
        legend = (1 + self.legend_rows) * LINE if self.legend_rows else 0.0
        bar = BAR + TICKS_X if self.bar is not None else 0.0
        beside, above = (bar + BETWEEN, 0.0) if self._columns > 1 else (0.0, bar and bar + LINE)
        left, right = EDGE + TICKS_Y, width - EDGE - BETWEEN - beside
        bottom, top = EDGE + legend + TICKS_X, height - EDGE - headline - above - lines * LINE
        is_shared = len(panels) > 1 and panels[1] in panels[0].get_shared_y_axes().get_siblings(
            panels[0]
        )
        across, up = BETWEEN + TICKS_Y * (not is_shared), BETWEEN + TICKS_X + lines * LINE
        wspace, hspace = (
            _space(right - left, across, self._columns),
            _space(top - bottom, up, self._rows),
        )
        fig.subplots_adjust(
            left / width, bottom / height, right / width, top / height, wspace, hspace
        )
        for axes in panels:
            axes.apply_aspect()
        if self.bar is not None:
            place = (left, height - EDGE - headline - TICKS_X - BAR, right - left, BAR)
            place = place if above else (right + BETWEEN, bottom, BAR, top - bottom)
            self.bar.set_position(
                (place[0] / width, place[1] / height, place[2] / width, place[3] / height)
            )

    def _wrapped(self, panels: Sequence[Axes], width: float) -> int:
        """Give titles as many lines as their panels are wide; the most that one has."""
        room = 72.0 * (width / self._columns - EDGE - TICKS_Y)
        for axes in panels:
            letters = int(room / (LETTER * float(axes.title.get_fontsize())))
            axes.set_title(
                "\n".join(
                    textwrap.fill(line, letters) for line in axes.get_title(loc="left").split("\n")
                ),
                loc="left",
                y=1.0,
            )
        return max(1 + axes.get_title(loc="left").count("\n") for axes in panels)


def _space(inner: float, gap: float, count: int) -> float:
    """A gap between panels as a share of their mean size, as matplotlib wants it. inner: of all
    panels with their gaps [inches].
    """
    return gap * count / (inner - (count - 1) * gap)
