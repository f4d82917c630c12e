"""Whether nodes are still there: those that served, published or asked when it mattered.

A process that ends says so, and DDS takes its endpoints off the graph at once. One that was killed
or frozen stays there for the 20 s of its participant's lease. So each node says on a latched topic
of its own, `~/_alive`, which process it is, and on the same machine the system is asked about that
process: a killed one is missed at once, and one that waits for a core is not. Of a node on another
machine the liveliness of that topic is looked at, which threads of the middleware assert: a node
whose Python code is busy is alive.

Liveliness is polled: callbacks of QoS events deadlock with rclpy's EventsExecutor. A shorter lease
of the participants would tell all clients, but a node that was frozen for longer is then not
always found again (Fast DDS 2.14).
"""

import os
import time
from collections import Counter
from collections.abc import Callable
from weakref import WeakKeyDictionary

import rclpy
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.event_handler import QoSSubscriptionEventType
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_msgs.msg import Empty, String

from dart_skill_nodes.comms.this_machine import LEASE, LOOK, LOW_NUMBER, SystemProcess, runs

PULSE = 0.5
"""Fast DDS asserts all topics of a process as often as the shortest of their leases needs it; this
one is there for that [s].
"""
SURE = 0.5
"""A silence that lasts so long beyond the lease is one [s, wall clock]."""
LEAVES = 30.0
"""A process that died has left the graph: the lease of a participant of Fast DDS is 20 s [s, wall
clock].
"""
FAST_DDS = b"\x01\x0f"
"""Vendor of a GUID of DDS."""
NO_CAMERAS = "no cameras"
UNKNOWN = "_NODE_NAME_UNKNOWN_"
"""What the middleware calls the node of an endpoint that was discovered before it."""


_HERE: set[str] = set()
"""Nodes of this process: they live as long as it does, and Fast DDS asserts no liveliness within a
process.
"""


def be_alive(node: Node) -> None:
    """Let others know within LEASE when this node is dead or frozen."""
    _HERE.add(node.get_fully_qualified_name())
    said = node.create_publisher(String, "~/_alive", _quality(LEASE))
    said.publish(String(data=SystemProcess.this().name))
    node.create_publisher(Empty, "~/_pulse", _quality(PULSE))


def _quality(lease: float) -> QoSProfile:
    latched = DurabilityPolicy.TRANSIENT_LOCAL
    return QoSProfile(
        depth=16,
        durability=latched,
        liveliness=LivelinessPolicy.AUTOMATIC,
        liveliness_lease_duration=Duration(seconds=lease),
    )


def process_of(endpoint: TopicEndpointInfo) -> tuple[bytes, int]:
    """Machine of an endpoint, empty where the middleware does not say it, and the lower 16 bits of
    the number of its process.

    Fast DDS makes a participant's GUID of them: vendor (2), machine (2), process (2, little
    endian), random (2).
    """
    gid = bytes(endpoint.endpoint_gid)
    return (gid[2:4], int.from_bytes(gid[4:6], "little")) if gid[:2] == FAST_DDS else (b"", -1)


