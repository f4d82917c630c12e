"""The graph as a client meets it that is not ours: plain rclpy, in a world that nobody pauses,
with wrong values.
"""

import re
import signal
import time

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Execute, Teach
from dart_skill_msgs.msg import Demonstration, SimulationState, WamCommand
from dart_skill_msgs.msg import Plan as PlanMsg
from dart_skill_msgs.srv import AddTrial, Look, Plan, Reset
from geometry_msgs.msg import Point, Pose, PoseStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.action import ActionClient
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from dart_skill.common.regions import targets_for
from dart_skill.common.world import joint_names, pose_topic
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import LOOP
from dart_skill_nodes.comms.tracked_bodies import REPAIRED
from dart_skill_nodes.process.graph_processes import GraphFailure
from tests.integration.conftest import (
    Diagnoses,
    Joints,
    begin_slow_throw,
    teach_and_learn,
    wait_for,
)

SHOWN = targets_for(0, 2, 2)[0]
TARGET = (SHOWN[0] + SHOWN[1]) / 2
LONGEST = 1.0
"""That a test watches the world for [s, simulated]: a world that runs on while nobody looks only
costs.
"""
RESTING = 0.1
"""Joint speed below which an arm is held, not thrown with [rad/s]."""


class Stranger:
    """A plain client of /execute: sends a goal, and keeps phases, the result, and how fast the arm
    was meanwhile.
    """

    def __init__(self, client):
        self.client, self.action = client, ActionClient(client.node, Execute, "/execute")
        self.stop = client.node.create_client(Trigger, "/commander/stop")
        self.reset = client.node.create_client(Reset, "/simulation/reset")
        self.pause = client.node.create_client(SetBool, "/simulation/pause")
        self.phases, self.fastest, self.newest_ns = [], 0.0, 0
        client.node.create_subscription(JointState, "/joint_states", self._on_state, LOOP)

    def _on_state(self, message):
        self.newest_ns = conversions.stamp_ns(message.header.stamp)
        self.fastest = max(self.fastest, np.abs(message.velocity).max())

    def begin(self, stamp_ns=0):
        """A world that runs, with the ball in the hand, and a goal; its handle and the future of
        its result.
        """
        reset = Reset.Request(situation=conversions.at_place(TARGET))
        began = self.client.call(self.reset, reset)
        wait_for(
            self.client,
            lambda: self.newest_ns >= conversions.stamp_ns(began.stamp),
            what="the state after the reset",
        )
        self.phases, self.fastest = [], 0.0
        goal = Execute.Goal(situation=conversions.at_place(TARGET))
        goal.header.stamp = conversions.time_msg(stamp_ns)
        sent = self.action.send_goal_async(
            goal, feedback_callback=lambda message: self.phases.append(message.feedback.phase)
        )
        handle = self.client.wait(sent, "/execute")
        assert handle.accepted
        return handle, handle.get_result_async()

    def free(self):
        """An arm that was stopped may move again."""
        self.client.call(
            self.client.node.create_client(Trigger, "/commander/reset"), Trigger.Request()
        )

    def watch(self, seconds):
        """Let simulated time go on, at full speed where the world rests: nobody waits for it
        there.
        """
        self.client.call(self.pause, SetBool.Request(data=False))
        until = self.newest_ns + round(seconds * 1e9)
        wait_for(
            self.client, lambda: self.newest_ns >= until, what=f"{seconds} s of simulated time"
        )


@pytest.fixture(scope="module")
def graph(make_shared_graph):
    graph, graph.client = make_shared_graph(extra={"composed": {"rest_after": LONGEST + 0.2}})
    teach_and_learn(graph.client, SHOWN)
    return graph


@pytest.fixture(scope="module")
def stranger(graph):
    return Stranger(graph.client)


@pytest.fixture(scope="module")
def calm(stranger):
    """From then on the world rests earlier: nobody watches it for more than half a second."""
    stranger.client.set_parameters("/wam_simulator", {"rest_after": 0.7})


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


