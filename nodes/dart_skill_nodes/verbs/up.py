"""`dart-skill up`: the node graph, started, watched and ended in order; it stays until Ctrl-C."""

import argparse
import json
import os
import sys
import time
import webbrowser
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill.cli.run_options import (
    add_arm,
    add_model,
    add_namespace,
    check_model,
    chosen_skill,
    differences,
    folder,
    output_folder,
)
from dart_skill_nodes.comms.names import DIAGNOSTICS, in_graph, in_namespace
from dart_skill_nodes.process.environment import Interrupts, stay_on_this_machine
from dart_skill_nodes.process.graph_processes import (
    LAYOUTS,
    SIMULATED,
    START,
    TOKEN,
    Graph,
    GraphFailure,
    nodes_of,
    of_executables,
    parameters_of,
)
from dart_skill_nodes.verbs.on_graph import of_graph

if TYPE_CHECKING:
    from dart_skill_nodes.client.graph_client import GraphClient

LEVELS = {b"\x00": "ready", b"\x01": "warning", b"\x02": "error", b"\x03": "stale"}
"""Words for the levels of diagnostic_msgs/DiagnosticStatus."""
TEACH = "dart-skill teach --count 5"
LEARN = "dart-skill learn --at-least 2"
HARDWARE = "dart-skill check arm"
NEXT = {"composed": TEACH, "processes": TEACH, "hardware": HARDWARE, "replay": LEARN}
"""What to do when everything is ready."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = (
        "The node graph, started, watched and ended in order; it stays until Ctrl-C."
    )
    parser.add_argument(
        "--layout",
        choices=list(LAYOUTS),
        help="what is started (default composed; replay with --play)",
    )
    parser.add_argument(
        "--skill",
        default="",
        metavar="NAME",
        help="throw, darts, place, reach, stir, or one that is installed (default throw)",
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        help="everything random in the simulation comes from it (default 0)",
    )
    parser.add_argument("--play", type=Path, metavar="BAG", help="bag of a replay")
    parser.add_argument("--rate", type=float, help="of a replay; 0: as fast as can be (default 1)")
    parser.add_argument("--viewer", action="store_true", help="the live view, too")
    parser.add_argument(
        "--open", action="store_true", help="the live view, too, opened in the browser"
    )
    parser.add_argument(
        "--port",
        type=int,
        metavar="N",
        help="of the live view; 0: any free one (default: that of config/viewer.yaml)",
    )
    parser.add_argument(
        "--record", type=Path, metavar="FOLDER", help="every topic into a bag, too"
    )
    parser.add_argument(
        "--output",
        type=folder,
        help="folder for logs and the bag of demonstrations (default output/up_<date>)",
    )
    add_model(parser)
    add_arm(parser)
    add_namespace(parser)
    parser.add_argument("--json", action="store_true", help="each event as a line of JSON")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Start the graph and stay; returns the exit status."""
    options.viewer |= options.open
    options.layout = options.layout or ("replay" if options.play else "composed")
    if (options.layout == "replay") != bool(options.play):
        parser.error("the layout replay, and no other, needs --play BAG")
    if options.port is not None and not (options.viewer and 0 <= options.port <= 65535):
        parser.error(
            f"--port is {options.port}: it is of the live view, from 0 to 65535: give"
            " --viewer, too"
        )
    if options.rate is not None and not options.play:
        parser.error(f"--rate {options.rate:g} is of a replay: give --play BAG, or leave it out")
    options.rate = 1.0 if options.rate is None else options.rate
    if options.seed < 0 or not 0.0 <= options.rate < float("inf"):
        parser.error(
            f"--seed is {options.seed}, --rate {options.rate}: neither may be negative or infinite"
        )
    if options.skill:
        chosen_skill(parser, options.skill)
    check_model(parser, options)
    options.differs = differences(parser, options)
    options.output = output_folder(parser, options.output)
    stay_on_this_machine()
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    interrupts = Interrupts()
    rclpy.init(
        args=in_namespace(options.namespace), signal_handler_options=SignalHandlerOptions.NO
    )
    try:
        stay(options, interrupts, teller(options.json))
    except GraphFailure as failure:
        print(f"dart-skill up: {failure}", file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()
    return 0


def _run_already(nodes: set[str]) -> GraphFailure:
    return GraphFailure(
        f"{', '.join(sorted(nodes))} run already: end them, set ROS_DOMAIN_ID to another number,"
        " or give a --namespace"
    )


class Status:
    """What every node last said of itself on /diagnostics; `tell` is called with each change.
    strangers: nodes of the same names that another process started; own: the processes that were
    not.
    """

    def __init__(self, client: "GraphClient", nodes: list[str], tell):
        from diagnostic_msgs.msg import DiagnosticArray

        self._node, self.strangers, self.own, self._nodes = client.node, set(), set(), nodes
        self.silent, self._said, self._tell, self._begun = set(nodes), {}, tell, time.monotonic()
        self.page = ""  # of the live view, its whole address
        client.node.create_subscription(DiagnosticArray, DIAGNOSTICS, self._take, 50)

    def _take(self, message) -> None:
        for status in message.status:
            name = in_graph(self._node, status.name)
            if name is None:
                continue
            values = {pair.key: pair.value for pair in status.values}
            if values.get("process") not in self.own:
                self.strangers |= {name} & set(self._nodes)
            elif name in self.silent or (name in self._said and self._said[name] != status.level):
                self.silent.discard(name)
                self._said[name] = status.level
                if "address" in values:
                    self.page = page(values["address"])
                self._tell(
                    LEVELS[status.level],
                    node=name,
                    message=self.page if "address" in values else status.message,
                    seconds=round(time.monotonic() - self._begun, 1),
                )


def page(url: str) -> str:
    """The whole address of the viewer's page: its status, which everybody hears, is without the
    token.
    """
    from dart_skill.view import with_token

    return with_token(url, os.environ[TOKEN])


def executables(options: argparse.Namespace) -> dict[str, dict]:
    """What is started, and with which parameters."""
    played = str(options.play.resolve()) if options.play else ""
    wanted = {
        name: parameters_of(
            name,
            options.layout,
            options.seed,
            str(options.output / "bag"),
            played,
            options.rate,
            skill=options.skill,
        )
        for name in LAYOUTS[options.layout]
    }
    for name, parameters in of_executables(options.layout, options.differs).items():
        wanted[name] |= parameters
    if options.record:
        wanted["recorder"] = {
            "bag": str(options.record.resolve()),
            "use_sim_time": options.layout in SIMULATED,
        }
    if options.viewer:
        from dart_skill.view import new_token

        wanted["viewer"] = parameters_of("viewer", options.layout, skill=options.skill)
        wanted["viewer"] |= {} if options.port is None else {"port": options.port}
        os.environ.setdefault(TOKEN, new_token())
    return wanted


def stay(options: argparse.Namespace, interrupts: Interrupts, tell) -> None:
    """Start the graph, say which nodes are ready, and wait for the end; GraphFailure if a node
    ends by itself, or says nothing.
    """
    from dart_skill_nodes.client.graph_client import GraphClient
    from dart_skill_nodes.comms.this_machine import ENDING

    wanted = executables(options)
    with (
        Graph(options.output / "logs", namespace=options.namespace) as graph,
        closing(GraphClient(lambda: dead(graph, tell), name="up")) as client,
    ):
        until = time.monotonic() + ENDING
        while there := client.running(nodes_of(wanted)):
            if time.monotonic() > until:
                raise _run_already(there)
            client.spin()
        status = Status(client, nodes_of(wanted), tell)
        for name, parameters in wanted.items():
            graph.start(name, parameters)
            status.own.add(str(graph.processes[name].pid))
        until = time.monotonic() + START
        is_up = False
        while not interrupts:
            client.spin()
            if status.strangers and not is_up:
                raise _run_already(status.strangers)
            if status.silent and time.monotonic() > until:
                raise GraphFailure(
                    f"nothing was heard of {', '.join(sorted(status.silent))} within {START:.0f} s"
                )
            if not (status.silent or is_up):
                is_up = True
                _tell_up(client, options, graph, tell, status.page)
                if options.open and not webbrowser.open(status.page):
                    tell("note", message="no browser was found here: open the address yourself")
        tell("down", message="ending all nodes")


def _tell_up(
    client: "GraphClient", options: argparse.Namespace, graph: Graph, tell, address: str
) -> None:
    """All nodes are ready; the learner has the model that was asked for. GraphFailure where it
    refuses that. address: of the live view, empty without one.
    """
    model = f"model {client.load(options.model)}; " if options.model else ""
    then = NEXT[options.layout]
    if options.model and options.layout in SIMULATED:
        then = "dart-skill execute"
    then = of_graph(then, options.namespace)
    then += f", or open {address}" if address else ""
    tell(
        "up",
        message=f"all nodes are ready; {model}logs in {graph.logs}; Ctrl-C ends them",
        next=then,
    )


def dead(graph: Graph, tell) -> str:
    """As `Graph.dead`, but for a replay that has come to its end."""
    player = graph.processes.get("bag_player")
    if player is not None and player.poll() == 0:
        del graph.processes["bag_player"]
        tell("over", node="bag_player", message="the bag was played to its end")
    return graph.dead()


def teller(as_json: bool):
    """Prints events: a line of JSON each, or text."""

    def tell(event: str, node: str = "", message: str = "", **more) -> None:
        if as_json:
            line = json.dumps({"event": event, "node": node, "message": message, **more})
        else:
            seconds = f"{more['seconds']:6.1f} s  " if "seconds" in more else ""
            line = f"{seconds}{event:8s} {node:24s} {message}" if node else message
            line += f"\nnext: {more['next']}" if "next" in more else ""
        print(line, flush=True)

    return tell
