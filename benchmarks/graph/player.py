#!/usr/bin/env python3
"""How punctual the bag player is beside one in rclpy's usual way: a recorded throw at rate 1.

    source tools/env.sh && python3 -m benchmarks.graph.player --seconds 10

One after the other, they play the same part of a bag to the same listener, which takes the time at
which the middleware received each message. The peer reads with rosbags, deserialises, sleeps until
a message is due, and publishes it. An error is how much later than due a message came, against the
median delay of that player: a constant delay moves nothing.
"""

import argparse
import subprocess
import sys
import time
from pathlib import Path

from dart_skill_nodes.process.environment import choose_domain

choose_domain()

import numpy as np  # noqa: E402
import rclpy  # noqa: E402  the domain must be chosen before rclpy starts
from rclpy.serialization import deserialize_message  # noqa: E402
from rosbags.highlevel import AnyReader  # noqa: E402

from dart_skill.recording import BagReader  # noqa: E402
from dart_skill_nodes.comms.qos import COMPLETE, message_class  # noqa: E402
from dart_skill_nodes.comms.raw_batches import RawBatches  # noqa: E402
from dart_skill_nodes.process.node_base import make_executor  # noqa: E402

BAG = Path(__file__).parents[2] / "bags" / "throws"
TOPICS = [
    "/joint_states",
    "/wam/command",
    *(f"/vrpn_mocap/{body}/pose" for body in ("hand", "ball", "basket")),
]


def play_as_peer(bag: Path, seconds: float) -> None:
    """Read, deserialise, sleep, publish."""
    rclpy.init()
    node = rclpy.create_node("peer")
    with AnyReader([bag]) as reader:
        connections = [one for one in reader.connections if one.topic in TOPICS]
        types = {one.topic: message_class(one.msgtype) for one in connections}
        publishers = {
            topic: node.create_publisher(name, topic, COMPLETE) for topic, name in types.items()
        }
        while any(publisher.get_subscription_count() == 0 for publisher in publishers.values()):
            time.sleep(0.05)
        start = reader.start_time
        begun = time.monotonic()
        for connection, stamp, data in reader.messages(
            connections, start=start, stop=start + round(seconds * 1e9)
        ):
            message = deserialize_message(bytes(data), types[connection.topic])
            time.sleep(max(0.0, begun + (stamp - start) * 1e-9 - time.monotonic()))
            publishers[connection.topic].publish(message)
        time.sleep(1.0)
    node.destroy_node()
    rclpy.shutdown()


def errors(command: list[str], stamps: dict[str, np.ndarray]) -> np.ndarray:
    """How much later than due the messages of a player came (n,) [s], against their median delay."""
    node, executor = rclpy.create_node("listener"), make_executor()
    executor.add_node(node)
    ears = RawBatches(node)
    for topic in TOPICS:
        ears.listen(topic)
    received = {topic: [] for topic in TOPICS}
    player = subprocess.Popen(command)
    while player.poll() is None:
        executor.spin_once(timeout_sec=0.05)
        for one in ears.take():
            received[one.topic].append(one.received_ns)
    ears.close()
    node.destroy_node()
    if player.returncode or any(len(received[topic]) != len(stamps[topic]) for topic in TOPICS):
        sys.exit(
            f"{command}: status {player.returncode},"
            f" { {topic: (len(received[topic]), len(stamps[topic])) for topic in TOPICS} }"
        )
    delays = np.concatenate([np.array(received[topic]) - stamps[topic] for topic in TOPICS])
    return (delays - np.median(delays)) * 1e-9


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--bag", type=Path, default=BAG)
    parser.add_argument("--peer", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.peer:
        return play_as_peer(options.bag, options.seconds)
    with BagReader(options.bag) as bag:
        end = bag.start_ns + round(options.seconds * 1e9)
        stamps = {
            topic: np.array(
                [m.stamp_ns for m in bag.messages([topic], bag.start_ns, end, decode=False)]
            )
            for topic in TOPICS
        }
    rclpy.init()
    played = {
        "bag": options.bag,
        "duration": options.seconds,
        "clock_rate": 0.0,
        "topics": f"[{','.join(TOPICS)}]",
    }
    played["awaited"] = played["topics"]
    played["commands"] = "true"
    own = [part for name, value in played.items() for part in ("-p", f"{name}:={value}")]
    commands = {
        "bag_player": [
            sys.executable,
            "-m",
            "dart_skill_nodes.executables.bag_player",
            "--ros-args",
            *own,
        ],
        "rclpy + rosbags": [
            sys.executable,
            __file__,
            "--peer",
            "--bag",
            str(options.bag),
            "--seconds",
            str(options.seconds),
        ],
    }
    middle = {}
    print(f"{sum(map(len, stamps.values()))} messages in {options.seconds:.0f} s")
    for name, command in commands.items():
        size = np.abs(errors(command, stamps))
        middle[name] = np.median(size)
        late = (
            f"{1e3 * np.quantile(size, 0.99):6.2f} ms at 99 % {1e3 * size.max():6.1f} ms at most"
        )
        print(f"{name:16s} {1e3 * middle[name]:6.2f} ms median error {late}")
    print(
        "median error of the player, in parts of the peer's:"
        f" {middle['bag_player'] / middle['rclpy + rosbags']:.2f}"
    )
    rclpy.shutdown()


if __name__ == "__main__":
    main()
