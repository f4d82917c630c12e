"""When a message is logged that says itself when it was sent: a time that never goes back, and
that no stray stamp carries away.
"""

from __future__ import annotations

LEAP_NS = 3_600_000_000_000
"""A stamp that is farther ahead of all others is not believed at once [ns]."""
INSISTING = 10
"""So many such stamps of one topic are believed: its clock was set."""


class LogTime:
    """now_ns: the newest stamp that was believed [ns]."""

    def __init__(self) -> None:
        self.now_ns = 0
        # the last stamp that was not believed, and the topics of all that were like it
        self._ahead_ns, self._topics = (
            0,
            [""],
        )

    def take(self, topic: str, stamp_ns: int) -> None:
        """Move on to the stamp of a message.

        Raises
        ------
        ValueError
            If it is far ahead, and time stays where it is: until a second topic says the same, or
            this one goes on saying it.
        """
        if not self.now_ns or stamp_ns <= self.now_ns + LEAP_NS:
            self.now_ns = max(self.now_ns, stamp_ns)
            return
        if abs(stamp_ns - self._ahead_ns) > LEAP_NS:
            self._topics = []
        self._ahead_ns = stamp_ns
        self._topics.append(topic)
        if len(set(self._topics)) == 1 and len(self._topics) < INSISTING:
            raise ValueError(
                f"it is stamped {(stamp_ns - self.now_ns) * 1e-9:.0f} s after everything else: set"
                " the clock of its publisher"
            )
        self.now_ns = stamp_ns
