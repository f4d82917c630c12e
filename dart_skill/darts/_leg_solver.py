"""The fewest expected turns (or darts) to finish a leg, if aims come from a finite set: dynamic
programming over turns of 3 darts.

A turn is bust if it would leave 1 or less than 0, or 0 without a double (the double bull is one).
Then it ends, and its points do not count. V(s) is the expected cost from the score s at the start
of a turn. It is computed for s = 2, 3, ... With k darts left and r remaining, in a turn that
started at s,

    W_k(r) = c + min over aims of the mean over results o of (V(s) if o is bust, else W_{k-1}(r - o)),   W_0 = V,   V(s) = t + d W_3(s)

where c and t are the costs of a dart and of a turn, and d is 1 unless an opponent may finish in
between. All of it is known but V(s) itself, to which a bust and three misses lead back. For fixed
aims W_3(s) = a + b V(s). The equation in this one unknown is solved by policy iteration (Howard),
which is Newton's method here: W_3(s) is concave in V(s), so from any guess the first step leads to
the root or above it, and the others down to it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dart_skill.darts._board import BED_IS_DOUBLE, BED_SCORES

_RESULTS, RESULT_OF_BED = np.unique(2 * BED_SCORES + BED_IS_DOUBLE, return_inverse=True)
POINTS = _RESULTS // 2
"""Points of each distinct result of a dart (57,)."""
IS_DOUBLE = _RESULTS % 2 == 1
"""Whether each distinct result of a dart (57,) is a double."""
LARGEST_SCORE = 60
"""Most points of a dart."""
SAFE = LARGEST_SCORE + 2
"""From this score on no dart can bust."""
MAX_ROUNDS = 50
"""Largest number of steps of policy iteration."""
ACCURACY = 1e-6
"""Relative step after which the aims are not chosen again: better ones would cost less by a small
share of it.
"""
FEWEST_ENDS = 1e-9
"""A turn changes the score with at least this probability; a policy with which it never does has a
large value then, and not an infinite one. It is the best one for a guess that is too low: busting
seems to cost nothing.
"""


class Solution(NamedTuple):
    """expected (start + 1,): V, NaN for 1. choices: with three, two and one darts left the index
    of the best aim, by the score at the start of the turn and by the points of the turn so far,
    (start + 1, 1), (start + 1, 61) and (start + 1, 121); -1 where no turn can stand.
    """

    expected: np.ndarray
    choices: tuple[np.ndarray, np.ndarray, np.ndarray]


def after_dart(remaining: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scores (..., 57) after each result of a dart with these remaining (...), and whether it is
    bust, where the score means nothing.
    """
    left = remaining[..., None] - POINTS
    return np.maximum(left, 0), (left < 0) | (left == 1) | ((left == 0) & ~IS_DOUBLE)


