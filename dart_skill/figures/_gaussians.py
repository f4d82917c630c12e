"""Figure `gaussians`: what was learned. Attractors of the demonstrations (7.20) and the mixture's
components (7.21) in two frames.

Two task frames: each shows its own Gaussians. One task frame, at the base and turned to the
target: the other view is that of the target. Where the distance of the target is an input, a
component is a joint Gaussian of distance and position, and what the target sees of it is exact,
for rims of one height: position minus distance is linear in both. Otherwise the components are
those for the median task.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dart_skill.figures._margins import FixedMargins
from dart_skill.figures._style import (
    BLACK,
    DEMONSTRATION,
    FEW_LEVELS,
    NARROW,
    RELEASE,
    colour_bar,
    ellipse_axes,
    house_style,
    legend_below,
    letter_panels,
    quantity_colours,
)
from dart_skill.movement import TaskFrame, azimuth_target_frame
from dart_skill.skills.learning import PreparedThrow, ThrowingSkill, frames_for

DEVIATIONS = 2.0
NAMES = {
    ("base", "target"): (
        "base frame, axes of the world (8.2)",
        "target frame, first axis to the target (8.2), target at 0",
    ),
    ("start", "target"): (
        "frame at the start of the hand, axes of the world (8.3)",
        "target frame, first axis to the target (8.2), target at 0",
    ),
    ("azimuth",): (
        "base frame, turned to the target",
        "the same, seen from the target (target at 0)",
    ),
    ("azimuth", "target"): (
        "base frame, turned to the target",
        "target frame, turned likewise (target at 0)",
    ),
}
WORLD_AXES = ("x", "y", "z")
"""Names of the axes of the world."""
TURNED_AXES = ("forward", "left", "up")
"""Names of the axes of a frame that is turned about the vertical."""
POINTING_AXES = ("towards the target", "left", "upwards across")
"""Names of the axes of a frame whose first axis points to the target."""
AxisNames = tuple[str, str, str]
AXES: dict[tuple[str, ...], tuple[AxisNames, AxisNames]] = {
    ("base", "target"): (WORLD_AXES, POINTING_AXES),
    ("start", "target"): (WORLD_AXES, POINTING_AXES),
}
PLANES = ((0, 2), (0, 1))
"""Pairs of axes that are drawn: from the side and from above."""


@dataclass(frozen=True, eq=False)
class FrameView:
    """Attractors and components as one frame sees them [m].

    Parameters
    ----------
    name
        Of the frame.
    axes
        Names of its three axes.
    attractors
        (n_i, 3) per demonstration.
    releases
        (n, 3), attractor when the ball leaves the hand.
    means, covariances
        (K, 3), (K, 3, 3), of the position in each component.
    times
        (K,), of the components [s].
    """

    name: str
    axes: tuple[str, str, str]
    attractors: tuple[np.ndarray, ...]
    releases: np.ndarray
    means: np.ndarray
    covariances: np.ndarray
    times: np.ndarray


def frame_views(skill: ThrowingSkill) -> tuple[FrameView, FrameView]:
    """The skill's demonstrations and components in two frames."""
    task = median_task(skill)
    model = skill.model_for(task).mixture_
    names, axes = (
        NAMES[skill.configuration.frames],
        AXES.get(skill.configuration.frames, (TURNED_AXES, TURNED_AXES)),
    )
    if model.n_frames == 2:
        gaussians = [(model.means_[frame], model.covariances_[frame]) for frame in range(2)]
    else:
        own = (model.means_[0], model.covariances_[0])
        gaussians = [own, _from_the_target(*own, task, skill.configuration.distance_input)]
    first, second = (
        _view(skill, frame, names[frame], axes[frame], *gaussians[frame]) for frame in range(2)
    )
    return first, second


