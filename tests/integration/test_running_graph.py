"""One graph for many: what it refuses before it has learned, and what it does, and stops,
afterwards.
"""

import json
import signal
import subprocess
import time

import numpy as np
import pytest
from dart_skill_msgs.action import Execute, Teach
from dart_skill_msgs.msg import SimulationState, WamCommand
from dart_skill_msgs.srv import Learn, PlaceBody, Reset
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from std_srvs.srv import SetBool, Trigger

from dart_skill.common.configuration import load_yaml
from dart_skill.common.regions import targets_for
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import LOOP
from dart_skill_nodes.process.graph_processes import NODES, GraphFailure
from dart_skill_nodes.verbs.trials import throw_at
from tests.integration.conftest import (
    Diagnoses,
    Joints,
    begin_slow_throw,
    catch_up,
    teach_and_learn,
    wait_for,
)

SEED = 1
SHOWN, (TARGET,) = targets_for(SEED, 2, 1)
BETWEEN = (SHOWN[0] + SHOWN[1]) / 2


@pytest.fixture(scope="module")
def graph(make_shared_graph):
    """The graph and its client."""
    return make_shared_graph("composed", SEED)


@pytest.fixture(scope="module")
def quiet(graph):
    """The same, in a world that rests after a second, not after ten: nobody looks at what it does
    meanwhile.
    """
    graph[1].set_parameters("/wam_simulator", {"rest_after": 1.0})
    return graph


@pytest.fixture(scope="module")
def taught(quiet):
    """The same, from when it has learned on: what needs a graph that has not stands above."""
    teach_and_learn(quiet[1], SHOWN)
    return quiet


@pytest.fixture
def client(taught):
    """Its client; afterwards the simulator is as fast as it can again, and the model that of the
    lessons.
    """
    yield taught[1]
    taught[1].set_parameters("/wam_simulator", {"speed_factor": 0.0})
    taught[1].learn()


def status(client, *arguments):
    """Exit status and output of `dart-skill status`, while the client goes on; asked again where a
    busy machine has found nobody yet.
    """
    command = ["dart-skill", "status", *arguments]
    for _ in range(5):
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        wait_for(client, lambda process=process: process.poll() is not None, what="the status")
        said, complaint = process.communicate()
        if "nothing runs in ROS domain" not in complaint:
            break
    assert complaint == "", complaint
    return process.returncode, said


def test_a_world_of_which_nobody_has_asked_anything_rests_soon(graph):
    """First: what comes later asks. Each graph made 5000 steps at its start for nobody."""
    _, client = graph
    said = Diagnoses(client)
    wait_for(
        client,
        lambda: "resting: 20 states a second" in said.of.get("wam_simulator", ""),
        what=lambda: f"it rests, not '{said.of.get('wam_simulator')}',",
    )
    assert int(said.values["wam_simulator"]["steps"]) < 2500, said.values["wam_simulator"]


@pytest.mark.parametrize("what", ("a basket that is moved", "a hand that opens"))
def test_a_world_that_rests_goes_on_when_something_is_done_in_it(quiet, what):
    """It stood still for good: who dragged the basket on the page saw nothing, and `dart-skill
    status` no message of any kind.
    """
    _, client = quiet
    said, heard = Diagnoses(client), []
    watching = client.node.create_subscription(
        SimulationState, "/simulation/state", heard.append, 10
    )
    wait_for(
        client,
        lambda: "resting: 20 states a second" in said.of.get("wam_simulator", ""),
        what=lambda: f"it rests, not '{said.of.get('wam_simulator')}',",
    )
    if what == "a hand that opens":
        client.call(client.node.create_client(Trigger, "/bhand/open_grasp"), Trigger.Request())
    else:
        request = PlaceBody.Request(body="basket", pose=conversions.pose_at(BETWEEN))
        client.call(client.node.create_client(PlaceBody, "/simulation/place_body"), request)
    heard.clear()
    wait_for(client, lambda: len(heard) > 20, what="a world that goes on")
    if what == "a basket that is moved":
        there = conversions.vector(conversions.state_of(heard[-1].bodies, "basket").pose.position)
        assert there == pytest.approx(BETWEEN, abs=1e-6)
    client.node.destroy_subscription(watching)


