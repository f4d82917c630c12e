"""Every node starts by itself with `ros2 run`, is seen on the graph, and ends without complaint when it is told to."""

import shutil
import signal
import subprocess
import sys

import pytest
import rclpy

from dart_skill_nodes.process.node_base import make_executor

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
    "composed": {"wam_simulator", "mock_optitrack", "commander", "demonstration_recorder", "teacher", "coach"},
}
ARGUMENTS = {"viewer": ["--ros-args", "-p", "port:=0"]}


@pytest.mark.parametrize("executable", NODES)
def test_starts_with_ros2_run_and_ends_on_sigint(ros, tmp_path, executable):
    node = rclpy.create_node(f"observer_of_{executable}")
    executor = make_executor()
    executor.add_node(node)
    log = open(tmp_path / "log", "wb")
    command = [shutil.which("ros2"), "run", "dart_skill", executable, *ARGUMENTS.get(executable, [])]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=log, stderr=log)
    try:
        for _ in range(300):
            executor.spin_once(timeout_sec=0.1)
            if NODES[executable] <= set(node.get_node_names()):
                break
            assert process.poll() is None, (tmp_path / "log").read_text()
        else:
            pytest.fail(f"{NODES[executable]} never appeared, only {node.get_node_names()}")
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0, (tmp_path / "log").read_text()
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
        log.close()
        node.destroy_node()
    text = (tmp_path / "log").read_text()
    for complaint in ("Traceback", "Error occurred", "context is invalid"):
        assert complaint not in text, text


CANNOT = {
    "demonstration_recorder": (["-p", "basket_radius:=.nan"], "basket_radius"),
    "teacher": (["-p", "seed:=text"], "seed"),
    "composed": (["-p", "wam_simulator:mass_scale:=[1.0]"], "mass_scale"),
    "viewer": (["-p", "host:=no.such.host.invalid"], "no.such.host.invalid"),
    "bag_player": (["-p", "bag:=nowhere"], "nowhere: no such bag"),
}


@pytest.mark.parametrize("executable", CANNOT)
def test_a_node_that_cannot_start_says_why_in_a_line_and_ends(tmp_path, executable):
    arguments, reason = CANNOT[executable]
    command = [sys.executable, "-m", f"dart_skill_nodes.executables.{executable}", "--ros-args", *arguments]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    told = ended.stdout + ended.stderr
    assert ended.returncode == 1 and "Traceback" not in told, told
    assert reason in told.splitlines()[-1] and told.splitlines()[-1].startswith(executable), told
