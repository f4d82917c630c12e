"""Parameters of the nodes: a row of the table in which a node says what they are, those that several
nodes share, and what may be typed behind the name of a node.
"""

import inspect
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import ModuleType

from rclpy.node import Node
from rclpy.utilities import remove_ros_args


@dataclass(frozen=True)
class Parameter:
    """One row of a node's parameter table; the value stands in config/. low and high bound
    numbers.
    """

    name: str
    description: str
    low: float | None = None
    high: float | None = None
    read_only: bool = True


LIMITS = [
    Parameter("careful_elbow", "fastest elbow where nothing is thrown [m/s]", 0.05, 10.0),
    Parameter("careful_hand", "fastest hand where nothing is thrown [m/s]", 0.05, 10.0),
    Parameter("fastest_elbow", "of a throw, and of an arm that a person guides [m/s]", 0.1, 10.0),
    Parameter(
        "fastest_hand",
        "of a throw, and of an arm that a person guides; plans beyond it are refused [m/s]",
        0.1,
        8.0,
    ),
    Parameter(
        "torque_share", "of the peak torque of a joint, gravity compensation included", 0.01, 1.5
    ),
    Parameter(
        "joint_margin",
        "to the end of a joint's range, at which a throw is stopped [rad]",
        0.0,
        0.5,
    ),
    Parameter("joint_overrun", "beyond the end of a joint's range [rad]", 0.001, 1.0),
    Parameter("workspace_low", "lower corner of the box in which the hand stays [m]"),
    Parameter("workspace_high", "its upper corner [m]"),
    Parameter("strongest_force", "wrenches of the commander are cut there [N]", 1.0, 500.0),
    Parameter("strongest_moment", "wrenches of the commander are cut there [N m]", 1.0, 200.0),
    Parameter(
        "human_force", "a person who guides a simulated arm does not push harder [N]", 1.0, 2000.0
    ),
    Parameter(
        "human_moment",
        "a person who guides a simulated arm does not turn harder [N m]",
        1.0,
        500.0,
    ),
    Parameter("warning_share", "of a limit, from which it is warned of", 0.1, 1.0),
    Parameter(
        "patience", "limits of the arm's own safety module, as shares of the commander's", 1.0, 2.0
    ),
]
"""The limits of the arm, for the nodes that enforce them."""


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
