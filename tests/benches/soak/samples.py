"""What a soak measures after each round of throws, whether it stays as it was, and its curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GROWTH = 0.05
"""The resident memory of a process may grow by this share after the warm-up."""
SLOWER = 0.95
"""The loop makes at the end at least this share of the speed that it had after the warm-up, and
needs as little processor time.
"""
UNDISTURBED = 90.0
"""Percentile of the speeds of rounds that are compared: whatever else the machine does makes some
of them slower.
"""
FEWEST = 8
"""Rounds after the warm-up that can be judged."""


@dataclass(frozen=True)
class Usage:
    """What one process uses. memory: resident [MB]; processor: time that it used in this round for
    a second of the world [s/s].
    """

    memory: float
    processor: float
    threads: int
    descriptors: int


@dataclass(frozen=True)
class Sample:
    """After a round. minutes: since the first throw [min, wall clock]; thrown: so far; speed: of
    the world in this round [s/s]; usage: by process.
    """

    minutes: float
    thrown: int
    speed: float
    usage: dict[str, Usage]


def changes(samples: Sequence[Sample], warm_up: float) -> list[str]:
    """What was not as at the end of the warm-up [min] when the soak ended, in words; ValueError if
    it was too short to tell.
    """
    rounds = [one for one in samples if one.minutes >= warm_up]
    if len(rounds) < FEWEST:
        raise ValueError(
            f"{len(rounds)} rounds after {warm_up:.0f} min of warm-up: at least {FEWEST} are"
            " needed; give more --minutes"
        )
    first, last = rounds[: len(rounds) // 4], rounds[-(len(rounds) // 4) :]
    said = []
    for name in sorted(rounds[0].usage):
        grown = _mean(last, name, "memory") / _mean(first, name, "memory") - 1.0
        if grown > GROWTH:
            said.append(f"the memory of {name} grew by {100 * grown:.0f} %")
        for what in ("threads", "descriptors"):
            before, now = (
                max(getattr(one.usage[name], what) for one in part) for part in (first, last)
            )
            if now > before:
                said.append(f"{name} has {now} {what}, it had {before}")
    slower = _fastest(last) / _fastest(first)
    if slower < SLOWER:
        said.append(f"the loop makes {100 * slower:.0f} % of the speed that it had")
    costlier = _processor(last) / _processor(first)
    if costlier > 1.0 / SLOWER:
        said.append(f"the loop needs {100 * costlier:.0f} % of the processor time that it needed")
    return said


def _fastest(samples: Sequence[Sample]) -> float:
    return float(np.percentile([one.speed for one in samples], UNDISTURBED))


def _processor(samples: Sequence[Sample]) -> float:
    """Processor time of all processes for a second of the world [s/s]."""
    return float(
        np.median([sum(usage.processor for usage in one.usage.values()) for one in samples])
    )


def _mean(samples: Sequence[Sample], name: str, what: str) -> float:
    return float(np.mean([getattr(one.usage[name], what) for one in samples]))


def curve(samples: Sequence[Sample], warm_up: float) -> Figure:
    """Memory of each process, threads and descriptors of all, speed of the loop and its processor
    time, over the time of the soak.
    """
    from matplotlib.figure import Figure

    from dart_skill.figures import BLACK, house_style

    minutes = [one.minutes for one in samples]
    with house_style():
        figure = Figure(figsize=(7.0, 8.0), layout="constrained")
        memory, counts, speed, processor = panels = figure.subplots(4, sharex=True)
        for name in sorted(samples[0].usage):
            memory.plot(minutes, [one.usage[name].memory for one in samples], label=name)
        memory.set(title="Resident memory", ylabel="MB", ylim=(0.0, None))
        for what in ("threads", "descriptors"):
            counts.plot(
                minutes,
                [sum(getattr(usage, what) for usage in one.usage.values()) for one in samples],
                label=what,
            )
        counts.set(title="Threads and descriptors of all processes", ylim=(0.0, None))
        speed.plot(minutes, [one.speed for one in samples], color=BLACK)
        speed.set(title="Speed of the loop", ylabel="times real time", ylim=(0.0, None))
        processor.plot(
            minutes,
            [sum(usage.processor for usage in one.usage.values()) for one in samples],
            color=BLACK,
        )
        processor.set(
            title="Processor time for a second of the world",
            ylabel="s",
            xlabel="min",
            ylim=(0.0, None),
        )
        for axes in panels:
            axes.axvspan(0.0, warm_up, color="0.93", zorder=0)
        memory.legend(ncols=3, loc="lower right")
        counts.legend(loc="lower right")
    return figure
