"""Finishing 501: where to aim for every remaining score and number of darts left, by dynamic programming over turns of 3 darts.

A turn is bust if it would leave 1 or less than 0, or 0 without a double (the double bull is one). Then it ends, and its points
do not count. V(s) is the expected number of turns from the score s at the start of a turn. It is computed for s = 2, 3, ...
A turn leads to smaller scores, whose V is known, or by misses or bust back to s. For fixed actions V(s) = a + b V(s), so
V(s) = a / (1 - b). Then the actions are chosen again for this V(s), until nothing changes. This is policy iteration (Howard)
in one unknown. Aims come from a grid, and then from finer grids around the chosen ones. The loss by the distance of the aims is
below 0.003 turns from 501 (measured with a quarter of the distance).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.checks import as_count
from dart_skill.darts._board import BED_IS_DOUBLE, BED_SCORES, RADII, bed_at, bed_centres, place_of
from dart_skill.darts._exact import bed_probabilities
from dart_skill.darts._optimum import best_aim
from dart_skill.darts._spread import Spread, SpreadByTarget, as_spread

OBJECTIVES = ("turns", "darts")
LARGEST_SCORE = 60
GRID, GRID_PER_SPREAD, REFINEMENTS = 8.0, 0.125, (0.5, 0.25)
"""Distance of the first aims: the larger of GRID [mm] and GRID_PER_SPREAD sigmas. REFINEMENTS: the finer ones, relative to it."""
REACH = 2.0
"""Aims may be so far beyond the board [sigmas]: a dart off the board cannot bust."""
MAX_ROUNDS = 50
HIGHEST_START = 1001

_OUTCOMES, _OUTCOME_OF_BED = np.unique(2 * BED_SCORES + BED_IS_DOUBLE, return_inverse=True)
POINTS, IS_DOUBLE = _OUTCOMES // 2, _OUTCOMES % 2 == 1
"""The distinct results of a dart (63,): its points, and whether it is a double."""


Which = Callable[[np.ndarray], np.ndarray]
"""From aims (n, 2) to the index (n,) of the spread of each."""
Choices = tuple[np.ndarray, np.ndarray, np.ndarray]
"""For 0, 1 and 2 darts that are used: the chosen aim by the score before the turn, and by what has been scored since."""
Settled = tuple[list[np.ndarray], list[np.ndarray]]
"""Values and choices (start + 1,) with two darts left and with one, where they do not depend on the score before the turn."""


class Candidates(NamedTuple):
    """aims (n, 2) [mm]; results (n, 63): probability of each result of a dart; which (n,): index of the spread of each aim."""

    aims: np.ndarray
    results: np.ndarray
    which: np.ndarray


class _Dart(NamedTuple):
    """For k remaining scores: choice (k,), the best candidate; fixed (k,) and returning (k,), a and b of the expected cost
    a + b V(s) from there to the end of the leg.
    """

    choice: np.ndarray
    fixed: np.ndarray
    returning: np.ndarray


@dataclass(frozen=True, eq=False)
class LegPolicy:
    """Where to aim in each state of a leg, made by `solve_leg`.

    * aims (n, 2) [mm].
    * expected (start + 1,): expected number of turns (or darts) to the finish from each score at the start of a turn; NaN for 1.
    * choices: three arrays of indices into aims, with three, two and one darts left: (start + 1, 1), (start + 1, 61) and
      (start + 1, 121). Row: score at the start of the turn; column: points of the turn so far; -1 for impossible states.
    * spreads, which (n,): the spreads of the thrower, and the index of the spread of each aim.
    * objective: "turns" or "darts".
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

    def best_aim(self, remaining: int, darts_left: int = 3, turn_start: int | None = None) -> np.ndarray:
        """Point (2,) [mm] to aim at with this remaining score and number of darts left.

        turn_start: score before the turn, to which a bust returns; default None: remaining, so nothing is scored yet.
        """
        turn_start = remaining if turn_start is None else turn_start
        remaining, turn_start = _as_remaining(remaining, self.start), _as_remaining(turn_start, self.start)
        if darts_left not in (1, 2, 3):
            raise ValueError(f"darts_left must be 1, 2 or 3, got {darts_left!r}")
        scored, most = turn_start - remaining, LARGEST_SCORE * (3 - darts_left)
        if not 0 <= scored <= most:
            raise ValueError(
                f"a turn from {turn_start} cannot stand at {remaining} with {darts_left} darts left: it scored 0 to {most} so far"
            )
        return self.aims[self.choices[3 - darts_left][turn_start, scored]]

    def target(self, remaining: int, darts_left: int = 3, turn_start: int | None = None) -> str:
        """Name of the bed of the best aim, or "outside D1" for a point beyond the double ring; arguments as in `best_aim`."""
        return place_of(self.best_aim(remaining, darts_left, turn_start))


