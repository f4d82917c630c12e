"""What sensors see of tracked bodies and of the arm, kept with its stamps until it is forgotten."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dart_skill.arm import all_finite
from dart_skill.common.arm_choice import joint_count
from dart_skill.common.constants import Grip
from dart_skill.common.situation import Situation
from dart_skill.recording import HAND, WORDS, Demonstration, Event, Track

RESET_NS = 500_000_000
"""Where the arm's own sensors were silent for longer, the world was set anew: what was seen before
belongs to no movement after it.
"""

JOINTS = "arm's joints"
"""What the arm's own sensors are called."""
REPEATED_NS = 100_000_000
"""Longest time between two commands to the fingers that are one: a commander repeats them."""
LOOK_BACK_NS = 500_000_000
"""Longest time for which a body is where it was last seen."""


@dataclass
class Stream:
    """Samples of one sensor: stamps [ns] and rows of numbers, in the order of their stamps."""

    stamps: list[int] = field(default_factory=list)
    rows: list[np.ndarray] = field(default_factory=list)

    def add(self, stamp_ns: int, row: np.ndarray) -> bool:
        """Keep a sample unless it is not finite, or not newer than the last one: drivers repeat
        stale poses.
        """
        row = np.asarray(row, dtype=float)
        if (self.stamps and stamp_ns <= self.stamps[-1]) or not all_finite(row):
            return False
        self.stamps.append(stamp_ns)
        self.rows.append(row)
        return True

    def extend(self, stamps: np.ndarray, rows: np.ndarray) -> int:
        """Keep those of many samples, stamps (n,) [ns] and rows (n, d), that `add` would keep one
        by one.

        Returns
        -------
        int
            How many.
        """
        stamps, rows = np.asarray(stamps, dtype=np.int64), np.asarray(rows, dtype=float)
        finite = np.isfinite(rows.sum(axis=1))  # as `all_finite`
        never = np.iinfo(np.int64).min
        newest = np.maximum.accumulate(
            np.concatenate([self.stamps[-1:] or [never], np.where(finite, stamps, never)])
        )[:-1]
        kept = finite & (stamps > newest)
        self.stamps += stamps[kept].tolist()
        self.rows += list(rows[kept])
        return int(kept.sum())

    def part(self, since_ns: int, until_ns: int) -> Stream:
        """The samples between two instants."""
        kept = slice(bisect_left(self.stamps, since_ns), bisect_right(self.stamps, until_ns))
        return Stream(self.stamps[kept], self.rows[kept])

    def between(self, origin_ns: int, start: float, stop: float) -> tuple[np.ndarray, np.ndarray]:
        """Times since the origin (n,) [s] and rows (n, d) between two times."""
        time = (np.array(self.stamps, dtype=np.int64) - origin_ns) * 1e-9
        kept = (time >= start) & (time <= stop)
        return time[kept], np.array(self.rows)[kept]


