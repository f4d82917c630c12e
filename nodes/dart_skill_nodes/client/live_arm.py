"""Whether what a recording holds would move an arm that is there, or be mistaken for what it says
of itself.
"""

import re
from collections.abc import Collection, Iterable, Mapping

from rclpy.node import Node

from dart_skill_nodes.comms.names import COMMANDS, GUIDING, JOINT_STATES
from dart_skill_nodes.comms.presence import UNKNOWN, others
from dart_skill_nodes.process.graph_processes import NODES

TAKE_COMMANDS = (".*/wam/command", ".*/wam/teacher_wrench", ".*/commands", ".*/hand_open")
"""Topics on which arms and hands take commands, as regular expressions: this package's, and those
of controllers of ros2_control.
"""
NO_DRIVERS = {*NODES, "recorder", "viewer", "bag_player"} - {"wam_simulator"}
"""Nodes of this package that take commands in, and carry none out; so do those of hidden names,
which begin with an underscore.
"""


def commands_an_arm(topic: str) -> bool:
    """Whether an arm that hears a topic of this name would move."""
    return any(re.fullmatch(pattern, topic) for pattern in TAKE_COMMANDS)


def concern_an_arm(topics: Iterable[str]) -> list[str]:
    """Those of some topics on which an arm takes commands, or says its states."""
    return [
        topic for topic in topics if commands_an_arm(topic) or topic.endswith(f"/{JOINT_STATES}")
    ]


def arm_beside(node: Node, topics: Mapping[str, str]) -> str:
    """Why a node must not publish a recording on some topics: an arm publishes its states. Empty
    if it may.

    * topics: what each is called in the recording, by the name under which it would be published.
    """
    theirs = concern_an_arm(topics)
    commands = [topic for topic in theirs if commands_an_arm(topic)]
    states = [topic for topic in theirs if topic not in commands]
    graphs = {
        topic.removesuffix(f"/{name}")
        for topic in commands
        for name in (COMMANDS, GUIDING)
        if topic.endswith(f"/{name}")
    }
    for topic in {
        *states,
        *([JOINT_STATES] if commands else []),
        *(f"{graph}/{JOINT_STATES}" for graph in graphs),
    }:
        if there := others(node, topic):
            who = " and ".join("somebody" if name == UNKNOWN else name for name in there)
            without = " ".join(topics[one] for one in theirs)
            return (
                f"{who} publishes {node.resolve_topic_name(topic)}: an arm is there. Play without"
                f" these (--exclude {without}), or end it"
            )
    return ""


class Hearers:
    """Those who hear the commands of a recording, each of whom is looked at before one is
    published.
    """

    def __init__(self, node: Node, topics: Collection[str]):
        self._node, self._known = node, {topic: 0 for topic in topics if commands_an_arm(topic)}

    def look(self) -> str:
        """See who is there now; why no command must be published: a node hears it that may move
        an arm. Empty if it may.
        """
        for topic in self._known:
            names = [one.node_name for one in self._node.get_subscriptions_info_by_topic(topic)]
            if drivers := sorted(
                {
                    name
                    for name in names
                    if name != UNKNOWN and name not in NO_DRIVERS and not name.startswith("_")
                }
            ):
                return (
                    f"{' and '.join(drivers)} hears {topic}, and may move an arm. Publish it under"
                    " another name (remap), or end it"
                )
            self._known[topic] = 0 if UNKNOWN in names else len(names)
        return ""

    def are_known(self, topic: str, count: int) -> bool:
        """Whether so many who hear a topic have all been looked at."""
        return topic not in self._known or count <= self._known[topic]
