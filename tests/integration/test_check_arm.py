"""`dart-skill check arm` on a real graph whose cameras are registered badly: the truth is known there, and found."""

import json
import signal
import subprocess
import sys

import numpy as np
import pytest
from dart_skill_msgs.msg import WamCommand
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from dart_skill.configuration import node_parameters
from dart_skill.fleet import arm_named
from dart_skill.robot import ArmModel, Command, Impedance, load_registration
from dart_skill.robot._impedance import JointServo
from dart_skill.simulation import MotionCapture
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import COMPLETE, LOOP

from .conftest import wait_for

SEED = 4
MIDDLE = np.array([0.0, -0.9, 0.0, 0.8, 0.0, -0.35, 0.0])
CAMERAS = arm_named("loose_registration")["mock_optitrack"]


class Leader:
    """Leads the simulated arm through postures, and answers every state, as a commander does."""

    def __init__(self, client):
        self._servo = JointServo(Impedance(ArmModel()))
        self._message = WamCommand()
        self._message.header.frame_id = "world"
        self._first_ns, self.count, self.swing = None, 0, 0.5
        self._command = client.node.create_publisher(WamCommand, "/wam/command", COMPLETE)
        client.node.create_subscription(JointState, "/joint_states", self._lead, LOOP)

    def _lead(self, message):
        state = conversions.arm_state(message)
        self._first_ns = self._first_ns or state.stamp_ns
        time = (state.stamp_ns - self._first_ns) * 1e-9
        share = min(1.0, time / 3.0)
        wanted = MIDDLE + share * self.swing * np.sin(time * np.array([0.9, 0.7, 1.1, 0.8, 1.3, 1.0, 1.2]) + np.arange(7))
        torque = self._servo.torque(state.position, state.velocity, wanted, np.zeros(7), np.zeros(7))
        self._command.publish(conversions.fill_command(self._message, Command(state.stamp_ns, joint_torque=torque)))
        self.count += 1


@pytest.fixture(scope="module")
def led(make_shared_graph):
    """A client of simulator and cameras, and the one who leads the arm."""
    graph, client = make_shared_graph(None)
    graph.start("wam_simulator", {"start_posture": MIDDLE.tolist()})
    graph.start("mock_optitrack", {"seed": SEED, **CAMERAS})
    leader = Leader(client)
    wait_for(client, lambda: leader.count > 100, what="an arm that is led")
    return client, leader


def start(*arguments):
    """The command as a process."""
    command = [sys.executable, "-m", "dart_skill.cli", "check", "arm", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True)


def check(led, states, *arguments):
    """Run the command until it has heard so many states, and Ctrl-C: exit status and output."""
    client, leader = led
    process = start("--duration", "100", *arguments)
    wait_for(client, lambda: "_arm_check_raw_batches" in listeners(client), what="the check listens")
    until = leader.count + states
    wait_for(client, lambda: leader.count >= until, what=f"{states} states of an arm that is led")
    process.send_signal(signal.SIGINT)
    output, said = process.communicate(timeout=60.0)
    return process.returncode, output, said


def listeners(client):
    """Names of the nodes that hear the joint states."""
    return [one.node_name for one in client.node.get_subscriptions_info_by_topic("/joint_states")]


def test_the_registration_of_loose_cameras_is_found_and_written(led, tmp_path):
    file = tmp_path / "registration.yaml"
    status, output, said = check(led, 4000, "--write", str(file), "--json")
    told = json.loads(output)
    lines = {one["check"]: one for one in told["lines"]}
    wrong = [one for one in told["lines"] if one["verdict"] == "NO-GO"]
    assert (status, told["go"]) == (0, True), (wrong, said)
    assert told["written"] == str(file)
    assert lines["hand against kinematics"]["verdict"] == lines["postures"]["verdict"] == "GO"
    assert lines["/joint_states: publisher"]["measured"] == "wam_simulator"
    truth, known = MotionCapture({**node_parameters("optitrack.yaml", "mock_optitrack"), **CAMERAS}, SEED), load_registration(file)
    found, (shift, turn) = known.registration, truth._registration
    assert (Rotation.from_quat(found.turn).inv() * Rotation.from_quat(turn)).magnitude() < 1.5e-3
    assert (Rotation.from_quat(found.hand_turn).inv() * Rotation.from_quat(truth._turns[0])).magnitude() < 1.5e-3
    assert np.linalg.norm(np.subtract(found.shift, shift)) < 2.5e-3
    assert np.linalg.norm(np.subtract(found.hand_shift, truth._offsets[0])) < 1.5e-3


def test_a_second_publisher_is_no_go_and_the_table_says_so(led):
    client, _ = led
    second = client.node.create_publisher(JointState, "/joint_states", LOOP)
    status, output, _ = check(led, 1500)
    client.node.destroy_publisher(second)
    assert status == 1
    (line,) = [one for one in output.splitlines() if "/joint_states: publisher" in one]
    assert line.startswith("NO-GO") and "wam_simulator" in line
    assert "end all but one of" in output and "next: mend what says NO-GO" in output


def test_it_listens_until_so_many_postures_were_shown(led):
    client, leader = led
    leader.swing = 0.0
    process = start("--postures", "1")
    wait_for(client, lambda: process.poll() is not None, what="the end of the check")
    output, said = process.communicate()
    assert process.returncode == 1 and "posture 1 of 1" in said
    assert "different postures were seen" in output and "lead the arm through 8 postures" in output


def test_a_file_that_is_there_is_not_written_over(tmp_path):
    file = tmp_path / "registration.yaml"
    file.write_text("mine")
    process = start("--write", str(file))
    _, said = process.communicate(timeout=60.0)
    assert process.returncode == 2 and "exists already" in said and file.read_text() == "mine"
