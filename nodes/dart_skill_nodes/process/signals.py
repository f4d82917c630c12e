"""How a process of the graph is told to end: SIGINT, SIGTERM, or the end of the process that started it."""

import os
import signal
import time

ENDS_WITH = "DART_SKILL_ENDS_WITH"
"""Environment variable: the process that started a node; the node ends when that is gone, however
it went.
"""


class Interrupts:
    """SIGINT and SIGTERM end the spin loop between two callbacks: rclpy's own handlers invalidate
    the context at once, in the middle of a callback that still publishes. A second one, when the
    first did not help, interrupts whatever is running.
    """

    PATIENCE = 5.0
    """In which one Ctrl-C may arrive twice: from the terminal, and forwarded by the process
    that started the node, late on a busy machine [s]. An interrupt while rclpy closes a node would abort the
    process.
    """

    def __init__(self):
        self._first: float | None = None
        self._starter = int(os.environ.get(ENDS_WITH, 0))
        for signal_number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(signal_number, self._on_signal)

    def __bool__(self) -> bool:
        return self._first is not None or bool(self._starter and os.getppid() != self._starter)

    def _on_signal(self, *_) -> None:
        now = time.monotonic()
        if self._first is None:
            self._first = now
        elif now - self._first > self.PATIENCE:
            raise KeyboardInterrupt
