"""How all figures look and how they are written: colours that colour-blind people can tell apart, and files without a date.

Colours: Okabe and Ito, Color Universal Design (2008), for kinds; viridis for quantities.
"""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse, Rectangle

from dart_skill.files import new_file

BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
GREY = "#777777"
LIGHT = "#BBBBBB"
PALE = "#EAF5FC"
PNG_DPI = 150
LOOK = {
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 10.0,
    "figure.titlesize": 11.0,
    "font.family": ["DejaVu Sans"],
    "font.size": 9.5,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "svg.fonttype": "none",
    "svg.hashsalt": "dart_skill",
}


@contextmanager
def house_style() -> Iterator[None]:
    """The settings of this module instead of the user's, for as long as the block runs."""
    with matplotlib.style.context(["default", LOOK]):
        yield


def quantity_colours() -> LinearSegmentedColormap:
    """Viridis without its lightest end, which is hard to see on white."""
    shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, 256))
    return LinearSegmentedColormap.from_list("quantity", shades)


def save(figure: Figure, folder: str | Path, name: str) -> list[Path]:
    """Write `name`.svg and `name`.png into a folder, which is made if need be; returns their paths."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    svg, png = folder / f"{name}.svg", folder / f"{name}.png"
    with new_file(svg, replace=True) as file:
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": "dart_skill"})
    with new_file(png, replace=True) as file:
        figure.savefig(file, format="png", dpi=PNG_DPI, metadata={"Software": None})
    return [svg, png]


def svg_text(figure: Figure) -> str:
    """A figure as the text of an SVG file, the same for the same figure."""
    with house_style(), io.StringIO() as text:
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": "dart_skill"})
        return text.getvalue()


def basket_from_above(axes: Axes, centre: np.ndarray | Sequence[float], radius: float, **look: Any) -> Circle:
    """The free opening of a basket to scale, seen from above; centre (>= 2,) and radius in the units of the axes."""
    circle = Circle((float(centre[0]), float(centre[1])), radius, **look)
    axes.add_patch(circle)
    return circle


def basket_from_the_side(axes: Axes, along: float, rim: float, radius: float, depth: float) -> None:
    """A basket to scale, seen from the side: walls, floor and a thick rim."""
    box = Rectangle((along - radius, rim - depth), 2 * radius, depth, facecolor=ORANGE, alpha=0.15, edgecolor="none")
    axes.add_patch(box)
    walls = ([along - radius] * 2 + [along + radius] * 2, [rim, rim - depth, rim - depth, rim])
    axes.plot(*walls, color=ORANGE, linewidth=1.2, gid="basket")
    axes.plot([along - radius, along + radius], [rim, rim], color=ORANGE, linewidth=2.2, label="basket")


def gaussian_ellipse(mean: np.ndarray, covariance: np.ndarray, deviations: float, **look: Any) -> Ellipse:
    """Contour of a planar Gaussian, mean (2,) and covariance (2, 2), at so many standard deviations."""
    values, vectors = np.linalg.eigh(covariance)
    width, height = 2 * deviations * np.sqrt(np.maximum(values, 0.0))
    angle = float(np.degrees(np.arctan2(vectors[1, 0], vectors[0, 0])))
    return Ellipse((mean[0], mean[1]), width, height, angle=angle, **look)


def unit_along(azimuth: float) -> np.ndarray:
    """Horizontal direction (2,) of an azimuth [rad]."""
    return np.array([np.cos(azimuth), np.sin(azimuth)])
