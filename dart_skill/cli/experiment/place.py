"""`dart-skill experiment place`: parts put into holders that stand elsewhere than where it was
shown.
"""

from __future__ import annotations

import argparse

from dart_skill.cli.experiment._pose_skill_options import add_options, show


def add_to(experiments: argparse._SubParsersAction) -> None:
    """Add `place` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "place",
        help="put parts into holders that stand elsewhere than where it was shown, and are turned",
    )
    add_options(parser, "parts", "part")
    parser.set_defaults(run=_place)


def _place(options: argparse.Namespace) -> int:
    from dart_skill.experiments import place

    placed = place.run(
        list(range(options.seeds)),
        options.jobs,
        options.demonstrations,
        options.parts,
        options.arm,
        options.partition,
    )
    show(placed, place.table, options.json)
    return 0
