"""Sizes of texts in figures, each measured once: a text stands in several panels, and in both forms of a figure.

matplotlib remembers a size for as long as one file is written. To measure a text takes a third of a millisecond.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, TextIO

from matplotlib.backends.backend_mixed import MixedModeRenderer
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

POINTS = 72.0
"""In an inch, and units of an SVG file."""


@lru_cache(maxsize=4096)
def text_size(text: str, font: FontProperties, ismath: Any = False) -> tuple[float, float, float]:
    """Width, height and descent of a line of text [points].

    * text: the line.
    * font: its font, which nobody changes afterwards.
    * ismath: whether it is a formula, as matplotlib says it.
    """
    width, height, descent = text_to_path.get_text_width_height_descent(text, font, ismath)
    return float(width), float(height), float(descent)


class _Renderer(RendererSVG):
    """matplotlib's, which measures each text once."""

    def get_text_width_height_descent(self, s: str, prop: FontProperties, ismath: Any) -> tuple[float, float, float]:
        """What `text_size` returns."""
        return text_size(s, prop.copy(), ismath)


def write_svg(figure: Figure, file: TextIO, metadata: dict[str, str | None]) -> None:
    """Write what `figure.savefig` writes of a figure that needs no layout any more.

    * figure: of matplotlib.
    * file: the SVG file.
    * metadata: as `savefig` takes it.
    """
    width, height = figure.get_size_inches()
    dpi = figure.dpi
    figure.dpi = POINTS
    try:
        shapes = _Renderer(POINTS * width, POINTS * height, file, image_dpi=dpi, metadata=metadata)
        renderer: Any = MixedModeRenderer(figure, width, height, dpi, shapes)  # what is many small shapes becomes a picture
        figure.draw(renderer)
        renderer.finalize()
    finally:
        figure.dpi = dpi
