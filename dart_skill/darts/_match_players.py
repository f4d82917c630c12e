"""A player of a match: between which aims to choose in each state, and what comes of turns with
the fewest turns on average.

The aims are the best ones against opponents of two kinds. Some finish in each of their turns with
a fixed chance h, from 0 (the fewest turns) to nearly 1 (now or never): then a turn counts 1 - h of
the one before. Others cannot finish in their next turns, and do so with such a chance later:
against them it pays to prepare the next turns. More of both kinds raise the chance to win from 501
by 1e-5.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.darts._candidates import (
    Candidates,
    Choices,
    Thrower,
    best_play,
    best_turn,
    candidates_at,
    first_aims,
    states_of,
    thrower_of,
)
from dart_skill.darts._leg import LegPolicy, as_start
from dart_skill.darts._leg_solver import Costs, Nearby, Solution, after_dart
from dart_skill.darts._match_solver import quiet
from dart_skill.darts._spread import Spread, SpreadByTarget

PLAYS = ("best", "turns")
"""How a player can choose: the best answer to the other, or the fewest turns on average."""
HAZARDS = (0.0, 0.1, 0.3, 0.6, 0.95)
"""Chances of the first kind of opponents to finish in a turn."""
LATE = (2, 4)
"""Index of the chances that the second kind of opponents have after a respite."""
RESPITE = 4
"""Longest respite [turns]."""


@dataclass(frozen=True, eq=False)
class MatchPlayer:
    """How one player can play, made by `match_player`.

    Parameters
    ----------
    leg
        The policy with the fewest turns on average.
    outcomes : (start + 1, start + 1)
        Chance of what is left after a turn of that policy, by what was left before.
    aims : (n, 2) [mm]
        Between which to choose.
    which : (n,)
        Index of the spread of each.
    choice
        Which of them are good with so many darts left and so much remaining.
    """

    leg: LegPolicy
    outcomes: np.ndarray
    aims: np.ndarray
    which: np.ndarray
    choice: Nearby


def match_player(
    spread: Spread | SpreadByTarget | float | ArrayLike,
    start: int,
    play: str = "best",
    tell: Callable[[float], None] = quiet,
) -> MatchPlayer:
    """The player with a spread, in legs from `start`; both as in `solve_leg`.

    Parameters
    ----------
    play
        "best" (default), or "turns": only the aims of the fewest turns, in a seventh of the time.
        Against another player such a player chooses between these alone.
    tell
        Called with the share that has been done, from 0 to 1.

    Raises
    ------
    ValueError
        For another play.
    """
    if play not in PLAYS:
        raise ValueError(f"play must be one of {', '.join(PLAYS)}, got {play!r}")
    start, thrower = as_start(start), thrower_of(spread)
    first = candidates_at(first_aims(thrower), thrower)
    if play == "turns":
        plays = [best_play(thrower, start, Costs(0.0, 1.0, 1.0), first)]
    else:
        plays = list(_plays(thrower, start, first, tell))
    candidates, near = _united(plays)
    fewest, (expected, choices) = plays[0]
    leg = LegPolicy(fewest.aims, expected, choices, thrower.spreads, fewest.which, "turns")
    outcomes = turn_outcomes(fewest.results, choices)
    return MatchPlayer(
        leg, outcomes, candidates.aims, candidates.which, Nearby(candidates.results, near)
    )


def _plays(
    thrower: Thrower, start: int, first: Candidates, tell: Callable[[float], None]
) -> Iterator[tuple[Candidates, Solution]]:
    """Against all opponents, that of the fewest turns first."""
    plays = []
    for number, hazard in enumerate(HAZARDS):
        plays.append(best_play(thrower, start, Costs(0.0, 1.0, 1.0 - hazard), first))
        tell((number + 1.0) / (len(HAZARDS) + len(LATE)))
    yield from plays
    for number, late in enumerate(LATE, start=len(HAZARDS)):
        yield from _after_respite(thrower, plays[late][1], first)
        tell((number + 1.0) / (len(HAZARDS) + len(LATE)))


def _after_respite(
    thrower: Thrower, solution: Solution, first: Candidates
) -> Iterator[tuple[Candidates, Solution]]:
    """The best turns before those of a solution. To finish costs nothing, and what is left costs
    what it is expected to, less a turn.
    """
    after = np.maximum(solution.expected - 1.0, 0.0)
    for _ in range(RESPITE):
        candidates, turn = best_turn(thrower, after, first)
        yield candidates, turn
        after = turn.expected


def _united(plays: list[tuple[Candidates, Solution]]) -> tuple[Candidates, np.ndarray]:
    """All aims that are chosen somewhere, and in which states, (3, start + 1, n)."""
    begins = np.cumsum([0, *(len(candidates.aims) for candidates, _ in plays)])
    aims, results, which = (
        np.concatenate([candidates[part] for candidates, _ in plays]) for part in range(3)
    )
    _, first, same = np.unique(aims @ [1.0, 1j], return_index=True, return_inverse=True)
    near = np.zeros((3, len(plays[0][1].expected), len(first)), dtype=bool)
    for begin, (_, solution) in zip(begins, plays, strict=False):
        for darts, table in enumerate(solution.choices[::-1]):
            remaining, aim = states_of(table)
            near[darts, remaining, same[begin + aim]] = True
    used = near.any(axis=(0, 1))
    return Candidates(*(part[first][used] for part in (aims, results, which))), near[..., used]


def turn_outcomes(results: np.ndarray, choices: Choices) -> np.ndarray:
    """Chance (start + 1, start + 1) of what is left after a turn, by what was left before; results
    (n, 57), and choices between them.
    """
    size = len(choices[0])
    left, bust = after_dart(np.arange(size))
    now, outcomes = np.eye(size), np.zeros((size, size))
    for table in choices:
        after = np.zeros_like(now)
        for scored in range(table.shape[1]):
            begun = np.arange(scored + 2, size)
            chance = now[begun, begun - scored, None] * results[table[begun, scored]]
            fails = bust[begun - scored]
            outcomes[begun, begun] += np.einsum("mo,mo->m", chance, fails)
            np.add.at(after, (begun[:, None], left[begun - scored]), np.where(fails, 0.0, chance))
        outcomes[:, 0] += after[:, 0]
        after[:, 0] = 0.0
        now = after
    outcomes[2:] += now[2:]
    return outcomes
