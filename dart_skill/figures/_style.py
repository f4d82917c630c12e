"""How all figures look and how they are written: colours of `palette` for kinds, viridis for
quantities, and files without a date.
"""

import io
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse, Rectangle

from dart_skill.common import palette
from dart_skill.common.files import new_file
from dart_skill.common.palette import hexadecimal
from dart_skill.figures._margins import FixedMargins

BLACK, GREY, LIGHT, PALE = map(
    hexadecimal, (palette.BLACK, palette.GREY, palette.LIGHT, palette.PALE)
)
WHITE = "#ffffff"
BLUE, ORANGE, SKY, GREEN, VERMILION, PURPLE = map(
    hexadecimal,
    (palette.BLUE, palette.ORANGE, palette.SKY, palette.GREEN, palette.VERMILION, palette.PURPLE),
)
"""For what has no meaning of its own, such as methods that are compared."""
BASKET, BALL, HAND, PLANNED, ATTRACTOR, DEMONSTRATION, RELEASE, GAUSSIAN, SUCCESS, FAILURE = (
    hexadecimal(getattr(palette, name))
    for name in (
        "BASKET", "BALL", "HAND", "PLANNED", "ATTRACTOR", "DEMONSTRATION", "RELEASE", "GAUSSIAN", "SUCCESS", "FAILURE",
    )
)  # fmt: skip
"""For things, as `palette` explains them."""
PNG_DPI = 150
"""Resolution of pictures without vectors [dots per inch]."""
NARROW = 4.6
"""Width of a figure on a telephone [inches]: its letters are as large there as those of the text.
"""
FEW_LEVELS = 48
"""Colours of a scale in a figure that may be shown in dark mode."""
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

_in_force = False
"""Whether the settings are in force already: to set them takes as long as a few panels."""


@contextmanager
def house_style() -> Iterator[None]:
    """The settings of this module instead of the user's, for as long as the block runs. A block
    within one changes nothing.
    """
    global _in_force
    if _in_force:
        yield
        return
    with matplotlib.style.context(["default", LOOK]):
        _in_force = True
        try:
            yield
        finally:
            _in_force = False


def quantity_colours(levels: int = 256) -> LinearSegmentedColormap:
    """Viridis without its lightest end, which is hard to see on white.

    Parameters
    ----------
    levels
        How many colours there are. Of `FEW_LEVELS` a colour bar is drawn as lines, so that a page
        can change each colour in dark mode; of more it is an image.
    """
    shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, 256))
    return LinearSegmentedColormap.from_list("quantity", shades, N=levels)


def panels(
    sizes: Sequence[tuple[float, float]], narrow: bool = False, **shared: Any
) -> tuple[Figure, list[Axes]]:
    """A figure and its panels, each of a size (width, height) [inches]: side by side, or, for a
    narrow screen, one below the other.

    Parameters
    ----------
    shared
        What `subplots` of matplotlib takes.
    """
    widths, heights = zip(*sizes, strict=True)
    if narrow:
        if len(sizes) > 1:
            heights = tuple(height * min(1.0, NARROW / width) for width, height in sizes)
        figure = Figure(figsize=(NARROW, sum(heights) + 0.6), layout=FixedMargins(len(sizes), 1))
        axes = figure.subplots(len(sizes), 1, squeeze=False, height_ratios=heights)
    else:
        figure = Figure(figsize=(sum(widths), max(heights)), layout=FixedMargins(1, len(sizes)))
        axes = figure.subplots(1, len(sizes), squeeze=False, width_ratios=widths, **shared)
    return figure, list(axes.ravel())


