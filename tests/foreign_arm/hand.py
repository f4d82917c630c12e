"""The hand: told to open or to close, it does so a while later."""

import numpy as np

CLOSING = 0.1  # until fingers that are open about a part have closed: chosen [s]


class Hand:
    """When what is held is let go, and when it is held.

    Parameters
    ----------
    laboratory
        Has the delay, and its spread.
    random
        Draws one delay for each opening.
    """

    def __init__(self, laboratory, random):
        self._laboratory, self._random = laboratory, random
        self._free_at, self._closed_at = None, 0.0

    @property
    def told_to_open(self):
        """Whether the last command was to open."""
        return self._free_at is not None

    def open(self, now):
        """The command to open; a second one changes nothing."""
        if self._free_at is None:
            delay = self._laboratory.hand_delay + self._laboratory.hand_spread * np.clip(
                self._random.standard_normal(), -3.0, 3.0
            )
            self._free_at = now + delay

    def close(self, now):
        """The command to close; a second one changes nothing."""
        if self._free_at is not None:
            self._free_at, self._closed_at = None, now + CLOSING

    def since_free(self, now):
        """Time since what was held is free [s]; negative before, and minus infinity without a
        command.
        """
        return -np.inf if self._free_at is None else now - self._free_at

    def holds(self, now):
        """Whether closed fingers hold what is between them."""
        if self._free_at is not None:
            return now < self._free_at and now >= self._closed_at
        return now >= self._closed_at
