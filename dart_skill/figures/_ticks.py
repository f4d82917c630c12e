"""Ticks and their labels while a figure is written: one line and one text for an axis, in place of the five artists that matplotlib makes
for each tick, which take half of the time that it draws.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist, allow_rasterization
from matplotlib.axes import Axes
from matplotlib.axis import Axis, XAxis, YAxis
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.markers import TICKDOWN, TICKLEFT, MarkerStyle
from matplotlib.text import Text
from matplotlib.ticker import NullLocator
from matplotlib.transforms import IdentityTransform

USUAL = frozenset({"labelsize", "left", "bottom", "labelleft", "labelbottom", "right", "top", "labelright", "labeltop", "gridOn"})
"""What may be set of the ticks of an axis that is drawn here."""


@contextmanager
def light_ticks(panels: Iterable[Axes]) -> Iterator[None]:
    """For as long as the block runs, axes of these panels draw light ticks wherever nothing is special about them.

    panels: whose titles and labels have their place already (`PanelLayout`).
    """
    put: list[tuple[XAxis | YAxis, Artist]] = []
    try:
        for axes in panels:
            for axis in (axes.xaxis, axes.yaxis):
                if axes.axison and axis.get_visible() and _is_plain(axis):
                    put.append((axis, axes.add_artist(LightTicks(axis))))
                    axis.set_visible(False)
        yield
    finally:
        for axis, ticks in put:
            ticks.remove()
            axis.set_visible(True)


class LightTicks(Artist):
    """Ticks, their labels and the label of an axis at the bottom or at the left. axis: whose they are."""

    def __init__(self, axis: XAxis | YAxis) -> None:
        super().__init__()
        self._axis = axis
        self.set_zorder(axis.get_zorder())

    @allow_rasterization
    def draw(self, renderer: RendererBase) -> None:
        """Draw them. renderer: of matplotlib."""
        axis, axes = self._axis, self._axis.axes
        look = axis.get_tick_params(which="major")
        is_x, pixels = axis.axis_name == "x", renderer.points_to_pixels(1.0)
        places, texts = seen_ticks(axis)
        corner = axes.bbox.p0
        along = axes.transData.transform(np.column_stack([places, places]))[:, 0 if is_x else 1]
        side = np.full(len(along), corner[1 if is_x else 0])
        points = np.column_stack([along, side] if is_x else [side, along])
        settings = _settings(axis)
        if look.get("bottom" if is_x else "left", True):
            self._draw_marks(renderer, points, TICKDOWN if is_x else TICKLEFT, settings)
        if look.get("labelbottom" if is_x else "labelleft", True):
            away = (settings["size"] + settings["pad"]) * pixels
            size = look.get("labelsize", settings["labelsize"])
            self._draw_labels(renderer, points - ([0.0, away] if is_x else [away, 0.0]), texts, size)
        axis.label.draw(renderer)

    def _figure(self) -> Figure | SubFigure:
        figure = self._axis.get_figure()
        assert figure is not None  # or nothing would be drawn
        return figure

    def _draw_marks(self, renderer: RendererBase, points: np.ndarray, marker: int, settings: dict) -> None:
        look = {"markersize": settings["size"], "markeredgewidth": settings["width"], "color": settings["color"]}
        marks = Line2D(*points.T, linestyle="none", marker=MarkerStyle(marker), transform=IdentityTransform(), **look)
        marks.set_figure(self._figure())
        marks.draw(renderer)

    def _draw_labels(self, renderer: RendererBase, points: np.ndarray, texts: list[str], size: float) -> None:
        ha, va = ("center", "top") if self._axis.axis_name == "x" else ("right", "center_baseline")
        label = Text(ha=ha, va=va, fontsize=size, transform=IdentityTransform())
        label.set_figure(self._figure())
        for place, text in zip(points, texts, strict=True):
            label.set_position(tuple(place))
            label.set_text(text)
            label.draw(renderer)


def seen_ticks(axis: Axis) -> tuple[np.ndarray, list[str]]:
    """Places (n,) of the ticks that are seen, in units of the axis, and their labels."""
    low, high = sorted(axis.get_view_interval())
    places = np.asarray(axis.get_majorticklocs(), dtype=float)
    texts, slack = axis.get_major_formatter().format_ticks(places.tolist()), 1e-9 * (high - low)
    seen = np.flatnonzero((places >= low - slack) & (places <= high + slack))
    return places[seen], [texts[k] for k in seen]


def _is_plain(axis: XAxis | YAxis) -> bool:
    """Whether nothing is special about an axis: it is linear, without minor ticks, grid, or an exponent beside it."""
    plain = axis.get_scale() == "linear" and isinstance(axis.get_minor_locator(), NullLocator)
    look = axis.get_tick_params(which="major")
    if not plain or not USUAL.issuperset(look) or any(look.get(name) for name in ("gridOn", "right", "top", "labelright", "labeltop")):
        return False
    seen_ticks(axis)
    return not axis.get_major_formatter().get_offset()


def _settings(axis: XAxis | YAxis) -> dict[str, Any]:
    """Size, pad and width [points], colour and size of the labels, as matplotlib is set."""
    names = {"size": "major.size", "pad": "major.pad", "width": "major.width", "color": "color", "labelsize": "labelsize"}
    params: Any = matplotlib.rcParams
    return {name: params[f"{axis.axis_name}tick.{key}"] for name, key in names.items()}
