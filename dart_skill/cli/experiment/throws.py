"""`dart-skill experiment throws`: the main job for several seeds, in process, as the table that
README quotes.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from dart_skill.cli.run_options import positive


def add_to(experiments: argparse._SubParsersAction) -> None:
    """Add `throws` to the experiments of `dart-skill experiment`."""
    throws = experiments.add_parser(
        "throws", help="the main job for several seeds, in process, as a table"
    )
    throws.add_argument("--seeds", type=positive, default=10, help="how many seeds (default 10)")
    throws.add_argument(
        "--first-seed", type=int, default=0, metavar="N", help="the first of them (default 0)"
    )
    throws.add_argument(
        "--arms",
        default="ideal",
        help="an arm of config/fleet.yaml, or fleet: every seed draws its own (default ideal)",
    )
    throws.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NODE.PARAMETER=VALUE",
        help="a parameter of a node; may be given several times",
    )
    text = (
        "names separated by commas; ladder: from `thesis` to `default`, a change each, and"
        " `default` without each (default: default)"
    )
    throws.add_argument("--configurations", default="default", metavar="NAMES", help=text)
    throws.add_argument("--demonstrations", type=int, default=13)
    throws.add_argument(
        "--throws", type=positive, default=10, help="new baskets per seed (default 10)"
    )
    throws.add_argument("--jobs", type=int, default=1, help="processes at a time (default 1)")
    throws.add_argument(
        "--scheduler",
        default="",
        metavar="ADDRESS",
        help="run on the Dask cluster of this scheduler instead",
    )
    throws.add_argument(
        "--best-possible",
        action="store_true",
        help="also the share that any plan could get in, with the scatter of this arm's fingers",
    )
    throws.add_argument(
        "--json",
        action="store_true",
        help="as JSON: thrown, in, median_error_m, p90_error_m, and every throw",
    )
    throws.set_defaults(run=_throws)


def _throws(options: argparse.Namespace) -> int:
    from dart_skill.common.fleet import arm_with
    from dart_skill.experiments import throws
    from dart_skill.experiments.throws import arm_of
    from dart_skill.skills.learning import LADDER, configuration

    asked = options.configurations.replace("ladder", ",".join(("thesis", *LADDER)))
    names = tuple(configuration(name).name for name in asked.split(","))
    arm_with(arm_of(options.arms, options.first_seed), options.set)
    seeds = list(range(options.first_seed, options.first_seed + options.seeds))
    settings = tuple(options.set)
    results = throws.run(
        seeds,
        names,
        options.jobs,
        options.demonstrations,
        options.throws,
        options.arms,
        settings,
        scheduler=options.scheduler,
    )
    best = throws.best_possible(results, settings) if options.best_possible else None
    if options.json:
        rows = [
            {k: None if v != v else v for k, v in asdict(result).items()} for result in results
        ]
        said = {} if best is None else {"best_possible": best}
        print(
            json.dumps(
                {
                    **throws.summary(results),
                    **said,
                    "summary": throws.summarise(results),
                    "throws": rows,
                },
                indent=1,
            )
        )
    else:
        print(throws.table(results))
        if best is not None:
            print(f"of all plans that let go there, the best would get {100 * best:.1f} % in")
    return 0
