"""Runs of a Dask worker in a process beside it.

A worker has threads that look at memory, disks and network of its machine, and talk to the scheduler. In the process of a run they would
wait for the interpreter's lock, and the run for them: it took an eighth longer. A worker may also have several threads, whose runs would
share what PyBullet has once for a process.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe
from typing import Any

ORPHANED = 1.0
"""A process looks so often whether the one that wants its results is still there [s]."""
OF_WORKERS = "MALLOC_TRIM_THRESHOLD_"
"""With this Dask has its workers give memory back to the system at once, and arrays get theirs page by page: runs take a tenth longer."""
_of_this_thread = threading.local()
"""`process` and `line`, in which the runs of this thread are carried out, once there was one."""


def run_apart(function: Callable, task: Any) -> Any:
    """function(task), called in a process of this thread, which stays for the next run.

    What the function raises is raised here; OSError says that the process has ended by itself.
    """
    if not hasattr(_of_this_thread, "line"):
        _of_this_thread.process, _of_this_thread.line = _begin_process()
    line = _of_this_thread.line
    try:
        _send(line, (function, task))
        succeeded, result = line.recv()
    except (EOFError, BrokenPipeError, ConnectionResetError) as error:
        del _of_this_thread.line
        status = _of_this_thread.process.wait()
        raise OSError(f"the process of a run ended with status {status}: is there too little memory?") from error
    if not succeeded:
        raise result
    return result


def _begin_process() -> tuple[subprocess.Popen, Connection]:
    """A new interpreter, not a child of `multiprocessing`: the processes of Dask's workers may have none of those."""
    ours, its = Pipe()
    program = f"from {__name__} import serve; serve({its.fileno()})"
    environment = {name: value for name, value in os.environ.items() if name != OF_WORKERS}
    process = subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.DEVNULL, pass_fds=[its.fileno()], env=environment)
    its.close()
    return process, ours


def serve(descriptor: int) -> None:
    """What the process does: it calls functions until nobody asks any more, or the worker has ended.

    * descriptor: of the line to the worker.
    """
    end_with_parent()
    line = Connection(descriptor)
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            _send(line, _called(*line.recv()))


def _called(function: Callable, task: Any) -> tuple[bool, Any]:
    """Whether it succeeded, and its result or what it raised."""
    try:
        return True, function(task)
    except Exception as error:  # whatever it is, it belongs to whoever asked
        return False, error


def _send(line: Connection, what: tuple) -> None:
    """As Dask sends: functions and types of a script go along, as its modules are not there on the other side."""
    line.send_bytes(importlib.import_module("cloudpickle").dumps(what))


def end_with_parent() -> None:
    """From now on this process ends when its parent does."""
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(ORPHANED)
    os._exit(1)
