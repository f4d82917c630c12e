"""Verbs that the ROS 2 nodes run: `dart-skill up`, `status`, `demo`, `practice`, `teach`,
`demonstrations`, `throw`, `learn` without a bag, `bag play`, `check arm`, `experiment faults`,
`experiment soak`.

The library knows no ROS. Each of these verbs is a module of `dart_skill_nodes.verbs` with
`add_arguments(parser)` and `main(options, parser)`, found by its name where the nodes are
installed.
"""

import argparse
import importlib
from collections.abc import Callable
from functools import partial
from types import ModuleType

HELP = {
    "up": "start the node graph, watch it, and end it with Ctrl-C",
    "status": (
        "the graph that runs, as a person reads it: nodes, rates, losses, limits, who commands;"
        " what is wrong"
    ),
    "demo": "the main job: teach, learn, throw; over real nodes, or in one process without ROS",
    "practice": "own throws over real nodes, each of which is learned from",
    "teach": "throws that a person guides, on a graph that runs",
    "demonstrations": "what a graph that runs was shown so far; drop a bad one",
    "throw": "throws of the arm, on a graph that runs",
    "execute": "trials of whatever skill a graph that runs has learned",
    "faults": (
        "inject faults into a graph (nodes, messages, disks, strangers), one by one: what the arm"
        " does, what clients hear"
    ),
    "soak": "practise for hours: does memory, speed, or anything else change?",
    "arm": "listen to the arm and its cameras: a table of what is measured and asked, go or no go",
    "play": "publish a bag's messages over ROS, as they were recorded",
}


def add_to(commands: argparse._SubParsersAction, name: str, module: str = "") -> None:
    """Add a verb with its options; where the nodes are not installed, one that takes anything, and
    says so when it runs.

    module: of `dart_skill_nodes.verbs`, if it is not called as the verb is.
    """
    parser = commands.add_parser(name, help=HELP[name])
    try:
        _module(module or name).add_arguments(parser)
    except ImportError:
        parser.description = "Its options are known where the ROS 2 nodes are installed."
        parser.set_defaults(takes_anything=True)
    parser.set_defaults(run=runner(module or name, parser))


def runner(name: str, parser: argparse.ArgumentParser) -> Callable[[argparse.Namespace], int]:
    """What runs a verb of the nodes with parsed options; returns the exit status."""
    return partial(_run, name, parser)


def _run(name: str, parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    return module_of(name, parser).main(options, parser)


def module_of(name: str, parser: argparse.ArgumentParser) -> ModuleType:
    """The nodes' module of a verb; ImportError says what to do where ROS or the nodes are not
    there.
    """
    try:
        module = _module(name)
        importlib.import_module("rclpy")
    except ImportError as error:
        command = parser.prog.removeprefix("dart-skill ")
        hint = "'make setup', then 'source tools/env.sh'"
        raise ImportError(f"{command} needs the ROS 2 workspace: {hint} ({error})") from error
    return module


def _module(name: str) -> ModuleType:
    return importlib.import_module(f"dart_skill_nodes.verbs.{name}")
