"""The figures of the thesis, computed anew: `dart-skill experiment figure NUMBER`.

For a figure 5.2 a module has `TITLE_5_2` and `draw_5_2(folder, seed)`, which writes the figure and
returns its paths and what was measured, by name; `describe_5_2`, where that reads better than
JSON. The thesis prints few numbers of its experiments; where one had to be chosen, the module says
so.
"""

import importlib
import inspect
import json
from pathlib import Path
from typing import Any

FIGURES = {
    "3.1": "chapter_3",
    "3.2": "chapter_3",
    "5.1": "exploration",
    "5.2": "exploration",
    "5.3": "exploration",
    "5.4": "components",
    "5.5": "components",
    "6.1": "board",
    "6.2": "board",
    "6.3": "dart_searches",
    "6.4": "resampling",
    "6.5": "resampling",
    "6.6": "board",
    "7.1": "figure_7_1",
    "7.4": "figure_7_4",
    "8.1": "dart_figures",
    "8.2": "dart_figures",
    "8.3": "dart_figures",
    "8.4.4": "figure_8_4_4",
    "8.6": "ball_trajectories",
    "8.7": "ball_angles",
    "8.8": "nearest_baskets",
    "8.9": "ball_trajectories",
    "8.10": "ball_angles",
    "8.11": "ball_trajectories",
    "landscape": "landscape",
    "regrets": "dart_searches",
}
"""Module of each figure, by its number."""


def titles() -> dict[str, str]:
    """Number and title of every figure that can be drawn."""
    return {number: _member(number, "TITLE") for number in FIGURES}


def draw(
    number: str, folder: str | Path, seed: int = 0, **options: int
) -> tuple[list[Path], dict]:
    """Write a figure into a folder; its paths, and what was measured for it.

    Parameters
    ----------
    options
        Of the figure alone, such as teachers of 8.4.4.

    Raises
    ------
    ValueError
        If it has no such option.
    """
    drawn = _member(number, "draw")
    for name in options:
        if name not in inspect.signature(drawn).parameters:
            raise ValueError(f"figure {number} has no option '{name}': leave it out")
    return drawn(folder, seed, **options)


def describe(number: str, measured: dict) -> str:
    """What was measured for a figure, as text."""
    return _member(number, "describe", json.dumps)(measured)


def _member(number: str, what: str, *default: Any) -> Any:
    if number not in FIGURES:
        raise ValueError(f"there is no figure {number} here: choose one of {', '.join(FIGURES)}")
    module = importlib.import_module(f"{__name__}.{FIGURES[number]}")
    return getattr(module, f"{what}_{number.replace('.', '_')}", *default)
