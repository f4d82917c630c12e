"""`dart-skill experiment` about darts: `darts` by the arm, and `search` and `landscapes`, where to
aim while rewards change.
"""

from __future__ import annotations

import argparse
import json

from dart_skill.cli.experiment._options import add_arm, add_batch, add_first_seed, add_json
from dart_skill.cli.run_options import add_configuration, folder
from dart_skill.common.constants import BULL_DISTANCE, BULL_HEIGHT

DEFAULT_BOARD = f"{BULL_DISTANCE},{BULL_HEIGHT}"
METHODS = (
    "power,power_constant,power_proportional,cem,cma,cma_default,reinforce,enac,mixture,mixture_daspec,mixture_automatic,restarts,"
    "monte_carlo,niches"
)
"""Searches that `landscapes` tries."""


def add_darts(experiments: argparse._SubParsersAction) -> None:
    """Add `darts` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "darts",
        help="darts by the arm: spread, aim and score over many throws, as a table and a figure",
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--seeds",
        type=int,
        metavar="N",
        help="so many seeds instead, as a table with a line for each",
    )
    add_first_seed(parser)
    add_arm(parser)
    parser.add_argument(
        "--jobs", type=int, default=1, help="processes at a time for several seeds (default 1)"
    )
    parser.add_argument("--throws", type=int, default=300, help="own throws (default 300)")
    parser.add_argument(
        "--demonstrations", type=int, default=8, help="darts that the teacher shows (default 8)"
    )
    learned = (
        "what is learned from own throws: which misses repeat, or that and when to let go (default"
        " both)"
    )
    parser.add_argument(
        "--practice", choices=("both", "misses", "none"), default="both", help=learned
    )
    bull = f"of the bull [m] (default {DEFAULT_BOARD}: regulation)"
    parser.add_argument("--board", default=DEFAULT_BOARD, metavar="DISTANCE,HEIGHT", help=bull)
    parser.add_argument(
        "--again",
        type=int,
        default=0,
        metavar="N",
        help="darts of one plan, before and after: what their scatter allows (default 0)",
    )
    add_configuration(parser, "default")
    parser.add_argument(
        "--output", type=folder, metavar="FOLDER", help="write the figure there, as SVG and PNG"
    )
    add_json(parser, "every throw as JSON instead of the table")
    parser.set_defaults(run=_arm_darts)


def _arm_darts(options: argparse.Namespace) -> int:
    from tqdm import tqdm

    if options.seeds is not None:
        return _over_seeds(options)
    from dart_skill.experiments.studies import arm_darts
    from dart_skill.figures import arm_darts_figure, save
    from dart_skill.simulation import Board

    distance, height = _board(options.board)
    with tqdm(total=options.throws, unit="throw", disable=None) as progress:
        board, of_the_run = (
            Board((distance, 0.0, height)),
            (options.seed, options.throws, options.demonstrations, options.practice),
        )
        run = arm_darts.run(
            *of_the_run,
            board,
            each=lambda n, dart: progress.update(),
            name=options.configuration,
            arm=options.arm,
            again=options.again,
        )
    paths = (
        [] if options.output is None else save(arm_darts_figure(run), options.output, "arm_darts")
    )
    if options.json:
        print(json.dumps({**run.to_json(), "figure": [str(path) for path in paths]}, indent=1))
    else:
        print("\n".join([run.table(), *(f"figure: {path}" for path in paths)]))
    return 0


def _over_seeds(options: argparse.Namespace) -> int:
    from dart_skill.experiments.parallel import all_of
    from dart_skill.experiments.studies import arm_darts

    if options.seeds < 1 or options.board != DEFAULT_BOARD or options.output is not None:
        raise ValueError(
            f"--seeds is {options.seeds}: give at least 1, and neither --board nor --output, which"
            " are for one seed"
        )
    runs = all_of(
        arm_darts.run_seed,
        range(options.first_seed, options.first_seed + options.seeds),
        options.jobs,
        throws=options.throws,
        demonstrations=options.demonstrations,
        practice=options.practice,
        name=options.configuration,
        arm=options.arm,
        again=options.again,
    )
    print(
        json.dumps([one.to_json() for one in runs], indent=1)
        if options.json
        else arm_darts.table_of_seeds(runs)
    )
    return 0


def _board(text: str) -> tuple[float, float]:
    try:
        distance, height = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(
            f"--board is '{text}': give the distance and the height of the bull in metres, such as"
            f" {DEFAULT_BOARD}"
        ) from None
    return distance, height


def add_search(verbs: argparse._SubParsersAction) -> None:
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
    _add_runs(parser, "mixture,power,cem")


def _add_runs(parser: argparse.ArgumentParser, methods: str) -> None:
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
    add_batch(parser)
    add_json(parser)
    parser.set_defaults(run=_search)


def _search(options: argparse.Namespace) -> int:
    from dart_skill.experiments.parallel import run_tasks
    from dart_skill.experiments.studies import dart_search

    if options.seeds < 1:
        raise ValueError(f"--seeds is {options.seeds}: give at least 1")
    named = options.schedules.split(",")
    schedules = dart_search.LANDSCAPES if options.schedules == "all" else named
    tasks = [
        dart_search.search_task(method, schedule, seed, options.reward, options.stop_after)
        for schedule in schedules
        for method in options.methods.split(",")
        for seed in range(options.seeds)
    ]
    runs = run_tasks(dart_search.run, tasks, options.results, options.jobs, options.scheduler)
    rows = dart_search.summarise(runs)
    print(json.dumps(rows, indent=1) if options.json else dart_search.table_of(rows))
    return 0


def add_landscapes(experiments: argparse._SubParsersAction) -> None:
    """Add `landscapes` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "landscapes",
        help="the same searches on other landscapes that change, as a table of regrets",
    )
    parser.add_argument(
        "--landscapes",
        dest="schedules",
        metavar="NAMES",
        default="all",
        help=(
            "separated by commas (default all): moving_peaks_2, moving_peaks_5, vanishing_peak,"
            " half_range, stuck_joint"
        ),
    )
    parser.set_defaults(reward="expected")
    _add_runs(parser, METHODS)
