"""`dart-skill experiment place`: parts put into holders that stand elsewhere than where it was shown."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from dart_skill.cli.run_options import positive
from dart_skill.constants import PARTITIONS


def add_to(experiments: argparse._SubParsersAction) -> None:
    """Add `place` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser("place", help="put parts into holders that stand elsewhere than where it was shown, and are turned")
    parser.add_argument("--seeds", type=positive, default=10, help="seeds 0 to N - 1 (default 10)")
    parser.add_argument("--demonstrations", type=int, default=8, help="that are learned from (default 8)")
    parser.add_argument("--parts", type=positive, default=10, help="for each seed (default 10)")
    parser.add_argument("--arm", default="ideal", help="of config/fleet.yaml; fleet: another one for every seed (default ideal)")
    parser.add_argument("--partition", choices=PARTITIONS, default="", help="of the components in time (default: of the skill's file)")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time (default 1)")
    parser.add_argument("--json", action="store_true", help="every part as JSON instead of the table")
    parser.set_defaults(run=_place)


def _place(options: argparse.Namespace) -> int:
    from dart_skill.experiments import place

    placed = place.run(list(range(options.seeds)), options.jobs, options.demonstrations, options.parts, options.arm, options.partition)
    print(json.dumps([asdict(one) for one in placed], indent=1) if options.json else place.table(placed))
    return 0
