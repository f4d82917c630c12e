"""`dart-skill bag play`: the node bag_player with what the command line says as its parameters."""

import argparse
import json
import math
import time
from collections.abc import Callable
from pathlib import Path

from dart_skill.cli.run_options import add_namespace, remapping
from dart_skill_nodes.comms.names import in_namespace
from dart_skill_nodes.process.environment import stay_on_this_machine
from dart_skill_nodes.verbs.on_graph import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb; `player_parameters` makes the node's parameters of them."""
    parser.add_argument(
        "bag",
        metavar="BAG",
        type=Path,
        help="bag folder, with or without metadata.yaml, .mcap or .db3 file",
    )
    rate = _number("--rate", 0.0, 1e6)
    parser.add_argument(
        "--rate",
        type=rate,
        metavar="FACTOR",
        help="seconds of the bag per second; 0: as fast as can be (default 1)",
    )
    parser.add_argument(
        "--start",
        type=_number("--start", 0.0, 1e9),
        metavar="S",
        help="begin so long after the bag's first message",
    )
    parser.add_argument(
        "--duration",
        type=_number("--duration", 1e-9, 1e9),
        metavar="S",
        help="end so long after that",
    )
    parser.add_argument("--loop", action="store_true", help="begin again at the end")
    parser.add_argument(
        "--paused",
        action="store_true",
        help="wait for the services ~/pause or ~/step of bag_player",
    )
    parser.add_argument(
        "--topics",
        nargs="+",
        metavar="REGEX",
        help="only topics that one of these matches as a whole",
    )
    parser.add_argument(
        "--exclude",
        nargs="+",
        metavar="REGEX",
        help=(
            "no topic that one of these matches (default: /parameter_events, /rosout and the like)"
        ),
    )
    parser.add_argument(
        "--commands",
        action="store_true",
        help=(
            "play topics on which an arm takes commands, too; refused beside an arm that is there"
        ),
    )
    text = (
        "play the recording of a graph in this namespace, whichever it was recorded in (default:"
        " names as recorded)"
    )
    add_namespace(parser, text)
    parser.add_argument(
        "--remap",
        nargs="+",
        type=remapping,
        metavar="OLD:=NEW",
        help="publish a topic under another name",
    )
    parser.add_argument(
        "--clock",
        type=_number("--clock", 0.0, 1e4),
        metavar="HZ",
        help="rate of /clock, unless the bag has one; 0: none (default 100)",
    )
    parser.add_argument(
        "--wait-for",
        nargs="+",
        metavar="REGEX",
        help="begin when topics that one of these matches have subscribers",
    )
    parser.add_argument("--json", action="store_true", help="what was played as JSON, at the end")


def player_parameters(options: argparse.Namespace) -> dict[str, object]:
    """Parameters of the node bag_player; what was not given is left to its file."""
    given = {
        "bag": str(options.bag),
        "rate": options.rate,
        "start": options.start,
        "duration": options.duration,
        "loop": options.loop or None,
        "start_paused": options.paused or None,
        "topics": options.topics,
        "exclude": options.exclude,
        "commands": options.commands or None,
        "graph": bool(options.namespace) or None,
        "remap": options.remap,
        "clock_rate": options.clock,
        "awaited": options.wait_for,
    }
    return {name: value for name, value in given.items() if value is not None}


def _number(name: str, low: float, high: float) -> Callable[[str], float]:
    """What argparse checks a number with."""

    def number(text: str) -> float:
        value = float(text)
        if not (math.isfinite(value) and low <= value <= high):
            raise argparse.ArgumentTypeError(f"{text}: give a number from {low:g} to {high:g}")
        return value

    number.__name__ = f"{name} value"
    return number


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Play; returns the exit status."""
    stay_on_this_machine()
    from dart_skill_nodes.executables.bag_player import play

    begun = time.monotonic()
    arguments = [*_ros_arguments(player_parameters(options)), *in_namespace(options.namespace)]
    player = play(
        arguments,
        "dart-skill bag play",
        lambda state: say(f"{state} {options.bag}; Ctrl-C ends it"),
    )
    if options.json:
        took = round(time.monotonic() - begun, 3)
        print(
            json.dumps(
                {
                    **player.p,
                    "finished": player.finished,
                    "refused": player.refusal,
                    "seconds": took,
                },
                indent=1,
            )
        )
    return 1 if player.refusal else 0


def _ros_arguments(parameters: dict[str, object]) -> list[str]:
    """Parameters as ROS reads them from a command line: YAML, of which JSON is a part."""
    pairs = [("-p", f"{name}:={json.dumps(value)}") for name, value in parameters.items()]
    return ["--ros-args", *(part for pair in pairs for part in pair)]
