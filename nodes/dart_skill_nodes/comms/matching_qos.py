"""Subscriptions with the quality of service that publishers offer: reliable where they are reliable, else best effort, which matches all.

A reliable subscriber never hears a best-effort publisher, as vrpn_mocap is one, and a best-effort subscriber may lose what a reliable
publisher would repeat. So topics of drivers are subscribed to when a publisher is there, in the way of `ros2 bag record`.
"""

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from dart_skill_nodes.comms.qos import WALL

LOOK_AGAIN = 0.2
"""The graph is looked at so often [s, wall clock]."""


@dataclass
class _Topic:
    callback: Callable
    type: type | None
    depth: int
    raw: bool
    on_offer: Callable[[list[TopicEndpointInfo]], None]
    offered: bool = False
    chosen: tuple = ()
    subscription: Subscription | None = field(default=None, repr=False)


class MatchingSubscriptions:
    """Subscriptions of a node that wait for their publishers, and follow them when a less reliable one joins.

    owner: another node, which nobody spins, to make them on: whoever takes the messages out by itself wants that.
    """

    def __init__(self, node: Node, owner: Node | None = None):
        self._node, self._owner, self._topics = node, owner or node, {}
        self._timer = node.create_timer(LOOK_AGAIN, self._look, clock=WALL)

    def subscribe(
        self,
        topic: str,
        callback: Callable,
        message_type: type | None = None,
        depth: int = 2000,
        raw: bool = False,
        on_offer: Callable[[list[TopicEndpointInfo]], None] = lambda offers: None,
        at_once: bool = False,
    ) -> None:
        """As `Node.create_subscription`; the topic is heard from when its first publisher is discovered.

        message_type: None takes the publisher's. on_offer: called with what the publishers say, just before the topic is subscribed to.
        at_once: it is heard reliably before that already, so that nothing is missed of a reliable publisher; needs message_type.
        """
        name = self._node.resolve_topic_name(topic)
        self._topics[name] = _Topic(callback, message_type, depth, raw, on_offer)
        if at_once:
            self._make(name, self._topics[name], (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE))
        self._look()

    @property
    def subscriptions(self) -> dict[str, Subscription]:
        """By topic, of those that have had a publisher."""
        return {name: topic.subscription for name, topic in self._topics.items() if topic.subscription is not None}

    @property
    def missing(self) -> list[str]:
        """Topics that have had no publisher yet."""
        return [name for name, topic in self._topics.items() if not topic.offered]

    def close(self) -> None:
        """Follow no publishers any more."""
        self._node.destroy_timer(self._timer)
        self._topics = {}  # one more tick of the timer may be under way

    def _look(self) -> None:
        for name, topic in self._topics.items():
            offers = self._node.get_publishers_info_by_topic(name)
            if not offers:
                continue
            if not topic.offered:
                topic.offered, topic.type = True, topic.type or message_class(offers[0].topic_type)
                topic.on_offer(offers)
            if (chosen := _matching_all([offer.qos_profile for offer in offers])) != topic.chosen:
                self._make(name, topic, chosen)

    def _make(self, name: str, topic: _Topic, chosen: tuple[ReliabilityPolicy, DurabilityPolicy]) -> None:
        if topic.subscription is not None:
            self._owner.destroy_subscription(topic.subscription)
        qos = QoSProfile(depth=topic.depth, reliability=chosen[0], durability=chosen[1])
        topic.subscription = self._owner.create_subscription(topic.type, name, topic.callback, qos, raw=topic.raw)
        topic.chosen = chosen


def message_class(type_name: str) -> type:
    """Class of a message type as package/msg/Name; ImportError if its package is not installed."""
    package, kind, name = type_name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), name)


def _matching_all(offers: list[QoSProfile]) -> tuple[ReliabilityPolicy, DurabilityPolicy]:
    """The most that every publisher offers."""
    reliable = all(offer.reliability == ReliabilityPolicy.RELIABLE for offer in offers)
    latched = all(offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers)
    return (
        ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
