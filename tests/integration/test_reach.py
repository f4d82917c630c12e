"""A skill that reacts through the nodes: shown, learned, executed, held, and stopped where nobody
sees the cup any more.
"""

import signal

import numpy as np
import pytest
from dart_skill_msgs.action import Execute, Teach
from dart_skill_msgs.msg import SimulationState, WamCommand
from dart_skill_msgs.srv import Plan, Reset
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from dart_skill.arm import Command
from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import read_demonstrations
from dart_skill.session import learn_skill
from dart_skill.simulation import Holder
from dart_skill.skills.learning import Policy
from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.commands import CommandWriter
from dart_skill_nodes.comms.qos import COMPLETE, LOOP
from tests.integration.conftest import graphs, wait_for
from tests.screen_person import ScreenPerson, begin_by_pointer

SHOWN, SEED = 3, 0
SECOND = 1_000_000_000
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def reach():
    return load_skill("reach")


def taught(make, reach, layout):
    """A graph that has been shown how to reach, has learned it, and has made the first reach."""
    graph, client = make(layout, SEED, skill="reach")
    graph.client, graph.rng = client, np.random.default_rng([SEED, 7])
    lessons = [client.show(conversions.situation_msg(reach.draw(graph.rng))) for _ in range(SHOWN)]
    assert all(lesson.success for lesson in lessons), [lesson.message for lesson in lessons]
    graph.learned = client.learn()
    graph.first = client.execute(
        conversions.situation_msg(reach.draw(graph.rng, wide=True)), look=True
    )
    return graph


@pytest.fixture(scope="module")
def running():
    """The graphs of this file by their layout."""
    return {}


@pytest.fixture(scope="module")
def processes(ros, tmp_path_factory, reach, running):
    """With a process for each node, of which one can be ended alone."""
    with graphs(tmp_path_factory.mktemp("processes")) as make:
        running["processes"] = taught(make, reach, "processes")
        yield running["processes"]


@pytest.fixture(scope="module")
def graph(ros, tmp_path_factory, reach, running):
    """The same in one process, which takes the place of those, if they are there."""
    if "processes" in running:
        running["processes"].stop()
    folder = tmp_path_factory.mktemp("reach")
    with graphs(folder) as make:
        made = taught(make, reach, "composed")
        made.bag = folder / "bag_1"
        yield made


@pytest.fixture(scope="module")
def stopped(graph):
    """A movement whose cup goes where nobody sees it."""
    return graph.client.execute(cup_msg([0.6, 0.05, 1.1], tunnel=1.6), look=True)


def cup_msg(place, **numbers):
    return conversions.situation_msg(Situation({"cup": Pose(np.array(place), UPRIGHT)}, numbers))


class Hands:
    """Somebody beside the arm who takes part in the handshake: they hold the hand for a second,
    half a second after it set off.
    """

    def __init__(self, client, holds=True):
        self._holder, self._phase, self._holds = Holder(SEED), "", holds
        self._writer = CommandWriter(77, "world")
        self._begun_ns, self.attractors, self._client = None, [], client
        self._push = client.node.create_publisher(WamCommand, "/wam/teacher_wrench", COMPLETE)
        self._states = client.node.create_subscription(
            JointState, "/joint_states", self._answer, LOOP
        )
        self.rows = []

    def on_feedback(self, message):
        self._phase = message.feedback.phase

    def _answer(self, message):
        state = conversions.arm_state(message)
        if self._phase == "executing" and self._begun_ns is None:
            self._begun_ns = state.stamp_ns
        since = -1.0 if self._begun_ns is None else (state.stamp_ns - self._begun_ns) / SECOND
        holds = self._holds and 0.5 <= since < 1.5
        push = self._holder.push(state, holds) or Command(state.stamp_ns)
        self._push.publish(self._writer.write(push))
        self.rows.append(
            (since, *self._holder._model.hand_state(state.position, state.velocity).position)
        )

    def leave(self):
        self._client.node.destroy_subscription(self._states)
        self._client.node.destroy_publisher(self._push)


