"""The experiment of chapter 8 at full size: a few demonstrations, no practice, baskets all around,
for several ways to learn.

    dart-skill experiment basket --models default,weighted,thesis --seeds 20

The teacher shows throws within 45 degrees and 1.5 to 2.5 m; baskets are asked for within 60
degrees and 20 % nearer and farther than that.

Figures `map_MODEL_N`: where a model hits after N demonstrations, over azimuth and distance of the
basket, seen from above with the front of the arm upwards. A cell of 15 degrees by about 0.25 m has
the share of its throws that went in, and the median of their landing error; what was demonstrated
is outlined.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Wedge

from dart_skill.common.regions import REGION, Region
from dart_skill.common.words import counted
from dart_skill.experiments.studies.practice import teach
from dart_skill.experiments.studies.throws import along_and_across
from dart_skill.figures import BLACK, GREY, LIGHT, house_style, quantity_colours, save
from dart_skill.session import Session
from dart_skill.skills.learning import configuration, learn_throwing

ASKED = Region(near=0.8 * REGION.near, far=1.2 * REGION.far, side=np.deg2rad(60.0), rim=REGION.rim)
"""Where baskets are put."""
PLACES = ("as shown", "to the side", "beyond")
"""Within the demonstrated angles and distances; at its distances up to 60 degrees; at other
distances.
"""


def basket_task(
    seed: int,
    models: Sequence[str] = ("default",),
    demonstrations: int = 13,
    throws: int = 40,
) -> dict:
    """A task of `run`: one teacher, all models learned from the same demonstrations and tried on
    the same baskets.

    Parameters
    ----------
    models
        Names of configurations.
    throws
        Of each model.

    Raises
    ------
    ValueError
        For a model that does not exist, and for too few demonstrations or throws.
    """
    for name in models:
        configuration(name)
    if demonstrations < 2 or throws < 1:
        raise ValueError(
            f"{demonstrations} demonstrations and {throws} throws: give at least 2 and 1"
        )
    much = {"demonstrations": demonstrations, "throws": throws}
    return {"seed": seed, "models": list(models), **much}


def run(task: dict) -> dict:
    """Teach once; learn and throw with every model.

    Returns
    -------
    dict
        targets (throws, 3) [m]; per model (models, throws): along and across [m], nan without a
        landing that was seen, and whether it went in (in_basket); refused: whether there was no
        plan, or it was stopped; shown (demonstrations, 3): where the demonstrations landed, or
        their baskets.
    """
    seed, session = task["seed"], Session(task["seed"])
    try:
        shown = teach(session, seed, task["demonstrations"])
        targets = ASKED.spread(task["throws"], np.random.default_rng([seed, 7]))
        columns: dict[str, list] = {"along": [], "across": [], "in_basket": [], "refused": []}
        for name in task["models"]:
            skill, rows = learn_throwing(shown, configuration(name)), []
            for target in targets:
                try:
                    outcome = session.throw(skill.plan(target)).outcome
                except ValueError:
                    rows.append((np.nan, np.nan, False, True))
                    continue
                miss = along_and_across(outcome.landing, target)
                rows.append((*miss, bool(outcome.in_basket), False))
            for column, values in zip(columns.values(), zip(*rows, strict=True), strict=True):
                column.append(list(values))
        places = [one.target.tolist() for one in shown]
        return {"task": task, "targets": targets.tolist(), **columns, "shown": places}
    finally:
        session.close()


def place_of(targets: np.ndarray) -> np.ndarray:
    """Index (n,) into PLACES of targets (n, 3)."""
    distance, azimuth = polar(targets)
    beyond = (distance < REGION.near) | (distance > REGION.far)
    return np.where(beyond, 2, np.where(np.abs(azimuth) > REGION.side, 1, 0))


def polar(targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances (n,) [m] and azimuths (n,) [rad] of targets (n, 3)."""
    x, y = targets[:, 0], targets[:, 1]
    return np.hypot(x, y), np.arctan2(y, x)


class ModelThrows(NamedTuple):
    """All throws of a model: targets (n, 3), landing error (n,) [m], in_basket (n,), refused
    (n,).
    """

    targets: np.ndarray
    error: np.ndarray
    in_basket: np.ndarray
    refused: np.ndarray

    @property
    def seen(self) -> np.ndarray:
        """Errors (m,) [m] of the throws whose landing was seen."""
        return self.error[np.isfinite(self.error)]

    def only(self, kept: np.ndarray) -> ModelThrows:
        """Those of a mask (n,)."""
        return ModelThrows(*(part[kept] for part in self))


