"""`dart-skill experiment`: what the documentation quotes, repeated.

Nothing else imports `dart_skill.experiments`.
"""

import argparse

from dart_skill.cli import graph_verbs
from dart_skill.cli.experiment import ball_throws, darts, pose_skills, thesis

EXPERIMENTS = (
    ball_throws.add_throws,
    ball_throws.add_basket,
    ball_throws.add_practice,
    ball_throws.add_attempts,
    darts.add_darts,
    ball_throws.add_repeatability,
    darts.add_search,
    darts.add_landscapes,
    ball_throws.add_compliance,
    pose_skills.add_place,
    pose_skills.add_reach,
    pose_skills.add_stir,
    thesis.add_real_data,
    thesis.add_rivals,
    thesis.add_figure,
)


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add `experiment` with all its verbs to the commands of `dart-skill`."""
    parser = commands.add_parser("experiment", help="repeat what the documentation quotes")
    experiments = parser.add_subparsers(required=True, metavar="EXPERIMENT")
    for add in EXPERIMENTS:
        add(experiments)
    for bench in graph_verbs.BENCHES:
        graph_verbs.add_to(experiments, bench)