def test_the_status_of_a_graph_that_is_well(quiet):
    code, said = status(quiet[1], "--json")
    told = json.loads(said)
    assert (code, told["ok"], told["problems"], told["commanders"]) == (
        0,
        True,
        [],
        ["commander"],
    ), said
    assert {node["name"] for node in told["nodes"]} == set(NODES)
    topics = {topic["topic"]: topic for topic in told["topics"]}
    assert topics["/joint_states"]["rate"] > 1.0 and topics["/joint_states"]["lost"] == 0
    limits = load_yaml("limits.yaml")["/**"]["ros__parameters"]
    assert told["limits"] == {"commander": limits, "wam_simulator": limits} and told["safety"] == [
        "ready",
        "",
    ]


def test_the_status_names_a_second_commander(quiet):
    _, client = quiet
    stranger = client.node.create_publisher(WamCommand, "/wam/command", 10)
    # on a machine that stalls for seconds a part of the graph is found late
    code, said = status(client, "--duration", "8")
    client.node.destroy_publisher(stranger)
    assert (
        code == 1
        and "wrong: coach_0 and commander command the arm (/wam/command): end one" in said
    ), said


def test_before_anything_is_learned_throws_and_practice_say_so(graph):
    refused, practised = graph[1].throw(TARGET), graph[1].practise(3)
    assert refused.code == 2 and "nothing is learned" in refused.message
    assert not practised.success and "nothing is learned yet" in practised.message


def test_a_throw_that_was_refused_is_told_as_none(graph, capsys):
    """It was called out, with a landing that was not seen."""
    [result] = throw_at(graph[1], [TARGET])
    assert "no throw: nothing is learned yet" in capsys.readouterr().err and not result.success


def test_the_simulated_arm_changes_with_the_next_reset(graph):
    _, client = graph
    seen = []
    watching = client.node.create_subscription(
        SimulationState, "/simulation/state", seen.append, 10
    )
    reset = client.node.create_client(Reset, "/simulation/reset")

    def hand():
        episode = client.call(reset, Reset.Request(paused=True)).episode
        wait_for(
            client, lambda: seen and seen[-1].episode == episode, what="the state after the reset"
        )
        return conversions.vector(
            conversions.state_of(seen[-1].bodies, "hand").pose.position
        ), seen[-1].base_turn

    straight, turn = hand()
    assert turn == 0.0
    client.set_parameters("/wam_simulator", {"base_turn": 0.1})
    turned, turn = hand()
    assert turn == 0.1
    azimuths = [np.arctan2(position[1], position[0]) for position in (straight, turned)]
    assert np.angle(np.exp(1j * (azimuths[1] - azimuths[0]))) == pytest.approx(0.1, abs=1e-6)
    with pytest.raises(GraphFailure, match="does not take base_turn = 5.0"):
        client.set_parameters("/wam_simulator", {"base_turn": 5.0})
    client.set_parameters("/wam_simulator", {"base_turn": 0.0})
    assert hand()[1] == 0.0
    client.node.destroy_subscription(watching)


@pytest.mark.slow
def test_the_coach_chooses_baskets_by_itself(client):
    said = []
    result = client.practise(2, on_feedback=lambda feedback: said.append(feedback.phase))
    assert result.success and result.executed == 2, result.message
    distances = [
        np.hypot(*conversions.target_of(outcome.situation)[:2]) for outcome in result.outcomes
    ]
    assert all(1.5 <= distance <= 2.5 for distance in distances)
    assert said == ["resetting", "executing", "learning", "done"] * 2


def test_throws_follow_a_basket_that_somebody_moves_while_the_arm_returns(client):
    places = [np.array([1.8, 0.1, 0.4]), np.array([2.0, -0.3, 0.4])]
    move = client.node.create_client(PlaceBody, "/simulation/place_body")
    client.call(move, PlaceBody.Request(body="basket", pose=conversions.pose_at(places[0])))

    def on_feedback(feedback):
        if (feedback.number, feedback.phase) == (1, "learning"):
            move.call_async(PlaceBody.Request(body="basket", pose=conversions.pose_at(places[1])))

    result = client.practise(2, follow_basket=True, on_feedback=on_feedback)
    assert result.executed == 2, result.message
    aimed = np.array([conversions.target_of(outcome.situation) for outcome in result.outcomes])
    np.testing.assert_allclose(aimed, places, atol=0.003)
    assert [outcome.success for outcome in result.outcomes] == [True, True]


