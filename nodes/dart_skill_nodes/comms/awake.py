"""Whether this process was frozen: stopped by a signal, or with its whole machine. One that waited for a core was not."""

import os
import time

from dart_skill_nodes.comms.presence import LEASE, LOOK

THREADS = "/proc/self/task"
"""Of this process. schedstat of each: time on a core, and time in which it waited for one [ns] (Linux, scheduler/sched-stats)."""
_FILES: dict[str, int] = {}
"""By thread; kept open."""


class Awake:
    """To be asked again and again."""

    def __init__(self) -> None:
        self._asked = self._looked = time.monotonic()
        self._busy = busy_times()

    def frozen(self) -> float:
        """For how long no thread ran or waited for a core since this was asked last [s]; 0 if not for longer than LEASE.

        All threads count: one that has Python's lock and no core holds the others up, which then wait for the lock and not for a core.
        """
        now = time.monotonic()
        gap, self._asked = now - self._asked, now
        lost = gap - busy_since(self._busy) if gap > LEASE else 0.0
        if now - self._looked > LOOK:  # so that hardly anything counts that was before the gap
            self._looked, self._busy = now, busy_times()
        return lost if lost > LEASE else 0.0


def busy_times() -> dict[str, float]:
    """For how long each thread has run, or wanted to [s]; nothing where the system does not say."""
    found = {}
    for thread, file in _opened().items():
        try:
            running, waiting, _ = os.pread(file, 100, 0).split()
        except (OSError, ValueError):  # it has just ended
            continue
        found[thread] = 1e-9 * (int(running) + int(waiting))
    return found


def _opened() -> dict[str, int]:
    """The files of all threads: to open one anew takes twenty times as long as to read it."""
    there = set(os.listdir(THREADS)) if os.path.isdir(THREADS) else set()
    for ended in _FILES.keys() - there:
        os.close(_FILES.pop(ended))
    for begun in there - _FILES.keys():
        try:
            _FILES[begun] = os.open(f"{THREADS}/{begun}/schedstat", os.O_RDONLY | os.O_CLOEXEC)
        except OSError:  # it has just ended, or the system does not count
            continue
    return _FILES


def busy_since(before: dict[str, float]) -> float:
    """For how long threads have run since then, or wanted to, together [s]."""
    return sum(max(0.0, busy - before.get(thread, 0.0)) for thread, busy in busy_times().items())
