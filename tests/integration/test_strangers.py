"""The graph as a client meets it that is not ours: plain rclpy, in a world that nobody pauses, with wrong values."""

import signal
import time

import numpy as np
import pytest
from dart_skill_msgs.action import Throw
from dart_skill_msgs.srv import Reset
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from dart_skill.regions import targets_for
from dart_skill_nodes.client.failures import GraphFailure
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import LOOP

from .conftest import teach_and_learn, wait_for

SHOWN = targets_for(0, 2, 2)[0]
TARGET = (SHOWN[0] + SHOWN[1]) / 2
RESTING = 0.1
"""Joint speed below which an arm is held, not thrown with [rad/s]."""


class Stranger:
    """A plain client of /throw: sends a goal, and keeps phases, the result, and how fast the arm was meanwhile."""

    def __init__(self, client):
        self.client, self.action = client, ActionClient(client.node, Throw, "/throw")
        self.stop = client.node.create_client(Trigger, "/commander/stop")
        self.reset = client.node.create_client(Reset, "/simulation/reset")
        self.pause = client.node.create_client(SetBool, "/simulation/pause")
        self.phases, self.fastest, self.newest_ns = [], 0.0, 0
        client.node.create_subscription(JointState, "/joint_states", self._on_state, LOOP)

    def _on_state(self, message):
        self.newest_ns = conversions.stamp_ns(message.header.stamp)
        self.fastest = max(self.fastest, np.abs(message.velocity).max())

    def begin(self, stamp_ns=0):
        """A world that runs, with the ball in the hand, and a goal; its handle and the future of its result."""
        reset = Reset.Request(move_basket=True, basket=conversions.point(TARGET))
        began = self.client.call(self.reset, reset)
        wait_for(self.client, lambda: self.newest_ns >= conversions.stamp_ns(began.stamp), what="the state after the reset")
        self.phases, self.fastest = [], 0.0
        goal = Throw.Goal(target=conversions.point(TARGET))
        goal.header.stamp = conversions.time_msg(stamp_ns)
        sent = self.action.send_goal_async(goal, feedback_callback=lambda message: self.phases.append(message.feedback.phase))
        handle = self.client.wait(sent, "/throw")
        assert handle.accepted
        return handle, handle.get_result_async()

    def watch(self, seconds):
        """Let simulated time go on."""
        until = self.newest_ns + round(seconds * 1e9)
        wait_for(self.client, lambda: self.newest_ns >= until, what=f"{seconds} s of simulated time")


@pytest.fixture(scope="module")
def graph(make_shared_graph):
    graph, graph.client = make_shared_graph()
    teach_and_learn(graph.client, SHOWN)
    return graph


@pytest.fixture(scope="module")
def stranger(graph):
    return Stranger(graph.client)


@pytest.fixture
def slow_learner(graph, stranger):
    """Sends a goal, and is in the middle of its planning: the learner is held up until `go_on`."""
    learner = graph.processes["skill_learner"]

    class Held:
        def begin(self):
            learner.send_signal(signal.SIGSTOP)
            handle, result = stranger.begin()
            wait_for(graph.client, lambda: "planning" in stranger.phases, what="planning")
            stranger.watch(0.2)
            return handle, result

        def go_on(self):
            learner.send_signal(signal.SIGCONT)

    held = Held()
    yield held
    held.go_on()


def test_a_plain_goal_in_a_running_world_is_answered_when_the_ball_has_come_down(graph, stranger, slow_learner):
    """However long planning takes: the states that come meanwhile are not the end of the throw."""
    _, result = slow_learner.begin()
    assert not result.done(), "answered before there was a plan"
    slow_learner.go_on()
    outcome = graph.client.wait(result, "the throw").result
    assert (outcome.code, outcome.message) == (Throw.Goal.OUTCOME_THROWN, "thrown")
    assert outcome.outcome.landing_seen and outcome.outcome.landing_error < 0.05
    assert stranger.fastest > 1.0 and {"approaching", "throwing"} <= set(stranger.phases)
    stranger.watch(0.5)
    stranger.fastest = 0.0
    stranger.watch(1.0)
    assert stranger.fastest < RESTING, f"the arm moves at {stranger.fastest:.2f} rad/s without a goal"


def test_stop_during_planning_means_that_nothing_is_thrown(graph, stranger, slow_learner):
    _, result = slow_learner.begin()
    assert graph.client.call(stranger.stop, Trigger.Request()).success
    slow_learner.go_on()
    outcome = graph.client.wait(result, "the throw").result
    assert (outcome.code, outcome.message) == (Throw.Goal.OUTCOME_STOPPED, "stopped by ~/stop")
    stranger.watch(2.0)
    assert stranger.fastest < RESTING, f"the arm moved at {stranger.fastest:.2f} rad/s after it was stopped"


def test_a_goal_that_is_cancelled_while_it_is_planned_moves_nothing(graph, stranger, slow_learner):
    handle, result = slow_learner.begin()
    graph.client.wait(handle.cancel_goal_async(), "the cancellation")
    slow_learner.go_on()
    response = graph.client.wait(result, "the throw")
    assert response.status == 5, "GoalStatus.STATUS_CANCELED"
    assert response.result.message == "cancelled"
    stranger.watch(2.0)
    assert stranger.fastest < RESTING, f"the arm moved at {stranger.fastest:.2f} rad/s after it was cancelled"


def test_a_throw_can_be_cancelled_in_a_running_world(graph, stranger):
    handle, result = stranger.begin()
    wait_for(graph.client, lambda: "approaching" in stranger.phases, what="the approach")
    graph.client.wait(handle.cancel_goal_async(), "the cancellation")
    assert graph.client.wait(result, "the throw").result.message == "cancelled"


def test_a_goal_that_waits_for_a_state_that_never_comes_is_refused(graph, stranger):
    _, result = stranger.begin(stamp_ns=10**18)
    outcome = graph.client.wait(result, "the throw").result
    assert outcome.code == Throw.Goal.OUTCOME_REFUSED and "1000000000000000000 ns" in outcome.message
    assert stranger.fastest < RESTING


@pytest.mark.parametrize("radius", [-3.0, 0.0, float("nan"), float("inf")])
def test_a_basket_that_cannot_be_is_refused_and_ends_no_process(graph, stranger, radius):
    with pytest.raises(GraphFailure, match="basket_radius"):
        graph.client.set_parameters("/mock_optitrack", {"basket_radius": radius})
    graph.client.set_parameters("/mock_optitrack", {"basket_radius": 0.15})
    before = time.monotonic()
    stranger.watch(0.5)
    assert not graph.dead(), f"{time.monotonic() - before:.1f} s later"


def test_a_speed_that_is_not_finite_is_refused(graph, stranger):
    with pytest.raises(GraphFailure, match="speed_factor"):
        graph.client.set_parameters("/wam_simulator", {"speed_factor": float("nan")})
    stranger.watch(0.5)


@pytest.mark.parametrize("change", [{"mass_scale": [1.0]}, {"mass_scale": [-1.0] * 7}, {"joint_stiffness": [100.0] * 6 + [0.0]}])
def test_an_arm_that_cannot_be_is_refused_when_it_is_set_and_not_at_a_reset(graph, stranger, change):
    (name,) = change
    with pytest.raises(GraphFailure, match=name):
        graph.client.set_parameters("/wam_simulator", change)
    stranger.watch(0.5)
    assert not graph.dead()
