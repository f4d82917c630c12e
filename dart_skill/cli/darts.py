"""`dart-skill darts heatmap|aim|estimate|501|match|search`: where to aim, from a spread or from
scores alone.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from dart_skill.cli import _darts_match
from dart_skill.cli.experiment.darts import add_search
from dart_skill.cli.run_options import folder
from dart_skill.common.files import new_file

if TYPE_CHECKING:
    import numpy as np

    from dart_skill.darts import (
        Aim,
        HeatMap,
        LegPolicy,
        LikelihoodRatio,
        Spread,
        SpreadByTarget,
        SpreadEstimate,
    )


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add `darts` with its verbs to the commands of `dart-skill`."""
    darts = commands.add_parser(
        "darts", help="where to aim on a dart board, for a thrower's spread or from scores"
    )
    verbs = darts.add_subparsers(required=True, metavar="VERB")
    _add_heatmap(verbs)
    _add_aim(verbs)
    _add_estimate(verbs)
    _add_leg(verbs)
    _darts_match.add_to(verbs)
    add_search(verbs)


def _add_heatmap(verbs: argparse._SubParsersAction) -> None:
    heatmap = verbs.add_parser("heatmap", help="the expected score of every aim, as a picture")
    _add_spread(heatmap, required=True)
    heatmap.add_argument(
        "--spacing", type=float, default=1.0, metavar="MM", help="of the grid (default 1)"
    )
    heatmap.add_argument(
        "--csv", metavar="FILE", help="write the map as rows of x_mm,y_mm,expected_score"
    )
    _add_output(heatmap, "figures")
    heatmap.set_defaults(run=_heatmap)


def _add_aim(verbs: argparse._SubParsersAction) -> None:
    aim = verbs.add_parser(
        "aim",
        help="the best aim and all local optima for a sigma, or its jumps over a range of sigmas",
    )
    _add_spread(aim, required=False)
    aim.add_argument(
        "--from", dest="lowest", type=float, metavar="A", help="smallest sigma [mm] of a range"
    )
    aim.add_argument(
        "--to", dest="highest", type=float, metavar="B", help="largest sigma [mm] of a range"
    )
    _add_output(aim)
    aim.set_defaults(run=_aim, usage_error=aim.error)


def _add_estimate(verbs: argparse._SubParsersAction) -> None:
    estimate = verbs.add_parser(
        "estimate",
        help="a thrower's spread from the scores of single darts, and where to aim with it",
    )
    estimate.add_argument(
        "scores",
        nargs="+",
        metavar="SCORE",
        help=(
            "20, 0 for a miss, T20 where the bed is known, x for a bounce-out; - reads them from"
            " stdin"
        ),
    )
    estimate.add_argument(
        "--aim",
        default="DB",
        metavar="TARGET",
        help="what was aimed at: a bed, or x,y in mm (default DB)",
    )
    estimate.add_argument(
        "--model",
        choices=("isotropic", "general"),
        default="isotropic",
        help="one sigma, or a covariance (default isotropic)",
    )
    estimate.add_argument(
        "--with-bias",
        action="store_true",
        help="estimate the mean too instead of taking it to be the aim",
    )
    estimate.add_argument(
        "--misses-unrecorded", action="store_true", help="only darts that hit the board are listed"
    )
    _add_output(estimate)
    estimate.set_defaults(run=_estimate)


def _add_leg(verbs: argparse._SubParsersAction) -> None:
    leg = verbs.add_parser(
        "501", help="where to aim with what remains, to finish a leg on a double"
    )
    _add_spread(leg, required=False)
    leg.add_argument(
        "--professional",
        nargs="?",
        const="typical",
        metavar="NAME",
        help="a published professional's spread; without a name a typical one",
    )
    leg.add_argument(
        "--start", type=int, default=501, help="score at which the leg starts (default 501)"
    )
    leg.add_argument("--remaining", type=int, help="only this score")
    leg.add_argument(
        "--darts", type=int, default=3, choices=(1, 2, 3), help="darts left with it (default 3)"
    )
    leg.add_argument(
        "--turn-start",
        type=int,
        help="score before this turn, to which a bust returns (default: what remains)",
    )
    leg.add_argument(
        "--objective",
        choices=("turns", "darts"),
        default="turns",
        help="what is to be least (default turns)",
    )
    _add_output(leg)
    leg.set_defaults(run=_leg, usage_error=leg.error)


