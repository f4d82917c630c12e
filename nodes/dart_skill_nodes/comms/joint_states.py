"""/joint_states as every node hears them that answers them: with what the driver offers, in the order of the arm's joints by their names.

Names are looked at where a message becomes a state of the arm (`conversions.arm_state`).
"""

from collections.abc import Callable

from rclpy.node import Node
from sensor_msgs.msg import JointState

from dart_skill_nodes.comms.matching_qos import MatchingSubscriptions
from dart_skill_nodes.comms.qos import LOOP

JOINT_STATES = "/joint_states"


def hear_joint_states(node: Node, callback: Callable, raw: bool = False) -> MatchingSubscriptions:
    """Call back with every state, serialised if raw: reliably from the start, best effort as soon as a driver offers no more."""
    heard = MatchingSubscriptions(node)
    heard.subscribe(JOINT_STATES, callback, JointState, depth=LOOP.depth, raw=raw, at_once=True)
    return heard