@dataclass(frozen=True, eq=False)
class CheckoutTable:
    """Best chances to finish within one, two or three darts, made by `checkout_table`.

    * probability (n, 3): highest probability to finish, from scores 0 to n - 1.
    * aims (n, 3, 2) [mm]: for the first of these darts.
    """

    probability: np.ndarray
    aims: np.ndarray


def solve_leg(spread: Spread | SpreadByTarget | float | ArrayLike, start: int = 501, objective: str = "turns") -> LegPolicy:
    """The policy with the fewest expected turns (or darts) to finish from `start`, double out, for a thrower without opponent.

    Parameters:

    * spread: a Spread, a sigma [mm], a covariance (2, 2) [mm^2], or a SpreadByTarget such as `professional()`.
    * start: int from 2 to 1001, default 501.
    * objective: "turns" (default) or "darts".
    """
    start = as_count(start, "start", 2)
    if start > HIGHEST_START:
        raise ValueError(f"start must be at most {HIGHEST_START}, got {start}")
    if objective not in OBJECTIVES:
        raise ValueError(f"objective must be one of {', '.join(OBJECTIVES)}, got {objective!r}")
    spreads, which = _spreads_of(spread)
    aims = first_aims(spreads)
    for share in (*REFINEMENTS, None):
        candidates = candidates_at(aims, spreads, which)
        expected, choices = _solve(candidates, start, objective)
        if share is not None:
            aims = _finer(aims, choices, share * _grid_distance(spreads))
    return LegPolicy(aims, expected, choices, spreads, candidates.which, objective)


def checkout_table(spread: Spread | SpreadByTarget | float | ArrayLike, highest: int = 170) -> CheckoutTable:
    """The best chances to finish within the darts of this turn, from scores up to `highest`; a failure costs nothing.

    spread: as in `solve_leg`.
    """
    highest = as_count(highest, "highest", 2)
    spreads, which = _spreads_of(spread)
    aims = first_aims(spreads)
    for share in (*REFINEMENTS, None):
        candidates = candidates_at(aims, spreads, which)
        after, probability, choices = np.eye(1, highest + 1)[0], [], []
        for _ in range(3):
            values = candidates.results @ _after_dart(np.arange(highest + 1), after, bust=0.0).T
            values[:, :2] = 0.0
            choices.append(values.argmax(axis=0))
            probability.append(values.max(axis=0))
            after = np.concatenate([[1.0], probability[-1][1:]])
        if share is not None:
            aims = _finer(aims, tuple(choices), share * _grid_distance(spreads))
    return CheckoutTable(np.column_stack(probability), aims[np.column_stack(choices)])


def simulate_legs(policy: LegPolicy, n_legs: int, rng: np.random.Generator, max_turns: int = 10_000) -> tuple[np.ndarray, np.ndarray]:
    """Simulates legs dart by dart with random impacts; returns the numbers of turns (n_legs,) and of darts (n_legs,)."""
    turn_start = np.full(as_count(n_legs, "n_legs"), policy.start)
    turns, darts = np.zeros(n_legs, dtype=int), np.zeros(n_legs, dtype=int)
    playing: np.ndarray = np.arange(n_legs)
    for _ in range(max_turns):
        if len(playing) == 0:
            return turns, darts
        remaining, used = _play_turn(policy, turn_start[playing], rng)
        turns[playing] += 1
        darts[playing] += used
        turn_start[playing] = remaining
        playing = playing[remaining > 0]
    raise ValueError(f"{len(playing)} of {n_legs} legs are not finished after {max_turns} turns; raise max_turns")


