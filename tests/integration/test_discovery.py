"""Who can be heard, and by whom: sockets of nodes that stay on this machine listen on loopback
alone, and every plain client finds them.
"""

import os
import socket
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from dart_skill.common.configuration import config_path
from dart_skill_nodes.process.environment import (
    OURS,
    PEERS,
    PROFILES,
    RANGE,
    choose_profile,
    stay_on_this_machine,
)
from tests.integration.conftest import wait_for

EVERYWHERE = "0.0.0.0"


def listening(pid):
    """Address and port of the UDP sockets of a process that have a port of its domain: DDS hears
    them; it sends from others.
    """
    sockets = {
        os.readlink(link)
        for link in Path(f"/proc/{pid}/fd").iterdir()
        if link.exists() or link.is_symlink()
    }
    first = 7400 + 250 * int(os.environ["ROS_DOMAIN_ID"])
    found = []
    for line in Path(f"/proc/{pid}/net/udp").read_text().splitlines()[1:]:
        fields = line.split()
        address, port = fields[1].split(":")
        if f"socket:[{fields[9]}]" in sockets and first <= int(port, 16) < first + 250:
            found.append((socket.inet_ntoa(struct.pack("<I", int(address, 16))), int(port, 16)))
    return found


def test_a_node_listens_on_loopback_alone_and_a_client_without_the_profile_finds_it(make_graph):
    assert not any(name in os.environ for name in PROFILES), "this process is the plain client"
    graph, client = make_graph(None)
    graph.start("coach")
    process = graph.processes["coach"]
    wait_for(client, lambda: "coach" in client.node.get_node_names(), what="the coach")
    assert client.is_simulated(), "it answers"
    heard = listening(process.pid)
    assert heard and {address for address, _ in heard} == {"127.0.0.1"}, heard
    assert EVERYWHERE in {address for address, _ in listening(os.getpid())}, (
        "without the profile DDS listens everywhere"
    )


LATE = """
import time

import rclpy
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from std_msgs.msg import String

rclpy.init()
node, word = rclpy.create_node("reads_the_profile"), serialize_message(String())
says = node.create_publisher(String, "any", QoSProfile(depth=10_000))
for _ in range(5100):  # more than a reader of Fast DDS may hold by default
    says.publish(word)
late = node.create_subscription(String, "any", lambda _: None, 10)
time.sleep(0.3)  # beyond the 70 ms in which the reader asks for all once more
says.publish(word)
with late.handle:
    print("heard" if late.handle.take_message(String, True) else "not heard")
"""


@pytest.mark.parametrize("profile", OURS)
def test_who_listens_late_hears_what_a_writer_of_the_same_process_says_next(profile):
    """Else it heard nothing for another 10,000 messages: a lesson of a teacher who had rested
    ended with 'the state after the reset did not arrive'. Nor does the middleware say that it does
    not know an element of the profile, with which it would go on without.
    """
    profile = {PROFILES[0]: str(config_path(f"fastdds_{profile}.xml"))}
    said = subprocess.run(
        [sys.executable, "-c", LATE],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | profile,
    )
    assert (said.stdout, said.stderr) == ("heard\n", "")


@pytest.fixture
def environment(monkeypatch):
    """Sets variables for one test, and takes away the others of this matter."""

    def set_to(**variables):
        for name in (RANGE, PEERS, *PROFILES):
            monkeypatch.setenv(name, "")  # so that it is put back, whatever the test sets
            monkeypatch.delenv(name)
        for name, value in variables.items():
            monkeypatch.setenv(name, value)

    return set_to


@pytest.mark.parametrize(
    ("variables", "ours"),
    [
        ({}, "network"),
        ({RANGE: "LOCALHOST"}, "loopback"),
        ({RANGE: "SUBNET"}, "network"),
        ({RANGE: "LOCALHOST", PEERS: "robot.local"}, "network"),
    ],
)
def test_the_profile_of_loopback_is_used_where_discovery_is_limited_to_this_machine(
    environment, variables, ours
):
    environment(**variables)
    choose_profile()
    assert chosen() == [config_path(f"fastdds_{ours}.xml")] * 2


def chosen():
    return [Path(os.environ[name]) for name in PROFILES if name in os.environ]


def test_a_profile_of_the_users_stays_and_ours_goes_with_the_range(environment):
    environment(**{PROFILES[0]: "mine.xml"})
    stay_on_this_machine()
    assert chosen() == [Path("mine.xml")]
    environment()
    stay_on_this_machine()
    os.environ[RANGE] = "SUBNET"
    stay_on_this_machine()
    assert chosen() == [config_path("fastdds_network.xml")] * 2
    os.environ[PROFILES[1]] = "mine.xml"
    stay_on_this_machine()
    assert chosen() == [Path("mine.xml")]
