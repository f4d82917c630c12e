#!/usr/bin/env python3
"""What a person waits for: learning from a bag of demonstrations, a plan of a throw, and commands
that only say something.

    python3 -m benchmarks.skill.lessons

One thread. Median processor time of learning and planning, with the demonstrations in memory; of
commands, that of a process of its own, the least of some. These have no peer: what is asked are
milliseconds.

What was prepared is kept with its demonstration, and what a plan needs of the model alone with the
model. So a lesson from 13 demonstrations gets new ones each time, one after one more demonstration
a new one beside 12 that have been learned from, and the first plan of a model a new model. Plans
go to another target each.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse  # noqa: E402
import resource  # noqa: E402
import statistics  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
import tempfile  # noqa: E402
import time  # noqa: E402
from collections.abc import Callable, Iterator  # noqa: E402
from dataclasses import replace  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402

from benchmarks.rows import tell  # noqa: E402
from dart_skill.recording import Demonstration, read_demonstrations  # noqa: E402
from dart_skill.skills.learning import configuration, learn_throwing  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
DEMONSTRATIONS = ROOT / "bags" / "demonstrations"
ASKED_MS = {
    "lesson from 13 demonstrations": 40.0,
    "lesson after one more demonstration": 40.0,
    "the same with intervals": 40.0,
    "first plan of a model": 3.0,
    "plan of a throw": 3.0,
    "a plan with intervals": 3.0,
    "dart-skill --help": 150.0,
    "TAB after dart-skill": 150.0,
    "dart-skill bag info": 150.0,
}


def median_ms(task: Callable, repeats: int, make: Callable) -> float:
    """Median processor time of a task, which is done once before, with what is made for it each
    time beforehand.
    """
    task(make())
    taken = []
    for _ in range(repeats):
        given = make()
        begin = time.process_time()
        task(given)
        taken.append(time.process_time() - begin)
    return 1e3 * statistics.median(taken)


def command_ms(arguments: list[str], repeats: int, **environment: str) -> float:
    """Least processor time of the command dart-skill, which is run once before; it must not fail."""
    taken, kept = (
        [],
        {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"},
    )
    for _ in range(repeats + 1):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, "-m", "dart_skill.cli", *arguments]
        subprocess.run(
            command, env=kept | environment, stdout=subprocess.DEVNULL, check=True, close_fds=False
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        taken.append(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)
    return 1e3 * min(taken[1:])


def tab_ms(repeats: int) -> float:
    """The same of completion, whose answer goes to a file."""
    with tempfile.TemporaryDirectory() as folder:
        asked = {
            "_ARGCOMPLETE": "1",
            "_ARGCOMPLETE_STDOUT_FILENAME": str(Path(folder) / "answer"),
            "COMP_LINE": "dart-skill ",
            "COMP_POINT": "11",
        }
        return command_ms([], repeats, **asked)


def targets(demonstrations: list[Demonstration]) -> Iterator[np.ndarray]:
    """Targets (3,) [m] one after the other, in the region of those that were shown."""
    shown, rng = np.array([one.target for one in demonstrations]), np.random.default_rng(0)
    reach, azimuth = np.hypot(shown[:, 0], shown[:, 1]), np.arctan2(shown[:, 1], shown[:, 0])
    while True:
        far, turned = (
            rng.uniform(reach.min(), reach.max()),
            rng.uniform(azimuth.min(), azimuth.max()),
        )
        yield np.array([far * np.cos(turned), far * np.sin(turned), shown[0, 2]])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=10, help="repeats per task (default 10)")
    parser.add_argument(
        "--rows", default="", help="only rows whose name holds this (default: all)"
    )
    options = parser.parse_args()
    demonstrations = list(read_demonstrations(DEMONSTRATIONS))
    skill, plainest = learn_throwing(demonstrations), configuration("intervals")
    other, target = learn_throwing(demonstrations, plainest), targets(demonstrations).__next__

    def new() -> list[Demonstration]:
        return [replace(one) for one in demonstrations]

    def one_new() -> list[Demonstration]:
        return [*demonstrations[:-1], replace(demonstrations[-1])]

    works: dict[str, Callable[[], float]] = {
        "lesson from 13 demonstrations": lambda: median_ms(learn_throwing, options.repeats, new),
        "lesson after one more demonstration": lambda: median_ms(
            learn_throwing, options.repeats, one_new
        ),
        "the same with intervals": lambda: median_ms(
            lambda shown: learn_throwing(shown, plainest), options.repeats, one_new
        ),
        "first plan of a model": lambda: median_ms(
            lambda one: one.plan(target()), options.repeats, lambda: learn_throwing(demonstrations)
        ),
        "plan of a throw": lambda: median_ms(skill.plan, 5 * options.repeats, target),
        "a plan with intervals": lambda: median_ms(other.plan, 5 * options.repeats, target),
        "dart-skill --help": lambda: command_ms(["--help"], options.repeats),
        "TAB after dart-skill": lambda: tab_ms(options.repeats),
        "dart-skill bag info": lambda: command_ms(
            ["bag", "info", str(DEMONSTRATIONS)], options.repeats
        ),
    }
    for name, work in ((name, work) for name, work in works.items() if options.rows in name):
        taken = work()
        met = taken <= ASKED_MS[name]
        print(
            f"{name:<36}{taken:>9.1f} ms   asked {ASKED_MS[name]:g} ms{'' if met else ', missed'}",
            flush=True,
        )
        tell(name, f"{taken:.1f} ms", asked=f"{ASKED_MS[name]:g} ms", met=met)


if __name__ == "__main__":
    main()
