"""Models in a plane of the user's own axes: a mixture, task frames, and a movement that was
reproduced, in the colours of the house.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.patches import Ellipse
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_dims, as_number
from dart_skill.figures._style import (
    ATTRACTOR,
    BLACK,
    DEMONSTRATION,
    GAUSSIAN,
    HAND,
    gaussian_ellipse,
)
from dart_skill.mixture import GaussianMixture
from dart_skill.movement import Reproduction, TaskFrame

FAINTEST = 0.12
"""Least opacity of the insides of components; the most probable has 0.5."""


def plot_mixture(
    axes: Axes,
    mixture: GaussianMixture,
    dims: ArrayLike = (0, 1),
    *,
    deviations: float = 2.0,
    colour: str = GAUSSIAN,
    label: str = "",
) -> list[Ellipse]:
    """Draw the components of a mixture in the plane of two of its dimensions.

    Parameters
    ----------
    axes
        Of matplotlib, into which is drawn.
    mixture
        Over two or more dimensions; the others are left out of it.
    dims
        The two dimensions, to the right and upwards.
    deviations
        Size of the ellipses in standard deviations.
    colour
        Of all components; the more probable one is, the fuller is its inside.
    label
        For a legend; none by default.

    Returns
    -------
    list[Ellipse]
        Their ellipses.

    Raises
    ------
    ValueError
        For other than two dimensions.
    """
    plane = mixture.marginal(_two(dims, mixture.n_dims))
    fullness = np.maximum(0.5 * plane.priors_ / plane.priors_.max(), FAINTEST)
    made: list[Ellipse] = []
    for k, one in enumerate(plane.components):
        inside = to_rgba(colour, fullness[k])
        ellipse = gaussian_ellipse(
            one.mean, one.covariance, as_number(deviations, "deviations"), facecolor=inside
        )
        ellipse.set(edgecolor=colour, linewidth=0.8, label=label if k == 0 and label else None)
        axes.add_patch(ellipse)
        made.append(ellipse)
    axes.plot(*plane.means_.T, ".", color=colour, markersize=4.0)
    axes.autoscale_view()
    return made


def plot_frames(
    axes: Axes,
    frames: Sequence[TaskFrame | None],
    dims: ArrayLike = (1, 2),
    *,
    size: float = 1.0,
    names: bool = True,
) -> None:
    """Draw task frames in the plane of two of their dimensions: where they stand, and where their
    two axes point to.

    Parameters
    ----------
    axes
        Of matplotlib, into which is drawn.
    frames
        TaskFrames over the features; a missing one (None) is left out. Time is feature 0.
    dims
        The two dimensions, to the right and upwards.
    size
        Length of an axis that neither stretches nor shrinks what it sees, in units of the plane.
    names
        Whether each has its number beside it, from 1.

    Raises
    ------
    ValueError
        For other than two dimensions.
    """
    length = as_number(size, "size")
    for number, frame in enumerate(frames, start=1):
        if frame is None:
            continue
        plane = _two(dims, frame.n_dims)
        origin, directions = frame.b[plane], length * frame.A[np.ix_(plane, plane)]
        for direction, style in zip(directions.T, ("-", (0, (2, 1))), strict=True):
            axes.plot(
                *np.array([origin, origin + direction]).T,
                color=BLACK,
                linestyle=style,
                linewidth=1.6,
                solid_capstyle="butt",
            )
        axes.plot(*origin, "s", color=BLACK, markersize=4.5)
        if names:
            axes.annotate(
                f"frame {number}", origin, xytext=(5, -12), textcoords="offset points", color=BLACK
            )


def plot_reproduction(
    axes: Axes,
    reproduction: Reproduction,
    dims: ArrayLike = (0, 1),
    *,
    demonstrations: Sequence[ArrayLike] = (),
    labels: bool = True,
) -> None:
    """Draw a movement that was reproduced in the plane of two movement variables, with the
    attractor that it follows.

    Parameters
    ----------
    axes
        Of matplotlib, into which is drawn.
    reproduction
        From `DSGMR.reproduce`; where it begins is a dot.
    dims
        The two movement variables, to the right and upwards.
    demonstrations
        Positions (n_i, d) of demonstrations, drawn below it.
    labels
        Whether what is drawn has a name in a legend.

    Raises
    ------
    ValueError
        For other than two dimensions.
    """
    plane = _two(dims, reproduction.position.shape[1])
    for i, shown in enumerate(demonstrations):
        axes.plot(
            *np.asarray(shown)[:, plane].T,
            color=DEMONSTRATION,
            linewidth=0.9,
            label="demonstrations" if labels and i == 0 else None,
        )
    axes.plot(
        *reproduction.attractor[:, plane].T,
        "--",
        color=ATTRACTOR,
        linewidth=1.3,
        label="attractor" if labels else None,
    )
    axes.plot(
        *reproduction.position[:, plane].T,
        color=HAND,
        linewidth=2.0,
        label="reproduction" if labels else None,
    )
    axes.plot(*reproduction.position[0, plane], "o", color=HAND, markersize=5.0)


def _two(dims: ArrayLike, n_dims: int) -> np.ndarray:
    plane = as_dims(dims, n_dims, "dims")
    if len(plane) != 2:
        raise ValueError(f"dims must name two dimensions, got {plane.tolist()}")
    return plane