@pytest.mark.slow
def test_a_plain_client_has_it_done_in_a_world_that_runs_and_a_hand_that_is_held_waits(processes):
    """As `ros2 action send_goal /execute dart_skill_msgs/action/Execute {}`; the cup stands still,
    so that it can wait, too.
    """
    node, client = processes.client.node, processes.client
    teacher = processes.processes.pop("teacher")  # whose place the hands take
    teacher.send_signal(signal.SIGINT)
    teacher.wait(30)
    reset, hold = (
        node.create_client(Reset, "/simulation/reset"),
        node.create_client(SetBool, "/simulation/pause"),
    )
    client.call(reset, Reset.Request(situation=cup_msg([0.6, 0.05, 1.1]), guided=True))
    hands = Hands(client)
    action = ActionClient(node, Execute, "/execute")
    wait_for(client, action.server_is_ready, what="the commander")
    handle = client.wait(
        action.send_goal_async(Execute.Goal(), feedback_callback=hands.on_feedback), "/execute"
    )
    result = client.wait(handle.get_result_async(), "the result").result
    hands.leave()
    client.call(reset, Reset.Request(paused=True))
    client.call(hold, SetBool.Request(data=True))
    assert result.code == Execute.Goal.OUTCOME_EXECUTED and result.outcome.success, (
        result.outcome.message or result.message
    )
    rows = np.array(hands.rows)
    since, place = rows[:, 0], rows[:, 1:]
    held = place[(since > 0.7) & (since < 1.5)]
    assert np.ptp(held, axis=0).max() < 0.03, "it is held"
    speed = np.linalg.norm(np.diff(place, axis=0), axis=1) / 0.002
    before, after = (
        speed[(since[1:] > 0.0) & (since[1:] < 0.5)].max(),
        speed[since[1:] > 1.55].max(),
    )
    assert after < 0.6 and after < 2.0 * before + 0.25, "it does not hurry after"
    action.destroy()


@pytest.mark.slow
def test_every_layout_makes_the_same_movement_to_the_last_bit(processes, graph):
    """Poses reach the commander over another way in each."""
    learned, first = processes.learned, processes.first
    assert first.outcome.success and graph.first.outcome.success, (
        first.message,
        graph.first.message,
    )
    assert (learned.model_id, first.outcome.error) == (
        graph.learned.model_id,
        graph.first.outcome.error,
    )


def test_a_cup_that_nobody_sees_any_more_stops_the_arm(stopped):
    assert stopped.code == Execute.Goal.OUTCOME_STOPPED
    assert (
        "the cup was last seen 0.1" in stopped.message
        and "more than 0.15 s are too long to react to it" in stopped.message
    )


@pytest.mark.slow
@pytest.mark.usefixtures("stopped")
def test_the_hand_reaches_into_cups_that_move_otherwise(graph, reach):
    """The second one right after one that was stopped: it is made as ever."""
    truth = []
    watching = graph.client.node.create_subscription(
        SimulationState, "/simulation/state", truth.append, 10
    )
    second = graph.client.execute(
        conversions.situation_msg(reach.draw(graph.rng, wide=True)), look=True
    )
    for made in (graph.first, second):
        assert (made.code, made.message) == (Execute.Goal.OUTCOME_EXECUTED, "executed")
        assert made.outcome.seen and made.outcome.success, made.outcome.message
        plan = graph.client.executed_plan(made)
        assert plan.policy and not plan.trajectory.points
    (cup,) = [body for body in truth[-1].bodies if body.name == "cup"]
    assert np.hypot(cup.twist.linear.x, cup.twist.linear.y) < 0.3
    graph.client.node.destroy_subscription(watching)


def test_the_learner_tells_nobody_where_the_cup_will_be(graph, reach):
    planner = graph.client.node.create_client(Plan, "/skill_learner/plan")
    here, there = (
        graph.client.call(planner, Plan.Request(header=Header(frame_id="world"))).plan
        for _ in range(2)
    )
    assert here == there and here.situation.bodies == []
    policy = Policy.from_bytes(here.policy.tobytes(), reach)
    assert policy.skill.settings == reach.settings and len(here.policy) < 200_000


@pytest.mark.slow
def test_practice_tries_it_where_the_coach_draws(graph):
    result = graph.client.practise(1)
    assert (result.executed, len(result.outcomes)) == (1, 1) and result.outcomes[0].success, (
        result.message
    )


def test_somebody_with_a_pointer_shows_it_in_a_cup_that_moves_slowly(graph, reach):
    client = graph.client
    person = ScreenPerson(client, ("hand", "cup"))
    teacher = ActionClient(client.node, Teach, "/teach")
    wait_for(client, teacher.server_is_ready, what="the teacher")
    lesson = begin_by_pointer(client, teacher, reach.unhurried(reach.draw(graph.rng)))
    # over the rim for a moment, in the cup for a second
    for height, poses in (
        (0.15, 10),
        (0.08, 10),
        (0.0, 100),
    ):
        person.follow("cup", [0.0, 0.0, height], poses)
    person.hands.done()
    shown = client.wait(lesson, "the end of the lesson").result
    assert shown.success, shown.message
    graph.learned = client.learn()
    assert graph.learned.demonstrations == SHOWN + 1
    teacher.destroy()


def test_the_bag_teaches_the_same_without_nodes(graph, reach):
    graph.stop()  # closes the bag; the last test that needs the nodes
    _, lesson = learn_skill(graph.bag, reach)
    assert lesson.model_id == graph.learned.model_id and not lesson.left_out


def test_no_demonstration_begins_in_the_world_before(graph, reach):
    """The teacher sets the world anew as soon as the recorder listens, and the last poses of the
    old one come after that.
    """
    for one in read_demonstrations(graph.bag, reach.name):
        assert max(np.diff(one.hand_time).max(), np.diff(one.track("cup").time).max()) < 0.1, (
            one.id
        )
