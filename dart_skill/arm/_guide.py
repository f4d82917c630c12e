"""Who says at each instant what the hand shall do: a plan that was made beforehand, or a model
that is asked while the arm moves.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np

from dart_skill.arm._command import Speed
from dart_skill.arm._contact import ContactSearch, Yielding
from dart_skill.arm._hand_seen import HandSeen, RestTakenOut, SeenOffset
from dart_skill.arm._impedance import PoseGains, Reference, rotation_error
from dart_skill.arm._model import HandState
from dart_skill.arm._motion_plan import Gains, GainsOverTime, GripEvent, MotionPlan, Pace
from dart_skill.arm._plan_rows import PlanRows
from dart_skill.arm._registration import Registration
from dart_skill.common.constants import HAND, Grip
from dart_skill.common.quaternions import (
    CONJUGATE,
    from_vectors,
    matrices,
    product,
    to_vectors,
    unit,
)

AS_SHOWN = 0.5
"""Rate of a plan's clock below which the hand is held back: the fingers do nothing then."""
HELD_BACK = 5.0
"""A motion that is held back for so long is given up [s]."""
STANDS = 0.01
"""A hand that is planned to be slower has no way along which it could be late [m/s]."""
UNSEEN = 0.5
"""Rate of a careful plan while the cameras do not see the hand."""
EASES = 0.1
"""Time constant with which a careful plan comes to that rate, and goes on [s]: half of a fast hand's
speed at once jolts an arm whose cables give, up to the limit of speed.
"""
EARLY = 1e-9
"""By which an event may be early [s]: times are rounded to the nanosecond."""


Pull = Callable[[PoseGains, bool, bool], Yielding]
"""From gains of a plan, whether the hand carries something, and whether that touches something, to how
far the hand that is pulled so gives way to a force."""


class Guidance(NamedTuple):
    """What the hand shall do now.

    Parameters
    ----------
    time
        On the clock of the guide [s].
    reference, gains
        Where the hand is pulled, and how strongly.
    grip
        What the fingers are told, again and again.
    carries
        Whether the hand holds something.
    off
        How far the hand is from where it must be [m]; 0 where it may be anywhere.
    over
        There is nothing to follow any more, and the arm is braked.
    fault
        Why the motion cannot go on; empty if it can.
    posture
        Joint angles (n,) that the arm's free motion aims at [rad]; None: those of the start.
    touches
        Whether something holds the hand back, which presses against it no harder and is softer.
    """

    time: float
    reference: Reference
    gains: PoseGains
    grip: Grip
    carries: bool
    off: float
    over: bool
    fault: str = ""
    posture: np.ndarray | None = None
    touches: bool = False


