"""What the system of this machine knows at once, and DDS after a while: whether a process runs, was
stopped or is gone, and which nodes run.

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
