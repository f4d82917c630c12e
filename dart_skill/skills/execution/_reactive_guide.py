"""Guides the hand by a model that is asked at every state of the arm, with the frames of now."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.arm import (
    AS_SHOWN,
    LARGEST_REST,
    Fingers,
    Grip,
    GripEvent,
    Guidance,
    HandSeen,
    HandState,
    PoseGains,
    Reference,
    Registration,
    RestTakenOut,
    SeenOffset,
    Speed,
    rotation_error,
    shifted,
)
from dart_skill.common.quaternions import from_vectors, matrices
from dart_skill.movement import (
    PhaseModel,
    Reaction,
    ReactivePolicy,
    StateFrame,
    critical_damping,
)
from dart_skill.skills.execution._moving_body import BodyMotion, MovingBody

Frames = Callable[[Mapping[str, BodyMotion]], Sequence[StateFrame]]
"""From the motions of the bodies now, by name, to the task frames of the features [t, x, y, z]."""

STUCK = 0.005
"""A hand that stays behind, and is no farther from where it shall be, is held by friction [m]; what
is left is taken out. One that is farther is held by somebody.
"""
PACING = 0.1
"""Time constant with which the expected speed follows the rate of the phase [s]: that follows late
speeds of cables that give.
"""


@dataclass(frozen=True)
class ReactiveSettings:
    """What a motion that reacts is allowed.

    Parameters
    ----------
    oldest
        Of the newest pose of a body that it reacts to [s]; an older one stops the motion.
    rotation_stiffness
        Pull of the hand to its orientation, critically damped [1/s^2].
    follow_on
        The hand stays with the frames so long after the end of what was shown [s].
    catch_up
        A hand that is left behind is pulled so that (7.19) makes it no faster than so much above
        the speed of the motion [m/s].
    """

    oldest: float = 0.15
    rotation_stiffness: float = 400.0
    follow_on: float = 0.3
    catch_up: float = np.inf


class ReactiveGuide:
    """A `Guide` for the position of the hand; its orientation stays that of the start, unless the
    model turns it.

    Parameters
    ----------
    model
        Fitted over [t, x, y, z], so that its movement variables are the position of the hand; it
        may turn the hand, too.
    frames
        From bodies to task frames.
    bodies
        Their names. `see` tells where they are.
    start_posture
        Joint angles before the motion (7,) [rad].
    rotation
        Of the hand (3, 3).
    events
        What the fingers do, on the clock of the model's phase.
    inputs
        Further inputs of the model (q,).
    registration
        Of the cameras that see the poses; the frames are those of the arm.
    hand
        Name of the hand's own body. Where the cameras see it counts, and not where the arm takes
        it to be; empty: it is not looked at.
    speed
        That the person chose.
    carries
        Whether the hand holds something.
    """

    def __init__(
        self,
        model: PhaseModel,
        frames: Frames,
        bodies: Sequence[str],
        start_posture: np.ndarray,
        rotation: np.ndarray,
        *,
        what: str = "motion",
        speed: Speed = Speed.CAREFUL,
        carries: bool = False,
        events: Sequence[GripEvent] = (),
        inputs: ArrayLike | None = None,
        registration: Registration | None = None,
        hand: str = "",
        settings: ReactiveSettings | None = None,
    ):
        self.what, self.start_posture, self.speed = what, start_posture, speed
        self._bodies = {name: MovingBody(name) for name in bodies}
        self._frames, self._policy, self._rotation = (
            frames,
            ReactivePolicy(model, inputs),
            rotation,
        )
        self._fingers, self._s = Fingers(events, carries), settings or ReactiveSettings()
        stiffness, damping = np.broadcast_to(model.stiffness, 3), np.broadcast_to(model.damping, 3)
        turn = self._s.rotation_stiffness
        self._gains = PoseGains(
            np.append(stiffness, 3 * [turn]),
            np.append(damping, 3 * [float(critical_damping(turn))]),
        )
        self._registration = registration or Registration()
        self._hand_seen, self._rest = HandSeen(hand, self._registration), RestTakenOut()
        self._farthest = self._s.catch_up * damping / stiffness
        self._then, self._ended, self._pace, self._along = 0.0, 0.0, 1.0, 1.0

    @property
    def phase(self) -> float:
        """Place along the movement that was shown [s]."""
        return self._policy.phase

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A pose of a body; one that the motion does not depend on is left out."""
        self._hand_seen.see(body, stamp_ns, position, quaternion)
        if body in self._bodies:
            stamp_ns -= round(1e9 * self._registration.delay)
            self._bodies[body].see(stamp_ns, *self._registration.of_body(position, quaternion))

    def missing(self, stamp_ns: int) -> str:
        """Which body is not seen at an instant [ns], in words; empty if all are."""
        for name, body in self._bodies.items():
            if body.newest_ns is None:
                return f"the {name} has not been seen yet"
            if (age := (stamp_ns - body.newest_ns) * 1e-9) > self._s.oldest:
                return (
                    f"the {name} was last seen {age:.2f} s ago: more than {self._s.oldest} s are"
                    " too long to react to it"
                )
        return ""

    def look(self, time: float, hand: HandState, stamp_ns: int) -> Guidance:
        """See `Guide`."""
        step = time - self._then
        self._then = time
        if missing := self.missing(stamp_ns):
            return self._still(hand, missing)
        seen = self._hand_seen.offset(stamp_ns, hand.position, hand.rotation)
        frames = self._frames({name: body.at(stamp_ns) for name, body in self._bodies.items()})
        before, reaction = (
            self.phase,
            self._policy.react(frames, hand.position + seen.shift, hand.linear, step, self._pace),
        )
        share = min(step / PACING, 1.0)
        self._pace += (min(reaction.rate, 1.0) - self._pace) * share
        self._along += (min(reaction.along, 1.0) - self._along) * share
        if not self._policy.is_over:
            self._policy.phase = self._fingers.held(before, self.phase, reaction.rate, step)
        self._ended += step if self._policy.is_over else 0.0
        grip, carries = self._fingers.at(self.phase)
        wanted = self._reference(reaction, hand, seen)
        left = hand.position - wanted.position
        turned = rotation_error(hand.rotation, wanted.rotation)
        most = STUCK if self._along < AS_SHOWN else LARGEST_REST
        rest = self._rest.at(time, np.concatenate([left, turned]), most)
        return Guidance(
            time=self.phase,
            reference=shifted(wanted, rest),
            gains=self._gains,
            grip=grip,
            carries=carries,
            off=0.0,
            over=self._ended > self._s.follow_on,
            fault=self._fingers.fault,
            touches=bool(np.linalg.norm(left) >= most),
        )

    def _reference(self, reaction: Reaction, hand: HandState, seen: SeenOffset) -> Reference:
        """The hand is expected where the model has it at this phase. It moves as it does there, at
        the rate of the phase but no faster, and with its frames, which do not wait.
        """
        k, d = self._gains.stiffness[:3], self._gains.damping[:3]
        position = reaction.moment.state[:3]
        velocity, acceleration = reaction.moment.paced(self._pace)
        # (7.20): the attractor of a motion that waits does not pull it on
        attractor = position + (d * velocity + acceleration) / k
        nearer = self._too_far(position - hand.position - seen.shift)
        ahead, rotation, spin, growth = self._turned(reaction)
        motion = np.append(velocity, spin), np.append(acceleration, growth)
        wanted = Reference(attractor - nearer, ahead, position - nearer, rotation, *motion)
        return shifted(wanted, seen)

    def _turned(self, reaction: Reaction) -> tuple[np.ndarray, ...]:
        """Attractor (7.20) and orientation of the hand (3, 3) each, angular velocity and
        acceleration (3,), at the rate of the phase; at rest where the model does not turn it.
        """
        turning = reaction.moment.turning
        if turning is None:
            return self._rotation, self._rotation, np.zeros(3), np.zeros(3)
        spin, growth = self._pace * turning.velocity, self._pace**2 * turning.acceleration
        lead = (self._gains.damping[3:] * spin + growth) / self._gains.stiffness[3:]
        return matrices(from_vectors(lead)) @ turning.rotation, turning.rotation, spin, growth

    def _too_far(self, behind: np.ndarray) -> np.ndarray:
        """By how much of a distance (3,) [m] a hand that was left behind would be pulled to hurry."""
        return behind * max(
            0.0, 1.0 - 1.0 / max(float(np.linalg.norm(behind / self._farthest)), 1e-9)
        )

    def _still(self, hand: HandState, fault: str) -> Guidance:
        rest = np.zeros(6)
        here = Reference(hand.position, self._rotation, hand.position, self._rotation, rest, rest)
        return Guidance(
            self.phase,
            here,
            self._gains,
            Grip.UNSPECIFIED,
            self._fingers.at(self.phase)[1],
            0.0,
            False,
            fault,
        )