def runs_of(results: Iterable[dict], model: str, demonstrations: int) -> list[dict]:
    """The runs that have a model after so many demonstrations."""
    return [
        one
        for one in results
        if model in one["task"]["models"] and one["task"]["demonstrations"] == demonstrations
    ]


def throws_of(results: Iterable[dict], model: str, demonstrations: int) -> ModelThrows:
    """Throws of one model after so many demonstrations, over all runs that have them.

    Raises
    ------
    ValueError
        If none has.
    """
    runs = runs_of(results, model, demonstrations)
    if not runs:
        raise ValueError(f"no run has the model '{model}' after {demonstrations} demonstrations")
    along, across, inside, refused = (
        np.concatenate([one[name][one["task"]["models"].index(model)] for one in runs])
        for name in ("along", "across", "in_basket", "refused")
    )
    targets = np.concatenate([one["targets"] for one in runs])
    return ModelThrows(targets, np.hypot(along, across), inside.astype(bool), refused.astype(bool))


def kinds_of(results: Iterable[dict]) -> list[tuple[str, int]]:
    """Every model with each number of demonstrations that it has."""
    tasks = [one["task"] for one in results]
    pairs = [(model, task["demonstrations"]) for task in tasks for model in task["models"]]
    return list(dict.fromkeys(pairs))


def summarise(results: list[dict]) -> list[dict]:
    """One row per model, number of demonstrations and place: throws, in the basket, refused,
    median and 90 % of the error [cm].
    """
    rows = []
    for model, demonstrations in kinds_of(results):
        every = throws_of(results, model, demonstrations)
        for k, place in enumerate(PLACES):
            part = every.only(place_of(every.targets) == k)
            errors: list = [None, None]
            if len(part.seen):
                errors = (100 * np.percentile(part.seen, [50, 90])).round(3).tolist()
            about = {"model": model, "demonstrations": demonstrations, "place": place}
            counts = {"throws": len(part.error), "in": int(part.in_basket.sum())}
            counts["refused"] = int(part.refused.sum())
            rows.append({**about, **counts, "median_cm": errors[0], "p90_cm": errors[1]})
    return rows


def table(results: list[dict]) -> str:
    """The rows of `summarise` as text."""
    lines = [f"{'model':<18}{'shown':>6}" + "".join(f"{place:>44}" for place in PLACES)]
    rows = summarise(results)
    for first in range(0, len(rows), len(PLACES)):
        group = rows[first : first + len(PLACES)]
        cells = "".join(_cell(row).rjust(44) for row in group)
        lines.append(f"{group[0]['model']:<18}{group[0]['demonstrations']:>6}{cells}")
    said = "median, 90 % of the landing error [cm] of those whose landing was seen"
    return "\n".join([*lines, f"in the basket of all; {said}; refused: no plan"])


def _cell(row: dict) -> str:
    if not row["throws"]:
        return "none"
    share = f"{100 * row['in'] / row['throws']:.1f} % of {row['throws']}"
    if row["median_cm"] is not None:
        share += f", {row['median_cm']:.1f}, {row['p90_cm']:.1f}"
    return share + (f", {row['refused']} refused" if row["refused"] else "")


AZIMUTHS = np.linspace(-ASKED.side, ASKED.side, 9)
"""Borders of the cells of a map [rad]; those of what is demonstrated are among them."""
DISTANCES = np.concatenate(
    [
        [ASKED.near],
        np.linspace(REGION.near, REGION.far, 5),
        np.linspace(REGION.far, ASKED.far, 3)[1:],
    ]
)
"""Borders of the cells [m]; those of what is demonstrated are among them."""


def cells_of(throws: ModelThrows) -> np.ndarray:
    """How many throws, share in the basket, and median error [m] in each cell, (3, n_azimuths,
    n_distances). Share and median are nan in a cell without a throw, the median also where no
    landing was seen.
    """
    distance, azimuth = polar(throws.targets)
    column = np.searchsorted(AZIMUTHS[1:-1], azimuth, side="right")
    row = np.searchsorted(DISTANCES[1:-1], distance, side="right")
    cells = np.full((3, len(AZIMUTHS) - 1, len(DISTANCES) - 1), np.nan)
    for i, j in np.ndindex(cells.shape[1:]):
        part = throws.only((column == i) & (row == j))
        cells[0, i, j] = len(part.error)
        cells[1, i, j] = part.in_basket.mean() if len(part.error) else np.nan
        cells[2, i, j] = np.median(part.seen) if len(part.seen) else np.nan
    return cells


