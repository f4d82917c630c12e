"""`dart-skill experiment`: what the documentation quotes, repeated; one file an experiment.

Nothing else imports `dart_skill.experiments`.
"""

import argparse

from dart_skill.cli import graph_verbs
from dart_skill.cli.experiment import (
    basket,
    compliance,
    darts,
    figure,
    landscapes,
    place,
    practice,
    reach,
    real_data,
    repeatability,
    search,
    throws,
)

EXPERIMENTS = (
    throws,
    basket,
    practice,
    darts,
    repeatability,
    search,
    landscapes,
    compliance,
    place,
    reach,
    real_data,
    figure,
)


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add `experiment` with all its verbs to the commands of `dart-skill`."""
    parser = commands.add_parser("experiment", help="repeat what the documentation quotes")
    experiments = parser.add_subparsers(required=True, metavar="EXPERIMENT")
    for experiment in EXPERIMENTS:
        experiment.add_to(experiments)
    for bench in graph_verbs.BENCHES:
        graph_verbs.add_to(experiments, bench)