class Everywhere:
    """In every state every aim may be chosen.

    Parameters
    ----------
    results : (n, 57)
        Probabilities of the results of a dart at each of n aims.
    """

    def __init__(self, results: np.ndarray):
        self.results, self._transposed = results, np.ascontiguousarray(results.T)

    def means(self, darts: int, low: int, values: np.ndarray) -> np.ndarray:
        """Means (m, n) over the results of a dart of values (m, 57), for the remaining scores low,
        low + 1, ... with these darts left.
        """
        return values @ self._transposed

    def means_at(self, darts: int, remaining: int, values: np.ndarray) -> np.ndarray:
        """Means (m, n) of several values (m, 57) of the results in a single state."""
        return values @ self._transposed

    def aims(self, darts: int, remaining: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """Index (m,) of the aims in those columns of means."""
        return chosen

    def aim(self, darts: int, remaining: int, chosen: int) -> int:
        """Aim in a single state."""
        return chosen


class Nearby:
    """In each state only some of the aims may be chosen.

    Parameters
    ----------
    near : (3, start + 1, n)
        Which, by the darts left less one, and what remains.

    Attributes
    ----------
    counts : (3, start + 1)
        How many. In each row of means the first so many are different.
    """

    def __init__(self, results: np.ndarray, near: np.ndarray):
        self.results, self.counts = results, near.sum(axis=2)
        # scores from which darts can bust have many aims, as their V differs from turn to turn,
        # and the others few
        self._lists = [
            [_padded(mask[: safe_from(darts)]), _padded(mask[safe_from(darts) :])]
            for darts, mask in enumerate(near, start=1)
        ]
        self._blocks = [[results[lists] for lists in parts] for parts in self._lists]

    def means(self, darts: int, low: int, values: np.ndarray) -> np.ndarray:
        """See `Everywhere`, (m, k)."""
        part = int(low >= safe_from(darts))
        first = low - part * safe_from(darts)
        return np.matmul(
            self._blocks[darts - 1][part][first : first + len(values)], values[..., None]
        )[..., 0]

    def means_at(self, darts: int, remaining: int, values: np.ndarray) -> np.ndarray:
        """See `Everywhere`, (m, k)."""
        part = int(remaining >= safe_from(darts))
        return values @ self._blocks[darts - 1][part][remaining - part * safe_from(darts)].T

    def allowed(self, darts: int, remaining: int) -> np.ndarray:
        """Index (k,) of the aims that may be chosen in a state."""
        part = int(remaining >= safe_from(darts))
        return np.unique(self._lists[darts - 1][part][remaining - part * safe_from(darts)])

    def block(self, darts: int, low: int, end: int) -> np.ndarray:
        """Probabilities of the results (m, k, 57) of the aims that may be chosen with these scores
        left, from which darts can bust.
        """
        return self._blocks[darts - 1][0][low:end]

    def best(self, darts: int, low: int, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The highest of the means of values (m, 57), as in means, and its aim, (m,) each."""
        parts = [
            (first, end)
            for first, end in cut(low, low + len(values), safe_from(darts))
            if first < end
        ]
        means = [self.means(darts, first, values[first - low : end - low]) for first, end in parts]
        aims = [
            self.aims(darts, np.arange(*part), mean.argmax(axis=1))
            for part, mean in zip(parts, means, strict=True)
        ]
        return np.concatenate([mean.max(axis=1) for mean in means]), np.concatenate(aims)

    def aims(self, darts: int, remaining: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """See `Everywhere`."""
        part = int(remaining[0] >= safe_from(darts))
        return self._lists[darts - 1][part][remaining - part * safe_from(darts), chosen]

    def aim(self, darts: int, remaining: int, chosen: int) -> int:
        """See `Everywhere`."""
        part = int(remaining >= safe_from(darts))
        return int(self._lists[darts - 1][part][remaining - part * safe_from(darts), chosen])


def safe_from(darts: int) -> int:
    """Least score from which this number of darts cannot bust."""
    return SAFE + LARGEST_SCORE * (darts - 1)


def cut(low: int, end: int, at: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """The parts of a range below a number and from it on; one of them may be empty."""
    return (low, min(end, at)), (max(low, at), end)


def _padded(mask: np.ndarray) -> np.ndarray:
    """Columns (m, k) in which each row of a mask (m, n) is true; the first of them again where
    there are fewer, 0 where there is none.
    """
    rows, columns = np.nonzero(mask)
    counts = mask.sum(axis=1)
    begins = np.cumsum(counts) - counts
    lists = np.where(
        counts[:, None] > 0,
        np.append(columns, 0)[begins, None],
        np.zeros((1, counts.max(initial=0)), dtype=int),
    )
    lists[rows, np.arange(len(rows)) - begins[rows]] = columns
    return lists


class Costs(NamedTuple):
    """Costs of a dart and of a turn.

    If an opponent finishes in each of his turns with the chance 1 - d, the least cost means the
    highest chance to finish before him.

    Parameters
    ----------
    share
        d, what a turn counts of the one before it.
    """

    dart: float
    turn: float
    share: float = 1.0


def solve(
    choice: Everywhere | Nearby, start: int, costs: Costs, guesses: np.ndarray | None = None
) -> Solution:
    """Policy with the least cost from every score up to `start`.

    Parameters
    ----------
    choice
        Between which aims.
    guesses : (start + 1,)
        Of V.

    Raises
    ------
    ValueError
        If no policy finishes.
    """
    leg = _Leg(choice, start, costs.dart)
    for score in range(2, start + 1):
        guess = leg.expected[score - 1] if score > 2 else 1.0
        this = _Turn(leg, score)
        leg.expected[score] = _root(
            this, float(guess if guesses is None else guesses[score]), costs
        )
        leg.keep(score, this)
    return Solution(leg.expected, leg.choices)


def solve_turn(choice: Everywhere | Nearby, after: np.ndarray) -> Solution:
    """One turn with the least cost from every score, if after (start + 1,) is the cost of what is
    left at its end; expected: that cost.
    """
    leg, costs = _Leg(choice, len(after) - 1, 0.0), after.copy()
    for score in range(2, len(after)):
        leg.expected[score] = after[score]
        this = _Turn(leg, score)
        costs[score], _ = this.value(float(after[score]))
        leg.keep(score, this)
    return Solution(costs, leg.choices)


def _root(turn: _Turn, guess: float, costs: Costs) -> float:
    """The V(s) that a turn from s costs with it, and the aims of that turn."""
    for _ in range(MAX_ROUNDS):
        value, slope = turn.value(guess)
        step = (costs.turn + costs.share * value - guess) / max(
            1.0 - costs.share * slope, FEWEST_ENDS
        )
        guess += step
        if abs(step) <= ACCURACY * guess:
            return guess  # what the aims of this round really cost
    raise ValueError(
        f"no policy was found that finishes from {turn.score}: do the darts reach the board?"
    )


class _Leg:
    """What is known of lower scores.

    left, bust (start + 1, 57): as of after_dart. ends (start + 1, 57): the same in one, -1 for a
    bust: an index of values by score whose last one is that of a bust. known (3, start + 1): V,
    and W_1 and W_2 in a turn from a higher score where no dart can bust.
    """

    def __init__(self, choice: Everywhere | Nearby, start: int, dart: float):
        self.dart, self.choice = dart, choice
        self.left, self.bust = after_dart(np.arange(start + 1))
        self.ends = np.where(self.bust, -1, self.left)
        self.known = np.full((3, start + 1), np.nan)
        self.expected, self.safe = self.known[0], self.known[1:]
        self.expected[0] = 0.0
        first, second, last = (
            np.full((start + 1, 1 + LARGEST_SCORE * used), -1) for used in range(3)
        )
        self.choices = first, second, last
        # with the last dart of a turn from a higher score: chances of a bust, and costs without it
        self.bust_chance = choice.means(1, 0, self.bust[:SAFE].astype(float))
        self.last_cost = np.full_like(self.bust_chance, np.inf)
        self.safe_aim = np.full((2, start + 1), -1)

    def keep(self, score: int, turn: _Turn) -> None:
        """V of this score is known now: what turns from higher scores need of it, and those aims
        of this turn that do not depend on V.
        """
        if score < SAFE:
            known = np.where(self.bust[score], 0.0, self.expected[self.left[score]])
            self.last_cost[score] = self.dart + self.choice.means_at(1, score, known[None])[0]
        for darts in (1, 2):
            lowest = safe_from(darts)
            if score >= lowest:
                self.safe[darts - 1, score], self.safe_aim[darts - 1, score] = turn.safe(darts)
            low = max(lowest, score - LARGEST_SCORE * (3 - darts))
            if low < score:
                self.choices[3 - darts][score, 1 : score - low + 1] = self.safe_aim[
                    darts - 1, low:score
                ][::-1]

    def best(self, darts: int, low: int, costs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The least of costs (m, n) for the scores low, low + 1, ..., and its aim, (m,) each."""
        chosen, rows = costs.argmin(axis=1), np.arange(len(costs))
        return costs[rows, chosen], self.choice.aims(darts, low + rows, chosen)

    def best_of(self, darts: int, score: int, costs: np.ndarray) -> tuple[float, int]:
        """The least of costs (n,) for a single score, and its aim."""
        chosen = int(costs.argmin())
        return float(costs[chosen]), self.choice.aim(darts, score, chosen)


class _Turn:
    """The turn from one score, as a function of its V."""

    def __init__(self, leg: _Leg, score: int):
        self._leg, self.score = leg, score
        self._last = slice(max(2, score - 2 * LARGEST_SCORE), min(SAFE, score))
        lower = max(2, score - LARGEST_SCORE), min(safe_from(2), score)
        self._second = [part for part in (lower, (score, score + 1)) if part[0] < part[1]]
        if score < safe_from(2):  # then they follow each other
            self._second = [(lower[0], score + 1)]
        self._back = leg.bust[score] | (leg.left[score] == score)
        after = np.where(self._back, 0.0, leg.expected[leg.left[score]])
        self._cost, self._slope = leg.choice.means_at(1, score, np.stack([after, self._back]))

    def value(self, guess: float) -> tuple[float, float]:
        """W_3(s) and its derivative, if V(s) is a guess."""
        score = self.score
        after, slopes = self._after_last(guess)
        two, slopes_of_two = self._known(2, guess)
        for low, end in self._second:
            two[low:end], slopes_of_two[low:end] = self._darts(low, end, 2, after, slopes)
        value, slope = self._darts(score, score + 1, 3, two, slopes_of_two)
        return float(value[0]), float(slope[0])

    def _after_last(self, guess: float) -> tuple[np.ndarray, np.ndarray]:
        """W_1 of the scores that can remain, and its derivative; the last ones after a bust."""
        leg, score, last = self._leg, self.score, self._last
        (after, slopes), table = self._known(1, guess), leg.choices[2][score]
        after[score], table[0] = leg.best_of(
            1, score, leg.dart + (self._cost + guess * self._slope)
        )
        slopes[score] = leg.choice.results[table[0]] @ self._back
        if last.start < last.stop:
            after[last], aims = leg.best(
                1, last.start, leg.last_cost[last] + guess * leg.bust_chance[last]
            )
            slopes[last] = np.einsum(
                "ko,ko->k", leg.choice.results.take(aims, axis=0), leg.bust[last]
            )
            table[score - last.stop + 1 : score - last.start + 1] = aims[::-1]
        return after, slopes

    def _darts(
        self, low: int, end: int, darts: int, after: np.ndarray, slopes: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """W_k of the scores from low to before end, and its derivative, from those of one dart
        less.
        """
        leg, score, ends = self._leg, self.score, self._leg.ends[low:end]
        value, aims = leg.best(
            darts, low, leg.dart + leg.choice.means(darts, low, after.take(ends))
        )
        leg.choices[3 - darts][score, score - end + 1 : score - low + 1] = aims[::-1]
        return value, np.einsum(
            "ko,ko->k", leg.choice.results.take(aims, axis=0), slopes.take(ends)
        )

    def safe(self, darts: int) -> tuple[float, int]:
        """W_k of the score in a turn that starts higher, and its aim."""
        leg, score = self._leg, self.score
        after = leg.known[darts - 1].take(leg.left[score])
        return leg.best_of(
            darts, score, leg.dart + leg.choice.means_at(darts, score, after[None])[0]
        )

    def _known(self, darts: int, guess: float) -> tuple[np.ndarray, np.ndarray]:
        """W_k of all scores from which no dart can bust, and of a bust, and its derivative."""
        value, slopes = np.empty(self.score + 2), np.zeros(self.score + 2)
        value[:-1] = self._leg.safe[darts - 1, : self.score + 1]
        value[0], value[-1], slopes[-1] = 0.0, guess, 1.0
        return value, slopes
