#!/usr/bin/env python3
"""Writes docs/reference.md from the nodes themselves: what each publishes and serves, its
parameters, and the message types.

    source tools/env.sh && python3 tools/make_reference.py            # --check only compares, exit status 1 if they differ

Every node is started in this process, and asked as `ros2 node info` and `ros2 param describe`
would.
"""

import argparse
import os
import re
import sys
import tempfile
import time
from pathlib import Path

from dart_skill.common.permissions import PARAMETERS
from dart_skill_nodes.process.environment import choose_domain

# where another commander is, its topics would be taken for those of this one
os.environ.pop("ROS_DOMAIN_ID", None)
choose_domain()

import rclpy  # noqa: E402  the domain must be chosen before rclpy starts
from rcl_interfaces.msg import ParameterDescriptor  # noqa: E402
from rclpy.lifecycle import LifecycleNode  # noqa: E402
from rclpy.node import Node  # noqa: E402

from dart_skill_nodes.executables import (  # noqa: E402
    bag_player,
    coach,
    commander,
    demonstration_recorder,
    effort_bridge,
    mock_optitrack,
    recorder,
    skill_learner,
    teacher,
    viewer,
    wam_simulator,
)

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reference.md"
CLASSES = [
    wam_simulator.WamSimulator,
    mock_optitrack.MockOptitrack,
    commander.CommanderNode,
    effort_bridge.EffortBridgeNode,
    demonstration_recorder.DemonstrationRecorder,
    skill_learner.SkillLearner,
    teacher.TeacherNode,
    coach.CoachNode,
    viewer.Viewer,
    recorder.Recorder,
    bag_player.BagPlayer,
]
COMMON = {"/rosout", "/parameter_events"}
OF_THE_MACHINERY = re.compile(
    r"/_|/(get_type_description|transition_event|change_state|get_state|get_available_\w+|get_transition_graph)$"
)
"""Topics and services that every node has, or every managed one."""
UNTOLD = re.compile(r"use_sim_time$|start_type_description_service$|qos_overrides|cameras\.")
"""Parameters of every node, and of every single camera."""
PATIENCE, LOOK = 60.0, 0.05
"""For a node to find itself on the graph, and between two looks [s, wall clock]."""
HEAD = """# Nodes, parameters and types

Written by `tools/make_reference.py` from the nodes themselves, which a test compares: change the code, not this page. Every node has
the topics `/rosout` and `/parameter_events`, tells its status on `/diagnostics`, and has the parameter services of ROS. Defaults stand in
[config/](../config); `*`: may be changed while the node runs; `†`: while it is not configured. Each camera has two parameters more, as
`cameras.c01.position` and `cameras.c01.look_at` †: its place, and a point that it looks at [m].
"""


def arguments(folder: Path) -> list[str]:
    """Parameters that let every node start here."""
    chosen = {
        "demonstration_recorder:bag": folder / "shown",
        "recorder:bag": folder / "all",
        "viewer:port": 0,
        "bag_player:bag": ROOT / "bags" / "demonstrations",
        "bag_player:start_paused": "true",
        "bag_player:topics": "[/vrpn_mocap/ball/pose]",
    }
    return [
        "--ros-args",
        *(part for name, value in chosen.items() for part in ("-p", f"{name}:={value}")),
    ]


def page(nodes: list[Node]) -> str:
    """The whole page."""
    return "\n".join([HEAD, *(section(node) for node in nodes), types()])


def section(node: Node) -> str:
    """A node: what it does, publishes and serves, and its parameters."""
    first = sys.modules[type(node).__module__].__doc__.strip().split("\n\n")[0].replace("\n", " ")
    managed = (
        ["", "A managed node: it has the services and the topic of the life cycle."]
        if isinstance(node, LifecycleNode)
        else []
    )
    return "\n".join(
        [
            f"## {node.get_name()}",
            "",
            first,
            *managed,
            "",
            *interfaces(node),
            "",
            *parameters(node),
            "",
        ]
    )


