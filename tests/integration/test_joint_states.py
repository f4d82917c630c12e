"""Whatever a driver offers its joint states with, and in whatever order: they are heard, or
somebody says which joint is missing.
"""

import time
from types import SimpleNamespace

import numpy as np
import pytest
from dart_skill_msgs.action import Execute
from dart_skill_msgs.msg import WamCommand
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.action import ActionClient
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from dart_skill.arm import ArmState
from dart_skill.common.world import joint_names
from dart_skill.recording import deserialize, joint_layout, serialize, typestore
from dart_skill.recording.imports import SignalSource
from dart_skill.recording.imports.joint_streams import read_states
from dart_skill.recording.mcap import BagMessage
from dart_skill_nodes.arm import arm_watch
from dart_skill_nodes.client.arm_listener import ArmListener
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.joint_states import JOINT_STATES, OfTheArm, Rivals, hear_joint_states
from dart_skill_nodes.executables.commander import CommanderNode
from dart_skill_nodes.executables.demonstration_recorder import DemonstrationRecorder
from dart_skill_nodes.process.node_base import make_executor
from tests.integration.conftest import until

NAMES = joint_names()
ANGLES = dict(zip(NAMES, (0.1, -1.0, 0.2, 0.9, 0.3, -0.4, 0.5), strict=True))
REORDERED = ["finger_1", *reversed(NAMES), "finger_2"]


def state(names=NAMES, ns=1):
    """A joint state with the angles of ANGLES by name, and tenths of them as speeds."""
    angles = [ANGLES.get(name, 9.0) for name in names]
    message = JointState(
        name=list(names), position=angles, velocity=[0.1 * angle for angle in angles]
    )
    message.header.stamp = conversions.time_msg(ns)
    return message


@pytest.fixture
def beside(ros):
    """Makes a driver beside a node, and spins both until a condition holds; the driver speaks all
    the time.
    """
    import rclpy

    made = []

    class Driver:
        def __init__(self, node, qos, names=NAMES):
            self.node, self.names, self.said, self._due = (
                rclpy.create_node("driver"),
                names,
                0,
                0.0,
            )
            self.other, self._others = None, None
            made.append(self)
            self.answers, self.diagnoses = [], []
            self.publisher = self.node.create_publisher(JointState, JOINT_STATES, qos)
            self.node.create_subscription(
                WamCommand, "/wam/command", lambda message: self.answers.append(message), 10
            )
            self.node.create_subscription(
                DiagnosticArray, "/diagnostics", self._on_diagnostics, 10
            )
            self.beside, self._executor = node, make_executor()
            self._executor.add_node(node)
            self._executor.add_node(self.node)

        def speak_beside(self, names):
            """Another node publishes states of these joints, in every step, with stamps of its own
            clock.
            """
            self.other = rclpy.create_node("gripper")
            self._executor.add_node(self.other)
            self._others = (
                self.other.create_publisher(JointState, JOINT_STATES, QoSProfile(depth=10)),
                names,
            )

        def _on_diagnostics(self, message):
            self.diagnoses += [
                (status.level, status.message)
                for status in message.status
                if status.name == "commander"
            ]

        def offer(self, qos):
            """Start again with another quality of service."""
            self.node.destroy_publisher(self.publisher)
            self.publisher = self.node.create_publisher(JointState, JOINT_STATES, qos)

        def close(self):
            self._executor.shutdown()
            for node in filter(None, (self.beside, self.node, self.other)):
                node.destroy_node()

        def until(self, condition, what):
            until(condition, self._turn, what)

        def _turn(self):
            # more of them than the node takes would leave no turn to its timers
            if time.monotonic() > self._due:
                self.said, self._due = self.said + 1, time.monotonic() + 0.002
                self.publisher.publish(state(self.names, 2_000_000 * self.said))
                if self._others is not None:
                    publisher, names = self._others
                    publisher.publish(state(names, 3_600_000_000_000 + 1_000_000 * self.said))
            self._executor.spin_once(timeout_sec=0.01)

    yield Driver
    for driver in made:
        driver.close()


