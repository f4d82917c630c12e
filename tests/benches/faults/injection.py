"""Injects the fault of a case into the graph, when it is time."""

import signal
import time
from collections.abc import Callable

from dart_skill_nodes.process.graph_processes import Graph
from tests.benches.faults.cases import (
    ATTACK,
    FULL_DISK,
    HELD_UP,
    HOLD_UP,
    KILL,
    OF_TOPICS,
    Case,
)
from tests.benches.faults.small_disk import SmallDisk


class FaultInjection:
    """`look` whenever something may have come. at: when it was done [s, monotonic], 0 before.

    is_time: whether the moment has come. order: tells the stranger what to do. disk: that is
    filled.
    """

    def __init__(
        self,
        graph: Graph,
        case: Case,
        is_time: Callable[[], bool],
        order: Callable[..., None],
        disk: SmallDisk | None = None,
    ):
        self._graph, self._case, self._disk = graph, case, disk
        self._is_time, self._order = is_time, order
        self.at, self._held = 0.0, False
        self.on_injection: Callable[[], None] = lambda: None

    def look(self) -> None:
        """Do it, if it is time."""
        if not self.at and self._is_time():
            self.now()
        if self._held and time.monotonic() - self.at > HELD_UP:
            self._held = False
            self._graph.processes[self._case.node].send_signal(signal.SIGCONT)

    def now(self) -> None:
        """Do it."""
        case = self._case
        self.at = time.monotonic()
        if case.fault in OF_TOPICS:
            self._order(fault=case.fault)
        elif case.fault == ATTACK:
            self._order(attack=case.what)
        elif case.fault == FULL_DISK and self._disk is not None:
            self._disk.fill(self._graph.processes[case.node].pid)
        else:
            self._stop_process()
        self.on_injection()

    def _stop_process(self) -> None:
        process = self._graph.processes[self._case.node]
        if self._case.fault == KILL:
            del self._graph.processes[self._case.node]
            process.kill()
            process.wait()
        else:
            process.send_signal(signal.SIGSTOP)
        self._held = self._case.fault == HOLD_UP
