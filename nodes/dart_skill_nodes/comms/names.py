"""Names of the graph's topics and services. They are relative: a graph lives in the namespace that
it is started in, so that several arms share a ROS domain. Global as everywhere in ROS are
/diagnostics, /tf and /tf_static only.
"""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from dart_skill.common import world

if TYPE_CHECKING:
    from rclpy.node import Node

JOINT_STATES = "joint_states"
COMMANDS, GUIDING = "wam/command", "wam/teacher_wrench"
"""What moves the arm: the commander's commands, and the forces of a person who guides it."""
ADDRESS_FILE = "address_file"
"""Key of a viewer on /diagnostics: where on its machine its whole address is, token included."""
CLOCK = "clock"
"""Clock of a graph: each simulator has a time of its own."""
DESCRIPTION = "robot_description"
DEMONSTRATIONS, MARKS = (
    world.DEMONSTRATION_TOPIC.removeprefix("/"),
    world.MARK_TOPIC.removeprefix("/"),
)
DIAGNOSTICS = "/diagnostics"
GLOBAL = (DIAGNOSTICS, "/tf", "/tf_static", "/rosout", "/parameter_events")
"""All graphs share them."""


def pose_topic(body: str) -> str:
    """Topic of the poses of a tracked body."""
    return world.pose_topic(body).removeprefix("/")


def pose_topics(roles: Iterable[str] = world.ROLES) -> dict[str, str]:
    """Topic of the poses of each role, default those of a throw."""
    return {role: pose_topic(world.the_world().body(role)) for role in roles}


def namespace_of(node: "Node") -> str:
    """Namespace of a node's graph, as what stands before its relative names: "" or "/arm1"."""
    return node.get_namespace().rstrip("/")


def full_name(node: "Node", name: str) -> str:
    """Full name of a topic or service of the graph, or of a node of it; without the remappings of
    the node.
    """
    return name if name.startswith("/") else f"{namespace_of(node)}/{name}"


def remapped(topics: Iterable[str], given: Mapping[str, str]) -> dict[str, str]:
    """What topics are called instead, by name: a name that is given stands for itself, and for all
    topics that begin with it.

    * topics: relative names of a graph.
    * given: new name by old name, with or without the first slash.

    Raises
    ------
    ValueError
        Names one that stands for none of the topics.
    """
    found, topics = {}, list(topics)
    for old, new in given.items():
        begin = old.strip("/")
        meant = [name for name in topics if name == begin or name.startswith(f"{begin}/")]
        if not meant:
            known = ", ".join(f"/{name}" for name in topics)
            raise ValueError(f"{old}:={new}: there is no such topic, only {known}")
        found.update({name: new.rstrip("/") + name.removeprefix(begin) for name in meant})
    return found


def in_namespace(namespace: str) -> list[str]:
    """Arguments of a process of ROS whose nodes are in a namespace, and follow the time of their
    graph there.
    """
    return (
        ["--ros-args", "-r", f"__ns:={namespace}", "-r", f"/clock:={CLOCK}"] if namespace else []
    )


def diagnostic_name(node: "Node") -> str:
    """How a node calls itself on /diagnostics, which all graphs share: "commander",
    "arm1/commander".
    """
    return node.get_fully_qualified_name().removeprefix("/")


def in_graph(node: "Node", full: str) -> str | None:
    """Name within a node's graph of what is called in full, with or without the first slash; None
    if it is of another namespace.
    """
    space, name = namespace_of(node).removeprefix("/"), full.removeprefix("/")
    if space:
        return name.removeprefix(f"{space}/") if name.startswith(f"{space}/") else None
    return name


def nodes_there(node: "Node") -> set[str]:
    """Names of the nodes of a node's graph that are there, and its own."""
    return {
        name
        for name, space in node.get_node_names_and_namespaces()
        if space == node.get_namespace()
    }
