#!/usr/bin/env python3
"""Makes the bags that the tests and the quick start use: 13 demonstrations and 20 throws, recorded
from this project's own graph; and of the first five demonstrations what learning needs, for the
wheel.

    source tools/env.sh && python3 tools/make_bags.py FOLDER

The recorder runs beside the graph of the main job, with the simulation's clock: the same seed
gives the same poses, states and commands.
"""

import argparse
import heapq
import signal
import sys
import time
from operator import attrgetter
from pathlib import Path
from tempfile import TemporaryDirectory

from dart_skill_nodes.process.environment import choose_domain
from dart_skill_nodes.process.graph_processes import Graph

choose_domain()

import rclpy  # noqa: E402  the domain must be chosen before rclpy starts
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402

from dart_skill.common.regions import targets_for  # noqa: E402
from dart_skill.recording import BagReader, BagWriter, definition  # noqa: E402
from dart_skill_nodes.client.graph_client import GraphClient  # noqa: E402
from dart_skill_nodes.process.graph_processes import GraphFailure  # noqa: E402
from dart_skill_nodes.verbs.trials import teach, throw_at  # noqa: E402

SEED, DEMONSTRATIONS, THROWS = 0, 13, 20
CONFIGURATION = "intervals"
"""With which the throws of the bag in this repository were learned: its poses stay what they are.
"""
HEARD = (
    "/joint_states",
    "/wam/command",
    *(f"/vrpn_mocap/{body}/pose" for body in ("hand", "ball", "basket")),
)
TOPICS = [
    *HEARD,
    "/wam/teacher_wrench",
    "/demonstrations",
    "/robot_description",
    "/commander/attractor",
    "/skill_learner/model",
]

FEW = 5
"""Demonstrations in the bag of the wheel."""
JOINTS = "/joint_states"
OTHERS = (
    *(f"/vrpn_mocap/{body}/pose" for body in ("hand", "ball", "basket")),
    "/wam/teacher_wrench",
    "/robot_description",
)
"""Topics from which throws are learned, beside the joints; the teacher's tells when the hand opens."""
THINNED_NS = 10_000_000
"""Time between two joint states in the bag of the wheel [ns]."""
PATIENCE = 30.0
"""For the recorder to hear every sensor [s, wall clock]."""


class Recording:
    """The recorder node, from when it hears every sensor until the block is left."""

    def __init__(self, graph: Graph, client: GraphClient, bag: Path, note: str):
        self._graph, self._client, self._counts = graph, client, {}
        client.node.create_subscription(DiagnosticArray, "/diagnostics", self._look, 10)
        notes = f"['seed={SEED}','what={note}']"
        wanted = {
            "bag": str(bag),
            "topics": f"[{','.join(TOPICS)}]",
            "notes": notes,
            "use_sim_time": True,
            "transform_rate": 25.0,
        }
        graph.start("recorder", wanted)

    def __enter__(self) -> None:
        until = time.monotonic() + PATIENCE
        while not all(topic in self._counts for topic in HEARD):
            self._client.spin()
            if time.monotonic() > until:
                raise GraphFailure(
                    f"the recorder does not hear {sorted(set(HEARD) - set(self._counts))}"
                )

    def __exit__(self, *failure) -> None:
        recorder = self._graph.processes.pop("recorder")
        recorder.send_signal(signal.SIGINT)
        recorder.wait()
        if lost := [
            name
            for name, count in self._counts.items()
            if name.endswith(" lost") and not name.startswith("/clock")
        ]:
            raise GraphFailure(
                f"messages were lost ({', '.join(lost)}): make the bags again when the machine has"
                " nothing else to do"
            )

    def _look(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "recorder":
                self._counts = {pair.key: pair.value for pair in status.values}


def make(folder: Path, logs: Path) -> None:
    """Record both bags into a folder."""
    shown, new = targets_for(SEED, DEMONSTRATIONS, THROWS)
    with Graph(logs) as graph:
        client = GraphClient(graph.dead)
        graph.start_all("composed", SEED, logs / "bag")
        client.wait_until_ready()
        with Recording(
            graph,
            client,
            folder / "demonstrations",
            f"{DEMONSTRATIONS} throws that a person guides",
        ):
            teach(client, SEED, DEMONSTRATIONS)
        client.learn(configuration=CONFIGURATION)
        with Recording(
            graph,
            client,
            folder / "throws",
            f"{THROWS} throws of the arm, learned from these demonstrations",
        ):
            throw_at(client, new)
        client.close()


def make_few(demonstrations: Path, few: Path) -> None:
    """Copy what learning needs of the first demonstrations, joint states at the cameras' rate."""
    with BagReader(demonstrations) as bag:
        shown = [one.stamp_ns for one in bag.messages(["/demonstrations"], decode=False)]
        how = {"stop_ns": shown[FEW - 1] + 1, "decode": False}
        streams = (
            bag.messages([JOINTS], every_ns=THINNED_NS, **how),
            bag.messages(OTHERS, **how),
        )
        with BagWriter(few, bag.custom_data, chunk_size=2**22, flush_period_ns=2**62) as copy:
            for name in (JOINTS, *OTHERS):
                topic = bag.topics[name]
                text = definition(bag.types, topic.type_name)
                copy.add_topic(name, topic.type_name, text, type_hash=topic.type_hash)
            for one in heapq.merge(*streams, key=attrgetter("stamp_ns")):
                copy.write(one.topic, one.stamp_ns, one.stamp_ns, one.data)


def main() -> int:
    """Entry point; returns the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="where the bags go; each must not exist")
    folder = parser.parse_args().folder
    rclpy.init()
    try:
        with TemporaryDirectory() as logs:
            make(folder.resolve(), Path(logs))
        make_few(folder / "demonstrations", folder / "five_demonstrations")
    except GraphFailure as failure:
        print(f"make_bags: {failure}", file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
