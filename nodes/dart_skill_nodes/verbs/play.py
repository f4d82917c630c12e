"""`dart-skill bag play`: the node bag_player with what the command line says as its parameters."""

import argparse
import json
import os
import sys
import time

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")  # before rclpy starts

from dart_skill.recording.bag_command import add_play_arguments, player_parameters  # noqa: E402
from dart_skill_nodes.bag_player import BagPlayer  # noqa: E402
from dart_skill_nodes.support import run  # noqa: E402


def ros_arguments(parameters: dict) -> list[str]:
    """Parameters as ROS reads them from a command line: YAML, of which JSON is a part."""
    pairs = [("-p", f"{name}:={json.dumps(value)}") for name, value in parameters.items()]
    return ["--ros-args", *(part for pair in pairs for part in pair)]


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    parser = argparse.ArgumentParser(prog="dart-skill bag play", description=__doc__)
    add_play_arguments(parser)
    options = parser.parse_args(arguments)
    players: list[BagPlayer] = []

    def make() -> list[BagPlayer]:
        players.append(BagPlayer())
        print(f"playing {options.bag}; Ctrl-C ends it", file=sys.stderr, flush=True)
        return players

    begun = time.monotonic()
    try:
        run(make, ros_arguments(player_parameters(options)), over=lambda nodes: nodes[0].finished)
    except (ValueError, OSError) as error:
        print(f"dart-skill bag play: {error}", file=sys.stderr)
        return 1
    if options.json:
        took = round(time.monotonic() - begun, 3)
        print(json.dumps({**players[0].p, "finished": players[0].finished, "seconds": took}, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
