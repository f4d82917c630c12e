"""`dart-skill experiment search`, also known as `dart-skill darts search`: where to aim while the
thrower gets better.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path


def add_to(verbs: argparse._SubParsersAction) -> None:
    """Add `search` to the verbs of `dart-skill darts` and `dart-skill experiment`."""
    parser = verbs.add_parser(
        "search",
        help="learn where to aim by throwing while the thrower gets better, as a table of regrets",
    )
    parser.add_argument(
        "--schedules",
        default="thesis",
        help=(
            "separated by commas: thesis (sigma 75 to 16 mm in 3000 throws), extended (to 6),"
            " thesis_12000, extended_12000"
        ),
    )
    parser.add_argument(
        "--reward",
        choices=("expected", "thrown"),
        default="expected",
        help="expected score, or that of the dart thrown",
    )
    add_runs(parser, "mixture,power,cem")


def add_runs(parser: argparse.ArgumentParser, methods: str) -> None:
    """Options of every experiment with searches."""
    parser.add_argument(
        "--methods",
        default=methods,
        help=f"separated by commas (default {methods}); a wrong one is answered with the list",
    )
    parser.add_argument("--seeds", type=int, default=20, help="seeds 0 to N - 1 (default 20)")
    parser.add_argument(
        "--stop-after",
        type=int,
        default=0,
        metavar="N",
        help="trials after which nothing more is learned (default never)",
    )
    parser.add_argument(
        "--jobs", type=int, default=0, help="processes at a time (default one per core)"
    )
    parser.add_argument(
        "--scheduler",
        default="",
        metavar="ADDRESS",
        help="run on the Dask cluster of this scheduler instead",
    )
    parser.add_argument(
        "--results",
        metavar="FILE",
        type=Path,
        help="add each run to this file; what it holds already is not run again",
    )
    parser.add_argument("--json", action="store_true", help="the table as JSON")
    parser.set_defaults(run=_search)


def _search(options: argparse.Namespace) -> int:
    from dart_skill.experiments.dart_search import LANDSCAPES, Task, run_tasks, summarise, table

    if options.seeds < 1:
        raise ValueError(f"--seeds is {options.seeds}: give at least 1")
    schedules = list(LANDSCAPES) if options.schedules == "all" else options.schedules.split(",")
    kinds = [(method, schedule) for schedule in schedules for method in options.methods.split(",")]
    tasks = [
        Task(*kind, seed, options.reward, options.stop_after)
        for kind in kinds
        for seed in range(options.seeds)
    ]
    runs = run_tasks(tasks, options.results, options.jobs, options.scheduler)
    print(json.dumps(summarise(runs), indent=1) if options.json else table(runs))
    return 0
