"""Figure 8.6: 13 demonstrations with gripper frames and targets, and the throw at a basket that
was not demonstrated. The thesis draws what its global model (two frames, three components) makes
of a new target, and says that it is as smooth as the demonstrations. Here the same stands beside
what `default` makes of it, with where each plan itself expects the ball to come down.

Figure 8.7: alpha and beta of the demonstrations in the thesis's two frames, and in axes that turn
with the target. The thesis blames beta, which "was not consistent to fit a GMM in different frame
of reference" (8.4.4). As long as the hand points backwards, which it does beyond the release, its
beta in world axes has the sign opposite to the target's azimuth. Frame 2 takes the beta of the
direction to the target off it, which doubles what differs from throw to throw instead of removing
it. In axes that turn with the target, beta is small throughout.

Figure 8.8: the three demonstrated baskets that are nearest to a new one (8.4.2), and the weights
of chapter 9's alternative. Local regression can only interpolate: the second thing that is
measured is how often a new basket lies between its three neighbours.

Figure 8.9: the three demonstrations chosen for local regression, and the throw that is generated
from them at a new basket.

Figure 8.10: alpha and beta of these three, in both frames. The thesis calls them consistent: their
targets differ little in azimuth, so that it does not matter what the frames make of it.

Figure 8.11: speed of the hand before and after synchronisation by velocity thresholds (8.4.3),
for all demonstrations. The thesis shows one; what synchronisation is for is seen only when there
are several. Before: each recording on its own clock, with the teacher's pause in it. After: cut
between the thresholds, and set to the release of the ball, which is what this package does.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from dart_skill.common.regions import REGION
from dart_skill.experiments.thesis import ball_throws
from dart_skill.experiments.thesis.ball_throws import FRAMES, Angles, DrawnThrow
from dart_skill.figures import (
    BALL,
    BASKET,
    BLACK,
    DEMONSTRATION,
    GREEN,
    HAND,
    PURPLE,
    RIM_RADIUS,
    SKY,
    basket_from_above,
    demonstrated_motions,
    legend_below,
    letter_panels,
    quantity_colours,
    synchronisation_figure,
    unit_along,
)
from dart_skill.movement import gaussian_weights, nearest_weights, rotate
from dart_skill.skills.learning import configuration

TRIAD = 0.09
"""Length of the axes of a gripper frame [m]."""
TRIAD_COLOURS = (PURPLE, GREEN, SKY)
"""Colours of its axes x, y, z."""
N_NEAREST = configuration("thesis_local").nearest
"""Number of demonstrations that local regression learns from."""


def draw_8_6(seed: int = 0) -> tuple[Figure, dict]:
    """Measured: where plans for new baskets expect the ball, and how rough they are beside the
    demonstrations.
    """
    titles = {"thesis": "Global model of the thesis", "default": "Default of this package"}
    shown, basket = ball_throws.all_demonstrated(seed, "thesis"), ball_throws.new_baskets(seed)[0]
    plans = {name: ball_throws.skill(seed, name).plan(basket) for name in titles}
    made = {name: ball_throws.planned(plan) for name, plan in plans.items()}
    figure = Figure(figsize=(10.5, 6.6), layout="constrained")
    panels = _panels(figure, 1 + len(titles))
    _draw_throws(panels[:, 0], shown, f"Demonstrations, n = {len(shown)}")
    for column, (name, plan) in zip(panels.T[1:], plans.items(), strict=True):
        miss = f"expected to miss it by {ball_throws.miss_of(plan):.1f} cm"
        _draw_throws(column, [made[name]], f"{titles[name]}, new target:\n{miss}", new=True)
    letter_panels(*panels[0])
    _draw_legend(figure, 5)
    speeds = [one.speed for one in shown]
    return figure, {
        "demonstrations": len(shown),
        "thesis_says": (
            "the reproduced trajectory has the smoothness properties similar to the demonstrations"
        ),
        "speed_at_release_m_s": {
            "demonstrated": [round(min(speeds), 2), round(max(speeds), 2)],
            **{name: round(one.speed, 2) for name, one in made.items()},
        },
        "jerk_rms_m_s3": {
            "demonstrated": round(float(np.median([one.jerk for one in shown]))),
            **{name: round(one.jerk) for name, one in made.items()},
        },
        "expected_miss_median_cm": ball_throws.median_misses(seed, tuple(titles)),
    }


def draw_8_9(seed: int = 0) -> tuple[Figure, dict]:
    """Measured: the generated throw, and where plans for ten new baskets expect the ball, local
    model and global ones.
    """
    _, basket, chosen = nearest_baskets(seed)
    shown = [ball_throws.all_demonstrated(seed, "thesis")[k] for k in chosen]
    plan = ball_throws.skill(seed, "thesis_local").plan(basket)
    made, miss = ball_throws.planned(plan), ball_throws.miss_of(plan)
    speeds = [one.speed for one in shown]
    figure = Figure(figsize=(8.2, 7.1), layout="constrained")
    panels = _panels(figure, 2)
    said = f"{min(speeds):.2f} to {max(speeds):.2f} m/s at the release"
    title = f"Chosen for local regression, n = {len(shown)}:\n{said}"
    _draw_throws(panels[:, 0], shown, title)
    said = f"expected to miss the new target by {miss:.1f} cm"
    title = f"Generated, {made.speed:.2f} m/s at the release:\n{said}"
    _draw_throws(panels[:, 1], [made], title, new=True)
    _draw_legend(figure, 4)
    return figure, {
        "thesis_says": "producing accurate results in the close vicinity of the selected points",
        "speed_at_release_m_s": {
            "chosen": [round(speed, 2) for speed in speeds],
            "generated": round(made.speed, 2),
        },
        "expected_miss_cm": round(miss, 1),
        "expected_miss_median_cm": ball_throws.median_misses(
            seed, ("thesis_local", "thesis", "default")
        ),
        "new_baskets": ball_throws.N_NEW,
    }


def _panels(figure: Figure, n_columns: int) -> np.ndarray:
    """Axes (2, n): the view from above over the one from the side, to one scale."""
    panels = figure.subplots(2, n_columns, height_ratios=[3.2, 2.2], sharey="row", squeeze=False)
    for above, side in panels.T:
        look: dict[str, Any] = {"aspect": "equal", "xlim": (-1.1, 2.75)}
        above.set(ylim=(-1.6, 1.6), xlabel="x, front of the arm [m]", **look)
        side.set(ylim=(0.25, 2.45), xlabel="forward, in the plane of the throw [m]", **look)
    panels[0, 0].set_ylabel("y [m]")
    panels[1, 0].set_ylabel("height [m]")
    return panels


def _draw_throws(
    column: np.ndarray, throws: list[DrawnThrow], title: str, new: bool = False
) -> None:
    """Throws from above and from the side in a column (2,) of panels.

    Parameters
    ----------
    new
        At a target that was not demonstrated.
    """
    colours = (HAND, BASKET) if new else (DEMONSTRATION, DEMONSTRATION)
    every = 0.1 if len(throws) < 5 else 0.24
    for one in throws:
        forward = unit_along(float(np.arctan2(one.target[1], one.target[0])))
        views = (np.eye(3)[:2], np.array([[*forward, 0.0], [0.0, 0.0, 1.0]]))
        for axes, view in zip(column, views, strict=True):
            _draw_throw(axes, one, view, colours, every)
        look = {"facecolor": "none", "edgecolor": colours[1], "linewidth": 0.6, "alpha": 0.7}
        basket_from_above(column[0], one.target, RIM_RADIUS, **look)
    column[0].plot(0.0, 0.0, "s", color=BLACK, markersize=6)
    column[0].set_title(title)


def _draw_throw(
    axes: Axes, one: DrawnThrow, view: np.ndarray, colours: tuple[str, str], every: float
) -> None:
    """Hand, its frame `every` so many seconds, ball and basket, in the plane that a view (2, 3)
    projects to.
    """
    axes.plot(*view @ one.flight.T, color=BALL, linewidth=0.7, alpha=0.7, zorder=1)
    axes.plot(*view @ one.position.T, color=colours[0], linewidth=1.1, zorder=2)
    k = np.searchsorted(one.time, np.arange(one.time[0], one.time[-1], every))
    for unit, shade in zip(np.eye(3), TRIAD_COLOURS, strict=True):
        ends = one.position[k] + TRIAD * rotate(one.quaternion[k], unit[None])
        gaps = np.full_like(ends, np.nan)  # between strokes that are drawn as one line
        strokes = np.stack([one.position[k], ends, gaps], axis=1).reshape(-1, 3)
        axes.plot(*view @ strokes.T, color=shade, linewidth=0.9, zorder=3)
    axes.plot(*view @ one.target, "o", color=colours[1], markersize=4.5, zorder=4)


def _draw_legend(figure: Figure, n_columns: int) -> None:
    lines = [("hand, demonstrated", DEMONSTRATION, 1.4), ("hand, planned", HAND, 1.4)]
    lines += [("ball", BALL, 1.0)]
    axes = zip("xyz", TRIAD_COLOURS, strict=True)
    lines += [(f"gripper's {name}", colour, 1.5) for name, colour in axes]
    entries = [Line2D([], [], color=c, linewidth=width, label=name) for name, c, width in lines]
    dot: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 4.5}
    for name, colour in (("demonstrated", DEMONSTRATION), ("new", BASKET)):
        entries.append(Line2D([], [], color=colour, label=f"basket, {name}", **dot))
    entries.append(Line2D([], [], color=BLACK, linestyle="none", marker="s", label="arm"))
    figure.legend(handles=entries, loc="outside lower center", ncols=n_columns)


def draw_8_7(seed: int = 0) -> tuple[Figure, dict]:
    """Measured: spreads of the angles in each frame."""
    seen = {frame: ball_throws.angles_in(seed, frame) for frame in FRAMES}
    figure = _angles_figure(seen, "Demonstrations", 10.5)
    said = "the data of beta was not consistent to fit a GMM in different frame of reference"
    return figure, {
        "thesis_says": said,
        **{frame: spreads(angles) for frame, angles in seen.items()},
    }


def draw_8_10(seed: int = 0) -> tuple[Figure, dict]:
    """Measured: spreads of the angles in both frames, of those that were chosen and of all."""
    chosen = nearest_baskets(seed)[2]
    frames = ("frame_1", "frame_2")
    seen = {frame: ball_throws.angles_in(seed, frame, chosen) for frame in frames}
    every = {frame: ball_throws.angles_in(seed, frame) for frame in frames}
    figure = _angles_figure(seen, "Chosen demonstrations", 8.6)
    said = "the orientation data is consistent in selected trajectories for fitting a GMM"
    return figure, {
        "thesis_says": said,
        **{
            frame: {"chosen": spreads(seen[frame]), "all": spreads(every[frame])}
            for frame in frames
        },
    }


def spreads(angles: Angles) -> dict:
    """Standard deviations from throw to throw, of the whole motion (rms over time) and at the
    release [degrees].
    """
    return {
        name: {
            "alpha_deg": round(float(np.rad2deg(pair[0])), 1),
            "beta_deg": round(float(np.rad2deg(pair[1])), 1),
        }
        for name, pair in (
            ("spread", angles.spread),
            ("spread_at_release", angles.spread_at_release),
        )
    }


def _angles_figure(seen: dict[str, Angles], which: str, width: float) -> Figure:
    """alpha over beta, a column for each frame, coloured by the azimuth of the target, with the
    mean and the spread over the throws.
    """
    figure = Figure(figsize=(width, 5.6), layout="constrained")
    side = np.rad2deg(REGION.side)
    shades = ScalarMappable(Normalize(-side, side), quantity_colours())
    panels = figure.subplots(2, len(seen), sharex=True, sharey="row", squeeze=False)
    for column, (frame, angles) in zip(panels.T, seen.items(), strict=True):
        for k, axes in enumerate(column):
            _draw_angle(axes, angles, k, shades)
        column[0].set_title(FRAMES[frame][0].upper() + FRAMES[frame][1:], pad=20)
        column[1].set_xlabel("time since the motion began [s]")
    panels[0, 0].set_ylabel("alpha [°]")
    panels[1, 0].set_ylabel("beta [°]")
    figure.colorbar(shades, ax=panels, label="azimuth of the target [°]", aspect=40, pad=0.02)
    n = len(next(iter(seen.values())).releases)
    title = f"{which}, n = {n}; band: mean ± s.d.; diamond: release"
    figure.suptitle(title, x=0.01, ha="left")
    return figure


def _draw_angle(axes: Axes, angles: Angles, k: int, shades: ScalarMappable) -> None:
    values = np.rad2deg(angles.values[:, :, k])
    mean, deviation = values.mean(axis=0), values.std(axis=0)
    band: dict[str, Any] = {"color": SKY, "alpha": 0.3, "linewidth": 0}
    axes.fill_between(angles.time, mean - deviation, mean + deviation, **band)
    for one, azimuth, release in zip(values, angles.azimuths, angles.releases, strict=True):
        colour = shades.to_rgba(np.rad2deg(azimuth))
        axes.plot(angles.time, one, color=colour, linewidth=1.1)
        at_release = np.interp(release, angles.time, one)
        diamond: dict[str, Any] = {"markeredgecolor": BLACK, "markeredgewidth": 0.5}
        axes.plot(release, at_release, "D", color=colour, markersize=4, **diamond)
    spread, at_release = (
        np.rad2deg(value[k]) for value in (angles.spread, angles.spread_at_release)
    )
    said = f"{('alpha', 'beta')[k]}: s.d. {spread:.1f}°, at the release {at_release:.1f}°"
    look: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points"}
    axes.annotate(said, (0.02, 1.0), xytext=(0, 2), va="bottom", fontsize=8.5, **look)


def nearest_baskets(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Demonstrated baskets (n, 3), a new one (3,), indices of the nearest (3,), nearest first."""
    shown = np.array([one.demonstration.target for one in ball_throws.lessons(seed)])
    new = ball_throws.new_baskets(seed)[0]
    chosen = np.flatnonzero(nearest_weights(shown[:, :2], new[:2], N_NEAREST))
    return shown, new, chosen[np.argsort(_distances(shown[chosen], new))]


