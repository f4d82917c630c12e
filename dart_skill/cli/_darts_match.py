"""`dart-skill darts match`: two players, the chance to win a leg and a match, and where to aim
against this opponent.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import TYPE_CHECKING

from dart_skill.cli.progress import share_bar

if TYPE_CHECKING:
    from dart_skill.darts import AimsApart, MatchPolicy, Spread, SpreadByTarget


def add_to(verbs: argparse._SubParsersAction) -> None:
    """Add `match` to the verbs of `dart-skill darts`."""
    match = verbs.add_parser(
        "match",
        help="two players: who wins a leg and a match, and where to aim against this opponent",
    )
    _add_player(match, "", "sigma", "your darts")
    _add_player(match, "against-", "against", "those of your opponent")
    match.add_argument(
        "--first",
        choices=("me", "them"),
        default="me",
        help="who begins the first leg; then they take turns (default me)",
    )
    match.add_argument(
        "--legs",
        type=int,
        default=1,
        metavar="N",
        help="the match is the best of N, an odd number (default 1)",
    )
    match.add_argument(
        "--start", type=int, default=501, help="score at which a leg starts (default 501)"
    )
    match.add_argument(
        "--quick",
        action="store_true",
        help=(
            "both play for the fewest turns, whatever the other has left: seconds in place of a"
            " minute and more, and chances that differ little (docs/darts.md)"
        ),
    )
    match.add_argument("--json", action="store_true", help="JSON instead of text")
    match.set_defaults(run=_match)


def _add_player(parser: argparse.ArgumentParser, prefix: str, sigma: str, whose: str) -> None:
    kinds = parser.add_mutually_exclusive_group(required=True)
    kinds.add_argument(
        f"--{sigma}", type=float, metavar="MM", help=f"standard deviation of {whose}"
    )
    kinds.add_argument(
        f"--{prefix}covariance",
        type=float,
        nargs=3,
        metavar=("XX", "XY", "YY"),
        help=f"of {whose} [mm^2]",
    )
    kinds.add_argument(
        f"--{prefix}professional",
        nargs="?",
        const="typical",
        metavar="NAME",
        help=f"a published spread for {whose}",
    )
    parser.add_argument(
        f"--{prefix}bias",
        type=float,
        nargs=2,
        default=(0.0, 0.0),
        metavar=("X", "Y"),
        help=f"mean of {whose} from the aim [mm]",
    )


def _spread(options: argparse.Namespace, prefix: str, sigma: str) -> Spread | SpreadByTarget:
    import numpy as np

    from dart_skill.darts import Spread, professional

    given = vars(options)
    name, covariance, bias = (
        given[f"{prefix}{kind}"] for kind in ("professional", "covariance", "bias")
    )
    try:
        if name is not None:
            return professional(None if name == "typical" else name)
        if covariance is not None:
            xx, xy, yy = covariance
            return Spread(np.array([[xx, xy], [xy, yy]]), bias)
        return Spread.isotropic(given[sigma], bias)
    except ValueError as error:
        raise ValueError(f"{'opponent' if prefix else 'you'}: {error}") from None


def _match(options: argparse.Namespace) -> int:
    from dart_skill.darts import match_chance

    mine, theirs = _spread(options, "", "sigma"), _spread(options, "against_", "against")
    # what cannot be is said before anything is computed
    match_chance(0.5, 0.5, options.legs, options.first)
    result = (
        _solved_quickly(options, mine, theirs) if options.quick else _solved(options, mine, theirs)
    )
    print(json.dumps(result, indent=1) if options.json else "\n".join(_lines(result)))
    return 0


def _solved(
    options: argparse.Namespace, mine: Spread | SpreadByTarget, theirs: Spread | SpreadByTarget
) -> dict:
    """Both play their best, and what it is worth against the fewest turns."""
    from dart_skill.darts import aims_apart, solve_match

    start = options.start
    _say("both play their best (1 of 3): a minute and more from 501, with --quick seconds ...")
    with share_bar("1 of 3") as tell:
        best = solve_match(mine, theirs, start, tell=tell)
    me, them = best.me.player, best.them.player
    _say("your best against one who counts turns (2 of 3) ...")
    with share_bar("2 of 3") as tell:
        answer = solve_match(me, them, start, ("best", "turns"), tell)
    _say("both count turns (3 of 3) ...")
    fewest = solve_match(me, them, start, ("turns", "turns"))
    return {
        **_asked(options, best),
        "leg": _chances(best),
        "leg_against_fewest_turns": _chances(answer),
        "leg_both_fewest_turns": _chances(fewest),
        "example": _example(aims_apart(best.me)),
    }


def _solved_quickly(
    options: argparse.Namespace, mine: Spread | SpreadByTarget, theirs: Spread | SpreadByTarget
) -> dict:
    """Both play for the fewest turns."""
    from dart_skill.darts import match_player, solve_match

    me, them = (match_player(one, options.start, "turns") for one in (mine, theirs))
    fewest = solve_match(me, them, options.start, ("turns", "turns"))
    return {**_asked(options, fewest), "leg_both_fewest_turns": _chances(fewest)}


def _asked(options: argparse.Namespace, policy: MatchPolicy) -> dict:
    """What is told of a match, whoever plays how."""
    from dart_skill.darts import match_chance

    chance = match_chance(*_pair(policy), options.legs, options.first)
    return {
        "start": options.start,
        "match": {"legs": options.legs, "first": options.first, "chance": chance},
        "aim": _aim(policy),
    }


def _say(what: str) -> None:
    """Progress, of a computation that takes half a minute for each part."""
    print(f"darts match: {what}", file=sys.stderr, flush=True)


def _pair(policy: MatchPolicy) -> tuple[float, float]:
    return float(policy.me.first[policy.start, policy.start]), float(
        policy.me.second[policy.start, policy.start]
    )


def _chances(policy: MatchPolicy) -> dict:
    return dict(zip(("first", "second"), _pair(policy), strict=True))


def _aim(policy: MatchPolicy) -> dict:
    point = policy.me.best_aim(policy.start, policy.start)
    return {
        "bed": policy.me.target(policy.start, policy.start),
        "x_mm": float(point[0]),
        "y_mm": float(point[1]),
    }


def _example(apart: AimsApart | None) -> dict | None:
    if apart is None:
        return None
    sides = [
        {
            "against": against,
            "bed": bed,
            "x_mm": float(aim[0]),
            "y_mm": float(aim[1]),
            "other_aim_loses": float(loss),
        }
        for against, bed, aim, loss in zip(
            apart.against, apart.beds, apart.aims, apart.losses, strict=True
        )
    ]
    return {"remaining": apart.remaining, "aims": sides}


def _lines(result: dict) -> list[str]:
    match, aim = result["match"], result["aim"]
    who = "you begin" if match["first"] == "me" else "they begin"
    fewest = _percent(result["leg_both_fewest_turns"])
    of_match = (
        f"best of {match['legs']}, {who} the first leg: you win {100 * match['chance']:.2f} %"
    )
    first = f"first dart: {aim['bed']} at x = {aim['x_mm']:.1f}, y = {aim['y_mm']:.1f} mm"
    if "leg" not in result:
        both = f"leg from {result['start']}, both play for the fewest turns: you win {fewest}"
        return [both, of_match, first]
    return [
        f"leg from {result['start']}, both play to win: you win {_percent(result['leg'])}",
        f"  if they play for the fewest turns: {_percent(result['leg_against_fewest_turns'])}",
        f"  if both play for the fewest turns: {fewest}",
        of_match,
        first,
        _example_line(result["example"]),
    ]


def _percent(chances: dict) -> str:
    return (
        f"{100 * chances['first']:.2f} % if you begin, {100 * chances['second']:.2f} % if they"
        " begin"
    )


def _example_line(example: dict | None) -> str:
    if example is None:
        return "no aim of a first dart depends on what they have left"
    near, far = example["aims"]
    return (
        f"with {example['remaining']} left: {near['bed']} if they have {near['against']} left,"
        f" {far['bed']} if they have {far['against']} (the other aim loses"
        f" {100 * near['other_aim_loses']:.2f} and {100 * far['other_aim_loses']:.2f} %)"
    )
