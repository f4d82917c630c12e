"""What is typed behind the name of a node: `--help`, and what ROS takes. The rest is refused."""

import inspect
import sys
from collections.abc import Callable, Iterable
from types import ModuleType

from rclpy.node import Node
from rclpy.utilities import remove_ros_args

from dart_skill_nodes.process.parameters import Parameter


def heed_arguments(make_nodes: Callable[[], list[Node]], program: str) -> None:
    """Print the help of a program and end it, where it is asked for; end it with status 2 and a
    line for what it does not take.

    make_nodes: of the module whose text and parameters the help has.
    """
    given = remove_ros_args(sys.argv)[1:]
    if {"-h", "--help"} & set(given):
        print(help_text(program, inspect.getmodule(make_nodes)))
        raise SystemExit(0)
    if given:
        print(
            f"{program}: '{given[0]}' is not understood: parameters are given as --ros-args -p"
            " NAME:=VALUE",
            file=sys.stderr,
        )
        raise SystemExit(2)


def help_text(program: str, module: ModuleType | None) -> str:
    """Usage, the first lines of a module, and its table of parameters."""
    about = (inspect.getdoc(module) or "").partition("\n\n")[0]
    tables = (
        [value for value in vars(module).values() if isinstance(value, list)] if module else []
    )
    rows = [row for table in tables for row in table if isinstance(row, Parameter)]
    width = max((len(row.name) for row in rows), default=0)
    lines = [
        f"usage: ros2 run dart_skill {program} [--ros-args -p NAME:=VALUE ...]",
        "",
        about,
        "",
    ]
    if rows:
        lines += ["parameters:", *(f"  {row.name:{width}}  {row.description}" for row in rows), ""]
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
