"""`dart-skill darts search`: learning where to aim by throwing, as a table of regrets."""

from __future__ import annotations

import argparse
import json
from pathlib import Path


def add_search(verbs) -> None:
    """Add `search` to the verbs of `dart-skill darts`."""
    parser = verbs.add_parser("search", help="learn where to aim by throwing while the thrower gets better, as a table of regrets")
    parser.add_argument("--methods", default="mixture,power,cem", help="separated by commas; a wrong one is answered with the list")
    parser.add_argument("--schedules", default="thesis", help="thesis (sigma 75 to 16 mm), extended (to 6), or both with a comma")
    parser.add_argument("--reward", choices=("expected", "thrown"), default="expected", help="expected score, or that of the dart thrown")
    parser.add_argument("--seeds", type=int, default=20, help="seeds 0 to N - 1 (default 20)")
    parser.add_argument("--stop-after", type=int, default=0, metavar="N", help="throws after which nothing more is learned (default never)")
    parser.add_argument("--jobs", type=int, default=0, help="processes at a time (default one per core)")
    parser.add_argument("--scheduler", default="", metavar="ADDRESS", help="run on the Dask cluster of this scheduler instead")
    parser.add_argument("--results", metavar="FILE", type=Path, help="add each run to this file; what it holds already is not run again")
    parser.add_argument("--json", action="store_true", help="the table as JSON")
    parser.set_defaults(run=_search)


def _search(options: argparse.Namespace) -> int:
    from dart_skill.experiments.dart_search import Task, run_tasks, summarise, table

    if options.seeds < 1:
        raise ValueError(f"--seeds is {options.seeds}: give at least 1")
    kinds = [(method, schedule) for method in options.methods.split(",") for schedule in options.schedules.split(",")]
    tasks = [Task(*kind, seed, options.reward, options.stop_after) for kind in kinds for seed in range(options.seeds)]
    runs = run_tasks(tasks, options.results, options.jobs, options.scheduler)
    print(json.dumps(summarise(runs), indent=1) if options.json else table(runs))
    return 0
