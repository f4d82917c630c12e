"""What a run of the main job amounts to: throw by throw and in figures, as JSON and as a table.

A landing that nobody saw has no error; the median and the 90th percentile are over the landings
that were seen (linear between order statistics), and the table says how many that were. A throw
counts as in only if the ball was seen in the basket.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from dart_skill.common.files import new_file
from dart_skill.common.world import THROW


@dataclass(frozen=True)
class ThrowResult:
    """One throw.

    * target: (3,), centre of the rim [m].
    * landing: (3,), where the ball crossed the plane of the rim, None if not seen [m].
    * error_m: horizontal distance of the two, None if not seen; nan stands for None.
    * in_basket: as the cameras saw it.
    * message: what went wrong, empty if nothing did.
    """

    target: tuple[float, float, float]
    landing: tuple[float, float, float] | None
    error_m: float | None
    in_basket: bool
    message: str = ""

    def __post_init__(self) -> None:
        target = _point("target", self.target)
        if target is None:
            raise ValueError(
                f"target {self.target} is not finite: give the centre of the rim in metres"
            )
        landing, error = _point("landing", self.landing), _number(self.error_m)
        if (landing is None) != (error is None):
            raise ValueError(
                f"landing {self.landing} and error_m {self.error_m}: give both, or None for both"
                " if nobody saw it"
            )
        if (
            error is not None
            and landing is not None
            and (error < 0.0 or abs(error - math.dist(target[:2], landing[:2])) > 1e-3)
        ):
            raise ValueError(
                f"error_m is {error}; the landing {landing} is"
                f" {math.dist(target[:2], landing[:2]):.4f} m from the target"
            )
        for name, value in (
            ("target", target),
            ("landing", landing),
            ("error_m", error),
            ("in_basket", bool(self.in_basket)),
        ):
            object.__setattr__(self, name, value)

    @property
    def seen(self) -> bool:
        """Whether the landing was seen."""
        return self.landing is not None

    @property
    def distance(self) -> float:
        """Distance of the basket from the base axis [m]."""
        return math.hypot(*self.target[:2])

    @property
    def azimuth(self) -> float:
        """Azimuth of the basket [rad]."""
        return math.atan2(self.target[1], self.target[0])

    def to_json(self) -> dict:
        """Plain values; what was not seen is None."""
        return {
            "target": list(self.target),
            "landing": None if self.landing is None else list(self.landing),
            "error_m": self.error_m,
            "in": self.in_basket,
            "message": self.message,
        }

    def as_trial(self) -> dict:
        """The same as trials of any skill have it."""
        basket = {"position": list(self.target), "quaternion": [0.0, 0.0, 0.0, 1.0]}
        return {
            "situation": {"basket": basket},
            "success": self.in_basket,
            "error_m": self.error_m,
            "message": self.message,
        }


@dataclass(frozen=True)
class DemoSummary:
    """A whole run.

    * seed: of everything random.
    * bag: folder of its bag.
    * demonstrations: how many were learned from.
    * throws: the throws of the arm, in order.
    * wall_seconds: of the run, the start of the graph included [s].
    * real_time_factor: simulated over wall-clock time of the whole job.
    * throw_real_time_factor: the same while the arm throws, None if nobody measured it.
    * attempts: guided throws that the demonstrations took, None if nobody counted.
    * layout: of the graph, default "".
    """

    seed: int
    bag: str
    demonstrations: int
    throws: tuple[ThrowResult, ...]
    wall_seconds: float
    real_time_factor: float
    throw_real_time_factor: float | None = None
    attempts: int | None = None
    layout: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "bag", str(self.bag))
        object.__setattr__(self, "throws", tuple(self.throws))
        if self.seed < 0 or self.demonstrations < 0:
            raise ValueError(
                f"seed {self.seed} and demonstrations {self.demonstrations} must not be negative"
            )

    @property
    def thrown(self) -> int:
        """Number of throws."""
        return len(self.throws)

    @property
    def n_in(self) -> int:
        """Number of throws that ended in the basket."""
        return sum(throw.in_basket for throw in self.throws)

    @property
    def median_error_m(self) -> float | None:
        """Median landing error of the throws that were seen to land; None if there are none."""
        return error_quantile(self.throws, 0.5)

    @property
    def p90_error_m(self) -> float | None:
        """90th percentile of the landing error of the throws that were seen to land; None if there
        are none.
        """
        return error_quantile(self.throws, 0.9)

    def to_json(self) -> dict:
        """The run as a dictionary that strict JSON can hold: no NaN, no infinity."""
        return {
            "skill": THROW,
            "seed": int(self.seed),
            "bag": self.bag,
            "layout": self.layout,
            "demonstrations": int(self.demonstrations),
            "attempts": None if self.attempts is None else int(self.attempts),
            "tried": self.thrown,
            "succeeded": self.n_in,
            "thrown": self.thrown,
            "in": self.n_in,
            "landings_seen": sum(throw.seen for throw in self.throws),
            "median_error_m": self.median_error_m,
            "p90_error_m": self.p90_error_m,
            "wall_seconds": _number(self.wall_seconds),
            "real_time_factor": _number(self.real_time_factor),
            "throw_real_time_factor": _number(self.throw_real_time_factor),
            "throws": [throw.to_json() for throw in self.throws],
            "trials": [throw.as_trial() for throw in self.throws],
        }


def basket_in_words(target: np.ndarray) -> str:
    """Where a basket stands."""
    azimuth = math.degrees(math.atan2(target[1], target[0]))
    return f"basket at {math.hypot(target[0], target[1]):.2f} m, {azimuth:+.0f} degrees"


def throw_in_words(in_basket: bool, error_m: float | None, message: str) -> str:
    """What became of a throw that was made: where it went, how far from the middle, and what there
    is to say.

    * in_basket: as the cameras saw it.
    * error_m: distance of the landing from the middle [m]; None if it was not seen.
    * message: of the commander, empty if there is nothing to say.
    """
    off = "landing not seen" if error_m is None else f"{100 * error_m:.1f} cm"
    return f"{'in' if in_basket else 'out'}, {off} {message}".rstrip()


def error_quantile(throws: Sequence[ThrowResult], share: float) -> float | None:
    """Landing error [m] that a share of the throws whose landing was seen stays below; None if
    none was seen.
    """
    errors = [throw.error_m for throw in throws if throw.error_m is not None]
    return float(np.quantile(errors, share)) if errors else None


def footer(throws: Sequence[ThrowResult]) -> str:
    """The throws in a line: `in 10/10, median 1.1 cm, 90 % 2.0 cm`, and how many landings were
    seen if not all.
    """
    throws = tuple(throws)
    if not throws:
        return "no throws"
    parts, seen = (
        [f"in {sum(throw.in_basket for throw in throws)}/{len(throws)}"],
        sum(throw.seen for throw in throws),
    )
    if seen:
        parts += [
            f"median {_cm(error_quantile(throws, 0.5))} cm",
            f"90 % {_cm(error_quantile(throws, 0.9))} cm",
        ]
    if seen < len(throws):
        parts.append(f"landing seen {seen}/{len(throws)}")
    return ", ".join(parts)


def table(summary: DemoSummary) -> str:
    """The throws as aligned text: target, azimuth and distance of the basket, landing, error, in
    or out; ends with `footer`.

    The notes come last, where there are any.
    """
    head = [
        "throw",
        "target x",
        "y",
        "z [m]",
        "azimuth [deg]",
        "distance [m]",
        "landing x",
        "y [m]",
        "error [cm]",
        "result",
    ]
    rows = [head, *(_row(number, throw) for number, throw in enumerate(summary.throws, start=1))]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    notes = ["note" if any(throw.message for throw in summary.throws) else ""]
    notes += [" ".join(throw.message.split()) for throw in summary.throws]
    lines = [
        "  ".join(map(str.rjust, row, widths)) + f"  {note}"
        for row, note in zip(rows, notes, strict=True)
    ]
    return "\n".join([*(line.rstrip() for line in lines), footer(summary.throws)])


class Summary(Protocol):
    """What a run amounts to."""

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that strict JSON can hold."""


