"""The figures of the thesis, one module each, computed anew: `dart-skill experiment figure
NUMBER`.

A module has TITLE and `draw(folder, seed)`, which writes the figure and returns its paths and what
was measured, by name; `describe`, where that reads better than JSON. The thesis prints few numbers
of its experiments; where one had to be chosen, the module says so.
"""

import importlib
import inspect
import json
from pathlib import Path
from types import ModuleType

FIGURES = {
    "3.1": "figure_3_1",
    "3.2": "figure_3_2",
    "5.1": "figure_5_1",
    "5.2": "figure_5_2",
    "5.3": "figure_5_3",
    "5.4": "figure_5_4",
    "5.5": "figure_5_5",
    "6.1": "figure_6_1",
    "6.2": "figure_6_2",
    "6.3": "figure_6_3",
    "6.4": "figure_6_4",
    "6.5": "figure_6_5",
    "6.6": "figure_6_6",
    "7.1": "figure_7_1",
    "7.4": "figure_7_4",
    "8.1": "figure_8_1",
    "8.2": "figure_8_2",
    "8.3": "figure_8_3",
    "8.4.4": "figure_8_4_4",
    "8.6": "figure_8_6",
    "8.7": "figure_8_7",
    "8.8": "figure_8_8",
    "8.9": "figure_8_9",
    "8.10": "figure_8_10",
    "8.11": "figure_8_11",
    "landscape": "landscape",
    "regrets": "regrets",
}


def titles() -> dict[str, str]:
    """Number and title of every figure that can be drawn."""
    return {number: _module(number).TITLE for number in FIGURES}


def draw(
    number: str, folder: str | Path, seed: int = 0, **options: int
) -> tuple[list[Path], dict]:
    """Write a figure into a folder; its paths, and what was measured for it.

    options: of the figure alone, such as teachers of 8.4.4. ValueError if it has no such option.
    """
    drawn = _module(number).draw
    for name in options:
        if name not in inspect.signature(drawn).parameters:
            raise ValueError(f"figure {number} has no option '{name}': leave it out")
    return drawn(folder, seed, **options)


def describe(number: str, measured: dict) -> str:
    """What was measured for a figure, as text."""
    return getattr(_module(number), "describe", json.dumps)(measured)


def _module(number: str) -> ModuleType:
    if number not in FIGURES:
        raise ValueError(f"there is no figure {number} here: choose one of {', '.join(FIGURES)}")
    return importlib.import_module(f"{__name__}.{FIGURES[number]}")
