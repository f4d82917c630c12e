"""An arm under effort control in real time: held through commander and bridge, and damped when
something is wrong.
"""

import signal
import subprocess
import sys

import numpy as np
import pytest
from dart_skill_msgs.msg import WamCommand
from std_msgs.msg import Bool, Float64MultiArray
from std_srvs.srv import Trigger

from dart_skill.common.configuration import node_parameters
from dart_skill_nodes.comms.qos import LATCHED
from tests.integration.conftest import Diagnoses, Joints, wait_for
from tests.integration.effort_stand_in import NAMES, START
from tests.paths import ROOT

SETTINGS = node_parameters("effort_bridge.yaml", "effort_bridge")
PATIENT = 5.0
"""Timeouts of the bridge here, the longest that it takes: a busy machine is no fault of a commander
[s].
"""


class Laboratory:
    """The arm, the bridge and the commander, and what is seen of them."""

    def __init__(self, graph, client):
        self.graph, self.client, self.efforts, self.opened = graph, client, None, []
        self.joints, self.said = Joints(client), Diagnoses(client)
        self.reset = client.node.create_client(Trigger, "/effort_bridge/reset")
        self.speeds = client.node.create_publisher(Float64MultiArray, "/stand_in/speeds", 10)
        client.node.create_subscription(
            Float64MultiArray, "/effort_controller/commands", self._take, 10
        )
        client.node.create_subscription(
            Bool,
            "/effort_bridge/hand_open",
            lambda message: self.opened.append(message.data),
            LATCHED,
        )

    def _take(self, message):
        self.efforts = np.array(message.data)[::-1]

    @property
    def position(self):
        return np.array(self.joints.message.position)

    @property
    def phase(self):
        return self.said.values.get("effort_bridge", {}).get("phase")

    @property
    def message(self):
        return self.said.of.get("effort_bridge", "")

    def wait(self, condition, what):
        wait_for(self.client, condition, what=what)

    def watch(self, states):
        """So many more joint states."""
        until = self.joints.count + states
        self.wait(lambda: self.joints.count >= until, f"{states} joint states")

    def go(self):
        """Reset the bridge until it carries commands out."""

        def active():
            if self.phase != "active":
                self.client.call(self.reset, Trigger.Request(), may_refuse=True)
                self.watch(50)
            return self.phase == "active"

        self.wait(active, "a bridge that carries commands out")


@pytest.fixture(scope="module")
def laboratory(make_shared_graph):
    graph, client = make_shared_graph(None)
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.integration.effort_stand_in"], cwd=ROOT
    )
    try:
        graph.start(
            "effort_bridge",
            {
                "controller_joints": NAMES[::-1],
                "command_timeout": PATIENT,
                "state_timeout": PATIENT,
            },
        )
        graph.start("commander", {"tracking": "joints"})
        laboratory = Laboratory(graph, client)
        laboratory.wait(lambda: laboratory.phase == "active", "a bridge that carries commands out")
        yield laboratory
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(20)


def test_the_arm_is_held_against_gravity_by_commander_and_bridge(laboratory):
    laboratory.watch(500)
    assert np.abs(laboratory.position - START).max() < 0.05, laboratory.position
    assert laboratory.joints.fastest < 0.1
    assert np.abs(laboratory.efforts).max() > 10.0, "nothing else holds it"
    assert laboratory.phase == "active" and laboratory.message == "active"


def test_a_second_commander_stops_the_arm_until_it_is_reset(laboratory):
    second = laboratory.client.node.create_publisher(WamCommand, "/wam/command", 10)
    laboratory.wait(lambda: laboratory.phase == "stopped", "a bridge that stops")
    assert "2 nodes publish commands" in laboratory.message
    refused = laboratory.client.call(laboratory.reset, Trigger.Request(), may_refuse=True)
    assert not refused.success and "2 nodes" in refused.message
    laboratory.client.node.destroy_publisher(second)
    laboratory.go()


def test_when_the_commander_is_gone_a_moving_arm_is_damped_to_rest(laboratory):
    """It stays damped when somebody commands it again, until the bridge is reset; then the hand is
    opened, too. The last test.
    """
    commander = laboratory.graph.processes.pop("commander")
    # one that is killed stays on the graph for 20 s, and its successor is the second one there
    commander.send_signal(signal.SIGINT)
    commander.wait(20)
    laboratory.wait(lambda: laboratory.phase == "stopped", "a bridge that stops")
    assert (
        "no command for" in laboratory.message and "is the commander running" in laboratory.message
    )
    before = laboratory.efforts[0]
    laboratory.speeds.publish(Float64MultiArray(data=[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    laboratory.wait(lambda: laboratory.efforts[0] < before - 1.0, "a damping effort")
    laboratory.wait(lambda: laboratory.joints.fastest < 0.02, "an arm at rest")
    assert np.abs(laboratory.position - START).max() < 0.5
    assert (np.abs(laboratory.efforts) <= np.array(SETTINGS["torque_limit"]) + 1e-9).all()
    commands = laboratory.client.node.create_publisher(WamCommand, "/wam/command", 10)

    def tell(grip):
        message = WamCommand(grip=grip)
        message.header.stamp, message.header.frame_id = (
            laboratory.joints.message.header.stamp,
            "world",
        )
        commands.publish(message)
        laboratory.watch(1)

    for _ in range(100):
        tell(WamCommand.GRIP_OPEN)
    assert laboratory.phase == "stopped" and not laboratory.opened
    assert laboratory.client.call(laboratory.reset, Trigger.Request()).success
    laboratory.wait(lambda: tell(WamCommand.GRIP_OPEN) or laboratory.opened, "a hand that opens")
    assert laboratory.opened == [True]
    laboratory.wait(
        lambda: tell(WamCommand.GRIP_OPEN) or laboratory.phase == "active",
        "a bridge that carries commands out",
    )
    laboratory.client.node.destroy_publisher(commands)