class SensorLog:
    """Poses of bodies by their role, joint states, and what the fingers were told, since `clear`.

    Attributes: turned, roles of the bodies whose orientation counts; left_out, how many samples of
    each sensor were stale or not finite.

    Parameters
    ----------
    roles
        Of the bodies.
    joint_period_ns
        Joint states are thinned to about this period, the rate of the poses, counted from when the
        world was set anew [ns].
    """

    def __init__(self, roles: Sequence[str], joint_period_ns: int = 10_000_000):
        self._roles, self._joint_period_ns = tuple(roles), max(1, joint_period_ns)
        self.turned = frozenset(self._roles)
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self.bodies = {role: Stream() for role in self._roles}
        self.joints = Stream()
        self._joint_phase_ns = 0
        self.left_out: Counter[str] = Counter()
        self.told: list[tuple[int, Grip]] = []
        self._last_told: tuple[int, Grip] = (-REPEATED_NS, Grip.UNSPECIFIED)

    @property
    def rejected(self) -> int:
        """How many samples were stale or not finite."""
        return sum(self.left_out.values())

    def take(self, role: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A pose of a body: position (3,) [m] and quaternion (4,)."""
        self._keep(role, stamp_ns, np.concatenate([position, quaternion]))

    def _keep(self, role: str, stamp_ns: int, row: np.ndarray) -> None:
        self.left_out[role] += not self.bodies[role].add(stamp_ns, row)

    def wants_joints(self, stamp_ns: int) -> bool:
        """Whether a joint state of this stamp would be kept."""
        if self._begins_a_world(stamp_ns):
            return True
        phase, period = self._joint_phase_ns, self._joint_period_ns
        return (stamp_ns - phase) // period > (self.joints.stamps[-1] - phase) // period

    def add_joints(self, stamp_ns: int, position: np.ndarray, velocity: np.ndarray) -> None:
        """A joint state: (7,) [rad] and (7,) [rad/s]."""
        if self.wants_joints(stamp_ns):
            if self._begins_a_world(stamp_ns):
                self._joint_phase_ns = stamp_ns
            self.left_out[JOINTS] += not self.joints.add(
                stamp_ns, np.concatenate([position, velocity])
            )
        else:
            self.left_out[JOINTS] += stamp_ns <= self.joints.stamps[-1]

    def _begins_a_world(self, stamp_ns: int) -> bool:
        return not self.joints.stamps or stamp_ns - self.joints.stamps[-1] > RESET_NS

    def add_told(self, stamp_ns: int, grip: Grip) -> None:
        """The fingers were told something; the same again and again counts once."""
        if grip == Grip.UNSPECIFIED:
            return
        before, last = self._last_told
        self._last_told = stamp_ns, grip
        if grip != last or abs(stamp_ns - before) > REPEATED_NS:
            self.told.append((stamp_ns, grip))

    def stamps(self) -> list[np.ndarray]:
        """Stamps (n,) [ns] of each sensor's samples: of the bodies in the order of their roles,
        then of the joints.
        """
        return [np.array(stream.stamps, dtype=np.int64) for stream in self._streams()]

    def forget_before(self, stamp_ns: int) -> None:
        """Forget samples before an instant; the newest of each sensor tells stale ones and is
        kept.
        """
        for stream in self._streams():
            old = slice(0, min(bisect_left(stream.stamps, stamp_ns), len(stream.stamps) - 1))
            del stream.stamps[old], stream.rows[old]
        self.told = [one for one in self.told if one[0] >= stamp_ns]

    def seen(self, name: str, since_ns: int, until_ns: int, skill: str) -> Demonstration:
        """All that was seen between two stamps, with the first as the origin of its times.

        Raises
        ------
        ValueError
            Says which body was never seen.
        """
        tracks = {}
        for role, stream in self.bodies.items():
            part = stream.part(since_ns, until_ns)
            if not part.stamps:
                raise ValueError(f"the {role} was not seen: is it tracked and published?")
            rows = np.array(part.rows)
            tracks[role] = Track(_seconds(part.stamps, since_ns), rows[:, :3], rows[:, 3:])
        joints = self.joints.part(since_ns, until_ns)
        states = np.array(joints.rows).reshape(-1, 2 * joint_count())
        return Demonstration(
            id=name,
            tracks=tracks,
            stamp_ns=since_ns,
            skill=skill,
            joint_time=_seconds(joints.stamps, since_ns),
            joint_position=states[:, : joint_count()],
            joint_velocity=states[:, joint_count() :],
            events=tuple(
                Event(WORDS[grip], (ns - since_ns) * 1e-9)
                for ns, grip in self.told
                if since_ns <= ns <= until_ns
            ),
        )

    def world_begins_ns(self, instant_ns: int | None = None) -> int:
        """Stamp of the first sample of the hand since the world was last set anew before an
        instant; None: the instant at which the fingers were first told something, or the end.

        Raises
        ------
        ValueError
            If the hand was not seen there.
        """
        if instant_ns is None:
            instant_ns = self.told[0][0] if self.told else np.iinfo(np.int64).max
        stamps = np.array(self.joints.stamps, dtype=np.int64)
        begins = stamps[1:][(np.diff(stamps) > RESET_NS) & (stamps[1:] <= instant_ns)]
        since = int(begins[-1]) if len(begins) else 0
        hand = self.bodies[HAND].stamps
        first = bisect_left(hand, since)
        if first == len(hand):
            raise ValueError(
                "no samples of the hand since the world was set anew: is it tracked and published?"
            )
        return hand[first]

    def situation_at(self, stamp_ns: int) -> Situation:
        """Where all bodies beside the hand were just before a stamp.

        Raises
        ------
        ValueError
            Says which one was not seen.
        """
        poses = {}
        for role, stream in self.bodies.items():
            if role == HAND:
                continue
            part = stream.part(stamp_ns - LOOK_BACK_NS, stamp_ns)
            if not part.stamps:
                raise ValueError(f"the {role} was not seen: is it tracked and published?")
            rows = np.array(part.rows)
            track = Track(_seconds(part.stamps, stamp_ns), rows[:, :3], rows[:, 3:])
            poses[role] = track.pose_at(0.0)
        return Situation(poses)

    def _streams(self) -> tuple[Stream, ...]:
        return *self.bodies.values(), self.joints


def _seconds(stamps: Sequence[int], origin_ns: int) -> np.ndarray:
    """Stamps (n,) [ns] as seconds after an origin."""
    return (np.array(stamps, dtype=np.int64) - origin_ns) * 1e-9
