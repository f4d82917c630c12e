"""What goes wrong is stopped and said: nodes that are dead, silent, held up, or there already
(test_running_graph.py: during a throw).
"""

import signal
import time

import numpy as np
import pytest
from dart_skill_msgs.msg import SimulationState, WamCommand
from dart_skill_msgs.srv import Plan, Step
from std_srvs.srv import Trigger

from dart_skill.recording import BagReader
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import LOOP
from dart_skill_nodes.process.graph_processes import NODES, GraphFailure
from tests.integration.conftest import Diagnoses, Joints, answer, plan_request, wait_for

TARGET = np.array([1.9, 0.2, 0.4])


def test_a_learner_that_takes_the_place_of_a_killed_one_is_asked_not_the_ghost(make_graph):
    """A killed process stays on the graph for seconds: its services look ready, and requests to
    them are lost.
    """
    graph, client = make_graph(None)
    planner = client.node.create_client(Plan, "/skill_learner/plan")
    graph.start("skill_learner")
    wait_for(client, planner.service_is_ready, what="the first learner")
    killed = graph.processes.pop("skill_learner")
    killed.kill()
    killed.wait()
    graph.start("skill_learner")
    assert planner.service_is_ready(), "the ghost"
    with pytest.raises(GraphFailure, match="nothing is learned"):
        client.call(planner, plan_request(TARGET))


def test_a_recorder_that_hears_nothing_does_not_start(make_graph, tmp_path):
    graph, client = make_graph(None)
    graph.start("demonstration_recorder", {"bag": str(tmp_path / "bag")})
    start = client.node.create_client(Trigger, "/demonstration_recorder/start")
    with pytest.raises(
        GraphFailure, match="nothing has come on /joint_states, .*/hand/pose, /wam/command yet"
    ):
        client.call(start, Trigger.Request())


@pytest.mark.slow
def test_a_recorder_that_is_held_up_loses_nothing(make_graph, tmp_path):
    """Whoever must not miss a message needs publishers that keep more than the newest ten until it
    has them, poses too.
    """
    graph, client = make_graph(None)
    parameters = {
        "mock_optitrack": {"dropout_rate": 0.0},
        "demonstration_recorder": {"bag": str(tmp_path / "bag")},
    }
    parameters["wam_simulator"] = {"rest_after": 0.0}
    for executable in ("wam_simulator", "commander", "mock_optitrack", "demonstration_recorder"):
        graph.start(executable, parameters.get(executable))
    periods = {"/joint_states": 2_000_000, "/wam/command": 2_000_000}
    periods |= {f"/vrpn_mocap/{body}/pose": 10_000_000 for body in ("hand", "ball", "basket")}
    joints, diagnoses, recorder = (
        Joints(client),
        Diagnoses(client),
        graph.processes["demonstration_recorder"],
    )

    def more(count):
        until = joints.newest_ns + count * 2_000_000
        wait_for(client, lambda: joints.newest_ns >= until, what=f"{count} more states")

    wait_for(client, lambda: joints.message is not None, what="the first state")
    more(200)
    recorder.send_signal(signal.SIGSTOP)
    try:
        more(800)
    finally:
        recorder.send_signal(signal.SIGCONT)

    def has_caught_up():
        recorded = diagnoses.values.get("demonstration_recorder", {})
        return all(
            int(recorded.get(topic, 0)) > 2_400_000_000 // period
            for topic, period in periods.items()
        )

    wait_for(
        client,
        has_caught_up,
        what=lambda: f"the recorder has everything: it says {diagnoses.values}",
    )
    graph.stop()
    with BagReader(tmp_path / "bag") as bag:
        for topic, period in periods.items():
            stamps = np.unique(
                [conversions.stamp_ns(m.data.header.stamp) for m in bag.messages([topic])]
            )
            assert len(stamps) > 2_400_000_000 // period and set(np.diff(stamps)) == {period}, (
                topic
            )


