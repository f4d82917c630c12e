"""Figures `map_MODEL_N` and `curve`: where a model hits, over azimuth and distance of the basket,
and how that grows with demonstrations.

A map is the floor from above, the front of the arm upwards. A cell of 15 degrees by about 0.25 m
has the share of its throws that went in, and the median of their landing error; what was
demonstrated is outlined. Colours and their limits are the same in all maps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Wedge
from matplotlib.patheffects import withStroke

from dart_skill.common.regions import REGION
from dart_skill.experiments.studies.basket import (
    ASKED,
    PLACES,
    BasketRun,
    ModelThrows,
    place_of,
    throws_of,
)
from dart_skill.figures import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LIGHT,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    house_style,
    quantity_colours,
    save,
)

AZIMUTHS = np.linspace(-ASKED.side, ASKED.side, 9)
DISTANCES = np.concatenate(
    [
        [ASKED.near],
        np.linspace(REGION.near, REGION.far, 5),
        np.linspace(REGION.far, ASKED.far, 3)[1:],
    ]
)
"""Borders of the cells [rad, m]; those of what is demonstrated are among them."""
ERROR_LIMITS = (0.5, 50.0)
"""Limits of the colours of the median error [cm]."""
LUMINANCE = (0.2126, 0.7152, 0.0722)
LOOKS = (
    (BLUE, "o"),
    (VERMILION, "s"),
    (GREEN, "D"),
    (ORANGE, "^"),
    (PURPLE, "v"),
    (SKY, "P"),
    (BLACK, "X"),
)


@dataclass(frozen=True)
class Cells:
    """A model's throws by cell, arrays (n_azimuths, n_distances): how many, share in the basket,
    median error [m], how many refused.

    Share and median are nan in a cell without a throw, the median also where no landing was seen.
    """

    throws: np.ndarray
    inside: np.ndarray
    median: np.ndarray
    refused: np.ndarray

    def __post_init__(self) -> None:
        shape = (len(AZIMUTHS) - 1, len(DISTANCES) - 1)
        for name in ("throws", "inside", "median", "refused"):
            if np.shape(getattr(self, name)) != shape:
                raise ValueError(
                    f"{name} of the cells has shape {np.shape(getattr(self, name))}; it must be"
                    f" {shape}"
                )


def cells_of(throws: ModelThrows) -> Cells:
    """Sort throws into cells; one beyond the borders is an error."""
    azimuth, distance = (
        np.arctan2(throws.targets[:, 1], throws.targets[:, 0]),
        np.hypot(throws.targets[:, 0], throws.targets[:, 1]),
    )
    column, row = _cell(azimuth, AZIMUTHS, "azimuth"), _cell(distance, DISTANCES, "distance")
    shape = (len(AZIMUTHS) - 1, len(DISTANCES) - 1)
    counts, refused, inside, median = (
        np.zeros(shape, dtype=int),
        np.zeros(shape, dtype=int),
        np.full(shape, np.nan),
        np.full(shape, np.nan),
    )
    for i, j in np.ndindex(shape):
        part = throws.only((column == i) & (row == j))
        counts[i, j], refused[i, j] = len(part.error), part.refused.sum()
        inside[i, j] = part.in_basket.mean() if len(part.error) else np.nan
        seen = part.error[np.isfinite(part.error)]
        median[i, j] = np.median(seen) if len(seen) else np.nan
    return Cells(counts, inside, median, refused)


def _cell(values: np.ndarray, borders: np.ndarray, what: str) -> np.ndarray:
    index = np.searchsorted(borders, values, side="right") - 1
    index[np.isclose(values, borders[-1])] = len(borders) - 2
    if len(index) and not (0 <= index.min() and index.max() < len(borders) - 1):
        worst = values[(index < 0) | (index >= len(borders) - 1)][0]
        raise ValueError(
            f"a basket with {what} {worst:.3f} lies outside of the map, {borders[0]:.3f} to"
            f" {borders[-1]:.3f}"
        )
    return index


def draw_basket(results: Sequence[BasketRun], folder: str | Path) -> list[Path]:
    """A map of every model and number of demonstrations, and the curve over these numbers if there
    are several.

    Returns
    -------
    list[Path]
        The paths.
    """
    kinds = list(
        dict.fromkeys(
            (model, one.task.demonstrations) for one in results for model in one.task.models
        )
    )
    paths = [
        path
        for model, demonstrations in kinds
        for path in draw_map(results, model, demonstrations, folder)
    ]
    return paths + (
        draw_curve(results, folder)
        if len({demonstrations for _, demonstrations in kinds}) > 1
        else []
    )


def draw_map(
    results: Sequence[BasketRun], model: str, demonstrations: int, folder: str | Path
) -> list[Path]:
    """Write `map_MODEL_N`.

    Returns
    -------
    list[Path]
        The paths.
    """
    throws = throws_of(list(results), model, demonstrations)
    cells = cells_of(throws)
    used = [
        one
        for one in results
        if model in one.task.models and one.task.demonstrations == demonstrations
    ]
    shown = np.concatenate([one.shown for one in used])
    with house_style():
        figure = Figure(figsize=(10.5, 5.0), layout="constrained")
        share, error = figure.subplots(1, 2)
        bars: dict[str, Any] = {
            "orientation": "horizontal",
            "aspect": 45,
            "shrink": 0.8,
            "pad": 0.02,
        }
        shades = ScalarMappable(Normalize(0.0, 100.0), quantity_colours())
        _draw_cells(share, cells, 100.0 * cells.inside, shades, "share")
        figure.colorbar(shades, ax=share, label="throws in the basket [%]", **bars)
        shades = ScalarMappable(LogNorm(*ERROR_LIMITS), quantity_colours().reversed())
        _draw_cells(error, cells, 100.0 * cells.median, shades, "median")
        bar = figure.colorbar(
            shades, ax=error, label="median landing error [cm]", extend="both", **bars
        )
        bar.set_ticks([0.5, 1, 2, 5, 10, 20, 50], labels=["0.5", "1", "2", "5", "10", "20", "50"])
        for axes in (share, error):
            _draw_region(axes, shown)
        share.set_title(_share_title(throws, cells))
        error.set_title(_error_title(throws))
        runs = f"{len(used)} teacher{'s' if len(used) > 1 else ''}"
        figure.suptitle(
            f"Model '{model}' after {demonstrations} demonstrations, {runs}, no practice",
            x=0.01,
            ha="left",
        )
        figure.legend(handles=_legend(), loc="outside lower center", ncols=4)
        return save(figure, folder, f"map_{model}_{demonstrations}")


def _share_title(throws: ModelThrows, cells: Cells) -> str:
    there = place_of(throws.targets) == 0
    part = throws.only(there)
    shown = (
        f"{100 * part.in_basket.mean():.1f} % of {there.sum()} where demonstrated"
        if there.any()
        else "none where demonstrated"
    )
    per_cell = f"{cells.throws.min()} to {cells.throws.max()} a cell"
    return (
        f"In the basket: {100 * throws.in_basket.mean():.1f} % of {len(throws.error)} throws"
        f" ({per_cell}),\n{shown}"
    )


def _error_title(throws: ModelThrows) -> str:
    seen = np.isfinite(throws.error)
    median = f"median {100 * np.median(throws.error[seen]):.1f} cm" if seen.any() else "no median"
    unseen = len(throws.error) - seen.sum() - throws.refused.sum()
    return (
        f"Landing error: {median} of {seen.sum()} throws;\n{throws.refused.sum()} refused,"
        f" {unseen} whose landing was not seen"
    )


def _draw_cells(
    axes: Axes, cells: Cells, values: np.ndarray, shades: ScalarMappable, gid: str
) -> None:
    """Wedges with their values; 0 degrees points up, positive azimuths to the left, as the arm
    sees it.
    """
    for i, j in np.ndindex(values.shape):
        look = {
            "facecolor": "white",
            "edgecolor": LIGHT,
            "hatch": "....",
            "linewidth": 0.4,
            "gid": f"{gid}_never_{i}_{j}",
        }
        if cells.throws[i, j] and np.isnan(cells.median[i, j]):
            look = {
                "facecolor": LIGHT,
                "edgecolor": GREY,
                "hatch": "////",
                "linewidth": 0.4,
                "gid": f"{gid}_refused_{i}_{j}",
            }
        elif cells.throws[i, j]:
            look = {
                "facecolor": shades.to_rgba(values[i, j]),
                "edgecolor": "white",
                "linewidth": 0.6,
                "gid": f"{gid}_cell_{i}_{j}",
            }
        axes.add_patch(_wedge(AZIMUTHS[i : i + 2], DISTANCES[j : j + 2], **look))
        if np.isfinite(cells.median[i, j]):
            form = "{:.1f}" if gid == "median" and values[i, j] < 9.95 else "{:.0f}"
            place = DISTANCES[j : j + 2].mean() * _direction(AZIMUTHS[i : i + 2].mean())
            _write(axes, place, form.format(values[i, j]), shades.to_rgba(values[i, j]))
    reach = ASKED.far * np.sin(ASKED.side) + 0.1
    axes.set(
        xlim=(-reach, reach),
        ylim=(-0.15, ASKED.far + 0.1),
        aspect="equal",
        xlabel="to the right of the arm [m]",
    )
    axes.set_ylabel("ahead of the arm [m]")
    axes.plot(0.0, 0.0, "s", color=BLACK, markersize=7)


def _write(axes: Axes, place: np.ndarray, text: str, ground: np.ndarray | tuple) -> None:
    """A number on a coloured ground, which covers dots next to it."""
    colour = "white" if np.dot(ground[:3], LUMINANCE) < 0.5 else BLACK
    look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 7.0, "zorder": 4}
    axes.text(
        place[0],
        place[1],
        text,
        color=colour,
        path_effects=[withStroke(linewidth=2.0, foreground=ground)],
        **look,
    )


def _wedge(azimuths: np.ndarray, distances: np.ndarray, **look: Any) -> Wedge:
    start, stop = 90.0 + np.rad2deg(azimuths)
    return Wedge((0.0, 0.0), distances[1], start, stop, width=distances[1] - distances[0], **look)


def _direction(azimuth: float) -> np.ndarray:
    """Direction of an azimuth in the map (2,): to the right, ahead."""
    return np.array([-np.sin(azimuth), np.cos(azimuth)])


def _draw_region(axes: Axes, shown: np.ndarray) -> None:
    """Outline of what is demonstrated, and the demonstrations (n, 3) themselves."""
    outline = {"facecolor": "none", "edgecolor": BLACK, "linewidth": 1.8, "zorder": 3}
    axes.add_patch(
        _wedge(
            np.array([-REGION.side, REGION.side]), np.array([REGION.near, REGION.far]), **outline
        )
    )
    axes.plot(
        -shown[:, 1],
        shown[:, 0],
        "o",
        linestyle="none",
        color=BLACK,
        markersize=1.4,
        markeredgewidth=0.0,
        zorder=3.5,
    )


def _legend() -> list:
    return [
        Patch(facecolor="none", edgecolor=BLACK, linewidth=1.8, label="demonstrated region"),
        Line2D(
            [],
            [],
            linestyle="none",
            marker="o",
            markersize=2.0,
            color=BLACK,
            label="demonstrated basket",
        ),
        Patch(
            facecolor=LIGHT, edgecolor=GREY, hatch="////", label="all refused, or no landing seen"
        ),
        Patch(facecolor="white", edgecolor=LIGHT, hatch="....", label="never thrown at"),
    ]


def draw_curve(results: Sequence[BasketRun], folder: str | Path) -> list[Path]:
    """Write `curve`: success and median error against the number of demonstrations, per model and
    place.

    Returns
    -------
    list[Path]
        The paths.
    """
    models = list(dict.fromkeys(model for one in results for model in one.task.models))
    numbers = sorted({one.task.demonstrations for one in results})
    with house_style():
        figure = Figure(figsize=(10.5, 6.2), layout="constrained")
        panels = figure.subplots(2, len(PLACES), sharex=True, sharey="row")
        for k, (share, error) in enumerate(panels.T):
            for m, model in enumerate(models):
                points = [
                    (n, _part(results, model, n, k)) for n in numbers if _has(results, model, n)
                ]
                _draw_model(share, error, points, m, len(models), model)
            share.set_title(_place_title(k))
            error.set(xscale="log", yscale="log", xlabel="demonstrations")
            error.set_xticks(numbers, labels=[str(n) for n in numbers])
            error.minorticks_off()
            share.axhline(100.0, color=LIGHT, linewidth=0.8, zorder=0)
        panels[0, 0].set(ylabel="in the basket [%]\n95 % interval", ylim=(-3.0, 103.0))
        limits = panels[1, 0].get_ylim()
        panels[1, 0].set_yticks(
            [0.5, 1, 2, 5, 10, 20, 50, 100], labels=["0.5", "1", "2", "5", "10", "20", "50", "100"]
        )
        panels[1, 0].set(ylabel="landing error [cm]\nmedian and quartiles", ylim=limits)
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 7))
        return save(figure, folder, "curve")


def _has(results: Sequence[BasketRun], model: str, demonstrations: int) -> bool:
    return any(
        model in one.task.models and one.task.demonstrations == demonstrations for one in results
    )


def _part(
    results: Sequence[BasketRun], model: str, demonstrations: int, place: int
) -> ModelThrows:
    throws = throws_of(list(results), model, demonstrations)
    return throws.only(place_of(throws.targets) == place)


def _place_title(place: int) -> str:
    side, far = np.rad2deg(REGION.side), np.rad2deg(ASKED.side)
    where = (
        f"within ±{side:.0f}°, {REGION.near:g} to {REGION.far:g} m",
        f"{side:.0f}° to {far:.0f}°, same distances",
        f"up to {100 * (ASKED.far / REGION.far - 1):.0f} % nearer or farther, ±{far:.0f}°",
    )
    return f"{PLACES[place][0].upper()}{PLACES[place][1:]}: {where[place]}"


def _draw_model(
    share: Axes,
    error: Axes,
    points: list[tuple[int, ModelThrows]],
    number: int,
    of: int,
    name: str,
) -> None:
    """Points of a model, moved a little sideways so that none hides another."""
    points = [(n, throws) for n, throws in points if len(throws.error)]
    (colour, marker), shift = LOOKS[number % len(LOOKS)], 1.02 ** (number - (of - 1) / 2)
    look: dict[str, Any] = {
        "color": colour,
        "marker": marker,
        "markersize": 5.0,
        "linewidth": 1.4,
        "capsize": 2.0,
        "elinewidth": 1.0,
    }
    at = [shift * n for n, _ in points]
    low, middle, high = (
        100.0
        * np.array([wilson(int(one.in_basket.sum()), len(one.error)) for _, one in points])
        .reshape(-1, 3)
        .T
    )
    share.errorbar(at, middle, [middle - low, high - middle], label=name, **look)
    seen = [
        (x, 100.0 * one.error[np.isfinite(one.error)])
        for x, (_, one) in zip(at, points, strict=True)
    ]
    rows = [(x, *np.percentile(errors, [25, 50, 75])) for x, errors in seen if len(errors)]
    x, low, middle, high = np.array(rows).reshape(-1, 4).T
    error.errorbar(x, middle, [middle - low, high - middle], **look)


def wilson(hits: int, n: int, deviations: float = 1.96) -> tuple[float, float, float]:
    """Share of hits with its 95 % interval: lower end, share, upper end (E. Wilson, JASA 22,
    1927); throws count as independent.
    """
    if not 0 <= hits <= n or n == 0:
        raise ValueError(
            f"{hits} hits of {n}: give at least one throw, and no more hits than throws"
        )
    share, z = hits / n, deviations**2 / n
    centre, half = (share + z / 2) / (1 + z), np.sqrt(z * share * (1 - share) + z**2 / 4) / (1 + z)
    return max(0.0, min(share, centre - half)), share, min(1.0, max(share, centre + half))
