"""`dart-skill experiment reach`: reaches into cups on belts that were not shown."""

from __future__ import annotations

import argparse

from dart_skill.cli.experiment._pose_skill_options import add_options, show


def add_to(experiments: argparse._SubParsersAction) -> None:
    """Add `reach` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "reach", help="reach into cups on belts that were not shown, also while the hand is held"
    )
    add_options(parser, "cups", "reach")
    parser.add_argument(
        "--held",
        type=int,
        default=3,
        help="of the cups again with a hand that is held for a second (default 3)",
    )
    parser.set_defaults(run=_reach)


def _reach(options: argparse.Namespace) -> int:
    from dart_skill.experiments import reach

    seeds = list(range(options.seeds))
    reached = reach.run(
        seeds,
        options.jobs,
        options.demonstrations,
        options.cups,
        options.held,
        options.arm,
        options.partition,
    )
    show(reached, reach.table, options.json)
    return 0
