"""PyBullet without its greetings: what it prints when it is imported and whenever a physics server
is made.
"""

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from dart_skill.common.extras import Absent


@contextmanager
def _muted() -> Iterator[None]:
    """What C code prints goes nowhere; errors come as exceptions."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = os.dup(1), os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    c = ctypes.CDLL(None)
    try:
        c.fflush(None)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        yield
    finally:
        c.fflush(None)  # what is printed to a pipe is kept by C until then
        os.dup2(kept[0], 1)
        os.dup2(kept[1], 2)
        for descriptor in (*kept, nowhere):
            os.close(descriptor)


try:
    with _muted():
        import pybullet
        from pybullet_utils.bullet_client import BulletClient
except ModuleNotFoundError as error:  # not needed where nothing is simulated
    pybullet, BulletClient = Absent(error), object


class _Client(BulletClient):
    """BulletClient looks every function up, and wraps it, at each call; this one remembers."""

    # What BulletClient's destructor asks for, even when an interrupt (Ctrl-C) ended the
    # constructor before there was a connection.
    _client = -1
    _pid = -1

    def __getattr__(self, name: str) -> Any:
        function = super().__getattr__(name)
        self.__dict__[name] = function
        return function


def connect() -> BulletClient:
    """A physics server in this process."""
    with _muted():
        return _Client(pybullet.DIRECT)