def test_a_plain_goal_in_a_running_world_is_answered_when_the_ball_has_come_down(
    graph, stranger, slow_learner
):
    """However long planning takes: the states that come meanwhile are not the end of the throw."""
    _, result = slow_learner.begin()
    assert not result.done(), "answered before there was a plan"
    slow_learner.go_on()
    outcome = graph.client.wait(result, "the throw").result
    assert (outcome.code, outcome.message) == (Execute.Goal.OUTCOME_EXECUTED, "executed")
    assert outcome.outcome.seen and outcome.outcome.error < 0.05
    assert stranger.fastest > 1.0 and {"approaching", "executing"} <= set(stranger.phases)
    stranger.watch(0.5)
    stranger.fastest = 0.0
    stranger.watch(1.0)
    assert stranger.fastest < RESTING, (
        f"the arm moves at {stranger.fastest:.2f} rad/s without a goal"
    )


def test_a_goal_that_says_nothing_is_thrown_at_the_basket_that_the_cameras_see(graph, stranger):
    """As `ros2 action send_goal /execute dart_skill_msgs/action/Execute`."""
    client = graph.client
    began = client.call(stranger.reset, Reset.Request(situation=conversions.at_place(TARGET)))
    wait_for(
        client,
        lambda: stranger.newest_ns >= conversions.stamp_ns(began.stamp),
        what="the state after the reset",
    )
    stranger.watch(0.2)
    handle = client.wait(stranger.action.send_goal_async(Execute.Goal()), "/execute")
    result = client.wait(handle.get_result_async(), "the throw").result
    assert result.code == Execute.Goal.OUTCOME_EXECUTED, result.message
    assert conversions.target_of(result.outcome.situation) == pytest.approx(TARGET, abs=2e-3)
    assert result.outcome.seen and result.outcome.error < 0.05


def test_a_goal_is_told_of_an_empty_hand_and_refused_where_no_poses_come(graph, stranger):
    """Both were executed, and nothing was said of what had come of them."""
    client = graph.client
    _, result = stranger.begin()
    assert client.wait(result, "/execute").result.outcome.success
    sent = stranger.action.send_goal_async(Execute.Goal(situation=conversions.at_place(TARGET)))
    result = client.wait(sent, "/execute").get_result_async()
    outcome = client.wait(result, "/execute").result.outcome
    assert not outcome.seen and "the ball was not in the hand" in outcome.message
    cameras = client.node.create_client(ChangeState, "/mock_optitrack/change_state")
    client.call(cameras, change_state(Transition.TRANSITION_DEACTIVATE))
    try:
        stranger.watch(1.1)
        until = time.monotonic() + REPAIRED
        wait_for(client, lambda: time.monotonic() > until, what="the patience for late poses")
        sent = stranger.action.send_goal_async(Execute.Goal())
        refused = client.wait(client.wait(sent, "/execute").get_result_async(), "/execute").result
    finally:
        client.call(cameras, change_state(Transition.TRANSITION_ACTIVATE))
        look = client.node.create_client(Look, "/demonstration_recorder/look")
        wait_for(
            client,
            lambda: client.call(look, Look.Request(), may_refuse=True).success,
            what="poses again",
        )
    assert refused.code == Execute.Goal.OUTCOME_REFUSED
    assert "no cameras: no pose has come for" in refused.message


def change_state(transition):
    return ChangeState.Request(transition=Transition(id=transition))


def test_stop_during_planning_means_that_nothing_is_thrown(graph, stranger, slow_learner):
    _, result = slow_learner.begin()
    assert graph.client.call(stranger.stop, Trigger.Request()).success
    slow_learner.go_on()
    outcome = graph.client.wait(result, "the throw").result
    assert (outcome.code, outcome.message) == (Execute.Goal.OUTCOME_STOPPED, "stopped by ~/stop")
    stranger.watch(LONGEST)
    stranger.free()
    assert stranger.fastest < RESTING, (
        f"the arm moved at {stranger.fastest:.2f} rad/s after it was stopped"
    )


