"""An arm under joint_trajectory_controller: a throw over DDS through the commander's output
trajectory, and what stops it.
"""

import importlib.util
import os
import signal
import subprocess
import sys
from contextlib import contextmanager

import numpy as np
import pytest
from dart_skill_msgs.action import Execute
from dart_skill_msgs.srv import MoveArm, Plan
from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from dart_skill.arm import CommanderSettings, planned_trajectory, the_arm
from dart_skill.common.world import pose_topic
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import LATCHED
from tests.integration.conftest import Joints, graphs, wait_for
from tests.integration.plan_messages import throw_plan_msg
from tests.integration.trajectory_names import START
from tests.paths import ROOT
from tests.unit.conftest import planned_swing

PLAN = planned_swing()
BUILT = ROOT / "build" / "control_msgs_of_tests"
PATHS = {
    "PYTHONPATH": "lib/python{}.{}/site-packages".format(*sys.version_info),
    "LD_LIBRARY_PATH": "lib",
    "AMENT_PREFIX_PATH": "",
}
COLCON = "from colcon_core.command import main; raise SystemExit(main())"


def build_control_msgs():
    """The two actions of control_msgs, which ROS from wheels lacks, unless they were built since
    they changed.
    """
    package, done = ROOT / "tests" / "interfaces", BUILT / "install" / "setup.sh"
    newest = max(file.stat().st_mtime for file in package.rglob("*") if file.is_file())
    if done.is_file() and done.stat().st_mtime > newest:
        return
    folders = ["--base-paths", package, "--build-base", BUILT / "build"]
    folders += ["--install-base", BUILT / "install", "--merge-install"]
    options = [f"-DPython3_EXECUTABLE={sys.executable}", "-DBUILD_TESTING=OFF"]
    options.append("-DWITHOUT_CPP=ON")
    log = ["--log-base", BUILT / "log"]
    made = subprocess.run(
        [sys.executable, "-c", COLCON, *log, "build", *folders, "--cmake-args", *options],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stdout + made.stderr


@contextmanager
def with_control_msgs():
    """Processes that are started meanwhile find control_msgs."""
    if importlib.util.find_spec("control_msgs"):
        yield
        return
    build_control_msgs()
    before = {name: os.environ.get(name) for name in PATHS}
    for name, below in PATHS.items():
        here = str(BUILT / "install" / below)
        os.environ[name] = os.pathsep.join(filter(None, (here, before[name])))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


class Laboratory:
    """The arm, the commander, who plans and who sees, and a client of /execute."""

    def __init__(self, graph, client):
        self.graph, self.client, self.plan, node = graph, client, PLAN, client.node
        self.joints, self.opened, self.stamps = Joints(client), [], []
        node.create_service(Plan, "/skill_learner/plan", self._answer)
        self._seen = node.create_publisher(PoseStamped, pose_topic("ball"), 10)
        node.create_timer(0.02, self._see)
        node.create_subscription(JointState, "/stand_in/opened", self.opened.append, LATCHED)
        self._hold = node.create_publisher(Bool, "/stand_in/held", 10)
        self._execute = ActionClient(node, Execute, "/execute")
        self._stop = node.create_client(Trigger, "/commander/stop")
        self._reset = node.create_client(Trigger, "/commander/reset")
        self._release = node.create_client(SetBool, "/commander/release_arm")
        self._move = node.create_client(MoveArm, "/commander/move_to")

    def _answer(self, request, response):
        response.success, response.plan = True, throw_plan_msg(self.plan)
        return response

    def _see(self):
        message = PoseStamped()
        message.header.frame_id = "world"
        message.header.stamp = self.client.node.get_clock().now().to_msg()
        message.pose.orientation.w = 1.0
        self._seen.publish(message)

    def wait(self, condition, what):
        wait_for(self.client, condition, what=what)

    def hold(self, held):
        self._hold.publish(Bool(data=held))

    def begin(self):
        """A throw: the future of its result, and the goal's handle."""
        self.wait(self._execute.server_is_ready, "a commander")
        goal = Execute.Goal(situation=conversions.at_place(PLAN.thrown.target))
        goal.header.frame_id = "world"
        sent = self._execute.send_goal_async(goal)
        self.wait(sent.done, "an answer to the goal")
        assert sent.result().accepted
        return sent.result().get_result_async(), sent.result()

    def end(self, result):
        self.wait(result.done, "the end of the throw")
        return result.result().result

    def back(self):
        """The arm is held where the throw begins, and may move."""
        self.wait(lambda: self.joints.fastest < 0.01, "an arm at rest")
        self.client.call(self._reset, Trigger.Request(), may_refuse=True)
        self.wait(self._moves, "an arm that may move")
        self.wait(self._is_held, "an arm that is held")
        off = np.abs(np.array(self.joints.message.position) - START).max()
        assert off < 0.02, off

    def _moves(self):
        request = MoveArm.Request(posture=list(START))
        return self.client.call(self._move, request, may_refuse=True).success

    def _is_held(self):
        """It cannot be held anew while it moves."""
        request = SetBool.Request(data=False)
        return self.client.call(self._release, request, may_refuse=True).success

    def stop(self):
        return self.client.call(self._stop, Trigger.Request())


@pytest.fixture(scope="module", params=[500, 125])
def laboratory(request, ros, tmp_path_factory):
    with with_control_msgs(), graphs(tmp_path_factory.mktemp("trajectory")) as make:
        graph, client = make(None)
        arm = subprocess.Popen(
            [sys.executable, "-m", "tests.integration.trajectory_stand_in", str(request.param)],
            cwd=ROOT,
        )
        try:
            graph.start("commander", {"output": "trajectory", "watch_time": 0.3})
            laboratory = Laboratory(graph, client)
            laboratory.wait(lambda: laboratory.joints.count > 10, "joint states")
            yield laboratory
        finally:
            arm.send_signal(signal.SIGINT)
            arm.wait(20)


def test_a_throw_is_executed_and_the_hand_is_told_where_the_plan_tells_it(laboratory):
    before = len(laboratory.opened)
    result = laboratory.end(laboratory.begin()[0])
    assert result.code == Execute.Goal.OUTCOME_EXECUTED, result.message
    laboratory.wait(lambda: len(laboratory.opened) > before, "an open hand")
    settings = CommanderSettings.configured(output="trajectory")
    course = planned_trajectory(PLAN, settings, the_arm())
    times = np.arange(0.0, course.duration, 1e-3)
    there = np.array(laboratory.opened[-1].position)
    near = [np.linalg.norm(course.at(time)[0] - there) for time in times]
    # the arm goes on by a state or two until the message is there
    assert times[int(np.argmin(near))] == pytest.approx(PLAN.open_hand, abs=0.03)
    laboratory.back()


def test_stop_cancels_the_trajectory_and_the_client_is_told(laboratory):
    result, _ = laboratory.begin()
    laboratory.wait(lambda: laboratory.joints.fastest > 0.5, "an arm that throws")
    laboratory.stop()
    ended = laboratory.end(result)
    assert ended.code == Execute.Goal.OUTCOME_STOPPED and "stopped by ~/stop" in ended.message
    laboratory.back()


def test_a_client_that_cancels_stops_the_arm(laboratory):
    result, handle = laboratory.begin()
    laboratory.wait(lambda: laboratory.joints.fastest > 0.5, "an arm that throws")
    handle.cancel_goal_async()
    assert "cancelled" in laboratory.end(result).message
    laboratory.back()


def test_an_arm_that_is_held_is_stopped_and_the_client_is_told(laboratory):
    result, _ = laboratory.begin()
    laboratory.wait(lambda: laboratory.joints.fastest > 0.5, "an arm that throws")
    laboratory.hold(True)
    ended = laboratory.end(result)
    assert ended.code == Execute.Goal.OUTCOME_STOPPED, ended.message
    assert "trajectory" in ended.message, ended.message
    laboratory.hold(False)
    laboratory.back()


def test_a_plan_that_the_joints_cannot_do_is_refused_before_anything_moves(laboratory):
    laboratory.plan = planned_swing(duration=0.5, release=0.25)
    try:
        ended = laboratory.end(laboratory.begin()[0])
    finally:
        laboratory.plan = PLAN
    assert ended.code == Execute.Goal.OUTCOME_REFUSED and "limit" in ended.message
    assert laboratory.joints.fastest < 0.01
