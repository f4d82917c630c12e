"""/joint_states as every node hears them that answers them: with what the driver offers, in the
order of the arm's joints by their names; and whether the arm's time goes on.

Others may publish on the topic, too, as a gripper's driver does: messages that name none of the
arm's joints are not heard. One that was late on its way is left out. Names are looked at where a
message becomes a state of the arm (`conversions.arm_state`).

The arm's time is that of the stamps of its states, against the clock of the wall. A simulator that
waits for an answer, or for a state to arrive, stands still for ever; one that is held says so on
HELD.
"""

import time
from collections.abc import Callable

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from dart_skill.arm import ArmState
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.conversions import leading_stamp_ns, stamp_ns, state_of_joints
from dart_skill_nodes.comms.fixed_layout import LayoutReader
from dart_skill_nodes.comms.names import JOINT_STATES
from dart_skill_nodes.comms.qos import LATCHED, LOOP, MatchingSubscriptions
from dart_skill_nodes.comms.this_machine import LEASE, LOOK

HELD = "simulation/held"
"""Topic that says whether the time of a simulated world is held."""
STANDS = LEASE + 0.9
"""Time that stands still for so long goes on no more: dead processes are known by then, and a
process may be held up [s, wall clock].
"""
HELD_LONG = 1.0
"""Who holds a world for a trial lets it run sooner [s, wall clock]."""
OF_LATE = 5.0
"""Who was heard within this time is there [s, wall clock]."""
LEAP = 0.05
"""Distance of a joint from its last position, beside what it moves meanwhile, that is a leap [rad]."""
FASTEST = 10.0
"""Speed with which a joint may have moved meanwhile [rad/s]."""
SEVERAL = 3
"""Leaps that are no accident."""
FORGET = 100
"""States after which earlier leaps are forgotten."""


class TimeOfTheArm:
    """silence: for how long no new state has come [s, wall clock]; the time is left out for which
    this process was held up itself.
    """

    def __init__(self, node: Node):
        self.silence, self._looked, self._held = 0.0, time.monotonic(), None
        node.create_subscription(Bool, HELD, self._on_held, LATCHED)

    def _on_held(self, message: Bool) -> None:
        self._held, self.silence = message.data, 0.0

    def goes_on(self) -> None:
        """A new state has come, or time has a reason to begin anew."""
        self.silence = 0.0

    def look(self) -> None:
        """To be called every LOOK."""
        now = time.monotonic()
        gap = now - self._looked
        self._looked = now
        self.silence += min(gap, 2 * LOOK)

    @property
    def is_held(self) -> bool:
        """Whether the time of a simulated arm is held."""
        return bool(self._held)

    @property
    def held(self) -> str:
        """What lets the time of a simulated arm go on, when it has been held for long; empty
        otherwise.
        """
        if not self._held or self.silence <= HELD_LONG:
            return ""
        return (
            "the simulated world is held: /simulation/pause with data: false lets it run,"
            " /simulation/reset begins it anew"
        )

    @property
    def stalled(self) -> str:
        """What to say when the time of a simulated arm stands still, and is not held; empty
        otherwise.
        """
        if self._held is not False or self.silence <= STANDS:
            return ""
        return (
            f"the arm's time has stood still for {self.silence:.1f} s: /joint_states, or an answer"
            " to them, gets lost (see /diagnostics)"
        )


class InOrder:
    """Calls back with messages in the order of their stamps. One that is older than the one before
    is refused with a ValueError: it was late. If the next one is older, too, time was set back, as
    by a simulator that was started again, and it counts.
    """

    def __init__(self, callback: Callable, stamp_of: Callable[..., int]):
        self._callback, self._stamp_of = callback, stamp_of
        self._newest, self._was_late = 0, False

    def __call__(self, message) -> None:
        ns = self._stamp_of(message)
        self._was_late = ns < self._newest and not self._was_late
        if self._was_late:
            raise ValueError(
                f"it is stamped {ns} ns, and came after the one of {self._newest} ns: out of order"
            )
        self._newest = ns
        self._callback(message)


class OfTheArm:
    """Tells messages on /joint_states that name a joint of the arm, or none at all, from those of
    others.

    others: what those of others name; empty without one.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic):
        self.others = ""
        self._clock, self._reader = clock, LayoutReader(JointState)
        self._last: JointState | None = (
            None  # of the layout that came last, and why it is of others
        )
        self._why = ""
        self._heard: dict[str, float] = {}  # when others were heard last [s], by what they name

    def __call__(self, message: JointState | bytes) -> bool:
        """Whether a message, or a serialised one, is the arm's as far as names tell."""
        why = self._why_not(message)
        if why:
            self.others = why
            self._heard[why] = self._clock()
        return not why

    @property
    def voices(self) -> int:
        """How many others have been heard of late."""
        now = self._clock()
        return sum(now - heard < OF_LATE for heard in self._heard.values())

    def _why_not(self, message: JointState | bytes) -> str:
        if isinstance(message, JointState):
            return conversions.of_others(message)
        try:
            like, _, _ = self._reader.read(message)
        except ValueError:
            return ""  # the reader of the state says what is wrong with it
        if like is not self._last:
            self._last, self._why = like, conversions.of_others(like)
        return self._why


class Rivals:
    """Notices that states leap to and fro, as where two publish different states of the arm.
    are_there: whether they do.
    """

    def __init__(self) -> None:
        self._last: ArmState | None = None
        self._leaps, self._count, self.are_there = 0, 0, False

    def see(self, state: ArmState) -> bool:
        """Whether states have leapt again and again, so that it is not known whose they are. state:
        the next one.
        """
        self._count += 1
        if self._last is not None:
            elapsed = 1e-9 * abs(state.stamp_ns - self._last.stamp_ns)
            self._leaps += bool(
                np.abs(state.position - self._last.position).max() > LEAP + FASTEST * elapsed
            )
        if self._count > FORGET:
            self._count, self._leaps = 0, 0
        self._last = state
        self.are_there = self.are_there or self._leaps >= SEVERAL
        return self.are_there


class JointStates(MatchingSubscriptions):
    """Subscription of /joint_states. of_the_arm: tells whose they are."""

    def __init__(self, node: Node):
        super().__init__(node)
        self.of_the_arm = OfTheArm()


def hear_joint_states(node: Node, callback: Callable, raw: bool = False) -> JointStates:
    """Call back with every state, serialised if raw: reliably from the start, best effort as soon
    as a driver offers no more.
    """
    heard = JointStates(node)
    in_order = InOrder(
        callback, leading_stamp_ns if raw else lambda message: stamp_ns(message.header.stamp)
    )

    def hear(message) -> None:
        if heard.of_the_arm(message):
            in_order(message)

    heard.subscribe(JOINT_STATES, hear, JointState, depth=LOOP.depth, raw=raw, at_once=True)
    return heard


class StateReader:
    """Reads serialised /joint_states."""

    def __init__(self) -> None:
        self._layouts = LayoutReader(JointState)
        self._like: JointState | None = None
        self._names: tuple[str, ...] = ()
        self._ends = 0, 0  # of positions and velocities among the numbers

    def read(self, data: bytes) -> ArmState:
        """The state of the arm, in the order of its joints; ValueError for names and numbers that
        are not those, and other bytes.
        """
        like, ns, numbers = self._layouts.read(data)
        if like is not self._like:
            self._like, self._names = like, tuple(like.name)
            self._ends = len(like.position), len(like.position) + len(like.velocity)
        positions, both = self._ends
        return state_of_joints(self._names, numbers[:positions], numbers[positions:both], ns)
