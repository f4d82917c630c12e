"""Darts: own throws whose aims are chosen by the spread of the thrower, each of which is learned
from, and a leg of 501; what the arm aimed at, hit and knew of itself, throw by throw and in blocks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from dart_skill.darts import (
    LegDart,
    LegInPlay,
    ModelBasedAgent,
    name_at,
    place_of,
    score,
    solve_leg,
)
from dart_skill.skills.protocol import TaskOutcome

if TYPE_CHECKING:
    from dart_skill.session._in_process import Session
    from dart_skill.skills.darts import Darts
    from dart_skill.skills.practice import PractisingSkill

BLOCK = 25
"""Throws of a row of the table."""
MOST_DARTS = 120
"""A leg that takes more is given up."""
UNSEEN = (math.nan, math.nan)
"""Place of a dart that was not seen [mm]."""
UNKNOWN = ((0.0, 0.0), (0.0, 0.0))
"""Spread before the first estimate [mm^2]."""


@dataclass(frozen=True)
class Dart:
    """One throw.

    Parameters
    ----------
    aim
        (x, y) [mm] on the board.
    hit
        (x, y) [mm] on the board; nan if the cameras did not see it or nothing was thrown.
    score
        Int, as seen; 0 if nothing was seen.
    covariance
        (2, 2) [mm^2], spread of the thrower as estimated before the throw; 0 before the first
        estimate.
    expected
        Float [points], expected score of the aim for that spread; nan before the first estimate.
    release_shift
        Float [s], by which the release was shifted before the throw; nan if unknown.
    note
        Str, default "". What went wrong.
    """

    aim: tuple[float, float]
    hit: tuple[float, float]
    score: int
    covariance: tuple[tuple[float, float], tuple[float, float]]
    expected: float
    release_shift: float
    note: str = ""

    @classmethod
    def aimed_by(cls, agent: ModelBasedAgent, release_shift: float = math.nan) -> Dart:
        """A dart before it is thrown where the agent aims.

        Parameters
        ----------
        release_shift
            By which the release is shifted [s]; nan if unknown.
        """
        covariance = UNKNOWN
        if agent.spread is not None:
            across, up = agent.spread.covariance
            covariance = (as_pair(across), as_pair(up))
        return cls(as_pair(agent.aim), UNSEEN, 0, covariance, agent.expected_score, release_shift)

    def seen_at(self, hit: np.ndarray, note: str = "") -> Dart:
        """The same dart after it was seen to hit a place.

        Parameters
        ----------
        hit
            (2,) [mm] on the board.
        note
            Why it was not learned from.
        """
        return replace(self, hit=as_pair(hit), score=int(score(hit)), note=note)


@dataclass(frozen=True)
class LegSummary:
    """A leg of 501 that was played.

    Parameters
    ----------
    darts
        In order.
    finished
        With a double.
    expected
        How many the policy takes on average, of a thrower with the spread that was known before
        [darts].
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
class DartsRun:
    """All throws of one arm.

    Parameters
    ----------
    seed
        Int.
    practice
        What is learned from own throws, in a word.
    board
        (x, y, z) [m], position of the bull.
    shown
        (x, y) [mm] for each of the teacher's darts: hit minus aim.
    darts
        One Dart for each throw.
    leg
        That was played after them, None without one.
    allowed
        The score that the arm's scatter allows, before and after them [points]; () if that was
        not measured.
    """

    seed: int
    practice: str
    board: tuple[float, ...]
    shown: tuple[tuple[float, float], ...]
    darts: tuple[Dart, ...]
    leg: LegSummary | None = None
    allowed: tuple[float, ...] = ()

    def blocks(self, block: int = BLOCK) -> list[dict[str, Any]]:
        """One row per block of throws: standard deviation and mean of the misses across and up
        [mm], beds aimed at, mean and expected score.

        Parameters
        ----------
        block
            Throws of a row.
        """
        starts = range(0, len(self.darts), block)
        return [_row(start + 1, self.darts[start : start + block]) for start in starts]

    def table(self) -> str:
        """The rows of `blocks` as text, the first notes, and the leg in a line."""
        x, _, height = self.board
        lines = [
            f"seed {self.seed}, practice {self.practice}, bull {x:.2f} m from the base axis,"
            f" {height:.2f} m high",
            f"{'throws':>9}{'across [mm]':>16}{'up [mm]':>16}{'score':>8}{'expected':>10}"
            f"{'release':>10}  aims",
            *map(_in_a_line, self.blocks()),
        ]
        notes = [f"  throw {n}: {one.note}" for n, one in enumerate(self.darts, 1) if one.note]
        leg = [] if self.leg is None else [self.leg.in_words]
        return "\n".join([*lines, *notes[:10], *leg])

    def to_json(self, seed: bool = True) -> dict[str, Any]:
        """Everything, with None for what is not known.

        Parameters
        ----------
        seed
            Whether the throws stand alone: with their seed, without a leg.
        """
        told = {
            "practice": self.practice,
            "board": self.board,
            "shown": self.shown,
            "blocks": self.blocks(),
            "darts": [
                {key: _plain(value) for key, value in asdict(dart).items()} for dart in self.darts
            ],
        }
        if seed:
            return {"seed": self.seed, **told, "allowed": _plain(self.allowed)}
        return {**told, "leg": None if self.leg is None else self.leg.to_json()}


