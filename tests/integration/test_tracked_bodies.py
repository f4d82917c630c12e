"""Poses of one body may lag behind those of another: each has a topic, and what got lost on one of
them is repeated seconds later.
"""

import re

import numpy as np
import pytest
import rclpy
from dart_skill_msgs.msg import WamCommand
from dart_skill_msgs.srv import Judge, StopDemonstration
from geometry_msgs.msg import PoseStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from dart_skill.common.constants import NS_PER_S
from dart_skill.common.world import ROLES, joint_names, pose_topic
from dart_skill.recording import read_demonstrations
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import COMPLETE
from dart_skill_nodes.comms.tracked_bodies import FRAME_NS, REPAIRED, TrackedBodies
from dart_skill_nodes.executables.demonstration_recorder import DemonstrationRecorder
from tests.integration.conftest import wait_for
from tests.paths import BAGS


class Wall:
    """A clock that stands still until it is set."""

    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def wall():
    return Wall()


@pytest.fixture
def tracked(wall):
    """Hand, ball and basket, seen for a second and a frame."""
    bodies = TrackedBodies("world", pytest.fail, wall)
    for role in ("hand", "ball", "basket"):
        see(bodies, role, 0, NS_PER_S + FRAME_NS)
    return bodies


def see(bodies, role, first_ns, last_ns):
    for ns in range(first_ns, last_ns + 1, FRAME_NS):
        message = PoseStamped()
        message.header.frame_id = "world"
        conversions.set_stamp(message.header.stamp, ns)
        bodies.take(role, serialize_message(message))


def test_nobody_is_late_when_all_has_come(tracked):
    assert tracked.has_frames_until(NS_PER_S) and not tracked.is_late("ball", NS_PER_S)
    assert not tracked.has_frames_until(NS_PER_S + 1), "the next frame may be on its way"


def test_a_body_that_lags_is_late_until_it_comes(tracked):
    see(tracked, "hand", NS_PER_S, 2 * NS_PER_S)
    assert tracked.has_frames_until(2 * NS_PER_S - FRAME_NS)
    assert tracked.is_late("ball", 2 * NS_PER_S) and not tracked.is_late("hand", 2 * NS_PER_S)
    assert tracked.farthest_behind[1] == NS_PER_S + FRAME_NS
    see(tracked, "ball", NS_PER_S, 2 * NS_PER_S)
    assert not tracked.is_late("ball", 2 * NS_PER_S)


def test_a_body_that_is_hidden_is_not_waited_for_longer_than_a_loss_takes(tracked, wall):
    assert tracked.is_late("ball", 2 * NS_PER_S)
    wall.now += 0.9 * REPAIRED
    assert tracked.is_late("ball", 2 * NS_PER_S)
    wall.now += 0.2 * REPAIRED
    assert not tracked.is_late("ball", 2 * NS_PER_S)
    assert tracked.is_late("basket", 2 * NS_PER_S), "each body has its own time"


def test_a_body_lags_from_when_the_others_went_on_without_it(tracked, wall):
    """A world that was held meanwhile does not count, and neither does when somebody asks."""
    wall.now += 1000.0
    see(tracked, "hand", NS_PER_S, 2 * NS_PER_S)
    wall.now += 0.9 * REPAIRED
    assert tracked.is_late("ball", 2 * NS_PER_S)
    wall.now += 0.2 * REPAIRED
    assert not tracked.is_late("ball", 2 * NS_PER_S) and not tracked.is_late(
        "ball", 2 * NS_PER_S - FRAME_NS
    )
    see(tracked, "ball", NS_PER_S, NS_PER_S + FRAME_NS)
    see(tracked, "hand", 2 * NS_PER_S, 3 * NS_PER_S)
    assert tracked.is_late("ball", 3 * NS_PER_S), "it came, and lags anew"


def test_a_body_that_others_are_seen_without_is_hidden_until_it_is_seen(tracked, wall):
    see(tracked, "ball", NS_PER_S, 2 * NS_PER_S)
    wall.now += 0.9 * REPAIRED
    assert not tracked.hidden("hand"), "it may be on its way"
    wall.now += 0.2 * REPAIRED
    assert "without the hand for 4 s" in tracked.hidden("hand") and not tracked.hidden("ball")
    see(tracked, "hand", NS_PER_S, 2 * NS_PER_S)
    assert not tracked.hidden("hand")


def test_a_few_frames_without_a_body_are_not_waited_for(tracked):
    assert not tracked.is_late("ball", NS_PER_S + 10 * FRAME_NS)


def test_a_body_that_was_never_seen_is_not_late():
    assert not TrackedBodies("world", pytest.fail).is_late("ball", NS_PER_S)


RIM = np.array([2.0, 0.0, 0.4])
OPENED_NS, UNTIL_NS = NS_PER_S, 2 * NS_PER_S
CALLS = {"start": Trigger, "stop": StopDemonstration}


def poses(role, first_ns, last_ns):
    """What cameras say at 100 Hz of a hand and a basket that rest, and of a ball that flies into
    the basket from 2 m above the floor.
    """
    for ns in range(first_ns, last_ns + 1, FRAME_NS):
        time = max(0.0, 1e-9 * (ns - OPENED_NS))
        place = {
            "hand": (0.0, 0.0, 2.0),
            "basket": RIM,
            "ball": (3.5 * time, 0.0, max(0.2, 2.0 - 0.5 * 9.81 * time**2)),
        }[role]
        message = PoseStamped()
        message.header.frame_id, message.header.stamp = "world", conversions.time_msg(ns)
        message.pose.position, message.pose.orientation.w = conversions.point(np.array(place)), 1.0
        yield message


