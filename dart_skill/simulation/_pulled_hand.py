"""Hands that guide the arm to where a pointer pulls them: what is between a mouse and the hand of
a simulated arm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.arm import ArmState, Command, Grip
from dart_skill.common.checks import check_unit_quaternions
from dart_skill.common.vectors import at_most
from dart_skill.simulation._guiding import SLOW_WRIST, Guiding
from dart_skill.simulation._teacher import Person


@dataclass(frozen=True)
class Pulling:
    """How the hand follows a pointer, which may jump.

    Parameters
    ----------
    fastest, fastest_turn
        The hand is pulled no faster [m/s], [rad/s].
    quick
        How fast what is left of the way is made up, critically damped [1/s].
    firm_hand, firm_wrist
        Stiffness and damping of the hold [N/m, N s/m], [N m/rad, N m s/rad].
    strongest_push
        What the spring between pointer and hand pulls with at most [N].
    follows
        As of `Guiding`.
    lead
        The hand may be pulled so long after the beginning: what goes before a movement is
        recorded, too [s].
    patience
        The hand is let go of when it was not pulled for so long, and the fingers were not told
        anything [s].
    """

    fastest: float = 0.5
    fastest_turn: float = 1.5
    quick: float = 15.0
    firm_hand: tuple[float, float] = (2000.0, 120.0)
    firm_wrist: tuple[float, float] = SLOW_WRIST
    strongest_push: float = 80.0
    follows: float = 6.0
    lead: float = 0.6
    patience: float = 300.0


class PulledHand(Guiding):
    """Guides one movement at a time: `begin`, then `pull`, `tell` and `finish` as the person
    wants, and `step` once per state.

    Parameters
    ----------
    pulling
        How the hand follows; the default where none is given.
    step
        Control period [s].
    """

    def __init__(self, pulling: Pulling | None = None, step: float = 0.002):
        p = self.pulling = pulling or Pulling()
        # the person with the mouse trembles enough
        person = Person(tremble=0.0, strongest_push=p.strongest_push)
        super().__init__(0, person, p.follows, p.firm_hand, p.firm_wrist, step)
        self._guides, self._now = False, 0.0

    @property
    def guides(self) -> bool:
        """Whether the hand may be pulled now."""
        return self._guides and self._now >= self.pulling.lead

    @property
    def over(self) -> bool:
        """Whether the movement that was begun has ended."""
        return not self._guides

    def begin(self, state: ArmState) -> None:
        """Take hold of the hand where it is now."""
        # a teacher of throws has such a hand, too, and never begins
        from scipy.spatial.transform import Rotation

        self._begin_guiding(state)
        hand = self._model.hand_state(state.position, state.velocity)
        self._place, self._turned, self._grip = (
            hand.position,
            Rotation.from_matrix(hand.rotation),
            Grip.UNSPECIFIED,
        )
        self._pointer, self._pointer_turned = self._place, self._turned
        self._velocity, self._spin = np.zeros(3), np.zeros(3)
        self._now, self._pulled, self._guides = 0.0, 0.0, True

    def pull(self, position: ArrayLike, quaternion: ArrayLike) -> None:
        """The pointer is there now: position (3,) [m], quaternion (4,).

        Raises
        ------
        ValueError
            While no hand is held, or for what is no pose.
        """
        from scipy.spatial.transform import Rotation

        self._need_hold("pulled")
        place = np.asarray(position, dtype=float)
        if place.shape != (3,) or not np.isfinite(place).all():
            raise ValueError(
                f"the pointer is at {position!r}: give three finite coordinates in metres"
            )
        turned = check_unit_quaternions("pointer", np.asarray(quaternion, dtype=float)[None], 1)[0]
        self._pointer, self._pointer_turned, self._pulled = (
            place,
            Rotation.from_quat(turned),
            self._now,
        )

    def tell(self, grip: Grip) -> None:
        """The fingers are told something with the next step.

        Raises
        ------
        ValueError
            While no hand is held.
        """
        self._need_hold("told to open or to close")
        self._grip, self._pulled = grip, self._now

    def finish(self) -> None:
        """The movement has ended. The hand is held where it is, as long as there are steps.

        Raises
        ------
        ValueError
            As of `pull`.
        """
        self._need_hold("let go of")
        self.let_go()

    def let_go(self) -> None:
        """Whatever was begun has ended."""
        self._guides = False

    def step(self, state: ArmState) -> Command:
        """The push that answers one state.

        Raises
        ------
        ValueError
            When the hand was not pulled for too long.
        """
        self._follow(self._time(state))
        if self._guides and self._now - self._pulled > self.pulling.patience:
            raise ValueError(
                f"the hand was not pulled for {self.pulling.patience:.0f} s: the lesson ends"
            )
        return super().step(state)

    def _need_hold(self, what: str) -> None:
        if not self.guides:
            raise ValueError(
                f"the hand is not {what} now: ask /teach for a lesson with by_pointer, and wait"
                " until the hand is held"
            )

    def _follow(self, time: float) -> None:
        """Where the hand shall be moves towards the pointer: critically damped, and no faster than
        a person would.
        """
        from scipy.spatial.transform import Rotation

        p, dt = self.pulling, self._step
        self._velocity = at_most(
            self._velocity
            + dt * p.quick * (p.quick * (self._pointer - self._place) - 2.0 * self._velocity),
            p.fastest,
        )
        self._place = self._place + dt * self._velocity
        self._spin = at_most(
            0.5 * p.quick * (self._pointer_turned * self._turned.inv()).as_rotvec(), p.fastest_turn
        )
        self._turned = Rotation.from_rotvec(dt * self._spin) * self._turned
        self._now = time

    def _wanted(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        from scipy.spatial.transform import Rotation

        ahead = time - self._now
        return (
            self._place + ahead * self._velocity,
            (Rotation.from_rotvec(ahead * self._spin) * self._turned).as_matrix(),
        )

    def _button(self, time: float) -> Grip:
        told = self._grip
        self._grip = Grip.UNSPECIFIED
        return told
