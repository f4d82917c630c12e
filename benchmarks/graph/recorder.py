#!/usr/bin/env python3
"""What the recorder loses and costs beside one in rclpy's usual way: joint states and commands at
500 Hz, three bodies at 100 Hz.

    source tools/env.sh && python3 -m benchmarks.graph.recorder --seconds 60

The peer subscribes to the same publishers at the same time: a raw callback for each message, and
the writer of rosbags. A publisher numbers its messages by their stamps, so that each recording is
compared with what was sent, message by message.
"""

import argparse
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from dart_skill_nodes.process.environment import choose_domain

choose_domain()

import rclpy  # noqa: E402  the domain must be chosen before rclpy starts
from rclpy.executors import ExternalShutdownException  # noqa: E402
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer  # noqa: E402

from dart_skill.recording import BagReader, serialize, types_for  # noqa: E402
from dart_skill_nodes.comms.qos import COMPLETE, message_class  # noqa: E402

POSE = "geometry_msgs/msg/PoseStamped"
"""Type of the poses."""
PERIOD_NS = 2_000_000
"""Time between two states of the arm [ns]."""
TOPICS = {
    "/joint_states": ("sensor_msgs/msg/JointState", 1),
    "/wam/command": ("dart_skill_msgs/msg/WamCommand", 1),
    **{f"/vrpn_mocap/{body}/pose": (POSE, 5) for body in ("hand", "ball", "basket")},
}
"""Type, and every how many steps of 2 ms a message is sent."""
CONTENT = {
    "sensor_msgs/msg/JointState": {
        "name": [f"wam/joint_{k}" for k in range(1, 8)],
        **{name: [0.1 * k for k in range(7)] for name in ("position", "velocity", "effort")},
    }
}


def stamp(step: int) -> int:
    """Of the message of a step [ns]; 0 is no step's."""
    return (step + 1) * PERIOD_NS


def publish(seconds: float, listeners: int) -> None:
    """Send everything, each step when it is due."""
    rclpy.init()
    node = rclpy.create_node("sender")
    sent = []
    for topic, (name, every) in TOPICS.items():
        data = bytearray(serialize(types_for(name), name, CONTENT.get(name, {})))
        sent.append((node.create_publisher(message_class(name), topic, COMPLETE), every, data))
    while any(publisher.get_subscription_count() < listeners for publisher, *_ in sent):
        time.sleep(0.05)
    begun = time.monotonic()
    for step in range(round(seconds * 1e9 / PERIOD_NS)):
        time.sleep(max(0.0, begun + step * PERIOD_NS * 1e-9 - time.monotonic()))
        for publisher, every, data in sent:
            if step % every == 0:
                struct.pack_into("<iI", data, 4, *divmod(stamp(step), 1_000_000_000))
                publisher.publish(bytes(data))
    time.sleep(4.0)  # longer than a heartbeat period: what was lost is asked for again
    node.destroy_node()
    rclpy.shutdown()


def record_as_peer(path: str) -> None:
    """A callback for each message, straight into a rosbags writer, until interrupted."""
    rclpy.init()
    node, writer = (
        rclpy.create_node("peer"),
        Writer(path, version=9, storage_plugin=StoragePlugin.MCAP),
    )
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        for topic, (name, _) in TOPICS.items():
            connection = writer.add_connection(topic, name, typestore=types_for(name))

            def write(data, connection=connection):
                writer.write(connection, time.time_ns(), data)

            node.create_subscription(message_class(name), topic, write, COMPLETE, raw=True)
        try:
            rclpy.spin(node)
        except (KeyboardInterrupt, ExternalShutdownException):
            pass


def ended(process: subprocess.Popen) -> float:
    """CPU time of a process that is told to end [s]."""
    process.send_signal(signal.SIGINT)
    return _cpu(process)


def _cpu(process: subprocess.Popen) -> float:
    _, status, usage = os.wait4(process.pid, 0)
    if process.returncode is None:
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"{process.args} ended with status {process.returncode}")
    return usage.ru_utime + usage.ru_stime


def lost(path: Path, steps: int) -> dict[str, int]:
    """How many of the messages sent are not in a bag, by topic."""
    with BagReader(path) as bag:
        missing = {}
        for topic, (_, every) in TOPICS.items():
            heard = {
                struct.unpack_from("<iI", message.data, 4)
                for message in bag.messages([topic], decode=False)
            }
            missing[topic] = sum(
                divmod(stamp(step), 1_000_000_000) not in heard for step in range(0, steps, every)
            )
    return missing


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--publish", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--peer", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.publish:
        return publish(options.seconds, 2)
    if options.peer:
        return record_as_peer(options.peer)
    with tempfile.TemporaryDirectory() as folder:
        measure(Path(folder), options.seconds)


def measure(folder: Path, seconds: float) -> None:
    """Run all three processes, and print what each recorder lost and cost."""
    topics = f"[{','.join(TOPICS)}]"
    parameters = {"bag": folder / "own", "topics": topics, "transforms": "false"}
    arguments = [part for name, value in parameters.items() for part in ("-p", f"{name}:={value}")]
    own = subprocess.Popen(
        [sys.executable, "-m", "dart_skill_nodes.executables.recorder", "--ros-args", *arguments]
    )
    peer = subprocess.Popen([sys.executable, __file__, "--peer", str(folder / "peer")])
    sender = subprocess.Popen([sys.executable, __file__, "--publish", "--seconds", str(seconds)])
    _cpu(sender)
    cost = {"recorder": ended(own), "rclpy + rosbags": ended(peer)}
    steps = round(seconds * 1e9 / PERIOD_NS)
    sent = sum(len(range(0, steps, every)) for _, every in TOPICS.values())
    print(f"{sent} messages in {seconds:.0f} s")
    for name, path in (("recorder", folder / "own"), ("rclpy + rosbags", folder / "peer")):
        missing = sum(lost(path, steps).values())
        print(
            f"{name:16s} {missing:6d} lost   {1e6 * cost[name] / sent:6.0f} us of CPU a message,"
            " start and end included"
        )
    print(
        "CPU of the recorder, in parts of the peer's:"
        f" {cost['recorder'] / cost['rclpy + rosbags']:.2f}"
    )


if __name__ == "__main__":
    main()
