"""Poses in step with states: what was delivered by a state is taken, however late it comes, and
nobody is waited for in vain.
"""

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from dart_skill_msgs.msg import FramesDelivered
from geometry_msgs.msg import PoseStamped

from dart_skill_nodes.comms import conversions, seen_in_step
from dart_skill_nodes.comms.seen_in_step import SeenInStep

MS = 1_000_000


class Node:
    """What of a node it needs; nothing is sent."""

    cameras = 1

    def create_subscription(self, kind, topic, callback, qos, **_):
        return callback

    def create_timer(self, period, callback, clock=None):
        return callback

    def count_publishers(self, topic):
        assert topic == "simulation/delivered"
        return self.cameras

    def resolve_topic_name(self, topic):
        return topic

    def get_publishers_info_by_topic(self, topic):
        return []


@pytest.fixture
def answered():
    return []


@pytest.fixture
def seen(answered):
    def answer(state, sightings):
        answered.append((state, [(one.body, one.stamp_ns // MS) for one in sightings]))

    made = SeenInStep(Node(), {"hand": "hand", "cup": "mug"}, "world", answer)
    made.begin(0)
    return made


def pose(ms, frame="world", x=0.0, w=1.0):
    message = PoseStamped()
    message.header.frame_id, message.header.stamp = frame, conversions.time_msg(ms * MS)
    message.pose.position.x, message.pose.orientation.w = x, w
    return message


def told(ms, hand, cup):
    newest = [conversions.time_msg(stamp * MS) for stamp in (hand, cup)]
    return FramesDelivered(
        stamp=conversions.time_msg(ms * MS), bodies=["hand", "cup"], newest=newest
    )


def test_a_state_waits_until_all_has_come_that_was_delivered_by_then(seen, answered):
    seen.offer(20 * MS, "twenty")
    seen._on_pose("cup", pose(10))
    assert not answered, "nobody has said that this is all"
    seen._on_delivered(told(20, 10, 10))
    assert not answered, "the hand is on its way"
    seen._on_pose("hand", pose(10))
    assert answered == [("twenty", [("hand", 10), ("cup", 10)])]


def test_what_comes_early_is_for_a_later_state(seen, answered):
    """In another process the poses of the next frame may overtake the state before it."""
    for ms in (10, 20):
        seen._on_pose("hand", pose(ms))
    seen._on_delivered(told(18, 10, 0))
    seen._on_delivered(told(26, 20, 0))
    seen.offer(18 * MS, "one")
    seen.offer(26 * MS, "two")
    assert answered == [("one", [("hand", 10)]), ("two", [("hand", 20)])]


def test_the_next_state_does_not_let_one_wait_longer(seen, answered):
    seen.offer(20 * MS, "twenty")
    seen.offer(20 * MS, "twenty again")
    assert not answered
    seen.offer(22 * MS, "later")
    assert answered == [("twenty", [])]
    seen.end()
    assert [state for state, _ in answered] == ["twenty", "later"] and not seen.goes_on


def test_where_nobody_tells_what_has_come_is_all(seen, answered):
    """As with real cameras, and with simulated ones that have died."""
    seen._node.cameras = 0
    seen._on_pose("cup", pose(14))
    seen._on_pose("hand", pose(12))
    seen.offer(20 * MS, "state")
    assert answered == [("state", [("hand", 12), ("cup", 14)])]


def test_poses_that_are_lost_for_good_hold_up_nobody(seen, answered, monkeypatch):
    seen._on_delivered(told(20, 10, 10))
    seen.offer(20 * MS, "state")
    seen._look()
    assert not answered
    monkeypatch.setattr(seen_in_step, "PATIENCE", -1.0)
    seen._look()
    assert answered == [("state", [])]


def test_what_was_seen_before_the_beginning_does_not_count(seen, answered):
    seen._on_pose("cup", pose(10))
    seen.begin(15 * MS)
    seen._on_pose("cup", pose(20))
    seen._on_delivered(told(24, 0, 20))
    seen.offer(24 * MS, "state")
    assert answered == [("state", [("cup", 20)])]


@pytest.mark.parametrize(
    ("message", "said"),
    [
        (pose(10, frame="camera"), "a pose of the cup is in frame 'camera', not 'world'"),
        (pose(10, x=np.nan), "the cup"),
        (pose(10, w=0.5), "the cup"),
        (pose(-1), "it is stamped -1 s"),
    ],
)
def test_a_pose_that_is_none_is_left_out(seen, message, said):
    with pytest.raises(ValueError, match=said):
        seen._on_pose("cup", message)
    assert seen._newest["cup"] == 0


def test_a_message_whose_parts_are_not_as_many_is_left_out(seen, answered):
    seen.offer(20 * MS, "state")
    with pytest.raises(ValueError, match="shorter|longer"):
        seen._on_delivered(FramesDelivered(stamp=Time(), bodies=["hand", "cup"], newest=[]))
    assert not answered
