"""What was seen of one throw, guided or made by the arm itself, from one reset of the world to the
next.
"""

from dataclasses import dataclass

import numpy as np

SAME_BASKET = 0.02
"""A recording belongs to a plan if its basket stood this near to the plan's target [m]."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Everything as it was recorded, in the frame of the world. Stamps are integer nanoseconds and
    increase.

    * hand_stamps, hand_position: (n,) [ns] and (n, 3) [m].
    * ball_stamps, ball_position: (m,) [ns] and (m, 3) [m].
    * basket: centre of the rim (3,) [m], the median of what was seen, nan if it was not seen.
    * command_stamps: of the controller's commands (k,) [ns].
    * opened_ns: stamp of the one that told the hand to open [ns], None if none did.
    """

    hand_stamps: np.ndarray
    hand_position: np.ndarray
    ball_stamps: np.ndarray
    ball_position: np.ndarray
    basket: np.ndarray
    command_stamps: np.ndarray
    opened_ns: int | None

    @property
    def start_ns(self) -> int:
        """Stamp of the first pose of the hand."""
        return int(self.hand_stamps[0])

    @property
    def stop_ns(self) -> int:
        """Stamp of the last pose of the hand."""
        return int(self.hand_stamps[-1])
