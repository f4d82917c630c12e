"""What the verbs that run a job on a graph have in common: telling how it goes, and how a job
fails.

rclpy is imported when something runs: parsers must come at once.
"""

import argparse
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from dart_skill_nodes.comms.names import in_namespace
from dart_skill_nodes.process.environment import (
    choose_domain,
    has_own_domain,
    stay_on_this_machine,
)
from dart_skill_nodes.process.graph_processes import (
    LAYOUTS,
    NODES,
    Graph,
    GraphFailure,
    of_executables,
)

if TYPE_CHECKING:
    import numpy as np

    from dart_skill_nodes.client.graph_client import GraphClient

PATIENCE = 10.0
"""For a graph that is said to run to answer at all [s, wall clock]."""


def say(text: str) -> None:
    """A line of progress."""
    print(text, file=sys.stderr, flush=True)


def baskets(options: argparse.Namespace, stream: int) -> "np.ndarray":
    """Centres of rims (n, 3) that the options name, or over the region; stream: of random numbers.
    ValueError for a wrong number.
    """
    import numpy as np

    from dart_skill.common.regions import REGION

    if options.at is not None:
        return np.array([options.at])
    if options.count < 1 or options.seed < 0:
        raise ValueError(
            f"--count is {options.count}, --seed {options.seed}: give at least 1, and at least 0"
        )
    return REGION.spread(options.count, np.random.default_rng([options.seed, stream]))


def carried_out(job: Callable, options: argparse.Namespace, what: str):
    """job(options) with ROS running, on a domain of its own; None, and a line why, if it failed.
    KeyboardInterrupt if it was stopped.
    """
    choose_domain()
    import rclpy

    options.output.mkdir(parents=True, exist_ok=True)
    rclpy.init(args=[])
    try:
        return job(options)
    except Exception as error:
        if not rclpy.ok():  # a signal that rclpy heard first: it ends the context under the job
            raise KeyboardInterrupt from None
        if not isinstance(error, (GraphFailure, ValueError, OSError)):
            raise
        say(f"{what} failed: {error}")
        say(f"logs: {options.output / 'logs'}")
    finally:
        # a signal that rclpy hears at this very moment has shut it down already
        with suppress(RuntimeError):
            rclpy.try_shutdown()
    return None


def started(graph: Graph, options: argparse.Namespace, skill: str = "") -> "GraphClient":
    """A client of the graph, which has been started and is ready. Where others may use the ROS
    domain, nodes of before must be gone first; where none does, nodes start while this process
    imports what a client needs.
    """
    with_skill = f" with the skill {skill}" if skill else ""
    say(f"seed {options.seed}; starting {', '.join(LAYOUTS[options.layout])}{with_skill}")
    extra = of_executables(options.layout, options.differs)
    start = partial(
        graph.start_all, options.layout, options.seed, options.output / "bag", extra, skill
    )
    if alone := has_own_domain():
        start()
    import dart_skill.session  # noqa: F401  what the job needs next
    from dart_skill_nodes.client.graph_client import GraphClient

    client = GraphClient(graph.dead)
    if not alone:
        client.wait_until_gone(NODES)
        start()
    client.wait_until_ready()
    return client


def on_running_graph(
    options: argparse.Namespace,
    wait: Callable[["GraphClient"], None],
    task: Callable[["GraphClient"], dict],
) -> int:
    """Carry out a task on the graph that runs in a namespace, after waiting for what it needs, and
    print what came of it as text or as JSON; the exit status.
    """
    stay_on_this_machine()
    import json

    import rclpy

    from dart_skill_nodes.client.graph_client import GraphClient

    namespace = options.namespace
    rclpy.init(args=in_namespace(namespace))
    client = GraphClient(name="verb", appears=PATIENCE)
    try:
        try:
            wait(client)
        except GraphFailure as failure:
            raise GraphFailure(
                f"{failure}: does the graph run? 'dart-skill up' starts it, in another terminal"
            ) from failure
        result = task(client)
    except (GraphFailure, ValueError) as failure:
        print(f"dart-skill: {failure}", file=sys.stderr)
        return 1
    finally:
        client.close()
        rclpy.try_shutdown()
    text = f"{result.pop('text')}\nnext: {of_graph(result.pop('next'), namespace)}"
    print(json.dumps(result) if options.json else text)
    return 0 if result["ok"] else 1


def of_graph(command: str, namespace: str) -> str:
    """A command of `dart-skill` for the graph of a namespace."""
    return f"{command} --namespace {namespace}" if namespace else command
