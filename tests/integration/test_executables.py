"""Every node starts by itself with `ros2 run`, and ends without complaint when it is told to."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from ament_index_python import get_package_prefix

from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.comms.this_machine import running
from tests.integration.conftest import until
from tests.paths import ROOT
from tests.warm import WarmPopen

COLD = True

NODES = {
    "wam_simulator": {"wam_simulator"},
    "mock_optitrack": {"mock_optitrack"},
    "demonstration_recorder": {"demonstration_recorder"},
    "skill_learner": {"skill_learner"},
    "commander": {"commander"},
    "effort_bridge": {"effort_bridge"},
    "teacher": {"teacher"},
    "coach": {"coach"},
    "recorder": {"recorder"},
    "viewer": {"viewer"},
    "composed": {
        "wam_simulator",
        "mock_optitrack",
        "commander",
        "demonstration_recorder",
        "teacher",
        "coach",
    },
}
TOGETHER = ("wam_simulator", "mock_optitrack", "teacher", "coach")
"""Nodes that are hardly ever started by themselves: `composed` begins them, too, and other tests
give each a process of its own.
"""
PATIENCE = 60.0
"""For a node to start, and to end [s, wall clock]."""
ARGUMENTS = {"viewer": ["--ros-args", "-p", "port:=0"]}


@pytest.fixture
def warm(monkeypatch):
    """For what a node says once it has begun: that each of them begins is found out by the first
    test.
    """
    monkeypatch.setattr(subprocess, "Popen", WarmPopen)


@pytest.mark.parametrize(
    "executable",
    [pytest.param(name, marks=[pytest.mark.slow] * (name in TOGETHER)) for name in NODES],
)
def test_starts_with_ros2_run_and_ends_on_sigint(tmp_path, executable):
    names, said = {f"/{name}" for name in NODES[executable]}, tmp_path / "log"
    command = ["ros2", "run", "dart_skill", executable, *ARGUMENTS.get(executable, [])]
    with said.open("wb") as log:
        process = subprocess.Popen(
            command, cwd=tmp_path, stdout=log, stderr=log, start_new_session=True
        )
    try:
        until(lambda: running(names) == names or process.poll() is not None, what=said.read_text)
        assert process.poll() is None, said.read_text()
        os.killpg(process.pid, signal.SIGINT)  # as Ctrl-C does: `ros2 run` hands nothing on
        assert process.wait(PATIENCE) == 0, said.read_text()
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    for complaint in ("Traceback", "Error occurred", "context is invalid"):
        assert complaint not in said.read_text()


@pytest.mark.parametrize("executable", NODES)
def test_the_help_of_a_node_starts_nothing_and_tells_its_parameters(warm, tmp_path, executable):
    command = ["ros2", "run", "dart_skill", executable, "--help"]
    asked = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert asked.returncode == 0 and asked.stdout.startswith(
        f"usage: ros2 run dart_skill {executable}"
    ), asked
    assert ("  skill " in asked.stdout or "  bag " in asked.stdout) or executable in (
        "composed",
        "effort_bridge",
    ), asked.stdout
    assert not list(tmp_path.iterdir()), "a recorder began a bag"


def test_what_a_node_does_not_take_is_said(warm, tmp_path):
    command = ["ros2", "run", "dart_skill", "bag_player"]
    wrong = subprocess.run(
        [*command, "bags/throws"], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    said = wrong.stderr.splitlines()
    assert (
        "bag_player: 'bags/throws' is not understood: parameters are given as --ros-args -p"
        " NAME:=VALUE" in said
    )
    assert wrong.returncode != 0
    mistyped = [
        *command,
        "--ros-args",
        "-p",
        "raet:=0.0",
        "-p",
        f"bag:={ROOT / 'bags/throws'}",
        "-p",
        "duration:=0.01",
    ]
    played = subprocess.run(mistyped, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert (
        played.returncode == 0
        and "there is no parameter 'raet' here" in played.stdout + played.stderr
    ), played


@pytest.fixture
def commander(warm, ros, tmp_path):
    """Starts a commander, its log in a file of its number; all end with the test."""
    started = []

    def start(*arguments):
        command = [sys.executable, "-m", "dart_skill_nodes.executables.commander", *arguments]
        with open(tmp_path / f"{len(started)}.log", "wb") as log:
            started.append(subprocess.Popen(command, cwd=tmp_path, stdout=log, stderr=log))
        return started[-1], tmp_path / f"{len(started) - 1}.log"

    yield start
    for process in started:
        if process.poll() is None:
            process.kill()
            process.wait()


def until_running(names):
    until(
        lambda: running(names) == set(names),
        what=lambda: f"all of {names}, of which there is only {running(names)},",
    )


def test_a_node_whose_name_is_taken_does_not_start(commander):
    """`ros2 launch` of a graph that ran already put two commanders on one arm."""
    first, _ = commander()
    until_running(["/commander"])
    second, log = commander()
    assert second.wait(60) == 1
    domain = os.environ.get("ROS_DOMAIN_ID", "0")
    assert (
        log.read_text()
        .splitlines()[0]
        .startswith(
            f"commander: /commander runs on this machine in ROS domain {domain} already: end it"
        )
    )
    assert "Traceback" not in log.read_text() and first.poll() is None
    commander("--ros-args", "-r", "__ns:=/arm2")
    commander("--ros-args", "-r", "__node:=spare")
    until_running(["/commander", "/arm2/commander", "/spare"])


def test_a_name_is_free_again_when_its_process_was_killed(commander):
    first, _ = commander()
    until_running(["/commander"])
    first.kill()
    second, log = commander()
    first.wait()
    until_running(["/commander"])
    assert second.poll() is None, log.read_text()


def test_a_node_that_is_destroyed_gives_its_name_back(ros):
    for _ in range(2):
        node = GuardedNode("passing")
        with pytest.raises(ValueError, match="/passing runs on this machine"):
            GuardedNode("passing")
        node.destroy_node()


def test_a_node_that_is_told_to_end_while_it_loads_says_nothing(tmp_path):
    """`ros2 launch` ends its nodes as soon as one of them cannot start: the others still import."""
    command = [Path(get_package_prefix("dart_skill"), "lib/dart_skill/composed")]
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    maps = Path(f"/proc/{process.pid}/maps")
    # of the library, which comes before ROS is up
    until(lambda: "numpy" in maps.read_text(), lambda: time.sleep(0.002))
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 0 and b"Traceback" not in said, said.decode()


@pytest.mark.parametrize(
    "home", [{}, {"HOME": "/proc/nowhere"}], ids=["none", "not to be written to"]
)
def test_a_user_without_a_home_has_the_graph_all_the_same(home, tmp_path):
    """rcl writes its logs there, and ended a verb with a traceback."""
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in ("HOME", "ROS_HOME", "ROS_LOG_DIR")
    }
    environment |= {**home, "TMPDIR": str(tmp_path), "ROS_DOMAIN_ID": "99"}
    status = [sys.executable, "-m", "dart_skill", "status", "--duration", "0.1"]
    asked = subprocess.run(
        status, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=60
    )
    assert asked.returncode == 1 and asked.stderr.startswith(
        "dart-skill status: nothing runs in ROS domain 99"
    ), asked


CANNOT = {
    "demonstration_recorder": (["-p", "basket_radius:=.nan"], "basket_radius"),
    "teacher": (["-p", "seed:=text"], "seed"),
    "composed": (["-p", "wam_simulator:mass_scale:=[1.0, 1.0]"], "mass_scale"),
    "viewer": (["-p", "host:=no.such.host.invalid"], "no.such.host.invalid"),
    "skill_learner": (["--params-file", "nowhere.yaml"], "'--params-file nowhere.yaml'"),
    "bag_player": (["-p", "bag:=nowhere"], "nowhere: no such bag"),
}


@pytest.mark.parametrize("executable", CANNOT)
def test_a_node_that_cannot_start_says_why_in_a_line_and_ends(warm, tmp_path, executable):
    arguments, reason = CANNOT[executable]
    command = [
        sys.executable,
        "-m",
        f"dart_skill_nodes.executables.{executable}",
        "--ros-args",
        *arguments,
    ]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    told = ended.stdout + ended.stderr
    assert ended.returncode == 1 and "Traceback" not in told, told
    assert reason in told.splitlines()[-1] and told.splitlines()[-1].startswith(executable), told


def test_a_node_that_lacks_a_package_says_which(tmp_path):
    """rclpy keeps what goes wrong in a change of state to itself."""
    package = tmp_path / "tf2_msgs"
    package.mkdir()
    (package / "__init__.py").write_text("raise ModuleNotFoundError('No module named tf2_msgs')")
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]),
    }
    command = ["ros2", "run", "dart_skill", "mock_optitrack"]
    done = subprocess.run(
        command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    said = (
        "mock_optitrack did not start: not configured: ModuleNotFoundError at __init__.py:1: No"
        " module named tf2_msgs"
    )
    assert done.returncode == 1 and said in done.stderr and "Traceback" not in done.stderr, (
        done.stderr
    )