def draw_map(
    results: Sequence[dict], model: str, demonstrations: int, folder: str | Path
) -> list[Path]:
    """Write `map_MODEL_N`.

    Returns
    -------
    list[Path]
        The paths.
    """
    throws = throws_of(results, model, demonstrations)
    counts, share, median = cells_of(throws)
    used = runs_of(results, model, demonstrations)
    shown = np.concatenate([one["shown"] for one in used])
    seen, refused = len(throws.seen), throws.refused.sum()
    middle = f"median {100 * np.median(throws.seen):.1f} cm of" if seen else "no median of"
    titles = (
        f"In the basket: {100 * throws.in_basket.mean():.1f} % of {len(throws.error)} throws\n"
        f"({counts.min():.0f} to {counts.max():.0f} a cell)",
        f"Landing error: {middle} {seen} throws;\n{refused} refused,"
        f" {len(throws.error) - seen - refused} whose landing was not seen",
    )
    colours = quantity_colours()
    panels = (
        (100.0 * share, Normalize(0.0, 100.0), colours, "throws in the basket [%]"),
        (100.0 * median, LogNorm(0.5, 50.0), colours.reversed(), "median landing error [cm]"),
    )
    with house_style():
        figure = Figure(figsize=(10.5, 5.0), layout="constrained")
        for axes, title, (values, norm, cmap, label) in zip(
            figure.subplots(1, 2), titles, panels, strict=True
        ):
            shades = ScalarMappable(norm, cmap)
            _draw_cells(axes, counts, median, values, shades)
            axes.plot(-shown[:, 1], shown[:, 0], ".", color=BLACK, markersize=1.4, zorder=3.5)
            axes.set_title(title)
            bar: dict[str, Any] = {"orientation": "horizontal", "aspect": 45, "shrink": 0.8}
            figure.colorbar(shades, ax=axes, label=label, pad=0.02, **bar)
        said = f"{counted(len(used), 'teacher')}, no practice"
        title = f"Model '{model}' after {demonstrations} demonstrations, {said}"
        figure.suptitle(title, x=0.01, ha="left")
        hatched = "dots: never thrown at; lines: all refused, or no landing seen"
        figure.supxlabel(f"outlined: what is demonstrated; {hatched}", fontsize=9.0)
        return save(figure, folder, f"map_{model}_{demonstrations}")


def _draw_cells(
    axes: Axes, counts: np.ndarray, median: np.ndarray, values: np.ndarray, shades: ScalarMappable
) -> None:
    """Wedges with their values; 0 degrees points up, positive azimuths to the left, as the arm
    sees it.
    """
    for i, j in np.ndindex(values.shape):
        look = {"facecolor": "white", "edgecolor": LIGHT, "hatch": "....", "linewidth": 0.4}
        if np.isfinite(median[i, j]):
            look = {"facecolor": shades.to_rgba(values[i, j]), "edgecolor": "white"}
            azimuth, distance = AZIMUTHS[i : i + 2].mean(), DISTANCES[j : j + 2].mean()
            place = distance * np.array([-np.sin(azimuth), np.cos(azimuth)])
            text = f"{values[i, j]:.{int(values[i, j] < 9.95)}f}"
            box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6}
            axes.text(
                place[0],
                place[1],
                text,
                ha="center",
                va="center",
                fontsize=7.0,
                bbox=box,
                zorder=4,
            )
        elif counts[i, j]:
            look = {"facecolor": LIGHT, "edgecolor": GREY, "hatch": "////", "linewidth": 0.4}
        axes.add_patch(_wedge(AZIMUTHS[i : i + 2], DISTANCES[j : j + 2], look))
    outline = {"facecolor": "none", "edgecolor": BLACK, "linewidth": 1.8, "zorder": 3}
    side, far = np.array([-REGION.side, REGION.side]), np.array([REGION.near, REGION.far])
    axes.add_patch(_wedge(side, far, outline))
    reach = ASKED.far * np.sin(ASKED.side) + 0.1
    axes.set(xlim=(-reach, reach), ylim=(-0.15, ASKED.far + 0.1), aspect="equal")
    axes.set(xlabel="to the right of the arm [m]", ylabel="ahead of the arm [m]")
    axes.plot(0.0, 0.0, "s", color=BLACK, markersize=7)


def _wedge(azimuths: np.ndarray, distances: np.ndarray, look: dict) -> Wedge:
    start, stop = 90.0 + np.rad2deg(azimuths)
    return Wedge((0.0, 0.0), distances[1], start, stop, width=np.ptp(distances), **look)
