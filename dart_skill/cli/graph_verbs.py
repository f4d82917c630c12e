"""Verbs that the ROS 2 nodes run: `dart-skill up`, `status`, `demo`, `practice`, `teach`,
`demonstrations`, `throw`, `learn` without a bag, `bag play`, `check arm`; and those of a checkout's
tests: `experiment faults`, `experiment soak`.

The library knows no ROS. Each of these verbs is a module of `dart_skill_nodes.verbs` with
`add_arguments(parser)` and `main(options, parser)`, found by its name where the nodes are
installed. `experiment faults` and `experiment soak` are packages of tests/benches.
"""

import argparse
import importlib
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
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

BENCHES = ("faults", "soak")
"""Verbs of `dart-skill experiment` that only a checkout has."""
BENCH_FOLDER = "tests/benches"
"""Folder of a checkout that has them."""
CHECKOUT = Path(__file__).resolve().parents[2]
"""The folder of the library, which is a checkout unless the library was installed elsewhere."""


def add_to(commands: argparse._SubParsersAction, name: str, module: str = "") -> None:
    """Add a verb with its options; where the nodes are not installed, one that takes anything, and
    says so when it runs.

    Parameters
    ----------
    module
        Of `dart_skill_nodes.verbs`, if it is not called as the verb is.
    """
    parser = commands.add_parser(name, help=HELP[name])
    try:
        _module(module or name).add_arguments(parser)
    except ImportError:
        place = "in a checkout" if name in BENCHES else "where the ROS 2 nodes are installed"
        parser.description = f"Its options are known {place}."
        parser.set_defaults(takes_anything=True)
    parser.set_defaults(run=runner(module or name, parser))


def runner(name: str, parser: argparse.ArgumentParser) -> Callable[[argparse.Namespace], int]:
    """What runs a verb of the nodes with parsed options.

    Returns
    -------
    collections.abc.Callable[[argparse.Namespace], int]
        The exit status.
    """
    return partial(_run, name, parser)


def _run(name: str, parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    return module_of(name, parser).main(options, parser)


def module_of(name: str, parser: argparse.ArgumentParser) -> ModuleType:
    """The module of a verb.

    Raises
    ------
    ImportError
        Says what to do where ROS, the nodes or the checkout are not there.
    """
    try:
        module = _module(name)
        importlib.import_module("rclpy")
    except ImportError as error:
        command = parser.prog.removeprefix("dart-skill ")
        if name in BENCHES and not (CHECKOUT / BENCH_FOLDER / name).is_dir():
            raise ImportError(
                f"{command} needs a checkout: call the dart-skill of one ({error})"
            ) from error
        hint = "'make setup', then 'source tools/env.sh'"
        raise ImportError(f"{command} needs the ROS 2 workspace: {hint} ({error})") from error
    return module


def _module(name: str) -> ModuleType:
    if name not in BENCHES:
        return importlib.import_module(f"dart_skill_nodes.verbs.{name}")
    if not (CHECKOUT / BENCH_FOLDER / name).is_dir():
        raise ImportError(f"{CHECKOUT} has no {BENCH_FOLDER}/{name}")
    if str(CHECKOUT) not in sys.path:
        sys.path.append(str(CHECKOUT))
    return importlib.import_module(f"{BENCH_FOLDER.replace('/', '.')}.{name}")