@dataclass(frozen=True)
class Hit:
    """Where a dart went.

    Parameters
    ----------
    place
        (2,) [mm] on the board, None if it was not seen or nothing was thrown.
    note
        What there is to say of it.
    outcome
        On the board or not, and how far from the aim [m].
    refused
        Whether there was no plan for it, or it was stopped.
    """

    place: np.ndarray | None
    note: str = ""
    outcome: TaskOutcome = TaskOutcome(False, math.nan)
    refused: bool = False


def throw_dart(session: Session, learned: PractisingSkill, skill: Darts, aim: np.ndarray) -> Hit:
    """A dart at a point (2,) [mm] of the board, which is learned from; its note says why there is
    no plan for it, or it was stopped.

    Parameters
    ----------
    aim
        The point.
    """
    try:
        plan = learned.plan(skill.target(skill.aimed(aim)))
        trial = session.throw(plan)
    except ValueError as error:
        return Hit(None, str(error), refused=True)
    seen = trial.outcome
    if not seen.landing_seen:
        return Hit(None, "the cameras did not see where the dart went")
    told = learned.tell(plan, trial.demonstration)
    outcome = TaskOutcome(bool(seen.in_basket), float(seen.landing_error))
    return Hit(skill.face.on_board(seen.landing), "" if told.kept else told.reason, outcome)


def own_dart(
    session: Session, learned: PractisingSkill, skill: Darts, agent: ModelBasedAgent
) -> tuple[Dart, Hit]:
    """Throw one dart where the agent aims; the agent and the skill learn from it.

    Parameters
    ----------
    learned
        The skill.
    """
    dart = Dart.aimed_by(agent, learned.release_shift)
    hit = throw_dart(session, learned, skill, agent.aim)
    if hit.refused:
        agent.cannot()
    if hit.place is None:
        return replace(dart, note=hit.note), hit
    agent.tell(hit.place)
    return dart.seen_at(hit.place, hit.note), hit


def play_leg(
    agent: ModelBasedAgent, throw: Callable[[np.ndarray], Hit], say: Callable[[str], None]
) -> LegSummary | None:
    """501, double out, with as few darts as the spread that the agent knows allows; None before it
    knows one.

    Parameters
    ----------
    throw
        At a point (2,) [mm] of the board. The arm learns from these darts, too: a miss that
        repeats at one bed would repeat for ever.
    say
        Called with what goes on, in words.
    """
    if agent.spread is None:
        say("no leg of 501: the spread is not known yet; let more darts be thrown (--throws)")
        return None
    policy, leg = solve_leg(agent.spread, objective="darts"), LegInPlay()
    say(f"501, double out: {policy.expected[leg.remaining]:.1f} darts are expected")
    while not leg.is_over and len(leg.darts) < MOST_DARTS:
        aim = policy.best_aim(leg.remaining, leg.darts_left, leg.turn_start)
        hit = throw(aim)
        dart = leg.lost(hit.note) if hit.place is None else leg.hit(hit.place)
        bust = ", bust" if dart.bust else ""
        say(
            f"501, dart {len(leg.darts)}: {dart.before} left, at {place_of(aim)}: {dart.hit},"
            f" {dart.points} points{bust}"
        )
    return LegSummary(tuple(leg.darts), leg.is_over, float(policy.expected[501]))


def as_pair(values: Iterable[float]) -> tuple[float, float]:
    """Two numbers (2,) as a tuple.

    Parameters
    ----------
    values
        The numbers.
    """
    first, second = values
    return float(first), float(second)


def _row(first: int, darts: tuple[Dart, ...]) -> dict[str, Any]:
    """The row of a block of darts; first: number of its first dart, from 1."""
    miss = np.array([np.subtract(dart.hit, dart.aim) for dart in darts])
    seen = miss[np.isfinite(miss).all(axis=1)]
    off = {}
    for axis, values in zip(("across", "up"), seen.T, strict=True):
        off[f"sd_{axis}_mm"] = float(values.std()) if len(seen) else None
        off[f"bias_{axis}_mm"] = float(values.mean()) if len(seen) else None
    expected = np.array([dart.expected for dart in darts])
    return {
        "first": first,
        "last": first + len(darts) - 1,
        **off,
        "aims": list(dict.fromkeys(name_at(dart.aim) for dart in darts)),
        "mean_score": float(np.mean([dart.score for dart in darts])),
        "expected_score": float(np.nanmean(expected)) if np.isfinite(expected).any() else None,
        "release_shift_ms": 1e3 * shift if np.isfinite(shift := darts[-1].release_shift) else None,
        "unseen": len(darts) - len(seen),
    }


def _in_a_line(row: dict[str, Any]) -> str:
    """A row of `DartsRun.blocks` as a line of the table."""
    columns = [
        f"{_or_dash(row[f'bias_{axis}_mm'], '+.1f')} +- {_or_dash(row[f'sd_{axis}_mm'], '.1f')}"
        for axis in ("across", "up")
    ]
    release = "-" if row["release_shift_ms"] is None else f"{row['release_shift_ms']:+.0f} ms"
    aims = row["aims"]
    return (
        f"{row['first']:>4}-{row['last']:<4}{columns[0]:>16}{columns[1]:>16}"
        f"{row['mean_score']:>8.1f}{_or_dash(row['expected_score'], '.1f'):>10}{release:>10}  "
        + (f"{aims[0]} to {aims[-1]}" if len(aims) > 1 else aims[0])
    )


def _plain(value: object) -> object:
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _or_dash(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
