"""Messages between nodes of one process, handed over without the middleware.

DDS takes about 35 us of a core for each message and each subscription, also where both are in one
process. So a publisher whose topic no other process hears serialises a message once and
hands it to the subscriptions here. As soon as another process hears the topic, its messages go
through the middleware, for everybody, and they do until the last of them has been heard here: no
message overtakes another one. Publishers and subscriptions exist in DDS all the time: `ros2 topic
info` shows them, and messages of other processes come as ever.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from rclpy.executors import Executor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.subscription import Subscription

SLICE = 2e-3
"""What the middleware has ready waits so long at most for messages that are handed over [s, wall
clock].
"""
MOST = 200
"""Callbacks of the middleware that are called before the next messages are handed over: whoever
sends more does not hold up the arm.
"""


@dataclass(eq=False)
class LocalSubscription:
    """A subscription of this process.

    topic: its full name. hear: called with each message, serialised if raw; None: they are kept
    until they are taken. waiting: messages that were handed over and that it has not heard.
    newest: the last one that came through the middleware.
    """

    topic: str
    message_type: type
    qos: QoSProfile
    raw: bool
    hear: Callable | None
    kept: deque[tuple[int, bytes]] = field(default_factory=deque)
    waiting: int = 0
    newest: bytes = b""

    def has_heard(self, data: bytes) -> bool:
        """Whether a message of the middleware was the last that it heard; one whose messages are
        taken puts them in order itself.
        """
        return self.hear is None or self.newest == data

    def suits(self, publisher: Publisher) -> bool:
        """Whether DDS would connect the two."""
        reliable = publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        best_effort = self.qos.reliability == ReliabilityPolicy.BEST_EFFORT
        latched = self.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        return (
            self.message_type is publisher.msg_type and (reliable or best_effort) and not latched
        )


class _HandedMessage:
    """A message on its way; those that hear it decoded share one copy, which none of them changes."""

    def __init__(self, data: bytes, message_type: type):
        self.data, self._type, self._message = data, message_type, None

    def give(self, hearer: LocalSubscription) -> None:
        """Call who hears it. Bytes that are no message are dropped, as the middleware drops them."""
        if hearer.raw:
            hearer.hear(self.data)
            return
        try:
            self._message = self._message or deserialize_message(self.data, self._type)
        except Exception as error:  # rclpy raises whatever its middleware does
            get_logger("in_process").error(
                f"{len(self.data)} bytes on {hearer.topic} are no {self._type.__name__}, dropped:"
                f" {error}"
            )
        else:
            hearer.hear(self._message)


class Exchange:
    """Who hears what in this process, and the messages that wait to be handed over. Only the
    thread that made it uses it.

    heard: messages that came through the middleware so far. called: callbacks of the middleware
    and of timers so far, as far as they are known, which tells a loop whether more may be ready
    there. turns: how often the others have had a turn so far: what the middleware knows of them
    does not change in between.
    """

    def __init__(self) -> None:
        self._thread, self._hearers, self._waiting = threading.get_ident(), [], deque()
        self._soon: list[Callable[[], None]] = []
        self.heard, self.called, self.changes, self.turns = 0, 0, 0, 0

    @property
    def is_here(self) -> bool:
        """Whether this is the thread that hands over. Others leave it to the middleware, which
        wakes the executor.
        """
        return threading.get_ident() == self._thread

    def add(self, hearer: LocalSubscription) -> None:
        """Hand messages over to a subscription, too."""
        self._hearers.append(hearer)
        self.changes += 1

    def remove(self, hearer: LocalSubscription) -> None:
        """Hand no message over to a subscription any more."""
        if hearer in self._hearers:
            self._hearers.remove(hearer)
            hearer.hear = hearer.hear and _nothing  # something may wait for it still
            self.changes += 1

    def hearers_of(self, publisher: Publisher) -> list[LocalSubscription]:
        """Subscriptions of this process that DDS connects with a publisher."""
        topic = publisher.topic_name
        return [
            hearer for hearer in self._hearers if hearer.topic == topic and hearer.suits(publisher)
        ]

    def hand_over(self, data: bytes, hearers: list[LocalSubscription]) -> None:
        """Give a serialised message to those that keep theirs, and let it wait for those that are
        called.
        """
        handed = None
        for hearer in hearers:
            if hearer.hear is None:
                hearer.kept.append((time.time_ns(), data))
            else:
                handed = handed or _HandedMessage(data, hearer.message_type)
                self._waiting.append((hearer, handed))
                hearer.waiting += 1

    def call_soon(self, callback: Callable[[], None]) -> None:
        """Call it once, when the others have had a turn."""
        self._soon.append(callback)

    def deliver(self) -> bool:
        """Call those that messages wait for, and those of the messages that they publish then, for
        a SLICE; whether there were any.
        """
        self.turns += 1
        waiting, (soon, self._soon) = self._waiting, (self._soon, [])
        if not waiting and not soon:
            return False
        for callback in soon:
            callback()
        until = time.monotonic() + SLICE
        while waiting:
            hearer, handed = waiting.popleft()
            hearer.waiting -= 1
            handed.give(hearer)
            if time.monotonic() > until:
                break
        return True

    def hear(self, hearer: LocalSubscription, data: bytes) -> None:
        """A message has come through the middleware: it is given to its hearer after those that
        were handed over before.
        """
        self.heard += 1
        self.called += 1
        if hearer.waiting:
            before = [handed for one, handed in self._waiting if one is hearer]
            self._waiting = deque(item for item in self._waiting if item[0] is not hearer)
            hearer.waiting = 0
            for handed in before:
                handed.give(hearer)
        hearer.newest = data
        _HandedMessage(data, hearer.message_type).give(hearer)


_exchange: Exchange | None = None
"""Exchange of this process; None: everything goes through the middleware."""


@contextmanager
def exchanging() -> Iterator[Exchange]:
    """Nodes that are made meanwhile hand each other their messages, if this thread spins them with
    `spin_once`.
    """
    global _exchange
    _exchange = Exchange()
    try:
        yield _exchange
    finally:
        _exchange = None


def call_soon(callback: Callable[[], None]) -> None:
    """Call it when the others in this process have had a turn, if it exchanges messages; else not
    at all: a timer will.
    """
    if _exchange is not None:
        _exchange.call_soon(callback)


def has_called() -> None:
    """Something beside a message was called by the executor: a timer, a service, a routine that
    goes on. More may be ready behind it.
    """
    if _exchange is not None:
        _exchange.called += 1


def spin_once(executor: Executor, exchange: Exchange, patience: float) -> None:
    """Hand over what waits and hear what the middleware has ready; where nothing waits, wait there
    for one message [s].
    """
    if not exchange.deliver():
        executor.spin_once(timeout_sec=patience)
        return
    for _ in range(MOST):
        before = exchange.called
        executor.spin_once(timeout_sec=0.0)
        if exchange.called == before:
            return


class ExchangingPublisher(Publisher):
    """A publisher that leaves out the middleware while only subscriptions of this process hear its
    topic.
    """

    _hearers: list[LocalSubscription] = []
    _changes = -1
    _last = b""
    """What went through the middleware last, until all in this process have heard it."""
    _counted, _count = (-1, -1), 0
    """When the subscriptions were counted last, and how many there were: in a turn of the arm it
    is asked at every state.
    """

    def get_subscription_count(self) -> int:
        """Subscriptions of its topic in all processes, at the last turn of the middleware."""
        exchange = _exchange
        if exchange is None or not exchange.is_here:
            return super().get_subscription_count()
        if self._counted != (now := (exchange.turns, exchange.changes)):
            self._counted, self._count = now, super().get_subscription_count()
        return self._count

    def publish(self, msg) -> None:
        """Send a message, or its bytes, to all who hear the topic."""
        exchange = _exchange
        if exchange is None or not exchange.is_here:
            super().publish(msg)
            return
        if self._changes != exchange.changes:
            self._hearers, self._changes = exchange.hearers_of(self), exchange.changes
        if not self._hearers:
            super().publish(msg)
            return
        data = msg if isinstance(msg, bytes) else serialize_message(msg)
        if self.get_subscription_count() > len(self._hearers) or not self._is_heard():
            self._last = data
            super().publish(data)
        else:
            exchange.hand_over(data, self._hearers)

    def _is_heard(self) -> bool:
        if self._last and all(hearer.has_heard(self._last) for hearer in self._hearers):
            self._last = b""
        return not self._last


class ExchangingNode:
    """Before Node or a class of it: its publishers and subscriptions take part in the exchange of
    the process, where there is one.
    """

    def create_publisher(self, msg_type, topic, qos_profile, **options):
        kind = (
            ExchangingPublisher
            if _exchange is not None and _is_volatile(qos_profile)
            else Publisher
        )
        return super().create_publisher(
            msg_type, topic, qos_profile, **{"publisher_class": kind, **options}
        )

    def create_subscription(self, msg_type, topic, callback, qos_profile, *, raw=False, **options):
        exchange = _exchange
        if exchange is None:
            return super().create_subscription(
                msg_type, topic, callback, qos_profile, raw=raw, **options
            )

        # serialised in any case: a publisher compares them with what it sent
        subscription = super().create_subscription(
            msg_type,
            topic,
            lambda data: self._hear(subscription, data),
            qos_profile,
            raw=True,
            **options,
        )
        self._take_part(subscription, msg_type, raw, callback)
        return subscription

    @staticmethod
    def _hear(subscription: Subscription, data: bytes) -> None:
        if _exchange is not None:
            _exchange.hear(subscription.hearer, data)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        if (hearer := getattr(subscription, "hearer", None)) is not None and _exchange is not None:
            _exchange.remove(hearer)
        return super().destroy_subscription(subscription)

    def _take_part(
        self, subscription: Subscription, msg_type: type, raw: bool, callback: Callable | None
    ) -> None:
        qos = subscription.qos_profile
        kept = deque(maxlen=qos.depth)
        subscription.hearer = LocalSubscription(
            subscription.topic_name, msg_type, qos, raw, callback, kept
        )
        _exchange.add(subscription.hearer)


class UnspunNode(ExchangingNode, Node):
    """A node that is not spun, for subscriptions whose messages are taken. Their callbacks are
    never called.
    """

    def _take_part(
        self, subscription: Subscription, msg_type: type, raw: bool, callback: Callable | None
    ) -> None:
        super()._take_part(subscription, msg_type, raw, None)


def kept_for(subscription: Subscription) -> list[tuple[int, bytes]]:
    """What was handed over to a subscription of an unspun node since the last time: when on the
    wall clock [ns], and the bytes.
    """
    hearer = getattr(subscription, "hearer", None)
    if hearer is None or not hearer.kept:
        return []
    kept = list(hearer.kept)
    hearer.kept = deque(maxlen=hearer.kept.maxlen)
    return kept


def _nothing(message) -> None:
    """Callback of a subscription that has gone."""


def _is_volatile(qos_profile: QoSProfile | int) -> bool:
    return (
        isinstance(qos_profile, int) or qos_profile.durability != DurabilityPolicy.TRANSIENT_LOCAL
    )
