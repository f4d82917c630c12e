"""Whether the arm's time goes on, as whoever moves the arm sees it: the stamps of its states,
against the clock of the wall.

A simulator that waits for an answer, or for a state to arrive, stands still for ever; one that
somebody holds says so on HELD.
"""

import time

from rclpy.node import Node
from std_msgs.msg import Bool

from dart_skill_nodes.comms.presence import LEASE, LOOK
from dart_skill_nodes.comms.qos import LATCHED

HELD = "simulation/held"
"""Whether somebody holds the time of a simulated world."""
STANDS = LEASE + 0.9
"""Time that stands still for so long goes on no more: whoever has died is known by then, and a
process may be held up [s, wall clock].
"""
HELD_LONG = 1.0
"""Who holds a world for a trial lets it run sooner [s, wall clock]."""


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
        """What lets the time of a simulated arm go on, when somebody has held it for long; empty
        else.
        """
        if not self._held or self.silence <= HELD_LONG:
            return ""
        return (
            "the simulated world is held: /simulation/pause with data: false lets it run,"
            " /simulation/reset begins it anew"
        )

    @property
    def stalled(self) -> str:
        """What to say when the time of a simulated arm stands still, and nobody holds it; empty
        else.
        """
        if self._held is not False or self.silence <= STANDS:
            return ""
        return (
            f"the arm's time has stood still for {self.silence:.1f} s: /joint_states, or an answer"
            " to them, gets lost (see /diagnostics)"
        )
