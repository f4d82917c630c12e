"""Which nodes run on this machine, known at once: DDS takes a while to find them, and seconds where the machine is busy.

Each process holds a socket for each of its nodes, with the ROS domain and the node's full name, in Linux's abstract namespace: it is gone
with its process, however that went. Where there is no such namespace nothing is known, and DDS alone tells.
"""

import hashlib
import os
import socket
from collections.abc import Iterable
from contextlib import closing

_HELD: list[socket.socket] = []


def hold(names: Iterable[str]) -> None:
    """Let others know, while this process lives, that it has nodes with these full names. Of two with one name the first one says so."""
    for name in names:
        held = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            held.bind(_address(name))
        except OSError:
            held.close()
        else:
            _HELD.append(held)


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
    whole = f"{os.environ.get('ROS_DOMAIN_ID') or 0} {name}"
    return b"\0dart_skill " + hashlib.sha256(whole.encode()).hexdigest().encode()
