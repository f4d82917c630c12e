#!/usr/bin/env python3
"""What a person waits for: learning from a bag of demonstrations, a plan of a throw, and commands that only say something.

    python3 benchmarks/skill/lessons.py

One thread. Median processor time of learning and planning, with the demonstrations in memory; of commands, that of a process of its own,
the least of some. These have no peer: what is asked are milliseconds.
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
from collections.abc import Callable  # noqa: E402
from pathlib import Path  # noqa: E402

from dart_skill.recording import read_demonstrations  # noqa: E402
from dart_skill.skill.learn import configuration, learn  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
DEMONSTRATIONS, THROWS = ROOT / "bags" / "demonstrations", ROOT / "bags" / "throws"
ASKED_MS = {
    "lesson from 13 demonstrations": 40.0,
    "the same with intervals": 40.0,
    "plan of a throw": 3.0,
    "a plan with intervals": 3.0,
    "dart-skill --help": 150.0,
    "TAB after dart-skill": 150.0,
    "dart-skill bag info": 150.0,
    "dart-skill report of 20 throws": 1500.0,
}


def median_ms(task: Callable, repeats: int) -> float:
    """Median processor time of a task, which is done once before."""
    task()
    taken = []
    for _ in range(repeats):
        begin = time.process_time()
        task()
        taken.append(time.process_time() - begin)
    return 1e3 * statistics.median(taken)


def command_ms(arguments: list[str], repeats: int, **environment: str) -> float:
    """Least processor time of the command dart-skill, which is run once before; it must not fail. {} in an argument counts the runs."""
    taken, kept = [], {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    for run in range(repeats + 1):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, "-m", "dart_skill.cli", *(argument.format(run) for argument in arguments)]
        subprocess.run(command, env=kept | environment, stdout=subprocess.DEVNULL, check=True, close_fds=False)
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


def report_ms(repeats: int) -> float:
    with tempfile.TemporaryDirectory() as folder:
        return command_ms(["report", str(THROWS), "--output", str(Path(folder) / "{}.html")], repeats)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=10, help="repeats per task (default 10)")
    parser.add_argument("--rows", default="", help="only rows whose name holds this (default: all)")
    options = parser.parse_args()
    demonstrations = list(read_demonstrations(DEMONSTRATIONS))
    skill, target, plainest = learn(demonstrations), demonstrations[0].target, configuration("intervals")
    other = learn(demonstrations, plainest)
    works: dict[str, Callable[[], float]] = {
        "lesson from 13 demonstrations": lambda: median_ms(lambda: learn(demonstrations), options.repeats),
        "the same with intervals": lambda: median_ms(lambda: learn(demonstrations, plainest), options.repeats),
        "plan of a throw": lambda: median_ms(lambda: skill.plan(target), 5 * options.repeats),
        "a plan with intervals": lambda: median_ms(lambda: other.plan(target), 5 * options.repeats),
        "dart-skill --help": lambda: command_ms(["--help"], options.repeats),
        "TAB after dart-skill": lambda: tab_ms(options.repeats),
        "dart-skill bag info": lambda: command_ms(["bag", "info", str(DEMONSTRATIONS)], options.repeats),
        "dart-skill report of 20 throws": lambda: report_ms(1),
    }
    for name, work in ((name, work) for name, work in works.items() if options.rows in name):
        taken = work()
        print(f"{name:<36}{taken:>9.1f} ms   asked {ASKED_MS[name]:g} ms{'' if taken <= ASKED_MS[name] else ', missed'}", flush=True)


if __name__ == "__main__":
    main()
