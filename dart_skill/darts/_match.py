"""Two players and a leg of 501, then a match of several legs: who wins, and where to aim against
this opponent.

Haugh and Wang ("Play like the pros? Solving the game of darts as a dynamic zero-sum game", INFORMS
Journal on Computing, 2022) solve this game for professionals. Here each player has a spread of any
size, and the aims are points of the plane.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_number
from dart_skill.darts._board import place_of
from dart_skill.darts._leg import as_remaining, as_start
from dart_skill.darts._leg_solver import LARGEST_SCORE, Nearby, after_dart
from dart_skill.darts._match_players import PLAYS, MatchPlayer, match_player
from dart_skill.darts._match_solver import Best, Fixed, quiet, solve_game
from dart_skill.darts._spread import Spread, SpreadByTarget, as_spread

PLAYERS = ("me", "them")
"""Who can begin a match."""
MOST_LEGS = 999
"""Largest number of legs of a match."""

Player = MatchPlayer | Spread | SpreadByTarget | float | ArrayLike


@dataclass(frozen=True, eq=False)
class MatchSide:
    """One of two players in a leg: the chances to win, and where to aim.

    Parameters
    ----------
    player
        Between which aims.
    play
        "best" or "turns", how they are chosen.
    first
        Chance to win the leg at the start of an own turn and at the start of one of the other
        player, by what this player has left and by what the other has left; NaN where one of them
        has 1 left.
    second : (start + 1, start + 1)
        Chance to win the leg at the start of an own turn and at the start of one of the other
        player, by what this player has left and by what the other has left; NaN where one of them
        has 1 left.
    """

    player: MatchPlayer
    play: str
    first: np.ndarray
    second: np.ndarray

    def best_aim(
        self, remaining: int, against: int, darts_left: int = 3, turn_start: int | None = None
    ) -> np.ndarray:
        """Point (2,) [mm] to aim at with this remaining score and number of darts left, when the
        other player has `against` left.

        Parameters
        ----------
        turn_start
            Score before the turn, to which a bust returns; default None: remaining, so nothing is
            scored yet.
        """
        begun, scored = self.player.leg.state(remaining, darts_left, turn_start)
        choices = self.choices(begun, as_remaining(against, self.player.leg.start, "against"))
        return self.aims[choices[3 - darts_left][scored]]

    def target(
        self, remaining: int, against: int, darts_left: int = 3, turn_start: int | None = None
    ) -> str:
        """Name of the bed of the best aim, or "outside D1" for a point beyond the double ring;
        arguments as in `best_aim`.
        """
        return place_of(self.best_aim(remaining, against, darts_left, turn_start))

    @property
    def aims(self) -> np.ndarray:
        """Between which this side chooses, (n, 2) [mm]."""
        return (self.player.leg if self.play == "turns" else self.player).aims

    @property
    def which(self) -> np.ndarray:
        """Index (n,) of the spread of each aim."""
        return (self.player.leg if self.play == "turns" else self.player).which

    def choices(self, begun: int, against: int) -> tuple[np.ndarray, ...]:
        """Index of the aims of a turn from the score `begun`, when the other player has `against`
        left: with three, two and one darts left three arrays, by the points of the turn so far.
        """
        if self.play == "turns":
            return tuple(table[begun] for table in self.player.leg.choices)
        return tuple(
            darts.aims[::-1]
            for darts in _best_turn(self.player.choice, self.second[: begun + 1, against])
        )


@dataclass(frozen=True, eq=False)
class MatchPolicy:
    """A leg of two players, made by `solve_match`: the sides `me` and `them`, which the spread and
    the spread `against` have.
    """

    me: MatchSide
    them: MatchSide

    @property
    def start(self) -> int:
        return self.me.player.leg.start


def solve_match(
    spread: Player,
    against: Player,
    start: int = 501,
    plays: tuple[str, str] = ("best", "best"),
    tell: Callable[[float], None] = quiet,
) -> MatchPolicy:
    """The chances of two players to win a leg, double out, and where they aim in every state of it
    (Haugh and Wang 2022).

    They throw three darts in turn. Each aims where the chance to win is highest, whatever the
    other does. From 501 this takes 10 to 60 s.

    Parameters
    ----------
    spread, against
        Of the two players, "me" and "them": as in `solve_leg`, or what `match_player` made, which
        saves its time.
    start
        Int from 2 to 1001, default 501.
    plays
        Of each player "best" (default), which is the best answer to how the other plays, or
        "turns", the fewest turns on average.
    tell
        Called with the share of the work that has been done, from 0 to 1.

    Raises
    ------
    ValueError
        For a start or a play that is none, and for a player who never finishes.
    """
    start = as_start(start)
    if len(plays) != 2 or any(play not in PLAYS for play in plays):
        raise ValueError(
            f"plays must be two of {', '.join(PLAYS)}, one for each player, got {plays!r}"
        )
    # what takes about as long; players that are there already take no time
    parts = [*(not isinstance(one, MatchPlayer) for one in (spread, against)), 3]
    me = _as_player(spread, start, _part(tell, parts, 0))
    try:
        them = (
            me if _is_same(spread, against) else _as_player(against, start, _part(tell, parts, 1))
        )
    except ValueError as error:
        raise ValueError(f"against: {error}") from None
    fewest = _solved(me, them, ("turns", "turns"))
    mine, theirs = (
        fewest
        if tuple(plays) == ("turns", "turns")
        else _solved(me, them, plays, fewest[0].left, _part(tell, parts, 2))
    )
    return MatchPolicy(
        MatchSide(me, plays[0], _by_scores(1.0 - theirs.left), _by_scores(mine.left.T)),
        MatchSide(them, plays[1], _by_scores(1.0 - mine.left), _by_scores(theirs.left.T)),
    )


def _solved(
    me: MatchPlayer,
    them: MatchPlayer,
    plays: tuple[str, str],
    guess: np.ndarray | None = None,
    tell: Callable[[float], None] = quiet,
) -> tuple[Fixed | Best, Fixed | Best]:
    """The game, solved."""
    mine, theirs = (
        Fixed(player.outcomes)
        if play == "turns"
        else Best(player.choice, np.diag(player.outcomes))
        for player, play in zip((me, them), plays, strict=True)
    )
    theirs = mine if me is them and plays[0] == plays[1] else theirs
    solve_game(mine, theirs, guess, tell)
    return mine, theirs


class AimsApart(NamedTuple):
    """A score at which the first dart of a turn is aimed at another bed against another score of
    the other player, made by `aims_apart`.

    Parameters
    ----------
    remaining
        The own score.
    against
        Two scores of the other.
    aims : (2, 2) [mm]
        The best ones against these.
    beds
        Their names.
    losses
        Of the chance to win, if the other of the two aims is taken.
    """

    remaining: int
    against: tuple[int, int]
    aims: np.ndarray
    beds: tuple[str, str]
    losses: tuple[float, float]


def aims_apart(side: MatchSide, near: int = 40, far: int = 140) -> AimsApart | None:
    """Where the best aim depends most on what the other player has left, near or far; None if it
    is in the same bed everywhere.

    Parameters
    ----------
    side
        One with the play "best"; a `far` above the start means the start.

    Raises
    ------
    ValueError
        For another play.
    """
    start = side.player.leg.start
    against = (
        as_remaining(min(near, start), start, "near"),
        as_remaining(min(far, start), start, "far"),
    )
    if side.play != "best":
        raise ValueError(
            f"only the play 'best' looks at the other player, not {side.play!r}: take a side that"
            " solve_match made with it"
        )
    every = [_apart(side, remaining, against) for remaining in range(2, start + 1)]
    different = [one for one in every if one.beds[0] != one.beds[1]]
    return max(different, key=lambda one: min(one.losses), default=None)


def _apart(side: MatchSide, remaining: int, against: tuple[int, int]) -> AimsApart:
    first = [
        _best_turn(side.player.choice, side.second[: remaining + 1, other])[0] for other in against
    ]
    chosen = [int(darts.aims[-1]) for darts in first]
    exchanged = [
        side.player.choice.results[aim] @ darts.values[-1]
        for aim, darts in zip(chosen[::-1], first, strict=True)
    ]
    losses = [float(darts.best[-1] - mean) for darts, mean in zip(first, exchanged, strict=True)]
    aims = side.aims[chosen]
    return AimsApart(
        remaining, against, aims, (place_of(aims[0]), place_of(aims[1])), (losses[0], losses[1])
    )


def match_chance(first: float, second: float, legs: int, begins: str = "me") -> float:
    """The chance to win a match, best of an odd number of legs, which the players begin in turn.

    The match is won if all legs were played and more than half of them were won: a sum of two
    binomial numbers.

    Parameters
    ----------
    first, second
        Chance to win a leg that the player begins, and one that the other begins.
    begins
        The first leg, "me" or "them".

    Raises
    ------
    ValueError
        For an even number of legs or too many, no chance, or another player.
    """
    for name, chance in (("first", first), ("second", second)):
        if as_number(chance, name, strict=False) > 1.0:
            raise ValueError(f"{name} must be a chance from 0 to 1, got {chance:g}")
    legs = as_count(legs, "legs", 1)
    if legs % 2 == 0 or legs > MOST_LEGS:
        raise ValueError(
            f"legs must be an odd number up to {MOST_LEGS}, such as {min(legs + 1, MOST_LEGS)},"
            f" got {legs}"
        )
    if begins not in PLAYERS:
        raise ValueError(f"begins must be one of {', '.join(PLAYERS)}, got {begins!r}")
    more, fewer = (first, second) if begins == "me" else (second, first)
    won = np.convolve(_binomial((legs + 1) // 2, more), _binomial(legs // 2, fewer))
    return min(float(won[legs // 2 + 1 :].sum()), 1.0)


class _Darts(NamedTuple):
    """With so many darts left in a turn, for the scores that can remain, ascending: values (m, 57)
    of the results of a dart, the best mean (m,) and its aim (m,).
    """

    values: np.ndarray
    best: np.ndarray
    aims: np.ndarray


def _best_turn(choice: Nearby, after: np.ndarray) -> list[_Darts]:
    """The best play of a turn with three, two and one darts left; after (begun + 1,): chance to
    win with what is left after the turn.
    """
    begun, back, turn = len(after) - 1, after[-1], []
    for darts in (1, 2, 3):
        low = max(2, begun - LARGEST_SCORE * (3 - darts))
        left, bust = after_dart(np.arange(low, begun + 1))
        values = np.where(bust, back, after[left])
        turn.append(_Darts(values, *choice.best(darts, low, values)))
        after = np.concatenate([[1.0], np.zeros(low - 1), turn[-1].best])
    return turn[::-1]


def _part(
    tell: Callable[[float], None], parts: Sequence[int], which: int
) -> Callable[[float], None]:
    """Tells of one of several parts of some work what share of the whole has been done; parts: how
    long each takes.
    """
    before, own, whole = sum(parts[:which]), parts[which], sum(parts)
    return lambda share: tell((before + share * own) / whole)


def _as_player(spread: Player, start: int, tell: Callable[[float], None]) -> MatchPlayer:
    if not isinstance(spread, MatchPlayer):
        return match_player(spread, start, tell=tell)
    if spread.leg.start != start:
        raise ValueError(
            f"this player was made for legs from {spread.leg.start}, not from {start}: make"
            " another with match_player"
        )
    return spread


def _is_same(one: Player, other: Player) -> bool:
    """Whether two players are given by the same spread, so that the work for one of them is
    enough.
    """
    if isinstance(one, (MatchPlayer, SpreadByTarget)) or isinstance(
        other, (MatchPlayer, SpreadByTarget)
    ):
        return one is other
    first, second = as_spread(one), as_spread(other)
    return np.array_equal(first.covariance, second.covariance) and np.array_equal(
        first.bias, second.bias
    )


def _by_scores(chances: np.ndarray) -> np.ndarray:
    """Chances by the own score and that of the other: who has nothing left has won."""
    chances = chances.copy()
    chances[1:, 0] = 0.0
    chances[0], chances[1], chances[:, 1] = 1.0, np.nan, np.nan
    chances.flags.writeable = False
    return chances


def _binomial(n: int, chance: float) -> np.ndarray:
    """Chances (n + 1,) of 0, 1, ... n successes."""
    return reduce(np.convolve, [np.array([1.0 - chance, chance])] * n, np.ones(1))
