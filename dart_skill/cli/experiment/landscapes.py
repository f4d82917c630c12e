"""`dart-skill experiment landscapes`: the searches of `search` on other landscapes that change, as
a table of regrets.
"""

from __future__ import annotations

import argparse

from dart_skill.cli.experiment.search import add_runs

METHODS = (
    "power,power_constant,power_proportional,cem,cma,cma_default,reinforce,enac,mixture,mixture_daspec,mixture_automatic,restarts,"
    "monte_carlo,niches"
)


def add_to(experiments: argparse._SubParsersAction) -> None:
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
    add_runs(parser, METHODS)
