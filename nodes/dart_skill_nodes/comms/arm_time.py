"""Whether time goes on: that of the arm, as the node that moves the arm sees it, and that of this
process.

The arm's time is that of the stamps of its states, against the clock of the wall. A simulator that
waits for an answer, or for a state to arrive, stands still for ever; one that is held says so on
HELD.
"""

import time
from pathlib import Path

from rclpy.node import Node
from std_msgs.msg import Bool

from dart_skill_nodes.comms.presence import LEASE, LOOK
from dart_skill_nodes.comms.qos import LATCHED

HELD = "simulation/held"
"""Topic that says whether the time of a simulated world is held."""
STANDS = LEASE + 0.9
"""Time that stands still for so long goes on no more: dead processes are known by then, and a
process may be held up [s, wall clock].
"""
HELD_LONG = 1.0
"""Who holds a world for a trial lets it run sooner [s, wall clock]."""
SCHEDULED = Path("/proc/thread-self/schedstat")
"""Statistics of its reader: time on a core, and time in which it waited for one [ns] (Linux,
Documentation/scheduler/sched-stats).
"""


class TimeOfTheArm:
    """silence: for how long no new state has come [s, wall clock]; the time is left out for which
    this process was held up itself.
    """

    def __init__(self, node: Node):
        self.silence, self._looked, self._held = 0.0, time.monotonic(), None
        node.create_subscription(Bool, HELD, self._on_held, LATCHED)

    def _on_held(self, message: Bool) -> None:
        self._held, self.silence = message.data, 0.0

    def goes_on(self) -> None:
        """A new state has come, or time has a reason to begin anew."""
        self.silence = 0.0

    def look(self) -> None:
        """To be called every LOOK."""
        now = time.monotonic()
        gap = now - self._looked
        self._looked = now
        self.silence += min(gap, 2 * LOOK)

    @property
    def held(self) -> str:
        """What lets the time of a simulated arm go on, when it has been held for long; empty
        otherwise.
        """
        if not self._held or self.silence <= HELD_LONG:
            return ""
        return (
            "the simulated world is held: /simulation/pause with data: false lets it run,"
            " /simulation/reset begins it anew"
        )

    @property
    def stalled(self) -> str:
        """What to say when the time of a simulated arm stands still, and is not held; empty
        otherwise.
        """
        if self._held is not False or self.silence <= STANDS:
            return ""
        return (
            f"the arm's time has stood still for {self.silence:.1f} s: /joint_states, or an answer"
            " to them, gets lost (see /diagnostics)"
        )


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