def test_a_commander_answers_a_driver_that_is_best_effort_and_one_that_is_reliable(beside):
    driver = beside(CommanderNode(), qos_profile_sensor_data)
    driver.until(lambda: len(driver.answers) > 3, "an answer to best-effort states")
    driver.offer(QoSProfile(depth=10))
    driver.answers.clear()
    driver.until(
        lambda: len(driver.answers) > 3,
        "an answer to a driver that was started again with reliable ones",
    )


def test_a_reliable_driver_is_heard_without_a_new_subscription(beside):
    """What is heard in lockstep must not be lost while the quality of service is found out."""
    import rclpy

    node, heard = rclpy.create_node("listener"), []
    states = hear_joint_states(node, heard.append)
    first = states.subscriptions[JOINT_STATES]
    driver = beside(node, QoSProfile(depth=10))
    driver.until(lambda: not states.missing and len(heard) > 3, "a state")
    assert states.subscriptions[JOINT_STATES] is first


def test_a_warning_of_a_subscription_that_was_replaced_before_its_turn_ends_nothing(beside):
    """A best-effort driver is noticed while the node is at work with something else."""
    import rclpy

    node, heard = rclpy.create_node("listener"), []
    states = hear_joint_states(node, heard.append)
    driver = beside(node, QoSProfile(depth=10))
    driver.until(lambda: len(heard) > 3, "a state of a reliable driver")
    first = states.subscriptions[JOINT_STATES]
    driver.offer(qos_profile_sensor_data)
    until(lambda: replaced(states, first), what="that the best-effort driver is noticed")
    heard.clear()
    driver.until(lambda: len(heard) > 3, "a state of the best-effort driver")


def replaced(states, subscription):
    """Whether it was, in place of which another one hears the driver."""
    states.look()
    return states.subscriptions[JOINT_STATES] is not subscription


def test_who_rests_is_not_sent_anything_and_hears_again_when_it_goes_on(beside):
    import rclpy

    node, heard = rclpy.create_node("listener"), []
    states = hear_joint_states(node, heard.append)
    driver = beside(node, qos_profile_sensor_data)
    driver.until(lambda: len(heard) > 3, "a state")
    states.rest()
    driver.until(
        lambda: driver.publisher.get_subscription_count() == 0, "that nobody hears the driver"
    )
    states.look()
    assert states.rests and not states.subscriptions
    heard.clear()
    states.go_on()
    driver.until(lambda: len(heard) > 3, "a state of a best-effort driver after the rest")


def test_joints_are_put_in_order_by_their_names(beside):
    taken = conversions.arm_state(state(REORDERED))
    np.testing.assert_array_equal(taken.position, list(ANGLES.values()))
    np.testing.assert_allclose(taken.velocity, 0.1 * taken.position)
    node = CommanderNode()
    driver = beside(node, QoSProfile(depth=10), REORDERED)
    driver.until(lambda: driver.answers, "an answer to states in another order")
    np.testing.assert_array_equal(node.execution.state.position, list(ANGLES.values()))


def test_check_arm_counts_postures_of_joints_in_another_order_beside_those_of_a_hand(beside):
    """Else a person who leads such an arm through postures is waited for without end."""
    import rclpy

    node, heard = rclpy.create_node("arm_check"), []
    listener = ArmListener(node)
    driver = beside(node, QoSProfile(depth=10), REORDERED)

    def takes():
        heard.append(listener.take())
        return heard[-1] is not None

    driver.until(takes, "a state")
    time_of_state, position = heard[-1]
    assert time_of_state > 0.0
    np.testing.assert_array_equal(position, list(ANGLES.values()))
    listener.close()


def test_a_missing_joint_is_named_and_nothing_is_commanded(beside):
    driver = beside(
        CommanderNode(), QoSProfile(depth=10), [name for name in NAMES if name != "wam_j4"]
    )
    driver.until(
        lambda: any("wam_j4 is missing" in text for _, text in driver.diagnoses), "a diagnosis"
    )
    assert not driver.answers and "config/wam.yaml" in driver.diagnoses[-1][1]
    driver.names = NAMES
    driver.until(lambda: driver.answers, "an answer once all joints are there")


