"""What the system of this machine knows at once, and DDS after a while: whether a process runs, was
stopped or is gone, which nodes run, and for how long this process was frozen.

Each node holds a socket, with the ROS domain and its full name, in Linux's abstract namespace: the
socket is gone with its process, however that ended. A second node of the name is refused. Where
there is no such namespace, DDS alone tells which nodes run.
"""

from __future__ import annotations

import errno
import hashlib
import os
import socket
import time
from collections.abc import Iterable
from contextlib import closing
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

ENDED = "ZXx"
STOPPED = "Tt"
"""Letters of /proc/<pid>/stat, proc(5): a zombie or dead; stopped by a signal or a debugger."""
ENDING = 0.5
"""For a process that was told to end, and whose place another one takes [s, wall clock]."""
LOOK_FOR_END = 0.02
"""Whether it has ended is asked so often [s, wall clock]."""
LOW_NUMBER = 0xFFFF
"""The bits of a process's number that DDS tells."""
LEASE = 3.5
"""A node that is not heard of for so long is taken for dead; a process may be held up for 3 s [s,
wall clock].
"""
LOOK = 0.2
"""Time between two looks at whether nodes are still there [s, wall clock]."""
SCHEDULED = Path("/proc/thread-self/schedstat")
"""Statistics of its reader: time on a core, and time in which it waited for one [ns] (Linux,
Documentation/scheduler/sched-stats).
"""


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


@dataclass(unsafe_hash=True)
class SystemProcess:
    """A process of this machine.

    * pid: its number, which another process may be given later.
    * started: when it was started [ticks since boot].
    """

    pid: int
    started: int
    _stopped: float | None = field(default=None, repr=False, compare=False)

    @classmethod
    def this(cls) -> SystemProcess:
        """The one that asks."""
        return cls.of(os.getpid())

    @classmethod
    def of(cls, pid: int) -> SystemProcess:
        """The one that has a number now."""
        return cls(pid, _state(pid)[1])

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


def hold(name: str) -> socket.socket:
    """Let others know, until the socket is closed, that a node with this full name runs;
    ValueError where another one has it.
    """
    held, until = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM), time.monotonic() + ENDING
    while _is_taken(held, name):
        if time.monotonic() > until:
            held.close()
            raise ValueError(
                f"{name} runs on this machine in ROS domain {_domain()} already: end it, or start"
                " this one in another domain (ROS_DOMAIN_ID) or in a namespace"
            )
        time.sleep(LOOK_FOR_END)
    return held


def _is_taken(held: socket.socket, name: str) -> bool:
    """Whether another one has the name; if not, the socket has it, as far as the machine knows
    such names.
    """
    try:
        held.bind(_address(name))
    except OSError as error:
        return error.errno == errno.EADDRINUSE
    return False


def running(names: Iterable[str]) -> set[str]:
    """Those of some full names of nodes that a process of this machine holds, in this ROS domain."""
    return {name for name in names if _is_held(name)}


def _is_held(name: str) -> bool:
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as asks:
        try:
            asks.connect(_address(name))
        except OSError:
            return False
    return True


def _address(name: str) -> bytes:
    """An address has at most 107 bytes, and a name may have more."""
    whole = f"{_domain()} {name}"
    return b"\0dart_skill " + hashlib.sha256(whole.encode()).hexdigest().encode()


def _domain() -> str:
    return os.environ.get("ROS_DOMAIN_ID") or "0"


class FreezeDetector:
    """Tells whether this process was frozen: stopped by a signal, or with its whole machine. A
    process that waited for a core was not. Ask it in one thread, again and again.
    """

    def __init__(self) -> None:
        self._asked = self._looked = time.monotonic()
        self._busy = busy_time()

    def frozen(self) -> float:
        """Time in which this thread neither ran nor waited for a core since the last call [s]; 0
        if it is not longer than LEASE.
        """
        now = time.monotonic()
        gap = now - self._asked
        self._asked = now
        lost = gap - (busy_time() - self._busy) if gap > LEASE else 0.0
        if now - self._looked > LOOK:  # so that hardly anything counts that was before the gap
            self._looked, self._busy = now, busy_time()
        return lost if lost > LEASE else 0.0


def busy_time() -> float:
    """Time in which this thread has run or waited for a core [s]; 0 where the system does not say."""
    try:
        running, waiting, _ = SCHEDULED.read_text().split()
    except (OSError, ValueError):
        return 0.0
    return 1e-9 * (int(running) + int(waiting))