class _Pulse:
    """The lives of the nodes of one name, as this process sees them. losses: how many have fallen
    silent so far, and stayed so.

    Where they have said which processes they are, and those run on this machine, the system knows.
    Else the middleware: only a loss is believed then, as Fast DDS may forget to tell a
    subscription that a publisher lives, and miscounts those that do when a dead one leaves. Of
    those who were killed before they met this process nothing ever comes, not even a loss: after
    LEASE their processes are looked for.
    """

    def __init__(self, node: Node, name: str):
        self._node, self._topic = node, f"{name}/_alive"
        self._there, self._silent, self.losses, self._worse = 0, 0, 0, 0.0
        # when all that are on the graph had last said which processes they are
        self._all_said = time.monotonic()
        self.looked = 0.0  # when this was last done [s, wall clock]
        self._lives: dict[SystemProcess, bool] = {}
        self._died: dict[SystemProcess, float] = {}  # when that was last noticed
        self._subscription = node.create_subscription(
            String, self._topic, lambda _: None, _quality(LEASE)
        )
        with self._subscription.handle:
            kind = QoSSubscriptionEventType.RCL_SUBSCRIPTION_LIVELINESS_CHANGED
            self._event = rclpy_implementation.EventHandle(self._subscription.handle, kind)

    def look(self) -> None:
        """Take in what has changed."""
        self.looked = time.monotonic()
        before = self._there
        self._there = self._node.count_publishers(self._topic)
        lost = self._lost()
        self._hear()
        if self._lives:
            self._look_at_processes()
        else:
            self._believe_leases(lost, max(0, before - self._there))
        if self._there <= len(self._lives):
            self._all_said = time.monotonic()
        elif time.monotonic() - self._all_said > LEASE:
            self._silent = max(self._silent, self._ended())

    def _hear(self) -> None:
        """Which processes they are; this node is not spun. One of another machine takes the place
        of those that died here.
        """
        with self._subscription.handle:
            while (taken := self._subscription.handle.take_message(String, False)) is not None:
                if (process := SystemProcess.named(taken[0].data)) is not None:
                    self._lives.setdefault(process, True)
                elif self._lives:
                    self._look_at_processes()
                    self._lives = {
                        process: True for process, lives in self._lives.items() if lives
                    }
                    self._silent = min(self._silent, max(0, self._there - 1))

    def _look_at_processes(self) -> None:
        now = time.monotonic()
        for process, lived in self._lives.items():
            self._lives[process] = process.lives(LEASE)
            if lived and not self._lives[process]:
                self.losses += 1
                self._died[process] = now
        alive = sum(self._lives.values())
        dead = min(len(self._lives) - alive, max(0, self._there - alive))
        self._silent = min(dead, self._of_the_dead()) if dead else 0
        if alive:  # one must be left, that it is known to be dead
            self._lives = {
                process: lives
                for process, lives in self._lives.items()
                if lives or now - self._died[process] < LEAVES
            }

    def _of_the_dead(self) -> int:
        """How many of those that are on the graph may be of processes that are known not to live:
        one that has just taken the place of another has not yet said which process it is.
        """
        dead = {one.pid & LOW_NUMBER for one, lives in self._lives.items() if not lives}
        return sum(not machine or low in dead for machine, low in self._processes())

    def _lost(self) -> int:
        """How many leases have run out since the last look."""
        with self._event:
            status = self._event.take_event()
        return (
            max(0, status.not_alive_count_change)
            if status is not None and status.alive_count_change
            else 0
        )

    def _believe_leases(self, lost: int, left: int) -> None:
        if lost:
            self._worse = time.monotonic()
        self.losses += lost
        self._silent = max(0, self._silent + lost - left)

    def _ended(self) -> int:
        """How many of them are of processes of this machine that have ended, as far as the
        middleware says which ones they are.
        """
        here = [process_of(one) for one in self._node.get_subscriptions_info_by_topic(self._topic)]
        mine = {machine for machine, number in here if number == os.getpid() & LOW_NUMBER}
        return sum(machine in mine and not runs(number) for machine, number in self._processes())

    def _processes(self) -> list[tuple[bytes, int]]:
        """Processes that are on the graph, as far as the middleware says which ones they are."""
        return [process_of(one) for one in self._node.get_publishers_info_by_topic(self._topic)]

    @property
    def silent(self) -> int:
        """How many of those that are on the graph say nothing any more."""
        return self._silent

    @property
    def is_dead(self) -> bool:
        """Whether none of them lives."""
        return self._silent >= max(1, self._there)

    @property
    def is_sure(self) -> bool:
        """Whether a silence lasts: a process that was held up itself has not yet read what the
        others sent meanwhile.
        """
        return bool(self._lives) or time.monotonic() - self._worse > SURE


class _Pulses:
    """Pulses of all nodes that the nodes of this process have needed, on a hidden node that is not
    spun.

    One for all: of two subscriptions in a process, Fast DDS tells only the first one that a
    publisher is alive.
    """

    def __init__(self, context: Context):
        self._node = rclpy.create_node(
            "_presence", context=context, start_parameter_services=False, enable_rosout=False
        )
        self._of: dict[str, _Pulse] = {}
        context.on_shutdown(self.close)

    def of(self, name: str) -> _Pulse:
        """The pulse of the nodes of a name, looked at now; the others now and then, so that it is
        known since when one is frozen.
        """
        if name not in self._of:
            self._of[name] = _Pulse(self._node, name)
        now = time.monotonic()
        for one, pulse in self._of.items():
            if one == name or now - pulse.looked > LOOK:
                pulse.look()
        return self._of[name]

    def close(self) -> None:
        """With the context."""
        self._of.clear()
        self._node.destroy_node()


