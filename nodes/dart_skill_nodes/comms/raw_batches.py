"""Raw messages of many topics in the order in which they arrived, and a count of those that never came.

Messages are taken out of the middleware in batches: a callback for each costs ten times as much, and rclpy's EventsExecutor does not
hand on the number that the publisher gave a message, by which a loss is known.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import rclpy
from rclpy.node import Node
from rclpy.subscription import Subscription

from dart_skill_nodes.comms.matching_qos import MatchingSubscriptions

TAKE = 0.01
"""Often enough for whoever has no reason for another period [s, wall clock]."""
DEPTH = 10_000
"""Messages of a topic that may wait, as when their taker is held up: 20 s of 500 Hz."""
MOST = 5000
"""Messages of a topic that are taken in one batch: the others' turn comes too."""


class RawMessage(NamedTuple):
    """A message as it came. received_ns: on the wall clock."""

    received_ns: int
    topic: str
    data: bytes


@dataclass
class _Numbering:
    expected: int = 0
    lost: int = 0


class RawBatches:
    """What a node hears without callbacks; call `take` often enough that no history overflows."""

    def __init__(self, node: Node):
        self._unspun = unspun_node(f"_{node.get_name()}_raw_batches")
        self._offered = MatchingSubscriptions(node, self._unspun)
        self._numbering: dict[str, _Numbering] = {}

    def listen(self, topic: str, on_offer=lambda offers: None) -> None:
        """Hear a topic from its first publisher on; on_offer is called with what its publishers say, before anything is heard."""
        self._numbering[topic] = _Numbering()
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
    def lost(self) -> dict[str, int]:
        """Messages that were sent and never came, by topic, of topics with a single publisher."""
        return {topic: numbering.lost for topic, numbering in self._numbering.items() if numbering.lost}

    def take(self) -> list[RawMessage]:
        """Every message that has come since the last time."""
        message = []
        for topic, subscription in self._offered.subscriptions.items():
            numbers = []
            for data, info in taken(subscription):
                numbers.append(info["publication_sequence_number"])
                message.append(RawMessage(info["received_timestamp"], topic, data))
            if numbers and subscription.get_publisher_count() == 1:
                _count(self._numbering[topic], numbers)
        message.sort(key=lambda one: one.received_ns)
        return message

    def close(self) -> None:
        """Hear nothing any more."""
        self._offered.close()
        self._unspun.destroy_node()


def unspun_node(name: str) -> Node:
    """A node that nobody spins, for subscriptions whose messages are taken; a leading underscore hides it from `ros2 node list`."""
    return rclpy.create_node(name, start_parameter_services=False, enable_rosout=False)


def taken(subscription: Subscription) -> Iterator[tuple[bytes, dict]]:
    """Serialised messages of a subscription that have come since the last time, and what the middleware knows of each; MOST at a time."""
    with subscription.handle:
        for _ in range(MOST):
            message = subscription.handle.take_message(subscription.msg_type, True)
            if message is None:
                return
            yield message


def never_called(data: bytes) -> None:
    """For the callbacks of such subscriptions."""
    raise NotImplementedError("messages are taken, nobody is called")


def _count(numbering: _Numbering, numbers: list[int | None]) -> None:
    """Gaps in the numbers that a publisher gave; one that was started again begins anew."""
    for number in numbers:
        if number is None:
            return
        if numbering.expected and number > numbering.expected:
            numbering.lost += number - numbering.expected
        numbering.expected = number + 1
