"""Whatever a message, a request or a parameter holds: no callback raises anything but a plain
refusal. Nodes in this process, no graph.

HYPOTHESIS_PROFILE=long looks for new examples, and for many of them.
"""

import contextlib
import math
from dataclasses import replace

import pytest
from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Execute, Practice, Teach
from dart_skill_msgs.msg import Demonstration, SimulationState, Situation, WamCommand
from dart_skill_msgs.msg import Plan as PlanMsg
from dart_skill_msgs.srv import AddTrial
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from visualization_msgs.msg import MarkerArray

from dart_skill.common.world import ROLES, joint_names, pose_topic
from dart_skill.recording import read_command, read_demonstrations
from dart_skill_nodes.client.node_inspector import NodeStatuses
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.for_viewers import TfMessages, ellipsoids
from dart_skill_nodes.comms.raw_batches import poses_of
from dart_skill_nodes.comms.refusals import Refusals
from dart_skill_nodes.comms.tracked_bodies import TrackedBodies
from dart_skill_nodes.executables.commander import CommanderNode
from dart_skill_nodes.executables.demonstration_recorder import DemonstrationRecorder
from dart_skill_nodes.executables.mock_optitrack import MockOptitrack
from dart_skill_nodes.executables.recorder import Recorder
from dart_skill_nodes.executables.skill_learner import SkillLearner
from dart_skill_nodes.executables.teacher import TeacherNode
from dart_skill_nodes.executables.wam_simulator import WamSimulator
from tests.integration.conftest import plan_request
from tests.integration.nasty import NUMBERS, nasty, spoil
from tests.integration.plan_messages import throw_plan_msg
from tests.paths import BAGS

SHOWN = read_demonstrations(BAGS / "demonstrations")[:4]

randoms = st.randoms(use_true_random=False)
few = settings(max_examples=40 if settings.default.derandomize else settings.default.max_examples)
"""A plain run tries fewer examples of what takes longer: they are the same ones each time."""
CONVERTED = {
    "arm_state": (JointState, conversions.arm_state),
    "command": (WamCommand, conversions.command),
    "plan": (PlanMsg, conversions.motion_plan),
    "throw_plan": (PlanMsg, conversions.throw_plan),
    "situation": (Situation, conversions.situation),
    "demonstration": (Demonstration, conversions.demonstration),
    "markers": (MarkerArray, lambda message: ellipsoids(message, "world")),
    "diagnostics": (DiagnosticArray, lambda message: NodeStatuses().take(message)),
}


@pytest.mark.parametrize("name", CONVERTED)
@given(random=randoms)
@few
def test_a_message_becomes_data_or_is_refused(name, random):
    kind, convert = CONVERTED[name]
    message = nasty(kind, random)
    if kind is JointState and random.random() < 0.7:  # else every one fails at its names
        message.name, message.position = (
            list(joint_names()),
            [random.choice(NUMBERS) for _ in range(7)],
        )
        message.velocity = [random.choice(NUMBERS) for _ in range(7)]
    if kind is PlanMsg:
        message.trajectory.joint_names = ["attractor", "hand"]
    with contextlib.suppress(ValueError):
        convert(message)


READERS = {
    "command": read_command,
    "stamp": conversions.leading_stamp_ns,
    "poses": lambda data: poses_of([data], "world"),
    "joints": lambda data: conversions.arm_state(conversions.decoded(data, JointState)),
    "body": lambda data: TrackedBodies("world", lambda text: None).take("hand", data),
    "transforms": lambda data: list(TfMessages("world", 50.0).messages("/joint_states", 0, data)),
}


@pytest.mark.parametrize("name", READERS)
@given(data=st.binary(max_size=200), kept=st.integers(0, 200), random=randoms)
@few
def test_bytes_become_data_or_are_refused(name, data, kept, random):
    kind = {"command": WamCommand, "joints": JointState}.get(name, PoseStamped)
    whole = bytes(serialize_message(nasty(kind, random)))
    for some in (data, whole[:kept] + data, whole):
        with contextlib.suppress(ValueError):
            READERS[name](some)


@pytest.fixture(scope="module")
def nodes(ros, tmp_path_factory):
    """One of each, in an empty working directory, none of which is spun."""
    made = []
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("fuzz"))
        patch.setattr(Refusals, "add", only_plain_refusals)
        kinds = (
            WamSimulator,
            MockOptitrack,
            CommanderNode,
            TeacherNode,
            DemonstrationRecorder,
            SkillLearner,
            Recorder,
        )
        made += [kind() for kind in kinds]
        named = {node.get_name(): node for node in made}
        named["skill_learner"]._learner.learn(SHOWN)
        yield named
        for node in made:
            node.destroy_node()


def only_plain_refusals(self, place, error):
    """Instead of Refusals.add: what is no refusal is a defect, which a node survives and this test
    does not.
    """
    if not isinstance(error, ValueError):
        raise AssertionError(f"{place}: {error!r}") from error
    self.counts[place] += 1
    return str(error)


HEARD = {
    "/joint_states": JointState,
    "/wam/command": WamCommand,
    "/wam/teacher_wrench": WamCommand,
    "/simulation/state": SimulationState,
    "/clock": Clock,
    "/demonstrations": Demonstration,
    "/skill_learner/heartbeat": Time,
    **{pose_topic(role): PoseStamped for role in ROLES},
}


