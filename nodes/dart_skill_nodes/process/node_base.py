"""What all nodes share: how they start, spin and end, and diagnostics."""

import atexit
import gc
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from dart_skill_nodes.comms.names import DIAGNOSTICS, diagnostic_name, in_namespace
from dart_skill_nodes.comms.presence import be_alive
from dart_skill_nodes.comms.qos import STATUS, SYSTEM
from dart_skill_nodes.comms.refusals import GuardedLifecycleNode, GuardedNode, in_a_line
from dart_skill_nodes.process.environment import Interrupts, choose_profile, find_log_folder
from dart_skill_nodes.process.parameters import heed_arguments, unknown_parameters

ENDS_WITHIN = 0.1
"""Whether it was told to end, a process looks so often [s, wall clock]: not after each of
thousands of messages a second.
"""


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


def make_executor() -> Executor:
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
    choose_profile()
    find_log_folder()
    interrupts = Interrupts()
    nodes: list[Node] = []
    try:
        nodes = _started(make_nodes, args, program)
        gc.freeze()  # what was imported stays: no later search for garbage looks through it
        gc.enable()
        executor = make_executor()
        for node in nodes:
            be_alive(node)
            executor.add_node(node)
        spin_until(executor, lambda: bool(interrupts or over(nodes)))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()


def spin_until(executor: Executor, is_over: Callable[[], bool]) -> None:
    """Let nodes work until it is over, or ROS was shut down."""
    while rclpy.ok() and not is_over():
        until = time.monotonic() + ENDS_WITHIN
        while time.monotonic() < until:
            executor.spin_once(timeout_sec=ENDS_WITHIN)


@contextmanager
def node_of_command(
    name: str, namespace: str = "", remappings: Mapping[str, str] | None = None
) -> Iterator[tuple[Node, Callable[[float], None]]]:
    """A node of a command, and a function that lets messages come in for a while [s]; both end with
    the context. The command ends at its own interrupts (`Interrupts`), not at those of rclpy.

    remappings: what topics are called instead, by name.
    """
    rules = [part for old, new in (remappings or {}).items() for part in ("-r", f"{old}:={new}")]
    args = in_namespace(namespace) + (["--ros-args", *rules] if rules else [])
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
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