def test_an_arm_that_was_stopped_stays_so_until_it_is_reset(graph, stranger):
    client, said = graph.client, Diagnoses(graph.client)
    client.call(stranger.stop, Trigger.Request())
    _, result = stranger.begin()
    refused = client.wait(result, "the throw").result
    assert (
        refused.code == Execute.Goal.OUTCOME_REFUSED and "call /commander/reset" in refused.message
    )
    practised = client.practise(targets=[TARGET, TARGET])
    assert not practised.success and "/commander/reset" in practised.message
    wait_for(
        client,
        lambda: "stopped by ~/stop: call /commander/reset" in said.of.get("commander", ""),
        what="the reason on /diagnostics",
    )
    assert stranger.fastest < RESTING
    stranger.free()
    assert client.throw(TARGET).code == Execute.Goal.OUTCOME_EXECUTED


def test_a_released_arm_does_not_throw(graph, stranger):
    graph.client.release_arm(True)
    _, result = stranger.begin()
    refused = graph.client.wait(result, "the throw").result
    graph.client.release_arm(False)
    assert refused.code == Execute.Goal.OUTCOME_REFUSED and "released" in refused.message


def test_stop_ends_practice(graph, stranger):
    client, asked = graph.client, []

    def on_feedback(feedback):
        if feedback.phase == "executing" and not asked:
            asked.append(stranger.stop.call_async(Trigger.Request()))

    practised = client.practise(targets=[TARGET] * 3, only_throw=True, on_feedback=on_feedback)
    assert not practised.success and "stopped" in practised.message
    assert len(practised.outcomes) <= 1, "it went on to the next throw"
    stranger.free()


def hearers(node, topic):
    return {one.node_name for one in node.get_subscriptions_info_by_topic(topic)}


@pytest.mark.parametrize("how", ["stop", "cancel"])
def test_a_lesson_ends_at_once_when_it_is_stopped_or_cancelled(graph, stranger, how):
    client = graph.client
    teach = ActionClient(client.node, Teach, "/teach")
    wait_for(client, teach.server_is_ready, what="the teacher")
    # a swing that takes longer than the word that ends it, however busy the machine is
    client.set_parameters("/wam_simulator", {"speed_factor": 0.2})
    wait_for(
        client,
        lambda: "teacher" not in hearers(client.node, "/joint_states"),
        what="a teacher who rests",
    )
    handle = client.wait(
        teach.send_goal_async(Teach.Goal(situation=conversions.at_place(SHOWN[0]))), "/teach"
    )
    ended, stranger.fastest = handle.get_result_async(), 0.0
    wait_for(client, lambda: stranger.fastest > 0.5 or ended.done(), what="the arm is guided")
    assert not ended.done(), ended.result().result.message
    client.wait(
        handle.cancel_goal_async()
        if how == "cancel"
        else stranger.stop.call_async(Trigger.Request()),
        how,
    )
    lesson = client.wait(ended, "the lesson")
    assert (
        not lesson.result.success
        and {"stop": "stopped by", "cancel": "cancelled"}[how] in lesson.result.message
    )
    assert lesson.result.attempts == 1 and not lesson.result.outcome.header.stamp.sec, (
        "the movement was not made to its end, and judged"
    )
    client.set_parameters("/wam_simulator", {"speed_factor": 0.0})
    if how == "stop":
        stranger.free()
    assert client.teach(SHOWN[0]).success, "the next lesson"


def test_a_plain_goal_after_a_lesson_is_carried_out_without_another_word(graph, stranger):
    """It waited for /simulation/pause, which the teacher had left at true, and said so in the log."""
    client, teach = graph.client, ActionClient(graph.client.node, Teach, "/teach")
    client.call(stranger.pause, SetBool.Request(data=False))
    wait_for(client, teach.server_is_ready, what="the teacher")
    goal = Teach.Goal(situation=conversions.at_place(SHOWN[0]))
    handle = client.wait(teach.send_goal_async(goal), "/teach")
    assert client.wait(handle.get_result_async(), "the lesson").result.success
    goal = Execute.Goal(situation=conversions.at_place(TARGET))
    handle = client.wait(stranger.action.send_goal_async(goal), "/execute")
    result = client.wait(handle.get_result_async(), "the throw").result
    assert result.code == Execute.Goal.OUTCOME_EXECUTED, result.message