def _add_spread(parser: argparse.ArgumentParser, required: bool) -> None:
    kinds = parser.add_mutually_exclusive_group(required=required)
    kinds.add_argument("--sigma", type=float, metavar="MM", help="standard deviation of the darts")
    kinds.add_argument(
        "--covariance", type=float, nargs=3, metavar=("XX", "XY", "YY"), help="of the darts [mm^2]"
    )
    parser.add_argument(
        "--bias",
        type=float,
        nargs=2,
        default=(0.0, 0.0),
        metavar=("X", "Y"),
        help="mean of the darts from the aim [mm]",
    )


def _add_output(parser: argparse.ArgumentParser, default: str | None = None) -> None:
    text = (
        f"where SVG and PNG go (default: {default})"
        if default
        else "draw a picture into this folder"
    )
    parser.add_argument("--output", type=folder, default=default, metavar="FOLDER", help=text)
    parser.add_argument("--json", action="store_true", help="JSON instead of text")


def _spread(options: argparse.Namespace) -> Spread | None:
    import numpy as np

    from dart_skill.darts import Spread

    if options.covariance is not None:
        xx, xy, yy = options.covariance
        return Spread(np.array([[xx, xy], [xy, yy]]), options.bias)
    return Spread.isotropic(options.sigma, options.bias) if options.sigma is not None else None


def _heatmap(options: argparse.Namespace) -> int:
    from dart_skill.darts import best_aim, heat_map
    from dart_skill.figures import heat_map_figure, save

    spread = _spread(options)
    assert spread is not None  # the parser asks for one
    best = best_aim(spread)
    paths = save(heat_map_figure(spread, options.spacing), options.output, "heat_map")
    if options.csv:
        _write_csv(heat_map(spread, options.spacing), options.csv)
    result = {
        **_spread_fields(spread),
        "spacing_mm": options.spacing,
        **_aim_fields(best),
        "paths": _texts(paths),
    }
    _show(options, result, f"best aim: {_sentence(best)}\n{paths[1]}")
    return 0


def _write_csv(heat: HeatMap, path: str) -> None:
    import numpy as np

    x, y = np.meshgrid(heat.x, heat.y)
    rows = np.column_stack([x.ravel(), y.ravel(), heat.expected_score.ravel()])
    with new_file(path, replace=True) as file:
        np.savetxt(
            file, rows, fmt="%.6g", delimiter=",", header="x_mm,y_mm,expected_score", comments=""
        )


def _aim(options: argparse.Namespace) -> int:
    from dart_skill.darts import local_optima

    usage_error: Callable[[str], NoReturn] = options.usage_error
    ranged = options.lowest is not None or options.highest is not None
    if ranged and (options.lowest is None or options.highest is None or options.sigma is not None):
        usage_error("a range needs both --from and --to, and no --sigma")
    if ranged:
        return _aim_over(options)
    spread = _spread(options)
    if spread is None:
        usage_error(
            "one of --sigma, --covariance, or --from with --to is needed: dart-skill darts aim"
            " --sigma 26.9"
        )
    optima = local_optima(spread)
    paths: list[str] = []
    if options.output is not None:
        from dart_skill.figures import heat_map_figure, save

        paths = _texts(save(heat_map_figure(spread), options.output, "aim"))
    result = {
        **_spread_fields(spread),
        **_aim_fields(optima[0]),
        "local_optima": [_aim_fields(aim) for aim in optima],
        "paths": paths,
    }
    others = [f"  {_sentence(aim)}" for aim in optima[1:]]
    _show(
        options,
        result,
        "\n".join(
            [
                f"best aim: {_sentence(optima[0])}",
                *(["other local optima:"] if others else []),
                *others,
                *paths[1:],
            ]
        ),
    )
    return 0