class Guide(Protocol):
    """Guides the hand through one motion.

    Attributes
    ----------
    what
        The motion in a word.
    start_posture
        Joint angles before it (n,) [rad].
    speed
        Level of speed that it needs.
    """

    what: str
    start_posture: np.ndarray
    speed: Speed

    def look(self, time: float, hand: HandState, stamp_ns: int) -> Guidance:
        """What a hand in this state shall do, so long after the motion began [s].

        Parameters
        ----------
        stamp_ns
            Of the state [ns].
        time
            On the guide's clock.
        """
        ...

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A pose of a body that the cameras deliver; one that does not matter is left out.

        Parameters
        ----------
        body
            Its role.
        stamp_ns, position, quaternion
            Of the pose, in the world of the cameras [ns], (3,) [m], (4,).
        """
        ...


class PlanGuide:
    """Guides through a plan; where the plan has a pace, the state of the hand drives its clock,
    else time does.

    Parameters
    ----------
    plan
        As the arm has it.
    follow_time
        The path is followed for so long after the plan's end [s].
    """

    def __init__(self, plan: MotionPlan, follow_time: float):
        self.plan, self.what, self.start_posture, self.speed = (
            plan,
            plan.what,
            plan.start_posture,
            plan.speed,
        )
        self._references, self._fingers = References(plan), Fingers(plan.events, plan.carries)
        self._duration = plan.path.duration
        self._last = min(self._duration, plan.end + follow_time)
        self._clock = (
            PlanClock(plan.pace, plan.path.time, self._fingers) if plan.pace is not None else None
        )

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """See `Guide`: nothing that is seen changes a plan that was made."""

    def look(self, time: float, hand: HandState, stamp_ns: int) -> Guidance:
        """See `Guide`."""
        rate = 1.0
        if self._clock is not None:
            time, rate = self._clock.at(time, hand, self._references)
        grip, carries = self._fingers.at(time)
        reference = self._references.at(time)
        return Guidance(
            time=time,
            reference=reference if rate == 1.0 else self._at_rate(reference, rate),
            gains=self._references.gains_at(time),
            grip=grip,
            carries=carries,
            off=self._off(reference, hand) if time < self.plan.end else 0.0,
            over=time > self._last or self._clock is not None and time >= self._duration,
            fault=self._fingers.fault,
            posture=self._references.posture_at(time),
        )

    def _at_rate(self, reference: Reference, rate: float) -> Reference:
        """The reference while the state of the hand makes the clock go at another rate."""
        return paced(reference, rate)

    def _off(self, reference: Reference, hand: HandState) -> float:
        """From the point of the plan; where the hand may be late, from the path about that point."""
        if self._clock is None:
            return math.dist(reference.position, hand.position)
        off, way = hand.position - reference.position, reference.velocity[:3]
        return float(np.linalg.norm(off - (off @ way) * way / max(way @ way, STANDS**2)))


class CarefulGuide(PlanGuide):
    """Guides through a plan that is slow enough to be corrected on the way: by where the cameras see
    the hand, by what a soft arm leaves of the distance, and by what is felt where it touches.

    Parameters
    ----------
    follow_time
        As of `PlanGuide`.
    plan
        As the arm has it.
    registration
        Of the cameras that see the hand; default: they agree with the arm.
    contact_force
        With which what the hand carries is pressed against what it touches [N]; default: contact is
        not felt, as where the pace of a plan makes it wait.
    pull
        How far the hand gives way to a force.
    """

    def __init__(
        self,
        plan: MotionPlan,
        follow_time: float,
        registration: Registration | None = None,
        contact_force: float = math.inf,
        pull: Pull = lambda gains, carries, touches: Yielding(np.eye(3), 0.0),
    ):
        super().__init__(plan, follow_time)
        self._hand_seen, self._rest = HandSeen(HAND, registration), RestTakenOut()
        self._contact = ContactSearch(contact_force)
        self._pull = pull
        self._then, self._waited, self._eased = 0.0, 0.0, 1.0

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """See `Guide`: the hand alone counts."""
        self._hand_seen.see(body, stamp_ns, position, quaternion)

    def look(self, time: float, hand: HandState, stamp_ns: int) -> Guidance:
        """See `Guide`."""
        step = time - self._then
        self._then = time
        seen = self._hand_seen.offset(stamp_ns, hand.position, hand.rotation)
        planned = super().look(time - self._waited, self._as_seen(hand, seen), stamp_ns)
        velocity, carries = planned.reference.velocity[:3], planned.carries
        aim = planned.reference.position - seen.shift + self._contact.aside
        pull = partial(self._pull, planned.gains, carries)
        yields = partial(pull, self._contact.touches)
        slower = velocity - hand.velocity[:3]
        rate = 1.0
        if self._clock is None or not self._clock.waits or self._contact.searches(time):
            rate = self._contact.rate(
                time, step, hand.position, aim, velocity, slower, carries, yields
            )
        change = self._ease(stamp_ns, step)
        rate, change = (self._eased, change) if rate == 1.0 else (rate, 0.0)
        # the way back ends where the plan begins
        self._waited = min(self._waited + (1.0 - rate) * step, time)
        wanted = shifted(
            planned.reference if rate == 1.0 else slowed(planned.reference, rate, change),
            SeenOffset(seen.shift - self._contact.aside, seen.turn),
        )
        left = self._contact.across(hand.position - wanted.position)
        turned = rotation_error(hand.rotation, wanted.rotation)
        rest = self._rest.at(time, np.concatenate([left, turned]))
        if carries:
            ahead = wanted.position - rest.shift - hand.position
            slower = wanted.velocity[:3] - hand.velocity[:3]
            less = self._contact.too_hard(ahead, slower, partial(pull, self._contact.touches))
            rest = rest._replace(shift=rest.shift + less)
        return planned._replace(
            reference=shifted(wanted, rest),
            fault=planned.fault or self._contact.fault,
            touches=self._contact.touches,
        )

    def _as_seen(self, hand: HandState, seen: SeenOffset) -> HandState:
        """The hand that drives a clock is where the cameras see it, as a late one must not be one
        that the encoders have elsewhere.
        """
        if self._clock is None:
            return hand
        return replace(hand, position=hand.position + seen.shift)

    def _at_rate(self, reference: Reference, rate: float) -> Reference:
        """As of `PlanGuide`; a hand that is held is not pulled on, either."""
        return slowed(reference, rate) if rate < 1.0 else paced(reference, rate)

    def _ease(self, stamp_ns: int, step: float) -> float:
        """Slow down while the cameras do not see the hand, or go on; the change of the rate [1/s]."""
        lost = self._hand_seen.is_lost(stamp_ns)
        change = ((UNSEEN if lost else 1.0) - self._eased) / max(step, EASES)
        self._eased += change * step
        return change


class Fingers:
    """What the fingers do on the clock of a guide, and where that clock waits for a hand that is
    held back.

    Attribute: fault, why the motion was given up, once the hand was held back for too long; empty
    until then.

    Parameters
    ----------
    carries
        Whether the hand holds something at the start.
    events
        When the fingers are told something.
    """

    def __init__(self, events: Sequence[GripEvent], carries: bool):
        self._events, self._carries = tuple(events), carries
        self._slow, self.fault = 0.0, ""

    def at(self, time: float) -> tuple[Grip, bool]:
        """What they are told at a time on the clock [s], and whether the hand holds something
        then.
        """
        grip, carries = Grip.UNSPECIFIED, self._carries
        for event in self._events:
            if time >= event.time - EARLY:
                grip = event.grip
                if time > event.done:
                    carries = grip == Grip.CLOSE
        return grip, carries

    def held(self, now: float, later: float, rate: float, step: float) -> float:
        """Where the clock gets in a step [s] that would lead it from now to later [s]: not past an
        event while the hand is held back.

        Parameters
        ----------
        rate
            Of the clock, 1 as shown.
        """
        if rate >= AS_SHOWN:
            self._slow = 0.0
            return later
        self._slow += step
        if self._slow > HELD_BACK:
            self.fault = f"the hand was held back for {self._slow:.0f} s"
        return min(
            [
                later,
                *(event.time - 2.0 * EARLY for event in self._events if event.time - EARLY > now),
            ]
        )


class PlanClock:
    """The clock of a plan, which the state of the hand drives (`Pace`).

    Attribute: rate, of the last step; 1 as planned.
    """

    def __init__(self, pace: Pace, instants: np.ndarray, fingers: Fingers):
        self._rule, self._gain, self._instants, self._fingers = (
            pace.rule,
            pace.gain,
            instants.tolist(),
            fingers,
        )
        self._now, self._then, self.rate = 0.0, 0.0, 1.0

    @property
    def waits(self) -> bool:
        """Whether the clock would wait now for a hand that is held back."""
        return bool(self._gain[self._row].any())

    @property
    def _row(self) -> int:
        return min(max(bisect_right(self._instants, self._now) - 1, 0), len(self._instants) - 1)

    def at(self, time: float, hand: HandState, references: References) -> tuple[float, float]:
        """Time on the clock, and its rate, so long after the motion began [s]."""
        step = time - self._then
        self._then = time
        self.rate = rate = self._rate(hand, references.at(self._now))
        later = self._fingers.held(self._now, self._now + rate * step, rate, step)
        self._now = min(max(later, 0.0), self._instants[-1])
        return self._now, rate

    def _rate(self, hand: HandState, reference: Reference) -> float:
        k = self._row
        error = -rotation_error(reference.rotation, hand.rotation)
        ahead = float(
            self._gain[k]
            @ np.concatenate(
                [hand.position - reference.position, error, hand.velocity - reference.velocity]
            )
        )
        return self._rule.rate(ahead)


def paced(reference: Reference, rate: float) -> Reference:
    """The reference of a motion that goes on at another rate than planned."""
    return replace(
        reference,
        velocity=rate * reference.velocity,
        acceleration=rate * rate * reference.acceleration,
    )


def slowed(reference: Reference, rate: float, change: float = 0.0) -> Reference:
    """The same whose attractor does not pull the hand on faster, either.

    Parameters
    ----------
    change
        Of the rate [1/s].
    """
    ahead = reference.attractor_position - reference.position
    slow = paced(reference, rate)
    return replace(
        slow,
        attractor_position=reference.position + rate * ahead,
        acceleration=slow.acceleration + change * reference.velocity,
    )


def shifted(reference: Reference, seen: SeenOffset) -> Reference:
    """The reference that brings a hand which is seen elsewhere than the arm takes it to be to where
    it shall be seen.
    """
    back = matrices(from_vectors(-seen.turn))
    return replace(
        reference,
        attractor_position=reference.attractor_position - seen.shift,
        attractor_rotation=back @ reference.attractor_rotation,
        position=reference.position - seen.shift,
        rotation=back @ reference.rotation,
    )


class References:
    """A plan as a function of time: linear between its instants, a share of the turn from each
    orientation to the next.
    """

    def __init__(self, plan: MotionPlan):
        path = plan.path
        self._position_gains, self._orientation_gains = plan.position_gains, plan.orientation_gains
        self._constant = self._constant_gains()
        self._posture = plan.posture
        linear = np.hstack(
            [plan.attractor_position, path.position, path.velocity, path.acceleration], dtype=float
        )
        turns = [unit(quaternion) for quaternion in (plan.attractor_quaternion, path.quaternion)]
        rotation = np.stack([matrices(turn) for turn in turns], axis=1)  # (n, 2, 3, 3)
        # To the second order in the small angle between two instants: R + s K R + s^2 / 2 K K R.
        angle = np.stack(
            [to_vectors(product(turn[1:], CONJUGATE * turn[:-1])) for turn in turns], axis=1
        )
        skew = _skew(angle)
        first = skew @ rotation[:-1]
        self._rows = PlanRows(
            np.array(path.time, dtype=float), linear, rotation, first, 0.5 * skew @ first
        )

    def at(self, time: float) -> Reference:
        """What the hand shall do at an instant of the plan [s]."""
        return Reference(*self._rows.at(time))

    def gains_at(self, time: float) -> PoseGains:
        """How strongly the hand is pulled at an instant of the plan [s]."""
        if self._constant is not None:
            return self._constant
        parts = [
            self._gains_at(gains, *self._rows.place(time))
            for gains in (self._position_gains, self._orientation_gains)
        ]
        return PoseGains(
            *(
                _block_diagonal(position, orientation)
                for position, orientation in zip(*parts, strict=True)
            )
        )

    def posture_at(self, time: float) -> np.ndarray | None:
        """What the arm's free motion aims at then (n,) [rad]; None where the plan does not say.

        Parameters
        ----------
        time
            On the clock of the plan [s].
        """
        if self._posture is None:
            return None
        k, share = self._rows.place(time)
        return self._posture[k] + min(max(share, 0.0), 1.0) * (
            self._posture[k + 1] - self._posture[k]
        )

    def _constant_gains(self) -> PoseGains | None:
        position, orientation = self._position_gains, self._orientation_gains
        if isinstance(position, Gains) and isinstance(orientation, Gains):
            return PoseGains.of(
                (position.stiffness, position.damping),
                (orientation.stiffness, orientation.damping),
            )
        return None

    @staticmethod
    def _gains_at(
        gains: Gains | GainsOverTime, k: int, share: float
    ) -> tuple[np.ndarray, np.ndarray]:
        if isinstance(gains, Gains):
            return gains.stiffness * np.eye(3), gains.damping * np.eye(3)
        share = min(max(share, 0.0), 1.0)
        return tuple(
            rows[k] + share * (rows[k + 1] - rows[k]) for rows in (gains.stiffness, gains.damping)
        )


def _block_diagonal(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    both = np.zeros((6, 6))
    both[:3, :3], both[3:, 3:] = first, second
    return both


def _skew(vectors: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) whose product with b is the cross product of vectors (..., 3) and b."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    return np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), (0, 1), (-2, -1))