_PULSES: WeakKeyDictionary[Context, _Pulses] = WeakKeyDictionary()


def _pulse(node: Node, name: str) -> _Pulse:
    if node.context not in _PULSES:
        _PULSES[node.context] = _Pulses(node.context)
    return _PULSES[node.context].of(name)


class Presence:
    """Those who are there now, as `node` sees them. `gone`: not one of them is there any more;
    never, where none was known.
    """

    def __init__(self, node: Node, look: Callable[[], list[TopicEndpointInfo]]):
        self._node, self._look, self._gone = node, look, False
        there = [one for one in look() if one.node_name != UNKNOWN]
        self._known = {bytes(one.endpoint_gid) for one in there}
        self._endpoints = Counter(
            f"{one.node_namespace.rstrip('/')}/{one.node_name}" for one in there
        )
        self._losses = {name: _pulse(node, name).losses for name in self._endpoints}

    @property
    def gone(self) -> bool:
        """Whether all have left, died or were frozen; a process that goes on again is found by
        another Presence.
        """
        self._gone = self._gone or (bool(self._known) and self._are_gone())
        return self._gone

    def _are_gone(self) -> bool:
        if not any(bytes(one.endpoint_gid) in self._known for one in self._look()):
            return True
        return all(self._is_dead(name, count) for name, count in self._endpoints.items())

    def _is_dead(self, name: str, count: int) -> bool:
        """One that took the place of a dead one may live already: as many are silent as were there
        then.
        """
        if name in _HERE:
            return False
        pulse = _pulse(self._node, name)
        return pulse.is_sure and (pulse.is_dead or pulse.losses - self._losses[name] >= count)

    def __bool__(self) -> bool:
        return bool(self._known)

    @property
    def count(self) -> int:
        """How many there were."""
        return sum(self._endpoints.values())

    def __str__(self) -> str:
        return ", ".join(sorted(name.rsplit("/", 1)[1] for name in self._endpoints)) or "a node"


def servers(node: Node, service: str) -> Presence:
    """Who serves a service; an action's is `<action>/_action/send_goal`."""
    full = node.resolve_service_name(service)
    return Presence(
        node, lambda: node.get_publishers_info_by_topic(f"rr{full}Reply", no_mangle=True)
    )


def publishers(node: Node, topic: str) -> Presence:
    """Who publishes a topic."""
    return Presence(node, lambda: node.get_publishers_info_by_topic(topic))


def subscribers(node: Node, topic: str) -> Presence:
    """Who hears a topic; the clients of an action hear `<action>/_action/feedback`."""
    return Presence(node, lambda: node.get_subscriptions_info_by_topic(topic))


def others(node: Node, topic: str) -> list[str]:
    """Names of the nodes other than this one that publish a topic and live."""
    there = Counter(
        f"{one.node_namespace.rstrip('/')}/{one.node_name}"
        for one in node.get_publishers_info_by_topic(topic)
    )
    there[node.get_fully_qualified_name()] -= 1
    return sorted(
        name.rsplit("/", 1)[1]
        for name, count in there.items()
        if count > 0 and count > _pulse(node, name).silent
    )


class Cameras:
    """Whether the poses of a body are published; to be asked often. met: whether they ever were."""

    def __init__(self, node: Node, topic: str):
        self._node, self._topic, self._there, self.met = node, topic, None, False

    @property
    def missing(self) -> str:
        """What to say if they are not published now; empty if they are."""
        if self._there and not self._there.gone:
            return ""
        self._there = publishers(self._node, self._topic)
        self.met = self.met or bool(self._there)
        return (
            ""
            if self._there and not self._there.gone
            else f"{NO_CAMERAS}: nobody publishes {self._node.resolve_topic_name(self._topic)}"
        )