def _aim_over(options: argparse.Namespace) -> int:
    from dart_skill.darts import Spread, optimum_path

    shape = _spread(options) or Spread.isotropic(1.0, options.bias)
    path = optimum_path(options.lowest, options.highest, shape)
    paths: list[str] = []
    if options.output is not None:
        from dart_skill.figures import path_figure, save

        paths = _texts(save(path_figure(path), options.output, "best_aim_over_sigma"))
    jumps = [
        {
            "sigma_mm": jump.sigma,
            "below": _aim_fields(jump.below),
            "above": _aim_fields(jump.above),
        }
        for jump in path.jumps
    ]
    rows = [
        {
            "sigma_mm": float(sigma),
            "x_mm": float(point[0]),
            "y_mm": float(point[1]),
            "expected_score": float(value),
        }
        for sigma, point, value in zip(path.sigmas, path.aims, path.expected_scores, strict=True)
    ]
    result = {
        "jumps": jumps,
        "sigma_mm": [jump.sigma for jump in path.jumps],
        "path": rows,
        "paths": paths,
    }
    lines = [
        f"sigma = {jump.sigma:.4f} mm: from {_sentence(jump.below)} to {_sentence(jump.above)}"
        for jump in path.jumps
    ]
    _show(options, result, "\n".join([*(lines or ["the best aim does not jump"]), *paths[1:]]))
    return 0


def _estimate(options: argparse.Namespace) -> int:
    from dart_skill.darts import best_aim, estimate_from_scores

    misses = "unrecorded" if options.misses_unrecorded else "counted"
    scores = [
        token
        for text in options.scores
        for token in (sys.stdin.read() if text == "-" else text).replace(",", " ").split()
    ]
    estimate = estimate_from_scores(
        scores, _target(options.aim), model=options.model, bias=options.with_bias, misses=misses
    )
    interval, isotropy, best = (
        estimate.confidence_interval(),
        estimate.isotropy_test(),
        best_aim(estimate.spread),
    )
    paths: list[str] = []
    if options.output is not None:
        from dart_skill.figures import estimate_figure, save

        paths = _texts(save(estimate_figure(estimate, best), options.output, "estimate"))
    result = {
        **_spread_fields(estimate.spread),
        "ci95_mm": [_finite_or_none(end) for end in interval],
        "model": estimate.model,
        "n_throws": estimate.n_throws,
        "bounced_out": estimate.throws.bounced_out,
        "log_likelihood": estimate.log_likelihood,
        "isotropy_p_value": isotropy.p_value,
        "best_aim": _aim_fields(best),
        "paths": paths,
    }
    _show(
        options,
        result,
        "\n".join(
            [
                *_estimate_lines(estimate, interval, isotropy),
                f"best aim: {_sentence(best)}",
                *paths[1:],
            ]
        ),
    )
    return 0


def _estimate_lines(
    estimate: SpreadEstimate, interval: tuple[float, float], isotropy: LikelihoodRatio
) -> list[str]:
    lines = [
        f"sigma = {estimate.sigma:.1f} mm, 95 % interval {interval[0]:.1f} to {interval[1]:.1f}"
        f" mm, from {estimate.n_throws} darts"
    ]
    if estimate.model == "general":
        narrow, wide = estimate.spread.deviations
        lines.append(f"  {wide:.1f} and {narrow:.1f} mm along its axes")
    if estimate.with_bias:
        lines.append(
            f"  bias: {estimate.spread.bias[0]:+.1f} mm to the right,"
            f" {estimate.spread.bias[1]:+.1f} mm up"
        )
    if estimate.model == "isotropic" and isotropy.p_value < 0.05:
        lines.append(f"  one sigma does not fit (p = {isotropy.p_value:.2g}): --model general")
    return lines


