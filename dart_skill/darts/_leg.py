"""Finishing 501: where to aim for every remaining score and number of darts left.

`_leg_solver` chooses between given aims. Here they are laid out: at first on a grid, then around those that were chosen, twice. This costs
at most 0.03 % more turns from 501, and 0.3 % more from any score, than aims on a grid of 5 mm or 0.3 sigmas that are refined four times
(measured for sigmas from 1 to 100 mm).
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
from dart_skill.darts._leg_solver import LARGEST_SCORE, POINTS, RESULT_OF_BED, Everywhere, Nearby, after_dart, solve
from dart_skill.darts._optimum import local_optima
from dart_skill.darts._spread import Spread, SpreadByTarget, as_spread

OBJECTIVES = ("turns", "darts")
GRID, GRID_PER_SPREAD, REFINEMENTS = 12.0, 0.5, (0.4, 0.15)
"""Distance of the first aims: the larger of GRID [mm] and GRID_PER_SPREAD sigmas. REFINEMENTS: the finer ones, relative to it."""
PEAKS_FROM = 6.0
"""For a narrower spread [mm] the peaks are the middles of beds."""
REACH = 2.0
"""Aims may be so far beyond the board [sigmas]: a dart off the board cannot bust."""
AROUND = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]), axis=-1).reshape(-1, 2)
HIGHEST_START = 1001

Which = Callable[[np.ndarray], np.ndarray]
"""From aims (n, 2) to the index (n,) of the spread of each."""
Choices = tuple[np.ndarray, np.ndarray, np.ndarray]
"""For 0, 1 and 2 darts that are used: the chosen aim by the score before the turn, and by what has been scored since."""


class Candidates(NamedTuple):
    """aims (n, 2) [mm]; results (n, 63): probability of each result of a dart; which (n,): index of the spread of each aim."""

    aims: np.ndarray
    results: np.ndarray
    which: np.ndarray


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

        turn_start: score before the turn, to which a bust returns; default None: remaining, so nothing is scored yet. ValueError for a
        state that cannot be.
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

    ValueError for another start or objective.
    """
    start = as_count(start, "start", 2)
    if start > HIGHEST_START:
        raise ValueError(f"start must be at most {HIGHEST_START}, got {start}")
    if objective not in OBJECTIVES:
        raise ValueError(f"objective must be one of {', '.join(OBJECTIVES)}, got {objective!r}")
    spreads, which = _spreads_of(spread)
    aims = first_aims(spreads)
    costs = (0.0, 1.0) if objective == "turns" else (1.0, 0.0)
    candidates = candidates_at(aims, spreads, which)
    expected, choices = solve(Everywhere(candidates.results), start, *costs)
    for share in REFINEMENTS:
        aims, near = _nearby(aims, choices, share * _grid_distance(spreads))
        candidates = candidates_at(aims, spreads, which)
        expected, choices = solve(Nearby(candidates.results, near), start, *costs, expected)
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
            left, bust = after_dart(np.arange(highest + 1))
            values = candidates.results @ np.where(bust, 0.0, after[left]).T
            values[:, :2] = 0.0
            choices.append(values.argmax(axis=0))
            probability.append(values.max(axis=0))
            after = np.concatenate([[1.0], probability[-1][1:]])
        if share is not None:
            aims = _finer(aims, tuple(choices), share * _grid_distance(spreads))
    return CheckoutTable(np.column_stack(probability), aims[np.column_stack(choices)])


def simulate_legs(policy: LegPolicy, n_legs: int, rng: np.random.Generator, max_turns: int = 10_000) -> tuple[np.ndarray, np.ndarray]:
    """Simulates legs dart by dart with random impacts; returns the numbers of turns (n_legs,) and of darts (n_legs,).

    policy: from `solve_leg`; max_turns: of one leg. ValueError if a leg takes more turns.
    """
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
    """First aims (n, 2) [mm]: middles of the beds, a grid over the board and beyond, and where the expected score has its peaks.

    With much to go peaks may be nearly equally good, and a grid would choose between them by where its points happen to lie.
    """
    distance = _grid_distance(spreads)
    reach = RADII[-1] + REACH * max(spread.deviations[1] for spread in spreads)
    steps = np.arange(-reach, reach + distance, distance)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    grid = grid[np.hypot(*grid.T) < reach]
    bias = np.mean([spread.bias for spread in spreads], axis=0)
    peaks = [aim.point for spread in spreads if spread.deviations[0] > PEAKS_FROM for aim in local_optima(spread)]
    return np.concatenate([bed_centres() - bias, grid - bias, np.reshape(peaks, (-1, 2))])


def _grid_distance(spreads: tuple[Spread, ...]) -> float:
    return max(GRID, GRID_PER_SPREAD * min(spread.deviations[0] for spread in spreads))


def candidates_at(aims: np.ndarray, spreads: tuple[Spread, ...], which: Which) -> Candidates:
    index = which(aims)
    beds = np.empty((len(aims), len(BED_SCORES)))
    for number, spread in enumerate(spreads):
        beds[index == number] = bed_probabilities(aims[index == number], spread)
    return Candidates(aims, beds @ np.eye(len(POINTS))[RESULT_OF_BED], index)


def _finer(aims: np.ndarray, choices: tuple[np.ndarray, ...], distance: float) -> np.ndarray:
    """The chosen aims, and for each its four neighbours at this distance [mm]."""
    chosen = np.unique(np.concatenate([table[table >= 0] for table in choices]))
    offsets = distance * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    return np.unique((aims[chosen][:, None] + offsets).reshape(-1, 2).round(6), axis=0)


def _nearby(aims: np.ndarray, choices: tuple[np.ndarray, ...], distance: float) -> tuple[np.ndarray, np.ndarray]:
    """The chosen aims and their neighbours (n, 2) at a distance [mm]; and which of them are around an aim that was chosen in some turn
    with so many darts left and this score remaining, (3, start + 1, n).
    """
    states = [_states(table) for table in choices[::-1]]  # one dart left first
    used = np.unique(np.concatenate([aim for _, aim in states]))
    around = (aims[used][:, None] + distance * AROUND).round(6) @ [1.0, 1j]
    finer, index = np.unique(around, return_inverse=True)
    neighbours = index.reshape(around.shape)
    near = np.zeros((3, len(choices[0]), len(finer)), dtype=bool)
    for darts, (remaining, aim) in enumerate(states):
        near[darts, remaining[:, None], neighbours[np.searchsorted(used, aim)]] = True
    return np.column_stack([finer.real, finer.imag]), near


def _states(table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What remains (k,) in each state of a table of choices, and the aim there (k,)."""
    begun, scored = np.nonzero(table >= 0)
    return begun - scored, table[begun, scored]


def _as_remaining(value: int, start: int) -> int:
    remaining = as_count(value, "remaining", 2)
    if remaining > start:
        raise ValueError(f"remaining must be between 2 and {start}, where this leg starts, got {remaining}")
    return remaining
