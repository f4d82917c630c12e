"""Since when nothing moves in a world."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

MOVED = 1e-4
"""A body that went farther since the last look has moved [m]."""
SPEED = 0.01
"""A joint that is faster moves [rad/s]; a held arm trembles by less."""
LOOK_NS = 100_000_000
"""Between two looks [ns]."""


class Stillness:
    """Looks at arm and bodies now and then.

    Attributes
    ----------
    since_ns
        The stamp of the last look at which something moved, or of `wake`.
    """

    def __init__(self) -> None:
        self.since_ns = 0
        self._looked_ns = 0
        self._places: dict[str, np.ndarray] = {}

    def wake(self, stamp_ns: int) -> None:
        """From now on something may move."""
        self.since_ns = self._looked_ns = stamp_ns

    def is_due(self, stamp_ns: int) -> bool:
        """Whether it is time to look; time that was set back begins anew."""
        if stamp_ns < self._looked_ns:
            self.wake(stamp_ns)
        return stamp_ns - self._looked_ns >= LOOK_NS

    def look(
        self,
        stamp_ns: int,
        joint_velocity: np.ndarray,
        bodies: Mapping[str, tuple[np.ndarray, np.ndarray]],
    ) -> None:
        """Joint velocities (n,) [rad/s], and by name the position (3,) [m] and quaternion of each
        body.

        Parameters
        ----------
        joint_velocity
            Of all joints.
        bodies
            Poses by name.
        """
        self._looked_ns = stamp_ns
        places = {name: np.array(position) for name, (position, _) in bodies.items()}
        still = places.keys() == self._places.keys() and all(
            np.abs(places[name] - self._places[name]).max() <= MOVED for name in places
        )
        if not still or np.abs(joint_velocity).max() > SPEED:
            self.since_ns = stamp_ns
        self._places = places
