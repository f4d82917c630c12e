"""What is said of a graph that runs, and what of it is wrong. No ROS is imported here."""

from collections import Counter
from dataclasses import dataclass, field

from dart_skill_nodes.comms.names import COMMANDS, GUIDING, JOINT_STATES
from dart_skill_nodes.process.graph_processes import LAYOUTS

READY, WARNING, ERROR, SILENT = "ready", "warning", "error", "silent"
"""States of a node, in the order of the levels of diagnostic_msgs/DiagnosticStatus."""
NEEDS = {
    "commander": LAYOUTS["hardware"],
    "wam_simulator": LAYOUTS["processes"],
    "bag_player": ("skill_learner", "demonstration_recorder"),
}
"""Where a node of this name runs, these do. Who looks at a graph for the first time does not find
those that were killed or frozen.
"""


@dataclass(frozen=True)
class NodeReport:
    """A node as it describes itself. process: as it says, empty if it says nothing. values: as on
    /diagnostics.
    """

    name: str
    state: str
    says: str
    process: str = ""
    values: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class TopicReport:
    """A topic while it was listened to. rate: messages per second of the wall clock; age: of the
    newest one [s], None if none came.

    publishers: names of nodes, one twice that publishes twice. reliable: all of them.
    """

    topic: str
    publishers: tuple[str, ...]
    rate: float
    age: float | None
    lost: int
    reliable: bool


@dataclass(frozen=True)
class GraphReport:
    """A whole graph. namespace: empty, or as "/arm1". bystanders: nodes without a status of their
    own, as a driver or `ros2 topic echo`.

    safety: state and reason of the arm's own safety module, None where it is not published.
    limits: in force, by the node that says so.
    """

    domain: str
    seconds: float
    nodes: tuple[NodeReport, ...]
    bystanders: tuple[str, ...]
    topics: tuple[TopicReport, ...]
    limits: dict[str, dict]
    safety: tuple[str, str] | None
    namespace: str = ""

    def topic(self, name: str) -> TopicReport | None:
        """The report of a topic of the graph, as COMMANDS, if it is published."""
        return next((one for one in self.topics if one.topic == f"{self.namespace}/{name}"), None)

    def node(self, name: str) -> NodeReport | None:
        """The report of a node, if it is there."""
        return next((one for one in self.nodes if one.name == name), None)

    @property
    def commanders(self) -> list[str]:
        """Who commands the arm. Of a node that was killed and started again the middleware shows
        both for a while: it counts once.
        """
        return self._living(COMMANDS)

    @property
    def refusals(self) -> dict[str, str]:
        """How many messages and requests were refused so far, by node and place."""
        counts = {f"{node.name}: {key.removesuffix(' refused')}": value for node in self.nodes for key, value in node.values.items()
                  if key.endswith(" refused")}  # fmt: skip
        return dict(sorted(counts.items()))

    @property
    def missing(self) -> list[str]:
        """Nodes that are not there, where others are that work with them."""
        return missing_nodes({node.name for node in self.nodes})

    @property
    def problems(self) -> list[str]:
        """What is wrong, a line each; a warning of a node is none, unless nothing can be thrown
        for it.
        """
        return [*self._of_nodes(), *self._of_arm(), *self._of_messages()]

    def _of_nodes(self) -> list[str]:
        bad = [f"{node.name}: {node.says}" for node in self.nodes if node.state in (ERROR, SILENT)]
        names = Counter(node.name for node in self.nodes)
        processes = {
            name: [node.process for node in self.nodes if node.name == name]
            for name, count in names.items()
            if count > 1
        }
        bad += [
            f"no {name}: it was not started, has ended, was killed or is frozen"
            for name in self.missing
        ]
        return bad + [
            f"{len(of)} nodes are called {name}, in processes {' and '.join(of)}: end one"
            for name, of in processes.items()
        ]

    def _of_arm(self) -> list[str]:
        bad = []
        for topic, what in ((COMMANDS, "command the arm"), (GUIDING, "push the arm")):
            if len(living := self._living(topic)) > 1:
                bad.append(f"{' and '.join(living)} {what} ({self.namespace}/{topic}): end one")
        if self.safety is not None and self.safety[0] == ERROR:
            bad.append(f"the arm's safety module has stopped it until a reset: {self.safety[1]}")
        commander = self.node("commander")
        if (
            commander is not None
            and "/commander/reset" in commander.says
            and commander.state != ERROR
        ):
            bad.append(f"commander: {commander.says}")
        if (
            commander is not None
            and commander.state != SILENT
            and self.topic(JOINT_STATES) is None
        ):
            bad.append(f"no arm: nobody publishes {self.namespace}/{JOINT_STATES}")
        if (
            len(
                {
                    tuple(sorted((name, str(value)) for name, value in limits.items()))
                    for limits in self.limits.values()
                }
            )
            > 1
        ):
            bad.append(f"{', '.join(self.limits)} have different limits: {self._differing()}")
        return bad

    def _of_messages(self) -> list[str]:
        return [
            f"{one.lost} messages of {one.topic} were lost while it was listened to"
            for one in self.topics
            if one.lost and one.reliable
        ]

    def _living(self, topic: str) -> list[str]:
        report = self.topic(topic)
        there = Counter(report.publishers if report else ())
        spoken = Counter(node.name for node in self.nodes if node.process)
        return sorted(
            name
            for name, count in there.items()
            for _ in range(min(count, spoken[name]) if spoken[name] else count)
        )

    def _differing(self) -> str:
        names = {name for limits in self.limits.values() for name in limits}
        return ", ".join(
            sorted(
                name
                for name in names
                if len({str(limits.get(name)) for limits in self.limits.values()}) > 1
            )
        )


def missing_nodes(there: set[str]) -> list[str]:
    """Nodes that work with those that are there, and are not."""
    if "commander" not in there and "bag_player" not in there:
        return []  # a simulator, or cameras, alone
    return sorted({needed for name in there for needed in NEEDS.get(name, ())} - there)
