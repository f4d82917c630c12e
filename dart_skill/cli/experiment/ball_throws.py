"""`dart-skill experiment` with throws of the ball: `throws`, `basket`, `practice`, `repeatability`
and `compliance`.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

from dart_skill.cli.experiment._options import (
    add_arms,
    add_batch,
    add_jobs,
    add_json,
    add_scheduler,
    show,
)
from dart_skill.cli.names import PRACTICE_METHODS
from dart_skill.cli.run_options import add_configuration, positive


def add_throws(experiments: argparse._SubParsersAction) -> None:
    """Add `throws` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "throws", help="the main job for several seeds, in process, as a table"
    )
    parser.add_argument("--seeds", type=positive, default=10, help="how many seeds (default 10)")
    add_arms(parser)
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NODE.PARAMETER=VALUE",
        help="a parameter of a node; may be given several times",
    )
    text = (
        "names separated by commas; ladder: from `thesis` to `default`, a change each, and"
        " `default` without each (default: default)"
    )
    parser.add_argument("--configurations", default="default", metavar="NAMES", help=text)
    parser.add_argument("--demonstrations", type=int, default=13)
    parser.add_argument(
        "--throws", type=positive, default=10, help="new baskets per seed (default 10)"
    )
    parser.add_argument(
        "--trajectory",
        type=positive,
        metavar="RATE",
        help="by an arm whose controller takes trajectories and sends so many positions a second",
    )
    parser.add_argument(
        "--lag",
        type=float,
        default=0.0,
        metavar="SECONDS",
        help="with --trajectory: time constant with which the arm follows them (default 0)",
    )
    add_jobs(parser)
    add_scheduler(parser)
    parser.add_argument(
        "--best-possible",
        action="store_true",
        help="also the share that any plan could get in, with the scatter of this arm's fingers",
    )
    add_json(parser, "as JSON: thrown, in, median_error_m, p90_error_m, and every throw")
    parser.set_defaults(run=_throws)


def _throws(options: argparse.Namespace) -> int:
    from dart_skill.common.fleet import arm_with, skill_settings
    from dart_skill.experiments.parallel import all_of
    from dart_skill.experiments.studies import throws
    from dart_skill.simulation import ControllerSettings
    from dart_skill.skills.learning import LADDER, configuration

    asked = options.configurations.replace("ladder", ",".join(("thesis", *LADDER)))
    names = tuple(configuration(name).name for name in asked.split(","))
    arm_with(throws.arm_of(options.arms, options.first_seed), options.set)
    if skill_settings(options.set):
        raise ValueError("--set skill.NAME is for a demo or a graph: give --configurations here")
    settings = tuple(options.set)
    rate = options.trajectory
    controller = None if rate is None else ControllerSettings(float(rate), options.lag)
    results = all_of(
        throws.run_seed,
        range(options.first_seed, options.first_seed + options.seeds),
        options.jobs,
        options.scheduler,
        names=names,
        demonstrations=options.demonstrations,
        throws=options.throws,
        arms=options.arms,
        settings=settings,
        controller=controller,
    )
    best = throws.best_possible(results, settings) if options.best_possible else None
    if options.json:
        rows = [
            {k: None if v != v else v for k, v in asdict(result).items()} for result in results
        ]
        said = {} if best is None else {"best_possible": best}
        print(
            json.dumps(
                {
                    **throws.summary(results),
                    **said,
                    "summary": throws.summarise(results),
                    "throws": rows,
                },
                indent=1,
            )
        )
    else:
        print(throws.table(results))
        if best is not None:
            print(f"of all plans that let go there, the best would get {100 * best:.1f} % in")
    return 0


def add_basket(experiments: argparse._SubParsersAction) -> None:
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
    add_batch(parser)
    parser.add_argument(
        "--figure",
        metavar="FOLDER",
        type=Path,
        help="write a map per model there",
    )
    add_json(parser)
    parser.set_defaults(run=_basket)


def _basket(options: argparse.Namespace) -> int:
    from dart_skill.experiments.parallel import run_tasks
    from dart_skill.experiments.studies import basket

    tasks = [
        basket.basket_task(seed, options.models.split(","), int(number), options.throws)
        for number in options.demonstrations.split(",")
        for seed in range(options.seeds)
    ]
    results = run_tasks(basket.run, tasks, options.results, options.jobs, options.scheduler)
    print(
        json.dumps(basket.summarise(results), indent=1) if options.json else basket.table(results)
    )
    for kind in basket.kinds_of(results) if options.figure else ():
        print(*basket.draw_map(results, *kind, options.figure), sep="\n", file=sys.stderr)
    return 0


def add_practice(experiments: argparse._SubParsersAction) -> None:
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
    add_arms(parser)
    add_configuration(parser, "default")
    add_batch(parser)
    add_json(parser)
    parser.set_defaults(run=_practice)


