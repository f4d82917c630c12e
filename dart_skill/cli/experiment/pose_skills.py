"""`dart-skill experiment place`, `reach` and `stir`: skills of poses, in situations that were not
shown."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from dart_skill.cli.experiment._options import add_pose_skill, show


def add_place(experiments: argparse._SubParsersAction) -> None:
    """Add `place` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "place",
        help="put parts into holders that stand elsewhere than where it was shown, and are turned",
    )
    add_pose_skill(parser, "parts", "part")
    parser.add_argument(
        "--own",
        type=int,
        default=0,
        metavar="N",
        help="own tries before them, from which the skill learns (default 0)",
    )
    parser.add_argument(
        "--unseen",
        type=float,
        default=0.0,
        metavar="SECONDS",
        help="the cameras lose the hand for so long in the last 10 cm (default 0)",
    )
    parser.set_defaults(run=_place)


def _place(options: argparse.Namespace) -> int:
    from dart_skill.experiments.studies import pose_skills

    placed = _of_seeds(
        options,
        pose_skills.place_seed,
        parts=options.parts,
        own=options.own,
        unseen=options.unseen,
    )
    return show(placed, pose_skills.place_table, options.json)


def add_reach(experiments: argparse._SubParsersAction) -> None:
    """Add `reach` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "reach", help="reach into cups on belts that were not shown, also while the hand is held"
    )
    add_pose_skill(parser, "cups", "reach")
    _add_held(parser, "cups", 3)
    parser.set_defaults(run=_reach)


def _reach(options: argparse.Namespace) -> int:
    from dart_skill.experiments.studies import pose_skills

    reached = _of_seeds(options, pose_skills.reach_seed, cups=options.cups, held=options.held)
    return show(reached, pose_skills.reach_table, options.json)


def add_stir(experiments: argparse._SubParsersAction) -> None:
    """Add `stir` to the experiments of `dart-skill experiment`."""
    parser = experiments.add_parser(
        "stir", help="stir in pots that stand elsewhere, also while the hand is held"
    )
    add_pose_skill(parser, "pots", "pot", demonstrations=1)
    _add_held(parser, "pots", 1)
    parser.set_defaults(run=_stir)


def _stir(options: argparse.Namespace) -> int:
    from dart_skill.experiments.studies import stirring

    stirred = _of_seeds(options, stirring.stir_seed, pots=options.pots, held=options.held)
    return show(stirred, stirring.stir_table, options.json)


def _add_held(parser: argparse.ArgumentParser, tried: str, number: int) -> None:
    """Add the option for movements with a hand that is held."""
    parser.add_argument(
        "--held",
        type=int,
        default=number,
        help=f"of the {tried} again with a hand that is held for a second (default {number})",
    )


def _of_seeds(options: argparse.Namespace, run: Callable[..., list], **own: Any) -> list:
    """Trials of every seed, by what `add_pose_skill` asks for and the options of one experiment."""
    from dart_skill.experiments.parallel import all_of

    return all_of(
        run,
        range(options.first_seed, options.first_seed + options.seeds),
        options.jobs,
        demonstrations=options.demonstrations,
        arm=options.arm,
        settings=tuple(options.set),
        **own,
    )
