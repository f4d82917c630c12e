"""What the sensors see of the bodies of a skill, and what the fingers are told, kept until it is
cut into a demonstration.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence

import numpy as np

from dart_skill.arm import Grip
from dart_skill.common.constants import N_JOINTS
from dart_skill.skills.observation import RESET_NS, SensorLog
from dart_skill.skills.protocol._demonstration import HAND, TaskDemonstration, Told, Track
from dart_skill.skills.protocol._situation import Situation

REPEATED_NS = 100_000_000
"""A commander tells the fingers the same again and again: what comes within so long of the last
time is the same word.
"""

LOOK_BACK_NS = 500_000_000
"""A body is where it was seen so long ago at most: what is older may be of another world."""


class TaskLog(SensorLog):
    """Poses of the hand and of the bodies of a skill, joint states, and what the fingers were
    told, with stamps [ns].

    * bodies: roles of the tracked bodies beside the hand.
    * joint_period_ns: as of `SensorLog`.
    """

    def __init__(self, bodies: Sequence[str], joint_period_ns: int = 10_000_000):
        super().__init__((HAND, *bodies), joint_period_ns)

    def clear(self) -> None:
        super().clear()
        self.told: list[tuple[int, Grip]] = []
        self._last: tuple[int, Grip] = (-REPEATED_NS, Grip.UNSPECIFIED)

    def add_told(self, stamp_ns: int, grip: Grip) -> None:
        """The fingers were told something; the same again and again counts once."""
        if grip == Grip.UNSPECIFIED:
            return
        before, last = self._last
        self._last = stamp_ns, grip
        if grip != last or abs(stamp_ns - before) > REPEATED_NS:
            self.told.append((stamp_ns, grip))

    def forget_before(self, stamp_ns: int) -> None:
        super().forget_before(stamp_ns)
        self.told = [one for one in self.told if one[0] >= stamp_ns]

    def cut(self, name: str, since_ns: int, until_ns: int) -> TaskDemonstration:
        """What was seen between two stamps, with the first as the origin of its times; ValueError
        says which body was never seen.
        """
        tracks = {}
        for role, stream in self.bodies.items():
            kept = slice(
                bisect_left(stream.stamps, since_ns), bisect_right(stream.stamps, until_ns)
            )
            if kept.start == kept.stop:
                raise ValueError(f"the {role} was not seen: is it tracked and published?")
            rows = np.array(stream.rows[kept])
            tracks[role] = Track(_seconds(stream.stamps[kept], since_ns), rows[:, :3], rows[:, 3:])
        joints = self.joints.part(since_ns, until_ns)
        rows = np.array(joints.rows).reshape(-1, 2 * N_JOINTS)
        told = tuple(
            Told((ns - since_ns) * 1e-9, grip)
            for ns, grip in self.told
            if since_ns <= ns <= until_ns
        )
        return TaskDemonstration(
            name,
            tracks,
            _seconds(joints.stamps, since_ns),
            rows[:, :N_JOINTS],
            rows[:, N_JOINTS:],
            told,
            stamp_ns=since_ns,
        )

    @property
    def world_begins_ns(self) -> int:
        """Stamp of the first sample of the hand in the world in which the fingers were told
        something first, or in the last one.

        ValueError if the hand was not seen there.
        """
        stamps = np.array(self.joints.stamps, dtype=np.int64)
        until = self.told[0][0] if self.told else np.iinfo(np.int64).max
        begins = stamps[1:][(np.diff(stamps) > RESET_NS) & (stamps[1:] <= until)]
        since = int(begins[-1]) if len(begins) else 0
        hand = [stamp for stamp in self.bodies[HAND].stamps if stamp >= since]
        if not hand:
            raise ValueError("the hand was not seen: is it tracked and published?")
        return hand[0]

    def situation_at(self, stamp_ns: int) -> Situation:
        """Where all bodies beside the hand were just before a stamp; ValueError says which one was
        not seen.
        """
        seen = self.cut("look", stamp_ns - LOOK_BACK_NS, stamp_ns)
        return Situation(
            {
                role: track.pose_at(LOOK_BACK_NS * 1e-9)
                for role, track in seen.tracks.items()
                if role != HAND
            }
        )


def _seconds(stamps: Sequence[int], origin_ns: int) -> np.ndarray:
    """Stamps (n,) [ns] as seconds after an origin."""
    return (np.array(stamps, dtype=np.int64) - origin_ns) * 1e-9