def test_a_goal_that_is_cancelled_while_it_is_planned_moves_nothing(graph, stranger, slow_learner):
    handle, result = slow_learner.begin()
    graph.client.wait(handle.cancel_goal_async(), "the cancellation")
    slow_learner.go_on()
    response = graph.client.wait(result, "the throw")
    assert response.status == 5, "GoalStatus.STATUS_CANCELED"
    assert response.result.message == "cancelled"
    stranger.watch(LONGEST)
    assert stranger.fastest < RESTING, (
        f"the arm moved at {stranger.fastest:.2f} rad/s after it was cancelled"
    )


def test_a_throw_can_be_cancelled_in_a_running_world(graph, stranger):
    handle, result = stranger.begin()
    wait_for(graph.client, lambda: "approaching" in stranger.phases, what="the approach")
    graph.client.wait(handle.cancel_goal_async(), "the cancellation")
    assert graph.client.wait(result, "the throw").result.message == "cancelled"
    log = (graph.logs / "composed.log").read_text()
    assert "[commander]: no throw: cancelled" in log
    assert not re.search(r"ERROR.*no throw: cancelled", log), "a client's own wish is no error"


def test_a_throw_that_is_stopped_ends_when_the_arm_rests(graph, stranger):
    """Whoever holds the world when the result is there finds an arm that can be reset."""
    result, _ = begin_slow_throw(graph.client, Joints(graph.client), TARGET)
    graph.client.call(stranger.stop, Trigger.Request())
    assert graph.client.wait(result, "the throw").result.code == Execute.Goal.OUTCOME_STOPPED
    graph.client.call(stranger.pause, SetBool.Request(data=True))
    stranger.free()
    graph.client.set_parameters("/wam_simulator", {"speed_factor": 0.0})


def test_a_goal_that_waits_for_a_state_that_never_comes_is_refused(graph, stranger):
    _, result = stranger.begin(stamp_ns=10**18)
    outcome = graph.client.wait(result, "the throw").result
    assert (
        outcome.code == Execute.Goal.OUTCOME_REFUSED
        and "1000000000000000000 ns" in outcome.message
    )
    assert stranger.fastest < RESTING


@pytest.mark.parametrize("radius", [-3.0, 0.0, float("nan"), float("inf")])
def test_a_basket_that_cannot_be_is_refused_and_ends_no_process(graph, stranger, calm, radius):
    with pytest.raises(GraphFailure, match="basket_radius"):
        graph.client.set_parameters("/mock_optitrack", {"basket_radius": radius})
    graph.client.set_parameters("/mock_optitrack", {"basket_radius": 0.15})
    before = time.monotonic()
    stranger.watch(0.5)
    assert not graph.dead(), f"{time.monotonic() - before:.1f} s later"


def test_a_speed_that_is_not_finite_is_refused(graph, stranger, calm):
    with pytest.raises(GraphFailure, match="speed_factor"):
        graph.client.set_parameters("/wam_simulator", {"speed_factor": float("nan")})
    stranger.watch(0.5)


@pytest.mark.parametrize(
    "change",
    [
        {"mass_scale": [1.0, 1.0]},
        {"mass_scale": [-1.0] * 7},
        {"joint_stiffness": [100.0] * 6 + [0.0]},
    ],
)
def test_an_arm_that_cannot_be_is_refused_when_it_is_set_and_not_at_a_reset(
    graph, stranger, calm, change
):
    (name,) = change
    with pytest.raises(GraphFailure, match=name):
        graph.client.set_parameters("/wam_simulator", change)
    stranger.watch(0.5)
    assert not graph.dead()


def garbage(length=40):
    """Bytes that begin as a serialised message does."""
    return b"\x00\x01\x00\x00" + b"\xff" * length


def pose(**position):
    message = PoseStamped(pose=Pose(position=Point(**position)))
    message.header.frame_id = "world"
    return message


def before_time(message):
    message.header.stamp.sec = -1
    return message


