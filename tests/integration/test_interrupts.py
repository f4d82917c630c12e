"""Whoever is told to end does so without a traceback, and leaves no process behind: Ctrl-C on a
terminal, and SIGTERM.
"""

import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from dart_skill_nodes.process.environment import Interrupts
from tests.paths import BAGS

COLD = True
PATIENCE = 60.0
INTERRUPTED = """
import sys
from argparse import Namespace
from pathlib import Path
import rclpy
from dart_skill_nodes.verbs.on_graph import carried_out

def job(options):
    if sys.argv[2] == "interrupted":
        rclpy.shutdown()
    raise RuntimeError("rcl node's context is invalid")

try:
    carried_out(job, Namespace(output=Path(sys.argv[1])), "the job")
except KeyboardInterrupt:
    print("stopped", file=sys.stderr)
"""
"""Where Python was told to ignore SIGINT, rclpy hears it all the same, and ends its context under
the job.
"""
EXPERIMENT = [
    "experiment",
    "throws",
    "--seeds",
    "8",
    "--demonstrations",
    "3",
    "--throws",
    "1",
    "--jobs",
    "2",
]


class OnTerminal:
    """A verb with a terminal and a session of its own. said: everything so far."""

    def __init__(self, arguments):
        self._terminal, its_end = pty.openpty()
        # Not pty.fork: Python that runs between fork and exec crashes now and then where threads
        # of DDS were.
        command = ["setsid", "--ctty", sys.executable, "-m", "dart_skill.cli", *arguments]
        self._process = subprocess.Popen(command, stdin=its_end, stdout=its_end, stderr=its_end)
        self.pid = self._process.pid
        os.close(its_end)
        os.set_blocking(self._terminal, False)
        self.said = ""

    def until(self, condition, what):
        """Wait, and read meanwhile; a process that has ended says nothing more."""
        limit = time.monotonic() + PATIENCE
        while not condition():
            over = self._process.poll() is not None and not self.others
            self._read()
            assert condition() or (not over and time.monotonic() < limit), (
                f"{what} did not come true: {self.said}"
            )
            time.sleep(0.02)

    def press_ctrl_c(self):
        os.write(self._terminal, b"\x03")

    def terminate(self):
        os.kill(self.pid, signal.SIGTERM)

    def loads(self, library):
        """Whether the process has a library whose name has this in it."""
        return library in Path(f"/proc/{self.pid}/maps").read_text()

    @property
    def others(self):
        """Other processes of its session that still run, with what they are."""
        found = {}
        for stat in Path("/proc").glob("[0-9]*/stat"):
            try:
                state, _, _, session = stat.read_text().rpartition(")")[2].split()[:4]
                if int(session) == self.pid and int(stat.parent.name) != self.pid and state != "Z":
                    found[int(stat.parent.name)] = (stat.parent / "cmdline").read_text()
            except OSError:
                continue
        return found

    def status(self):
        """Exit status, when it has ended."""
        self.until(lambda: self._process.poll() is not None, "the end")
        self._read()
        return self._process.returncode

    def close(self):
        for pid in [*self.others, self.pid]:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
        self._process.wait()
        os.close(self._terminal)

    def _read(self):
        try:
            while text := os.read(self._terminal, 65536):
                self.said += text.decode(errors="replace")
        except OSError:  # nothing more now, or ever
            return


@pytest.fixture
def verb():
    """Starts a verb on a terminal; what is left of it is killed afterwards."""
    started = []

    def start(arguments):
        started.append(OnTerminal(arguments))
        return started[-1]

    yield start
    for one in started:
        one.close()


@pytest.mark.parametrize(
    "arguments", [["throw"], ["status", "--duration", "60"], ["check", "arm", "--postures", "9"]]
)
def test_ctrl_c_ends_a_verb_without_a_traceback(verb, arguments):
    process = verb(arguments)
    process.until(lambda: process.loads("librmw_fastrtps"), "rclpy runs")
    process.press_ctrl_c()
    status = process.status()
    assert "Traceback" not in process.said and status in (1, 130, -signal.SIGINT), process.said


@pytest.mark.parametrize("said", ["demonstration 1/13", "starting"])
def test_ctrl_c_ends_a_job_on_a_graph_of_its_own_and_all_nodes_with_it(verb, tmp_path, said):
    """Once the graph runs, and while it starts: last, for nodes that end before they are known are
    on the domain for a while.
    """
    process = verb(["demo", "--output", str(tmp_path / "run")])
    process.until(lambda: said in process.said, said)
    process.press_ctrl_c()
    assert process.status() == 130, process.said
    assert (
        process.said.rstrip().endswith("dart-skill: stopped") and "Traceback" not in process.said
    ), process.said
    process.until(lambda: not process.others, f"no process is left of {process.others}")


@pytest.mark.parametrize(
    ("end", "status"), [(OnTerminal.press_ctrl_c, 130), (OnTerminal.terminate, 143)]
)
def test_whoever_computes_on_all_cores_ends_at_once_and_leaves_no_worker(verb, end, status):
    process = verb(EXPERIMENT)
    process.until(
        lambda: sum("multiprocessing" in command for command in process.others.values()) >= 4,
        "two workers",
    )
    end(process)
    assert process.status() == status, process.said
    assert "Traceback" not in process.said, process.said
    process.until(lambda: not process.others, f"no process is left of {process.others}")


@pytest.mark.parametrize(
    ("end", "status"), [(OnTerminal.press_ctrl_c, 130), (OnTerminal.terminate, 143)]
)
def test_who_makes_a_page_ends_at_once(verb, tmp_path, end, status):
    process = verb(["report", str(BAGS / "throws"), "--output", str(tmp_path / "page.html")])
    process.until(lambda: process.loads("matplotlib"), "a page that is being made")
    end(process)
    assert process.status() == status, process.said
    assert "Traceback" not in process.said and list(tmp_path.iterdir()) == [], process.said


@pytest.mark.parametrize("how, status", [("interrupted", 0), ("defect", 1)])
def test_a_job_whose_context_has_ended_was_stopped_and_a_defect_is_none(tmp_path, how, status):
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, str(tmp_path), how],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == status
    assert done.stderr.endswith("stopped\n") == (how == "interrupted") and (
        "Traceback" in done.stderr
    ) == (how == "defect")


def test_a_ctrl_c_that_is_forwarded_some_seconds_later_is_the_same_one(monkeypatch):
    """On a busy machine a node that was closing got the second one in the middle of that, and
    aborted.
    """
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    now = [100.0]
    monkeypatch.setattr("dart_skill_nodes.process.environment.time.monotonic", lambda: now[0])
    try:
        interrupts = Interrupts()
        assert not interrupts
        signal.raise_signal(signal.SIGINT)
        now[0] += 4.0
        signal.raise_signal(signal.SIGINT)
        assert interrupts
        now[0] += 2.0
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
