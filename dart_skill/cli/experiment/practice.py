"""`dart-skill experiment practice`: does the arm get better with its own throws, and how fast?"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from dart_skill.cli.run_options import add_configuration, positive


def add_to(experiments: argparse._SubParsersAction) -> None:
    """Add `practice` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "practice",
        help="own throws in process, for several seeds and methods, as a table of errors",
    )
    parser.add_argument(
        "--methods",
        default="residual,bootstrap,both,power,none",
        help="separated by commas (default: all)",
    )
    parser.add_argument(
        "--changes",
        default="none",
        help="none, heavier_ball, friction, weaker_motors, slower_hand, base_turned; commas",
    )
    parser.add_argument(
        "--change-after",
        type=int,
        default=0,
        metavar="N",
        help="practised throws before the change (default 0)",
    )
    parser.add_argument(
        "--demonstrations",
        default="13",
        help="how many are shown; several numbers with commas (default 13)",
    )
    parser.add_argument("--throws", type=int, default=50, help="practised throws (default 50)")
    parser.add_argument(
        "--tested-after",
        default="0,1,2,5,10,20,50",
        metavar="NUMBERS",
        help="practised throws after which there is a test",
    )
    parser.add_argument("--tests", type=int, default=10, help="throws of each test (default 10)")
    parser.add_argument(
        "--again",
        type=int,
        default=0,
        metavar="N",
        help="throws of one plan for each basket of the last test: the floor (default none)",
    )
    parser.add_argument("--seeds", type=positive, default=20, help="how many seeds (default 20)")
    parser.add_argument(
        "--first-seed", type=int, default=0, metavar="N", help="the first of them (default 0)"
    )
    parser.add_argument(
        "--arms",
        default="ideal",
        help="an arm of config/fleet.yaml, or fleet: every seed draws its own (default ideal)",
    )
    add_configuration(parser, "default")
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
        help="write error and success against own throws there",
    )
    parser.add_argument(
        "--floor",
        type=float,
        metavar="CM",
        help="median error that `repeatability` leaves: a line in the figure [cm]",
    )
    parser.add_argument("--json", action="store_true", help="the table as JSON")
    parser.set_defaults(run=_practice)


def _practice(options: argparse.Namespace) -> int:
    from dart_skill.common.fleet import arm_named
    from dart_skill.experiments.practice import Task, run_all, summarise, table
    from dart_skill.experiments.throws import arm_of

    tested = tuple(int(number) for number in options.tested_after.split(","))
    if options.again < 0 or options.again == 1:
        raise ValueError(
            f"--again is {options.again}: a scatter takes 2 throws at least, or 0 for none"
        )
    arm_named(arm_of(options.arms, options.first_seed))
    shared = {
        "throws": options.throws,
        "change_after": options.change_after,
        "tested_after": tested,
    }
    shared |= {
        "tests": options.tests,
        "again": options.again,
        "arm": options.arms,
        "configuration": options.configuration or "default",
    }
    tasks = [
        Task(seed, method, int(shown), change=change, **shared)
        for shown in options.demonstrations.split(",")
        for change in options.changes.split(",")
        for method in options.methods.split(",")
        for seed in range(options.first_seed, options.first_seed + options.seeds)
    ]
    results = run_all(tasks, options.results, options.jobs, options.scheduler)
    print(json.dumps(summarise(results), indent=1) if options.json else table(results))
    if options.figure:
        from dart_skill.experiments.pictures.practice import draw_practice

        floor = None if options.floor is None else 0.01 * options.floor
        print(*draw_practice(results, options.figure, floor), sep="\n", file=sys.stderr)
    return 0
