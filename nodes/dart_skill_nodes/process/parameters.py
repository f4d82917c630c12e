"""Parameters of the nodes: what they are stands in config/parameters.yaml, their values in the file of
each node; and what may be typed behind the name of a node.
"""

import inspect
import math
import sys
from collections.abc import Callable, Iterable
from functools import cache, partial
from types import ModuleType
from typing import TYPE_CHECKING, Any

import yaml
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.utilities import remove_ros_args

from dart_skill.common.configuration import NoSection, described_parameters, node_parameters
from dart_skill.common.world import the_world
from dart_skill_nodes.comms.refusals import GuardedLifecycleNode

if TYPE_CHECKING:
    from dart_skill.skills.protocol import Skill

UNCONFIGURED = "while the node is not configured"
"""When a parameter may be changed that a managed node reads when it is configured."""
FILES = {"mock_optitrack": "optitrack.yaml"}
"""Files of values that are not called as their node."""


@cache
def described(section: str) -> dict[str, dict[str, Any]]:
    """By name, what each parameter of a node is: `about`, a description; the `range` of a number,
    or what `kind_of` knows it by; `changes`, if it may be changed while the node runs: true, or
    `unconfigured` for what a managed node reads when it is configured. Empty for a node without
    parameters of its own.

    section: name of the executable; "limits": those that several nodes share.
    """
    return described_parameters().get(section, {})


def declare(node: Node, section: str) -> dict[str, Any]:
    """Declare the parameters of a node with the values of its file in config/ as defaults; the
    values in force. A node that was given another name has those of the file's own section.
    """
    node.add_on_set_parameters_callback(_refuse_what_is_not_finite)
    if isinstance(node, GuardedLifecycleNode):
        node.add_on_set_parameters_callback(partial(_refuse_what_is_read, node))
    file = FILES.get(section, f"{section}.yaml")
    try:
        defaults = node_parameters(file, node.get_name(), section)
    except NoSection:
        defaults = node_parameters(file, section)
    rows = described(section)
    for name, row in rows.items():
        declare_row(node, name, row, defaults[name])
    return values_of(node, rows)


def values_of(node: Node, names: Iterable[str]) -> dict[str, Any]:
    """Values of parameters of a node, as they are now."""
    return {name: node.get_parameter(name).value for name in names}


def declare_bodies(node: Node, roles: Iterable[str]) -> dict[str, str]:
    """A parameter for the name of each tracked body, by its role in the skill; the names that are
    in force.
    """
    for role in roles:
        row = {"about": f"tracked body that is the {role}"}
        declare_row(node, f"{role}_body", row, the_world().body(role))
    return {role: node.get_parameter(f"{role}_body").value for role in roles}


def skill_of(node: Node) -> "Skill":
    """The skill that the parameter `skill` names, with the changes of its settings that the
    parameter `skill_settings` holds, a YAML mapping; ValueError for a skill, a setting or a part
    that there is not.
    """
    (row,) = described("skill").items()
    declare_row(node, *row, "")
    given = node.get_parameter(row[0]).value
    try:
        changes = yaml.safe_load(given) if given else {}
    except yaml.YAMLError:
        changes = None
    if not isinstance(changes, dict):
        raise ValueError(f"{row[0]} is '{given}': give a YAML mapping, {{components: 16}}")
    from dart_skill.skills.protocol import load_skill  # not every node knows a skill

    return load_skill(node.get_parameter("skill").value, changes=changes)


def declare_row(node: Node, name: str, row: dict[str, Any], default) -> None:
    """Declare a parameter. row: what it is, as `described` has it."""
    changes = row.get("changes")
    descriptor = ParameterDescriptor(description=row["about"], read_only=not changes)
    descriptor.additional_constraints = UNCONFIGURED if changes == "unconfigured" else ""
    low, high = row.get("range", (None, None))
    if low is not None and isinstance(default, float):
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(low), to_value=float(high))
        ]
    elif low is not None:
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
    node.declare_parameter(name, default, descriptor)


def _refuse_what_is_not_finite(parameters) -> SetParametersResult:
    """A parameter that is NaN or infinite is refused: NaN lies inside every range."""
    for parameter in parameters:
        values = (
            parameter.value if isinstance(parameter.value, list | tuple) else [parameter.value]
        )
        if any(isinstance(value, float) and not math.isfinite(value) for value in values):
            reason = f"{parameter.name} = {parameter.value}: give finite numbers"
            return SetParametersResult(successful=False, reason=reason)
    return SetParametersResult(successful=True)


def _refuse_what_is_read(node: GuardedLifecycleNode, parameters) -> SetParametersResult:
    """A parameter that counts when a node is configured is refused while it is."""
    for name in (one.name for one in parameters):
        if (
            node.is_configured
            and node.has_parameter(name)
            and node.describe_parameter(name).additional_constraints == UNCONFIGURED
        ):
            reason = f"{name} is read when the node is configured: deactivate it and clean it up"
            return SetParametersResult(successful=False, reason=reason)
    return SetParametersResult(successful=True)


def heed_arguments(make_nodes: Callable[[], list[Node]], program: str) -> None:
    """Print the help of a program and end it, where it is asked for; end it with status 2 and a
    line for what it does not take.

    make_nodes: of the module whose text the help has.
    """
    try:
        given = remove_ros_args(sys.argv)[1:]
    except RuntimeError as error:
        # of rcl, whose text ends with places in its source
        why = str(error).removeprefix("Failed to parse ROS arguments: ").split(", at /")[0]
        print(f"{program}: {why}", file=sys.stderr)
        raise SystemExit(1) from None
    if {"-h", "--help"} & set(given):
        print(_help_text(program, inspect.getmodule(make_nodes)))
        raise SystemExit(0)
    if given:
        print(
            f"{program}: '{given[0]}' is not understood: parameters are given as --ros-args -p"
            " NAME:=VALUE",
            file=sys.stderr,
        )
        raise SystemExit(2)


def _help_text(program: str, module: ModuleType | None) -> str:
    """Usage, the first lines of a module, and its table of parameters."""
    about = (inspect.getdoc(module) or "").partition("\n\n")[0]
    rows = described(program)
    width = max(map(len, rows), default=0)
    lines = [
        f"usage: ros2 run dart_skill {program} [--ros-args -p NAME:=VALUE ...]",
        "",
        about,
        "",
    ]
    if rows:
        lines += ["parameters:"]
        lines += [*(f"  {name:{width}}  {row['about']}" for name, row in rows.items()), ""]
    lines.append(
        "docs/reference.md has the topics, services, actions, and parameters of every node with"
        " their defaults."
    )
    return "\n".join(lines)


def unknown_parameters(nodes: Iterable[Node]) -> list[str]:
    """Names of parameters that were given to a process, and that none of its nodes has."""
    nodes = list(nodes)
    given = {name for node in nodes for name in node._parameter_overrides}
    return sorted(name for name in given if not any(node.has_parameter(name) for node in nodes))
