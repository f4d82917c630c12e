"""Quality of service of the graph's topics, the clocks of its watchdogs, and subscriptions with the
quality of service that publishers offer: reliable where they are reliable, else best effort, which
matches all.

A reliable subscriber never hears a best-effort publisher, as vrpn_mocap is one, and a best-effort
subscriber may lose what a reliable publisher would repeat. So topics of drivers are subscribed to
when a publisher is there, in the way of `ros2 bag record`.
"""

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

LOOP = QoSProfile(depth=10)
"""For subscribers that answer the newest state: reliable, ten messages."""
COMPLETE = QoSProfile(depth=10_000)
"""For what is recorded, at both ends: reliable, 20 s of 500 Hz. A reliable publisher repeats only
what it still keeps, and Fast DDS may take its heartbeat period of 3 s to find out what was lost.
"""
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Late joiners get what was published before: demonstrations, marks, fixed transforms. For
subscriptions to NEWEST, too.
"""
NEWEST = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Late joiners get the last one alone: what holds until the next message. `ros2 topic echo --once`
prints the first that it gets.
"""
FRAMES = QoSProfile(depth=500)
"""For what comes with every frame of the cameras: reliable, 5 s. Once its history is full, Fast
DDS tells with every message what came before it, so that what was lost is repeated at once.
"""
CALLS = QoSProfile(depth=1000)
"""Services: so many requests may wait, and so many answers of a client that asks with this depth,
too. With ROS's own depth of 10 more are lost, and never answered.
"""
POSES = {
    "reliable": FRAMES,
    "best_effort": QoSProfile(
        depth=5, reliability=ReliabilityPolicy.BEST_EFFORT, history=HistoryPolicy.KEEP_LAST
    ),
}
"""What a motion-capture driver may publish with; the second one is sensor data as ROS has it."""
CLOCK_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""For /clock, as rclpy itself subscribes to it."""

WALL = Clock(clock_type=ClockType.STEADY_TIME)
"""For watchdogs: a machine's time, never the simulation's. No timer comes or goes on it while a
node works (see WAITS).
"""
WAITS = Clock(clock_type=ClockType.STEADY_TIME)
"""The same time for timers that are set again and again. Each time, as with each new timer on a
clock, rclpy's EventsExecutor calls those of that clock again that are due and not yet called; a
repeating one skips a period for each such call, and was silent for up to 25 s (rclpy 7.1.6).
"""
STATUS = Clock(clock_type=ClockType.STEADY_TIME)
"""The same time for the status of nodes, once a second: on the clock of the watchdogs, those that
a node makes while it is configured would silence it for as many seconds.
"""
SYSTEM = Clock(clock_type=ClockType.SYSTEM_TIME)
"""For stamps that do not belong to the time of the world: the date."""
NO_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)
"""No events for a subscription that follows its publishers: rclpy warns of one that does not match,
though it is about to be replaced, and ends the process where it was replaced before the warning's
turn came.
"""
LOOK_AGAIN = 0.2
"""The graph is looked at so often [s, wall clock]."""


@dataclass
class _FollowedTopic:
    name: str
    callback: Callable
    type: type | None
    depth: int
    raw: bool
    on_offer: Callable[[list[TopicEndpointInfo]], None]
    at_once: bool = False
    offered: bool = False
    chosen: tuple = ()
    subscription: Subscription | None = field(default=None, repr=False)


class MatchingSubscriptions:
    """Subscriptions of a node that wait for their publishers, and follow them when a less reliable
    one joins.

    owner: another node, which is not spun, to make them on, for messages that are taken without
    callbacks. on_look: called with a topic and the publishers that are heard, whenever the
    graph was looked at. strange: topics that are published with another type than the one
    that is heard, so that none of that comes; and who does.
    """

    def __init__(
        self,
        node: Node,
        owner: Node | None = None,
        on_look: Callable[[str, frozenset[bytes]], None] = lambda *_: None,
    ):
        self._node, self._owner, self._topics, self._on_look = node, owner or node, {}, on_look
        self.strange: dict[str, str] = {}
        self.rests = False
        self._timer = node.create_timer(LOOK_AGAIN, self.look, clock=WALL)

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
        """As `Node.create_subscription`; the topic is heard from when its first publisher is
        discovered.

        message_type: None takes the publisher's. on_offer: called with what the publishers say,
        just before the topic is subscribed to. at_once: it is heard reliably before that already,
        so that nothing is missed of a reliable publisher; needs message_type.
        """
        name = self._node.resolve_topic_name(topic)
        self._topics[topic] = _FollowedTopic(
            name, callback, message_type, depth, raw, on_offer, at_once
        )
        self.go_on()

    def go_on(self) -> None:
        """Hear again, after a `rest`."""
        self.rests = False
        for topic in self._topics.values():
            if topic.at_once and topic.subscription is None:
                self._make(topic, (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE))
        self.look()

    def rest(self) -> None:
        """Hear nothing until `go_on`: each message costs its publisher and this node as much as a
        step of the arm's arithmetic.
        """
        self.rests = True
        for topic in self._topics.values():
            if topic.subscription is not None:
                self._owner.destroy_subscription(topic.subscription)
                topic.subscription, topic.chosen = None, ()

    @property
    def subscriptions(self) -> dict[str, Subscription]:
        """By topic, as it was asked for, of those that have had a publisher."""
        return {
            name: topic.subscription
            for name, topic in self._topics.items()
            if topic.subscription is not None
        }

    @property
    def missing(self) -> list[str]:
        """Topics that have had no publisher yet."""
        return [name for name, topic in self._topics.items() if not topic.offered]

    def close(self) -> None:
        """Follow no publishers any more."""
        self._node.destroy_timer(self._timer)
        self._topics = {}  # one more tick of the timer may be under way

    def look(self) -> None:
        """Follow what publishers offer now."""
        if self.rests:
            return
        for name, topic in self._topics.items():
            offers = self._node.get_publishers_info_by_topic(topic.name)
            if offers and topic.type is None:
                topic.type = message_class(offers[0].topic_type)
            heard = self._heard(name, topic, offers)
            if heard and not topic.offered:
                topic.offered = True
                topic.on_offer(heard)
            if (
                heard
                and (chosen := _matching_all([offer.qos_profile for offer in heard]))
                != topic.chosen
            ):
                self._make(topic, chosen)
            self._on_look(name, frozenset(bytes(offer.endpoint_gid) for offer in heard))

    def _heard(
        self, name: str, topic: _FollowedTopic, offers: list[TopicEndpointInfo]
    ) -> list[TopicEndpointInfo]:
        """Those that publish the type that is heard; DDS hands over nothing of the others, and
        says nothing of it.
        """
        wanted = type_name(topic.type) if topic.type else ""
        for offer in offers:
            if offer.topic_type != wanted and name not in self.strange:
                self.strange[name] = (
                    f"{offer.node_name} publishes {topic.name} as {offer.topic_type}, which is not"
                    f" the {wanted} that is heard"
                )
                self._node.get_logger().warning(self.strange[name])
        return [offer for offer in offers if offer.topic_type == wanted]

    def _make(
        self, topic: _FollowedTopic, chosen: tuple[ReliabilityPolicy, DurabilityPolicy]
    ) -> None:
        if topic.subscription is not None:
            self._owner.destroy_subscription(topic.subscription)
        qos = QoSProfile(depth=topic.depth, reliability=chosen[0], durability=chosen[1])
        topic.subscription = self._owner.create_subscription(
            topic.type,
            topic.name,
            topic.callback,
            qos,
            raw=topic.raw,
            event_callbacks=NO_EVENTS,
        )
        topic.chosen = chosen


def message_class(type_name: str) -> type:
    """Class of a message type as package/msg/Name; ImportError if its package is not installed."""
    package, kind, name = type_name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), name)


def type_name(message_type: type) -> str:
    """Type name of a message class, as package/msg/Name."""
    package, kind = message_type.__module__.split(".")[:2]
    return f"{package}/{kind}/{message_type.__name__}"


def _matching_all(offers: list[QoSProfile]) -> tuple[ReliabilityPolicy, DurabilityPolicy]:
    """The most that every publisher offers."""
    reliable = all(offer.reliability == ReliabilityPolicy.RELIABLE for offer in offers)
    latched = all(offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers)
    return (
        ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
