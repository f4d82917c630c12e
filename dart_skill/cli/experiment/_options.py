"""Options that several experiments share, and what they print."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dart_skill.cli.run_options import add_settings, positive


def add_jobs(parser: argparse.ArgumentParser, default: int = 1) -> None:
    """Add `--jobs`.

    Parameters
    ----------
    default
        1, or 0 for a process per core.
    """
    text = "1" if default else "one per core"
    parser.add_argument(
        "--jobs", type=int, default=default, help=f"processes at a time (default {text})"
    )


def add_scheduler(parser: argparse.ArgumentParser) -> None:
    """Add `--scheduler`, the address of a Dask cluster."""
    parser.add_argument(
        "--scheduler",
        default="",
        metavar="ADDRESS",
        help="run on the Dask cluster of this scheduler instead",
    )


def add_batch(parser: argparse.ArgumentParser) -> None:
    """Add the options of experiments whose runs are kept in a file, and can be continued."""
    add_jobs(parser, 0)
    add_scheduler(parser)
    parser.add_argument(
        "--results",
        metavar="FILE",
        type=Path,
        help="add each run to this file; what it holds already is not run again",
    )


def add_json(parser: argparse.ArgumentParser, text: str = "the table as JSON") -> None:
    """Add `--json`.

    Parameters
    ----------
    text
        What it prints, in words.
    """
    parser.add_argument("--json", action="store_true", help=text)


def add_first_seed(parser: argparse.ArgumentParser) -> None:
    """Add `--first-seed`, beside a number of seeds."""
    parser.add_argument(
        "--first-seed", type=int, default=0, metavar="N", help="the first of them (default 0)"
    )


def add_arms(parser: argparse.ArgumentParser) -> None:
    """Add the first seed, and the arms of the seeds."""
    add_first_seed(parser)
    parser.add_argument(
        "--arms",
        default="ideal",
        help="an arm of config/fleet.yaml, or fleet: every seed draws its own (default ideal)",
    )


def add_arm(parser: argparse.ArgumentParser) -> None:
    """Add `--arm`, the arm of every seed, or fleet."""
    parser.add_argument(
        "--arm",
        default="ideal",
        help="of config/fleet.yaml; fleet: another one for every seed (default ideal)",
    )


def add_pose_skill(
    parser: argparse.ArgumentParser, tried: str, one: str, demonstrations: int = 8
) -> None:
    """Add the options of an experiment with a skill of poses.

    Parameters
    ----------
    parser
        Of the experiment.
    tried
        What each seed tries, in the plural, the name of the option.
    one
        What a line of the JSON is about.
    demonstrations
        Default of their number.
    """
    parser.add_argument("--seeds", type=positive, default=10, help="how many (default 10)")
    add_first_seed(parser)
    parser.add_argument(
        "--demonstrations",
        type=int,
        default=demonstrations,
        help=f"that are learned from (default {demonstrations})",
    )
    parser.add_argument(f"--{tried}", type=positive, default=10, help="for each seed (default 10)")
    add_arm(parser)
    add_settings(parser)
    add_jobs(parser)
    add_json(parser, f"every {one} as JSON instead of the table")


def show(tried: Sequence[Any], table: Callable[[Any], str], as_json: bool) -> int:
    """Print the results of an experiment.

    Parameters
    ----------
    tried
        A dataclass for each.
    table
        Makes the table of them.
    as_json
        The fields of each instead of the table.

    Returns
    -------
    int
        The exit status.
    """
    print(json.dumps([asdict(one) for one in tried], indent=1) if as_json else table(tried))
    return 0
