"""`dart-skill experiment basket`: where does the arm hit after a few demonstrations, and what does
the way it learns have to do with it?
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from dart_skill.cli.run_options import positive


def add_to(experiments: argparse._SubParsersAction) -> None:
    """Add `basket` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "basket", help="no practice, baskets all around, several ways to learn: a table, and maps"
    )
    parser.add_argument(
        "--models",
        default="default",
        metavar="NAMES",
        help="configurations, separated by commas (default: default)",
    )
    parser.add_argument(
        "--demonstrations",
        default="13",
        metavar="N",
        help="how many are shown; several numbers with commas (default 13)",
    )
    parser.add_argument(
        "--throws", type=positive, default=40, help="baskets per seed and model (default 40)"
    )
    parser.add_argument("--seeds", type=positive, default=20, help="seeds 0 to N - 1 (default 20)")
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
    parser.add_argument(
        "--figure",
        metavar="FOLDER",
        type=Path,
        help="write a map per model, and the curve over several numbers, there",
    )
    parser.add_argument("--json", action="store_true", help="the table as JSON")
    parser.set_defaults(run=_basket)


def _basket(options: argparse.Namespace) -> int:
    from dart_skill.experiments.basket import Task, run_all, summarise, table

    models = tuple(options.models.split(","))
    numbers = [int(number) for number in options.demonstrations.split(",")]
    tasks = [
        Task(seed, models, number, options.throws)
        for number in numbers
        for seed in range(options.seeds)
    ]
    results = run_all(tasks, options.results, options.jobs, options.scheduler)
    print(json.dumps(summarise(results), indent=1) if options.json else table(results))
    if options.figure:
        from dart_skill.experiments.pictures.maps import draw_basket

        print(*draw_basket(results, options.figure), sep="\n", file=sys.stderr)
    return 0
