"""A person who guides the hand of a gravity-compensated arm along a path that they have in mind,
as one does with kinesthetic teaching.

The person sees how far the hand is off the path, and pushes. How firmly is that of `Person`; which
path, that of who derives from this.
"""

from __future__ import annotations

import numpy as np

from dart_skill.arm import (
    ArmModel,
    ArmState,
    Command,
    Grip,
    HandSeen,
    HandState,
    rotation_error,
)
from dart_skill.common.quaternions import from_vectors, matrices
from dart_skill.common.vectors import at_most
from dart_skill.simulation._teacher import Person, tremor

MOST_LEFT = np.repeat([0.02, 0.3], 3)
"""What is left of a distance to the path is taken out as if it were no larger [m], [rad]."""
SLOW_HAND = (2500.0, 100.0)
"""Stiffness and damping of a push that guides slowly and exactly [N/m, N s/m]. The simulated person
knows the hand from the joints, on the motors' side of the cables: as firm as in a swing they would
make arms of config/fleet.yaml swing by millimetres.
"""
SLOW_WRIST = (40.0, 0.6)
"""Stiffness and damping of a turn with both hands [N m/rad, N m s/rad]."""


class Guiding:
    """Guides one movement at a time: `_begin_guiding`, then `step` once per state. Who derives
    from it writes `_wanted`.

    Parameters
    ----------
    seed
        Of what differs from one time to the next.
    person
        How firmly they push.
    follows
        How fast what is left of the distance to the path is taken out [1/s]: a person sees it.
    firm_hand, firm_wrist
        Stiffness and damping of the push [N/m, N s/m], None: those of the person, and of the turn
        [N m/rad, N m s/rad].
    step
        Control period [s].
    looks_at
        Body that the person looks at, as a role: encoders that read wrong do not mislead them.
        Empty: they believe the arm.
    """

    def __init__(
        self,
        seed: int,
        person: Person | None,
        follows: float,
        firm_hand: tuple[float, float] | None,
        firm_wrist: tuple[float, float],
        step: float,
        looks_at: str = "",
    ):
        self.person = person or Person()
        self._firm_hand = firm_hand or self.person.firm_hand
        self._follows, self._firm_wrist = follows, firm_wrist
        self._model, self._seed, self._step, self._times = ArmModel(), seed, step, 0
        self._looks_at = looks_at
        self.forget()

    def forget(self) -> None:
        """Nothing is seen yet: the world was reset."""
        # a person needs no cameras that agree with the arm
        self._eyes = HandSeen(self._looks_at, largest=(np.inf, np.inf))

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A pose of a body (3,) [m], (4,), as the person sees it."""
        self._eyes.see(body, stamp_ns, position, quaternion)

    def look(self, state: ArmState) -> tuple[HandState, np.ndarray, np.ndarray]:
        """Compare what is seen with what the arm says, once for every state; `step` does so itself.

        Returns
        -------
        hand : HandState
            By the arm.
        position, rotation : (3,), (3, 3)
            Of the hand, as it is seen.
        """
        hand = self._model.hand_state(state.position, state.velocity)
        if not self._looks_at:
            return hand, hand.position, hand.rotation
        place, turned = self._body_in_hand(hand)
        shift, turn = self._eyes.offset(state.stamp_ns, place, turned)
        swing, lever = matrices(from_vectors(turn)), place - hand.position
        return hand, place + shift - swing @ lever, swing @ hand.rotation

    def _body_in_hand(self, hand: HandState) -> tuple[np.ndarray, np.ndarray]:
        """Pose (3,), (3, 3) of the body that is looked at, by the arm. Default: it is the hand."""
        return hand.position, hand.rotation

    def _begin_guiding(self, state: ArmState) -> None:
        """Another movement begins now, with its own random numbers."""
        self._times += 1
        self._rng = np.random.default_rng([self._seed, self._times])
        self._started_ns = state.stamp_ns
        self._tremble, self._left = np.zeros(3), np.zeros(6)

    def step(self, state: ArmState) -> Command:
        """The push that answers one state, and what the fingers are told."""
        hand, seen_at, seen_turned = self.look(state)
        time = self._time(state)
        position, rotation = self._wanted(time)
        ahead, ahead_rotation = self._wanted(time + self._step)
        velocity = (ahead - position) / self._step
        spin = rotation_error(ahead_rotation, rotation) / self._step
        off = np.concatenate([position - seen_at, rotation_error(rotation, seen_turned)])
        self._left = np.clip(self._left + self._follows * self._step * off, -MOST_LEFT, MOST_LEFT)
        (k, d), (kr, dr) = self._firm_hand, self._firm_wrist
        self._tremble = tremor(self._tremble, self.person, self._rng, self._step)
        force = k * (off[:3] + self._left[:3]) + d * (velocity - hand.linear) + self._tremble
        twist = kr * (off[3:] + self._left[3:]) + dr * (spin - hand.angular)
        push = np.concatenate(
            [
                at_most(force, self.person.strongest_push),
                at_most(twist, self.person.strongest_twist),
            ]
        )
        return Command(
            state.stamp_ns, push, self._steady_elbow(state, hand.position), self._button(time)
        )

    def _time(self, state: ArmState) -> float:
        return (state.stamp_ns - self._started_ns) * 1e-9

    def _wanted(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Where the hand shall be (3,), and how turned (3, 3), so long after the beginning [s]."""
        raise NotImplementedError

    def _button(self, time: float) -> Grip:
        """What the fingers are told then. Default: nothing."""
        return Grip.UNSPECIFIED

    def _steady_elbow(self, state: ArmState, hand: np.ndarray) -> np.ndarray:
        """The other hand keeps the elbow over the line from the base to the hand (3,): joint
        torques (n,).
        """
        k, d = self.person.firm_elbow
        elbow, jacobian = self._model.elbow(state.position)
        across = np.array([-hand[1], hand[0], 0.0]) / np.hypot(hand[0], hand[1])
        force = -(k * (elbow @ across) + d * (across @ jacobian @ state.velocity)) * across
        return jacobian.T @ at_most(force, self.person.strongest_push)


class Holder(Guiding):
    """Holds the hand where it is met, while asked to.

    Parameters
    ----------
    seed
        Of the trembling.
    person
        How firmly they hold; the defaults where none is given.
    """

    def __init__(self, seed: int = 0, person: Person | None = None, step: float = 0.002):
        super().__init__(
            seed, person, follows=0.0, firm_hand=None, firm_wrist=SLOW_WRIST, step=step
        )
        self._met: tuple[np.ndarray, np.ndarray] | None = None

    def push(self, state: ArmState, holds: bool) -> Command | None:
        """What the person does to an arm in this state; None if they do not touch it.

        Parameters
        ----------
        holds
            Whether they do.
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


def smooth(share: float) -> float:
    """Minimum jerk from 0 to 1, as `minimum_jerk` for one number; rounding must not lead beyond."""
    s = min(max(share, 0.0), 1.0)
    return min((10 - 15 * s + 6 * s * s) * s**3, 1.0)
