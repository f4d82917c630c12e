"""`dart-skill experiment real_data`: published demonstrations of people, reproduced and
generalised.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path


def add_to(experiments: argparse._SubParsersAction) -> None:
    """Add `real_data` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "real_data",
        help=(
            "published demonstrations of people: reproduced, and from starts and in frames not"
            " seen"
        ),
    )
    parser.add_argument(
        "--data",
        type=Path,
        required=True,
        metavar="FOLDER",
        help=(
            "with DataSet/*.mat of LASA handwriting, datasets of clfd, pbdlib/data of"
            " pbdlib-python, or data of TP-GMM"
        ),
    )
    parser.add_argument(
        "--pbdlib",
        type=Path,
        metavar="FOLDER",
        help="checkout of pbdlib-python for Python 3: a peer in task frames",
    )
    parser.add_argument(
        "--shapes",
        metavar="NAMES",
        default="",
        help="only these, separated by commas (default: all in the folder)",
    )
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time (default 1)")
    parser.add_argument(
        "--json", action="store_true", help="every set and method as JSON instead of the table"
    )
    parser.set_defaults(run=_real_data)


def _real_data(options: argparse.Namespace) -> int:
    from dart_skill.experiments import real_data

    scores = real_data.run(
        options.data,
        options.jobs,
        [name for name in options.shapes.split(",") if name],
        options.pbdlib,
    )
    print(
        json.dumps([asdict(one) for one in scores], indent=1)
        if options.json
        else real_data.table(scores)
    )
    return 0
