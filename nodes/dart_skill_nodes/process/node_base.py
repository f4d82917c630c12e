"""What all nodes share: the spin loop, parameters from config/ with their descriptions,
diagnostics.
"""

import atexit
import gc
import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from dart_skill.common.configuration import node_parameters
from dart_skill.common.world import the_world
from dart_skill_nodes.comms.in_process import exchanging, spin_once
from dart_skill_nodes.comms.names import DIAGNOSTICS, diagnostic_name, in_namespace
from dart_skill_nodes.comms.presence import be_alive
from dart_skill_nodes.comms.qos import STATUS, SYSTEM
from dart_skill_nodes.comms.refusals import GuardedLifecycleNode, GuardedNode, in_a_line
from dart_skill_nodes.process.discovery import find_log_folder, hear_loopback_alone
from dart_skill_nodes.process.parameters import Parameter, heed_arguments, unknown_parameters
from dart_skill_nodes.process.signals import Interrupts

if TYPE_CHECKING:
    from dart_skill.skills.protocol import Skill

ENDS_WITHIN = 0.1
"""Whether it was told to end, a process looks so often [s, wall clock]: not after each of
thousands of messages a second.
"""


def declare(node: Node, file: str, table: list[Parameter]) -> dict:
    """Declare a node's parameters with the values of config/`file` as defaults; returns what is in
    force.
    """
    refuse_what_is_not_finite(node)
    defaults = _defaults(file, node.get_name())
    for row in table:
        declare_row(node, row, defaults[row.name])
    return {row.name: node.get_parameter(row.name).value for row in table}


def skill_of(node: Node) -> "Skill":
    """The skill that the parameter `skill` names, with the changes of its settings that the
    parameter `skill_settings` holds, a YAML mapping.

    Raises
    ------
    ValueError
        For a skill, a setting or a part that there is not.
    """
    text = "changes of the settings of the skill, as YAML: {representation: pose}; empty: none"
    about = ParameterDescriptor(description=text, read_only=True)
    given = node.declare_parameter("skill_settings", "", about).value
    changes = yaml.safe_load(given) if given else {}
    if not isinstance(changes, dict):
        raise ValueError(f"skill_settings is '{given}': give a YAML mapping, {{components: 16}}")
    from dart_skill.skills.protocol import load_skill  # not every node knows a skill

    return load_skill(node.get_parameter("skill").value, changes=changes)


def declare_row(node: Node, row: Parameter, default) -> None:
    """Declare one parameter with its description and range."""
    node.declare_parameter(row.name, default, _descriptor(row, default))


def declare_bodies(node: Node, roles: Iterable[str]) -> dict[str, str]:
    """A parameter for the name of each tracked body, by its role in the skill; the names that are
    in force.
    """
    for role in roles:
        declare_row(
            node,
            Parameter(f"{role}_body", f"tracked body that is the {role}"),
            the_world().body(role),
        )
    return {role: node.get_parameter(f"{role}_body").value for role in roles}


def refuse_what_is_not_finite(node: Node) -> None:
    """From now on a parameter that is NaN or infinite is refused: NaN lies inside every range."""

    def check(parameters) -> SetParametersResult:
        for parameter in parameters:
            values = (
                parameter.value if isinstance(parameter.value, list | tuple) else [parameter.value]
            )
            if any(isinstance(value, float) and not math.isfinite(value) for value in values):
                return SetParametersResult(
                    successful=False,
                    reason=f"{parameter.name} = {parameter.value}: give finite numbers",
                )
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(check)


def _defaults(file: str, name: str) -> dict:
    """Defaults of a node by its name; one that was given another name has those of the file's own
    section.
    """
    try:
        return node_parameters(file, name)
    except KeyError:
        return node_parameters(file, file.removesuffix(".yaml"))


def _descriptor(row: Parameter, default) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=row.description, read_only=row.read_only)
    if row.low is not None and isinstance(default, float):
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(row.low), to_value=float(row.high))
        ]
    elif row.low is not None and isinstance(default, int) and not isinstance(default, bool):
        descriptor.integer_range = [IntegerRange(from_value=int(row.low), to_value=int(row.high))]
    return descriptor


