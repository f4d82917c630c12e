"""Poses of one body may lag behind those of another: each has a topic, and what got lost on one of them is repeated seconds later."""

import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.serialization import serialize_message

from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.tracked_bodies import FRAME_NS, REPAIRED, TrackedBodies

GIGA = 1_000_000_000


@pytest.fixture
def tracked():
    """Hand, ball and basket, seen for a second and a frame."""
    bodies = TrackedBodies("world", pytest.fail)
    for role in ("hand", "ball", "basket"):
        see(bodies, role, 0, GIGA + FRAME_NS)
    return bodies


def see(bodies, role, first_ns, last_ns):
    for ns in range(first_ns, last_ns + 1, FRAME_NS):
        message = PoseStamped()
        message.header.frame_id = "world"
        conversions.set_stamp(message.header.stamp, ns)
        bodies.take(role, serialize_message(message))


def test_nobody_is_late_when_all_has_come(tracked):
    assert tracked.has_frames_until(GIGA) and not tracked.is_late("ball", GIGA, 0.0)
    assert not tracked.has_frames_until(GIGA + 1), "the next frame may be on its way"


def test_a_body_that_lags_is_late_until_it_comes(tracked):
    see(tracked, "hand", GIGA, 2 * GIGA)
    assert tracked.has_frames_until(2 * GIGA - FRAME_NS)
    assert tracked.is_late("ball", 2 * GIGA, 0.0) and not tracked.is_late("hand", 2 * GIGA, 0.0)
    assert tracked.farthest_behind[1] == GIGA + FRAME_NS
    see(tracked, "ball", GIGA, 2 * GIGA)
    assert not tracked.is_late("ball", 2 * GIGA, 0.1)


def test_a_body_that_is_hidden_is_not_waited_for_longer_than_a_loss_takes(tracked):
    assert tracked.is_late("ball", 2 * GIGA, 100.0)
    assert tracked.is_late("ball", 2 * GIGA, 100.0 + 0.9 * REPAIRED)
    assert not tracked.is_late("ball", 2 * GIGA, 100.1 + REPAIRED)
    assert tracked.is_late("basket", 2 * GIGA, 100.1 + REPAIRED), "each body has its own time"


def test_a_few_frames_without_a_body_are_not_waited_for(tracked):
    assert not tracked.is_late("ball", GIGA + 10 * FRAME_NS, 0.0)


def test_a_body_that_was_never_seen_is_not_late():
    assert not TrackedBodies("world", pytest.fail).is_late("ball", GIGA, 0.0)
