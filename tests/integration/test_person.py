"""What is known of an arm beside which a person stands."""

import time

import numpy as np
import pytest
import rclpy
from dart_skill_msgs.srv import MoveArm
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from dart_skill.arm import wam_description
from dart_skill.common.world import ROLES
from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.client.person import LOOK, PersonAtTheArm
from dart_skill_nodes.client.service_calls import ServiceCalls
from dart_skill_nodes.comms.coroutines import start
from dart_skill_nodes.process.graph_processes import GraphFailure
from tests.integration.conftest import until

SECOND = 1_000_000_000
PARAMETERS = {"frame_id": "world", "longest_wait": 1.0, "stand_back": 1.0}
PARAMETERS |= {"seat_tolerance": 0.1, "body_tolerance": 0.1}


@pytest.fixture
def person(ros):
    node = rclpy.create_node("beside_an_arm")
    yield PersonAtTheArm(
        node,
        load_skill("throw"),
        ServiceCalls(node),
        {role: role for role in ROLES},
        PARAMETERS,
    )
    node.destroy_node()


def test_a_state_from_before_a_throw_does_not_say_where_the_arm_is_after_it(person):
    """States may come seconds late on a busy machine: the arm seemed to be at its start, and was
    not brought back.
    """
    with pytest.raises(ValueError, match="no state of the arm has come"):
        person._check_heard(0)
    message = JointState(
        name=[joint.name for joint in wam_description().joints],
        position=np.zeros(7),
        velocity=np.zeros(7),
    )
    message.header.stamp.sec = 5
    person._on_state(serialize_message(message))
    assert person._check_heard(5 * SECOND)
    with pytest.raises(ValueError, match="since the last throw"):
        person._check_heard(6 * SECOND)


class Told:
    """A commander that moves the arm when it is asked to, says what the test has it say, and an
    arm at a posture.
    """

    def __init__(self, person):
        self.person, self.node, self.asked, self.ended = (
            person,
            rclpy.create_node("commander"),
            [],
            [],
        )
        self._says = self.node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.node.create_service(
            Trigger, "/commander/stop", lambda *_: Trigger.Response(success=True)
        )
        self.node.create_service(MoveArm, "/commander/move_to", self._on_move)
        self.executor = SingleThreadedExecutor()
        for node in (person._node, self.node):
            self.executor.add_node(node)

    def _on_move(self, request, response):
        self.asked.append(request)
        response.success = True
        return response

    def say(self, mode, last="", newest=0):
        """Say a mode, and the time of the newest state [s]; whether the person has heard it."""
        pairs = {"mode": mode, "last": last, "newest_state_ns": str(newest * SECOND)}
        values = [KeyValue(key=key, value=value) for key, value in pairs.items()]
        self._says.publish(
            DiagnosticArray(status=[DiagnosticStatus(name="commander", values=values)])
        )
        return self.person._mode == mode

    def arm_is_at(self, angle, seconds):
        message = JointState(
            name=[joint.name for joint in wam_description().joints],
            position=np.full(7, angle),
            velocity=np.zeros(7),
        )
        message.header.stamp.sec = seconds
        self.person._on_state(serialize_message(message))

    def cameras_see(self, seconds):
        message = PoseStamped()
        message.header.frame_id, message.header.stamp.sec, message.pose.orientation.w = (
            "world",
            seconds,
            1.0,
        )
        self.person._taker("ball")(serialize_message(message))

    def until(self, condition):
        until(condition, lambda: self.executor.spin_once(timeout_sec=0.05))

    def close(self):
        # it holds what it has waited for: the node would stay on the graph, and the next find a
        # commander there
        self.executor.shutdown()
        self.node.destroy_node()


@pytest.fixture
def told(person):
    commander = Told(person)
    commander.arm_is_at(0.0, 5)
    start(
        person._node,
        person.bring(np.full(7, 0.3)),
        lambda result, error: commander.ended.append(error),
    )
    commander.until(lambda: commander.asked)
    commander.until(lambda: commander.say("moving"))
    assert not commander.ended
    yield commander
    commander.close()


def test_an_arm_that_stops_on_its_way_is_not_waited_for(told):
    """The coach said after 23 s that the arm is not where the throw begins, and not what the
    commander had stopped it for.
    """
    told.until(lambda: told.say("holding", "no /joint_states for 0.6 s", newest=5) and told.ended)
    assert (
        isinstance(told.ended[0], GraphFailure)
        and "stopped on its way" in str(told.ended[0])
        and "for 0.6 s" in str(told.ended[0])
    )


def test_states_that_come_after_the_word_that_the_arm_is_held_say_where_it_is(told):
    """On a busy machine the commander said that it holds the arm before its last states had come:
    it "stopped on its way".
    """
    told.until(lambda: told.say("holding", newest=9))
    end = time.monotonic() + 5 * LOOK
    told.until(lambda: time.monotonic() > end)
    assert not told.ended
    told.arm_is_at(0.3, 9)
    told.cameras_see(9)
    told.until(lambda: told.ended)
    assert told.ended == [None]