def _play_turn(policy: LegPolicy, turn_start: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Score (n,) after a turn from scores (n,), and the darts thrown in it (n,)."""
    remaining, used = turn_start.copy(), np.zeros(len(turn_start), dtype=int)
    on = np.arange(len(turn_start))
    for table in policy.choices:
        choice = table[turn_start[on], turn_start[on] - remaining[on]]
        beds = bed_at(_impacts(policy, choice, rng))
        left = remaining[on] - BED_SCORES[beds]
        bust = (left < 0) | (left == 1) | ((left == 0) & ~BED_IS_DOUBLE[beds])
        used[on] += 1
        remaining[on] = np.where(bust, turn_start[on], left)
        on = on[~bust & (left > 0)]
    return remaining, used


def _impacts(policy: LegPolicy, choice: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    factors = np.array([np.linalg.cholesky(spread.covariance) for spread in policy.spreads])
    biases = np.array([spread.bias for spread in policy.spreads])
    which = policy.which[choice]
    return policy.aims[choice] + biases[which] + np.einsum("nij,nj->ni", factors[which], rng.standard_normal((len(choice), 2)))


def _spreads_of(spread: Spread | SpreadByTarget | float | ArrayLike) -> tuple[tuple[Spread, ...], Which]:
    """The spreads of a thrower, and a function from aims (n, 2) to the index (n,) of the spread of each."""
    if isinstance(spread, SpreadByTarget):
        return spread.all_spreads, spread.which
    return (as_spread(spread),), lambda aims: np.zeros(len(aims), dtype=int)


def first_aims(spreads: tuple[Spread, ...]) -> np.ndarray:
    """First aims (n, 2) [mm]: middles of the beds, the best aim for score, and a grid over the board and beyond."""
    distance = _grid_distance(spreads)
    reach = RADII[-1] + REACH * max(spread.deviations[1] for spread in spreads)
    steps = np.arange(-reach, reach + distance, distance)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    grid = grid[np.hypot(*grid.T) < reach]
    bias = np.mean([spread.bias for spread in spreads], axis=0)
    best = [best_aim(spread).point for spread in spreads]
    return np.concatenate([bed_centres() - bias, grid - bias, best])


def _grid_distance(spreads: tuple[Spread, ...]) -> float:
    return max(GRID, GRID_PER_SPREAD * min(spread.deviations[0] for spread in spreads))


def candidates_at(aims: np.ndarray, spreads: tuple[Spread, ...], which: Which) -> Candidates:
    index = which(aims)
    beds = np.empty((len(aims), len(BED_SCORES)))
    for number, spread in enumerate(spreads):
        beds[index == number] = bed_probabilities(aims[index == number], spread)
    return Candidates(aims, beds @ np.eye(len(POINTS))[_OUTCOME_OF_BED], index)


def _finer(aims: np.ndarray, choices: tuple[np.ndarray, ...], distance: float) -> np.ndarray:
    """The chosen aims, and for each its eight neighbours at this distance [mm]."""
    chosen = np.unique(np.concatenate([table[table >= 0].ravel() for table in choices]))
    offsets = distance * (np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2))
    around = (aims[chosen][:, None] + offsets).reshape(-1, 2)
    return np.unique(around.round(6), axis=0)


def _solve(candidates: Candidates, start: int, objective: str) -> tuple[np.ndarray, Choices]:
    expected = np.full(start + 1, np.nan)
    expected[0] = 0.0
    first, second, third = (np.full((start + 1, 1 + LARGEST_SCORE * used), -1) for used in range(3))
    choices = (first, second, third)
    settled = [np.full(start + 1, np.nan), np.full(start + 1, np.nan)], [np.full(start + 1, -1), np.full(start + 1, -1)]
    for score in range(2, start + 1):
        expected[score] = _solve_turn(score, candidates, expected, choices, settled, objective)
        _settle(score, candidates, expected, settled, objective)
    return expected, choices


def _solve_turn(score: int, candidates: Candidates, expected: np.ndarray, choices: Choices, settled: Settled, objective: str) -> float:
    """V(score) by policy iteration; the choices of this turn are written into `choices`."""
    guess = expected[score - 1] if score > 2 else 20.0
    for _ in range(MAX_ROUNDS):
        first = _turn(score, guess, candidates, expected, choices, settled, objective)
        value = float(first.fixed[0] / (1.0 - first.returning[0]))
        if abs(value - guess) <= 1e-12 * value:
            break
        guess = value
    return value


def _turn(
    score: int, guess: float, candidates: Candidates, expected: np.ndarray, choices: Choices, settled: Settled, objective: str
) -> _Dart:
    """Best actions of one turn from a score, if V(score) is `guess`: last dart first; returns those of the first dart."""
    fixed, returning = expected[: score + 1].copy(), np.zeros(score + 1)
    fixed[score], returning[score] = 0.0, 1.0
    for used in (2, 1, 0):
        lowest = max(2, score - LARGEST_SCORE * used)
        remaining = np.arange(lowest, score + 1)
        free = _is_settled(remaining, score, used)
        new_fixed, new_returning = np.zeros(score + 1), np.zeros(score + 1)
        choice = np.empty(len(remaining), dtype=int)
        if free.any():
            new_fixed[remaining[free]] = settled[0][used - 1][remaining[free]]
            choice[free] = settled[1][used - 1][remaining[free]]
        dart = _best_dart(remaining[~free], fixed, returning, guess, candidates, _dart_cost(objective))
        new_fixed[remaining[~free]], new_returning[remaining[~free]], choice[~free] = dart.fixed, dart.returning, dart.choice
        choices[used][score, score - remaining] = choice
        fixed, returning = new_fixed, new_returning
    return dart._replace(fixed=dart.fixed + (objective == "turns"))


def _is_settled(remaining: np.ndarray, score: int, used: int) -> np.ndarray:
    """Mask of the states with one or two darts left in which no dart can bust, so that the score before the turn does not matter."""
    if used == 0:
        return np.zeros(len(remaining), dtype=bool)
    return (remaining >= 2 + LARGEST_SCORE * (3 - used)) & (remaining < score)


def _settle(score: int, candidates: Candidates, expected: np.ndarray, settled: Settled, objective: str) -> None:
    """Compute values and choices with one and two darts left at this score, for turns that started at higher scores."""
    values, choices = settled
    after = expected[: score + 1]
    for used in (2, 1):
        if score < 2 + LARGEST_SCORE * (3 - used):
            return
        dart = _best_dart(np.array([score]), after, np.zeros(score + 1), 0.0, candidates, _dart_cost(objective))
        values[used - 1][score], choices[used - 1][score] = dart.fixed[0], dart.choice[0]
        after = values[used - 1][: score + 1]


def _dart_cost(objective: str) -> float:
    return 1.0 if objective == "darts" else 0.0


def _best_dart(remaining: np.ndarray, fixed: np.ndarray, returning: np.ndarray, guess: float, candidates: Candidates, cost: float) -> _Dart:
    """The best aims for remaining scores (k,); fixed + returning * V(s), (s + 1,), is the cost of each score after the dart."""
    after_fixed, after_returning = _after_dart(remaining, fixed, bust=0.0), _after_dart(remaining, returning, bust=1.0)
    choice = ((after_fixed + guess * after_returning) @ candidates.results.T).argmin(axis=1)
    chosen = candidates.results[choice]
    return _Dart(choice, cost + np.einsum("ko,ko->k", chosen, after_fixed), np.einsum("ko,ko->k", chosen, after_returning))


def _after_dart(remaining: np.ndarray, values: np.ndarray, bust: float) -> np.ndarray:
    """Values (k, 63) of the scores after each result of a dart; `bust` where the result has too many points or is no double."""
    left = remaining[:, None] - POINTS
    is_bust = (left < 0) | (left == 1) | ((left == 0) & ~IS_DOUBLE)
    return np.where(is_bust, bust, values[np.maximum(left, 0)])


def _as_remaining(value: int, start: int) -> int:
    remaining = as_count(value, "remaining", 2)
    if remaining > start:
        raise ValueError(f"remaining must be between 2 and {start}, where this leg starts, got {remaining}")
    return remaining