def write_summary(summary: Summary, folder: Path) -> Path:
    """`summary.json` in a folder, which is made if need be; returns its path."""
    path = Path(folder) / "summary.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    with new_file(path, replace=True) as file:
        file.write((json.dumps(summary.to_json(), indent=1, allow_nan=False) + "\n").encode())
    return path


def _row(number: int, throw: ThrowResult) -> list[str]:
    target = [f"{value:.3f}" for value in throw.target]
    place = [f"{math.degrees(throw.azimuth):+.1f}", f"{throw.distance:.2f}"]
    landing = (
        [f"{value:.3f}" for value in throw.landing[:2]]
        if throw.landing is not None
        else ["not seen", "-"]
    )
    return [
        str(number),
        *target,
        *place,
        *landing,
        _cm(throw.error_m),
        "in" if throw.in_basket else "out",
    ]


def _cm(error: float | None) -> str:
    return "-" if error is None else f"{100.0 * error:.1f}"


def _point(name: str, value: Sequence[float] | None) -> tuple[float, float, float] | None:
    """Three finite numbers, or None for None and for numbers that are not finite."""
    if value is None:
        return None
    if np.shape(value) != (3,):
        raise ValueError(
            f"{name} has shape {np.shape(value)}; it must be three numbers x, y, z in metres"
        )
    x, y, z = (float(number) for number in value)
    point = (x, y, z)
    return point if all(map(math.isfinite, point)) else None


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
