"""What is known of an arm beside which a person stands."""

import time

import numpy as np
import pytest
import rclpy
from dart_skill_msgs.srv import MoveArm
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from dart_skill.robot import wam_description
from dart_skill.world import ROLES
from dart_skill_nodes.client.failures import CallFailed
from dart_skill_nodes.client.person import Patience, Person
from dart_skill_nodes.client.service_calls import ServiceCalls
from dart_skill_nodes.comms.coroutines import start

SECOND = 1_000_000_000


@pytest.fixture
def person(ros):
    node = rclpy.create_node("beside_an_arm")
    yield Person(node, ServiceCalls(node), "world", {role: role for role in ROLES}, Patience(1.0, 1.0, 0.1, 0.1))
    node.destroy_node()


def test_a_state_from_before_a_throw_does_not_say_where_the_arm_is_after_it(person):
    """States may come seconds late on a busy machine: the arm seemed to be at its start, and was not brought back."""
    with pytest.raises(ValueError, match="no state of the arm has come"):
        person._check_heard(0)
    message = JointState(name=[joint.name for joint in wam_description().joints], position=np.zeros(7), velocity=np.zeros(7))
    message.header.stamp.sec = 5
    person._on_state(serialize_message(message))
    assert person._check_heard(5 * SECOND)
    with pytest.raises(ValueError, match="since it was thrown with"):
        person._check_heard(6 * SECOND)


def test_an_arm_that_stops_on_its_way_is_not_waited_for(person):
    """The coach said after 23 s that the arm is not where the throw begins, and not what the commander had stopped it for."""
    commander, ended = rclpy.create_node("commander"), []
    says = commander.create_publisher(DiagnosticArray, "/diagnostics", 10)
    asked = []
    commander.create_service(Trigger, "/commander/stop", lambda *_: Trigger.Response(success=True))
    commander.create_service(MoveArm, "/commander/move_to", lambda request, _: asked.append(request) or MoveArm.Response(success=True))

    def say(mode, last=""):
        values = [KeyValue(key="mode", value=mode), KeyValue(key="last", value=last)]
        says.publish(DiagnosticArray(status=[DiagnosticStatus(name="commander", values=values)]))

    executor = SingleThreadedExecutor()
    for node in (person._node, commander):
        executor.add_node(node)
    message = JointState(name=[joint.name for joint in wam_description().joints], position=np.zeros(7), velocity=np.zeros(7))
    person._on_state(serialize_message(message))
    start(person._node, person.bring(np.full(7, 0.3)), lambda result, error: ended.append(error))
    spin(executor, lambda: asked)
    spin(executor, lambda: say("moving") or person._mode == "moving")
    assert not ended
    spin(executor, lambda: say("holding", "no /joint_states for 0.6 s") or ended)
    assert isinstance(ended[0], CallFailed) and "stopped on its way" in str(ended[0]) and "for 0.6 s" in str(ended[0])
    executor.shutdown()  # it holds what it has waited for: the node would stay on the graph, and the next command find a commander there
    commander.destroy_node()


def spin(executor, condition, limit=30.0):
    until = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < until
        executor.spin_once(timeout_sec=0.05)
