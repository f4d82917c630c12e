"""Which basket to practise next: the one at which a throw teaches most of where throws are bad.

Errors at places near to each other resemble each other, as a Gaussian process says. So a throw
tells something of all places around its own, and less where many were thrown before. Chosen is the
one that takes most of the expected squared error away, over all baskets that may be chosen (D.
Cohn, Z. Ghahramani and M. Jordan, Active learning with statistical models, Journal of Artificial
Intelligence Research 4, 1996). The worst place alone would be chosen again and again where an arm
is bad and remains so, as at the end of its reach.
"""

from __future__ import annotations

import numpy as np

UNKNOWN_ERROR = 0.05
"""Error [m] that is expected where nothing was thrown: it takes worse ones than this to be sent
back to a place at once.
"""
LENGTHS = (0.25, 0.35)
"""Over which errors tell of each other, in distance [m] and azimuth [rad]."""
FADING = 0.95
"""Weight that an error loses with each later throw: the skill has learned since."""
REMEMBERED = 200
"""Throws at most, the latest: of older ones nothing is left by FADING, and each counts in every
choice.
"""
SCATTER = 1.0
"""Variance of what does not repeat in an error, in parts of that of what places differ by."""
UNSEEN_ERROR = 0.3
"""Error [m] of a throw whose landing was not seen."""
ODD = 2.0
"""A throw that was so many times as bad as expected asks for one elsewhere."""
ELSEWHERE = (0.4, 0.5)
"""Farther than this, in distance [m] and azimuth [rad]."""
GIVEN_UP = 20.0
"""Good throws that a place counts for where no throw came about: there is nothing to be learned.
"""


class Curriculum:
    """Remembers the errors of throws at places (distance [m], azimuth [rad])."""

    def __init__(self) -> None:
        self._places: np.ndarray = np.empty((0, 2))
        self._squares: np.ndarray = np.empty(0)
        self._weights: np.ndarray = np.empty(0)
        self._odd: np.ndarray | None = None

    def tell(self, target: np.ndarray, error: float) -> None:
        """A throw at a target (3,) missed by `error` [m], nan if it was not seen."""
        error = UNSEEN_ERROR if not np.isfinite(error) else float(error)
        odd = error > ODD * self.expected_error(np.asarray(target)[None])[0]
        self._add(target, error, 1.0)
        self._odd = self._places[-1] if odd else None

    def give_up(self, target: np.ndarray) -> None:
        """A throw at a target (3,) was refused, or stopped on its way: stay away from there for a
        while.
        """
        self._add(target, 0.0, GIVEN_UP)

    def _add(self, target: np.ndarray, error: float, weight: float) -> None:
        place = _places(target)
        if not np.isfinite(place).all():
            raise ValueError(f"target {target} of a throw is not finite")
        self._places = np.vstack([self._places, place])[-REMEMBERED:]
        self._squares = np.append(self._squares, error**2)[-REMEMBERED:]
        self._weights = np.append(self._weights, weight)[-REMEMBERED:]

    def expected_error(self, targets: np.ndarray) -> np.ndarray:
        """Root mean square (n,) [m] of the errors near targets (n, 3), newer ones counting more,
        and of UNKNOWN_ERROR, which counts as one.
        """
        places = _places(targets)
        age = np.arange(len(self._squares))[::-1]
        weights = _resemblance(places, self._places) * FADING**age * self._weights
        return np.sqrt((UNKNOWN_ERROR**2 + weights @ self._squares) / (1.0 + weights.sum(axis=1)))

    def order(self, targets: np.ndarray) -> list[int]:
        """Indices of targets (n, 3), first the one where the next throw teaches most. After a
        throw that was much worse than expected that is one elsewhere: has the arm changed, or is
        it the place?
        """
        near = np.zeros(len(targets), dtype=bool)
        if self._odd is not None:
            apart = (_places(targets) - self._odd) / ELSEWHERE
            near = np.linalg.norm(apart, axis=1) < 1.0
        return np.lexsort([-self.gains(targets), near]).tolist()

    def gains(self, targets: np.ndarray) -> np.ndarray:
        """How much of the expected squared error at all targets (n, 3) a throw at each of them takes
        away (n,) [m^2].
        """
        places = _places(targets)
        covariance = _resemblance(places, places)
        known = _resemblance(self._places, self._places) + np.diag(SCATTER / self._weights)
        shared = _resemblance(places, self._places)
        covariance -= shared @ np.linalg.solve(known, shared.T)
        told = covariance**2 / (np.diag(covariance) + SCATTER)
        return self.expected_error(targets) ** 2 @ told


def _resemblance(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """How much errors at places (m, 2) and (n, 2) resemble each other (m, n), from 0 to 1."""
    apart = (first[:, None] - second) / LENGTHS
    return np.exp(-0.5 * np.einsum("ijk,ijk->ij", apart, apart))


def _places(targets: np.ndarray) -> np.ndarray:
    """Distance [m] and azimuth [rad] (n, 2) of targets (n, 3), or of one (3,)."""
    x, y, _ = np.asarray(targets, dtype=float).reshape(-1, 3).T
    return np.column_stack([np.hypot(x, y), np.arctan2(y, x)])