def test_throws_that_cannot_be_are_refused_with_a_reason(client):
    far = client.throw(np.array([6.0, 0.0, 0.4]))
    assert far.code == 2 and "6.00 m" in far.message
    behind = client.throw(np.array([-2.0, 0.1, 0.4]))
    assert behind.code == 2 and "degrees" in behind.message


@pytest.mark.parametrize("body", ["Basket", "bucket"])
def test_a_throw_at_a_body_that_there_is_not_is_no_throw_at_the_basket(client, body):
    action = ActionClient(client.node, Execute, "/execute")
    wait_for(client, action.server_is_ready, what="the commander")
    goal = Execute.Goal(situation=conversions.at_place(TARGET, body))
    handle = client.wait(action.send_goal_async(goal), "/execute")
    result = client.wait(handle.get_result_async(), "the result").result
    action.destroy()
    assert result.code == Execute.Goal.OUTCOME_REFUSED
    assert (
        f"names the body '{body}', which 'throw' does not have: it has only hand, ball, basket"
        in result.message
    ), result.message


def test_the_result_of_a_throw_is_asked_for_once(client, monkeypatch):
    """It holds the whole plan: to send, and to decode, it takes as long as to plan."""
    asked, ask = [], ClientGoalHandle.get_result_async
    monkeypatch.setattr(
        ClientGoalHandle, "get_result_async", lambda handle: asked.append(handle) or ask(handle)
    )
    assert client.throw(np.array([6.0, 0.0, 0.4])).code == 2
    assert len(asked) == 1


def test_a_goal_in_a_world_that_somebody_holds_says_what_lets_it_run(client):
    """As a lesson leaves it, where `ros2 action send_goal` waited without a word."""
    pause, phases = client.node.create_client(SetBool, "/simulation/pause"), []
    execute = ActionClient(client.node, Execute, "/execute")
    goal = Execute.Goal(situation=conversions.at_place(BETWEEN))
    client.call(
        client.node.create_client(Reset, "/simulation/reset"),
        Reset.Request(paused=True, situation=goal.situation),
    )
    wait_for(client, execute.server_is_ready, what="the action")
    handle = client.wait(
        execute.send_goal_async(goal, lambda message: phases.append(message.feedback.phase)),
        "the goal",
    )
    result = handle.get_result_async()
    wait_for(client, lambda: "held" in phases, what="who waits is told")
    assert not result.done() and phases[-2:] == ["armed", "held"]
    client.call(pause, SetBool.Request(data=False))
    assert client.wait(result, "the throw").result.outcome.success
    client.call(
        client.node.create_client(Reset, "/simulation/reset"),
        Reset.Request(paused=True, situation=goal.situation),
    )
    handle = client.wait(execute.send_goal_async(goal), "the goal")
    ended = client.wait(handle.get_result_async(), "the end of a goal that nobody lets begin")
    assert ended.result.code == Execute.Goal.OUTCOME_STOPPED
    assert "the simulated world is held: /simulation/pause" in ended.result.message


def test_a_lesson_that_is_refused_changes_nothing(client):
    """It left the world paused, where the next goal waited for ever."""
    resets = []
    client.node.create_subscription(
        SimulationState, "/simulation/state", lambda state: resets.append(state.episode), LOOP
    )
    client.call(client.node.create_client(Reset, "/simulation/reset"), Reset.Request())
    catch_up(client, 0.3)
    teach = Teach.Goal(situation=conversions.at_place(np.array([np.nan, 0.0, 0.4])))
    handle = client.wait(client.teach_action.send_goal_async(teach), "/teach")
    refused = client.wait(handle.get_result_async(), "the lesson").result
    assert not refused.success and refused.message
    last = resets[-1]
    wait_for(client, lambda: resets[-20:] == [last] * 20, what="a world that goes on as it was")
    assert client.throw(BETWEEN).outcome.success


