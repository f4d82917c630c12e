"""A person who shows how to reach into a cup: their hands, and what they see of cup and hand."""

from __future__ import annotations

import numpy as np

from dart_skill.arm import ArmModel, ArmState, Command
from dart_skill.simulation import Person, Reacher
from dart_skill.skills.execution import HandSeen, MovingBody
from dart_skill.skills.protocol import HAND


class ReachingPerson:
    """Tell what is seen by `see`; `begin`, then `step` once per state until `done`. They see as
    well as the cameras do, and as late.

    * seed: of what differs from one time to the next. person: how firmly they push.
    * cup: role of the body into which they reach.
    """

    def __init__(self, seed: int, person: Person | None = None, cup: str = "cup"):
        self._reacher, self._model = Reacher(seed, person=person), ArmModel()
        self._body = cup
        self.forget()

    def forget(self) -> None:
        """Nothing is seen yet: the world was reset."""
        self._cup, self._hand = MovingBody(self._body), HandSeen(HAND)

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A pose of a body: (3,) [m], (4,)."""
        if body == HAND:
            self._hand.see(stamp_ns, position)
        elif body == self._body:
            self._cup.see(stamp_ns, position, quaternion)

    def look(self, state: ArmState) -> None:
        """Compare what is seen of the hand with where the arm takes it to be, once per state, from
        before the beginning.
        """
        hand = self._model.hand_state(state.position, state.velocity).position
        self._beside = self._hand.beside(state.stamp_ns, hand)

    def begin(self, state: ArmState) -> None:
        """Begin where the hand is now; ValueError if no cup was seen."""
        if self._cup.newest_ns is None:
            raise ValueError(f"the {self._body} was not seen: is it tracked and published?")
        self._reacher.begin(state)

    def step(self, state: ArmState) -> Command:
        """The push that answers a state."""
        self.look(state)
        cup = self._cup.at(state.stamp_ns)
        self._reacher.watch(state, cup.position, cup.velocity, self._beside)
        return self._reacher.step(state)

    def done(self, state: ArmState) -> bool:
        """Whether the hand has been in the cup for long enough."""
        return self._reacher.done(state)
