"""Figure 5.2: exploration noise as a constant diagonal matrix, which makes a long covariance
rounder.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dart_skill.figures import BLUE, LIGHT, VERMILION, gaussian_ellipse, house_style, save
from dart_skill.policy_search import with_constant_noise

TITLE = "Exploration noise, constant: the covariance becomes rounder"
ANGLE, LONG, SHORT = np.radians(35.0), 1.0, 0.25
NOISE = 0.5
"""Standard deviations of the covariance along its axes, and of the noise, in units of the
parameters.
"""


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    """The same for every seed: there is nothing random in it."""
    return draw_noise(folder, "figure_5_2", with_constant_noise, "constant diagonal matrix added")


def draw_noise(
    folder: str | Path, name: str, add: Callable, title: str
) -> tuple[list[Path], dict]:
    """A covariance before and after its eigenvalues (2,) get noise; how much longer than wide it
    is.
    """
    axes = np.array([[np.cos(ANGLE), -np.sin(ANGLE)], [np.sin(ANGLE), np.cos(ANGLE)]])
    before = np.array([LONG, SHORT]) ** 2
    after = add(before, NOISE)
    with house_style():
        figure = Figure(figsize=(8.0, 4.0), layout="constrained")
        panels = figure.subplots(1, 2, sharex=True, sharey=True)
        for panel, variances, what in zip(panels, (before, after), ("before", title), strict=True):
            covariance = (axes * variances) @ axes.T
            panel.add_patch(
                gaussian_ellipse(
                    np.zeros(2), covariance, 1.0, facecolor=LIGHT, edgecolor=BLUE, alpha=0.6
                )
            )
            for axis, variance in zip(axes.T, variances, strict=True):
                panel.plot(*np.outer([0.0, np.sqrt(variance)], axis).T, color=VERMILION)
            panel.set(
                xlim=(-1.5, 1.5),
                ylim=(-1.5, 1.5),
                aspect="equal",
                xlabel="first parameter",
                title=what,
            )
        panels[0].set_ylabel("second parameter")
        return save(figure, folder, name), {
            "long_over_short_before": LONG / SHORT,
            "after": round(float(np.sqrt(after[0] / after[1])), 3),
        }
