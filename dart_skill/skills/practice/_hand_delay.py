"""How long the hand takes to let go, as far as own throws tell: the mean of what was seen, until
it is another hand.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

USUAL_DELAY_SPREAD = 0.004
"""Standard deviation [s] of a hand about which little is known: docs/throwing.md."""
PRIOR_WEIGHT = 4.0
"""Openings that this counts for."""
SURPRISE = 2.5
"""Standard deviations: two openings in a row, both early or both late by more, are those of a hand
that has changed.
"""
MEMORY = 100
CLEARLY = 0.0015
"""An opening that was not seen to so much [s] tells nothing: a hand that moves as the ball does
hides when it has let go.
"""


class HandDelay:
    """Delays from the command to the release [s], the latest."""

    def __init__(self, delays: Iterable[float] = ()):
        self._delays: list[float] = [float(delay) for delay in delays if np.isfinite(delay)]
        self._odd: float | None = None

    def __len__(self) -> int:
        return len(self._delays)

    @property
    def mean(self) -> float:
        """Expected delay [s], 0 before anything was seen."""
        return float(np.mean(self._delays)) if self._delays else 0.0

    @property
    def spread(self) -> float:
        """Standard deviation of single delays [s]; that of a usual hand counts for a few."""
        squares = (
            np.sum(np.square(np.array(self._delays) - self.mean))
            + PRIOR_WEIGHT * USUAL_DELAY_SPREAD**2
        )
        return float(np.sqrt(squares / (PRIOR_WEIGHT + max(len(self._delays) - 1, 0))))

    def add(self, delay: float, uncertainty: float = 0.0, confirmed: bool = True) -> None:
        """One more opening, seen with an uncertainty [s]; nan, of one that was not seen, tells
        nothing. A surprise counts from the second one on.

        Parameters
        ----------
        confirmed
            Whether the ball came down where it does after such an opening. A surprise that the
            landing contradicts was seen wrong, and tells nothing.
        """
        if not (np.isfinite(delay) and uncertainty <= CLEARLY):
            return
        off = delay - self.mean
        surprising = len(self._delays) >= 2 and abs(off) >= SURPRISE * self.spread
        if surprising and not confirmed:
            return
        if not surprising:
            self._odd, self._delays = None, [*self._delays, float(delay)][-MEMORY:]
        elif self._odd is not None and (self._odd - self.mean) * off > 0:
            self._delays = [self._odd, float(delay)]
            self._odd = None
        else:
            self._odd = float(delay)

    def state(self) -> dict:
        """What is remembered, for JSON."""
        return {"delays": self._delays, "odd": self._odd}

    def restore(self, state: dict) -> None:
        """Remember what `state` gave, and nothing else.

        Parameters
        ----------
        state
            As it was returned.
        """
        self._delays = [float(delay) for delay in state["delays"]]
        self._odd = None if state["odd"] is None else float(state["odd"])


def likely_late(seen: float, uncertainty: float, spread: float = USUAL_DELAY_SPREAD) -> float:
    """How late [s] a hand most probably let go that was seen to be so late, with an uncertainty
    [s]; nan stays nan.

    Parameters
    ----------
    spread
        Standard deviation [s] of its delays.
    """
    return seen * spread**2 / (spread**2 + uncertainty**2)