def test_the_law_of_the_simulated_arm_throws_nothing_beside_another_arm(beside):
    """Whoever starts the node by itself beside a real arm gets the parameters of config/: told at
    once, before anything moves.
    """
    driver = beside(CommanderNode(), QoSProfile(depth=10))
    client = ActionClient(driver.node, Execute, "/execute")
    driver.until(lambda: driver.answers and client.server_is_ready(), "a commander")
    sent = client.send_goal_async(
        Execute.Goal(situation=conversions.at_place(np.array([2.0, 0.0, 0.4])))
    )
    driver.until(sent.done, "an answer to the goal")
    result = sent.result().get_result_async()
    driver.until(result.done, "the result")
    assert result.result().result.code == Execute.Goal.OUTCOME_REFUSED
    assert (
        "tracking is 'hand'" in result.result().result.message
        and "tracking:=joints" in result.result().result.message
    )


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"name": []}, "0 names, 7 positions"),
        ({"velocity": []}, "0 velocities"),
        ({"name": [*NAMES[:6], "wam_j1"]}, "joint wam_j1 is named twice"),
        (
            {"name": [f"joint_{k}" for k in range(7)]},
            "names none of the arm's joints wam_j1 to wam_j7, but joint_0",
        ),
        (
            {"name": NAMES[:6], "position": [0.0] * 6, "velocity": [0.0] * 6},
            "joint wam_j7 is missing",
        ),
    ],
)
def test_a_state_that_is_not_the_arms_is_refused_with_the_remedy(change, why):
    message = state()
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(ValueError, match=f"/joint_states.*{why}.*driver"):
        conversions.arm_state(message)


def test_a_gripper_on_the_same_topic_is_not_heard(beside):
    """Neither its stamps of another clock nor its joints stop the arm; who has heard nothing else
    says so.
    """
    driver = beside(CommanderNode(), QoSProfile(depth=10))
    driver.speak_beside(["finger_left", "finger_right"])
    driver.until(lambda: driver.other.count_publishers(JOINT_STATES) == 2, "two publishers")
    driver.until(lambda: driver.beside._states.of_the_arm.voices, "that the gripper is heard")
    driver.answers.clear()
    driver.until(lambda: len(driver.answers) > 50, "answers beside a gripper")
    stamps = [conversions.stamp_ns(answer.header.stamp) for answer in driver.answers]
    assert (
        all(a < b for a, b in zip(stamps, stamps[1:], strict=False))
        and max(np.diff(stamps)) <= 4_000_000
    ), "no state was lost"
    assert not driver.beside.refusals.counts and not driver.beside._rivals


def test_whose_states_they_are_is_told_by_their_names_of_messages_and_of_their_bytes():
    for read in (lambda message: message, serialize_message):
        of_the_arm = OfTheArm()
        assert of_the_arm(read(state())) and of_the_arm(read(state(REORDERED)))
        assert not of_the_arm.others and not of_the_arm(read(state(["finger_1"])))
        assert "finger_1" in of_the_arm.others and of_the_arm.voices == 1


def test_who_hears_a_gripper_only_says_whose_joints_come(beside):
    driver = beside(CommanderNode(), QoSProfile(depth=10), ["finger_left", "finger_right"])
    driver.until(lambda: driver.beside._states.of_the_arm.others, "a state")
    missing = driver.beside._missing()
    assert (
        "names none of the arm's joints wam_j1 to wam_j7, but finger_left, finger_right" in missing
        and not driver.answers
    )


