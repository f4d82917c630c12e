"""A second process of our own, which works on another core beside this one: it is asked for a result, and gives it when it is wanted.

It is a copy of this process where that has a single thread, so that it begins at once; else a new interpreter, as a copy of a process with
threads or nodes of ROS may hang. It ends with the block that wants it, and with this process, however that goes. A pool of
`concurrent.futures` would unpack results in a thread beside the work of this process, and slow that down.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import pkgutil
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import ForkingPickler
from typing import Any

Begin = Callable[..., Callable[[], Any]]
"""begin(function, ...) asks for function(...), and returns what gives its result. `functools.partial` is one that begins only then."""
SMALL = 16_384
"""A question of fewer bytes is sent while others are being answered: it waits in the pipe, which takes much more."""
MOST = 4
"""Such questions at one time."""


@contextmanager
def second_process() -> Iterator[Begin]:
    """A `Begin` whose functions, which modules must have, are called by a second process, one after the other; by this process where it has
    a single core.

    What a function raises is raised where its result is asked for; there OSError says that the process has ended by itself.
    """
    if (len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1) < 2:
        yield partial
        return
    ours, its = multiprocessing.Pipe()
    process: BaseProcess
    if _has_one_thread():
        process = multiprocessing.get_context("fork").Process(target=_serve, args=(its, ours), daemon=True)
    else:
        process = multiprocessing.get_context("spawn").Process(target=_serve, args=(its, None), daemon=True)
        resource_tracker.ensure_running()  # it comes with the first such process, and would let Ctrl-C through again
    with _ctrl_c_held_back():
        process.start()
    its.close()
    try:
        yield _Questions(process, ours).begin
    finally:
        process.kill()
        process.join()
        ours.close()


@contextmanager
def _ctrl_c_held_back() -> Iterator[None]:
    """Ctrl-C in a terminal is for this process alone, which ends the other one: a process that starts meanwhile is deaf to it for good."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _has_one_thread() -> bool:
    """Whether a copy of this process is as good as this process; False where nobody knows."""
    try:
        return len(os.listdir("/proc/self/task")) == 1
    except OSError:
        return False


def called(name: str, *arguments: Any) -> Any:
    """What a function returns that is asked for by its name, "package:function": whoever asks need not have imported it yet."""
    return pkgutil.resolve_name(name)(*arguments)


def load(names: Sequence[str]) -> None:
    """Import what will be wanted; whoever lacks a package is told so then. names: of modules, or of what they have, as "package:Name"."""
    with suppress(ImportError):
        for name in names:
            pkgutil.resolve_name(name)


class _Questions:
    """What is asked of a process, and its answers, which come in the same order."""

    def __init__(self, process: BaseProcess, line: Connection):
        self._process, self._line = process, line
        self._asked, self._answers = 0, list[tuple[bool, Any]]()

    def begin(self, function: Callable, *arguments: Any) -> Callable[[], Any]:
        """Ask for function(*arguments). Before a large question whoever still answers is heard: two processes that both send would wait for
        each other.
        """
        question = ForkingPickler.dumps((function, arguments))
        if len(question) > SMALL or self._asked - len(self._answers) > MOST:
            self._hear(self._asked)
        try:
            self._line.send_bytes(question)
        except OSError as error:
            raise self._gone() from error
        self._asked += 1
        return partial(self._result, self._asked - 1)

    def _result(self, number: int) -> Any:
        self._hear(number + 1)
        succeeded, result = self._answers[number]
        if not succeeded:
            raise result
        return result

    def _hear(self, count: int) -> None:
        """Wait until so many answers have come in all."""
        while len(self._answers) < count:
            try:
                self._answers.append(self._line.recv())
            except (EOFError, OSError) as error:
                raise self._gone() from error

    def _gone(self) -> OSError:
        self._process.join()
        return OSError(f"the second process of this command ended with status {self._process.exitcode}: is there too little memory?")


def _serve(line: Connection, others_end: Connection | None) -> None:
    """What the second process does: it calls functions until nobody asks any more. What they print goes to stderr."""
    if others_end is not None:
        others_end.close()  # of a copy: or it would not notice that nobody asks any more
    gc.disable()  # nearly all that it makes lives as long as it does, as in the process that asks
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    with suppress(EOFError, BrokenPipeError):
        while True:
            line.send(_answer(line))


def _answer(line: Connection) -> tuple[bool, Any]:
    """Whether the next function succeeded, and its result or what it raised; EOFError after the last one."""
    try:
        function, arguments = line.recv()
    except ImportError as error:
        return False, error
    try:
        return True, function(*arguments)
    except Exception as error:  # whatever it is, it belongs to whoever asked
        return False, error
