"""`dart-skill check arm` on a real graph whose cameras are registered badly: the truth is known
there, and found.
"""

import json
import signal
import subprocess

import numpy as np
import pytest
from dart_skill_msgs.msg import WamCommand
from dart_skill_msgs.srv import Plan
from geometry_msgs.msg import PoseStamped
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from dart_skill.arm import (
    ArmModel,
    Command,
    Registration,
    RegistrationFit,
    Speed,
    fit_registration,
    load_registration,
    save_registration,
)
from dart_skill.common.configuration import node_parameters
from dart_skill.common.fleet import arm_named
from dart_skill.recording import read_demonstrations
from dart_skill.simulation import MotionCapture
from dart_skill.skills.observation import sightings
from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.commands import CommandWriter
from dart_skill_nodes.comms.names import remapped
from dart_skill_nodes.comms.qos import COMPLETE, LOOP
from tests.integration.conftest import plan_request, wait_for, wait_for_end
from tests.paths import BAGS

SEED = 4
MIDDLE = np.array([0.0, -0.9, 0.0, 0.8, 0.0, -0.35, 0.0])
STIFFNESS = np.array([900.0, 2500.0, 600.0, 500.0, 50.0, 50.0, 8.0])
"""With which the arm is led; these are the gains of the arm's vendor [N m/rad]."""
DAMPING = np.array([10.0, 20.0, 5.0, 2.0, 0.5, 0.5, 0.05])
"""The same for its speed [N m s/rad]."""
STRONGEST = np.array([25.0, 20.0, 15.0, 15.0, 5.0, 5.0, 5.0])
"""Most torque of each joint with which it is led [N m]."""
CAMERAS = arm_named("loose_registration")["mock_optitrack"]


class Leader:
    """Leads the simulated arm through postures, and answers every state, as a commander does."""

    def __init__(self, client):
        self._writer = CommandWriter(0, "world")
        self._first_ns, self.count, self.swing, self.fastest = None, 0, 0.5, np.inf
        self._swings = 0.0
        self._command = client.node.create_publisher(WamCommand, "/wam/command", COMPLETE)
        client.node.create_subscription(JointState, "/joint_states", self._lead, LOOP)

    def _lead(self, message):
        state = conversions.arm_state(message)
        self._first_ns = self._first_ns or state.stamp_ns
        time = (state.stamp_ns - self._first_ns) * 1e-9
        self._swings += np.clip(self.swing - self._swings, -5e-4, 5e-4)  # nobody jerks an arm
        wanted = MIDDLE + self._swings * np.sin(
            time * np.array([0.9, 0.7, 1.1, 0.8, 1.3, 1.0, 1.2]) + np.arange(7)
        )
        torque = STIFFNESS * (wanted - state.position) - DAMPING * state.velocity
        torque = np.clip(torque, -STRONGEST, STRONGEST)
        self._command.publish(
            self._writer.write(Command(state.stamp_ns, joint_torque=torque, speed=Speed.THROW))
        )
        self.count += 1
        self.fastest = np.abs(state.velocity).max()


@pytest.fixture(scope="module")
def led(make_shared_graph):
    """A client of simulator and cameras, the one who leads the arm, and the graph."""
    graph, client = make_shared_graph(None)
    graph.start("wam_simulator", {"start_posture": MIDDLE.tolist()})
    graph.start("mock_optitrack", {"seed": SEED, **CAMERAS})
    leader = Leader(client)
    wait_for(client, lambda: leader.count > 100, what="an arm that is led")
    return client, leader, graph


class Check:
    """The command as a process; what it says meanwhile goes into a file."""

    def __init__(self, folder, *arguments):
        self._said = folder / "said.txt"
        command = ["dart-skill", "check", "arm", *arguments]
        with self._said.open("w") as said:
            self.process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=said, stdin=subprocess.DEVNULL, text=True
            )

    @property
    def said(self):
        return self._said.read_text()

    def listens(self):
        """Whether it hears arm and cameras."""
        assert self.process.poll() is None, self.said
        return "arm and cameras are heard" in self.said

    def end(self):
        """Exit status and output, when it has ended."""
        output, _ = self.process.communicate(timeout=60.0)
        return self.process.returncode, output


def check(led, folder, states, *arguments, said=""):
    """Run the command until it has said something and heard so many states, and Ctrl-C: exit
    status, output, and what it said meanwhile.
    """
    client, leader, _ = led
    running = Check(folder, "--duration", "100", *arguments)
    wait_for(
        client,
        lambda: running.listens() and said in running.said,
        what=f"the check listens, and says '{said}'",
    )
    until = leader.count + states
    wait_for(client, lambda: leader.count >= until, what=f"{states} states of an arm that is led")
    running.process.send_signal(signal.SIGINT)
    return *running.end(), running.said


def test_the_registration_of_loose_cameras_is_found_and_written(led, tmp_path):
    file = tmp_path / "registration.yaml"
    status, output, said = check(led, tmp_path, 3000, "--write", str(file), "--json")
    told = json.loads(output)
    lines = {one["check"]: one for one in told["lines"]}
    wrong = [one for one in told["lines"] if one["verdict"] == "NO-GO"]
    assert not wrong and (status, told["go"]) == (0, True), (wrong, said)
    assert told["written"] == str(file)
    assert lines["hand against kinematics"]["verdict"] == lines["postures"]["verdict"] == "GO"
    assert lines["/joint_states: publisher"]["measured"] == "wam_simulator"
    truth, known = (
        MotionCapture({**node_parameters("optitrack.yaml", "mock_optitrack"), **CAMERAS}, SEED),
        load_registration(file),
    )
    found, (shift, turn) = known.registration, truth._registration
    assert (Rotation.from_quat(found.turn).inv() * Rotation.from_quat(turn)).magnitude() < 1.5e-3
    assert (
        Rotation.from_quat(found.hand_turn).inv() * Rotation.from_quat(truth._turns[0])
    ).magnitude() < 1.5e-3
    assert np.linalg.norm(np.subtract(found.shift, shift)) < 2.5e-3
    assert np.linalg.norm(np.subtract(found.hand_shift, truth._offsets[0])) < 1.5e-3


