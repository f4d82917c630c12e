"""Who wins a leg, if aims come from a finite set: a stochastic game of two players who throw in
turn.

L(b, s) is the chance of a player to win who has s left when the other, with b left, begins a turn;
L(b, 0) = 1. With a left and b against it, k darts left and r remaining in a turn, the best chance
is

    W_k(r) = max over aims of the mean over results o of (L(b, a) if o is bust, else W_{k-1}(r - o)),    W_0(r) = L(b, r),

and the other player's L(a, b) is 1 - W_3(a). Pairs (a, b) are taken in the order of their sum.
Then all of this is known but u = L(b, a), to which busts and three misses lead back, and the
other's L(a, b). Each of the two turns raises u more slowly than it is raised, so u = 1 - W'_3(b; 1
- W_3(a; u)) has one root. A secant method finds it for all pairs of a sum at once, and keeps it
between two bounds.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import as_strided

from dart_skill.darts._leg_solver import (
    FEWEST_ENDS,
    LARGEST_SCORE,
    POINTS,
    SAFE,
    Nearby,
    after_dart,
    cut,
    safe_from,
)

MAX_ROUNDS = 100
"""Largest number of steps of the secant method."""
ACCURACY = 1e-7
"""Accuracy of chances to win at which the secant method ends; its next step would be shorter by a
factor of ten at least.
"""
NO_BUST_TWO = safe_from(2)
"""Score from which two darts cannot bust."""
NO_BUST_THREE = safe_from(3)
"""Score from which three darts cannot bust."""
PER_DART = LARGEST_SCORE + 1
"""Number of different points that a dart can take off, from 0 on."""
LAST_PARTS = (2, 32, SAFE)
"""Limits of the ranges of scores that are computed together, from which the last dart may bust."""
SECOND_PARTS = (2, 32, SAFE, NO_BUST_TWO)
"""The same, from which the second dart may bust."""
BUST = NO_BUST_THREE
"""Column of the tables of a turn in which a bust finds its value."""


def quiet(share: float) -> None:
    """Tells nobody what share of some work has been done."""


def solve_game(
    mine: Fixed | Best,
    theirs: Fixed | Best,
    guess: np.ndarray | None = None,
    tell: Callable[[float], None] = quiet,
) -> None:
    """Fills `left` of both sides, which may be the same.

    Parameters
    ----------
    guess : (start + 1, start + 1)
        Of mine.left.
    tell
        Called with the share of the pairs that are solved.
    """
    start = len(mine.left) - 1
    guess = np.zeros_like(mine.left) if guess is None else guess
    for total in range(4, 2 * start + 1):
        low, end = max(2, total - start), min(start, total - 2) + 1
        if mine is theirs:
            low = (total + 1) // 2
        own = np.arange(low, end)
        other = total - own
        first, second = (
            mine.turns(low, end, total),
            theirs.turns(total - end + 1, total - low + 1, total),
        )
        better = np.where(own > 2, mine.left[other, own - 1] - guess[other, own - 1], 0.0)
        back = _root(
            first,
            second,
            np.clip(guess[other, own] + better, 0.0, 1.0),
            mine.back[own] * theirs.back[other],
        )
        first.keep(back)
        second.keep(1.0 - first.value(back)[::-1])
        tell(_solved(total, start))


def _solved(total: int, start: int) -> float:
    """Share of the pairs of scores up to `start` whose sum is `total` at most, about."""
    share = total / (2.0 * start)
    return 2.0 * share**2 if share < 0.5 else 1.0 - 2.0 * (1.0 - share) ** 2


def _root(
    first: _FixedTurns | _BestTurns,
    second: _FixedTurns | _BestTurns,
    at: np.ndarray,
    slope: np.ndarray,
) -> np.ndarray:
    """The u (m,) of all pairs of a sum, from a guess; slope (m,): of the right side, about."""
    low, high = np.zeros_like(at), np.ones_like(at)
    fall = np.maximum(1.0 - slope, FEWEST_ENDS)
    before = gap_before = np.full_like(at, np.nan)
    for _ in range(MAX_ROUNDS):
        gap = 1.0 - second.value(1.0 - first.value(at)[::-1])[::-1] - at
        low, high = np.where(gap >= 0.0, at, low), np.where(gap <= 0.0, at, high)
        step = at - before
        far = np.abs(step) > ACCURACY
        secant = np.divide(gap_before - gap, step, out=fall.copy(), where=far)
        fall = np.clip(secant, FEWEST_ENDS, 1.0)
        before, gap_before = at, gap
        at = at + gap / fall
        at = np.where((at < low) | (at > high), 0.5 * (low + high), at)
        if np.abs(at - before).max() <= ACCURACY:
            return at
    raise ValueError("no chance to win was found: do the darts of both players reach the board?")


class Fixed:
    """A player who plays by a fixed policy.

    Parameters
    ----------
    outcomes : (start + 1, start + 1)
        Chances of what is left after a turn, by what was before.

    Attributes
    ----------
    left : (start + 1, start + 1)
        L, by the score of the other player and by the own one.
    back : (start + 1,)
        Chance that a turn leads back to its beginning, nearly.
    """

    def __init__(self, outcomes: np.ndarray):
        self.outcomes, self.back = outcomes, np.diag(outcomes)
        self.left = np.zeros_like(outcomes)
        self.left[:, 0] = 1.0

    def turns(self, low: int, end: int, total: int) -> _FixedTurns:
        """The turns from the scores low, low + 1, ..., against an opponent who has the rest of a
        sum left.
        """
        return _FixedTurns(self, low, end, total)


class _FixedTurns:
    """Turns of one player from a range of scores: `value` (m,) is the chance to win, if it is
    `back` (m,) after a turn that leads back to its beginning; `keep` says what that is.
    """

    def __init__(self, side: Fixed, low: int, end: int, total: int):
        self._left, self._own = side.left, np.arange(low, end)
        self._other = total - self._own
        self._back = side.back[self._own]
        self._known = np.einsum(
            "ms,ms->m", side.outcomes[low:end, :end], side.left[self._other, :end]
        )

    def value(self, back: np.ndarray) -> np.ndarray:
        return self._known + self._back * back

    def keep(self, back: np.ndarray) -> None:
        self._left[self._other, self._own] = back


class Best:
    """A player who chooses the best aim in every state of the game.

    Parameters
    ----------
    choice
        Between which aims.
    back : (start + 1,)
        As of Fixed.

    Attributes
    ----------
    left : (start + 1, start + 1)
        As of Fixed.
    safe : (2, start + 1, start + 1)
        W_1 and W_2 of scores from which no dart can bust, by the score of the other and by what
        remains.
    last, second
        The last dart of a turn, and the second, from scores from which they may bust.
    """

    def __init__(self, choice: Nearby, back: np.ndarray):
        size = len(back)
        self.choice, self.back = choice, back
        self.after, self.bust = after_dart(np.arange(size))
        self.left = np.zeros((size, size))
        self.left[:, 0] = 1.0
        self.safe = np.zeros((2, size, size))
        self.last = [_LastDart(self, *part) for part in _parts(choice.counts[0], LAST_PARTS)]
        self.second = [_SecondDart(self, *part) for part in _parts(choice.counts[1], SECOND_PARTS)]

    def turns(self, low: int, end: int, total: int) -> _BestTurns:
        """See `Fixed`."""
        parts: list[_RiskyTurns | _SafeTurns] = []
        if low < NO_BUST_THREE:
            parts.append(_RiskyTurns(self, low, min(end, NO_BUST_THREE), total))
        if end > NO_BUST_THREE:
            parts.append(_SafeTurns(self, max(low, NO_BUST_THREE), end, total))
        return _BestTurns(parts)

    def best(self, darts: int, low: int, values: np.ndarray) -> np.ndarray:
        """The best means (m,) of values (m, 57) of the results of a dart, for the remaining scores
        low, low + 1, ...
        """
        first, second = cut(low, low + len(values), safe_from(darts))
        parts = [part for part in (first, second) if part[0] < part[1]]
        return np.concatenate(
            [self.choice.means(darts, a, values[a - low : b - low]).max(axis=1) for a, b in parts]
        )


def _parts(counts: np.ndarray, edges: tuple[int, ...]) -> list[tuple[int, int, int]]:
    """Ranges of scores, and the largest number of aims in each: low scores have many aims, and the
    others few.
    """
    ends = [min(edge, len(counts)) for edge in edges]
    return [(low, end, int(counts[low:end].max())) for low, end in pairwise(ends) if low < end]


class _LastDart:
    """The last dart of a turn from scores from which it can bust: what each of k aims is worth
    without busts, and its chance of a bust.

    worth (k, start + 1, n): by the score of the other player and what remains; busts (k, 1, n).
    """

    def __init__(self, side: Best, low: int, end: int, k: int):
        self._choice, self.low, self.end = side.choice, low, end
        self._k = k
        self.busts = np.ascontiguousarray(self._means(low, side.bust[low:end].astype(float)).T)[
            :, None
        ]
        self.worth = np.zeros((k, len(side.left), end - low))

    def _means(self, low: int, values: np.ndarray) -> np.ndarray:
        return self._choice.means(1, low, values)[:, : self._k]

    def best(self, other: np.ndarray, end: int, back: np.ndarray) -> np.ndarray:
        """W_1 (m, n) for what remains from low to before end, against scores (m,) of the other
        player, descending by one.

        back (m,): what a bust is worth.
        """
        n = min(end, self.end) - self.low
        lines = back[:, None] * self.busts[..., :n]
        lines += self.worth[:, other[-1] : other[0] + 1, :n][:, ::-1]
        return lines.max(axis=0)

    def keep(self, other: np.ndarray, low: int, known: np.ndarray) -> None:
        """Values (m, 57) of the results of a dart that does not bust, for the remaining scores
        low, low + 1, ..., are known.
        """
        first, end = max(low, self.low), min(low + len(known), self.end)
        if first < end:
            rows = slice(first - low, end - low)
            self.worth[:, other[rows], np.arange(first, end) - self.low] = self._means(
                first, known[rows]
            ).T


class _SecondDart:
    """The second dart of a turn from n scores: chances of what an aim leaves, from 60 points less
    to all, (n, k, 61), and of a bust.
    """

    def __init__(self, side: Best, low: int, end: int, k: int):
        self.low, self.end = low, end
        results, bust = side.choice.block(2, low, end)[:, :k], side.bust[low:end, None]
        self._left = np.where(bust, 0.0, results) @ np.eye(PER_DART)[LARGEST_SCORE - POINTS]
        self._busts = np.where(bust, results, 0.0).sum(axis=2, keepdims=True)

    def fill(self, low: int, end: int, padded: np.ndarray, two: np.ndarray) -> None:
        """W_2 of those of the scores from low to before end that are here, for the turns in which
        so many points more were left: into the table `two`, from the padded table of W_1.
        """
        low, end = max(low, self.low), min(end, self.end)
        if low < end:
            rows, (row, column) = slice(low - self.low, end - self.low), padded.strides
            after = as_strided(
                padded[low:, low:], (end - low, PER_DART, PER_DART), (row + column, row, column)
            )
            means = np.matmul(self._left[rows], after.swapaxes(1, 2))
            begun = np.arange(low, end)[:, None] + np.arange(PER_DART)
            if low < SAFE:
                means += self._busts[rows] * padded[begun, LARGEST_SCORE + BUST][:, None]
            two[begun, np.arange(low, end)[:, None]] = means.max(axis=1)


class _BestTurns:
    """Turns from a range of scores as of _FixedTurns; each part is computed in its own way."""

    def __init__(self, parts: list[_RiskyTurns | _SafeTurns]):
        self._parts = parts

    def value(self, back: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [part.value(mine) for part, mine in zip(self._parts, self._shares(back), strict=True)]
        )

    def keep(self, back: np.ndarray) -> None:
        for part, mine in zip(self._parts, self._shares(back), strict=True):
            part.keep(mine)

    def _shares(self, back: np.ndarray) -> list[np.ndarray]:
        return np.split(back, np.cumsum([len(part.own) for part in self._parts])[:-1])


class _SafeTurns:
    """The turns from scores from which no three darts can bust: only misses lead back."""

    def __init__(self, side: Best, low: int, end: int, total: int):
        self._side, self.own = side, np.arange(low, end)
        self._other = total - self.own
        self._worth, self._miss = [], []
        for darts, table in enumerate((side.left, *side.safe), start=1):
            after = table[self._other[:, None], side.after[low:end]]
            after[:, 0] = 0.0  # of a miss, which is the first result
            self._worth.append(side.choice.means(darts, low, after))
            self._miss.append(
                side.choice.means(darts, low, np.broadcast_to(np.eye(1, len(POINTS)), after.shape))
            )

    def value(self, back: np.ndarray) -> np.ndarray:
        for worth, miss in zip(self._worth, self._miss, strict=True):
            back = (worth + back[:, None] * miss).max(axis=1)
        return back

    def keep(self, back: np.ndarray) -> None:
        self._side.left[self._other, self.own] = back
        for table, worth, miss in zip(self._side.safe, self._worth, self._miss, strict=False):
            back = (worth + back[:, None] * miss).max(axis=1)
            table[self._other, self.own] = back


class _RiskyTurns:
    """The turns from scores from which three darts can bust.

    Tables (182, 60 + 183) of W_1 and W_2: by the score at the start of the turn and by what
    remains, the last column after a bust; the first 60 are of less than nothing, which is never
    left.
    """

    def __init__(self, side: Best, low: int, end: int, total: int):
        self._side, self.own = side, np.arange(low, end)
        self._low, self._end, self._other = low, end, total - self.own
        self._index = self.own[:, None], np.where(side.bust[low:end], BUST, side.after[low:end])
        self._back = side.bust[low:end] | (side.after[low:end] == self.own[:, None])
        self._after = side.left[self._other[:, None], side.after[low:end]]
        self._padded = np.zeros((NO_BUST_THREE, LARGEST_SCORE + BUST + 1))
        self._one, self._two = self._padded[:, LARGEST_SCORE:], np.zeros((NO_BUST_THREE, BUST + 1))
        self._one[:, 0] = self._two[:, 0] = 1.0
        for table, known, first in (
            (self._one, side.safe[0], SAFE),
            (self._two, side.safe[1], NO_BUST_TWO),
        ):
            table[low:end, first:end] = known[self._other, first:end]

    def value(self, back: np.ndarray) -> np.ndarray:
        self._one[self.own, BUST] = self._two[self.own, BUST] = back
        self._one[self.own, self.own] = self._side.best(
            1, self._low, np.where(self._back, back[:, None], self._after)
        )
        self._fill_last(back)
        self._fill_second()
        return self._side.best(3, self._low, self._two[self._index])

    def _fill_last(self, back: np.ndarray) -> None:
        """W_1 of lower scores from which a dart can bust."""
        for part in self._side.last:
            remaining = np.arange(part.low, min(part.end, self._end - 1))
            if len(remaining):
                lower = remaining < self.own[:, None]
                best = part.best(self._other, self._end - 1, back)
                self._one[self._low : self._end, remaining[0] : remaining[-1] + 1][lower] = best[
                    lower
                ]

    def _fill_second(self) -> None:
        """W_2 of all scores that can remain, for all turns that can have led there."""
        for part in self._side.second:
            part.fill(self._low - LARGEST_SCORE, self._end, self._padded, self._two)
        low = max(self._low, NO_BUST_TWO)
        if low < self._end:
            own, rows = np.arange(low, self._end), slice(low - self._low, None)
            self._two[own, own] = self._side.best(
                2, low, self._one[self._index[0][rows], self._index[1][rows]]
            )

    def keep(self, back: np.ndarray) -> None:
        side = self._side
        side.left[self._other, self.own] = back
        for darts, (low, end) in enumerate(
            (cut(self._low, self._end, SAFE)[1], cut(self._low, self._end, NO_BUST_TWO)[1]),
            start=1,
        ):
            if low < end:
                own, other = np.arange(low, end), self._other[low - self._low :]
                known = (side.left, side.safe[0])[darts - 1]
                side.safe[darts - 1, other, own] = side.best(
                    darts, low, known[other[:, None], side.after[low:end]]
                )
        known = np.where(
            side.bust[self._low : self._end],
            0.0,
            side.left[self._other[:, None], side.after[self._low : self._end]],
        )
        for part in side.last:
            part.keep(self._other, self._low, known)
