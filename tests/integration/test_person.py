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

from dart_skill.arm import the_arm
from dart_skill.common.situation import Pose
from dart_skill.common.world import ROLES
from dart_skill.recording import HAND
from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.client import person as person_module
from dart_skill_nodes.client.person import LOOK, PersonAtTheArm
from dart_skill_nodes.client.service_calls import ServiceCalls
from dart_skill_nodes.comms.conversions import pose_msg, time_msg
from dart_skill_nodes.comms.coroutines import start
from dart_skill_nodes.process.graph_processes import GraphFailure
from tests.integration.conftest import until

SECOND = 1_000_000_000
QUARTER = np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
PARAMETERS = {"frame_id": "world", "longest_wait": 60.0, "stand_back": 1.0}
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
        name=[joint.name for joint in the_arm().joints],
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
            name=[joint.name for joint in the_arm().joints],
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


def test_an_arm_on_its_way_is_not_asked_to_be_held(told, monkeypatch):
    """Who held it, as the coach asked after 2 s of every longer way, ended practice: the remedy
    was one of an arm that is free.
    """
    monkeypatch.setattr(person_module, "HINT", 0.0)
    said = []
    told.person.ask = said.append
    told.until(lambda: told.say("moving", newest=5) and said)
    assert set(said) == {
        "the arm is still on its way, the commander says 'moving': wait until it rests"
    }
    told.until(lambda: told.say("free") and len(set(said)) > 1)
    assert said[-1].endswith("hold it (/commander/release_arm with data: false)")


class Beside:
    """A person beside an arm that practises a skill: the test says what the cameras see, and that the
    commander holds the arm.
    """

    def __init__(self, name):
        self.skill, self.node, self.said = load_skill(name), rclpy.create_node("person"), []
        names = {role: role for role in (HAND, *self.skill.bodies)}
        calls = ServiceCalls(self.node)
        self.person = PersonAtTheArm(self.node, self.skill, calls, names, PARAMETERS)
        self.person.ask, self.person._mode = self.said.append, "holding"
        self._ns, self._executor = SECOND, SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self.poses = {HAND: Pose(np.zeros(3))}

    def see(self):
        """A frame of the cameras, and a state of the arm."""
        self._ns += SECOND // 20
        message = JointState(name=[joint.name for joint in the_arm().joints])
        message.position = message.velocity = [0.0] * 7
        message.header.stamp = time_msg(self._ns)
        self.person._on_state(serialize_message(message))
        for role, pose in self.poses.items():
            seen = PoseStamped(pose=pose_msg(pose))
            seen.header.frame_id, seen.header.stamp = "world", time_msg(self._ns)
            self.person._taker(role)(serialize_message(seen))

    def ask(self, coroutine):
        """What comes of what the person is asked: results, and errors."""
        ended = []
        start(self.node, coroutine, lambda result, error: ended.append(error or result))
        return ended

    def until(self, condition):
        def turn():
            self.see()
            self._executor.spin_once(timeout_sec=0.01)

        until(condition, turn, lambda: f"what follows {self.said}")

    def until_said(self, words):
        self.until(lambda: words in self.said)

    def result(self, ended):
        """The result of what the person was asked."""
        self.until(lambda: ended)
        (result,) = ended
        assert not isinstance(result, Exception), (result, self.said)
        return result

    def close(self):
        self._executor.shutdown()
        self.node.destroy_node()