def test_a_throw_is_not_judged_by_half_a_flight(make_graph, tmp_path):
    """The ball's poses come later than the others': the recorder says so, and what it says of the
    landing is said by all of them.
    """
    graph, client = make_graph(None)
    graph.start("demonstration_recorder", {"bag": str(tmp_path / "bag")})
    publishers = {
        role: client.node.create_publisher(PoseStamped, pose_topic(role), COMPLETE)
        for role in ROLES
    }
    judge = client.node.create_client(Judge, "/demonstration_recorder/judge")
    client.reach(judge)
    wait_for(
        client,
        lambda: all(one.get_subscription_count() for one in publishers.values()),
        what="a recorder that hears all bodies",
    )
    asked = Judge.Request(
        situation=conversions.at_place(RIM),
        told=conversions.time_msg(OPENED_NS),
        until=conversions.time_msg(UNTIL_NS),
    )

    def publish(role, first_ns, last_ns):
        for message in poses(role, first_ns, last_ns):
            publishers[role].publish(message)

    def answer():
        return client.call(judge, asked, may_refuse=True)

    publish("ball", 0, OPENED_NS + 300_000_000)
    for role in ("basket", "hand"):
        publish(role, 0, UNTIL_NS + FRAME_NS)
    wait_for(
        client,
        lambda: "of the ball up to" in answer().message,
        what="a recorder that misses the ball",
    )
    assert answer().pending
    publish("ball", OPENED_NS + 310_000_000, UNTIL_NS)
    wait_for(client, lambda: not answer().pending, limit=0.9 * REPAIRED, what="a judgement")
    assert answer().outcome.seen
    assert answer().outcome.error == pytest.approx(
        abs(3.5 * np.sqrt(2.0 * 1.6 / 9.81) - RIM[0]), abs=0.02
    )


@pytest.fixture
def stranger(ros):
    """A node of somebody else, whose name no other test has used: Fast DDS may remember those that
    are gone.
    """
    node = rclpy.create_node("driver_without_stamps")
    yield node
    node.destroy_node()


def test_stop_says_at_once_that_the_arm_was_stretched(ros, monkeypatch, tmp_path):
    """It was kept without a word, and so were four of four."""
    shown = read_demonstrations(BAGS / "demonstrations")[0]
    monkeypatch.chdir(tmp_path)
    node = DemonstrationRecorder()
    node.observer.recording = True
    monkeypatch.setattr(node.observer, "cut", lambda *_: shown)
    said = {}
    for why in ("", "the arm was stretched: bend the elbow"):
        monkeypatch.setattr(node._learner, "strain", lambda one, why=why: why)
        said[why] = StopDemonstration.Response()
        node._on_stop(StopDemonstration.Request(keep=True), said[why])
    well, stretched = said.values()
    node.destroy_node()
    assert (well.readable, well.message) == (True, "")
    assert stretched.readable and stretched.message == (
        f"kept, but the arm was stretched: bend the elbow; better drop {shown.id}, and show it again"
    )


def test_poses_that_nobody_stamped_are_told_by_the_recorder(make_graph, stranger, tmp_path):
    graph, client = make_graph(None)
    graph.start("demonstration_recorder", {"bag": str(tmp_path / "bag")})
    topics = {
        **{pose_topic(role): PoseStamped for role in ROLES},
        "/joint_states": JointState,
        "/wam/command": WamCommand,
    }
    publishers = {
        topic: stranger.create_publisher(kind, topic, COMPLETE) for topic, kind in topics.items()
    }
    calls = {
        name: client.node.create_client(kind, f"/demonstration_recorder/{name}")
        for name, kind in CALLS.items()
    }
    for call in calls.values():
        client.reach(call)
    wait_for(
        client,
        lambda: all(one.get_subscription_count() for one in publishers.values()),
        what="a recorder that hears all",
    )
    said = []

    def publish(first_ns, last_ns):
        rest = [0.0] * len(joint_names())
        for message in poses("hand", first_ns, last_ns):
            stamp = message.header.stamp
            for role in ROLES:
                message.header.stamp = conversions.time_msg(0) if role == "hand" else stamp
                publishers[pose_topic(role)].publish(message)
            state = JointState(
                header=Header(stamp=stamp), name=list(joint_names()), position=rest, velocity=rest
            )
            publishers["/joint_states"].publish(state)
            publishers["/wam/command"].publish(
                WamCommand(header=Header(stamp=stamp), grip=WamCommand.GRIP_OPEN)
            )

    def answer(name):
        said.append(client.call(calls[name], CALLS[name].Request(), may_refuse=True))
        return said[-1]

    publish(OPENED_NS, UNTIL_NS)
    wait_for(client, lambda: answer("start").success, what=lambda: f"the start: {said[-1]}")
    publish(UNTIL_NS + FRAME_NS, UNTIL_NS + NS_PER_S)
    told = (
        r"only 1 samples of the hand, and \d+ that do not count: not numbers, or stamped no later"
    )
    wait_for(
        client,
        lambda: re.search(told, answer("stop").message),
        what=lambda: f"what is wrong with the stamps: {said[-1]}",
    )
