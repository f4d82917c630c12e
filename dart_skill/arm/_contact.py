"""What a careful motion does when that which the hand carries touches something: it feels for the way
in, backs out and tries again, and says so where it does not go in.

Contact is felt from the encoders alone: a hand that does not come along with its plan is held back.
How far it must stay behind follows from a force and from the compliance of the law that moves it.
The search is a spiral across the direction of the motion at constant speed, while the hand presses
lightly (Chhatpar and Branicky, "Search strategies for peg-in-hole assemblies with position
uncertainty", IROS 2001).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

FELT_SHARE = 0.4
"""Contact is felt at this share of the force with which the hand may press."""
PRESSES = 0.25
"""A hand that searches presses with this share of it: friction at the rim, which is a share of that
force, shall not hold what it carries against the spiral.
"""
LEAST_FELT = 0.005
"""A hand that is less far behind is not held back [m]: so late a free one may be."""
BESIDE = 0.001
"""A hand that is nearer to where it is pulled presses against nothing [m]."""
SLOWEST = 0.005
"""Planned speed below which the motion has no direction in which it could be held back [m/s]."""
PITCH = 0.003
"""Distance between two turns of the spiral [m]: less than parts have play."""
FEELS = 0.02
"""Speed along the spiral [m/s]."""
WIDEST = 0.009
"""Radius at which a search is given up [m]."""
GAVE_WAY = 0.004
"""Way along the motion by which the hand has found in [m]."""
BACK = 0.8
"""So much of the plan is gone backwards before the second try [s]."""
TRIES = 2
"""Searches from the outside, until the motion is given up."""


class Yielding(NamedTuple):
    """How far the hand gives way to a force, by the law that pulls it.

    Parameters
    ----------
    compliance
        From a force to how far it holds the hand back, while the arm does the same, (3, 3) [m/N].
    lead
        A hand that is slower than wanted by v is pulled like one that is v times this behind [s].
    """

    compliance: np.ndarray
    lead: float


Yields = Callable[[], Yielding]
"""Tells it of a hand that is behind."""


class ContactSearch:
    """Watches one motion for contact, and searches.

    Attributes: aside, where the search has moved the hand (3,) [m]; touches, whether the hand is
    held back now; fault, why the motion is given up, empty while it is not.

    Parameters
    ----------
    force
        With which the hand may press at most [N]; default: contact is not felt.
    """

    def __init__(self, force: float = np.inf):
        self._force = force
        self._tries, self._backs_until = 0, 0.0
        self._axis: np.ndarray | None = None
        self.aside, self.fault = np.zeros(3), ""

    @property
    def touches(self) -> bool:
        """Whether the hand is held back now."""
        return self._axis is not None

    def searches(self, time: float) -> bool:
        """Whether the hand is held back, or on its way back from there, so long after the motion
        began [s].
        """
        return self.touches or time < self._backs_until

    def across(self, way: np.ndarray) -> np.ndarray:
        """What of a way (3,) is across the motion that is held back; all of it where none is."""
        return way if self._axis is None else way - (way @ self._axis) * self._axis

    def too_hard(self, way: np.ndarray, slower: np.ndarray, yields: Yields) -> np.ndarray:
        """How much less far (3,) [m] a hand that is held back must be aimed, so that it presses along
        the motion no harder than a search shall, across it no harder than the hand may; 0 where
        none is held back.

        Parameters
        ----------
        way
            That the hand is aimed ahead (3,) [m].
        slower
            By how much it is slower than wanted (3,) [m/s].
        yields
            As of `rate`.
        """
        if self._axis is None:
            return np.zeros(3)
        compliance, lead = yields()
        pulled = way + lead * slower
        across = self.across(pulled)
        aside = across / max(float(np.linalg.norm(across)), 1e-9)
        parts = ((self._axis, PRESSES), (aside, 1.0))
        return sum(
            max(pulled @ axis - share * self._force * (axis @ compliance @ axis), 0.0) * axis
            for axis, share in parts
        )

    def rate(
        self,
        time: float,
        step: float,
        hand: np.ndarray,
        wanted: np.ndarray,
        velocity: np.ndarray,
        slower: np.ndarray,
        carries: bool,
        yields: Yields,
    ) -> float:
        """Rate of the plan's clock: 1 as planned, 0 while it is searched, -1 on the way back.

        Parameters
        ----------
        time, step
            Since the motion began, and since the last state [s].
        hand, wanted
            Where the hand is, and where it shall be (3,) [m].
        velocity
            Planned there (3,) [m/s].
        slower
            By how much the hand is slower than that (3,) [m/s].
        carries
            Whether the hand holds something.
        yields
            Asked only of a hand that is behind.
        """
        if time < self._backs_until:
            return -1.0
        if self._tries == TRIES:
            self.fault = (
                "what the hand carries touched something on its way, and did not go in within"
                f" {1e3 * WIDEST:.0f} mm of it in {TRIES} tries"
            )
        if self.fault or not carries:
            return 1.0
        if self._axis is None and not self._meets(hand, wanted, velocity, slower, yields):
            return 1.0
        if (hand - self._met) @ self._axis > GAVE_WAY:
            self._axis = None
            return 1.0
        if self._widen(step):
            return 0.0
        self._back_out(time)
        return -1.0

    def _meets(
        self,
        hand: np.ndarray,
        wanted: np.ndarray,
        velocity: np.ndarray,
        slower: np.ndarray,
        yields: Yields,
    ) -> bool:
        """Whether a hand that was free is held back from now on."""
        speed = float(np.linalg.norm(velocity))
        if speed < SLOWEST:
            return False
        axis = velocity / speed
        behind = (wanted - hand) @ axis
        if behind < BESIDE:
            return False
        compliance, lead = yields()
        felt = FELT_SHARE * self._force * (axis @ compliance @ axis)
        if behind + lead * (slower @ axis) < max(felt, LEAST_FELT):
            return False
        self._axis, self._met = axis, hand.copy()
        first = np.cross(self._axis, np.eye(3)[np.abs(self._axis).argmin()])
        self._plane = np.array([first, np.cross(self._axis, first)]) / np.linalg.norm(first)
        self._angle, self._centre = 0.0, self.aside
        return True

    def _widen(self, step: float) -> bool:
        """Go on along the spiral; False at its end."""
        radius = PITCH * self._angle / (2.0 * np.pi)
        self._angle += FEELS * step / max(radius, 0.25 * PITCH)
        sense = (-1.0) ** self._tries
        turned = np.array([np.cos(self._angle), sense * np.sin(self._angle)])
        self.aside = self._centre + radius * turned @ self._plane
        return radius < WIDEST

    def _back_out(self, time: float) -> None:
        self._tries += 1
        self._backs_until, self._axis, self.aside = time + BACK, None, np.zeros(3)
