"""Whatever a driver offers its joint states with, and in whatever order: they are heard, or somebody says which joint is missing."""

import time

import numpy as np
import pytest
from dart_skill_msgs.action import Execute
from dart_skill_msgs.msg import WamCommand
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.action import ActionClient
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState

from dart_skill.world import joint_names
from dart_skill_nodes.client.arm_listener import ArmListener
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.joint_states import JOINT_STATES, hear_joint_states
from dart_skill_nodes.executables.commander import CommanderNode
from dart_skill_nodes.process.node_base import make_executor

PATIENCE = 30.0
NAMES = joint_names()
ANGLES = dict(zip(NAMES, (0.1, -1.0, 0.2, 0.9, 0.3, -0.4, 0.5), strict=True))
REORDERED = ["finger_1", *reversed(NAMES), "finger_2"]


def state(names=NAMES, ns=1):
    """A joint state with the angles of ANGLES by name, and tenths of them as speeds."""
    angles = [ANGLES.get(name, 9.0) for name in names]
    message = JointState(name=list(names), position=angles, velocity=[0.1 * angle for angle in angles])
    message.header.stamp = conversions.time_msg(ns)
    return message


@pytest.fixture
def beside(ros):
    """Makes a driver beside a node, and spins both until a condition holds; the driver speaks all the time."""
    import rclpy

    made = []

    class Driver:
        def __init__(self, node, qos, names=NAMES):
            self.node, self.names, self.said, self._due = rclpy.create_node("driver"), names, 0, 0.0
            made.append(self)
            self.answers, self.diagnoses = [], []
            self.publisher = self.node.create_publisher(JointState, JOINT_STATES, qos)
            self.node.create_subscription(WamCommand, "/wam/command", lambda message: self.answers.append(message), 10)
            self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
            self.beside, self._executor = node, make_executor()
            self._executor.add_node(node)
            self._executor.add_node(self.node)

        def _on_diagnostics(self, message):
            self.diagnoses += [(status.level, status.message) for status in message.status if status.name == "commander"]

        def offer(self, qos):
            """Start again with another quality of service."""
            self.node.destroy_publisher(self.publisher)
            self.publisher = self.node.create_publisher(JointState, JOINT_STATES, qos)

        def close(self):
            self._executor.shutdown()
            for node in (self.beside, self.node):
                node.destroy_node()

        def until(self, condition, what):
            end = time.monotonic() + PATIENCE
            while not condition():
                assert time.monotonic() < end, f"{what} did not come true in {PATIENCE:.0f} s"
                if time.monotonic() > self._due:  # more of them than the node takes would leave no turn to its timers
                    self.said, self._due = self.said + 1, time.monotonic() + 0.002
                    self.publisher.publish(state(self.names, 2_000_000 * self.said))
                self._executor.spin_once(timeout_sec=0.01)

    yield Driver
    for driver in made:
        driver.close()


def test_a_commander_answers_a_driver_that_is_best_effort_and_one_that_is_reliable(beside):
    driver = beside(CommanderNode(), qos_profile_sensor_data)
    driver.until(lambda: len(driver.answers) > 3, "an answer to best-effort states")
    driver.offer(QoSProfile(depth=10))
    driver.answers.clear()
    driver.until(lambda: len(driver.answers) > 3, "an answer to a driver that was started again with reliable ones")


def test_a_reliable_driver_is_heard_without_a_new_subscription(beside):
    """What is heard in lockstep must not be lost while the quality of service is found out."""
    import rclpy

    node, heard = rclpy.create_node("listener"), []
    states = hear_joint_states(node, heard.append)
    first = states.subscriptions[JOINT_STATES]
    driver = beside(node, QoSProfile(depth=10))
    driver.until(lambda: not states.missing and len(heard) > 3, "a state")
    assert states.subscriptions[JOINT_STATES] is first


def test_who_rests_is_not_sent_anything_and_hears_again_when_it_goes_on(beside):
    import rclpy

    node, heard = rclpy.create_node("listener"), []
    states = hear_joint_states(node, heard.append)
    driver = beside(node, qos_profile_sensor_data)
    driver.until(lambda: len(heard) > 3, "a state")
    states.rest()
    driver.until(lambda: driver.publisher.get_subscription_count() == 0, "that nobody hears the driver")
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
    np.testing.assert_array_equal(node._state.position, list(ANGLES.values()))


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
    driver = beside(CommanderNode(), QoSProfile(depth=10), [name for name in NAMES if name != "wam_j4"])
    driver.until(lambda: any("wam_j4 is missing" in text for _, text in driver.diagnoses), "a diagnosis")
    assert not driver.answers and "config/wam.yaml" in driver.diagnoses[-1][1]
    driver.names = NAMES
    driver.until(lambda: driver.answers, "an answer once all joints are there")


def test_the_law_of_the_simulated_arm_throws_nothing_beside_another_arm(beside):
    """Whoever starts the node by itself beside a real arm gets the parameters of config/: told at once, before anything moves."""
    driver = beside(CommanderNode(), QoSProfile(depth=10))
    client = ActionClient(driver.node, Execute, "/execute")
    driver.until(lambda: driver.answers and client.server_is_ready(), "a commander")
    sent = client.send_goal_async(Execute.Goal(situation=conversions.at_place(np.array([2.0, 0.0, 0.4]))))
    driver.until(sent.done, "an answer to the goal")
    result = sent.result().get_result_async()
    driver.until(result.done, "the result")
    assert result.result().result.code == Execute.Goal.OUTCOME_REFUSED
    assert "tracking is 'hand'" in result.result().result.message and "tracking:=joints" in result.result().result.message


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"name": []}, "0 names, 7 positions"),
        ({"velocity": []}, "0 velocities"),
        ({"name": [*NAMES[:6], "wam_j1"]}, "joint wam_j1 is named twice"),
        ({"name": [f"joint_{k}" for k in range(7)]}, "joint wam_j1 is missing among joint_0"),
    ],
)
def test_a_state_that_is_not_the_arms_is_refused_with_the_remedy(change, why):
    message = state()
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(ValueError, match=f"/joint_states.*{why}.*driver"):
        conversions.arm_state(message)
