"""One demonstration of any skill: where the tracked bodies were, the arm's joints, and what the
fingers were told.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dart_skill.arm import Grip
from dart_skill.common.checks import check_samples, check_unit_quaternions
from dart_skill.common.constants import N_JOINTS
from dart_skill.skills.protocol._situation import Pose

HAND = "hand"
"""The role that every skill has."""
BEFORE = 0.1
"""A body is where it was in so long before an instant [s], in the median of what was seen of it
then.
"""


@dataclass(frozen=True, eq=False)
class Track:
    """A tracked body: stamps time (n,) [s], position (n, 3) [m] and quaternion (n, 4), in the
    world of the cameras.
    """

    time: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray

    def __post_init__(self) -> None:
        time, position = check_samples("track", self.time, self.position, least=1)
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "position", position)
        object.__setattr__(
            self, "quaternion", check_unit_quaternions("track", self.quaternion, len(time))
        )

    def pose_at(self, instant: float) -> Pose:
        """Where the body was just before an instant [s]: the median of the positions, and the mean
        of the orientations seen then.

        Of a body that was not seen then, the last that was seen before; if nothing was, the first
        that was seen after.
        """
        seen = (self.time <= instant) & (self.time >= instant - BEFORE)
        if not seen.any():
            seen = np.arange(len(self.time)) == max(
                int(np.searchsorted(self.time, instant, side="right")) - 1, 0
            )
        nearest = self.quaternion[seen][-1]
        same_sign = self.quaternion[seen] * np.sign(self.quaternion[seen] @ nearest)[:, None]
        return Pose(np.median(self.position[seen], axis=0), same_sign.mean(axis=0))

    def resampled(self, time: np.ndarray) -> Track:
        """The body at other stamps (n,) [s]: linear between samples; before the first and after
        the last as it was there.
        """
        turns = np.vstack(
            [
                np.ones((1, 1)),
                np.sign(np.sum(self.quaternion[1:] * self.quaternion[:-1], axis=1))[:, None],
            ]
        )
        rows = np.hstack(
            [
                self.position,
                self.quaternion * np.cumprod(np.where(turns == 0.0, 1.0, turns), axis=0),
            ]
        )
        there = np.column_stack([np.interp(time, self.time, column) for column in rows.T])
        return Track(
            time, there[:, :3], there[:, 3:] / np.linalg.norm(there[:, 3:], axis=1, keepdims=True)
        )


@dataclass(frozen=True)
class Told:
    """The fingers were told something at `time` [s]."""

    time: float
    grip: Grip


@dataclass(frozen=True, eq=False)
class TaskDemonstration:
    """What was seen of one movement; all on one clock.

    * id: str.
    * tracks: of the bodies by role; one is the hand.
    * joint_time, joint_position, joint_velocity: (k,) [s], (k, 7) [rad], (k, 7) [rad/s]; k = 0 if
      the joints were not recorded.
    * told: what the fingers were told, in order.
    * stamp_ns: the instant that is 0 on that clock [ns].
    """

    id: str
    tracks: Mapping[str, Track]
    joint_time: np.ndarray
    joint_position: np.ndarray
    joint_velocity: np.ndarray
    told: tuple[Told, ...] = ()
    stamp_ns: int = 0

    def __post_init__(self) -> None:
        if HAND not in self.tracks:
            raise ValueError(
                f"demonstration {self.id} has no track of the hand, only of"
                f" {', '.join(sorted(self.tracks)) or 'nothing'}"
            )
        n = len(self.joint_time)
        for name in ("joint_position", "joint_velocity"):
            if np.shape(getattr(self, name)) != (n, N_JOINTS):
                raise ValueError(
                    f"demonstration {self.id}: {name} has shape {np.shape(getattr(self, name))},"
                    f" not {(n, N_JOINTS)}"
                )

    def track(self, role: str) -> Track:
        """Track of one body; ValueError if it was never seen."""
        if role not in self.tracks:
            raise ValueError(
                f"demonstration {self.id}: the {role} was never seen; tracked were"
                f" {', '.join(sorted(self.tracks))}"
            )
        return self.tracks[role]

    @property
    def hand_time(self) -> np.ndarray:
        return self.tracks[HAND].time

    @property
    def hand_position(self) -> np.ndarray:
        return self.tracks[HAND].position

    @property
    def hand_quaternion(self) -> np.ndarray:
        return self.tracks[HAND].quaternion
