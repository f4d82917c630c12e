"""A short look at a graph that runs: what its nodes say of themselves, what is heard on its
topics, and the limits in force.
"""

import os
import time
from collections import Counter
from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import ReliabilityPolicy

from dart_skill_nodes.client.graph_report import (
    ERROR,
    READY,
    SILENT,
    WARNING,
    GraphReport,
    NodeReport,
    TopicReport,
    missing_nodes,
)
from dart_skill_nodes.comms.names import (
    COMMANDS,
    DIAGNOSTICS,
    GUIDING,
    JOINT_STATES,
    in_graph,
    namespace_of,
    nodes_there,
    pose_topics,
)
from dart_skill_nodes.comms.presence import UNKNOWN
from dart_skill_nodes.comms.qos import LATCHED
from dart_skill_nodes.comms.raw_batches import RawBatches
from dart_skill_nodes.process.parameters import described

SAFETY = "wam/safety"
STATES = (READY, WARNING, ERROR, SILENT)
HAVE_LIMITS = ("commander", "wam_simulator", "effort_bridge")
LONGER = 6.0
"""Nodes that have said nothing yet, or have not answered, are waited for so much longer [s, wall
clock].
"""


class GraphListener:
    """Hears a graph from now on. `spin` lets messages come in for a moment; `report` says what was
    found so far.
    """

    def __init__(self, node: Node, spin: Callable[[], None]):
        self._node, self._spin = node, spin
        self._heard: dict[tuple[str, str], DiagnosticStatus] = {}
        self._safety: DiagnosticStatus | None = None
        self._counts: Counter[str] = Counter()
        self._newest: dict[str, int] = {}
        self._asked: dict[str, tuple] = {}
        self._begun = time.monotonic()
        self._batches = RawBatches(node)
        for topic in (JOINT_STATES, COMMANDS, GUIDING, *pose_topics().values()):
            self._batches.listen(topic)
        node.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, 100)
        node.create_subscription(DiagnosticStatus, SAFETY, self._on_safety, LATCHED)

    def find(self, limit: float) -> bool:
        """Whether a node is found within a limit [s]."""
        until = time.monotonic() + limit
        while not self._others() and time.monotonic() < until:
            self._spin()
        return bool(self._others())

    def listen(self, seconds: float) -> None:
        """Listen for so long, and somewhat longer to nodes that have not said anything yet."""
        self._begun = time.monotonic()
        self._take(count=False)
        until = self._begun + seconds
        while (now := time.monotonic()) < until or (now < until + LONGER and self._lacks()):
            self._spin()
            self._take()
            self._ask_for_limits()

    def report(self, domain: str) -> GraphReport:
        """What was found."""
        return GraphReport(
            domain=domain,
            namespace=namespace_of(self._node),
            seconds=time.monotonic() - self._begun,
            nodes=tuple(self._nodes()),
            bystanders=tuple(
                sorted(self._others() - self._describing() - {name for name, _ in self._heard})
            ),
            topics=tuple(
                report
                for topic in self._batches.topics
                if (report := self._topic(topic)) is not None
            ),
            limits={name: limits for name in self._asked if (limits := self._limits(name))},
            safety=(
                None
                if self._safety is None
                else (STATES[self._safety.level[0]], self._safety.message)
            ),
        )

    def close(self) -> None:
        """Hear nothing any more."""
        self._batches.close()

    # hearing

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if name := in_graph(self._node, status.name):
                self._heard[name, _values(status).get("process", "?")] = status

    def _on_safety(self, message: DiagnosticStatus) -> None:
        self._safety = message

    def _take(self, count: bool = True) -> None:
        for message in self._batches.take():
            self._counts[message.topic] += count
            self._newest[message.topic] = message.received_ns

    def _ask_for_limits(self) -> None:
        """Once of each node that has limits, when it is found; an answer that gets lost is one
        that is not shown.
        """
        for name in HAVE_LIMITS:
            if name not in self._asked and any(name == other for other, _ in self._heard):
                client = self._node.create_client(GetParameters, f"{name}/get_parameters")
                self._asked[name] = client, None
            client, answer = self._asked.get(name, (None, None))
            if client is not None and answer is None and client.service_is_ready():
                self._asked[name] = (
                    client,
                    client.call_async(GetParameters.Request(names=list(described("limits")))),
                )

    # what was found

    def _others(self) -> set[str]:
        return {
            name
            for name in nodes_there(self._node)
            if name not in (self._node.get_name(), UNKNOWN) and not name.startswith("_")
        }

    def _describing(self) -> set[str]:
        """Nodes that have a status of their own, whether they tell it or not."""
        offers = self._node.get_publishers_info_by_topic(DIAGNOSTICS)
        space = self._node.get_namespace()
        return {
            one.node_name
            for one in offers
            if one.node_name != UNKNOWN and one.node_namespace == space
        }

    def _silent(self) -> set[str]:
        return self._describing() - {name for name, _ in self._heard}

    def _lacks(self) -> bool:
        heard = {name for name, _ in self._heard}
        return bool(self._silent() or missing_nodes(heard)) or any(
            answer is None or not answer.done() for _, answer in self._asked.values()
        )

    def _nodes(self) -> list[NodeReport]:
        nodes = [
            NodeReport(name, STATES[status.level[0]], status.message, process, _values(status))
            for (name, process), status in self._heard.items()
        ]
        why = (
            "it is on the graph, and says nothing: it was killed, is frozen, or has just been"
            " started"
        )
        return sorted(
            [*nodes, *(NodeReport(name, SILENT, why) for name in self._silent())],
            key=lambda one: one.name,
        )

    def _topic(self, topic: str) -> TopicReport | None:
        offers = self._node.get_publishers_info_by_topic(topic)
        if not offers:
            return None
        newest = self._newest.get(topic)
        return TopicReport(
            topic=self._node.resolve_topic_name(topic),
            publishers=tuple(sorted(one.node_name for one in offers)),
            rate=self._counts[topic] / max(1e-3, time.monotonic() - self._begun),
            age=None if newest is None else max(0.0, (time.time_ns() - newest) * 1e-9),
            lost=self._batches.lost.get(topic, 0),
            reliable=all(
                one.qos_profile.reliability == ReliabilityPolicy.RELIABLE for one in offers
            ),
        )

    def _limits(self, name: str) -> dict:
        _, answer = self._asked[name]
        if answer is None or not answer.done():
            return {}
        values = [parameter_value_to_python(value) for value in answer.result().values]
        return {
            name: list(value) if hasattr(value, "tolist") else value
            for name, value in zip(described("limits"), values, strict=True)
        }


def this_domain() -> str:
    """The ROS domain that is looked at."""
    return os.environ.get("ROS_DOMAIN_ID", "0")


def _values(status: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}