@pytest.fixture
def beside(ros):
    made = []

    def make(name):
        made.append(Beside(name))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_a_dart_is_put_into_the_hand_and_the_board_hangs_where_it_hangs(beside):
    darts = beside("darts")
    bull, seat = np.array(darts.skill.bull), Pose(np.array([0.0, 0.0, 0.1]))
    hang = darts.skill.words.stand
    darts.poses |= {"board": Pose(bull + [0.0, 0.1, 0.0]), "dart": Pose(np.ones(3))}
    stands = darts.ask(darts.person.stand({}))
    darts.until(lambda: any("hang it there, or say there" in said for said in darts.said))
    assert hang == darts.said[0] and hang in darts.said[-1] and not stands
    darts.poses["board"] = Pose(bull)
    places = darts.result(stands)
    assert places["board"].position == pytest.approx(bull)
    ready = darts.ask(darts.person.ready(seat, places))
    darts.until_said("put the dart into the hand, then stand back")
    darts.poses["dart"] = seat
    assert darts.result(ready).keys() == {"board"}
    assert darts.said[-1] == "stand back: the arm throws in 1 s"


def test_an_aim_at_the_board_that_has_no_plan_asks_nobody_to_hang_the_board_elsewhere(beside):
    darts = beside("darts")
    places = {"board": Pose(np.array(darts.skill.bull))}
    (error,) = darts.ask(darts.person.stand_elsewhere(places, "too far to the right"))
    assert str(error) == "too far to the right" and not darts.said


def test_the_arm_waits_for_the_cup_to_move_and_its_hand_stays_empty(beside):
    reach, cup = beside("reach"), Pose(np.array([0.6, 0.1, 1.1]))
    reach.poses["cup"] = cup
    places = reach.result(reach.ask(reach.person.stand({})))
    ready = reach.ask(reach.person.ready(None, places))
    reach.until_said("stand back: the belt may start in 1 s")
    reach.until_said("start the belt: the arm reaches as soon as the cup moves")
    for _ in range(20):
        reach.see()
    assert not ready and "put the cup into the hand, then stand back" not in reach.said
    reach.poses["cup"] = Pose(cup.position + [0.0, 0.03, 0.0])
    assert reach.result(ready) == places


def test_a_cup_that_moves_before_the_person_has_stood_back_is_asked_for_again(beside):
    reach, cup = beside("reach"), Pose(np.array([0.6, 0.1, 1.1]))
    reach.poses["cup"] = cup
    ready = reach.ask(reach.person.ready(None, {"cup": cup}))
    reach.until_said("stand back: the belt may start in 1 s")
    reach.poses["cup"] = Pose(cup.position + [0.0, 0.2, 0.0])
    assert reach.result(ready) is None


def test_a_holder_is_asked_for_at_a_pose_and_where_the_arm_can_serve_it(beside):
    place, wanted = beside("place"), Pose(np.array([0.6, 0.1, 1.2]), QUARTER)
    place.poses |= {"holder": Pose(np.array([1.2, 0.1, 1.2])), "part": Pose(np.ones(3))}
    stands = place.ask(place.person.stand({"holder": wanted, "part": wanted}))
    text = "put the holder at x 0.60, y 0.10, z 1.20 m, turned by +90 degrees"
    place.until(lambda: any("put it between 0.42 and 0.75 m from there" in s for s in place.said))
    assert place.said[0] == text
    place.poses["holder"] = Pose(wanted.position)
    move = (
        "the holder is seen elsewhere: move it by x +0.00, y +0.00, z +0.00 m, and turn it by +90"
    )
    place.until_said(f"{text}: {move} degrees")
    place.poses["holder"] = wanted
    assert place.result(stands)["holder"].apart(wanted) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_a_part_that_leaves_the_hand_while_the_person_stands_back_is_asked_for_again(beside):
    place, seat = beside("place"), Pose(np.array([0.0, 0.0, 0.14]))
    holder = Pose(np.array([0.6, 0.1, 1.2]))
    place.poses |= {"holder": holder, "part": seat}
    ready = place.ask(place.person.ready(seat, {"holder": holder}))
    place.until_said("stand back: the arm places it in 1 s")
    place.poses["part"] = Pose(np.array([0.0, 0.3, 0.0]))
    load = place.skill.words.load
    place.until(lambda: any(said.endswith(f"hand: {load}") for said in place.said))
    assert not ready
    place.poses["part"] = seat
    assert place.result(ready)["holder"].position == pytest.approx(holder.position)
