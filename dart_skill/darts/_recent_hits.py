"""A thrower's spread, estimated from the last hits: the most likely covariance about their aims."""

from __future__ import annotations

from collections import deque
from collections.abc import Set

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_vector
from dart_skill.darts._estimation import estimate_from_points
from dart_skill.darts._exact import expected_score
from dart_skill.darts._optimum import Aim, best_aim, local_optima
from dart_skill.darts._spread import Spread

BULL = np.zeros(2)
FEWEST = 4
"""Least number of hits from which a covariance can be estimated."""


class RecentHits:
    """The last hits with their aims, and the aim with the highest expected score for the spread
    estimated from them.

    A bias counts as spread and is not corrected in the aim: practice removes it.

    Parameters:

    * window: int, number of the last hits that are used.
    * least: int, number of hits before the first estimate.
    * every: int, number of hits between two estimates.
    """

    def __init__(self, window: int, least: int, every: int):
        least, every = as_count(least, "least", FEWEST), as_count(every, "every")
        self._least, self._every = least, every
        self._aims: deque[np.ndarray] = deque(maxlen=as_count(window, "window", least))
        self._hits: deque[np.ndarray] = deque(maxlen=self._aims.maxlen)
        self._n_told, self._aimed = 0, BULL
        self.spread: Spread | None = None

    @property
    def sigma(self) -> float:
        """Sigma of the spread [mm]; nan before the first estimate."""
        return float("nan") if self.spread is None else self.spread.sigma

    def tell(self, hit: ArrayLike) -> bool:
        """Learn from the hit (2,) [mm] of the dart that was thrown at the aim chosen last; returns
        whether there is a new estimate.
        """
        self._hits.append(as_vector(hit, "hit", 2))
        self._aims.append(self._aimed)
        self._n_told += 1
        if self._n_told < self._least or self._n_told % self._every:
            return False
        self.spread = estimate_from_points(
            np.array(self._hits), np.array(self._aims), model="general"
        ).spread
        return True

    def choose(self, beyond: Set[str]) -> Aim:
        """The best aim that is not in one of the beds `beyond`; the bull before the first
        estimate, or if no other bed is left.
        """
        aim = Aim(BULL, float("nan")) if self.spread is None else self._best(self.spread, beyond)
        self._aimed = aim.point
        return aim

    def _best(self, spread: Spread, beyond: Set[str]) -> Aim:
        best = best_aim(spread)
        if best.bed not in beyond:
            return best
        others = (aim for aim in local_optima(spread) if aim.bed not in beyond)
        return next(others, Aim(BULL, float(expected_score(BULL, spread))))
