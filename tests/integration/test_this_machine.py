"""Whether a process lives, as the system says."""

import os
import signal
import subprocess
import sys
import time

import pytest

from dart_skill_nodes.comms.this_machine import SystemProcess

PATIENCE = 0.2


@pytest.fixture
def other():
    """A process that does nothing, and what is known of it."""
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1000)"])
    yield process, SystemProcess.of(process.pid)
    process.kill()
    process.wait()


def test_a_process_is_known_by_its_name_and_words_that_name_none_are_none():
    this = SystemProcess.this()
    assert SystemProcess.named(this.name) == this and this.lives(PATIENCE)
    machine, pid, started = this.name.rsplit(" ", 2)
    for name in (
        "",
        "x",
        f"elsewhere {pid} {started}",
        machine,
        f"{machine} {pid}",
        f"{machine} a b",
        f"{machine} -1 0",
    ):
        assert SystemProcess.named(name) is None, name


def test_a_killed_one_is_dead_at_once_before_anybody_waits_for_it(other):
    process, known = other
    assert known.lives(PATIENCE)
    process.kill()
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)  # it is a zombie now
    assert not known.lives(PATIENCE)
    process.wait()
    assert not known.lives(PATIENCE)


def test_a_number_that_is_given_again_is_another_process():
    assert not SystemProcess(os.getpid(), 1).lives(PATIENCE)


def test_a_stopped_one_is_dead_after_a_while_and_lives_again(other):
    process, known = other
    process.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, process.pid, os.WSTOPPED)
    assert known.lives(PATIENCE)
    time.sleep(1.1 * PATIENCE)
    assert not known.lives(PATIENCE) and known.lives(1000.0)
    process.send_signal(signal.SIGCONT)
    os.waitid(os.P_PID, process.pid, os.WCONTINUED)
    assert known.lives(PATIENCE)
