"""Who is still there: a process that is killed or frozen is missed, one that is busy or held up
for a while is not.
"""

import signal
import subprocess
import sys
import time
from functools import partial

import pytest
import rclpy
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile
from std_msgs.msg import Empty, String
from std_srvs.srv import Trigger

from dart_skill_nodes.comms.presence import PULSE, Presence, be_alive, others, servers
from dart_skill_nodes.comms.this_machine import LEASE, LOOK
from tests.integration.conftest import until

BUSY = """
import rclpy
from std_srvs.srv import Trigger
from dart_skill_nodes.comms.presence import be_alive
from dart_skill_nodes.comms import this_machine
if {elsewhere}:
    this_machine._machine = lambda: "another machine"
rclpy.init()
node = rclpy.create_node("{name}")
be_alive(node)
node.create_service(Trigger, "~/serve", lambda request, response: response)
while True:
    sum(range(10**6))  # and never spins
"""


ALIVE = QoSProfile(
    depth=16,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    liveliness=LivelinessPolicy.AUTOMATIC,
    liveliness_lease_duration=Duration(seconds=LEASE),
)
"""How a node says that it lives."""


@pytest.fixture
def node(ros):
    node = rclpy.create_node("watching")
    yield node
    node.destroy_node()


@pytest.fixture
def start():
    """Starts a node that is busy with Python code, in a process of its own."""
    started = []

    def go(elsewhere=False, name="busy"):
        started.append(
            subprocess.Popen([sys.executable, "-c", BUSY.format(elsewhere=elsewhere, name=name)])
        )
        return started[-1]

    yield go
    for process in started:
        process.kill()
        process.wait()


def come(node, count=1, name="busy"):
    """Those who serve, as soon as so many do, and one at least lives."""
    found = []

    def are_there():
        found.append(servers(node, f"/{name}/serve"))
        return found[-1].count >= count and not found[-1].gone

    until(are_there, what=f"{count} of {name}")
    # it has said so: who dies before that is missed only when its lease is over
    time.sleep(4 * PULSE)
    return found[-1]


def wait_until_gone(presence):
    until(lambda: presence.gone, what="that it is missed")


@pytest.mark.slow
def test_a_process_that_is_busy_is_there_and_one_that_is_killed_or_frozen_is_not(node, start):
    process = start()
    there = come(node)
    assert str(there) == "busy"
    process.send_signal(signal.SIGSTOP)
    wait_until_gone(there)
    process.send_signal(signal.SIGCONT)
    again = come(node)
    assert not again.gone and there.gone, "met anew"
    process.kill()
    wait_until_gone(again)
    second = start()
    new = come(node, count=2)  # the one that was killed stays on the graph for 20 s
    assert again.gone and not new.gone
    second.kill()
    wait_until_gone(new)


@pytest.mark.slow
def test_it_is_known_since_when_a_process_is_frozen_whoever_is_looked_at(node, start):
    """Who asks for it later does not wait for a lease that begins only then."""
    process, other = start(name="frozen"), rclpy.create_node("other")
    be_alive(other)
    other.create_publisher(Empty, "/heard", 1)
    there = come(node, name="frozen")
    process.send_signal(signal.SIGSTOP)
    end = time.monotonic() + LEASE + 1.0
    until(lambda: time.monotonic() > end, lambda: (others(node, "/heard"), time.sleep(LOOK)))
    assert there.gone
    other.destroy_node()


def test_a_process_of_another_machine_is_missed_when_its_lease_is_over(node, start):
    process = start(elsewhere=True)
    there = come(node)
    assert not there.gone
    process.kill()
    wait_until_gone(there)


def test_a_process_that_was_killed_before_it_was_met_is_missed(node, start):
    """It never told this process anything, and DDS keeps it on the graph for 20 s."""
    process = start()
    seen = partial(node.get_publishers_info_by_topic, "/busy/_alive")
    until(seen, lambda: time.sleep(0.005), "the process")
    process.kill()
    process.wait()
    killed, there = time.monotonic(), servers(node, "/busy/serve")
    while there and not there.gone:
        time.sleep(0.05)
        there = servers(node, "/busy/serve")
    assert there.gone and time.monotonic() - killed < 15.0, "only the middleware missed it"


def test_who_takes_a_place_is_not_taken_for_the_one_that_left_it(node, start):
    """Until it has said which process it is: a slow machine takes a while for that."""
    process = start(name="left")
    there = come(node, name="left")
    process.send_signal(signal.SIGINT)
    process.wait()
    wait_until_gone(there)
    until(
        lambda: not node.get_publishers_info_by_topic("/left/_alive"),
        lambda: time.sleep(0.05),
        "that it has left the graph",
    )
    second = rclpy.create_node("left")
    second.create_publisher(String, "~/_alive", ALIVE)  # and has said nothing yet
    second.create_service(Trigger, "~/serve", lambda request, response: response)
    until(lambda: servers(node, "/left/serve"), lambda: time.sleep(0.05), "another one")
    assert not servers(node, "/left/serve").gone
    second.destroy_node()


def test_nodes_of_one_process_do_not_miss_each_other_and_nobody_is_never_gone(node):
    other = rclpy.create_node("other")
    be_alive(other)
    other.create_service(Trigger, "~/serve", lambda request, response: response)
    until(lambda: servers(node, "/other/serve"), what="the other")
    there = servers(node, "/other/serve")
    assert not there.gone
    other.destroy_node()
    wait_until_gone(there)
    assert not Presence(node, lambda: []).gone
