#!/usr/bin/env python3
"""Experiments on 1 to N cores, and on a Dask cluster of several worker processes: how much of them
is used.

    python3 -m benchmarks.skill.cores

The runs are those of `dart-skill experiment throws`, a seed each: five demonstrations and as many
throws. The efficiency on n processes is T1 / (n Tn), n no larger than the number of cores; times
are by the clock, with the start of the processes and their imports. Where other programs use the
same cores, it says more of them than of this one. `free` is what it would be without them: the
share of the time of all processes in which runs were under way, times the processor time that the
runs take one after the other, divided by what they take side by side. A cluster is there before an
experiment is: its scheduler and workers are started, and each worker carries out a first run, in
which it imports, before the clock is started. `first` is what these first runs take by the clock.
"""

import argparse
import contextlib
import importlib
import json
import os
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = (
        "1"  # before NumPy is imported, here and in the processes that are started
    )

from benchmarks.rows import tell  # noqa: E402
from dart_skill.experiments.parallel import run_all  # noqa: E402
from dart_skill.experiments.studies.throws import ThrowResult, run_seed  # noqa: E402

ASKED = 0.9
CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
CONFIGURATION = "default"


class Run(NamedTuple):
    """One seed: its throws, how long it lasted by the clock, and processor time [s]."""

    throws: list[ThrowResult]
    lasted: float
    used: float


def run(seed: int, throws: int) -> Run:
    """Teach, learn, throw."""
    begun, used = time.monotonic(), time.process_time()
    done = run_seed(seed, (CONFIGURATION,), demonstrations=5, throws=throws)
    return Run(done, time.monotonic() - begun, time.process_time() - used)


@contextlib.contextmanager
def cluster(workers: int) -> Iterator[str]:
    """Address of a scheduler of this machine with so many workers, each of one thread."""
    dask = importlib.import_module("distributed")
    with dask.LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address=None,
    ) as made:
        yield made.scheduler_address


def measure(
    runs: int, throws: int, processes: int, scheduler: str = ""
) -> tuple[float, list[Run]]:
    """Time by the clock [s] of some runs on so many processes or on a cluster, and the runs in the
    order of their seeds.
    """
    begun = time.monotonic()
    found = dict(run_all(partial(run, throws=throws), range(runs), processes, scheduler))
    return time.monotonic() - begun, [found[index] for index in range(runs)]


def report(
    kind: str,
    processes: int,
    clock: float,
    runs: list[Run],
    alone: tuple[float, list[Run]],
    first: float | None = None,
) -> dict:
    """A row, printed and returned; the script ends if the results are others than those of one
    process.
    """
    if [one.throws for one in runs] != [one.throws for one in alone[1]]:
        raise SystemExit(f"{kind} with {processes} processes gives other results than one process")
    used, used_alone = (sum(one.used for one in some) for some in (runs, alone[1]))
    busy = min(processes, CORES)
    efficiency = alone[0] / (busy * clock)
    free = sum(one.lasted for one in runs) / (processes * clock) * used_alone / used
    missed = "" if efficiency >= ASKED else f"   asked: {ASKED:.0%}"
    numbers = f"{clock:8.1f} s{used / len(runs):13.2f} s{efficiency:12.0%}{free:9.0%}"
    before = "" if first is None else f"   first: {first:.1f} s"
    print(f"{kind:<11}{processes:>10}{numbers}{before}{missed}", flush=True)
    if processes > 1 or kind == "--scheduler":
        work, beside = (
            f"efficiency of {processes} processes, {kind}",
            f"one process {alone[0]:.1f} s",
        )
        tell(
            work,
            f"{clock:.1f} s, {efficiency:.0%}",
            beside,
            alone[0] / clock,
            f"{ASKED:.0%}",
            efficiency >= ASKED,
        )
    return {
        "kind": kind,
        "processes": processes,
        "clock": clock,
        "run": used / len(runs),
        "efficiency": efficiency,
        "free": free,
        "first": first,
    }


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=24, help="seeds 0 to N - 1 (default 24)")
    parser.add_argument("--throws", type=int, default=5, help="of each run (default 5)")
    parser.add_argument(
        "--jobs",
        type=int,
        nargs="+",
        default=list(range(1, CORES + 1)),
        metavar="N",
        help="default: 1 to all cores",
    )
    parser.add_argument(
        "--workers",
        type=int,
        nargs="*",
        default=[1, 2, 4],
        metavar="N",
        help="of Dask clusters; none leaves them out",
    )
    parser.add_argument(
        "--results", type=Path, metavar="FILE", help="write the numbers there, as JSON"
    )
    options = parser.parse_args()
    print(f"{CORES} cores, {options.runs} runs, load {os.getloadavg()[0]:.1f}")
    print(
        f"{'':<11}{'processes':>10}{'clock':>10}{'of each run':>15}{'efficiency':>12}{'free':>9}",
        flush=True,
    )
    alone = measure(options.runs, options.throws, 1)
    found = [report("one after another" if 1 not in options.jobs else "--jobs", 1, *alone, alone)]
    for jobs in options.jobs:
        if jobs > 1:
            found.append(
                report("--jobs", jobs, *measure(options.runs, options.throws, jobs), alone)
            )
    for workers in options.workers:
        with cluster(workers) as address:
            first, _ = measure(workers, options.throws, 0, address)
            found.append(
                report(
                    "--scheduler",
                    workers,
                    *measure(options.runs, options.throws, 0, address),
                    alone,
                    first,
                )
            )
    if options.results:
        options.results.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
