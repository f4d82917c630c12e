#!/usr/bin/env python3
"""How time and memory of learning and of a plan grow with demonstrations, task frames, components
and dimensions.

    python3 -m benchmarks.growth [--picture docs/growth.svg]

A DS-GMR model learns made demonstrations of 200 steps: smooth movements in random task frames. All
but one number are as usual: 13 demonstrations, 2 frames, 5 components, 6 columns (time and 5
variables). EM does 20 iterations. A plan is a movement of 200 steps in a new situation. One
thread; least processor time of some repeats, and the most memory that a call holds at a time,
beyond what was there before.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse  # noqa: E402
import time  # noqa: E402
import tracemalloc  # noqa: E402
from collections.abc import Callable  # noqa: E402
from typing import NamedTuple  # noqa: E402

import numpy as np  # noqa: E402

from dart_skill.movement import DSGMR, TaskFrame  # noqa: E402

N_STEPS = 200
"""Number of samples of a demonstration."""
N_ITERATIONS = 20
"""Number of iterations of EM."""
USUAL = {"demonstrations": 13, "frames": 2, "components": 5, "dimensions": 6}
GROWN = {
    "demonstrations": (5, 10, 20, 50, 100, 200, 500, 1000, 2000),
    "frames": (1, 2, 3, 4, 6, 8),
    "components": (1, 2, 5, 10, 20),
    "dimensions": (2, 4, 6, 10, 15, 20, 30),
}


class Cost(NamedTuple):
    """Of one call: processor time [s] and memory [bytes]."""

    seconds: float
    size: float


def cost_of(task: Callable[[], object], seconds: float) -> Cost:
    """Least time of at least three calls in so many seconds, of one only where it is long; memory
    of another call.
    """
    taken: list[float] = []
    while len(taken) < 3 or (sum(taken) < seconds and len(taken) < 200):
        begin = time.process_time()
        task()
        taken.append(time.process_time() - begin)
        if taken[-1] > 3.0:
            break
    tracemalloc.start()
    try:
        task()
        return Cost(min(taken), tracemalloc.get_traced_memory()[1])
    finally:
        tracemalloc.stop()


def frame(n_dims: int, rng: np.random.Generator) -> TaskFrame:
    """A frame that leaves time as it is and turns all variables."""
    matrix = np.eye(n_dims)
    matrix[1:, 1:] = np.linalg.qr(rng.normal(size=(n_dims - 1, n_dims - 1)))[0]
    return TaskFrame(matrix, np.concatenate([[0.0], rng.normal(size=n_dims - 1)]))


def measure(
    seconds: float, demonstrations: int, frames: int, components: int, dimensions: int
) -> tuple[Cost, Cost]:
    """Costs of learning and of a plan."""
    rng, stamps = np.random.default_rng(0), np.linspace(0.0, 1.0, N_STEPS)
    phases, rates = rng.uniform(0.0, 6.0, dimensions - 1), rng.uniform(2.0, 7.0, dimensions - 1)
    shifts = rng.normal(0.0, 0.2, (demonstrations, 1, dimensions - 1))
    motions = np.sin(rates * stamps[:, None] + phases + shifts) + rng.normal(
        0.0, 0.01, (demonstrations, N_STEPS, dimensions - 1)
    )
    shown = [np.column_stack([stamps, motion]) for motion in motions]
    seen_from = [[frame(dimensions, rng) for _ in range(frames)] for _ in shown]

    def learn() -> DSGMR:
        return DSGMR(components, tolerance=0.0, max_iterations=N_ITERATIONS).fit(shown, seen_from)

    model, situation, start = (
        learn(),
        [frame(dimensions, rng) for _ in range(frames)],
        motions[0, 0],
    )
    return cost_of(learn, seconds), cost_of(
        lambda: model.reproduce(situation, stamps, start, np.zeros(dimensions - 1)), seconds
    )


def draw(found: dict[str, list[tuple[int, Cost, Cost]]], file: str) -> None:
    """Curves of time and memory by each number, both axes logarithmic."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 5.2), layout="constrained")
    axes = figure.subplots(2, len(found), sharey="row", sharex="col")
    for column, (name, rows) in zip(axes.T, found.items(), strict=True):
        numbers = [number for number, *_ in rows]
        for kind, index, marker in (("learning", 1, "o"), ("a plan", 2, "s")):
            column[0].loglog(
                numbers, [1e3 * row[index].seconds for row in rows], marker=marker, label=kind
            )
            column[1].loglog(
                numbers, [1e-6 * row[index].size for row in rows], marker=marker, label=kind
            )
        column[1].set_xlabel(name)
        ticks = numbers if len(numbers) < 8 else numbers[::2]
        column[1].set_xticks(ticks, [str(tick) for tick in ticks])
        column[1].minorticks_off()
    axes[0, 0].set_ylabel("processor time [ms]")
    axes[1, 0].set_ylabel("memory [MB]")
    axes[0, 0].legend(frameon=False)
    for one in axes.ravel():
        one.grid(alpha=0.3)
    FigureCanvasSVG(figure).print_svg(file, metadata={"Date": None, "Creator": "dart_skill"})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picture", metavar="FILE", help="draw the curves into an SVG file, too")
    parser.add_argument(
        "--largest",
        type=int,
        default=2000,
        help="leave out larger numbers of demonstrations (default 2000)",
    )
    parser.add_argument(
        "--seconds",
        type=float,
        default=0.3,
        help="for which each cost is measured at least (default 0.3)",
    )
    options, found = parser.parse_args(), {}
    print(f"{'':<22}{'learning':>12}{'':>12}{'a plan':>12}")
    for name, numbers in GROWN.items():
        found[name] = []
        for number in numbers:
            if name == "demonstrations" and number > options.largest:
                continue
            learning, plan = measure(options.seconds, **{**USUAL, name: number})
            found[name].append((number, learning, plan))
            costs = "".join(
                f"{1e3 * one.seconds:>9.2f} ms{1e-6 * one.size:>9.2f} MB"
                for one in (learning, plan)
            )
            print(f"{number:>5} {name:<16}{costs}", flush=True)
    if options.picture:
        draw(found, options.picture)


if __name__ == "__main__":
    main()
