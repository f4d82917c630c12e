"""A person who guides the arm's hand, in which there is a spoon: into a pot, some turns round in it,
and up again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dart_skill.arm import ArmState, Grip
from dart_skill.movement import SoftClock
from dart_skill.simulation._carrier import Carrier, Carrying
from dart_skill.simulation._guiding import smooth
from dart_skill.simulation._teacher import Person
from dart_skill.simulation._workbench import Pose


@dataclass(frozen=True)
class Stirring:
    """How a person stirs. Spreads are standard deviations.

    Parameters
    ----------
    radius, radius_spread
        Of a turn [m], and as a share.
    turns
        How many.
    pace, pace_spread
        Turns in a second [1/s], and as a share from one time to the next.
    uneven
        How much faster, as a share, a turn is on one side than on the other.
    begin_spread
        Of the side on which the first turn begins [rad].
    sets_off
        Time in which the hand comes to that pace, and to rest [s].
    rises, rise_time
        How far the spoon is lifted at the end [m], and in which time [s].
    """

    radius: float = 0.04
    radius_spread: float = 0.02
    turns: int = 3
    pace: float = 0.7
    pace_spread: float = 0.05
    uneven: float = 0.1
    begin_spread: float = 0.3
    sets_off: float = 0.6
    rises: float = 0.12
    rise_time: float = 1.5


class Stirrer(Carrier):
    """See `Carrier`: `begin` has the middle of the circle as its goal, whose z axis the spoon goes
    round.

    Parameters
    ----------
    stirring
        How they stir: fields of `Stirring`.
    """

    def __init__(
        self,
        seed: int = 0,
        carrying: Carrying | None = None,
        person: Person | None = None,
        step: float = 0.002,
        part: str = "spoon",
        **stirring: Any,
    ):
        self.stirring = replace(Stirring(), **stirring)
        super().__init__(seed, carrying, person, step, part)

    def begin(self, state: ArmState, part: Pose, goal: Pose) -> None:
        """Bring the spoon from where it is to a circle about a goal, and stir; both as the person
        sees them.
        """
        super().begin(state, part, goal)
        s, rng = self.stirring, self._rng
        self._radius = s.radius * (1.0 + s.radius_spread * rng.standard_normal())
        self._pace = s.pace * (1.0 + s.pace_spread * rng.standard_normal())
        self._begins = s.begin_spread * rng.standard_normal()
        self._axes = self._turns(1.0).as_matrix()
        self._last = self._last + self._circle(np.zeros(1))[0]

    @property
    def _clock(self) -> SoftClock:
        """Clock of the turns, at the pace at which they are made."""
        return SoftClock(self.stirring.turns / self._pace, self.stirring.sets_off)

    @property
    def _stirs_at(self) -> float:
        """Instant at which the first turn begins [s]."""
        return 2.0 * self.carrying.wait + self._way + self.carrying.rest

    @property
    def _rises_at(self) -> float:
        return self._stirs_at + self._clock.duration + self.carrying.rest

    @property
    def duration(self) -> float:
        """See `Carrier`."""
        return self._rises_at + self.stirring.rise_time + self.carrying.rest

    def _circle(self, turns: np.ndarray) -> np.ndarray:
        """Places (n, 3) [m] about the middle after turns (n,)."""
        angle = 2.0 * np.pi * turns + self._begins
        angle = angle + self.stirring.uneven * np.sin(angle)
        rows = np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
        return self._radius * rows @ self._axes.T

    def _places(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        place, over = super()._places(times)
        turned = self._pace * self._clock.at(times - self._stirs_at)[0]
        place += self._circle(turned) - self._circle(np.zeros(1))
        rises = (times - self._rises_at) / self.stirring.rise_time
        place[:, 2] += self.stirring.rises * np.array([*map(smooth, rises.tolist())])
        return place, over

    def _button(self, time: float) -> Grip:
        return Grip.UNSPECIFIED
