"""The simulator with a commander that this test plays: it waits, names who is silent, and takes no
nonsense.
"""

import numpy as np
import pytest
import rclpy
from dart_skill_msgs.msg import SimulationState, WamCommand
from dart_skill_msgs.srv import PlaceBody, Reset, Step
from diagnostic_msgs.msg import DiagnosticStatus
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import LATCHED, LOOP
from tests.integration.conftest import Diagnoses, Joints, answer, catch_up, wait_for


@pytest.fixture(scope="module")
def alone(make_shared_graph):
    """The simulator alone, and a publisher: these tests play the commander."""
    graph, client = make_shared_graph(None)
    graph.start("wam_simulator", {"answer_timeout": 0.5})
    state, command = Joints(client), client.node.create_publisher(WamCommand, "/wam/command", LOOP)
    wait_for(
        client,
        lambda: state.message is not None and command.get_subscription_count(),
        what="the first state",
    )
    return client, state, command


@pytest.fixture
def simulator(alone):
    """Client, newest state and publisher, in a world that runs from its beginning."""
    client, state, _ = alone
    stamp = client.call(
        client.node.create_client(Reset, "/simulation/reset"), Reset.Request()
    ).stamp
    wait_for(
        client,
        lambda: state.newest_ns == conversions.stamp_ns(stamp),
        what="the state after the reset",
    )
    return alone


def test_lockstep_waits_for_the_answer_and_names_who_is_silent(simulator):
    client, state, command = simulator
    said = Diagnoses(client)
    before = state.newest_ns
    wait_for(
        client,
        lambda: "commander" in said.of.get("wam_simulator", ""),
        what="the simulator says who is silent",
    )
    assert state.newest_ns == before, "time stood still"

    def steps():
        if state.newest_ns == before:
            answer(state, command)
        return state.newest_ns == before + 2_000_000

    wait_for(client, steps, what="the next state")


def test_who_comes_late_hears_what_holds_now_and_nothing_that_is_over(simulator):
    """`ros2 topic echo --once /simulation/held` printed the oldest of a hundred messages."""
    client, _, _ = simulator
    pause = client.node.create_client(SetBool, "/simulation/pause")
    for held in (True, False, True):
        client.call(pause, SetBool.Request(data=held))
    heard = []
    client.node.create_subscription(
        Bool, "/simulation/held", lambda message: heard.append(message.data), LATCHED
    )
    wait_for(client, lambda: heard, what="whether the world is held")
    catch_up(client, 0.5)
    assert heard == [True]


def test_nonsense_on_the_command_topic_moves_nothing(simulator):
    client, state, command = simulator
    said, before = Diagnoses(client), state.newest_ns

    def names(word, **fields):
        """Publish again and again: a message is lost while publisher and subscriber still find
        each other.
        """
        answer(state, command, **fields)
        return word in said.of.get("wam_simulator", "")

    nan = np.full(7, np.nan)
    wait_for(client, lambda: names("finite", joint_torque=nan), what="NaN is named")
    wait_for(client, lambda: names("moon", frame="moon"), what="the wrong frame is named")
    assert state.newest_ns == before
    assert np.isfinite(state.message.position).all()


def test_a_second_commander_is_named_and_not_obeyed(simulator):
    """With a command that would turn the arm; the first one goes on moving it."""
    client, state, command = simulator
    said, node = Diagnoses(client), rclpy.create_node("stranger")
    second = node.create_publisher(WamCommand, "/wam/command", LOOP)

    def is_named():
        answer(state, second, sender=7, joint_torque=np.full(7, 2.0))
        return "stranger publishes /wam/command, too" in said.of.get("wam_simulator", "")

    before = state.newest_ns
    wait_for(client, is_named, what="the report")
    assert state.newest_ns == before

    def goes_on():
        answer(state, command)
        return state.newest_ns > before

    node.destroy_node()
    wait_for(
        client,
        lambda: "stranger" not in said.of.get("wam_simulator", "stranger"),
        what="the stranger is forgotten",
    )
    wait_for(client, goes_on, what="the first one is obeyed again")


def test_a_command_that_is_too_strong_stops_the_arm_until_it_is_reset(simulator):
    """As the safety module of a real arm does: its motors are shorted, and everybody is told."""
    client, state, command = simulator
    said, safety = Diagnoses(client), []
    client.node.create_subscription(
        DiagnosticStatus, "/wam/safety", lambda message: safety.append(message), LATCHED
    )

    def is_stopped():
        answer(state, command, joint_torque=np.full(7, 1e9))
        return bool(safety) and safety[-1].level == DiagnosticStatus.ERROR

    wait_for(client, is_stopped, what="the arm is stopped")
    assert "is asked for" in safety[-1].message and joints_at_rest(state)
    wait_for(
        client, lambda: "until a reset" in said.of.get("wam_simulator", ""), what="the diagnosis"
    )
    reset = client.node.create_client(Reset, "/simulation/reset")
    assert client.call(reset, Reset.Request()).success
    wait_for(client, lambda: safety[-1].level == DiagnosticStatus.OK, what="the end of the fault")


def joints_at_rest(state):
    """Whether no joint is faster than gravity makes it in a few steps [rad/s]."""
    return np.abs(state.message.velocity).max() < 1.0


def test_pause_step_and_reset(simulator):
    client, state, command = simulator
    pause = client.node.create_client(SetBool, "/simulation/pause")
    step = client.node.create_client(Step, "/simulation/step")
    reset = client.node.create_client(Reset, "/simulation/reset")
    client.call(pause, SetBool.Request(data=True))
    first = state.newest_ns
    answered = set()

    def keep_answering():
        if state.newest_ns not in answered:
            answered.add(state.newest_ns)
            answer(state, command)
        return False

    refused = client.call(step, Step.Request(steps=2**32 - 1), may_refuse=True)
    assert not refused.success and "1 to 100000 at a time" in refused.message
    for _ in range(3):
        keep_answering()
        client.spin()
    assert state.newest_ns == first, "paused"
    ends = conversions.stamp_ns(client.call(step, Step.Request(steps=7)).stamp)
    wait_for(client, lambda: keep_answering() or state.newest_ns == ends, what="seven steps")
    assert ends == first + 7 * 2_000_000
    again = client.call(reset, Reset.Request(paused=True))
    assert conversions.stamp_ns(again.stamp) == ends + 1_000_000_000, "time goes on over a reset"


def test_the_basket_is_placed_and_the_hand_obeys_its_services(simulator):
    client, state, command = simulator
    truth = []
    client.node.create_subscription(SimulationState, "/simulation/state", truth.append, 10)
    basket = client.node.create_client(PlaceBody, "/simulation/place_body")
    opener = client.node.create_client(Trigger, "/bhand/open_grasp")
    client.call(
        basket, PlaceBody.Request(body="basket", pose=conversions.pose_at([1.8, 0.3, 0.4]))
    )
    client.call(opener, Trigger.Request())
    answered = set()

    def let_go():
        if state.newest_ns not in answered:
            answered.add(state.newest_ns)
            answer(state, command)
        return truth and truth[-1].held == ""

    wait_for(client, let_go, what="the hand lets go")
    assert conversions.state_of(truth[-1].bodies, "basket").pose == conversions.pose_at(
        [1.8, 0.3, 0.4]
    )
    assert truth[-1].step * 0.002 > 0.01, "the hand takes time to open"
