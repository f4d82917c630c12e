"""The aims between which `_leg_solver` and `_match_solver` choose.

At first they are on a grid, then around those that were chosen, twice. This costs at most 0.03 %
more turns from 501, and 0.3 % more from any score, than aims on a grid of 5 mm or 0.3 sigmas that
are refined four times (measured for sigmas from 1 to 100 mm).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.darts._board import BED_SCORES, RADII, bed_centres
from dart_skill.darts._exact import bed_probabilities
from dart_skill.darts._leg_solver import (
    POINTS,
    RESULT_OF_BED,
    Costs,
    Everywhere,
    Nearby,
    Solution,
    solve,
    solve_turn,
)
from dart_skill.darts._optimum import local_optima
from dart_skill.darts._spread import Spread, SpreadByTarget, as_spread

GRID = 12.0
"""Least distance of the first aims [mm]."""
GRID_PER_SPREAD = 0.5
"""Least distance of the first aims [sigmas]."""
REFINEMENTS = (0.4, 0.15)
"""Distances of finer aims, relative to that of the first ones."""
PEAKS_FROM = 6.0
"""For a narrower spread [mm] the peaks are the middles of beds."""
REACH = 2.0
"""Aims may be so far beyond the board [sigmas]: a dart off the board cannot bust."""
AROUND = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]), axis=-1).reshape(-1, 2)

Choices = tuple[np.ndarray, np.ndarray, np.ndarray]
"""For 0, 1 and 2 darts that are used: the chosen aim by the score before the turn, and by what has
been scored since.
"""


class Thrower(NamedTuple):
    """spreads; which: from aims (n, 2) to the index (n,) of the spread of each."""

    spreads: tuple[Spread, ...]
    which: Callable[[np.ndarray], np.ndarray]

    @property
    def grid_distance(self) -> float:
        """Distance between the first aims [mm]."""
        return max(GRID, GRID_PER_SPREAD * min(spread.deviations[0] for spread in self.spreads))


class Candidates(NamedTuple):
    """aims (n, 2) [mm]; results (n, 57): probability of each result of a dart; which (n,): index
    of the spread of each aim.
    """

    aims: np.ndarray
    results: np.ndarray
    which: np.ndarray


def thrower_of(spread: Spread | SpreadByTarget | float | ArrayLike) -> Thrower:
    """The thrower with a spread, a sigma [mm], a covariance (2, 2) [mm^2] or a spread by target."""
    if isinstance(spread, SpreadByTarget):
        return Thrower(spread.all_spreads, spread.which)
    return Thrower((as_spread(spread),), lambda aims: np.zeros(len(aims), dtype=int))


def best_play(
    thrower: Thrower, start: int, costs: Costs, first: Candidates | None = None
) -> tuple[Candidates, Solution]:
    """The policy with the least cost, between the first aims and then between finer ones around
    those that were chosen.
    """
    first = candidates_at(first_aims(thrower), thrower) if first is None else first
    return _refined(thrower, first, lambda choice, guesses: solve(choice, start, costs, guesses))


def best_turn(
    thrower: Thrower, after: np.ndarray, first: Candidates
) -> tuple[Candidates, Solution]:
    """As best_play, of one turn with costs of what is left at its end, as in `solve_turn`."""
    return _refined(thrower, first, lambda choice, _: solve_turn(choice, after))


def _refined(
    thrower: Thrower,
    candidates: Candidates,
    solved: Callable[[Everywhere | Nearby, np.ndarray | None], Solution],
) -> tuple[Candidates, Solution]:
    solution = solved(Everywhere(candidates.results), None)
    for share in REFINEMENTS:
        aims, near = _nearby(candidates.aims, solution.choices, share * thrower.grid_distance)
        candidates = candidates_at(aims, thrower)
        solution = solved(Nearby(candidates.results, near), solution.expected)
    return candidates, solution


def first_aims(thrower: Thrower) -> np.ndarray:
    """First aims (n, 2) [mm]: middles of the beds, a grid over the board and beyond, and where the
    expected score has its peaks.

    With much to go peaks may be nearly equally good, and a grid would choose between them by where
    its points happen to lie.
    """
    distance = thrower.grid_distance
    reach = RADII[-1] + REACH * max(spread.deviations[1] for spread in thrower.spreads)
    steps = np.arange(-reach, reach + distance, distance)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    grid = grid[np.hypot(*grid.T) < reach]
    bias = np.mean([spread.bias for spread in thrower.spreads], axis=0)
    peaks = [
        aim.point
        for spread in thrower.spreads
        if spread.deviations[0] > PEAKS_FROM
        for aim in local_optima(spread)
    ]
    return np.concatenate([bed_centres() - bias, grid - bias, np.reshape(peaks, (-1, 2))])


def candidates_at(aims: np.ndarray, thrower: Thrower) -> Candidates:
    index = thrower.which(aims)
    beds = np.empty((len(aims), len(BED_SCORES)))
    for number, spread in enumerate(thrower.spreads):
        beds[index == number] = bed_probabilities(aims[index == number], spread)
    return Candidates(aims, beds @ np.eye(len(POINTS))[RESULT_OF_BED], index)


def finer(aims: np.ndarray, choices: tuple[np.ndarray, ...], distance: float) -> np.ndarray:
    """The chosen aims, and for each its four neighbours at this distance [mm]."""
    chosen = np.unique(np.concatenate([table[table >= 0] for table in choices]))
    offsets = distance * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    return np.unique((aims[chosen][:, None] + offsets).reshape(-1, 2).round(6), axis=0)


def _nearby(
    aims: np.ndarray, choices: tuple[np.ndarray, ...], distance: float
) -> tuple[np.ndarray, np.ndarray]:
    """The chosen aims and their neighbours (n, 2) at a distance [mm]; and which of them are around
    an aim that was chosen in some turn with so many darts left and this score remaining, (3, start
    + 1, n).
    """
    states = [states_of(table) for table in choices[::-1]]  # one dart left first
    used = np.unique(np.concatenate([aim for _, aim in states]))
    around = (aims[used][:, None] + distance * AROUND).round(6) @ [1.0, 1j]
    places, index = np.unique(around, return_inverse=True)
    neighbours = index.reshape(around.shape)
    near = np.zeros((3, len(choices[0]), len(places)), dtype=bool)
    for darts, (remaining, aim) in enumerate(states):
        near[darts, remaining[:, None], neighbours[np.searchsorted(used, aim)]] = True
    return np.column_stack([places.real, places.imag]), near


def states_of(table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What remains (k,) in each state of a table of choices, and the aim there (k,)."""
    begun, scored = np.nonzero(table >= 0)
    return begun - scored, table[begun, scored]
