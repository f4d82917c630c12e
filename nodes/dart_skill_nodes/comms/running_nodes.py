"""Which nodes run on this machine, known at once: DDS takes a while to find them, and seconds
where the machine is busy.

Each node holds a socket, with the ROS domain and its full name, in Linux's abstract namespace: it
is gone with its process, however that went. A second node of the name is refused. Where there is
no such namespace nothing is known, and DDS alone tells.
"""

import errno
import hashlib
import os
import socket
import time
from collections.abc import Iterable
from contextlib import closing

ENDING = 0.5
"""For a process that was told to end, and whose place another one takes [s, wall clock]."""
LOOK = 0.02
"""Whether it has ended is asked so often [s, wall clock]."""


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
        time.sleep(LOOK)
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
