"""The plainest way to learn from a miss: aim the next throw off by what the last one missed.

It is Newton's method for the miss as a function of the aim, with a Jacobian that is never computed
anew (K. Ploeger and J. Peters, 2026): where the aim goes, the landing goes. So the Jacobian is the
identity, and a step of the aim x is

    x <- x - (landing - target)

It has no model of scatter and none of places: each throw is believed to the last millimetre, and
the miss of one target is that of all others.
"""

from __future__ import annotations

import numpy as np

from dart_skill.common.surface import RIMS, Surface
from dart_skill.common.vectors import at_most
from dart_skill.skills.practice._correction import NOTHING, CorrectionSettings, as_throws


class NewtonCorrection:
    """The last miss, in place of what `Correction` learns from all of them.

    Parameters
    ----------
    settings
        CorrectionSettings, of which `farthest` counts; default None: the default ones.
    surface
        On which throws come down, default rims of baskets.
    """

    share = 0.0
    """A late release excuses nothing."""

    def __init__(self, settings: CorrectionSettings | None = None, surface: Surface = RIMS):
        self.settings, self._surface = settings or CorrectionSettings(), surface
        self.throws: np.ndarray = np.empty((0, 6))

    def __len__(self) -> int:
        return len(self.throws)

    @property
    def _miss(self) -> np.ndarray:
        return self.throws[-1, 2:4] if len(self) else NOTHING

    def remember(self, throws: np.ndarray) -> None:
        """Take up what another correction remembered (n, 6): the last throw of it.

        Raises
        ------
        ValueError
            For another shape, or what is not finite.
        """
        self.throws = as_throws(throws)[-1:]

    def add(self, place: np.ndarray, miss: np.ndarray, explained: np.ndarray = NOTHING) -> None:
        """Take the miss (2,) [m] of the newest throw, at a place (2,).

        Raises
        ------
        ValueError
            For what is not finite.
        """
        self.remember(np.concatenate([place, miss, explained])[None])

    def predict(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The last miss at every place (n, 2), and its standard deviation, of which it says
        nothing: nan.
        """
        shape = (len(np.reshape(places, (-1, 2))), 2)
        return np.broadcast_to(self._miss, shape), np.full(shape, np.nan)

    def shifted(self, target: np.ndarray) -> np.ndarray:
        """The point (3,) to plan for so that the ball comes down on the target (3,)."""
        target = np.asarray(target, dtype=float)
        point = target
        for _ in range(3):  # the axes of a miss are those of the point
            move = self._surface.offset(self._miss, point)
            point = target - at_most(move, self.settings.farthest)
        return point

    def suspicions(self) -> list:
        """None: nothing surprises it."""
        return []

    def suspect(self, suspicions: list) -> None:
        """Nothing waits for another throw like it."""
