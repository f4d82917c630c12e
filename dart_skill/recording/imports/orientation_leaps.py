"""Orientations that leap between two solutions: a body whose markers look the same after a turn is
seen in either of two orientations.

Both differ by one turn L in the axes of the body: q and q L. Which samples leapt is told by
continuity, and which of the two is right by how often it was seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dart_skill.common.quaternions import CONJUGATE, product
from dart_skill.recording.imports.pose_stream import PoseStream

LEAP = 0.5
"""Least angle between the two solutions [rad]."""
ALIKE = 0.35
"""Difference between two leaps that may come from the movement between frames and from noise
[rad].
"""
AT_ONCE = 0.05
"""Longest time between two frames of a leap [s]."""
LEAST_STRETCH = 3
"""Samples of a stretch that leapt; fewer, only once, are an outlier."""
CLEARLY = 0.4
"""Largest share of samples that leapt of which it is sure that they are the wrong ones."""


@dataclass(frozen=True)
class Leaps:
    """Where the orientation of a body leapt.

    * leapt: (n,) whether each sample shows the solution that was seen less often.
    * turn: (4,) quaternion of that solution in the axes of the body, as the other one has them.
    """

    leapt: np.ndarray
    turn: np.ndarray

    @property
    def is_clear(self) -> bool:
        """Whether it is sure which of the two solutions is the right one."""
        return bool(np.mean(self.leapt) < CLEARLY)

    @property
    def angle(self) -> float:
        """Angle between the two solutions [rad]."""
        return float(_angles(self.turn[None])[0])

    def mended(self, stream: PoseStream) -> PoseStream:
        """The stream with all samples in the solution that was seen more often. stream: in which
        they were found.
        """
        back = product(
            stream.quaternion, np.broadcast_to(self.turn * CONJUGATE, stream.quaternion.shape)
        )
        return replace(stream, quaternion=np.where(self.leapt[:, None], back, stream.quaternion))


def find_leaps(stream: PoseStream) -> Leaps | None:
    """Where an orientation leaps between two solutions; None where it does not, or leaps
    otherwise.

    * stream: quaternions of norm 1, in order of time.
    """
    if len(stream) < 2 * LEAST_STRETCH:
        return None
    q = stream.quaternion
    steps = product(q[:-1] * CONJUGATE, q[1:])
    at_once = np.diff(stream.stamp_ns) < 1e9 * AT_ONCE
    sudden = at_once & (_angles(steps) > LEAP)
    if not sudden.any():
        return None
    turn = steps[np.argmax(sudden)]
    there, back = (np.broadcast_to(one, steps.shape) for one in (turn * CONJUGATE, turn))
    if np.any(
        np.minimum(_angles(product(steps, there)), _angles(product(steps, back)))[sudden] > ALIKE
    ):
        return None  # each leap is another one
    leapt = _leapt(steps, turn)
    stretches = np.diff(
        np.flatnonzero(np.diff(np.concatenate([[0], leapt.astype(int), [0]])))
    ).tolist()[::2]
    if np.mean(leapt) > 0.5:
        leapt, turn = ~leapt, turn * CONJUGATE
    return (
        Leaps(leapt, turn)
        if len(stretches) > 1 or max(stretches, default=0) >= LEAST_STRETCH
        else None
    )


def _leapt(steps: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Which samples (n,) show the other solution than the first one, so that the body turns as
    little as it can between two of them.
    """
    n = len(steps)
    away = product(
        steps, np.broadcast_to(turn * CONJUGATE, steps.shape)
    )  # the step, if the second sample has leapt
    home = product(np.broadcast_to(turn, steps.shape), steps)  # ... and if the first one has
    both = product(home, np.broadcast_to(turn * CONJUGATE, steps.shape))
    stays, goes, comes, remains = map(_angles, (steps, away, home, both))
    found = np.zeros(n + 1, dtype=bool)
    for k in range(n):  # each depends on the one before it
        found[k + 1] = remains[k] <= comes[k] if found[k] else goes[k] < stays[k]
    return found


def _angles(quaternion: np.ndarray) -> np.ndarray:
    """Angles (n,) of turns (n, 4) [rad]."""
    return 2.0 * np.arctan2(np.linalg.norm(quaternion[:, :3], axis=1), np.abs(quaternion[:, 3]))
