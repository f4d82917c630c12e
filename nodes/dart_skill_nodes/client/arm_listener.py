"""Hears joints, poses and /clock with plain subscriptions, and hands them to the check of the arm
as arrays.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from dart_skill.arm.check import Endpoint, Heard, HeardJoints, HeardPoses
from dart_skill.common.world import ROLES, joint_order
from dart_skill_nodes.client.playing import NO_DRIVERS
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.joint_states import OfTheArm
from dart_skill_nodes.comms.names import CLOCK, COMMANDS, JOINT_STATES, pose_topics
from dart_skill_nodes.comms.raw_batches import RawBatches, RawMessage


class ArmListener:
    """Everything that is heard of an arm from now on. `take` must be called often, and the node
    must be spun.

    roles: of the tracked bodies that are heard.
    """

    def __init__(self, node: Node, roles: Iterable[str] = ROLES):
        self._node, self._batches = node, RawBatches(node)
        self._topics, self._of_the_arm = pose_topics(roles), OfTheArm()
        self._messages: dict[str, list[RawMessage]] = {
            name: [] for name in (JOINT_STATES, CLOCK, *self._topics.values())
        }
        for topic in self._messages:
            self._batches.listen(topic)

    def take(self) -> tuple[float, np.ndarray] | None:
        """What has come since the last time; of the newest joint state of it the instant [s] and
        the joints, None if there is none.
        """
        newest = None
        for message in self._batches.take():
            self._messages[message.topic].append(message)
            newest = (
                message
                if message.topic == JOINT_STATES and self._of_the_arm(message.data)
                else newest
            )
        if newest is None:
            return None
        state = conversions.decoded(newest.data, JointState)
        return conversions.stamp_ns(state.header.stamp) * 1e-9, _of_arm(state, state.position)

    @property
    def hears_joints(self) -> bool:
        """Whether a joint state has come."""
        return bool(self._messages[JOINT_STATES])

    @property
    def drivers(self) -> list[str]:
        """Names of the nodes that publish joint states."""
        return sorted(
            one.node for one in _ends(self._node.get_publishers_info_by_topic(JOINT_STATES))
        )

    @property
    def silent(self) -> list[str]:
        """Topics of joints and poses on which nothing has come."""
        return [
            self._node.resolve_topic_name(topic)
            for topic in (JOINT_STATES, *self._topics.values())
            if not self._messages[topic]
        ]

    def heard(self) -> Heard:
        """Everything so far."""
        clock = self._messages[CLOCK]
        told = np.array(
            [conversions.stamp_ns(conversions.decoded(one.data, Clock).clock) for one in clock],
            dtype=np.int64,
        )
        when = np.array([one.received_ns for one in clock], dtype=np.int64)
        poses = {role: self._poses(topic, when, told) for role, topic in self._topics.items()}
        takers = _ends(self._node.get_subscriptions_info_by_topic(COMMANDS))
        drivers = [
            one for one in takers if one.node not in NO_DRIVERS and not one.node.startswith("_")
        ]
        commanders = tuple(_ends(self._node.get_publishers_info_by_topic(COMMANDS)))
        return Heard(bool(clock), self._joints(when, told), poses, commanders, tuple(drivers))

    def close(self) -> None:
        """Hear nothing any more."""
        self._batches.close()

    def _joints(self, when: np.ndarray, told: np.ndarray) -> HeardJoints:
        states = [
            (one.received_ns, conversions.decoded(one.data, JointState))
            for one in self._messages[JOINT_STATES]
        ]
        states = [one for one in states if not conversions.of_others(one[1])] or states
        lengths = [len(message.position) for _, message in states]
        usual = max(set(lengths), key=lengths.count) if lengths else 0
        same = [
            (received, message) for received, message in states if len(message.position) == usual
        ]
        position = np.array([_of_arm(message, message.position) for _, message in same])
        with_speeds = all(len(message.velocity) == usual for _, message in same)
        velocity = np.array(
            [_of_arm(message, message.velocity) if with_speeds else [] for _, message in same]
        )
        return HeardJoints(
            **self._stream(JOINT_STATES, same, when, told),
            orders=tuple(sorted({tuple(message.name) for _, message in same})),
            position=position.reshape(len(same), -1 if same else 0),
            velocity=velocity.reshape(len(same), -1 if same else 0),
            n_odd=len(states) - len(same),
        )

    def _poses(self, topic: str, when: np.ndarray, told: np.ndarray) -> HeardPoses:
        messages = [
            (one.received_ns, conversions.decoded(one.data, PoseStamped))
            for one in self._messages[topic]
        ]
        return HeardPoses(
            **self._stream(topic, messages, when, told),
            position=np.array(
                [conversions.vector(one.pose.position) for _, one in messages]
            ).reshape(-1, 3),
            quaternion=np.array(
                [conversions.quaternion(one.pose.orientation) for _, one in messages]
            ).reshape(-1, 4),
        )

    def _stream(self, topic: str, messages: list, when: np.ndarray, told: np.ndarray) -> dict:
        """What all streams have; times of receipt on /clock if there is one: what it last said
        before.
        """
        received = np.array([received for received, _ in messages], dtype=np.int64)
        if len(told):
            received = told[np.clip(np.searchsorted(when, received, side="right") - 1, 0, None)]
        return {
            "topic": self._node.resolve_topic_name(topic),
            "publishers": tuple(_ends(self._node.get_publishers_info_by_topic(topic))),
            "received_ns": received,
            "stamp_ns": np.array(
                [conversions.stamp_ns(message.header.stamp) for _, message in messages],
                dtype=np.int64,
            ),
            "frames": tuple(sorted({message.header.frame_id for _, message in messages})),
        }


def _of_arm(message: JointState, values: Sequence[float]) -> np.ndarray:
    """Values of the arm's joints in their order, from one value for each name; all of them where a
    joint is missing.
    """
    try:
        return np.array(values)[joint_order(tuple(message.name))]
    except (ValueError, IndexError):
        return np.array(values)


def _ends(offers: Iterable) -> list[Endpoint]:
    return [
        Endpoint(
            one.node_name,
            "best_effort"
            if one.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
            else "reliable",
        )
        for one in offers
    ]