def median_task(skill: ThrowingSkill) -> np.ndarray:
    """The demonstrated task (3,) of median distance."""
    throws = sorted(skill.throws, key=lambda throw: throw.distance)
    return throws[len(throws) // 2].task


@house_style()
def gaussians_figure(skill: ThrowingSkill, narrow: bool = False) -> Figure:
    """The figure of a skill that has learned.

    Parameters
    ----------
    narrow
        Its panels stand one below the other.
    """
    views = frame_views(skill)
    times = np.concatenate([view.times for view in views])
    shades = ScalarMappable(
        Normalize(times.min() - 1e-6, times.max() + 1e-6), quantity_colours(FEW_LEVELS)
    )
    # Height over width of the rows, as the attractors need it.
    spans = [np.ptp(np.concatenate(view.attractors), axis=0) for view in views]
    ratios = [
        float(np.clip(max(span[up] / span[across] for span in spans), 0.4, 1.0))
        for across, up in PLANES
    ]
    if narrow:
        figure = Figure(
            figsize=(NARROW, 2.4 + 2.0 * NARROW * sum(ratios)), layout=FixedMargins(4, 1)
        )
        grid = figure.subplots(4, 1, height_ratios=2 * ratios).reshape(2, 2).T
    else:
        figure = Figure(figsize=(10.5, 1.6 + 4.7 * sum(ratios)), layout=FixedMargins(2, 2))
        grid = figure.subplots(2, 2, height_ratios=ratios)
    for number, (column, view) in enumerate(zip(grid.T, views, strict=True), start=1):
        for axes, plane, side in zip(column, PLANES, ("side", "above"), strict=True):
            _draw_view(axes, view, plane, shades, f"frame{number}_{side}")
            axes.set_title(f"{view.name}\nfrom {'the side' if side == 'side' else 'above'}")
    letter_panels(*(grid.T if narrow else grid).ravel())
    instant = "release" if skill.configuration.alignment == "release" else "start of the motion"
    colour_bar(figure, shades, f"time of the component since the {instant} [s]", narrow)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    legend_below(figure, handles, labels, len(labels), narrow)
    headline = _headline(skill)
    if narrow:
        headline = headline.replace(": ", ":\n", 1).replace(", n", ",\nn")
    figure.suptitle(headline, x=0.01, ha="left")
    return figure


def _from_the_target(
    means: np.ndarray, covariances: np.ndarray, task: np.ndarray, distance_input: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Gaussians (K, m), (K, m, m) of the frame at the base as the target, straight ahead, sees
    them.
    """
    matrix, offset = np.eye(means.shape[1]), np.zeros(means.shape[1])
    first = _first_position(distance_input)
    offset[first + 2] = -task[2]
    if distance_input:
        matrix[first, first - 1] = -1.0
    else:
        offset[first] = -np.hypot(task[0], task[1])
    return means @ matrix.T + offset, matrix @ covariances @ matrix.T


def _view(
    skill: ThrowingSkill,
    frame: int,
    name: str,
    axes: tuple[str, str, str],
    means: np.ndarray,
    covariances: np.ndarray,
) -> FrameView:
    first = _first_position(skill.configuration.distance_input)
    xyz = slice(first, first + 3)
    start = np.median([throw.start for throw in skill.throws]) - 0.05
    stop = np.median([throw.stop for throw in skill.throws]) + 0.05
    attractors, releases = [], []
    for throw in skill.throws:
        A, b = _position_frame(skill, throw, frame)
        seen = np.linalg.solve(A, (throw.attractor[:, :3] - b).T).T
        attractors.append(seen[(throw.time >= start) & (throw.time <= stop)])
        releases.append([np.interp(throw.release_time, throw.time, column) for column in seen.T])
    return FrameView(
        name,
        axes,
        tuple(attractors),
        np.array(releases),
        means[:, xyz],
        covariances[:, xyz, xyz],
        means[:, 0],
    )


def _position_frame(
    skill: ThrowingSkill, throw: PreparedThrow, frame: int
) -> tuple[np.ndarray, np.ndarray]:
    """Axes (3, 3) and origin (3,) of a demonstration's frame."""
    frames: list[TaskFrame] = frames_for(throw.task, throw.motion[0, :3], skill.configuration)
    if frame < len(frames):
        first = _first_position(skill.configuration.distance_input)
    else:
        frames, first = [*frames, azimuth_target_frame(throw.task, n_angles=0)], 1
    xyz = slice(first, first + 3)
    return frames[frame].A[xyz, xyz], frames[frame].b[xyz]


def _first_position(distance_input: bool) -> int:
    """Column of x among the features t, [distance,] x, y, z, alpha, beta."""
    return 2 if distance_input else 1


def _headline(skill: ThrowingSkill) -> str:
    c, n = skill.configuration, len(skill.throws)
    distance = f"a target at {np.hypot(*median_task(skill)[:2]):.2f} m"
    which = ""
    if c.nearest or c.width:
        how = f"the {c.nearest} nearest" if c.nearest else f"weights of width {c.width:g} m"
        which = f", {how} for {distance}"
    elif c.frames == ("azimuth",) and not c.distance_input:
        which = f"; right: components for {distance}"
    return (
        f"Configuration '{c.name}': {c.components} components as {DEVIATIONS:g}-sigma ellipses, n"
        f" = {n} demonstrations{which}"
    )


def _draw_view(
    axes: Axes, view: FrameView, plane: tuple[int, int], shades: ScalarMappable, gid: str
) -> None:
    axes.add_collection(
        LineCollection(
            [path[:, plane] for path in view.attractors],
            colors=DEMONSTRATION,
            linewidths=0.7,
            zorder=2,
            label="attractor of a demonstration",
            gid=f"{gid}_attractors",
        )
    )
    _draw_components(axes, view, plane, shades, f"{gid}_components")
    dots: dict[str, Any] = {
        "linestyle": "none",
        "markersize": 4,
        "markeredgewidth": 0.6,
        "markeredgecolor": BLACK,
    }
    axes.plot(
        *view.means[:, plane].T,
        "o",
        color="white",
        label="mean of a component",
        gid=f"{gid}_means",
        zorder=3,
        **dots,
    )
    axes.plot(
        *view.releases[:, plane].T,
        "D",
        color=RELEASE,
        label="release",
        gid=f"{gid}_releases",
        zorder=3,
        **dots,
    )
    axes.set_aspect("equal", adjustable="datalim")
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.set(xlabel=f"{view.axes[plane[0]]} [m]", ylabel=f"{view.axes[plane[1]]} [m]")


def _draw_components(
    axes: Axes, view: FrameView, plane: tuple[int, int], shades: ScalarMappable, gid: str
) -> None:
    means, covariances = view.means[:, plane], view.covariances[:, plane][:, :, plane]
    sizes, angles = ellipse_axes(covariances, DEVIATIONS)
    colours = shades.to_rgba(view.times)
    ellipses = EllipseCollection(
        sizes[:, 0],
        sizes[:, 1],
        angles,
        units="xy",
        offsets=means,
        offset_transform=axes.transData,
        facecolors=np.column_stack([colours[:, :3], np.full(len(colours), 0.15)]),
        edgecolors=colours,
        linewidths=1.2,
        zorder=2.5,
        gid=gid,
    )
    axes.add_collection(ellipses, autolim=False)
    reach = DEVIATIONS * np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    axes.update_datalim(np.concatenate([means - reach, means + reach]))
