"""What the last hits tell of a thrower's spread: its most likely covariance about their aims."""

from __future__ import annotations

from collections import deque
from collections.abc import Set

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.darts._estimation import estimate_from_points
from dart_skill.darts._exact import expected_score
from dart_skill.darts._optimum import Aim, best_aim, local_optima
from dart_skill.darts._spread import Spread
from dart_skill.mixture._checks import as_count, as_vector

BULL = np.zeros(2)
FEWEST = 4
"""Hits that a covariance needs at least."""


class RecentHits:
    """The last hits and their aims, and the aim with the highest expected score for the spread that they show.

    A bias counts as spread: practice removes it, and then another aim would be wrong.
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
        """Of the spread [mm], nan before there is one."""
        return float("nan") if self.spread is None else self.spread.sigma

    def tell(self, hit: ArrayLike) -> bool:
        """Where the dart went (2,) [mm] that was thrown at the aim chosen last; whether that changed the estimate."""
        self._hits.append(as_vector(hit, "hit", 2))
        self._aims.append(self._aimed)
        self._n_told += 1
        if self._n_told < self._least or self._n_told % self._every:
            return False
        self.spread = estimate_from_points(np.array(self._hits), np.array(self._aims), model="general").spread
        return True

    def choose(self, beyond: Set[str]) -> Aim:
        """The best aim in a bed that is not beyond reach; the bull before there is an estimate, or if no other is left."""
        aim = Aim(BULL, float("nan")) if self.spread is None else self._best(self.spread, beyond)
        self._aimed = aim.point
        return aim

    def _best(self, spread: Spread, beyond: Set[str]) -> Aim:
        best = best_aim(spread)
        if best.bed not in beyond:
            return best
        others = (aim for aim in local_optima(spread) if aim.bed not in beyond)
        return next(others, Aim(BULL, float(expected_score(BULL, spread))))