def test_the_recorder_takes_the_arms_states_beside_a_gripper(beside, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    driver = beside(DemonstrationRecorder(), QoSProfile(depth=10))
    recorder = driver.beside
    driver.speak_beside(["finger_left", "finger_right"])
    driver.until(
        lambda: recorder._of_the_arm.voices and recorder.observer.heard(JOINT_STATES) > 20,
        "states of both",
    )
    state = recorder.observer.arm_state()
    np.testing.assert_array_equal(state.position, list(ANGLES.values()))
    assert not recorder.refusals.counts and state.stamp_ns < 3_600_000_000_000


def test_a_second_arm_under_the_same_names_is_refused(beside):
    driver = beside(CommanderNode(), QoSProfile(depth=10))
    driver.until(lambda: len(driver.answers) > 3, "an answer")
    driver.speak_beside(REORDERED)
    driver.until(lambda: driver.beside._rivals, "that nothing is commanded")
    assert "driver and gripper publish /joint_states: end one of them" in driver.beside._rivals


def test_arms_whose_states_leap_to_and_fro_are_rivals_beside_a_gripper_too(monkeypatch):
    monkeypatch.setattr(arm_watch, "others", lambda node, topic: ["driver", "stranger"])
    for needed in ("TimeOfTheArm", "Cameras"):
        monkeypatch.setattr(arm_watch, needed, lambda *_: None)
    states = SimpleNamespace(of_the_arm=SimpleNamespace(voices=1))
    watch = arm_watch.ArmWatch(SimpleNamespace(get_namespace=lambda: "/"), states, "")
    watch.look_for_rivals()
    assert not watch.rivals
    for k in range(10):
        leaps = watch.leaps(ArmState(2_000_000 * k, np.full(7, k % 2.0), np.zeros(7)))
    watch.look_for_rivals()
    assert leaps and watch.rivals.startswith("driver and stranger publish /joint_states: end one")


def test_states_that_leap_to_and_fro_are_of_two_arms():
    """Also where one of two publishers sends other joints, too, so that counting them tells
    nothing.
    """
    rivals, ours = Rivals(), list(ANGLES.values())
    assert not any(rivals.see(conversions.arm_state(state(ns=2_000_000 * k))) for k in range(300))
    zeros = state(ns=700_000_000)
    zeros.position = [0.0] * 7
    assert any(
        rivals.see(conversions.arm_state(one))
        for _ in range(3)
        for one in (zeros, state(ns=702_000_000))
    )
    assert rivals.are_there and ours != zeros.position


KINDS = {
    "ours": {},
    "in another order": {"name": NAMES[::-1]},
    "with fingers": {
        "name": REORDERED,
        "position": [9.0, *range(7), 9.0],
        "velocity": [9.0, *range(7), 9.0],
    },
    "with mimic joints between": {
        "name": [*NAMES[:3], "mimic", *NAMES[3:]],
        "position": range(8),
        "velocity": range(8),
    },
    "a gripper": {"name": ["finger"], "position": [0.1], "velocity": []},
    "another arm": {"name": [f"left_{name}" for name in NAMES]},
    "a part of the arm": {"name": NAMES[:4], "position": range(4), "velocity": range(4)},
    "a name twice": {"name": [*NAMES[:6], NAMES[0]]},
    "a name too many": {"name": [*NAMES, "finger"]},
    "a position too many": {"position": range(8)},
    "no position": {"position": [], "velocity": [], "effort": [1.0] * 7},
    "a position that is none": {"position": [0.0] * 6 + [float("nan")]},
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_live_graph_and_a_bag_read_the_same_row_from_the_same_message(kind):
    message = state()
    for name, value in KINDS[kind].items():
        setattr(message, name, [float(x) for x in value] if name != "name" else list(value))
    try:
        live = conversions.arm_state(message)
    except ValueError:
        live = None
    types = typestore()
    data = serialize(types, "sensor_msgs/msg/JointState", message)
    where = SignalSource("/joint_states", names=NAMES)
    recorded = [
        BagMessage("/joint_states", "sensor_msgs/msg/JointState", k, data) for k in range(3)
    ]
    try:
        states = read_states(
            recorded,
            types,
            lambda one: deserialize(types, one.type_name, one.data),
            where,
            lambda one: 0,
        )
    except ValueError:
        states = None
    assert (live is None) == (states is None), "both have a row, or neither"
    assert OfTheArm()(data) == (not conversions.of_others(message))
    if live is not None:
        np.testing.assert_array_equal(states.position, np.tile(live.position, (3, 1)))
        np.testing.assert_array_equal(states.velocity, np.tile(live.velocity, (3, 1)))


def test_a_state_without_velocities_is_read_from_a_bag_and_refused_by_what_moves_the_arm():
    """Positions over time tell them afterwards; a control law that has to wait for them would be
    late.
    """
    message = state()
    message.velocity = []
    with pytest.raises(ValueError, match="0 velocities"):
        conversions.arm_state(message)
    position, velocity = joint_layout(tuple(message.name), 7, 0).row(
        np.array(message.position), np.empty(0)
    )
    np.testing.assert_array_equal(position, list(ANGLES.values()))
    assert np.isnan(velocity).all()
