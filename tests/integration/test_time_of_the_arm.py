"""When the time of the arm is said to stand still, on a clock that the test makes up."""

from types import SimpleNamespace

import pytest
from std_msgs.msg import Bool

from dart_skill_nodes.comms import time_of_the_arm
from dart_skill_nodes.comms.joint_states import InOrder
from dart_skill_nodes.comms.presence import LOOK
from dart_skill_nodes.comms.time_of_the_arm import HELD_LONG, STANDS, TimeOfTheArm


class Node:
    """Has one subscription, and a clock that goes on when it is told."""

    def __init__(self):
        self.now = 0.0

    def create_subscription(self, kind, topic, callback, qos):
        self.hear = callback


@pytest.fixture
def node(monkeypatch):
    node = Node()
    monkeypatch.setattr(time_of_the_arm, "time", SimpleNamespace(monotonic=lambda: node.now))
    return node


def pass_time(node, arm, seconds, step=LOOK):
    """Look again and again, as a timer does."""
    for _ in range(round(seconds / step)):
        node.now += step
        arm.look()


def test_time_that_stands_still_is_noticed_unless_somebody_holds_it(node):
    arm = TimeOfTheArm(node)
    node.hear(Bool(data=False))
    pass_time(node, arm, STANDS - LOOK)
    assert not arm.stalled
    pass_time(node, arm, 2 * LOOK)
    assert "stood still" in arm.stalled
    arm.goes_on()
    assert not arm.stalled
    node.hear(Bool(data=True))
    pass_time(node, arm, 3 * STANDS)
    assert not arm.stalled
    node.hear(Bool(data=False))
    assert not arm.stalled
    pass_time(node, arm, STANDS + LOOK)
    assert arm.stalled


def test_who_waits_for_a_world_that_somebody_holds_is_told_what_lets_it_run(node):
    arm = TimeOfTheArm(node)
    node.hear(Bool(data=True))
    pass_time(node, arm, HELD_LONG - LOOK)
    assert not arm.held, "as before every trial"
    pass_time(node, arm, 3 * LOOK)
    assert "/simulation/pause with data: false" in arm.held
    node.hear(Bool(data=False))
    pass_time(node, arm, 3 * STANDS)
    assert not arm.held


def test_nobody_knows_it_of_an_arm_that_says_nothing_of_its_time(node):
    arm = TimeOfTheArm(node)
    pass_time(node, arm, 3 * STANDS)
    assert not arm.stalled


def test_whoever_was_held_up_itself_does_not_blame_the_arm(node):
    arm = TimeOfTheArm(node)
    node.hear(Bool(data=False))
    pass_time(node, arm, 3 * STANDS, step=STANDS)
    assert not arm.stalled


def test_a_state_that_was_late_is_refused_and_time_that_was_set_back_is_not():
    heard = []
    hear = InOrder(heard.append, lambda ns: ns)
    for ns in (2, 4, 4, 6):
        hear(ns)
    with pytest.raises(
        ValueError, match="stamped 4 ns, and came after the one of 6 ns: out of order"
    ):
        hear(4)
    hear(8)
    with pytest.raises(ValueError, match="out of order"):
        hear(1)
    hear(3)
    hear(5)
    assert heard == [2, 4, 4, 6, 8, 3, 5]