NAN = float("nan")
HOSTILE = {
    "a pose before time began": (
        pose_topic("hand"),
        before_time(pose()),
        "demonstration_recorder",
    ),
    "a pose beyond this world": (pose_topic("ball"), pose(x=1e308), "demonstration_recorder"),
    "a pose that is none": (pose_topic("basket"), pose(z=NAN), "demonstration_recorder"),
    "a pose of a few bytes": (pose_topic("hand"), garbage(0), "demonstration_recorder"),
    "a pose of other bytes": (pose_topic("hand"), garbage(), "demonstration_recorder"),
    "six joints": (
        "/joint_states",
        JointState(name=joint_names()[:6], position=[0.0] * 6, velocity=[0.0] * 6),
        "commander",
    ),
    "joints that are no numbers": (
        "/joint_states",
        JointState(name=joint_names(), position=[NAN] * 7, velocity=[0.0] * 7),
        "commander",
    ),
    "a push of other bytes": ("/wam/teacher_wrench", garbage(), None),
    "a world before time began": (
        "/simulation/state",
        before_time(SimulationState()),
        "mock_optitrack",
    ),
    "a world that is none": (
        "/simulation/state",
        SimulationState(joint_position=[NAN] * 7),
        "mock_optitrack",
    ),
    "a time before time began": ("/clock", Clock(clock=Time(sec=-1)), "mock_optitrack"),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_a_message_that_cannot_be_used_ends_no_node_and_is_named(graph, stranger, calm, what):
    topic, message, node = HOSTILE[what]
    kind = {
        "/joint_states": JointState,
        "/wam/teacher_wrench": WamCommand,
        "/simulation/state": SimulationState,
        "/clock": Clock,
    }
    sender = graph.client.node.create_publisher(kind.get(topic, PoseStamped), topic, LOOP)
    said = Diagnoses(graph.client)
    wait_for(graph.client, sender.get_subscription_count, what="a subscriber")

    def is_named():
        sender.publish(message)  # again and again: a message may get lost
        return (
            node is None
            or f"refused on {topic}" in said.of.get(node, "")
            or topic in said.of.get(node, "")
        )

    wait_for(graph.client, is_named, what=lambda: f"{node} says so: {said.of}")
    graph.client.node.destroy_publisher(sender)
    stranger.watch(0.1)
    assert not graph.dead()


def test_after_all_that_the_arm_is_taught_and_throws(graph):
    """Nothing that was refused is left behind anywhere."""
    lesson = graph.client.teach(np.zeros(3))
    assert not lesson.success and "on the base of the arm" in lesson.message
    lesson = graph.client.teach(TARGET)
    assert lesson.success, lesson.message
    assert graph.client.throw(TARGET).code == Execute.Goal.OUTCOME_EXECUTED


def test_a_trial_whose_plan_is_empty_is_refused(graph):
    add = graph.client.node.create_client(AddTrial, "/skill_learner/add_trial")
    plan = PlanMsg(
        skill="throw",
        trajectory=MultiDOFJointTrajectory(
            joint_names=["attractor", "hand"], points=[MultiDOFJointTrajectoryPoint()]
        ),
    )
    trial = Demonstration(skill="throw", header=Header(frame_id="world"))
    response = graph.client.call(add, AddTrial.Request(plan=plan, trial=trial), may_refuse=True)
    assert (
        not response.success
        and "point 0 of the plan's trajectory has 0 transforms" in response.message
    )


def test_a_plan_is_made_for_a_situation_that_names_no_frame_and_an_empty_trial_is_named(graph):
    """As /execute takes it; of an empty trial the message had no subject."""
    client = graph.client
    plan = client.node.create_client(Plan, "/skill_learner/plan")
    request = Plan.Request(situation=conversions.at_place(TARGET))
    assert client.call(plan, request).plan.model_id
    add = client.node.create_client(AddTrial, "/skill_learner/add_trial")
    refused = client.call(add, AddTrial.Request(), may_refuse=True).message
    assert refused.startswith("the demonstration is in frame ''")
