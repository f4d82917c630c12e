"""Figures `practice_N_CHANGE`: how the landing error and the share in the basket develop with own
throws, one figure per number of demonstrations and change of the plant, one line per method.

What is drawn are throws from which nothing was learned: median and quartiles of their error, and
the share that went in with its 95 % interval. The dashed line is what the hand's own scatter
leaves of the error when nothing else is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dart_skill.experiments.studies.basket_maps import wilson
from dart_skill.experiments.studies.practice import PracticeRun, PracticeTask
from dart_skill.figures import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LIGHT,
    ORANGE,
    PURPLE,
    VERMILION,
    house_style,
    save,
)
from dart_skill.skills.practice import METHODS

LOOKS = dict(
    zip(
        METHODS,
        ((BLUE, "o"), (VERMILION, "s"), (GREEN, "D"), (ORANGE, "^"), (PURPLE, "v")),
        strict=True,
    )
)
CHANGES = {
    "none": "",
    "heavier_ball": "ball of twice the mass",
    "friction": "friction doubled",
    "weaker_motors": "motors of 80 % torque",
    "slower_hand": "hand opens later",
    "base_turned": "base turned by 5°",
}


def draw_practice(
    results: Sequence[PracticeRun], folder: str | Path, floor: float | None = None
) -> list[Path]:
    """Write a figure for every number of demonstrations and change.

    Parameters
    ----------
    floor : [m]
        Of the median error.

    Returns
    -------
    list[Path]
        The paths.
    """
    kinds = dict.fromkeys(
        (one.task.demonstrations, one.task.change, one.task.change_after) for one in results
    )
    return [path for kind in kinds for path in _draw(_of_kind(results, kind), folder, floor)]


def _of_kind(results: Sequence[PracticeRun], kind: tuple[int, str, int]) -> list[PracticeRun]:
    return [
        one
        for one in results
        if (one.task.demonstrations, one.task.change, one.task.change_after) == kind
    ]


def _draw(results: list[PracticeRun], folder: str | Path, floor: float | None) -> list[Path]:
    task, methods = (
        results[0].task,
        [method for method in METHODS if any(one.task.method == method for one in results)],
    )
    counts = sorted({n for one in results for n in one.task.tested_after})
    with house_style():
        figure = Figure(figsize=(10.5, 4.6), layout="constrained")
        error, share = figure.subplots(1, 2)
        for number, method in enumerate(methods):
            shift = (number - (len(methods) - 1) / 2) * 0.1
            _draw_method(
                error,
                share,
                [one for one in results if one.task.method == method],
                shift,
                counts,
                method,
            )
        if floor is not None:
            error.axhline(
                100.0 * floor,
                color=BLACK,
                linestyle="--",
                linewidth=1.2,
                label=f"hand's repeatability, {100 * floor:.2f} cm",
            )
        for axes in (error, share):
            _describe(axes, counts, task)
        error.set(
            yscale="log", ylabel="landing error [cm], median and quartiles", title=_title(results)
        )
        low, high = error.get_ylim()
        error.set_yticks(
            [0.2, 0.5, 1, 2, 5, 10, 20, 50], labels=["0.2", "0.5", "1", "2", "5", "10", "20", "50"]
        )
        error.minorticks_off()
        error.set_ylim(low, min(high, 100.0))
        share.set(
            ylabel="in the basket [%], 95 % interval",
            ylim=(min(80.0, share.get_ylim()[0]), 101.0),
            title=_counted(results),
        )
        share.yaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 5, 10]))
        handles, labels = error.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        after = (
            f"_after_{task.change_after}" if task.change != "none" and task.change_after else ""
        )
        return save(figure, folder, f"practice_{task.demonstrations}_{task.change}{after}")


def errors_after(results: Sequence[PracticeRun], n: int) -> tuple[np.ndarray, np.ndarray]:
    """Error (m,) [m], nan if unknown, and whether it went in (m,), of the test throws after n
    practised ones, over all runs.
    """
    tested = [
        (one, one.task.tested_after.index(n)) for one in results if n in one.task.tested_after
    ]
    errors = [error for one, k in tested for error in one.test_errors[k]]
    return np.array(errors, dtype=float), np.array(
        [hit for one, k in tested for hit in one.test_in_basket[k]], dtype=bool
    )


def _draw_method(
    error: Axes,
    share: Axes,
    results: list[PracticeRun],
    shift: float,
    counts: list[int],
    method: str,
) -> None:
    """Points of a method; shift: sideways, as a share of the way between two tests."""
    colour, marker = LOOKS[method]
    look: dict[str, Any] = {
        "color": colour,
        "marker": marker,
        "markersize": 5.0,
        "linewidth": 1.4,
        "capsize": 2.0,
        "elinewidth": 1.0,
    }
    rows, shares = [], []
    for place, n in enumerate(counts):
        errors, inside = errors_after(results, n)
        seen = 100.0 * errors[np.isfinite(errors)]
        rows += [(place + shift, *np.percentile(seen, [25, 50, 75]))] if len(seen) else []
        shares += (
            [(place + shift, *(100.0 * np.array(wilson(int(inside.sum()), len(inside)))))]
            if len(inside)
            else []
        )
    for axes, points in ((error, rows), (share, shares)):
        x, low, middle, high = np.array(points).reshape(-1, 4).T
        axes.errorbar(x, middle, [middle - low, high - middle], label=method, **look)


def _describe(axes: Axes, counts: list[int], task: PracticeTask) -> None:
    """The tests at equal distances, and the change if it comes between two of them."""
    axes.set_xticks(range(len(counts)), labels=[str(n) for n in counts])
    axes.set_xlabel("own throws")
    axes.grid(axis="y", color=LIGHT, linewidth=0.5)
    axes.set_axisbelow(True)
    if task.change != "none" and task.change_after > 0:
        # A change after n throws comes before the test after n throws.
        place = np.searchsorted(counts, task.change_after) - 0.5
        axes.axvline(place, color=GREY, linewidth=1.2, linestyle=":")
        axes.annotate(
            "change",
            (place, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(3, -9),
            textcoords="offset points",
            color=GREY,
        )


def _title(results: list[PracticeRun]) -> str:
    task = results[0].task
    change = f", then {CHANGES[task.change]}" if task.change != "none" else ""
    errors = [error for one in results for test in one.test_errors for error in test]
    without = int(np.isnan(errors).sum())
    note = (
        f"\n{without} of {len(errors)} throws had no plan, or a landing that nobody saw"
        if without
        else ""
    )
    arm = "" if task.arm == "ideal" else f", {task.arm}"
    return f"After {task.demonstrations} demonstrations{change}{arm}{note}"


def _counted(results: list[PracticeRun]) -> str:
    runs = [
        sum(one.task.method == method for one in results)
        for method in dict.fromkeys(one.task.method for one in results)
    ]
    number = f"{runs[0]}" if min(runs) == max(runs) else f"{min(runs)} to {max(runs)}"
    tests = sorted({len(test) for one in results for test in one.test_errors})
    return f"n = {number} runs of {' or '.join(map(str, tests))} test throws per point"
