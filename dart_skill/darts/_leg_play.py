"""A leg as it is played: what is left after each dart, and when a turn or the leg is over."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count
from dart_skill.darts._board import BED_IS_DOUBLE, BED_SCORES, bed_at, place_of

PER_TURN = 3


@dataclass(frozen=True)
class LegDart:
    """A dart of a leg.

    * before: what was left before it; after: what is left then, after a bust as much as at the
      start of the turn.
    * hit: name of the place that it hit, such as T20, or what became of it.
    * points: of the dart, whether they count or not; bust: they do not.
    """

    before: int
    after: int
    hit: str
    points: int
    bust: bool = False


class LegInPlay:
    """501, double out, dart by dart.

    * start: the score at the start, default 501.

    Attributes:

    * darts: that were thrown, in order.
    * remaining: what is left.
    * turn_start: what was left when the turn began, to which a bust returns.
    * darts_left: of the turn.
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
        """A dart that nobody saw on the board: it scores nothing. why: what became of it."""
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
