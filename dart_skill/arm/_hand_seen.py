"""Closing the loop by what is seen: where cameras see a body that the arm moves, from where the
arm's own kinematics takes it to be.

Encoders have offsets, cables give, and the load bends the arm. The difference changes slowly with
the posture. So it is filtered, and what the hand shall do is shifted by it. Poses are compared with
the arm at their own stamps: late cameras do not lag behind an arm that moves.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from typing import NamedTuple

import numpy as np

from dart_skill.arm._drive import turn
from dart_skill.arm._registration import Registration
from dart_skill.common.quaternions import matrices
from dart_skill.common.vectors import at_most

FILTER_TIME = 0.1
"""Time constant with which the difference is followed [s]. Cables give to what the correction asks
of them, so a fast filter makes arms swing: the modulus margin is 0.67 with cables of half the
stiffness of config/fleet.yaml and cameras that are up to 20 ms late, 0.36 with 0.05 s.
"""
ARM_MEMORY = 0.1
"""Poses are compared with the arm of so long ago at most [s]."""
WAITING = 10
"""Poses that wait for the arm at most: stamps of cameras that are late may be newer than its own."""
LOST = 0.1
"""A body that was not seen for longer is not seen now [s]: cameras are late by up to 20 ms, and lose
single frames.
"""
LARGEST_SHIFT = 0.03
"""Length of the difference that is corrected at most [m]; more is a fault of the registration."""
LARGEST_TURN = 0.1
"""Angle of the difference that is corrected at most [rad]."""
FASTEST_SHIFT = 0.05
"""Speed with which a correction changes at most [m/s]."""
FASTEST_TURN = 0.2
"""Angular speed with which a correction changes at most [rad/s]."""


class SeenOffset(NamedTuple):
    """Where a body is seen, from where the arm takes it to be: shift (3,) [m], and the turn that
    leads from one orientation to the other, a rotation vector (3,) [rad]; axes of the world.
    """

    shift: np.ndarray
    turn: np.ndarray


class HandSeen:
    """The difference between two accounts of a body that the arm moves: of cameras, which are
    late, and of the arm, which is wrong.

    Limited in size and rate. While the body is not seen, the last difference stays.

    Parameters
    ----------
    name
        Of the body; empty: it is not looked at.
    registration
        Of the cameras that see it, and of the tracked body on the hand; default: they agree with
        the arm.
    largest
        Of the shift and of the turn that are told at most [m], [rad].
    """

    def __init__(
        self,
        name: str,
        registration: Registration | None = None,
        largest: tuple[float, float] = (LARGEST_SHIFT, LARGEST_TURN),
    ):
        self.name, self._registration = name, registration or Registration()
        self._largest = largest
        self.newest_ns = 0
        """Stamp of the newest pose that counted [ns]; 0 before any."""
        self._arm: deque[tuple[int, np.ndarray, np.ndarray]] = deque()
        self._waiting: deque[tuple[int, np.ndarray, np.ndarray]] = deque(maxlen=WAITING)
        self._seen, self._poses = np.zeros(6), 0
        self._offset, self._told_ns = np.zeros(6), 0

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A pose from the cameras; left out if it is of another body, or the arm was not heard
        around that instant. One whose stamp is newer than the arm's waits for the arm.

        Parameters
        ----------
        body
            Its role.
        stamp_ns, position, quaternion
            In the world of the cameras [ns], (3,) [m], (4,).
        """
        if body == self.name:
            stamp_ns -= round(1e9 * self._registration.delay)
            self._waiting.append((stamp_ns, position, quaternion))
            self._compare()

    def _compare(self) -> None:
        """Compare the poses that have come with the arm, as far as it was heard."""
        while self._waiting and self._arm and self._waiting[0][0] <= self._arm[-1][0]:
            stamp_ns, position, quaternion = self._waiting.popleft()
            if len(self._arm) > 1 and max(self._arm[0][0], self.newest_ns + 1) <= stamp_ns:
                self._compare_one(stamp_ns, position, quaternion)

    def _compare_one(self, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        places, turns = self._registration.poses(position[None], quaternion[None])
        later = min(bisect_right([one[0] for one in self._arm], stamp_ns), len(self._arm) - 1)
        (first_ns, *first), (second_ns, *second) = self._arm[later - 1], self._arm[later]
        share = (stamp_ns - first_ns) / (second_ns - first_ns)
        there = first[0] + share * (second[0] - first[0])
        # within one period of the arm a mean of rotations is one, to the second order
        turned = first[1] + share * (second[1] - first[1])
        new = np.concatenate([places[0] - there, turn(matrices(turns[0]), turned)])
        since = (stamp_ns - self.newest_ns) * 1e-9
        self._poses, self.newest_ns = self._poses + 1, stamp_ns
        # The mean of the first poses, until there are so many that the time constant asks for
        # less.
        self._seen = self._seen + max(1.0 / self._poses, min(since / FILTER_TIME, 1.0)) * (
            new - self._seen
        )

    def is_lost(self, stamp_ns: int) -> bool:
        """Whether the body was seen before, but not lately, at an instant [ns]."""
        return bool(self.newest_ns) and (stamp_ns - self.newest_ns) * 1e-9 > LOST

    def offset(self, stamp_ns: int, position: np.ndarray, rotation: np.ndarray) -> SeenOffset:
        """The difference now; to be called once for every state.

        Parameters
        ----------
        stamp_ns
            Of the state [ns].
        position, rotation
            Of the body by the arm (3,) [m] and (3, 3).
        """
        self._arm.append((stamp_ns, position, rotation))
        self._compare()
        while (stamp_ns - self._arm[0][0]) * 1e-9 > ARM_MEMORY:
            self._arm.popleft()
        step = min((stamp_ns - self._told_ns) * 1e-9, ARM_MEMORY)
        self._told_ns = stamp_ns
        parts = (
            (slice(0, 3), self._largest[0], FASTEST_SHIFT),
            (slice(3, 6), self._largest[1], FASTEST_TURN),
        )
        for part, largest, fastest in parts:
            wanted = at_most(self._seen[part], largest)
            self._offset[part] += at_most(wanted - self._offset[part], fastest * step)
        return SeenOffset(self._offset[:3].copy(), self._offset[3:].copy())


TAKES_OUT = 4.0
"""Rate at which what is left of the distance to the plan is taken out [1/s]: modulus margin 0.55,
together with `FILTER_TIME`, where 0.67 are left without.
"""
LARGEST_REST = 0.015
"""So much of what is left is taken out at most [m]."""
LARGEST_REST_TURN = 0.05
"""Turn that is left of which no more is taken out [rad]."""


class RestTakenOut:
    """Integral of the distance between where the hand shall be and where it is, which a soft arm
    with friction leaves.
    """

    def __init__(self) -> None:
        self._sum, self._then = np.zeros(6), 0.0

    def at(self, time: float, left: np.ndarray, most: float = LARGEST_REST) -> SeenOffset:
        """How much farther than wanted to aim, as an offset of the hand.

        Parameters
        ----------
        time
            Since the motion began [s].
        left
            Where the hand is, from where it shall be: shift and turn (6,) [m], [rad].
        most
            Where more is left, something holds the hand [m], which is aimed less far then.
        """
        step = time - self._then
        self._then = time
        parts = (slice(0, 3), LARGEST_REST), (slice(3, 6), LARGEST_REST_TURN)
        if math.hypot(*left[:3]) >= most or math.hypot(*left[3:]) >= LARGEST_REST_TURN:
            self._sum *= max(1.0 - TAKES_OUT * step, 0.0)
        else:
            for part, largest in parts:
                self._sum[part] = at_most(self._sum[part] + TAKES_OUT * step * left[part], largest)
        return SeenOffset(self._sum[:3].copy(), self._sum[3:].copy())
