"""What is forked from a process that has imported everything behaves as what is started anew."""

import os
import signal
import subprocess
import sys
import time

import pytest

from tests import warm

COLD = True


@pytest.fixture(params=[subprocess.Popen, warm.WarmPopen], ids=["anew", "forked"])
def popen(request):
    return request.param


def run(popen, command, **options):
    process = popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)
    said = process.communicate(timeout=120)
    return process.returncode, *said


@pytest.mark.parametrize(
    ("command", "status", "on_stdout", "on_stderr"),
    [
        (["dart-skill", "--version"], 0, "dart-skill ", ""),
        (["dart-skill", "nonsense"], 2, "", "invalid choice: 'nonsense'"),
        (["dart-skill", "bag", "info", "nowhere"], 1, "", "nowhere"),
        (["bash", "-c", "dart-skill --version"], 0, "dart-skill ", ""),
        (["bash", "-c", "exec dart-skill --version && true"], 0, "dart-skill ", ""),
    ],
)
def test_status_and_streams_are_its_own(popen, command, status, on_stdout, on_stderr):
    returncode, stdout, stderr = run(popen, command)
    assert (returncode, on_stdout in stdout, on_stderr in stderr) == (status, True, True), stderr


def test_it_works_in_its_own_folder(popen, tmp_path):
    assert run(popen, ["dart-skill", "security", "policy.xml"], cwd=tmp_path)[0] == 0
    assert (tmp_path / "policy.xml").is_file() and not os.path.exists("policy.xml")


def test_a_signal_ends_it_and_a_killed_one_says_so(popen, tmp_path):
    # starts in half the time of those that move an arm
    node = [
        sys.executable,
        "-m",
        "dart_skill_nodes.executables.recorder",
    ]
    for number, status in ((signal.SIGINT, 0), (signal.SIGKILL, -signal.SIGKILL)):
        folder = tmp_path / signal.Signals(number).name  # a bag is named after the second
        folder.mkdir()
        process = popen(node, stderr=subprocess.PIPE, text=True, cwd=folder)
        assert "recording into" in process.stderr.readline()  # or the end of it
        assert process.poll() is None
        process.send_signal(number)
        assert process.wait(60) == status
        process.stderr.close()


def test_a_node_ends_with_its_starter():
    begin = (
        "from tests.warm import WarmPopen; import sys; p = WarmPopen([sys.executable, '-m',"
        " 'dart_skill_nodes.executables.teacher'])"
    )
    environment = {**os.environ, warm.STARTER: "1"}
    environment[warm.ADDRESS] = warm._address()
    starter = subprocess.Popen(
        [sys.executable, "-c", f"{begin}; print(p.pid, flush=True); input()"],
        env=environment,
        cwd=warm.ROOT,  # fmt: skip
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    pid = int(starter.stdout.readline())
    assert os.path.exists(f"/proc/{pid}")
    starter.kill()
    starter.wait()
    starter.stdin.close()
    starter.stdout.close()
    until = time.monotonic() + 60.0
    while os.path.exists(f"/proc/{pid}"):
        assert time.monotonic() < until, "it goes on"
        time.sleep(0.02)


def test_what_depends_on_how_python_begins_is_started_anew(tmp_path):
    """Another PYTHONPATH means other packages."""
    (tmp_path / "sitecustomize.py").write_text("print('here')")
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"}
    assert "here" in run(warm.WarmPopen, ["dart-skill", "--version"], env=environment)[1]