def _practice(options: argparse.Namespace) -> int:
    from dart_skill.common.fleet import arm_named
    from dart_skill.experiments.parallel import run_tasks
    from dart_skill.experiments.studies import practice
    from dart_skill.experiments.studies.throws import arm_of

    if options.again < 0 or options.again == 1:
        raise ValueError(
            f"--again is {options.again}: a scatter takes 2 throws at least, or 0 for none"
        )
    arm_named(arm_of(options.arms, options.first_seed))
    shared = {
        "throws": options.throws,
        "change_after": options.change_after,
        "tested_after": [int(number) for number in options.tested_after.split(",")],
        "tests": options.tests,
        "again": options.again,
        "arm": options.arms,
        "configuration": options.configuration or "default",
    }
    tasks = [
        practice.practice_task(
            seed, method=method, demonstrations=int(shown), change=change, **shared
        )
        for shown in options.demonstrations.split(",")
        for change in options.changes.split(",")
        for method in options.methods.split(",")
        for seed in range(options.first_seed, options.first_seed + options.seeds)
    ]
    results = run_tasks(practice.run, tasks, options.results, options.jobs, options.scheduler)
    print(
        json.dumps(practice.summarise(results), indent=1)
        if options.json
        else practice.table(results)
    )
    return 0


def add_attempts(experiments: argparse._SubParsersAction) -> None:
    """Add `attempts` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "attempts", help="throws at one basket again and again, for several methods of practice"
    )
    parser.add_argument(
        "--methods",
        default=",".join(PRACTICE_METHODS),
        help="separated by commas (default: all)",
    )
    parser.add_argument(
        "--demonstrations", type=positive, default=13, help="how many are shown (default 13)"
    )
    parser.add_argument(
        "--baskets", type=positive, default=3, help="thrown at by each method (default 3)"
    )
    parser.add_argument(
        "--attempts", type=positive, default=6, help="throws at each basket (default 6)"
    )
    parser.add_argument(
        "--within",
        type=float,
        default=0.03,
        metavar="METRES",
        help="so near a throw is near enough (default 0.03)",
    )
    parser.add_argument("--seeds", type=positive, default=20, help="how many seeds (default 20)")
    add_arms(parser)
    add_configuration(parser, "default")
    add_batch(parser)
    add_json(parser)
    parser.set_defaults(run=_attempts)


def _attempts(options: argparse.Namespace) -> int:
    from dart_skill.common.fleet import arm_named
    from dart_skill.experiments.parallel import run_tasks
    from dart_skill.experiments.studies import attempts
    from dart_skill.experiments.studies.throws import arm_of

    arm_named(arm_of(options.arms, options.first_seed))
    shared = {
        "methods": options.methods.split(","),
        "demonstrations": options.demonstrations,
        "baskets": options.baskets,
        "attempts": options.attempts,
        "arm": options.arms,
        "configuration": options.configuration or "default",
    }
    tasks = [
        attempts.attempts_task(seed, **shared)
        for seed in range(options.first_seed, options.first_seed + options.seeds)
    ]
    results = run_tasks(attempts.run, tasks, options.results, options.jobs, options.scheduler)
    print(
        json.dumps(attempts.summarise(results, options.within), indent=1)
        if options.json
        else attempts.table(results, options.within)
    )
    return 0


def add_repeatability(experiments: argparse._SubParsersAction) -> None:
    """Add `repeatability` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "repeatability", help="one plan thrown again and again: the floor of the error"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--throws", type=positive, default=25, help="of each plan (default 25)")
    parser.add_argument(
        "--demonstrations",
        type=int,
        default=13,
        help="that the plans are learned from (default 13)",
    )
    add_configuration(parser, "default")
    add_json(parser, "JSON instead of the table")
    parser.set_defaults(run=_repeatability)


def _repeatability(options: argparse.Namespace) -> int:
    from dart_skill.experiments.studies import throws

    rows = throws.repeatability(
        options.seed,
        [1.6, 2.0, 2.4],
        options.throws,
        options.demonstrations,
        options.configuration,
    )
    print(json.dumps(rows, indent=1) if options.json else throws.repeatability_table(rows))
    return 0


def add_compliance(experiments: argparse._SubParsersAction) -> None:
    """Add `compliance` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "compliance",
        help="force on a person who grabs the hand, and error, by the stiffness of plans",
    )
    parser.add_argument("--seeds", type=positive, default=5, help="seeds 0 to N - 1 (default 5)")
    parser.add_argument(
        "--demonstrations",
        type=int,
        default=13,
        help="that the plans are learned from (default 13)",
    )
    parser.add_argument(
        "--throws", type=positive, default=5, help="of each kind and seed (default 5)"
    )
    add_configuration(parser, "default")
    add_jobs(parser)
    add_json(parser, "every throw as JSON instead of the table")
    parser.set_defaults(run=_compliance)


def _compliance(options: argparse.Namespace) -> int:
    from dart_skill.experiments.parallel import all_of
    from dart_skill.experiments.studies import compliance

    swings = all_of(
        compliance.run_seed,
        range(options.seeds),
        options.jobs,
        demonstrations=options.demonstrations,
        throws=options.throws,
        name=options.configuration,
    )
    return show(swings, compliance.table, options.json)
