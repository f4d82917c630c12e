"""What is known of an arm beside which a person stands."""

import numpy as np
import pytest
import rclpy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from dart_skill.robot import wam_description
from dart_skill.world import ROLES
from dart_skill_nodes.client.person import Patience, Person
from dart_skill_nodes.client.service_calls import ServiceCalls

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
