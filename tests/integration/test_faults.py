"""What goes wrong in a graph is stopped and said: a dead learner, a cancelled throw, nonsense on a topic, an unreachable basket."""

import signal
import time

import numpy as np
import pytest
from dart_skill_msgs.msg import SimulationState, WamCommand
from dart_skill_msgs.srv import Learn, PlaceBasket, PlanThrow, Reset, Step
from geometry_msgs.msg import Point
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from dart_skill.recording import BagReader
from dart_skill.session import targets_for
from dart_skill_nodes.client.failures import GraphFailure
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import LOOP
from dart_skill_nodes.process.graph_processes import NODES

from .conftest import Diagnoses, wait_for

SLOW = {"composed": {"speed_factor": 0.4}}
SHOWN, TARGETS = targets_for(0, 2, 2)


class Joints:
    """The newest joint state."""

    def __init__(self, client):
        self.message, self.count = None, 0
        client.node.create_subscription(JointState, "/joint_states", self._take, LOOP)

    def _take(self, message):
        self.message, self.count = message, self.count + 1

    @property
    def newest_ns(self):
        return conversions.stamp_ns(self.message.header.stamp)

    @property
    def fastest(self):
        return np.abs(self.message.velocity).max()


def _taught(make_graph, extra=None):
    graph, client = make_graph("composed", 0, extra)
    for target in SHOWN:
        assert client.teach(target).success
    client.learn()
    return graph, client


def _begin_throw(client, joints):
    """A throw that is under way: the arm moves."""
    result, handle = client.start_throw(_between())

    def moves():
        assert not result.done(), result.result().result.message
        return joints.message is not None and joints.fastest > 0.3

    wait_for(client, moves, what="the arm moves")
    return result, handle


def _between():
    return (SHOWN[0] + SHOWN[1]) / 2


def test_a_learner_that_dies_during_a_throw_stops_the_arm_and_is_named(make_graph):
    graph, client = _taught(make_graph, SLOW)
    joints = Joints(client)
    result, _ = _begin_throw(client, joints)
    learner = graph.processes.pop("skill_learner")
    learner.kill()
    learner.wait()
    outcome = client.wait(result, "the throw").result
    assert outcome.code == 3, outcome.message
    assert "skill_learner" in outcome.message
    wait_for(client, lambda: joints.fastest < 0.05, what="the arm comes to rest")


def test_a_learner_that_learns_and_a_commander_that_is_held_up_stop_no_throw(make_graph):
    """Both are alive."""
    graph, client = _taught(make_graph, {"composed": {"speed_factor": 0.4, "learner_timeout": 0.3}})
    joints, learner = Joints(client), client.node.create_client(Learn, "/skill_learner/learn")
    client.reach(learner)
    result, _ = _begin_throw(client, joints)
    learned = learner.call_async(Learn.Request(configuration="em"))
    graph.processes["composed"].send_signal(signal.SIGSTOP)
    until = time.monotonic() + 0.8
    while time.monotonic() < until:
        client.spin()
    graph.processes["composed"].send_signal(signal.SIGCONT)
    outcome = client.wait(result, "the throw").result
    assert outcome.code == 1, outcome.message
    assert client.wait(learned, "learning").success


def test_a_learner_that_takes_the_place_of_a_killed_one_is_asked_not_the_ghost(make_graph):
    """A killed process stays on the graph for seconds: its services look ready, and requests to them are lost."""
    graph, client = make_graph(None)
    planner = client.node.create_client(PlanThrow, "/skill_learner/plan_throw")
    graph.start("skill_learner")
    wait_for(client, planner.service_is_ready, what="the first learner")
    killed = graph.processes.pop("skill_learner")
    killed.kill()
    killed.wait()
    graph.start("skill_learner")
    assert planner.service_is_ready(), "the ghost"
    request = PlanThrow.Request(target=conversions.point(TARGETS[0]))
    request.header.frame_id = "world"
    with pytest.raises(GraphFailure, match="nothing is learned"):
        client.call(planner, request)