class Diagnostics:
    """A node's status on /diagnostics, once a second of the wall clock: `describe` gives level,
    message and values.

    What the node refused of late is a warning, and the counts of all that it refused are among the
    values.
    """

    def __init__(
        self,
        node: GuardedNode | GuardedLifecycleNode,
        describe: Callable[[], tuple[bytes, str, dict]],
    ):
        self._node, self._describe = node, describe
        self._publisher = node.create_publisher(DiagnosticArray, DIAGNOSTICS, 10)
        node.create_timer(1.0, self.publish, clock=STATUS)

    def publish(self) -> None:
        level, message, values = self._describe()
        refusals = self._node.refusals
        if refusals.recent:
            level, message = max(level, WARN), f"{message}; {refusals.recent}"
        values = {
            **values,
            **{f"{place} refused": count for place, count in refusals.counts.items()},
        }
        status = DiagnosticStatus(
            level=level, name=diagnostic_name(self._node), message=message, hardware_id="wam"
        )
        status.values = [
            KeyValue(key=key, value=str(value))
            for key, value in {**values, "process": os.getpid()}.items()
        ]
        array = DiagnosticArray(status=[status])
        array.header.stamp = SYSTEM.now().to_msg()  # all nodes alike, those that follow /clock too
        self._publisher.publish(array)


OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def make_executor():
    """The EventsExecutor where this rclpy has one (several times faster), else the single-threaded
    one.
    """
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor()
    return EventsExecutor()


def run(
    make_nodes: Callable[[], list[Node]],
    args: list[str] | None = None,
    over: Callable[[list[Node]], bool] = lambda nodes: False,
    program: str = "",
) -> None:
    """Main function of every executable: start nodes, spin until told to stop, or until it is
    over, shut down in order.

    A node that cannot start ends the process with status 1 and one line, which begins with the
    name of the program.
    """
    program = program or Path(sys.argv[0]).stem
    if args is None:
        heed_arguments(make_nodes, program)
    # or the interpreter looks through all that was imported once more before it ends
    atexit.register(gc.freeze)
    hear_loopback_alone()
    find_log_folder()
    interrupts = Interrupts()
    nodes: list[Node] = []
    with exchanging() as exchange:
        try:
            nodes = _started(make_nodes, args, program)
            gc.freeze()  # what was imported stays: no later search for garbage looks through it
            gc.enable()
            executor = make_executor()
            for node in nodes:
                be_alive(node)
                executor.add_node(node)
            while rclpy.ok() and not (interrupts or over(nodes)):
                until = time.monotonic() + ENDS_WITHIN
                while time.monotonic() < until:
                    spin_once(executor, exchange, ENDS_WITHIN)
        except (KeyboardInterrupt, ExternalShutdownException):
            pass
        finally:
            for node in nodes:
                node.destroy_node()
            rclpy.try_shutdown()


@contextmanager
def node_of_command(
    name: str, namespace: str = ""
) -> Iterator[tuple[Node, Callable[[float], None]]]:
    """A node of a command, and a function that lets messages come in for a while [s]; both end with
    the context. The command ends at its own interrupts (`Interrupts`), not at those of rclpy.
    """
    rclpy.init(args=in_namespace(namespace), signal_handler_options=SignalHandlerOptions.NO)
    try:
        node, executor = rclpy.create_node(name), make_executor()
        executor.add_node(node)
        try:
            yield node, lambda seconds: executor.spin_once(timeout_sec=seconds)
        finally:
            executor.shutdown()
            node.destroy_node()
    finally:
        rclpy.try_shutdown()


def _started(
    make_nodes: Callable[[], list[Node]], args: list[str] | None, program: str
) -> list[Node]:
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        nodes = make_nodes()
        for name in unknown_parameters(nodes):
            nodes[0].get_logger().warning(
                f"there is no parameter '{name}' here: it changes nothing (--help lists them)"
            )
        return nodes
    # rclpy has its own for parameters and arguments that it does not take
    except Exception as error:
        defect = isinstance(
            error, TypeError | LookupError | AttributeError | ArithmeticError | AssertionError
        )
        text = in_a_line(error) if defect else " ".join(str(error).split())
        print(f"{program}: {text or type(error).__name__}", file=sys.stderr, flush=True)
        os._exit(1)  # nodes that had started already have threads, which would not end


def autostart(node: GuardedLifecycleNode) -> None:
    """Configure and activate a managed node at once; RuntimeError if it does not come up, instead
    of a silent node.
    """
    for trigger in (node.trigger_configure, node.trigger_activate):
        if trigger() != TransitionCallbackReturn.SUCCESS:
            raise RuntimeError(f"{node.get_name()} did not start: {node.fault}")