def draw_8_8(seed: int = 0) -> tuple[Figure, dict]:
    """Measured: distances of the chosen ones, and how often a basket anywhere in the region lies
    between its three nearest.
    """
    shown, new, chosen = nearest_baskets(seed)
    away, width = _distances(shown[chosen], new), configuration("weighted").width
    figure = Figure(figsize=(9.8, 6.0), layout="constrained")
    nearest, weighted = figure.subplots(1, 2, sharey=True)
    for axes in (nearest, weighted):
        _draw_baskets(axes, shown, new)
    for centre in shown[chosen]:
        look = {"facecolor": "none", "edgecolor": BLACK, "linewidth": 1.8}
        circle = basket_from_above(nearest, centre, 1.35 * RIM_RADIUS, **look)
        nearest.plot(*np.stack([new, centre])[:, :2].T, color=BLACK, linewidth=0.8)
    circle.set_label("chosen to learn from")
    first, last = ", ".join(f"{value:.2f}" for value in away[:-1]), f"{away[-1]:.2f}"
    said = f"the {N_NEAREST} nearest of {len(shown)},\n{first} and {last} m away"
    nearest.set_title(f"Local regression (8.4.2): {said}")
    distances = np.hypot(shown[:, 0], shown[:, 1])[:, None]
    weights = gaussian_weights(distances, np.hypot(*new[:2])[None], width)
    for centre, weight in zip(shown, weights, strict=True):
        look = {"facecolor": DEMONSTRATION, "edgecolor": "none", "zorder": 0.5}
        circle = basket_from_above(weighted, centre, RIM_RADIUS, alpha=0.6 * weight, **look)
        weighted.annotate(f"{weight:.2f}", centre[:2], ha="center", va="center", fontsize=7.0)
    circle.set_label("filled by its weight")
    said = f"of width {width:g} m in distance from the base axis"
    weighted.set_title(f"Chapter 9: a Gaussian weight for each of {len(shown)},\n{said}")
    nearest.set_ylabel("y [m]")
    handles, labels = nearest.get_legend_handles_labels()
    letter_panels(nearest, weighted)
    legend_below(figure, [*handles, circle], [*labels, "filled by its weight"], 5)
    places = shown[:, :2]
    asked = REGION.spread(400, np.random.default_rng([seed, 8]))[:, :2]
    between = [inside(places[nearest_weights(places, one, N_NEAREST) > 0.0], one) for one in asked]
    return figure, {
        "new_basket_m": new.round(3).tolist(),
        "chosen_are_away_m": away.round(3).tolist(),
        "new_basket_is_between_them": inside(shown[chosen, :2], new[:2]),
        "share_of_baskets_between_their_nearest": round(float(np.mean(between)), 3),
    }


