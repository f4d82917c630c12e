#!/usr/bin/env python3
"""A flame graph of the graph in one process, from the stacks that py-spy sampled.

    dart-skill up --output build/flame/bag                 # then teach and throw from another terminal, and meanwhile:
    py-spy record --native --format raw --rate 100 --duration 20 --output build/flame.txt --pid PID
    python3 tools/draw_flame.py build/flame.txt docs/flame.svg

PID: of `composed`, as `dart-skill status` tells. py-spy is no requirement of this package: pip
install py-spy. Without --native what the executor does in C++ counts as Python that waits. A box
is a function, as wide as its share of the samples, above the one that called it; its colour is
that of the node for which it works. What stands below the executor's turn is left out, and so are
C++ functions without a name.
"""

import argparse
import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from dart_skill.common import palette
from dart_skill.common.palette import hexadecimal

TURN = "spin_until (dart_skill_nodes/process/node_base.py"
"""Below it stands only what started the process."""
NODES = {
    "wam_simulator.py": ("simulator", palette.SKY),
    "mock_optitrack.py": ("cameras", palette.GREEN),
    "commander.py": ("commander", palette.ORANGE),
    "teacher.py": ("teacher", palette.VERMILION),
    "recorder.py": ("recorders", palette.PURPLE),
    "bag_sink.py": ("recorders", palette.PURPLE),
}
NOBODY = ("executor and middleware", palette.LIGHT)
LEFT_OUT = re.compile(
    r"^0x|^_Guarded|<lambda>|^_call_with|^Refusals\.accepts|^eprosima|^0$|^std::"
)
WAITS = re.compile(r"pthread_cond_(timed)?wait|epoll_wait|clock_nanosleep")
"""Samples in which the process waits are not counted: this is about processor time."""
DEEPEST = 14
"""As many functions are drawn above each other; the rest is inside a library."""
SMALLEST = 0.004
"""A box of a smaller share is not drawn."""
LETTERS = 155
"""That fit into the whole width."""


class Box(NamedTuple):
    """start, share: of the width, from 0 to 1; depth: 0 at the bottom; kind: the node for which
    the function works.
    """

    name: str
    start: float
    share: float
    depth: int
    kind: tuple[str, palette.Colour]


def stacks_of(text: str) -> Counter[tuple[str, ...]]:
    """How often each stack of functions was seen, the outermost first, from the executor's turn
    on.
    """
    stacks: Counter[tuple[str, ...]] = Counter()
    for line in text.splitlines():
        frames, _, count = line.rpartition(" ")
        names = frames.split(";")
        turn = next((k for k, name in enumerate(names) if name.startswith(TURN)), None)
        if turn is not None and not any(WAITS.match(name) for name in names):
            stacks[tuple(name for name in names[turn + 1 :] if not LEFT_OUT.search(name))] += int(
                count
            )
    if not stacks:
        raise SystemExit(
            f"no stack holds '{TURN}': sample `composed` with --native --format raw while the arm"
            " throws"
        )
    return stacks


def kind_of(name: str, below: tuple[str, palette.Colour]) -> tuple[str, palette.Colour]:
    """The node for which a function works: that of its file, or the one below it works for."""
    return next((kind for file, kind in NODES.items() if f"{file}:" in name), below)


def boxes(stacks: Counter[tuple[str, ...]]) -> list[Box]:
    """All functions that have a share of some size; of one function in several lines of another
    there is one box.
    """
    total, found = sum(stacks.values()), []

    def stack_up(
        rows: list[tuple[tuple[str, ...], int]],
        start: float,
        depth: int,
        below: tuple[str, palette.Colour],
    ) -> None:
        inner: dict[tuple[str, tuple[str, palette.Colour]], list[tuple[tuple[str, ...], int]]] = {}
        for names, count in rows:
            if depth < min(len(names), DEEPEST):
                key = (names[depth].split(" (")[0], kind_of(names[depth], below))
                inner.setdefault(key, []).append((names, count))
        for (name, kind), some in sorted(
            inner.items(), key=lambda item: (item[0][1][0], item[0][0])
        ):
            share = sum(count for _, count in some) / total
            if share >= SMALLEST:
                found.append(Box(name, start, share, depth, kind))
                stack_up(some, start, depth + 1, kind)
            start += share

    stack_up(list(stacks.items()), 0.0, 0, NOBODY)
    return found


def drawn(found: list[Box]) -> Figure:
    """The boxes, the outermost function at the bottom, and a key of the colours with the share of
    each node.
    """
    deepest = max(box.depth for box in found)
    figure = Figure(figsize=(12.0, 0.19 * (deepest + 1) + 0.9))
    axes = figure.add_axes((0.01, 0.09, 0.98, 0.9))
    for box in found:
        colour = hexadecimal(box.kind[1])
        axes.add_patch(
            Rectangle(
                (box.start, box.depth),
                box.share,
                0.94,
                facecolor=colour,
                edgecolor="white",
                linewidth=0.4,
            )
        )
        room = int(LETTERS * box.share)
        if room >= 4:
            text = (
                box.name
                if len(box.name) <= room
                else box.name[: room - 1] + "\N{HORIZONTAL ELLIPSIS}"
            )
            axes.text(
                box.start + 0.001,
                box.depth + 0.45,
                text,
                fontsize=6.5,
                va="center",
                ha="left",
                clip_on=True,
            )
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, deepest + 1.0)
    axes.axis("off")
    key = key_of(found)
    figure.legend(
        handles=key,
        loc="lower center",
        ncols=len(key),
        frameon=False,
        fontsize=8,
        columnspacing=1.2,
    )
    return figure


def key_of(found: list[Box]) -> list[Patch]:
    """A patch and the share of each node; the rest is the executor's."""
    shares: Counter[tuple[str, palette.Colour]] = Counter()
    for box in found:
        if box.kind != NOBODY and not any(
            other.kind == box.kind and other.depth < box.depth and covers(other, box)
            for other in found
        ):
            shares[box.kind] += box.share
    shares[NOBODY] = 1.0 - sum(shares.values())
    return [
        Patch(color=hexadecimal(colour), label=f"{name}, {share:.0%}")
        for (name, colour), share in shares.most_common()
    ]


def covers(below: Box, box: Box) -> bool:
    """Whether a box stands on another."""
    return (
        below.start <= box.start + 1e-12
        and box.start + box.share <= below.start + below.share + 1e-12
    )


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("samples", type=Path, help="what py-spy wrote, with --format raw")
    parser.add_argument("picture", type=Path, help="the file to draw, .svg or .png")
    options = parser.parse_args()
    figure = drawn(boxes(stacks_of(options.samples.read_text(encoding="utf-8"))))
    figure.savefig(
        options.picture, metadata={"Date": None} if options.picture.suffix == ".svg" else None
    )


if __name__ == "__main__":
    main()