@pytest.mark.slow
def test_a_second_publisher_is_no_go_and_the_table_says_so(led, tmp_path):
    client, *_ = led
    second = client.node.create_publisher(JointState, "/joint_states", LOOP)
    status, output, _ = check(led, tmp_path, 1500, said="/joint_states: 2 publishers: ")
    client.node.destroy_publisher(second)
    assert status == 1
    (line,) = [one for one in output.splitlines() if "/joint_states: publisher" in one]
    assert line.startswith("NO-GO") and "wam_simulator" in line
    assert "end all but one of" in output and "next: mend what says NO-GO" in output


def test_a_name_of_remap_stands_for_all_topics_that_begin_with_it():
    topics = ("joint_states", "vrpn_mocap/hand/pose", "vrpn_mocap/ball/pose")
    assert remapped(topics, {"/vrpn_mocap": "/lab/mocap/", "joint_states": "/wam/joints"}) == {
        "joint_states": "/wam/joints",
        "vrpn_mocap/hand/pose": "/lab/mocap/hand/pose",
        "vrpn_mocap/ball/pose": "/lab/mocap/ball/pose",
    }
    with pytest.raises(ValueError, match="/mocap:=/x: there is no such topic, only /joint_states"):
        remapped(topics, {"/mocap": "/x"})


def test_the_bodies_are_those_of_the_skill(led, tmp_path):
    """Who teaches the arm to place was told that ball and basket are missing."""
    client, *_ = led
    asked = Check(tmp_path, "--duration", "1", "--json", "--skill", "place")
    wait_for(client, lambda: asked.process.poll() is not None, what="the end of the check")
    lines = {one["check"]: one for one in json.loads(asked.end()[1])["lines"]}
    for name in load_skill("place").bodies:
        assert lines[f"/vrpn_mocap/{name}/pose"]["measured"] == "nobody publishes it"
    assert not any("ball" in name or "basket" in name for name in lines)
    none = subprocess.run(
        ["dart-skill", "check", "arm", "--skill", "juggle"], capture_output=True, text=True
    )
    assert none.returncode == 2 and "no skill 'juggle': choose one of darts" in none.stderr


def test_topics_of_another_prefix_are_heard(led, tmp_path):
    """An arm whose cameras publish elsewhere was NO-GO, though the nodes can be remapped."""
    client, *_ = led
    poses = client.node.create_publisher(PoseStamped, "/lab/mocap/hand/pose", COMPLETE)
    listening = Check(tmp_path, "--duration", "4", "--json", "--remap", "/vrpn_mocap:=/lab/mocap")

    def publishes():
        poses.publish(PoseStamped())
        return listening.process.poll() is not None

    wait_for(client, publishes, what="the end of the check")
    lines = {one["check"]: one for one in json.loads(listening.end()[1])["lines"]}
    heard = lines["/lab/mocap/hand/pose: publisher"]
    assert heard["verdict"] == "GO", heard
    assert not [name for name in lines if name.startswith("/vrpn_mocap")]


@pytest.mark.slow
def test_learner_and_commander_start_from_the_file(led, tmp_path):
    """A file that says 30 mm where thirteen throws say none is felt, though they outweigh it; one
    that is none ends the node.
    """
    client, _, graph = led
    file, none = tmp_path / "registration.yaml", tmp_path / "none.yaml"
    save_registration(file, far_and_firm())
    none.write_text("registration: of voters")
    graph.start("skill_learner", {"registration_file": str(file)})
    graph.start("commander", {"registration_file": str(none)})
    ended = wait_for_end(graph, client, "commander")
    assert ended.returncode != 0
    said = (graph.logs / "commander.log").read_text()
    assert f"{none} is no registration file" in said and "dart-skill check arm --write" in said
    client.wait_for_learner()
    client.learn(bag=str(BAGS / "demonstrations"))
    planner = client.node.create_client(Plan, "/skill_learner/plan")
    plan = client.call(planner, plan_request(np.array([1.9, 0.1, 0.4]))).plan
    alone = fit_registration(
        [sightings(one, ArmModel()) for one in read_demonstrations(BAGS / "demonstrations")]
    ).shift[0]
    assert abs(alone) < 0.003 and alone + 0.003 < plan.base.translation.x < 0.03


def far_and_firm():
    """A fit whose base stands 3 cm from where the cameras' world has it, known to 2 mm."""
    registration = Registration(shift=(0.03, 0.0, 0.0))
    return RegistrationFit(registration, np.full(13, 1e-6), 0.0, 0.0, 0.0, 0.0, 10, 1.0, 1.0)


@pytest.mark.slow
def test_it_listens_until_so_many_postures_were_shown(led, tmp_path):
    client, leader, _ = led
    leader.swing = 0.0
    wait_for(client, lambda: leader.fastest < 0.01, what="an arm at rest")
    running = Check(tmp_path, "--postures", "1")
    wait_for(client, lambda: running.process.poll() is not None, what="the end of the check")
    status, output = running.end()
    assert status == 1 and "posture 1 of 1" in running.said
    assert "different postures were seen" in output and "lead the arm through 8 postures" in output
