"""`dart-skill experiment repeatability`: one plan thrown again and again, which shows the floor of
the error.
"""

from __future__ import annotations

import argparse
import json

from dart_skill.cli.run_options import add_configuration, positive


def add_to(experiments: argparse._SubParsersAction) -> None:
    """Add `repeatability` to the experiments of `dart-skill experiment`."""
    again = experiments.add_parser(
        "repeatability", help="one plan thrown again and again: the floor of the error"
    )
    again.add_argument("--seed", type=int, default=0)
    again.add_argument("--throws", type=positive, default=25, help="of each plan (default 25)")
    again.add_argument(
        "--demonstrations",
        type=int,
        default=13,
        help="that the plans are learned from (default 13)",
    )
    add_configuration(again, "default")
    again.add_argument("--json", action="store_true", help="JSON instead of the table")
    again.set_defaults(run=_repeatability)


def _repeatability(options: argparse.Namespace) -> int:
    from dart_skill.experiments import throws

    rows = throws.repeatability(
        options.seed,
        [1.6, 2.0, 2.4],
        options.throws,
        options.demonstrations,
        options.configuration,
    )
    print(json.dumps(rows, indent=1) if options.json else throws.repeatability_table(rows))
    return 0
