"""A person who takes hold of the hand of a simulated arm where it is, and lets it go again."""

from __future__ import annotations

import numpy as np

from dart_skill.arm import ArmState, Command
from dart_skill.simulation._guiding import Guiding
from dart_skill.simulation._teacher import Person


class Holder(Guiding):
    """Holds the hand where it is met, while asked to.

    * seed: of the trembling. person: how firmly they hold; the defaults where none is given.
    """

    def __init__(self, seed: int = 0, person: Person | None = None, step: float = 0.002):
        super().__init__(seed, person, follows=0.0, firm_wrist=(60.0, 3.0), step=step)
        self._met: tuple[np.ndarray, np.ndarray] | None = None

    def push(self, state: ArmState, holds: bool) -> Command | None:
        """What the person does to an arm in this state; None if they do not touch it. holds:
        whether they do.
        """
        if not holds:
            self._met = None
            return None
        if self._met is None:
            hand = self._model.hand_state(state.position, state.velocity)
            self._begin_guiding(state)
            self._met = hand.position, hand.rotation
        return self.step(state)

    def _wanted(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        assert self._met is not None, "nothing is held"
        return self._met
