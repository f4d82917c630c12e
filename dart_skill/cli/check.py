"""`dart-skill check`: whether what is there is fit to be used; today the arm with its cameras."""

from __future__ import annotations

import argparse

from dart_skill.cli import graph_verbs


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add `check` with its verbs to the commands of `dart-skill`."""
    check = commands.add_parser(
        "check", help="before anything moves: arm, cameras and numbers, go or no go"
    )
    verbs = check.add_subparsers(title="verbs", required=True, metavar="VERB")
    graph_verbs.add_to(verbs, "arm", module="check_arm")
