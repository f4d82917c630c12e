#!/usr/bin/env python3
"""Whole commands that a person waits for, by the clock: the report of a bag, a demo to its end,
and a leg of 501 solved for any thrower.

    python3 -m benchmarks.skill.waits

These have no peer: what is asked are seconds, on two idle cores. A report is the median of some
runs after a first one, a demo one run, a leg the slowest of its spreads and objectives in
processor time.
"""

import argparse
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.rows import tell
from dart_skill.darts import solve_leg

THROWS = Path(__file__).parents[2] / "bags" / "throws"
SPREADS = (6.0, 10.0, 16.0, 30.0, 60.0, 100.0)
"""Standard deviations of throwers [mm]."""
ASKED = {"report": 1.5, "demo": 25.0, "first throw of a demo": 12.0, "501": 0.5}
"""Seconds."""
FIRST_THROW = re.compile(r"throw +1/")


def command(*arguments: str) -> subprocess.Popen:
    """dart-skill with arguments, in an environment in which modules stay compiled."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    whole = [sys.executable, "-m", "dart_skill.cli", *arguments]
    return subprocess.Popen(
        whole, env=kept, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def report_seconds(repeats: int) -> float:
    """From the command to its end; the first run, which may compile modules, does not count."""
    taken = []
    with tempfile.TemporaryDirectory() as folder:
        for run in range(repeats + 1):
            begun = time.monotonic()
            process = command("report", str(THROWS), "--output", str(Path(folder) / f"{run}.html"))
            said = process.communicate()[0]
            if process.returncode:
                raise SystemExit(said)
            taken.append(time.monotonic() - begun)
    return statistics.median(taken[1:])


def demo_seconds() -> tuple[float, float]:
    """From the command to its end, and to the line of its first throw."""
    with tempfile.TemporaryDirectory() as folder:
        begun, first, said = time.monotonic(), float("nan"), []
        process = command("demo", "--output", str(Path(folder) / "demo"))
        for line in process.stdout or ():
            said.append(line)
            if FIRST_THROW.search(line) and first != first:
                first = time.monotonic() - begun
        if process.wait():
            raise SystemExit("".join(said))
        return time.monotonic() - begun, first


def leg_seconds(spreads: Sequence[float] = SPREADS) -> float:
    """The slowest of some legs of 501."""
    taken = []
    for objective in ("darts", "turns"):
        for spread in spreads:
            begun = time.process_time()
            solve_leg(spread, objective=objective)
            taken.append(time.process_time() - begun)
    return max(taken)


def say(what: str, seconds: float) -> None:
    """A row."""
    met = seconds <= ASKED[what]
    print(
        f"{what:<24}{seconds:>7.2f} s   asked {ASKED[what]:g} s{'' if met else ', missed'}",
        flush=True,
    )
    tell(what, f"{seconds:.2f} s", asked=f"{ASKED[what]:g} s", met=met)


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5, help="reports (default 5)")
    parser.add_argument("--only", choices=("report", "demo", "501"), help="one of them")
    parser.add_argument(
        "--spreads", type=float, nargs="+", default=SPREADS, help="of the throwers of 501 [mm]"
    )
    options = parser.parse_args()
    works: dict[str, Callable[[], float]] = {
        "501": lambda: leg_seconds(options.spreads),
        "report": lambda: report_seconds(options.repeats),
    }
    for what, work in works.items():
        if options.only in (None, what):
            say(what, work())
    if options.only in (None, "demo"):
        whole, first = demo_seconds()
        say("demo", whole)
        say("first throw of a demo", first)


if __name__ == "__main__":
    main()
