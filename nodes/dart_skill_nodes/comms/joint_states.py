"""/joint_states as every node hears them that answers them: with what the driver offers, in the order of the arm's joints by their names.

One that was late on its way is left out. Names are looked at where a message becomes a state of the arm (`conversions.arm_state`).
"""

from collections.abc import Callable

from rclpy.node import Node
from sensor_msgs.msg import JointState

from dart_skill.robot import ArmState
from dart_skill_nodes.comms.conversions import leading_stamp_ns, stamp_ns, state_of_joints
from dart_skill_nodes.comms.fixed_layout import LayoutReader
from dart_skill_nodes.comms.matching_qos import MatchingSubscriptions
from dart_skill_nodes.comms.names import JOINT_STATES
from dart_skill_nodes.comms.qos import LOOP


class InOrder:
    """Calls back with messages in the order of their stamps. One that is older than the one before is refused with a ValueError: it was
    late. If the next one is older, too, time was set back, as by a simulator that was started again, and it counts.
    """

    def __init__(self, callback: Callable, stamp_of: Callable[..., int]):
        self._callback, self._stamp_of = callback, stamp_of
        self._newest, self._was_late = 0, False

    def __call__(self, message) -> None:
        ns = self._stamp_of(message)
        self._was_late = ns < self._newest and not self._was_late
        if self._was_late:
            raise ValueError(f"it is stamped {ns} ns, and came after the one of {self._newest} ns: out of order")
        self._newest = ns
        self._callback(message)


def hear_joint_states(node: Node, callback: Callable, raw: bool = False) -> MatchingSubscriptions:
    """Call back with every state, serialised if raw: reliably from the start, best effort as soon as a driver offers no more."""
    heard = MatchingSubscriptions(node)
    in_order = InOrder(callback, leading_stamp_ns if raw else lambda message: stamp_ns(message.header.stamp))
    heard.subscribe(JOINT_STATES, in_order, JointState, depth=LOOP.depth, raw=raw, at_once=True)
    return heard


class StateReader:
    """Reads serialised /joint_states."""

    def __init__(self) -> None:
        self._layouts = LayoutReader(JointState)

    def read(self, data: bytes) -> ArmState:
        """The state of the arm, in the order of its joints; ValueError for names and numbers that are not those, and other bytes."""
        like, ns, numbers = self._layouts.read(data)
        positions, both = len(like.position), len(like.position) + len(like.velocity)
        return state_of_joints(tuple(like.name), numbers[:positions], numbers[positions:both], ns)
