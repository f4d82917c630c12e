#!/usr/bin/env python3
"""Curves of what large bags, graphs side by side and more processes cost, from the numbers that
their benchmarks wrote.

    python3 tools/draw_growth.py build/growth docs/growth_graphs.svg

`make growth` measures and draws all. The folder holds bags.json (benchmarks/graph/large_bags.py),
graphs.json (benchmarks/graph/side_by_side.py) and cores.json (benchmarks/skill/cores.py); panels
of files that are not there stay empty.
"""

import argparse
import json
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

COMMANDS = {"check": "o", "learn": "s", "recover": "^"}
KINDS = {"--jobs": "o", "--scheduler": "s"}


def read(folder: Path, name: str) -> list[dict[str, Any]]:
    """Rows of a file of numbers; none if it is not there."""
    file = folder / name
    return json.loads(file.read_text(encoding="utf-8")) if file.exists() else []


def draw_bags(time: Axes, memory: Axes, rows: list[dict[str, Any]]) -> None:
    """Processor time and memory by the size of a bag."""
    for command, marker in COMMANDS.items():
        there = [row for row in rows if command in row]
        sizes = [1e-9 * row["size"] for row in there]
        time.loglog(
            sizes, [row[command]["processor"] for row in there], marker=marker, label=command
        )
        memory.loglog(
            sizes, [1e-6 * row[command]["memory"] for row in there], marker=marker, label=command
        )
    for axes, what in ((time, "processor time [s]"), (memory, "most memory [MB]")):
        axes.set_xlabel("bag [GB]")
        axes.set_ylabel(what)
        axes.legend(frameon=False, loc="upper left")
        ticks = [round(1e-9 * row["size"], 1) for row in rows]
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    time.set_ylim(1.0, 2000.0)
    memory.set_ylim(20.0, 20_000.0)


def draw_graphs(speed: Axes, step: Axes, rows: list[dict[str, Any]]) -> None:
    """Seconds of all worlds in one of the clock, and processor time of a step, by the number of
    graphs.
    """
    numbers = [row["graphs"] for row in rows]
    speed.plot(numbers, [row["sum"] for row in rows], marker="o", color="C3")
    step.plot(numbers, [1e3 * row["step"] for row in rows], marker="o", color="C3")
    for axes, what in (
        (speed, "simulated seconds of all in a second"),
        (step, "processor time of a step [ms]"),
    ):
        axes.set_xlabel("graphs side by side")
        axes.set_ylabel(what)
        axes.set_xticks([number for number in numbers if number != 2])
        axes.set_ylim(bottom=0.0)


def draw_cores(axes: Axes, rows: list[dict[str, Any]]) -> None:
    """Efficiency by the number of processes: by the clock, and without other programs."""
    for (kind, marker), colour in zip(KINDS.items(), ("C4", "C5"), strict=True):
        there = [row for row in rows if row["kind"] == kind]
        numbers = [row["processes"] for row in there]
        axes.plot(
            numbers,
            [100 * row["free"] for row in there],
            marker=marker,
            color=colour,
            label=f"{kind}, free",
        )
        axes.plot(
            numbers,
            [100 * row["efficiency"] for row in there],
            marker=marker,
            color=colour,
            ls=":",
            label=f"{kind}, clock",
        )
    axes.axhline(90.0, color="0.6", lw=0.8)
    axes.set_xlabel("processes")
    axes.set_ylabel("efficiency [%]")
    axes.set_xticks(sorted({row["processes"] for row in rows}))
    axes.set_ylim(0.0, 110.0)
    axes.legend(frameon=False, fontsize=8)


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("results", type=Path, help="folder of the numbers")
    parser.add_argument("picture", type=Path, help="SVG file to write")
    options = parser.parse_args()
    figure = Figure(figsize=(14.0, 3.4), layout="constrained")
    axes = figure.subplots(1, 5)
    draw_bags(axes[0], axes[1], read(options.results, "bags.json"))
    draw_graphs(axes[2], axes[3], read(options.results, "graphs.json"))
    draw_cores(axes[4], read(options.results, "cores.json"))
    for one in axes:
        one.grid(alpha=0.3)
        one.xaxis.set_minor_locator(NullLocator())
        one.yaxis.set_minor_locator(NullLocator())
    FigureCanvasSVG(figure).print_svg(
        str(options.picture), metadata={"Date": None, "Creator": "dart_skill"}
    )
    print(options.picture)


if __name__ == "__main__":
    main()
