"""`dart-skill experiment reach`: reaches into cups on belts that were not shown."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from dart_skill.cli.run_options import positive
from dart_skill.constants import PARTITIONS


def add_to(experiments: argparse._SubParsersAction) -> None:
    """Add `reach` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser("reach", help="reach into cups on belts that were not shown, also while the hand is held")
    parser.add_argument("--seeds", type=positive, default=10, help="seeds 0 to N - 1 (default 10)")
    parser.add_argument("--demonstrations", type=int, default=8, help="that are learned from (default 8)")
    parser.add_argument("--cups", type=positive, default=10, help="for each seed (default 10)")
    parser.add_argument("--held", type=int, default=3, help="of them again with a hand that is held for a second (default 3)")
    parser.add_argument("--arm", default="ideal", help="of config/fleet.yaml; fleet: another one for every seed (default ideal)")
    parser.add_argument("--partition", choices=PARTITIONS, default="", help="of the components in time (default: of the skill's file)")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time (default 1)")
    parser.add_argument("--json", action="store_true", help="every reach as JSON instead of the table")
    parser.set_defaults(run=_reach)


def _reach(options: argparse.Namespace) -> int:
    from dart_skill.experiments import reach

    seeds = list(range(options.seeds))
    reached = reach.run(seeds, options.jobs, options.demonstrations, options.cups, options.held, options.arm, options.partition)
    print(json.dumps([asdict(one) for one in reached], indent=1) if options.json else reach.table(reached))
    return 0
