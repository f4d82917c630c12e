"""Whether a process was frozen: stopped is frozen, and waiting for a core, or computing, is not."""

import signal
import subprocess
import sys
import time

import pytest

from dart_skill_nodes.comms import awake
from dart_skill_nodes.comms.presence import LEASE

ASKS = """
import sys, time
from dart_skill_nodes.comms.awake import Awake
asked = Awake()
print("asks", flush=True)
while not (frozen := asked.frozen()):
    time.sleep(0.05)
print(frozen, flush=True)
"""


@pytest.mark.parametrize(
    ("gap", "busy", "frozen"),
    [
        (0.1, 0.0, 0.0),
        (LEASE - 0.1, 0.0, 0.0),
        (LEASE + 1.0, 0.1, LEASE + 0.9),
        (LEASE + 1.0, 1.1, 0.0),
        (20.0, 19.9, 0.0),
    ],
)
def test_what_counts_is_the_time_without_work_and_without_wanting_any(
    monkeypatch, gap, busy, frozen
):
    now = {"time": 100.0, "busy": 7.0}
    monkeypatch.setattr(awake, "busy_time", lambda: now["busy"])
    monkeypatch.setattr(awake.time, "monotonic", lambda: now["time"])
    asked = awake.Awake()
    for _ in range(100):  # a busy life before does not count
        now["time"], now["busy"] = now["time"] + 0.1, now["busy"] + 0.09
        assert asked.frozen() == 0.0
    now["time"], now["busy"] = now["time"] + gap, now["busy"] + busy
    assert asked.frozen() == pytest.approx(frozen, abs=0.3)
    assert asked.frozen() == 0.0, "it is told once"


def test_a_thread_that_computes_is_busy_and_one_that_sleeps_is_not():
    before, until = awake.busy_time(), time.process_time() + 0.2
    while time.process_time() < until:
        pass
    computed = awake.busy_time()
    time.sleep(0.2)
    assert computed - before > 0.15 and awake.busy_time() - computed < 0.1


def test_a_process_that_is_stopped_by_a_signal_knows_it_afterwards():
    with subprocess.Popen(
        [sys.executable, "-c", ASKS], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline().strip() == "asks"
        process.send_signal(signal.SIGSTOP)
        stopped = time.monotonic()
        while time.monotonic() < stopped + LEASE + 0.5:
            time.sleep(0.05)
        process.send_signal(signal.SIGCONT)
        assert float(process.stdout.readline()) > LEASE
