#!/usr/bin/env python3
"""How fast the loop of simulator and commander goes, everything on: cameras, recorder to disk,
learner. Beside it a floor in the same run.

    source tools/env.sh && python3 -m benchmarks.graph.loop --seconds 10

A step is 2 ms of the world. `session`: throws in one process without ROS. `composed`, `processes`:
the layouts of `dart-skill up`; `alone`: `composed` without cameras and recorder. Two floors:
`bare`, two nodes of rclpy in one process that answer each other over DDS with a /joint_states and
a command, and do nothing else, is what the middleware allows; `bullet`, torques, a step of the
physics and the joints' states, is what PyBullet allows.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from dart_skill_nodes.process.environment import choose_domain

choose_domain()

import numpy as np  # noqa: E402
import rclpy  # noqa: E402  the domain must be chosen before rclpy starts
from dart_skill_msgs.msg import WamCommand  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from lifecycle_msgs.msg import Transition  # noqa: E402
from lifecycle_msgs.srv import ChangeState  # noqa: E402
from rclpy.executors import Executor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402

from benchmarks.rows import tell  # noqa: E402
from dart_skill.common.arm_choice import joint_count  # noqa: E402
from dart_skill.common.world import joint_names  # noqa: E402
from dart_skill.session import Session, learn_skill  # noqa: E402
from dart_skill.simulation import Plant, PlantSettings  # noqa: E402
from dart_skill.simulation._bullet import pybullet  # noqa: E402
from dart_skill.skills.throw import Throw  # noqa: E402
from dart_skill_nodes.comms.names import DIAGNOSTICS  # noqa: E402
from dart_skill_nodes.comms.qos import COMPLETE, LOOP  # noqa: E402
from dart_skill_nodes.process.graph_processes import SIMULATED, Graph  # noqa: E402
from dart_skill_nodes.process.node_base import make_executor  # noqa: E402

STEP = PlantSettings().step
BAG = Path(__file__).parents[2] / "bags" / "demonstrations"
TARGET = 1.9, 0.2, 0.4
"""The basket of the throws [m]."""
ASKED = {"composed": 5.0, "alone": 10.0, "processes": 4.0}
"""Times real time, of an otherwise idle machine with two cores."""
ASKED_THROWS = 10.0
"""Of a session, in a second of processor time."""
LEFT_OUT = "mock_optitrack", "demonstration_recorder"
TICK = os.sysconf("SC_CLK_TCK")


def processor_time(pids: list[int]) -> float:
    """Of processes so far, all threads [s]."""
    fields = [Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split() for pid in pids]
    return sum(int(one[11]) + int(one[12]) for one in fields) / TICK


def of_layout(layout: str, seconds: float, left_out: Sequence[str] = ()) -> tuple[float, float]:
    """Steps and processor time [s] per second of the clock, by what the simulator says on
    /diagnostics. left_out: nodes that do nothing.
    """
    marks: list[tuple[float, int, float]] = []
    with tempfile.TemporaryDirectory() as folder, Graph(Path(folder)) as graph:

        def take(message: DiagnosticArray) -> None:
            for status in message.status:
                steps = next(
                    (int(pair.value) for pair in status.values if pair.key == "steps"), None
                )
                if steps is not None:
                    pids = [process.pid for process in graph.processes.values()]
                    marks.append((time.monotonic(), steps, processor_time(pids)))

        node, executor = rclpy.create_node("clock_on_the_wall"), make_executor()
        executor.add_node(node)
        node.create_subscription(DiagnosticArray, DIAGNOSTICS, take, 50)
        awake = {"composed" if layout == "composed" else "wam_simulator": {"rest_after": 0.0}}
        graph.start_all(layout, 0, Path(folder) / "bag", awake)
        until = time.monotonic() + 60.0
        # the first seconds are those of starting
        while len(marks) < 3 and time.monotonic() < until:
            executor.spin_once(timeout_sec=0.1)
            if fallen := graph.dead():
                raise SystemExit(fallen)
        if len(marks) < 3:
            raise SystemExit(
                f"{layout}: no simulator said on {DIAGNOSTICS} in 60 s how many steps it had made"
            )
        for name in left_out:
            deactivate(node, executor, name)
        begin, until = len(marks), time.monotonic() + seconds + 1.0
        while time.monotonic() < until:
            executor.spin_once(timeout_sec=0.1)
        executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()
    (t0, n0, c0), (t1, n1, c1) = marks[begin], marks[-1]
    return (n1 - n0) / (t1 - t0), (c1 - c0) / (t1 - t0)


def deactivate(node: Node, executor: Executor, name: str) -> None:
    """A node that has a life cycle does nothing from now on."""
    client = node.create_client(ChangeState, f"/{name}/change_state")
    request = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_DEACTIVATE))
    if not client.wait_for_service(timeout_sec=10.0):
        raise SystemExit(f"{name} has no life cycle here")
    answer = client.call_async(request)
    while not answer.done():
        executor.spin_once(timeout_sec=0.1)
    if not answer.result().success:
        raise SystemExit(f"{name} cannot be made inactive")


def of_session(seconds: float) -> tuple[float, float, float]:
    """Cost of a step of throws in one process: plant, cameras, commander, and the judging of each throw;
    and throws in a second of processor time.
    """
    skill = Throw()
    learner, _ = learn_skill(BAG, skill)
    plan, session = learner.plan(skill.at(np.array(TARGET))).plan, Session(0)
    begun, used, throws = time.monotonic(), time.process_time(), 0
    while time.monotonic() < begun + seconds:
        session.throw(plan)
        throws += 1
    passed, used = time.monotonic() - begun, time.process_time() - used
    session.close()
    return session.steps / passed, used / passed, throws / used


def of_bullet(seconds: float) -> tuple[float, float]:
    """Steps and processor time [s] per second of the clock of the arm with a ball in its hand, and
    nothing beside PyBullet's own calls.
    """
    plant, joints, torques = Plant(), list(range(joint_count())), [0.0] * joint_count()
    world, arm, steps = plant._world, plant._arm, 0
    begun, used = time.monotonic(), time.process_time()
    while time.monotonic() < begun + seconds:
        world.setJointMotorControlArray(arm, joints, pybullet.TORQUE_CONTROL, forces=torques)
        world.stepSimulation()
        world.getJointStates(arm, joints)
        steps += 1
    passed, used = time.monotonic() - begun, time.process_time() - used
    plant.close()
    return steps / passed, used / passed


def of_bare_nodes(seconds: float) -> tuple[float, float]:
    """Cost of a step of two nodes that only answer each other."""
    arm, controller, executor = (
        rclpy.create_node("arm"),
        rclpy.create_node("controller"),
        make_executor(),
    )
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
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=10.0, help="of each [s]")
    parser.add_argument(
        "--layouts", nargs="+", choices=SIMULATED, default=SIMULATED, help="that are measured"
    )
    options = parser.parse_args()
    seconds = options.seconds
    rclpy.init()
    *session, throws = of_session(seconds)
    rows = {
        "bullet": of_bullet(seconds),
        "bare": of_bare_nodes(seconds),
        "session": tuple(session),
    }
    rows |= {layout: of_layout(layout, seconds) for layout in options.layouts}
    if "composed" in options.layouts:
        rows["alone"] = of_layout("composed", seconds, LEFT_OUT)
    rclpy.try_shutdown()
    print(f"{'':12}{'steps/s':>9}{'x real time':>13}{'asked':>7}{'us of a core per step':>23}")
    for name, (rate, used) in rows.items():
        report(name, rate, used, rows["bare"][0])
    print(f"session: {throws:.1f} throws in a second of processor time, asked {ASKED_THROWS:g}")
    floor = rows["bullet"][1] / rows["bullet"][0]
    beside = f"PyBullet alone {1e6 * floor:.0f} us a step"
    met = throws >= ASKED_THROWS
    tell(
        "throws in a second of a core",
        f"{throws:.1f}",
        beside,
        floor * session[0] / session[1],
        f"{ASKED_THROWS:g}",
        met,
    )


def report(name: str, rate: float, used: float, bare: float) -> None:
    """A row: steps a second, processor time [s] used in a second. bare: steps a second that the
    middleware allows.
    """
    factor, asked = rate * STEP, ASKED.get(name)
    print(
        f"{name:12}{rate:9.0f}{factor:13.1f}{f'{asked:g}' if asked else '':>7}{1e6 * used / rate:23.0f}"
    )
    if asked:
        ours, beside = f"{factor:.1f} x real time", f"middleware alone {bare * STEP:.0f} x"
        tell(
            f"graph, {name}", ours, beside, rate / bare, f"{asked:g} x real time", factor >= asked
        )


if __name__ == "__main__":
    main()