def inside(corners: np.ndarray, point: np.ndarray) -> bool:
    """Whether a point (2,) lies in the triangle of corners (3, 2)."""
    rows = np.vstack([corners.T, np.ones(3)])
    shares = np.linalg.lstsq(rows, np.append(point, 1.0), rcond=None)[0]
    return bool((shares >= 0.0).all())


def _distances(places: np.ndarray, new: np.ndarray) -> np.ndarray:
    return np.linalg.norm((places - new)[:, :2], axis=1)


def _draw_baskets(axes: Axes, shown: np.ndarray, new: np.ndarray) -> None:
    axes.plot(0.0, 0.0, "s", color=BLACK, markersize=8, label="arm")
    for centre in shown:
        look = {"facecolor": "none", "edgecolor": DEMONSTRATION, "linestyle": "--"}
        circle = basket_from_above(axes, centre, RIM_RADIUS, linewidth=1.2, **look)
    circle.set_label("basket, demonstrated")
    look = {"facecolor": BASKET, "edgecolor": BASKET, "label": "basket, new"}
    basket_from_above(axes, new, RIM_RADIUS, alpha=0.45, **look)
    axes.set(aspect="equal", xlabel="x, front of the arm [m]", xlim=(-0.2, 2.75), ylim=(-1.6, 1.6))


def draw_8_11(seed: int = 0) -> tuple[Figure, dict]:
    taught = ball_throws.lessons(seed)
    recordings = [ball_throws.recording_of(one) for one in taught]
    motions = demonstrated_motions(recordings, [one.demonstration for one in taught])
    starts, releases, stops, ends = np.array(
        [(one.motion_start, one.release, one.motion_stop, one.time[-1]) for one in motions]
    ).T
    recorded, moved = sorted(ends), sorted(stops - starts)
    return synchronisation_figure(motions), {
        "demonstrations": len(motions),
        "release_spread_ms": {
            "as_recorded": _spread_ms(releases),
            "from_the_start_of_the_motion": _spread_ms(releases - starts),
            "from_the_release": 0.0,
        },
        "motion_start_spread_ms": {
            "as_recorded": _spread_ms(starts),
            "from_the_release": _spread_ms(starts - releases),
        },
        "recording_s": [round(float(recorded[k]), 2) for k in (0, -1)],
        "motion_s": [round(float(moved[k]), 2) for k in (0, -1)],
    }


def _spread_ms(times: np.ndarray) -> float:
    return round(1000 * float(times.std(ddof=1)), 1)