def test_nodes_that_are_there_already_are_named(make_graph):
    graph, client = make_graph(None)
    graph.start("skill_learner")
    wait_for(client, lambda: "skill_learner" in client.node.get_node_names(), what="the learner")
    with pytest.raises(GraphFailure, match="skill_learner on ROS domain"):
        client.wait_until_gone(NODES, limit=0.5)


def test_a_graph_that_dds_has_not_found_yet_is_refused_as_well(make_graph, monkeypatch):
    """On a busy machine `dart-skill demo` started beside `dart-skill up`, and threw with the nodes
    of both.
    """
    graph, client = make_graph(None)
    graph.start("skill_learner")
    wait_for(client, lambda: client.running(NODES), what="the learner")
    monkeypatch.setattr("dart_skill_nodes.client.graph_client.nodes_there", lambda node: set())
    begun = time.monotonic()
    with pytest.raises(GraphFailure, match="skill_learner on ROS domain"):
        client.wait_until_gone(NODES)
    assert time.monotonic() - begun < 5.0, "its process lives: nobody waits for its lease to end"
    graph.processes["skill_learner"].kill()
    graph.processes.pop("skill_learner").wait()
    client.wait_until_gone(NODES, limit=0.0)


def test_in_real_time_a_held_world_makes_the_steps_that_are_asked_for(make_graph):
    """Who looks at the bodies before a trial asks for them; they were refused."""
    graph, client = make_graph(None)
    graph.start("wam_simulator", {"lockstep": False, "start_paused": True})
    state, step = Joints(client), client.node.create_client(Step, "/simulation/step")
    client.reach(step)
    end_ns = conversions.stamp_ns(client.call(step, Step.Request(steps=50)).stamp)
    wait_for(
        client,
        lambda: state.message is not None and state.newest_ns >= end_ns,
        what="the last step",
    )
    client.call(step, Step.Request(steps=1))
    wait_for(client, lambda: state.newest_ns > end_ns, what="one more")
    assert state.newest_ns == end_ns + 2_000_000, "and none of its own"


def test_in_real_time_a_command_opens_the_hand(make_graph):
    """The next command follows at once: it must not take this one's word away."""
    graph, client = make_graph(None)
    graph.start("wam_simulator", {"lockstep": False})
    state, truth = Joints(client), []
    client.node.create_subscription(SimulationState, "/simulation/state", truth.append, 10)
    command = client.node.create_publisher(WamCommand, "/wam/command", LOOP)
    wait_for(
        client,
        lambda: state.message is not None and command.get_subscription_count(),
        what="a state",
    )
    wait_for(client, lambda: truth and truth[-1].held == "ball", what="a ball in the hand")

    def opens():
        answer(state, command, grip=WamCommand.GRIP_OPEN)
        answer(state, command)
        return not truth[-1].held

    wait_for(client, opens, what="the hand opens")


def test_in_real_time_a_silent_commander_brakes_the_arm(make_graph):
    graph, client = make_graph(None)
    graph.start("wam_simulator", {"lockstep": False})
    state, said = Joints(client), Diagnoses(client)
    command = client.node.create_publisher(WamCommand, "/wam/command", LOOP)
    wait_for(
        client,
        lambda: state.count > 10 and command.get_subscription_count(),
        what="states without any answer: real time",
    )
    push = np.array([0, 30.0, 0, 0, 0, 0, 0])
    until = time.monotonic() + 20.0
    while state.fastest < 0.3:
        assert time.monotonic() < until, (
            f"the arm never moved faster than {state.fastest:.2f} rad/s"
        )
        answer(state, command, joint_torque=push, speed=WamCommand.SPEED_THROW)
        client.spin()
    wait_for(client, lambda: state.fastest < 0.05, what="the arm is braked")
    wait_for(
        client,
        lambda: "braked" in said.of.get("wam_simulator", ""),
        what=lambda: f"braked: {said.of}",
    )
