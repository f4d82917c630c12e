"""Options and output that the experiments of skills of poses, `place` and `reach`, have in common."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from dart_skill.cli.run_options import positive
from dart_skill.common.constants import PARTITIONS


def add_options(parser: argparse.ArgumentParser, tried: str, one: str) -> None:
    """Add the options of an experiment with a skill of poses.

    * parser: of the experiment.
    * tried: what each seed tries, in the plural, the name of the option.
    * one: what a line of the JSON is about.
    """
    parser.add_argument("--seeds", type=positive, default=10, help="seeds 0 to N - 1 (default 10)")
    parser.add_argument(
        "--demonstrations", type=int, default=8, help="that are learned from (default 8)"
    )
    parser.add_argument(f"--{tried}", type=positive, default=10, help="for each seed (default 10)")
    parser.add_argument(
        "--arm",
        default="ideal",
        help="of config/fleet.yaml; fleet: another one for every seed (default ideal)",
    )
    parser.add_argument(
        "--partition",
        choices=PARTITIONS,
        default="",
        help="of the components in time (default: of the skill's file)",
    )
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time (default 1)")
    parser.add_argument(
        "--json", action="store_true", help=f"every {one} as JSON instead of the table"
    )


def show(tried: Sequence[Any], table: Callable[[Any], str], as_json: bool) -> None:
    """Print what came of an experiment.

    * tried: a dataclass for each.
    * table: makes the table of them.
    * as_json: the fields of each instead of the table.
    """
    print(json.dumps([asdict(one) for one in tried], indent=1) if as_json else table(tried))