def legend_below(
    figure: Figure,
    handles: Sequence[Any],
    labels: Sequence[str],
    columns: int,
    narrow: bool = False,
) -> None:
    """One legend of all panels; in two columns below a narrow figure.

    Parameters
    ----------
    handles, labels
        Of its entries, as matplotlib has them.
    """
    columns, layout = min(2, columns) if narrow else columns, figure.get_layout_engine()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)
    if isinstance(layout, FixedMargins):
        layout.legend_rows = -(-len(labels) // columns)


def colour_bar(figure: Figure, shades: ScalarMappable, label: str, narrow: bool) -> None:
    """One colour bar for all panels of a figure: to the right of them, or, for a narrow screen,
    above them.

    Parameters
    ----------
    figure
        Of `panels`.
    shades
        Its colours.
    label
        What they stand for.
    """
    layout = figure.get_layout_engine()
    assert isinstance(layout, FixedMargins)  # as `panels` makes it
    layout.bar = figure.add_axes((0.0, 0.0, 0.1, 0.1))
    how: dict[str, Any] = {"orientation": "vertical", "ticklocation": "right"}
    if narrow:
        how = {"orientation": "horizontal", "ticklocation": "top"}
    bar = figure.colorbar(shades, cax=layout.bar, label=label, **how)
    close_gaps(bar)


def close_gaps(bar: Colorbar) -> None:
    """Let the levels of a colour bar touch: a browser would show the ground between them."""
    assert bar.solids is not None  # it is filled
    bar.solids.set_edgecolor("face")


def save(figure: Figure, folder: str | Path, name: str, drawn: str = "") -> list[Path]:
    """Write `name`.svg and `name`.png into a folder, which is made if need be.

    Parameters
    ----------
    figure
        Of matplotlib.
    drawn
        What `svg_text` made of it; by default it is drawn here.

    Returns
    -------
    list[pathlib.Path]
        Their paths.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    svg, png = folder / f"{name}.svg", folder / f"{name}.png"
    _settle(figure)
    with new_file(svg, replace=True) as file:
        file.write((drawn or svg_text(figure)).encode())
    with new_file(png, replace=True) as file:
        figure.savefig(file, format="png", dpi=PNG_DPI, metadata={"Software": None})
    return [svg, png]


def _settle(figure: Figure) -> None:
    """Lay a figure out once and for all: the solver of the layout differs in the last bit from run
    to run, and names of parts with it.
    """
    engine = figure.get_layout_engine()
    if engine is None:
        return
    engine.execute(figure)
    if not isinstance(engine, FixedMargins) and any(
        axes.get_aspect() != "auto" for axes in figure.axes
    ):
        engine.execute(figure)  # for their titles one pass may not find room
    # in fractions of the figure, to less than a pixel
    bounds = [np.round(axes.get_position(original=True).bounds, 5) for axes in figure.axes]
    # "none" would leave a placeholder, for which every file is drawn twice
    figure.set_layout_engine(None)
    for axes, position in zip(figure.axes, bounds, strict=True):
        axes.set_position(position)
        if axes.get_aspect() != "auto":
            axes.set_adjustable("box")  # limits follow the box to half a percent only


def svg_text(figure: Figure) -> str:
    """A figure as the text of an SVG file, the same for the same figure."""
    with house_style(), io.StringIO() as text:
        _settle(figure)
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": "dart_skill"})
        return text.getvalue()


def basket_from_above(
    axes: Axes, centre: np.ndarray | Sequence[float], radius: float, **look: Any
) -> Circle:
    """The free opening of a basket to scale, seen from above; centre (>= 2,) and radius in the
    units of the axes.

    Parameters
    ----------
    look
        Of the circle, as matplotlib's patches take it.
    """
    x, y = float(centre[0]), float(centre[1])
    circle = Circle((x, y), radius, **look)
    axes.add_artist(circle)  # `add_patch` takes long to find out how large a circle is
    axes.update_datalim([(x - radius, y - radius), (x + radius, y + radius)])
    return circle


def basket_from_the_side(
    axes: Axes, along: float, rim: float, radius: float, depth: float
) -> None:
    """A basket to scale, seen from the side: walls, floor and a thick rim."""
    left, right, floor = along - radius, along + radius, rim - depth
    look: dict[str, Any] = {"facecolor": BASKET, "alpha": 0.15, "edgecolor": "none"}
    axes.add_patch(Rectangle((left, floor), 2 * radius, depth, **look))
    walls = ([left, left, right, right], [rim, floor, floor, rim])
    axes.plot(*walls, color=BASKET, linewidth=1.2, gid="basket")
    axes.plot([left, right], [rim, rim], color=BASKET, linewidth=2.2, label="basket")


def gaussian_ellipse(
    mean: np.ndarray, covariance: np.ndarray, deviations: float, **look: Any
) -> Ellipse:
    """Contour of a planar Gaussian, mean (2,) and covariance (2, 2), at so many standard
    deviations.

    Parameters
    ----------
    look
        Of the ellipse, as matplotlib's patches take it.
    """
    (width, height), angle = ellipse_axes(covariance, deviations)
    return Ellipse((mean[0], mean[1]), width, height, angle=float(angle), **look)


def add_gaussians(
    axes: Axes,
    means: Iterable[np.ndarray],
    covariances: Iterable[np.ndarray],
    deviations: float,
    **look: Any,
) -> list[Ellipse]:
    """Draw the contours of planar Gaussians, means (K, 2) and covariances (K, 2, 2).

    Parameters
    ----------
    deviations, look
        As of `gaussian_ellipse`.
    """
    ellipses = [
        gaussian_ellipse(mean, covariance, deviations, **look)
        for mean, covariance in zip(means, covariances, strict=True)
    ]
    for ellipse in ellipses:
        axes.add_patch(ellipse)
    return ellipses


def ellipse_axes(covariance: np.ndarray, deviations: float) -> tuple[np.ndarray, np.ndarray]:
    """Diameters (..., 2) of the contours of planar Gaussians along their axes, and the angles
    (...,) [degrees] of the first of these.

    Parameters
    ----------
    covariance
        (..., 2, 2).
    deviations
        How many standard deviations away the contours are.
    """
    values, vectors = np.linalg.eigh(covariance)
    return 2.0 * deviations * np.sqrt(np.maximum(values, 0.0)), np.degrees(
        np.arctan2(vectors[..., 1, 0], vectors[..., 0, 0])
    )


def unit_along(azimuth: float) -> np.ndarray:
    """Horizontal direction (2,) of an azimuth [rad]."""
    return np.array([np.cos(azimuth), np.sin(azimuth)])


def letter_panels(*panels: Axes) -> None:
    """(a), (b), ... before the titles of panels, in the order in which they are read."""
    for letter, axes in zip("abcdefghijkl", panels, strict=False):
        axes.set_title(f"({letter}) {axes.get_title(loc='left')}", loc="left")


def zoomed_inset(
    axes: Axes, half_width: float, bounds: tuple[float, float, float, float], unit: str = "cm"
) -> Axes:
    """A square about the middle of `axes`, so many units to either side, drawn larger in a corner
    of it; where hits are a blob.

    Parameters
    ----------
    bounds
        Of the inset in fractions of the axes: left, bottom, width, height. The caller draws into
        it what it drew into the axes.
    half_width
        Half the side of the square, in units of the axes.
    """
    inset = axes.inset_axes(bounds, xlim=(-half_width, half_width), ylim=(-half_width, half_width))
    inset.set(aspect="equal", facecolor="white", xticks=[], yticks=[])
    for spine in inset.spines.values():
        spine.set(visible=True, color=GREY)
    axes.indicate_inset_zoom(inset, edgecolor=GREY)
    inset.set_title(
        f"the middle, \N{PLUS-MINUS SIGN}{half_width:g} {unit}",
        fontsize=8.5,
        color=GREY,
        loc="center",
    )
    return inset
