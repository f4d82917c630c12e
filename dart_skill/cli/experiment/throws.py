"""`dart-skill experiment throws`: the main job for several seeds, in process, as the table that README quotes."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict


def add_to(experiments: argparse._SubParsersAction) -> None:
    """Add `throws` to the experiments of `dart-skill experiment`."""
    throws = experiments.add_parser("throws", help="the main job for several seeds, in process, as a table")
    throws.add_argument("--seeds", type=int, default=10, help="seeds 0 to N - 1 (default 10)")
    throws.add_argument("--configurations", default="default", help="names separated by commas (default: default)")
    throws.add_argument("--demonstrations", type=int, default=13)
    throws.add_argument("--throws", type=int, default=10, help="new baskets per seed (default 10)")
    throws.add_argument("--jobs", type=int, default=1, help="processes at a time (default 1)")
    throws.add_argument("--json", action="store_true", help="every throw as JSON instead of the table")
    throws.set_defaults(run=_throws)


def _throws(options: argparse.Namespace) -> int:
    from dart_skill.experiments import throws
    from dart_skill.skill.learn import configuration

    names = tuple(configuration(name).name for name in options.configurations.split(","))
    seeds = list(range(options.seeds))
    results = throws.run(seeds, names, options.jobs, options.demonstrations, options.throws)
    if options.json:
        rows = [{k: None if v != v else v for k, v in asdict(result).items()} for result in results]
        print(json.dumps({"summary": throws.summarise(results), "throws": rows}, indent=1))
    else:
        print(throws.table(results))
    return 0
