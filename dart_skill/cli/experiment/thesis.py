"""`dart-skill experiment figure`, a figure of the thesis; `real_data`, published demonstrations of
people; `rivals`, learners of few demonstrations beside each other.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from dart_skill.cli.experiment._options import add_jobs, add_json, show
from dart_skill.cli.run_options import folder, positive


def add_figure(experiments: argparse._SubParsersAction) -> None:
    """Add `figure` to the experiments of `dart-skill experiment`."""
    figure = experiments.add_parser("figure", help="a figure of the thesis, computed anew")
    figure.add_argument(
        "number",
        nargs="?",
        default="list",
        help="3.1, 7.1, ..., regrets; 'all' draws every one; without one: which there are",
    )
    figure.add_argument(
        "--output",
        type=folder,
        default="figures",
        metavar="FOLDER",
        help="where SVG and PNG go (default: figures)",
    )
    figure.add_argument("--seed", type=int, default=0)
    figure.add_argument(
        "--teachers",
        type=positive,
        metavar="N",
        help="of 8.4.4 alone: how many simulated teachers (default 2)",
    )
    add_json(figure, "seed, paths and what was measured as JSON")
    figure.set_defaults(run=_figure)


def _figure(options: argparse.Namespace) -> int:
    from dart_skill.experiments import thesis

    if options.number == "list":
        titles = thesis.titles()
        print(
            json.dumps(titles, indent=1)
            if options.json
            else "\n".join(f"{number}  {title}" for number, title in titles.items())
        )
        return 0
    drawn, asked = {}, {} if options.teachers is None else {"teachers": options.teachers}
    everything = options.number == "all"
    for number in thesis.FIGURES if everything else [options.number]:
        more = thesis.known_options(number, asked) if everything else asked
        paths, measured = thesis.draw(number, options.output, options.seed, **more)
        drawn[number] = {
            "seed": options.seed,
            "paths": [str(path) for path in paths],
            "measured": measured,
        }
        if not options.json:
            text = thesis.describe(number, measured).replace("\n", "\n  ")
            print(f"figure {number}, seed {options.seed}: {paths[0]}, {paths[1].name}\n  {text}")
    if options.json:
        print(json.dumps(drawn, indent=1))
    return 0


def add_real_data(experiments: argparse._SubParsersAction) -> None:
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
    add_jobs(parser)
    add_json(parser, "every set and method as JSON instead of the table")
    parser.set_defaults(run=_real_data)


def _real_data(options: argparse.Namespace) -> int:
    from dart_skill.experiments.studies import real_data

    scores = real_data.run(
        options.data,
        options.jobs,
        [name for name in options.shapes.split(",") if name],
        options.pbdlib,
    )
    return show(scores, real_data.table, options.json)


def add_rivals(experiments: argparse._SubParsersAction) -> None:
    """Add `rivals` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "rivals", help="learners of few demonstrations, ours and others, on real and own ones"
    )
    parser.add_argument(
        "--data",
        type=Path,
        metavar="FOLDER",
        help="published sets, as of real_data, and those of lpvds and robInfLib-matlab",
    )
    parser.add_argument(
        "--bag",
        type=Path,
        action="append",
        default=[],
        metavar="BAG",
        help="its demonstrations are a set; may be given several times",
    )
    parser.add_argument(
        "--simulated",
        type=int,
        default=0,
        metavar="N",
        help="so many simulated demonstrations of place are a set (default 0)",
    )
    parser.add_argument(
        "--shown",
        type=_counts,
        default="2,5,10,13",
        metavar="NUMBERS",
        help="how many demonstrations are learned from (default 2,5,10,13)",
    )
    parser.add_argument(
        "--draws",
        type=positive,
        default=1,
        help="how often they are drawn for each that is left out (default 1)",
    )
    parser.add_argument(
        "--sets",
        metavar="NAMES",
        default="",
        help="only these, separated by commas (default: all there are)",
    )
    parser.add_argument("--seed", type=int, default=0)
    add_jobs(parser)
    add_json(parser, "every prediction as JSON instead of the table")
    parser.set_defaults(run=_rivals)


def _counts(text: str) -> list[int]:
    """Numbers that are separated by commas."""
    return [positive(one) for one in text.split(",")]


def _rivals(options: argparse.Namespace) -> int:
    from dart_skill.experiments.studies import rivals

    predictions = rivals.run(
        options.data,
        options.bag,
        simulated=options.simulated,
        counts=options.shown,
        draws=options.draws,
        names=[name for name in options.sets.split(",") if name],
        jobs=options.jobs,
        seed=options.seed,
    )
    return show(predictions, rivals.table, options.json)
