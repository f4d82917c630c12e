"""A person who guides the arm's hand over the rim of a cup that moves, and down into it, and stays
there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dart_skill.arm import ArmState
from dart_skill.simulation._guiding import Guiding, smooth
from dart_skill.simulation._teacher import Person


@dataclass(frozen=True)
class Reaching:
    """How a person reaches. Spreads are standard deviations.

    Parameters
    ----------
    wait, wait_spread
        Before the hand moves [s].
    duration, duration_spread
        Of the way [s], and as a share.
    above, height_spread
        Height over the cup's floor from which the hand comes down [m].
    aim_spread
        Of where the hand ends in the cup, along each axis [m].
    rest
        The hand stays in the cup for so long [s].
    follows, firm_wrist
        As of `Guiding`.
    """

    wait: float = 1.0
    wait_spread: float = 0.1
    duration: float = 1.8
    duration_spread: float = 0.06
    above: float = 0.12
    height_spread: float = 0.008
    aim_spread: float = 0.003
    rest: float = 1.0
    follows: float = 6.0
    firm_wrist: tuple[float, float] = (60.0, 3.0)


class Reacher(Guiding):
    """Guides one movement at a time: `begin`, then `watch` and `step` once per state until `done`.

    Parameters
    ----------
    seed
        Of what differs from one time to the next.
    reaching, person
        How they do it; the defaults where none is given.
    step
        Control period [s].
    """

    def __init__(
        self,
        seed: int = 0,
        reaching: Reaching | None = None,
        person: Person | None = None,
        step: float = 0.002,
    ):
        self.reaching = reaching or Reaching()
        super().__init__(seed, person, self.reaching.follows, self.reaching.firm_wrist, step)

    def begin(self, state: ArmState) -> None:
        """Begin where the hand is now."""
        self._begin_guiding(state)
        r, rng = self.reaching, self._rng
        self._wait = r.wait + r.wait_spread * rng.standard_normal()
        self._way = r.duration * (1.0 + r.duration_spread * rng.standard_normal())
        self._above = np.array([0.0, 0.0, r.above + r.height_spread * rng.standard_normal()])
        self._aside = r.aim_spread * rng.standard_normal(3)
        hand = self._model.hand_state(state.position, state.velocity)
        self._first, self._rotation = hand.position, hand.rotation
        self._cup, self._seen, self._speed, self._beside = (
            np.zeros(3),
            0.0,
            np.zeros(3),
            np.zeros(3),
        )

    def watch(
        self, state: ArmState, cup: np.ndarray, speed: np.ndarray, beside: np.ndarray
    ) -> None:
        """What the person sees now: the cup (3,) [m] and how it moves (3,) [m/s], and the hand
        from where the arm takes it to be (3,) [m].

        Encoders that read wrong do not mislead them: what they see of the hand counts.

        Parameters
        ----------
        speed
            Of the cup.
        beside
            Place of the hand from there.
        """
        self._cup, self._speed, self._beside, self._seen = cup, speed, beside, self._time(state)

    def done(self, state: ArmState) -> bool:
        """Whether the hand has been in the cup for long enough."""
        return self._time(state) >= self._wait + self._way + self.reaching.rest

    def _wanted(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        share = (time - self._wait) / self._way
        over, down = smooth(share / 0.75), smooth((share - 0.5) / 0.5)
        inside = self._cup + (time - self._seen) * self._speed + self._aside
        return self._first + over * (
            inside - self._beside + self._above - self._first
        ) - down * self._above, self._rotation
