"""Serialised messages that are taken out of the middleware without callbacks: all of many topics, in
the order in which they arrived, with a count of those that never came; or the newest alone.

A callback for each message costs ten times as much, and rclpy's EventsExecutor does not hand on the
number that the publisher gave a message, by which a loss is known.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from dart_skill.common.checks import FARTHEST
from dart_skill_nodes.comms.fixed_layout import LayoutReader
from dart_skill_nodes.comms.qos import MatchingSubscriptions

TAKE = 0.01
"""Usual time between two calls of `RawBatches.take` [s, wall clock]."""
DEPTH = 10_000
"""Messages of a topic that may wait, as when their taker is held up: 20 s of 500 Hz."""
MOST = 5000
"""Messages of a topic that are taken in one batch: the others' turn comes too."""


class RawMessage(NamedTuple):
    """A message as it came. topic: as it was asked for. received_ns: on the wall clock."""

    received_ns: int
    topic: str
    data: bytes


@dataclass
class Numbering:
    """What is known of the numbers that the publisher of a topic gives its messages, which each
    publisher counts for itself.

    A gap is a loss if one publisher, and the same one, was there before it and after it: at two
    looks at the graph and at every message between them. Gaps since the last look are `open`;
    mixed: several publishers were there since then.
    """

    expected: int = 0
    lost: int = 0
    open: int = 0
    mixed: bool = False
    publishers: frozenset[bytes] = frozenset()

    def count(self, numbers: list[int], publishers: int) -> None:
        """Take in the numbers of messages that came while so many published the topic; one that
        was started again begins anew.
        """
        self.mixed |= publishers != 1
        for number in numbers:
            if self.expected and number > self.expected:
                self.open += number - self.expected
            self.expected = number + 1

    def look(self, publishers: frozenset[bytes]) -> None:
        """Settle what was counted since the last look, now that these publish the topic."""
        if self.mixed or publishers != self.publishers:
            self.expected = 0
        elif len(publishers) == 1:
            self.lost += self.open
        self.open, self.mixed, self.publishers = 0, False, publishers


class RawBatches:
    """What a node hears without callbacks; call `take` often enough that no history overflows."""

    def __init__(self, node: Node):
        self._unspun = unspun_node(node, "raw_batches")
        self._numbering: dict[str, Numbering] = {}
        self._offered = MatchingSubscriptions(node, self._unspun, self._on_look)

    def listen(self, topic: str, on_offer=lambda offers: None) -> None:
        """Hear a topic from its first publisher on; on_offer is called with what its publishers
        say, before anything is heard.
        """
        self._numbering[topic] = Numbering()
        self._offered.subscribe(topic, never_called, depth=DEPTH, raw=True, on_offer=on_offer)

    @property
    def topics(self) -> list[str]:
        """Topics that are listened to, with or without a publisher."""
        return list(self._numbering)

    @property
    def missing(self) -> list[str]:
        """Topics that have had no publisher yet."""
        return self._offered.missing

    @property
    def strange(self) -> dict[str, str]:
        """Topics that are published with another type than the one that is heard, so that
        none of that comes; and who does.
        """
        return self._offered.strange

    @property
    def lost(self) -> dict[str, int]:
        """Messages that were sent and never came, by topic, while one and the same node published
        it.
        """
        return {
            topic: numbering.lost for topic, numbering in self._numbering.items() if numbering.lost
        }

    def take(self) -> list[RawMessage]:
        """Every message that has come since the last time."""
        message = []
        for topic, subscription in self._offered.subscriptions.items():
            numbers = []
            for data, received_ns, number in taken(subscription):
                numbers.append(number)
                message.append(RawMessage(received_ns, topic, data))
            if numbers:
                self._numbering[topic].count(numbers, subscription.get_publisher_count())
        message.sort(key=lambda one: one.received_ns)
        return message

    def close(self) -> None:
        """Hear nothing any more; what was lost stays known."""
        self._offered.look()
        self._offered.close()
        self._unspun.destroy_node()

    def _on_look(self, topic: str, publishers: frozenset[bytes]) -> None:
        if topic in self._numbering:
            self._numbering[topic].look(publishers)


class LatestMessages:
    """The newest messages of fast topics, for a reader that needs them at a slower rate: most are
    never decoded. Subscriptions are best effort, so that they match every publisher and never
    hold one up.
    """

    def __init__(self, node: Node):
        self._node, self._unspun = node, unspun_node(node, "latest_messages")
        self._subscriptions = {}

    def watch(self, topic: str, message_type: type, depth: int = 1) -> None:
        """Keep the `depth` newest messages of a topic for `take`."""
        qos = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._subscriptions[topic] = self._unspun.create_subscription(
            message_type, self._node.resolve_topic_name(topic), never_called, qos, raw=True
        )

    def take(self, topic: str) -> list[bytes]:
        """Serialised messages that have come since the last time, the newest last."""
        return [data for data, _, _ in taken(self._subscriptions[topic])]

    def close(self) -> None:
        """Keep nothing any more."""
        self._unspun.destroy_node()


def poses_of(messages: list[bytes], frame_id: str) -> np.ndarray:
    """Positions and quaternions x, y, z, w (n, 7) of serialised PoseStamped; ValueError if one is
    in another frame, or is no pose.
    """
    reader = LayoutReader(PoseStamped)
    read = [reader.read(data) for data in messages]
    for like, _, _ in read:
        if like.header.frame_id != frame_id:
            raise ValueError(
                f"poses are in frame '{like.header.frame_id[:100]}', not '{frame_id}'"
            )
    poses = np.array([numbers for _, _, numbers in read]).reshape(-1, 7)
    if not (np.abs(poses) <= FARTHEST).all():
        raise ValueError("a pose is not finite, or beyond this world")
    return poses


def unspun_node(node: Node, purpose: str) -> Node:
    """A node beside another one that is not spun, for subscriptions whose messages are taken; a
    leading underscore hides it from `ros2 node list`.
    """
    name = f"_{node.get_name()}_{purpose}"
    return rclpy.create_node(
        name, namespace=node.get_namespace(), start_parameter_services=False, enable_rosout=False
    )


def taken(subscription: Subscription) -> Iterator[tuple[bytes, int, int]]:
    """Serialised messages of a subscription that have come since the last time, MOST at a time:
    when each came on the wall clock [ns], and the number that its publisher gave it.
    """
    with subscription.handle:
        for _ in range(MOST):
            message = subscription.handle.take_message(subscription.msg_type, True)
            if message is None:
                return
            data, info = message
            yield data, info["received_timestamp"], info["publication_sequence_number"]


def never_called(data: bytes) -> None:
    """For the callbacks of such subscriptions."""
    raise NotImplementedError("messages are taken, nobody is called")
