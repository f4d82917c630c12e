"""When the time of the arm is said to stand still, on a clock that the test makes up; and whether a
process was frozen: stopped is frozen, and waiting for a core, or computing, is not.
"""

import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest
from std_msgs.msg import Bool

from dart_skill_nodes.comms import joint_states, this_machine
from dart_skill_nodes.comms.joint_states import HELD_LONG, STANDS, InOrder, TimeOfTheArm
from dart_skill_nodes.comms.this_machine import LEASE, LOOK, FreezeDetector


class Node:
    """Has one subscription, and a clock that goes on when it is told."""

    def __init__(self):
        self.now = 0.0

    def create_subscription(self, kind, topic, callback, qos):
        self.hear = callback


@pytest.fixture
def node(monkeypatch):
    node = Node()
    monkeypatch.setattr(joint_states, "time", SimpleNamespace(monotonic=lambda: node.now))
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


ASKS = """
import sys, time
from dart_skill_nodes.comms.this_machine import FreezeDetector
asked = FreezeDetector()
print("asks", flush=True)
while not (frozen := asked.frozen()):
    time.sleep(0.05)
print(frozen, flush=True)
"""


@pytest.mark.parametrize(
    ("gap", "busy", "frozen"),
    [
        (0.1, 0.0, 0.0),
        (LEASE - 0.1, 0.0, 0.0),
        (LEASE + 1.0, 0.1, LEASE + 0.9),
        (LEASE + 1.0, 1.1, 0.0),
        (20.0, 19.9, 0.0),
    ],
)
def test_what_counts_is_the_time_without_work_and_without_wanting_any(
    monkeypatch, gap, busy, frozen
):
    now = {"time": 100.0, "busy": 7.0}
    monkeypatch.setattr(this_machine, "busy_time", lambda: now["busy"])
    monkeypatch.setattr(this_machine.time, "monotonic", lambda: now["time"])
    asked = FreezeDetector()
    for _ in range(100):  # a busy life before does not count
        now["time"], now["busy"] = now["time"] + 0.1, now["busy"] + 0.09
        assert asked.frozen() == 0.0
    now["time"], now["busy"] = now["time"] + gap, now["busy"] + busy
    assert asked.frozen() == pytest.approx(frozen, abs=0.3)
    assert asked.frozen() == 0.0, "it is told once"


def test_a_thread_that_computes_is_busy_and_one_that_sleeps_is_not():
    before, until = this_machine.busy_time(), time.process_time() + 0.2
    while time.process_time() < until:
        pass
    computed = this_machine.busy_time()
    time.sleep(0.2)
    assert computed - before > 0.15 and this_machine.busy_time() - computed < 0.1


def test_a_process_that_is_stopped_by_a_signal_knows_it_afterwards():
    with subprocess.Popen(
        [sys.executable, "-c", ASKS], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline().strip() == "asks"
        process.send_signal(signal.SIGSTOP)
        stopped = time.monotonic()
        while time.monotonic() < stopped + LEASE + 0.5:
            time.sleep(0.05)
        process.send_signal(signal.SIGCONT)
        assert float(process.stdout.readline()) > LEASE
