"""The figures of the thesis, computed anew: `dart-skill experiment figure NUMBER`.

The module of figure 5.2 has `draw_5_2(seed)`, which returns a matplotlib Figure and what was
measured, by name; keyword arguments of it are options of the figure. `describe_5_2` says what was
measured in words, where that reads better than JSON. The thesis prints few numbers of its
experiments; where one had to be chosen, the module says so.
"""

from __future__ import annotations

import importlib
import inspect
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURES = {
    "3.1": ("chapter_3", "Gaussian mixture model and regression on planar data"),
    "3.2": ("chapter_3", "Gestures recognised by the likelihood of the mixtures of demonstrated ones"),
    "5.1": ("chapter_5", "One update of PoWER: samples, the best of them, new mean and covariance"),
    "5.2": ("chapter_5", "Exploration noise, constant: the covariance becomes rounder"),
    "5.3": ("chapter_5", "Exploration noise, proportional to the eigenvalues: the covariance keeps its shape"),
    "5.4": ("chapter_5", "A Gaussian split in two, and merged again"),
    "5.5": ("chapter_5", "Data spectroscopy finds the groups of weighted points"),
    "6.1": ("chapter_6", "The dart board, and what its fields score"),
    "6.2": ("dart_searches", "The mixture's search over the board while the thrower gets better"),
    "6.3": ("dart_searches", "Number of Gaussians, and learning on against stopping half-way"),
    "6.4": ("chapter_6", "Stochastic universal sampling"),
    "6.5": ("chapter_6", "Average log-likelihood of resampled data tends to that of weighted data"),
    "6.6": ("chapter_6", "The best aim over the thrower's standard deviation"),
    "7.1": ("chapter_7", "A finger on a ball is held: a clock and a state as what drives it"),
    "7.4": ("chapter_7", "Task-parameterised movement: two frames, and new places for them"),
    "8.1": ("dart_throws", "Dart throws, demonstrated and reproduced"),
    "8.2": ("dart_throws", "Dart throws get better with every attempt"),
    "8.3": ("dart_throws", "The error of dart throws falls with experience"),
    "8.4.4": ("figure_8_4_4", "Success of both models against the range of angles and of distances"),
    "8.6": ("ball_figures", "Demonstrated throws of the ball, and the global model's at a new basket"),
    "8.7": ("ball_figures", "Angles of the hand in all demonstrations, as two frames see them"),
    "8.8": ("ball_figures", "The demonstrations nearest to a new basket"),
    "8.9": ("ball_figures", "Local regression: chosen trajectories and the generated one"),
    "8.10": ("ball_figures", "Angles of the hand in the chosen demonstrations, as two frames see them"),
    "8.11": ("ball_figures", "Speed of the hand before and after synchronisation"),
    "correction": ("correction", "What cameras correct of a careful motion: its step response and margins"),
    "landscape": ("chapter_6", "A landscape modelled by a mixture that is told all of it"),
    "place_strip": ("place_strip", "A part on its way into a holder: corrected, without cameras, and as planned"),
    "regrets": ("dart_searches", "Regrets of all methods, thesis's schedule and the extended one"),
}  # fmt: skip
"""Module and title of each figure, by its number."""


def titles() -> dict[str, str]:
    """Number and title of every figure that can be drawn."""
    return {number: title for number, (_, title) in FIGURES.items()}


def figure_of(number: str, seed: int = 0, **options: Any) -> tuple[Figure, dict]:
    """A figure, and what was measured for it.

    Parameters
    ----------
    options
        Of the figure alone, such as teachers of 8.4.4.

    Raises
    ------
    ValueError
        If it has no such option.
    """
    from dart_skill.figures import house_style

    for name in options.keys() - known_options(number, options).keys():
        raise ValueError(f"figure {number} has no option '{name}': leave it out")
    with house_style():
        return _member(number, "draw")(seed, **options)


def known_options(number: str, options: dict[str, Any]) -> dict[str, Any]:
    """Those of some options that a figure has."""
    known = inspect.signature(_member(number, "draw")).parameters
    return {name: value for name, value in options.items() if name in known}


def draw(
    number: str, folder: str | Path, seed: int = 0, **options: Any
) -> tuple[list[Path], dict]:
    """Write the figure of `figure_of` into a folder; its paths, and what was measured for it."""
    from dart_skill.figures import save

    if number == "regrets":
        options["folder"] = Path(folder)
    figure, measured = figure_of(number, seed, **options)
    name = f"figure_{number.replace('.', '_')}" if number[0].isdigit() else number
    return save(figure, folder, name), measured


def describe(number: str, measured: dict) -> str:
    """What was measured for a figure, as text."""
    return _member(number, "describe", json.dumps)(measured)


def _member(number: str, what: str, *default: Any) -> Any:
    if number not in FIGURES:
        raise ValueError(f"there is no figure {number} here: choose one of {', '.join(FIGURES)}")
    module = importlib.import_module(f"{__name__}.{FIGURES[number][0]}")
    return getattr(module, f"{what}_{number.replace('.', '_')}", *default)