def interfaces(node: Node) -> list[str]:
    """Tables of topics, actions and services, as the graph has them."""
    name, until = node.get_name(), time.monotonic() + PATIENCE
    while not _is_seen_whole(node):
        if time.monotonic() > until:
            raise TimeoutError(f"{name} is not whole on the graph after {PATIENCE:.0f} s")
        time.sleep(LOOK)  # to look takes the processor that whoever finds the rest of it needs
    ignored = COMMON | ({"/diagnostics"})
    topics = [
        one
        for one in node.get_publisher_names_and_types_by_node(name, "/")
        if one[0] not in ignored and "/_action/" not in one[0]
    ]
    services = node.get_service_names_and_types_by_node(name, "/")
    actions = [
        (one.split("/_action/")[0], [kind[0].removesuffix("_SendGoal")])
        for one, kind in services
        if one.endswith("/_action/send_goal")
    ]
    plain = [
        one
        for one in services
        if "/_action/" not in one[0] and one[0].rsplit("/", 1)[1] not in PARAMETERS
    ]
    rows = [
        f"| {what} | `{topic}` | `{kinds[0]}` |"
        for what, found in (("publishes", topics), ("action", actions), ("service", plain))
        for topic, kinds in sorted(found)
        if not OF_THE_MACHINERY.search(topic)
    ]
    return ["| | name | type |", "|---|---|---|", *rows] if rows else []


def _is_seen_whole(node: Node) -> bool:
    """Whether the graph shows all that the node made: a participant is found before its endpoints
    are.
    """
    name = node.get_name()
    if name not in node.get_node_names():
        return False
    published = {topic for topic, _ in node.get_publisher_names_and_types_by_node(name, "/")}
    served = {service for service, _ in node.get_service_names_and_types_by_node(name, "/")}
    return published >= {one.topic_name for one in node.publishers} and served >= {
        one.service_name for one in node.services
    }


def parameters(node: Node) -> list[str]:
    """A table of the parameters, with defaults and ranges."""
    rows = [
        _parameter_row(node, name, node.describe_parameter(name))
        for name in sorted(node._parameters)
        if not UNTOLD.match(name)
    ]
    return ["| parameter | default | range | |", "|---|---|---|---|", *rows] if rows else []


def _parameter_row(node: Node, name: str, descriptor: ParameterDescriptor) -> str:
    bounds = [*descriptor.floating_point_range, *descriptor.integer_range]
    limits = f"{bounds[0].from_value:g} to {bounds[0].to_value:g}" if bounds else ""
    starred = "†" if descriptor.additional_constraints else "\\*"
    changeable = "" if descriptor.read_only else f" {starred}"
    value = node.get_parameter(name).value
    default = (
        "" if f"{node.get_name()}:{name}:=" in " ".join(arguments(Path("x"))) else f"`{value}`"
    )
    return (
        f"| `{name}`{changeable} | {default} | {limits} |"
        f" {descriptor.description.replace('|', 'or')} |"
    )


def types() -> str:
    """The definitions of dart_skill_msgs."""
    parts = ["## Types of dart_skill_msgs", ""]
    for kind in ("msg", "srv", "action"):
        for file in sorted((ROOT / "msg_schemas" / kind).glob(f"*.{kind}")):
            parts += [
                f"### {kind}/{file.stem}",
                "",
                "```",
                file.read_text(encoding="utf-8").rstrip(),
                "```",
                "",
            ]
    return "\n".join(parts)


def main() -> int:
    """Entry point; returns the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--check", action="store_true")
    check = parser.parse_args().check
    with tempfile.TemporaryDirectory() as folder:
        rclpy.init(args=arguments(Path(folder)))
        nodes = [make() for make in CLASSES]
        try:
            text = page(nodes)
        finally:
            for node in nodes:
                node.destroy_node()
            rclpy.try_shutdown()
    if check:
        same = PAGE.is_file() and PAGE.read_text(encoding="utf-8") == text
        print(
            "docs/reference.md is what the nodes say"
            if same
            else "docs/reference.md is not what the nodes say: python3 tools/make_reference.py"
        )
        return int(not same)
    PAGE.write_text(text, encoding="utf-8")
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
