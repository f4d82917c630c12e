"""`dart-skill experiment compliance`: what stiffness from the demonstrations buys."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from dart_skill.cli.run_options import add_configuration, positive


def add_to(experiments: argparse._SubParsersAction) -> None:
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
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time (default 1)")
    parser.add_argument(
        "--json", action="store_true", help="every throw as JSON instead of the table"
    )
    parser.set_defaults(run=_compliance)


def _compliance(options: argparse.Namespace) -> int:
    from dart_skill.experiments import compliance

    swings = compliance.run(
        list(range(options.seeds)),
        options.jobs,
        options.demonstrations,
        options.throws,
        options.configuration,
    )
    print(
        json.dumps([asdict(one) for one in swings], indent=1)
        if options.json
        else compliance.table(swings)
    )
    return 0