def test_lessons_without_a_situation_are_each_somewhere_else(client):
    """`ros2 action send_goal /teach ... "{}"` was refused: the situation said where nothing is."""
    baskets = []
    for _ in range(2):
        handle = client.wait(client.teach_action.send_goal_async(Teach.Goal()), "/teach")
        result = client.wait(handle.get_result_async(), "the lesson").result
        assert result.success, result.message
        baskets.append(conversions.target_of(result.outcome.situation))
    assert np.linalg.norm(baskets[1] - baskets[0]) > 0.05


def test_a_cancelled_throw_stops_the_arm(client):
    joints = Joints(client)
    result, handle = begin_slow_throw(client, joints, BETWEEN)
    client.wait(handle.cancel_goal_async(), "the cancellation")
    response = client.wait(result, "the throw")
    assert response.status == 5, "GoalStatus.STATUS_CANCELED"
    assert response.result.message == "cancelled"
    wait_for(client, lambda: joints.fastest < 0.05, what="the arm comes to rest")


def test_what_is_learned_with_can_be_changed_while_the_learner_runs(client):
    usual = client.learn()
    client.set_parameters(
        "/skill_learner", {"components": 8, "stiffness": 300.0, "most_stiffness": 800.0}
    )
    try:
        client.set_parameters("/skill_learner", {"least_stiffness": 50.0})
        other = client.learn()
        assert (
            other.model_id != usual.model_id
            and "with components 8, stiffness 300.0, stiffness_range (50.0, 800.0)"
            in other.message
        )
        with pytest.raises(GraphFailure, match="stiffness_range"):
            client.set_parameters("/skill_learner", {"least_stiffness": 900.0})
        with pytest.raises(GraphFailure, match="frames 'cup' are unknown"):
            client.set_parameters("/skill_learner", {"frames": "cup"})
        with pytest.raises(GraphFailure, match="choose_components is 'aic'"):
            client.set_parameters("/skill_learner", {"choose_components": "aic"})
        client.set_parameters("/skill_learner", {"choose_components": "bic"})
        assert " by bic" in client.learn().message
    finally:
        usually = {
            "components": 0,
            "choose_components": "",
            "stiffness": 0.0,
            "most_stiffness": 0.0,
            "least_stiffness": 0.0,
        }
        client.set_parameters("/skill_learner", usually)
    assert client.learn().model_id == usual.model_id


@pytest.mark.slow
def test_a_learner_that_learns_and_a_commander_that_is_held_up_stop_no_throw(taught, client):
    """Both are alive, and silent for longer than the commander waits for a learner."""
    learner = client.node.create_client(Learn, "/skill_learner/learn")
    client.reach(learner)
    result, _ = begin_slow_throw(client, Joints(client), BETWEEN)
    learned = learner.call_async(Learn.Request(configuration="em"))
    composed = taught[0].processes["composed"]
    composed.send_signal(signal.SIGSTOP)
    until = time.monotonic() + 2.5
    while time.monotonic() < until:
        client.spin()
    composed.send_signal(signal.SIGCONT)
    outcome = client.wait(result, "the throw").result
    assert outcome.code == 1, outcome.message
    assert client.wait(learned, "learning").success


def test_a_learner_that_dies_during_a_throw_stops_the_arm_and_is_named(taught):
    """The last test of this graph: it has no learner any more."""
    graph, client = taught
    joints = Joints(client)
    # a dead node is missed after 4 s
    result, _ = begin_slow_throw(client, joints, BETWEEN, speed_factor=0.15)
    learner = graph.processes.pop("skill_learner")
    learner.kill()
    learner.wait()
    outcome = client.wait(result, "the throw").result
    assert outcome.code == 3, outcome.message
    assert "skill_learner" in outcome.message
    wait_for(client, lambda: joints.fastest < 0.05, what="the arm comes to rest")
    code, said = status(client)
    assert code == 1 and "wrong: no skill_learner: " in said, said
