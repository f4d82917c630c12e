"""A run of darts: what the arm aimed at, hit and knew of itself, throw by throw, and in blocks of
throws.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from dart_skill.darts import LegDart, ModelBasedAgent, name_at, score
from dart_skill.session._skill_summary import SkillSummary

BLOCK = 25
"""Throws of a row of the table."""
UNSEEN = (float("nan"), float("nan"))
UNKNOWN = ((0.0, 0.0), (0.0, 0.0))


@dataclass(frozen=True)
class Dart:
    """One throw.

    * aim: (x, y) [mm] on the board.
    * hit: (x, y) [mm] on the board; nan if the cameras did not see it or nothing was thrown.
    * score: int, as seen; 0 if nothing was seen.
    * covariance: (2, 2) [mm^2], spread of the thrower as estimated before the throw; 0 before the
      first estimate.
    * expected: float [points], expected score of the aim for that spread; nan before the first
      estimate.
    * release_shift: float [s], by which the release was shifted before the throw; nan where nobody
      says.
    * note: str, default "". What went wrong.
    """

    aim: tuple[float, float]
    hit: tuple[float, float]
    score: int
    covariance: tuple[tuple[float, float], tuple[float, float]]
    expected: float
    release_shift: float
    note: str = ""


@dataclass(frozen=True)
class DartsRun:
    """All throws of one arm.

    * seed: int.
    * practice: what is learned from own throws, in a word.
    * board: (x, y, z) [m], position of the bull.
    * shown: (x, y) [mm] for each of the teacher's darts: hit minus aim.
    * darts: one Dart for each throw.
    """

    seed: int
    practice: str
    board: tuple[float, ...]
    shown: tuple[tuple[float, float], ...]
    darts: tuple[Dart, ...]


@dataclass(frozen=True)
class LegSummary:
    """A leg of 501 that was played.

    * darts: in order; finished: with a double.
    * expected: how many the policy takes on average, of a thrower with the spread that was known
      before [darts].
    """

    darts: tuple[LegDart, ...]
    finished: bool
    expected: float

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "finished": self.finished,
            "expected_darts": self.expected,
            "darts": [asdict(dart) for dart in self.darts],
        }

    @property
    def in_words(self) -> str:
        """The leg in a line."""
        how = (
            f"finished with dart {len(self.darts)}"
            if self.finished
            else f"not finished after {len(self.darts)} darts"
        )
        return (
            f"501, double out: {how}; {self.expected:.1f} are expected with the spread that was"
            " known before"
        )


@dataclass(frozen=True)
class DartsSummary:
    """A whole run of darts: trials as of any skill, what is particular to darts, and the leg, if
    one was played.
    """

    of: SkillSummary
    run: DartsRun
    leg: LegSummary | None = None

    def to_json(self) -> dict[str, Any]:
        """The run as a dictionary that strict JSON can hold."""
        own = {name: value for name, value in darts_json(self.run).items() if name != "seed"}
        return {
            **self.of.to_json(),
            **own,
            "leg": None if self.leg is None else self.leg.to_json(),
        }


def before_the_throw(agent: ModelBasedAgent, release_shift: float = float("nan")) -> Dart:
    """What is known of a dart before it is thrown where the agent aims.

    release_shift: by which the release is shifted [s]; nan where nobody says.
    """
    covariance = UNKNOWN
    if agent.spread is not None:
        across, up = agent.spread.covariance
        covariance = (as_pair(across), as_pair(up))
    return Dart(as_pair(agent.aim), UNSEEN, 0, covariance, agent.expected_score, release_shift)


def after_the_throw(dart: Dart, hit: np.ndarray, note: str = "") -> Dart:
    """The same with what was seen of it: hit (2,) [mm]. dart: before that; note: why it was not
    seen.
    """
    return replace(dart, hit=as_pair(hit), score=int(score(hit)), note=note)


def as_pair(values: np.ndarray) -> tuple[float, float]:
    """Two numbers (2,) as a tuple. values: the numbers."""
    return float(values[0]), float(values[1])


def summarise(run: DartsRun, block: int = BLOCK) -> list[dict]:
    """One row per block of throws: standard deviation and mean of the misses across and up [mm],
    beds aimed at, mean and expected score.

    run: all darts of one arm.
    """
    return [
        _row(start + 1, run.darts[start : start + block])
        for start in range(0, len(run.darts), block)
    ]


def _row(first: int, darts: tuple[Dart, ...]) -> dict:
    """The row of a block of darts; first: number of its first dart, from 1."""
    miss = np.array([np.subtract(dart.hit, dart.aim) for dart in darts])
    seen = np.isfinite(miss).all(axis=1)
    beds = [name_at(dart.aim) for dart in darts]
    expected = np.array([dart.expected for dart in darts])
    return {
        "first": first,
        "last": first + len(darts) - 1,
        "sd_across_mm": float(miss[seen, 0].std()) if seen.any() else None,
        "sd_up_mm": float(miss[seen, 1].std()) if seen.any() else None,
        "bias_across_mm": float(miss[seen, 0].mean()) if seen.any() else None,
        "bias_up_mm": float(miss[seen, 1].mean()) if seen.any() else None,
        "aims": list(dict.fromkeys(beds)),
        "mean_score": float(np.mean([dart.score for dart in darts])),
        "expected_score": float(np.nanmean(expected)) if np.isfinite(expected).any() else None,
        "release_shift_ms": 1e3 * shift if np.isfinite(shift := darts[-1].release_shift) else None,
        "unseen": int((~seen).sum()),
    }


def darts_table(run: DartsRun) -> str:
    """The rows of `summarise` as text. run: all darts of one arm."""
    head = (
        f"{'throws':>9}{'across [mm]':>16}{'up [mm]':>16}{'score':>8}{'expected':>10}{'release':>10}"
        "  aims"
    )
    x, _, height = run.board
    lines = [
        (
            f"seed {run.seed}, practice {run.practice}, bull {x:.2f} m from the base axis,"
            f" {height:.2f} m high"
        ),
        head,
    ]
    for row in summarise(run):
        columns = [
            f"{_or_dash(row[f'bias_{axis}_mm'], '+.1f')} +-"
            f" {_or_dash(row[f'sd_{axis}_mm'], '.1f')}".rjust(16)
            for axis in ("across", "up")
        ]
        numbers = f"{row['mean_score']:>8.1f}{_or_dash(row['expected_score'], '.1f'):>10}{_moved(row['release_shift_ms'])}"
        aims = f"{row['aims'][0]} to {row['aims'][-1]}" if len(row["aims"]) > 1 else row["aims"][0]
        lines.append(f"{row['first']:>4}-{row['last']:<4}{''.join(columns)}{numbers}  {aims}")
    notes = [f"  throw {n}: {dart.note}" for n, dart in enumerate(run.darts, start=1) if dart.note]
    return "\n".join([*lines, *notes[:10]])


def darts_json(run: DartsRun) -> dict:
    """Everything, with None for what is not known. run: all darts of one arm."""
    darts = [{key: _plain(value) for key, value in asdict(dart).items()} for dart in run.darts]
    return {
        "seed": run.seed,
        "practice": run.practice,
        "board": run.board,
        "shown": run.shown,
        "blocks": summarise(run),
        "darts": darts,
    }


def _plain(value: object) -> object:
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _or_dash(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def _moved(milliseconds: float | None) -> str:
    """By how much the release was moved, as a column."""
    return f"{'-':>10}" if milliseconds is None else f"{milliseconds:>+7.0f} ms"
