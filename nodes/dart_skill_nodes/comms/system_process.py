"""A process as the system of this machine sees it: whether it runs, was stopped, or is gone."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

ENDED = "ZXx"
STOPPED = "Tt"
"""Letters of /proc/<pid>/stat, proc(5): a zombie or dead; stopped by a signal or a debugger."""
LOW_NUMBER = 0xFFFF
"""The bits of a process's number that DDS tells."""


@cache
def _machine() -> str:
    """This boot of this machine, and the name space of its process numbers; empty where the system
    does not say.
    """
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip() + os.readlink(
            "/proc/self/ns/pid"
        )
    except OSError:
        return ""


@dataclass
class SystemProcess:
    """pid, started: its number, and when it was started, which nobody shares who is given the same
    number later [ticks since boot].
    """

    pid: int
    started: int
    _stopped: float | None = field(default=None, repr=False)

    def __hash__(self) -> int:
        return hash((self.pid, self.started))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SystemProcess) and (self.pid, self.started) == (
            other.pid,
            other.started,
        )

    @classmethod
    def this(cls) -> SystemProcess:
        """The one that asks."""
        return cls(os.getpid(), _state(os.getpid())[1])

    @classmethod
    def named(cls, name: str) -> SystemProcess | None:
        """The one with a `name`; None for one of another machine, and for words that name none."""
        machine, _, numbers = name.partition(" ")
        if not machine or machine != _machine():
            return None
        pid, _, started = numbers.partition(" ")
        return cls(int(pid), int(started)) if pid.isdigit() and started.isdigit() else None

    @property
    def name(self) -> str:
        """By which processes of the same machine find it."""
        return f"{_machine()} {self.pid} {self.started}"

    def lives(self, patience: float) -> bool:
        """Whether it runs, or has not been seen stopped for longer than patience [s, wall clock]."""
        state, started = _state(self.pid)
        if started != self.started or state in ENDED:
            return False
        if state not in STOPPED:
            self._stopped = None
            return True
        now = time.monotonic()
        self._stopped = now if self._stopped is None else self._stopped
        return now - self._stopped <= patience


def _state(pid: int) -> tuple[str, int]:
    """Letter of its state, and when it was started; ended, if there is none of this number."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return ENDED[0], 0
    return words[0], int(words[19])


def runs(low: int) -> bool:
    """Whether a process runs whose number has these lower 16 bits, be it another one; True where
    the system does not say.
    """
    numbers = [int(one.name) for one in Path("/proc").glob("[0-9]*")]
    return not numbers or any(
        number & LOW_NUMBER == low and _state(number)[0] not in ENDED for number in numbers
    )


def processor_time_of(pid: int) -> float:
    """Processor time that a process has used so far, its threads together [s]; OSError if there is
    none of this number.
    """
    words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def memory_of(pid: int) -> int:
    """Resident memory of a process [bytes]; OSError if there is none of this number."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def threads_of(pid: int) -> int:
    """How many threads a process has."""
    return len(os.listdir(f"/proc/{pid}/task"))


def descriptors_of(pid: int) -> int:
    """How many files and sockets a process has open."""
    return len(os.listdir(f"/proc/{pid}/fd"))