def _leg(options: argparse.Namespace) -> int:
    import numpy as np

    from dart_skill.darts import HIGHEST_CHECKOUT, checkout_table, professional, solve_leg

    spread: Spread | SpreadByTarget | None = _spread(options)
    if (spread is None) == (options.professional is None):
        options.usage_error(
            "one of --sigma, --covariance or --professional is needed: dart-skill darts 501"
            " --professional"
        )
    if spread is None:
        spread = professional(None if options.professional == "typical" else options.professional)
    policy = solve_leg(spread, options.start, options.objective)
    states = [(s, 3, s) for s in range(2, policy.start + 1)]
    if options.remaining is not None:
        states = [(options.remaining, options.darts, options.turn_start or options.remaining)]
    chances = np.zeros((policy.start + 1, 3))
    chances[: HIGHEST_CHECKOUT + 1] = checkout_table(spread, HIGHEST_CHECKOUT).probability[
        : policy.start + 1
    ]
    rows = [_state_fields(policy, chances, *state) for state in states]
    paths: list[str] = []
    if options.output is not None:
        from dart_skill.figures import leg_figure, save

        paths = _texts(save(leg_figure(policy), options.output, "leg"))
    summary = {
        "start": policy.start,
        "objective": policy.objective,
        f"expected_{policy.objective}": float(policy.expected[-1]),
    }
    head = f"{policy.expected[-1]:.3f} {policy.objective} on average from {policy.start}"
    _show(
        options,
        {**summary, "aims": rows, "paths": paths},
        "\n".join([head, *_leg_table(rows, policy.objective), *paths[1:]]),
    )
    return 0


def _state_fields(
    policy: LegPolicy, chances: np.ndarray, remaining: int, darts: int, turn_start: int
) -> dict:
    point = policy.best_aim(remaining, darts, turn_start)
    fields = {
        "remaining": remaining,
        "darts_left": darts,
        "turn_start": turn_start,
        "bed": policy.target(remaining, darts, turn_start),
    }
    fields |= {
        "x_mm": float(point[0]),
        "y_mm": float(point[1]),
        "best_chance_to_finish": float(chances[remaining, darts - 1]),
    }
    if darts == 3 and remaining == turn_start:
        fields[f"expected_{policy.objective}"] = float(policy.expected[remaining])
    return fields


def _leg_table(rows: list[dict], objective: str) -> list[str]:
    lines = [
        f"{'left':>5} {'darts':>5}  {'aim at':<12} {'x mm':>7} {'y mm':>7} {objective:>8}  chance"
        " to finish this turn"
    ]
    for row in rows:
        expected = row.get(f"expected_{objective}")
        shown = f"{expected:8.3f}" if expected is not None else f"{'':8}"
        place = f"{row['bed']:<12} {row['x_mm']:7.1f} {row['y_mm']:7.1f}"
        lines.append(
            f"{row['remaining']:5d} {row['darts_left']:5d}  {place} {shown} "
            f" {row['best_chance_to_finish']:.3f}"
        )
    return lines


def _target(text: str) -> str | list[float]:
    parts = text.split(",")
    if len(parts) != 2:
        return text
    try:
        return [float(part) for part in parts]
    except ValueError:
        raise ValueError(
            f"aim {text!r} is neither a bed such as T20 nor x,y in mm such as 0,103"
        ) from None


def _texts(paths: Sequence[Path]) -> list[str]:
    return [str(path) for path in paths]


def _spread_fields(spread: Spread) -> dict:
    return {
        "sigma_mm": spread.sigma,
        "covariance_mm2": spread.covariance.tolist(),
        "bias_mm": spread.bias.tolist(),
    }


def _aim_fields(aim: Aim) -> dict:
    return {
        "x_mm": float(aim.point[0]),
        "y_mm": float(aim.point[1]),
        "expected_score": float(aim.expected_score),
        "bed": aim.bed,
    }


def _sentence(aim: Aim) -> str:
    return (
        f"{aim.bed} at x = {aim.point[0]:.1f}, y = {aim.point[1]:.1f} mm, {aim.expected_score:.3f}"
        " points per dart"
    )


def _finite_or_none(value: float) -> float | None:
    return value if abs(value) < float("inf") else None


def _show(options: argparse.Namespace, result: dict, text: str) -> None:
    print(json.dumps(result, indent=1) if options.json else text)
