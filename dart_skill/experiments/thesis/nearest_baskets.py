"""Figure 8.8: the three demonstrated baskets that are nearest to a new one (8.4.2), and the
weights of chapter 9's alternative.

Local regression can only interpolate: the second thing that is measured is how often a new basket
lies between its three neighbours.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.common.regions import REGION
from dart_skill.experiments.thesis import ball_throws
from dart_skill.figures import (
    BASKET,
    BLACK,
    DEMONSTRATION,
    RIM_RADIUS,
    basket_from_above,
    house_style,
    legend_below,
    letter_panels,
    save,
)
from dart_skill.movement import gaussian_weights, nearest_weights
from dart_skill.skills.learning import configuration

TITLE_8_8 = "The demonstrations nearest to a new basket"
N_NEAREST = configuration("thesis_local").nearest
WIDTH = configuration("weighted").width
N_ASKED = 400


def compute_8_8(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Demonstrated baskets (n, 3), a new one (3,), indices of the nearest (3,), nearest first."""
    shown = np.array([one.target for one in ball_throws.lessons(seed).demonstrations])
    new = ball_throws.new_baskets(seed)[0]
    chosen = np.flatnonzero(nearest_weights(shown[:, :2], new[:2], N_NEAREST))
    return shown, new, chosen[np.argsort(_distances(shown[chosen], new))]


def draw_8_8(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    shown, new, chosen = compute_8_8(seed)
    with house_style():
        figure = Figure(figsize=(9.8, 6.0), layout="constrained")
        nearest, weighted = figure.subplots(1, 2, sharey=True)
        _draw_baskets(nearest, shown, new)
        for number, centre in enumerate(shown[chosen], start=1):
            look = {
                "facecolor": "none",
                "edgecolor": BLACK,
                "linewidth": 1.8,
                "label": "chosen to learn from" if number == 1 else None,
            }
            basket_from_above(nearest, centre, 1.35 * RIM_RADIUS, gid=f"chosen_{number}", **look)
            nearest.plot(*np.stack([new, centre])[:, :2].T, color=BLACK, linewidth=0.8)
        away = _listed(_distances(shown[chosen], new))
        nearest.set_title(
            f"Local regression (8.4.2): the {N_NEAREST} nearest of {len(shown)},\n{away} m away"
        )
        _draw_baskets(weighted, shown, new)
        _draw_weights(weighted, shown, new)
        weighted.set_title(
            f"Chapter 9: a Gaussian weight for each of {len(shown)},\nof width {WIDTH:g} m in"
            " distance from the base axis"
        )
        nearest.set_ylabel("y [m]")
        handles, labels = nearest.get_legend_handles_labels()
        more, others = weighted.get_legend_handles_labels()
        letter_panels(nearest, weighted)
        legend_below(figure, [*handles, more[-1]], [*labels, others[-1]], 5)
        return save(figure, folder, "figure_8_8"), measured_8_8(shown, new, chosen, seed)


def measured_8_8(shown: np.ndarray, new: np.ndarray, chosen: np.ndarray, seed: int) -> dict:
    """Distances of the chosen ones, and how often a basket anywhere in the region lies between its
    three nearest.
    """
    asked = REGION.spread(N_ASKED, np.random.default_rng([seed, 8]))[:, :2]
    places = shown[:, :2]
    between = [inside(places[nearest_weights(places, one, N_NEAREST) > 0.0], one) for one in asked]
    return {
        "new_basket_m": new.round(3).tolist(),
        "chosen_are_away_m": _distances(shown[chosen], new).round(3).tolist(),
        "new_basket_is_between_them": inside(shown[chosen, :2], new[:2]),
        "share_of_baskets_between_their_nearest": round(float(np.mean(between)), 3),
    }


def inside(corners: np.ndarray, point: np.ndarray) -> bool:
    """Whether a point (2,) lies in the triangle of corners (3, 2)."""
    shares = np.linalg.lstsq(
        np.vstack([corners.T, np.ones(3)]), np.append(point, 1.0), rcond=None
    )[0]
    return bool((shares >= 0.0).all())


def _distances(places: np.ndarray, new: np.ndarray) -> np.ndarray:
    return np.linalg.norm((places - new)[:, :2], axis=1)


def _listed(values: np.ndarray) -> str:
    first, last = ", ".join(f"{value:.2f}" for value in values[:-1]), f"{values[-1]:.2f}"
    return f"{first} and {last}"


def _draw_baskets(axes: Axes, shown: np.ndarray, new: np.ndarray) -> None:
    axes.plot(0.0, 0.0, "s", color=BLACK, markersize=8, label="arm")
    for number, centre in enumerate(shown, start=1):
        look = {
            "facecolor": "none",
            "edgecolor": DEMONSTRATION,
            "linestyle": "--",
            "linewidth": 1.2,
            "label": "basket, demonstrated" if number == 1 else None,
        }
        basket_from_above(axes, centre, RIM_RADIUS, gid=f"demonstrated_{number}", **look)
    look = {"facecolor": BASKET, "edgecolor": BASKET, "alpha": 0.45, "label": "basket, new"}
    basket_from_above(axes, new, RIM_RADIUS, gid="new", **look)
    axes.set(aspect="equal", xlabel="x, front of the arm [m]", xlim=(-0.2, 2.75), ylim=(-1.6, 1.6))


def _draw_weights(axes: Axes, shown: np.ndarray, new: np.ndarray) -> None:
    """The baskets filled by their weights."""
    distances = np.hypot(shown[:, 0], shown[:, 1])[:, None]
    for number, (centre, weight) in enumerate(
        zip(shown, gaussian_weights(distances, np.hypot(*new[:2])[None], WIDTH), strict=True)
    ):
        basket_from_above(
            axes,
            centre,
            RIM_RADIUS,
            facecolor=DEMONSTRATION,
            edgecolor="none",
            alpha=0.6 * weight,
            zorder=0.5,
            label=None if number else "filled by its weight",
        )
        axes.annotate(f"{weight:.2f}", centre[:2], ha="center", va="center", fontsize=7.0)
