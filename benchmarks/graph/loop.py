#!/usr/bin/env python3
"""How fast the loop of simulator and commander goes, everything on: cameras, recorder to disk, learner. Beside it a floor in the same run.

    source tools/env.sh && python3 benchmarks/graph/loop.py --seconds 10

A step is 2 ms of the world. `session`: throws in one process without ROS. `composed`, `processes`: the layouts of
`dart-skill up`. `bare`: two nodes of rclpy in one process that answer each other over DDS with a /joint_states and a command, and do
nothing else: what the middleware alone allows.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

from dart_skill_nodes.process.discovery import choose_domain

choose_domain()

import numpy as np  # noqa: E402
import rclpy  # noqa: E402  the domain must be chosen before rclpy starts
from dart_skill_msgs.msg import WamCommand  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402

from dart_skill.session import Session, learn_throws_from_bag  # noqa: E402
from dart_skill.simulation import PlantSettings  # noqa: E402
from dart_skill.skills.throw import Throw  # noqa: E402
from dart_skill.world import joint_names  # noqa: E402
from dart_skill_nodes.comms.names import DIAGNOSTICS  # noqa: E402
from dart_skill_nodes.comms.qos import COMPLETE, LOOP  # noqa: E402
from dart_skill_nodes.process.graph_processes import SIMULATED, Graph  # noqa: E402
from dart_skill_nodes.process.node_base import make_executor  # noqa: E402

STEP = PlantSettings().step
BAG = Path(__file__).parents[2] / "bags" / "demonstrations"
TARGET = 1.9, 0.2, 0.4
"""The basket of the throws [m]."""
ASKED = {"composed": 5.0, "processes": 4.0}
"""Times real time, of an otherwise idle machine with two cores."""
TICK = os.sysconf("SC_CLK_TCK")


def processor_time(pids: list[int]) -> float:
    """Of processes so far, all threads [s]."""
    fields = [Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split() for pid in pids]
    return sum(int(one[11]) + int(one[12]) for one in fields) / TICK


def of_layout(layout: str, seconds: float) -> tuple[float, float]:
    """Steps and processor time [s] per second of the clock, by what the simulator says on /diagnostics."""
    marks: list[tuple[float, int, float]] = []
    with tempfile.TemporaryDirectory() as folder, Graph(Path(folder)) as graph:

        def take(message: DiagnosticArray) -> None:
            for status in message.status:
                steps = next((int(pair.value) for pair in status.values if pair.key == "steps"), None)
                if steps is not None:
                    pids = [process.pid for process in graph.processes.values()]
                    marks.append((time.monotonic(), steps, processor_time(pids)))

        node, executor = rclpy.create_node("clock_on_the_wall"), make_executor()
        executor.add_node(node)
        node.create_subscription(DiagnosticArray, DIAGNOSTICS, take, 50)
        awake = {"composed" if layout == "composed" else "wam_simulator": {"rest_after": 0.0}}
        graph.start_all(layout, 0, Path(folder) / "bag", awake)
        until = time.monotonic() + 60.0
        while len(marks) < 3 and time.monotonic() < until:  # the first seconds are those of starting
            executor.spin_once(timeout_sec=0.1)
            if fallen := graph.dead():
                raise SystemExit(fallen)
        if len(marks) < 3:
            raise SystemExit(f"{layout}: no simulator said on {DIAGNOSTICS} in 60 s how many steps it had made")
        begin, until = len(marks) - 1, time.monotonic() + seconds
        while time.monotonic() < until:
            executor.spin_once(timeout_sec=0.1)
        executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()
    (t0, n0, c0), (t1, n1, c1) = marks[begin], marks[-1]
    return (n1 - n0) / (t1 - t0), (c1 - c0) / (t1 - t0)


def of_session(seconds: float) -> tuple[float, float]:
    """The same of throws in one process: plant, cameras, commander, and the judging of each throw."""
    practice, _ = learn_throws_from_bag(BAG, Throw())
    plan, session = practice.learn().plan(np.array(TARGET)), Session(0)
    begun, used = time.monotonic(), time.process_time()
    while time.monotonic() < begun + seconds:
        session.throw(plan)
    passed = time.monotonic() - begun
    session.close()
    return session.steps / passed, (time.process_time() - used) / passed


def of_bare_nodes(seconds: float) -> tuple[float, float]:
    """The same of two nodes that only answer each other."""
    arm, controller, executor = rclpy.create_node("arm"), rclpy.create_node("controller"), make_executor()
    executor.add_node(arm)
    executor.add_node(controller)
    state = JointState(name=list(joint_names()))
    state.position = state.velocity = state.effort = [0.1] * len(state.name)
    states, commands, steps = arm.create_publisher(JointState, "bare/states", COMPLETE), None, [0]

    def answer(_: JointState) -> None:
        commands.publish(WamCommand())

    def go_on(_: WamCommand) -> None:
        steps[0] += 1
        states.publish(state)

    commands = controller.create_publisher(WamCommand, "bare/commands", COMPLETE)
    controller.create_subscription(JointState, "bare/states", answer, LOOP)
    arm.create_subscription(WamCommand, "bare/commands", go_on, LOOP)
    while not (states.get_subscription_count() and commands.get_subscription_count()):
        executor.spin_once(timeout_sec=0.1)
    states.publish(state)
    begun, used = time.monotonic(), time.process_time()
    while time.monotonic() < begun + seconds:
        executor.spin_once(timeout_sec=0.1)
    passed = time.monotonic() - begun
    result = steps[0] / passed, (time.process_time() - used) / passed
    for node in (arm, controller):
        executor.remove_node(node)
        node.destroy_node()
    executor.shutdown()
    return result


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0, help="of each [s]")
    parser.add_argument("--layouts", nargs="+", choices=SIMULATED, default=SIMULATED, help="that are measured")
    options = parser.parse_args()
    seconds = options.seconds
    rclpy.init()
    rows = {"bare": of_bare_nodes(seconds), "session": of_session(seconds)}
    rows |= {layout: of_layout(layout, seconds) for layout in options.layouts}
    rclpy.try_shutdown()
    print(f"{'':12}{'steps/s':>9}{'x real time':>13}{'asked':>7}{'us of a core per step':>23}")
    for name, (rate, used) in rows.items():
        asked = f"{ASKED[name]:g}" if name in ASKED else ""
        print(f"{name:12}{rate:9.0f}{rate * STEP:13.1f}{asked:>7}{1e6 * used / rate:23.0f}")


if __name__ == "__main__":
    main()
