"""Finishing 501: where to aim for every remaining score and number of darts left.

`LegPolicy` is the solution, `CheckoutTable` the chance to finish in this turn, and `LegInPlay` a
leg as it is played: what is left after each dart, and when a turn or the leg is over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count
from dart_skill.darts._board import BED_IS_DOUBLE, BED_SCORES, HIGHEST_CHECKOUT, bed_at, place_of
from dart_skill.darts._candidates import (
    REFINEMENTS,
    best_play,
    candidates_at,
    finer,
    first_aims,
    thrower_of,
)
from dart_skill.darts._leg_solver import LARGEST_SCORE, Costs, after_dart
from dart_skill.darts._spread import Spread, SpreadByTarget

OBJECTIVES = ("turns", "darts")
HIGHEST_START = 1001


@dataclass(frozen=True, eq=False)
class LegPolicy:
    """Where to aim in each state of a leg, made by `solve_leg`.

    Parameters
    ----------
    aims : (n, 2) [mm]
    expected : (start + 1,)
        Expected number of turns (or darts) to the finish from each score at the start of a turn;
        NaN for 1.
    choices
        Three arrays of indices into aims, with three, two and one darts left: (start + 1, 1),
        (start + 1, 61) and (start + 1, 121). Row: score at the start of the turn; column: points
        of the turn so far; -1 for impossible states.
    spreads
        The spreads of the thrower, and the index of the spread of each aim.
    which : (n,)
        The spreads of the thrower, and the index of the spread of each aim.
    objective
        "turns" or "darts".
    """

    aims: np.ndarray
    expected: np.ndarray
    choices: tuple[np.ndarray, np.ndarray, np.ndarray]
    spreads: tuple[Spread, ...]
    which: np.ndarray
    objective: str

    @property
    def start(self) -> int:
        return len(self.expected) - 1

    def best_aim(
        self, remaining: int, darts_left: int = 3, turn_start: int | None = None
    ) -> np.ndarray:
        """Point (2,) [mm] to aim at with this remaining score and number of darts left.

        Parameters
        ----------
        turn_start
            Score before the turn, to which a bust returns; default None: remaining, so nothing is
            scored yet.

        Raises
        ------
        ValueError
            For a state that cannot be.
        """
        begun, scored = self.state(remaining, darts_left, turn_start)
        return self.aims[self.choices[3 - darts_left][begun, scored]]

    def state(
        self, remaining: int, darts_left: int = 3, turn_start: int | None = None
    ) -> tuple[int, int]:
        """The score before the turn and the points of the turn so far; arguments as in `best_aim`,
        ValueError if no turn stands so.
        """
        turn_start = remaining if turn_start is None else turn_start
        remaining, turn_start = (
            as_remaining(remaining, self.start),
            as_remaining(turn_start, self.start),
        )
        if darts_left not in (1, 2, 3):
            raise ValueError(f"darts_left must be 1, 2 or 3, got {darts_left!r}")
        scored, most = turn_start - remaining, LARGEST_SCORE * (3 - darts_left)
        if not 0 <= scored <= most:
            raise ValueError(
                f"a turn from {turn_start} cannot stand at {remaining} with {darts_left} darts"
                f" left: it scored 0 to {most} so far"
            )
        return turn_start, scored

    def target(self, remaining: int, darts_left: int = 3, turn_start: int | None = None) -> str:
        """Name of the bed of the best aim, or "outside D1" for a point beyond the double ring;
        arguments as in `best_aim`.
        """
        return place_of(self.best_aim(remaining, darts_left, turn_start))


@dataclass(frozen=True, eq=False)
class CheckoutTable:
    """Best chances to finish within one, two or three darts, made by `checkout_table`.

    Parameters
    ----------
    probability : (n, 3)
        Highest probability to finish, from scores 0 to n - 1.
    aims : (n, 3, 2) [mm]
        For the first of these darts.
    """

    probability: np.ndarray
    aims: np.ndarray


def solve_leg(
    spread: Spread | SpreadByTarget | float | ArrayLike, start: int = 501, objective: str = "turns"
) -> LegPolicy:
    """The policy with the fewest expected turns (or darts) to finish from `start`, double out, for
    a thrower without opponent.

    Parameters
    ----------
    spread
        A Spread, a sigma [mm], a covariance (2, 2) [mm^2], or a SpreadByTarget such as
        `professional()`.
    start
        Int from 2 to 1001, default 501.
    objective
        "turns" (default) or "darts".

    Raises
    ------
    ValueError
        For another start or objective.
    """
    start = as_start(start)
    if objective not in OBJECTIVES:
        raise ValueError(f"objective must be one of {', '.join(OBJECTIVES)}, got {objective!r}")
    thrower = thrower_of(spread)
    costs = Costs(0.0, 1.0) if objective == "turns" else Costs(1.0, 0.0)
    candidates, (expected, choices) = best_play(thrower, start, costs)
    return LegPolicy(
        candidates.aims, expected, choices, thrower.spreads, candidates.which, objective
    )


def checkout_table(
    spread: Spread | SpreadByTarget | float | ArrayLike, highest: int = HIGHEST_CHECKOUT
) -> CheckoutTable:
    """The best chances to finish within the darts of this turn, from scores up to `highest`; a
    failure costs nothing.

    Parameters
    ----------
    spread
        As in `solve_leg`.
    """
    highest = as_count(highest, "highest", 2)
    thrower = thrower_of(spread)
    aims = first_aims(thrower)
    for share in (*REFINEMENTS, None):
        candidates = candidates_at(aims, thrower)
        after, probability, choices = np.eye(1, highest + 1)[0], [], []
        for _ in range(3):
            left, bust = after_dart(np.arange(highest + 1))
            values = candidates.results @ np.where(bust, 0.0, after[left]).T
            values[:, :2] = 0.0
            choices.append(values.argmax(axis=0))
            probability.append(values.max(axis=0))
            after = np.concatenate([[1.0], probability[-1][1:]])
        if share is not None:
            aims = finer(aims, tuple(choices), share * thrower.grid_distance)
    return CheckoutTable(np.column_stack(probability), aims[np.column_stack(choices)])


def as_remaining(value: int, start: int, name: str = "remaining") -> int:
    """A score that can be left in a leg from `start`."""
    remaining = as_count(value, name, 2)
    if remaining > start:
        raise ValueError(
            f"{name} must be between 2 and {start}, where this leg starts, got {remaining}"
        )
    return remaining


def as_start(value: int) -> int:
    """A score from which a leg can start."""
    start = as_count(value, "start", 2)
    if start > HIGHEST_START:
        raise ValueError(f"start must be at most {HIGHEST_START}, got {start}")
    return start


PER_TURN = 3


@dataclass(frozen=True)
class LegDart:
    """A dart of a leg.

    Parameters
    ----------
    before
        What was left before it.
    after
        What is left then, after a bust as much as at the start of the turn.
    hit
        Name of the place that it hit, such as T20, or what became of it.
    points
        Of the dart, whether they count or not.
    bust
        They do not.
    """

    before: int
    after: int
    hit: str
    points: int
    bust: bool = False


class LegInPlay:
    """501, double out, dart by dart.

    Parameters
    ----------
    start
        The score at the start, default 501.

    Attributes
    ----------
    darts
        That were thrown, in order.
    remaining
        What is left.
    turn_start
        What was left when the turn began, to which a bust returns.
    darts_left
        Of the turn.
    """

    def __init__(self, start: int = 501):
        self.remaining = self.turn_start = as_count(start, "start", 2)
        self.darts_left = PER_TURN
        self.darts: list[LegDart] = []

    @property
    def is_over(self) -> bool:
        """Whether it was finished with a double."""
        return self.remaining == 0

    def hit(self, point: ArrayLike) -> LegDart:
        """A dart that hit a point (2,) [mm]."""
        bed = int(bed_at(point))
        return self._thrown(place_of(point), int(BED_SCORES[bed]), bool(BED_IS_DOUBLE[bed]))

    def lost(self, why: str) -> LegDart:
        """A dart that was not seen on the board: it scores nothing.

        Parameters
        ----------
        why
            What became of it.
        """
        return self._thrown(why, 0, False)

    def _thrown(self, hit: str, points: int, double: bool) -> LegDart:
        if self.is_over:
            raise ValueError(
                f"the leg was finished with dart {len(self.darts)}: begin another one"
            )
        before, left = self.remaining, self.remaining - points
        bust = left < 0 or left == 1 or (left == 0 and not double)
        self.remaining = self.turn_start if bust else left
        self.darts_left -= 1
        if bust or not self.darts_left:
            self.turn_start, self.darts_left = self.remaining, PER_TURN
        self.darts.append(LegDart(before, self.remaining, hit, points, bust))
        return self.darts[-1]
