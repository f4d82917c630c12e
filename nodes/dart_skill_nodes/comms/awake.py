"""Whether this process was frozen: stopped by a signal, or with its whole machine. One that waited
for a core was not.
"""

import time
from pathlib import Path

from dart_skill_nodes.comms.presence import LEASE, LOOK

SCHEDULED = Path("/proc/thread-self/schedstat")
"""Statistics of its reader: time on a core, and time in which it waited for one [ns] (Linux,
Documentation/scheduler/sched-stats).
"""


class Awake:
    """To be asked in one thread, again and again."""

    def __init__(self) -> None:
        self._asked = self._looked = time.monotonic()
        self._busy = busy_time()

    def frozen(self) -> float:
        """For how long this thread neither ran nor waited for a core since it asked last [s]; 0 if
        not for longer than LEASE.
        """
        now = time.monotonic()
        gap = now - self._asked
        self._asked = now
        lost = gap - (busy_time() - self._busy) if gap > LEASE else 0.0
        if now - self._looked > LOOK:  # so that hardly anything counts that was before the gap
            self._looked, self._busy = now, busy_time()
        return lost if lost > LEASE else 0.0


def busy_time() -> float:
    """For how long this thread has run, or wanted to [s]; 0 where the system does not say."""
    try:
        running, waiting, _ = SCHEDULED.read_text().split()
    except (OSError, ValueError):
        return 0.0
    return 1e-9 * (int(running) + int(waiting))