def test_a_recorder_that_hears_nothing_does_not_start(make_graph, tmp_path):
    graph, client = make_graph(None)
    graph.start("demonstration_recorder", {"bag": str(tmp_path / "bag")})
    start = client.node.create_client(Trigger, "/demonstration_recorder/start")
    with pytest.raises(GraphFailure, match="nothing has come on /joint_states, .*/hand/pose, /wam/command yet"):
        client.call(start, Trigger.Request())


def test_a_recorder_that_is_held_up_loses_nothing(make_graph, tmp_path):
    """Whoever must not miss a message needs publishers that keep more than the newest ten until it has them, poses too."""
    graph, client = make_graph("processes", extra={"mock_optitrack": {"dropout_rate": 0.0}})
    periods = {"/joint_states": 2_000_000, "/wam/command": 2_000_000}
    periods |= {f"/vrpn_mocap/{body}/pose": 10_000_000 for body in ("hand", "ball", "basket")}
    joints, diagnoses, recorder = Joints(client), Diagnoses(client), graph.processes["demonstration_recorder"]

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
        return all(int(recorded.get(topic, 0)) > 2_400_000_000 // period for topic, period in periods.items())

    wait_for(client, has_caught_up, what="the recorder has everything")
    graph.stop()
    with BagReader(tmp_path / "bag_1") as bag:
        for topic, period in periods.items():
            stamps = np.unique([conversions.stamp_ns(m.data.header.stamp) for m in bag.messages([topic])])
            assert len(stamps) > 2_400_000_000 // period and set(np.diff(stamps)) == {period}, topic


def test_nodes_that_are_there_already_are_named(make_graph):
    graph, client = make_graph(None)
    graph.start("skill_learner")
    wait_for(client, lambda: "skill_learner" in client.node.get_node_names(), what="the learner")
    with pytest.raises(GraphFailure, match="skill_learner on ROS domain"):
        client.wait_until_gone(NODES, limit=0.5)


def test_a_cancelled_throw_stops_the_arm(make_graph):
    _, client = _taught(make_graph, SLOW)
    joints = Joints(client)
    result, handle = _begin_throw(client, joints)
    client.wait(handle.cancel_goal_async(), "the cancellation")
    response = client.wait(result, "the throw")
    assert response.status == 5, "GoalStatus.STATUS_CANCELED"
    assert response.result.message == "cancelled"
    wait_for(client, lambda: joints.fastest < 0.05, what="the arm comes to rest")


def test_throws_that_cannot_be_are_refused_with_a_reason(make_graph):
    _, client = make_graph("composed", 0)
    refused = client.throw(TARGETS[0])
    assert refused.code == 2 and "nothing is learned" in refused.message
    for target in SHOWN:
        assert client.teach(target).success
    client.learn()
    far = client.throw(np.array([6.0, 0.0, 0.4]))
    assert far.code == 2 and "6.00 m" in far.message
    behind = client.throw(np.array([-2.0, 0.1, 0.4]))
    assert behind.code == 2 and "degrees" in behind.message


@pytest.fixture
def simulator(make_graph):
    """The simulator alone: this test plays the commander."""
    graph, client = make_graph(None)
    graph.start("wam_simulator", {"answer_timeout": 0.5})
    state = Joints(client)
    command = client.node.create_publisher(WamCommand, "/wam/command", LOOP)
    wait_for(client, lambda: state.message is not None and command.get_subscription_count(), what="the first state")
    yield client, state, command
    client.node.destroy_publisher(command)


def _answer(client, state, command, frame="world", **fields):
    message = WamCommand(**fields)
    message.header.stamp, message.header.frame_id = state.message.header.stamp, frame
    command.publish(message)


def _stamp(state):
    return conversions.stamp_ns(state.message.header.stamp)


def test_lockstep_waits_for_the_answer_and_names_who_is_silent(simulator):
    client, state, command = simulator
    said = Diagnoses(client)
    before = _stamp(state)
    wait_for(client, lambda: "commander" in said.of.get("wam_simulator", ""), what="the simulator says who is silent")
    assert _stamp(state) == before, "time stood still"

    def steps():
        if _stamp(state) == before:
            _answer(client, state, command)
        return _stamp(state) == before + 2_000_000

    wait_for(client, steps, what="the next state")


def test_nonsense_on_the_command_topic_moves_nothing(simulator):
    client, state, command = simulator
    said, before = Diagnoses(client), _stamp(state)

    def names(word, **fields):
        """Publish again and again: a message is lost while publisher and subscriber still find each other."""
        _answer(client, state, command, **fields)
        return word in said.of.get("wam_simulator", "")

    nan = np.full(7, np.nan)
    wait_for(client, lambda: names("finite", joint_torque=nan), what="NaN is named")
    wait_for(client, lambda: names("moon", frame="moon"), what="the wrong frame is named")
    assert _stamp(state) == before
    assert np.isfinite(state.message.position).all()


def test_a_second_commander_is_reported(simulator):
    client, _, _ = simulator
    said = Diagnoses(client)
    second = client.node.create_publisher(WamCommand, "/wam/command", LOOP)
    wait_for(client, lambda: "nodes publish /wam/command" in said.of.get("wam_simulator", ""), what="the report")
    client.node.destroy_publisher(second)


def test_pause_step_and_reset(simulator):
    client, state, command = simulator
    pause = client.node.create_client(SetBool, "/simulation/pause")
    step = client.node.create_client(Step, "/simulation/step")
    reset = client.node.create_client(Reset, "/simulation/reset")
    client.call(pause, SetBool.Request(data=True))
    first = _stamp(state)
    answered = set()

    def keep_answering():
        if _stamp(state) not in answered:
            answered.add(_stamp(state))
            _answer(client, state, command)
        return False

    for _ in range(3):
        keep_answering()
        client.spin()
    assert _stamp(state) == first, "paused"
    ends = conversions.stamp_ns(client.call(step, Step.Request(steps=7)).stamp)
    wait_for(client, lambda: keep_answering() or _stamp(state) == ends, what="seven steps")
    assert ends == first + 7 * 2_000_000
    again = client.call(reset, Reset.Request(paused=True))
    assert conversions.stamp_ns(again.stamp) == ends + 1_000_000_000, "time goes on over a reset"


def test_the_basket_is_placed_and_the_hand_obeys_its_services(simulator):
    client, state, command = simulator
    truth = []
    client.node.create_subscription(SimulationState, "/simulation/state", truth.append, 10)
    basket = client.node.create_client(PlaceBasket, "/simulation/place_basket")
    opener = client.node.create_client(Trigger, "/bhand/open_grasp")
    client.call(basket, PlaceBasket.Request(position=Point(x=1.8, y=0.3, z=0.4)))
    client.call(opener, Trigger.Request())
    answered = set()

    def let_go():
        if _stamp(state) not in answered:
            answered.add(_stamp(state))
            _answer(client, state, command)
        return truth and truth[-1].ball_state == SimulationState.BALL_FREE

    wait_for(client, let_go, what="the hand lets go")
    assert truth[-1].basket.position == Point(x=1.8, y=0.3, z=0.4)
    assert truth[-1].step * 0.002 > 0.01, "the hand takes time to open"


def test_in_real_time_a_silent_commander_brakes_the_arm(make_graph):
    graph, client = make_graph(None)
    graph.start("wam_simulator", {"lockstep": False})
    state, said = Joints(client), Diagnoses(client)
    command = client.node.create_publisher(WamCommand, "/wam/command", LOOP)
    wait_for(client, lambda: state.count > 10 and command.get_subscription_count(), what="states without any answer: real time")
    push = np.array([0, 30.0, 0, 0, 0, 0, 0])
    until = time.monotonic() + 20.0
    while state.fastest < 0.3:
        assert time.monotonic() < until, f"the arm never moved faster than {state.fastest:.2f} rad/s"
        _answer(client, state, command, joint_torque=push)
        client.spin()
    wait_for(client, lambda: state.fastest < 0.05, what="the arm is braked")
    wait_for(client, lambda: "braked" in said.of.get("wam_simulator", ""), what="the simulator says so")