@given(random=randoms)
def test_every_callback_of_a_topic_survives(nodes, random):
    topic = random.choice(list(HEARD))
    message = nasty(HEARD[topic], random)
    for node in nodes.values():
        for subscription in node.subscriptions:
            if subscription.topic_name == topic:
                subscription.callback(
                    bytes(serialize_message(message)) if subscription.raw else message
                )


@given(random=randoms)
def test_every_raw_message_survives(nodes, random):
    topic = random.choice([topic for topic in HEARD if HEARD[topic] not in (Clock, Time)])
    data = random.choice(
        (
            random.randbytes(random.randrange(60)),
            bytes(serialize_message(nasty(HEARD[topic], random))),
        )
    )
    recorder = nodes["demonstration_recorder"]
    with contextlib.suppress(ValueError):
        recorder.observer.take(topic, random.choice((0, 10**9, 2**62)), data)


def called(node, service, make_request):
    """Type of a service of a node, and its response."""
    (found,) = (one for one in node.services if one.service_name == service)
    kind = found.srv_type
    return kind, found.callback(make_request(kind), kind.Response())


SERVED = {
    "wam_simulator": (
        "/simulation/reset",
        "/simulation/pause",
        "/simulation/step",
        "/simulation/place_body",
        "/bhand/close_grasp",
    ),
    "commander": ("~/release_arm", "~/move_to", "~/stop"),
    "demonstration_recorder": ("~/start", "~/stop", "~/judge"),
    "skill_learner": (
        "~/learn",
        "~/plan",
        "~/add_trial",
        "~/load",
        "~/demonstrations",
        "~/drop_demonstration",
    ),
}


@given(random=randoms)
def test_every_service_answers(nodes, random):
    name = random.choice(list(SERVED))
    service = random.choice(SERVED[name]).replace("~", f"/{name}")
    kind, response = called(nodes[name], service, lambda kind: nasty(kind.Request, random))
    assert isinstance(response, kind.Response)
    assert response.success or getattr(response, "pending", False) or response.message
    assert not response.message or "\n" not in response.message


@pytest.fixture(scope="module")
def thrown(nodes):
    """A demonstration and a plan as messages, both as good as can be."""
    one = replace(read_demonstrations(BAGS / "demonstrations")[4], id="trial")
    return one, nodes["skill_learner"]._learner.plan(one.situation).plan


@given(random=randoms)
@settings(max_examples=max(20, settings.default.max_examples // 5))
def test_a_trial_with_a_few_wrong_numbers_is_kept_or_refused(nodes, thrown, random):
    demonstration, plan = thrown
    request = AddTrial.Request(
        trial=conversions.demonstration_msg(demonstration),
        plan=throw_plan_msg(plan),
    )
    spoil(random.choice((request.trial, request.plan)), random)
    request.trial.id = f"trial {random.random()}"
    learner = nodes["skill_learner"]
    _, response = called(learner, "/skill_learner/add_trial", lambda kind: request)
    assert response.success or response.message
    _, again = called(learner, "/skill_learner/plan", lambda _: plan_request(demonstration.target))
    assert again.success, f"a trial that was kept spoils every plan: {again.message}"


@given(random=randoms)
@settings(max_examples=max(20, settings.default.max_examples // 5))
def test_a_demonstration_with_a_few_wrong_numbers_does_not_keep_the_others_from_being_learned(
    nodes, thrown, random
):
    learner, message = (
        nodes["skill_learner"],
        spoil(conversions.demonstration_msg(thrown[0]), random),
    )
    message.id = "spoiled"
    learner._heard = {one.id: one for one in SHOWN}
    with contextlib.suppress(ValueError):
        learner._on_demonstration(message)
    _, learned = called(learner, "/skill_learner/learn", lambda kind: kind.Request())
    assert learned.success and learned.demonstrations >= 4, learned.message
    _, again = called(learner, "/skill_learner/plan", lambda _: plan_request(thrown[0].target))
    assert again.success, f"it spoils every plan: {again.message}"


@given(random=randoms)
def test_every_parameter_takes_what_it_can_and_refuses_the_rest(nodes, random):
    node = random.choice(list(nodes.values()))
    names = [name for name in node._parameters if name != "use_sim_time"]
    name = random.choice(names)
    before = node.get_parameter(name).value
    value = random.choice(
        (random.choice(NUMBERS), 10**9, -1, True, "text", [1.0, math.nan], [1.0] * 7, ["a"], [])
    )
    (result,) = node.set_parameters([Parameter(name, value=value)])
    assert result.successful or result.reason
    if result.successful:
        assert all(
            math.isfinite(one)
            for one in (value if isinstance(value, list) else [value])
            if isinstance(one, float)
        )
        node.set_parameters([Parameter(name, value=before)])


def test_nothing_of_ours_stands_where_rclpy_keeps_its_own(nodes):
    """A clock of the recorder's did: once it was configured, no parameter could be set."""
    for node in nodes.values():
        plain = (LifecycleNode if isinstance(node, LifecycleNode) else Node)("plain")
        try:
            taken = [
                name
                for name, value in vars(plain).items()
                if not isinstance(getattr(node, name), type(value))
            ]
        finally:
            plain.destroy_node()
        assert not taken, f"{node.get_name()}: {taken}"


@given(random=randoms)
@settings(max_examples=30)
def test_targets_of_goals_become_places_or_are_refused(random):
    for goal in (nasty(Execute.Goal, random), nasty(Teach.Goal, random)):
        with contextlib.suppress(ValueError):
            conversions.target_of(goal.situation)
    for one in nasty(Practice.Goal, random).situations:
        with contextlib.suppress(ValueError):
            assert all(map(math.isfinite, conversions.target_of(one)))
