"""What of a recording a node may publish: neither what would move an arm that is there, or be mistaken
for what it says of itself, nor what is of an unknown type.
"""

import math
import re
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from dart_skill.recording import BagReader, TopicInfo, type_hash, types_for
from dart_skill.recording.bags import CLOCK_TOPIC, CLOCK_TYPE, Playback, PlaybackSelection
from dart_skill_nodes.comms.names import COMMANDS, GLOBAL, GUIDING, JOINT_STATES, full_name
from dart_skill_nodes.comms.presence import UNKNOWN, others
from dart_skill_nodes.comms.qos import CLOCK_QOS, message_class
from dart_skill_nodes.process.graph_processes import NODES

DEPTH = 10_000
"""Least depth of publishers, whatever was recorded, so that what is lost on the way can be
repeated; no subscriber sees it.
"""
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


def selection(node: Node, bag: BagReader, parameters: dict[str, Any]) -> PlaybackSelection:
    """What of a bag is played, and how; the log says what is left out.

    * parameters: of the node bag_player.
    """
    p, log = parameters, node.get_logger()
    played = PlaybackSelection(p["topics"], p["exclude"])
    remap = {}
    if p["graph"]:
        own = [name for name in bag.topics if name not in (CLOCK_TOPIC, *GLOBAL)]
        remap = {name: full_name(node, name.removeprefix("/")) for name in own}
    remap |= dict(text.split("=", 1) for text in p["remap"] if text.strip("="))
    left_out = []
    for name, info in bag.topics.items():
        if not played.matches(name):
            continue
        new = remap.get(name, name)
        if not p["commands"] and commands_an_arm(new):
            log.info(f"{new} is not played: it would command an arm (parameter commands)")
            left_out.append(name)
        elif why := _unknown(info):
            log.warning(f"{name} is not played: {why}")
            left_out.append(name)
    return PlaybackSelection(
        topics=p["topics"],
        exclude=[*p["exclude"], *map(re.escape, left_out)],
        remap=remap,
        start=p["start"],
        duration=p["duration"] or math.inf,
        loop=p["loop"],
        clock_rate=p["clock_rate"],
    )


def _unknown(info: TopicInfo) -> str:
    """Why the type of a topic is not installed here, in the version that the bag has; empty if it
    is.
    """
    try:
        message_class(info.type_name)
        here = type_hash(types_for(info.type_name), info.type_name)
    except (ImportError, AttributeError, ValueError) as error:
        return str(error)
    if info.type_hash in ("", here):
        return ""
    return f"its {info.type_name} differs from the one that is installed here"


def offers(playback: Playback) -> dict[str, tuple[type, QoSProfile]]:
    """Type and quality of service of each topic that is played."""
    made = {
        topic: (message_class(info.type_name), quality(info))
        for topic, info in playback.topics.items()
    }
    clock = {CLOCK_TOPIC: (message_class(CLOCK_TYPE), CLOCK_QOS)}
    return made | (clock if playback.makes_clock else {})


def quality(info: TopicInfo) -> QoSProfile:
    """The first recorded quality of service of a topic; late joiners get as many messages of a
    latched one as they did then.
    """
    if not info.qos:
        return QoSProfile(depth=DEPTH)
    recorded = info.qos[0]
    latched = recorded.durability.name == "TRANSIENT_LOCAL"
    return QoSProfile(
        depth=recorded.depth if latched and recorded.depth else max(recorded.depth, DEPTH),
        reliability=ReliabilityPolicy[recorded.reliability.name],
        durability=DurabilityPolicy[recorded.durability.name],
    )


def awaited_topics(expressions: Iterable[str], topics: Iterable[str]) -> list[str]:
    """Those of some topics that one of the expressions matches as a whole; ValueError if one of
    them, but an empty one, matches none.
    """
    topics, patterns = sorted(topics), list(filter(None, expressions))
    matched = {
        pattern: [one for one in topics if re.fullmatch(pattern, one)] for pattern in patterns
    }
    if unknown := [pattern for pattern in patterns if not matched[pattern]]:
        raise ValueError(f"awaited: {unknown} are not played, only {topics}")
    return [one for one in topics if any(one in found for found in matched.values())]
