"""`dart-skill experiment darts`: the arm throws darts, sees where they go, and gets better at it."""

from __future__ import annotations

import argparse
import json

from dart_skill.cli.run_options import add_configuration, folder
from dart_skill.common.constants import BULL_DISTANCE, BULL_HEIGHT

DEFAULT_BOARD = f"{BULL_DISTANCE},{BULL_HEIGHT}"


def add_to(experiments: argparse._SubParsersAction) -> None:
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
        help="seeds 0 to N - 1 instead, as a table with a line for each",
    )
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
    add_configuration(parser, "default")
    parser.add_argument(
        "--output", type=folder, metavar="FOLDER", help="write the figure there, as SVG and PNG"
    )
    parser.add_argument(
        "--json", action="store_true", help="every throw as JSON instead of the table"
    )
    parser.set_defaults(run=_arm_darts)


def _arm_darts(options: argparse.Namespace) -> int:
    from tqdm import tqdm

    if options.seeds is not None:
        return _over_seeds(options)
    from dart_skill.experiments import arm_darts
    from dart_skill.figures import draw_arm_darts
    from dart_skill.simulation import Board

    distance, height = _board(options.board)
    with tqdm(total=options.throws, unit="throw", disable=None) as progress:
        board, of_the_run = (
            Board((distance, 0.0, height)),
            (options.seed, options.throws, options.demonstrations, options.practice),
        )
        run = arm_darts.run(
            *of_the_run, board, each=lambda n, dart: progress.update(), name=options.configuration
        )
    paths = [] if options.output is None else draw_arm_darts(run, options.output)
    if options.json:
        print(json.dumps({**run.to_json(), "figure": [str(path) for path in paths]}, indent=1))
    else:
        print("\n".join([run.table(), *(f"figure: {path}" for path in paths)]))
    return 0


def _over_seeds(options: argparse.Namespace) -> int:
    from dart_skill.experiments import arm_darts

    if options.seeds < 1 or options.board != DEFAULT_BOARD or options.output is not None:
        raise ValueError(
            f"--seeds is {options.seeds}: give at least 1, and neither --board nor --output, which"
            " are for one seed"
        )
    how = (options.throws, options.demonstrations, options.practice, options.configuration)
    runs = arm_darts.over_seeds(range(options.seeds), options.jobs, *how)
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
