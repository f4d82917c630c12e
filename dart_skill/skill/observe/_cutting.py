"""From continuous sensor streams to one demonstration: the motion of the throw between velocity thresholds, and the flight.

Thesis 8.4.3: recording goes on before and after the throw, and the arm may be moved about before it; what counts is the motion
during which the hand was opened, found on the magnitude of the hand's velocity.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field

import numpy as np

from dart_skill.checks import to_the_nanosecond
from dart_skill.movement import VelocityThreshold, segment_containing
from dart_skill.recording import Demonstration
from dart_skill.robot import all_finite, wam_description
from dart_skill.skill.observe._outcome import Outcome, Release, fit_release, judge_flight
from dart_skill.world import the_world

THRESHOLDS = VelocityThreshold(run_up=0.15, settle=0.1)
ARRIVAL_NS = 50_000_000
"""Samples of so long before the end of watching may still be on their way."""
BEFORE_NS = 200_000_000
"""The release is looked for from so long before the hand was told to open."""
RESET_NS = 500_000_000
"""Where the arm's own sensors were silent for longer, the world was set anew: what was seen before does not belong to a throw after it."""


def watched_until(opened_ns: int) -> int:
    """The instant up to which a throw is watched and cut, whoever does it [ns]."""
    return opened_ns + the_world().watch_ns - ARRIVAL_NS


def judged(log: ThrowLog, target: np.ndarray, rim_radius: float, opened_ns: int, until_ns: int) -> tuple[Outcome, Release | None]:
    """What became of a throw at the centre (3,) of a rim, and how the ball left the hand, of what was seen up to an instant.

    ValueError for a target or radius that cannot be.
    """
    outcome = judge_flight(*log.ball_between(opened_ns, until_ns), target, rim_radius)
    return outcome, log.release_between(opened_ns - BEFORE_NS, until_ns)


def seen_down(log: ThrowLog, target: np.ndarray, opened_ns: int, until_ns: int) -> bool:
    """Whether the ball was seen above the plane of a rim (3,) and last below it, so that later poses change no landing."""
    _, position = log.ball_between(opened_ns, until_ns)
    return len(position) > 0 and bool(position[:, 2].max() > target[2] > position[-1, 2])


@dataclass
class _Stream:
    """Samples of one sensor: stamps [ns] and rows of numbers, in the order of their stamps."""

    stamps: list[int] = field(default_factory=list)
    rows: list[np.ndarray] = field(default_factory=list)

    def add(self, stamp_ns: int, row: np.ndarray) -> bool:
        """Keep a sample unless it is not finite, or not newer than the last one: drivers repeat stale poses."""
        row = np.asarray(row, dtype=float)
        if (self.stamps and stamp_ns <= self.stamps[-1]) or not all_finite(row):
            return False
        self.stamps.append(stamp_ns)
        self.rows.append(row)
        return True

    def part(self, since_ns: int, until_ns: int) -> _Stream:
        """The samples between two instants."""
        kept = slice(bisect_left(self.stamps, since_ns), bisect_right(self.stamps, until_ns))
        return _Stream(self.stamps[kept], self.rows[kept])

    def between(self, origin_ns: int, start: float, stop: float) -> tuple[np.ndarray, np.ndarray]:
        """Times since the origin (n,) [s] and rows (n, d) between two times."""
        time = (np.array(self.stamps, dtype=np.int64) - origin_ns) * 1e-9
        kept = (time >= start) & (time <= stop)
        return time[kept], np.array(self.rows)[kept]


class ThrowLog:
    """What the sensors saw since `clear`: pose of the hand, position of the ball, joint states, the hand's button.

    joint_period_ns thins the joint states to about the rate of the poses, counted from when the world was set anew. `rejected` counts
    samples that were stale or not finite.
    """

    def __init__(self, joint_period_ns: int = 10_000_000):
        self._joint_period_ns = max(1, joint_period_ns)
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self.hand, self.ball, self.joints, self.basket = _Stream(), _Stream(), _Stream(), _Stream()
        self.opened_ns: int | None = None
        self.left_ns: int | None = None
        self._joint_phase_ns = 0
        self.rejected = 0

    def add_hand(self, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        self.rejected += not self.hand.add(stamp_ns, np.concatenate([position, quaternion]))

    def add_ball(self, stamp_ns: int, position: np.ndarray) -> None:
        self.rejected += not self.ball.add(stamp_ns, position)

    def add_basket(self, stamp_ns: int, position: np.ndarray) -> None:
        self.rejected += not self.basket.add(stamp_ns, position)

    def wants_joints(self, stamp_ns: int) -> bool:
        """Whether a joint state of this stamp would be kept."""
        if self._begins_a_world(stamp_ns):
            return True
        phase, period = self._joint_phase_ns, self._joint_period_ns
        return (stamp_ns - phase) // period > (self.joints.stamps[-1] - phase) // period

    def add_joints(self, stamp_ns: int, position: np.ndarray, velocity: np.ndarray) -> None:
        if self.wants_joints(stamp_ns):
            if self._begins_a_world(stamp_ns):
                self._joint_phase_ns = stamp_ns
            self.rejected += not self.joints.add(stamp_ns, np.concatenate([position, velocity]))

    def _begins_a_world(self, stamp_ns: int) -> bool:
        return not self.joints.stamps or stamp_ns - self.joints.stamps[-1] > RESET_NS

    def add_opening(self, stamp_ns: int) -> None:
        """The hand was told to open; only the first time counts."""
        if self.opened_ns is None:
            self.opened_ns = stamp_ns

    def add_release(self, stamp_ns: int) -> None:
        """The ball was seen to leave the hand: where nobody knows when the hand was told to open, this tells which motion is the throw."""
        if self.left_ns is None:
            self.left_ns = stamp_ns

    def stamps(self) -> list[np.ndarray]:
        """Stamps (n,) [ns] of each sensor's samples."""
        return [np.array(stream.stamps, dtype=np.int64) for stream in self._streams()]

    def part(self, since_ns: int, until_ns: int) -> ThrowLog:
        """A log of what was seen between two instants, the hand's button aside."""
        part = ThrowLog(self._joint_period_ns)
        part.hand, part.ball, part.joints, part.basket = (stream.part(since_ns, until_ns) for stream in self._streams())
        return part

    def forget_before(self, stamp_ns: int) -> None:
        """Forget samples before an instant; the newest of each sensor tells stale ones and is kept."""
        for stream in self._streams():
            old = slice(0, min(bisect_left(stream.stamps, stamp_ns), len(stream.stamps) - 1))
            del stream.stamps[old], stream.rows[old]

    def _streams(self) -> tuple[_Stream, ...]:
        return self.hand, self.ball, self.joints, self.basket

    def ball_between(self, since_ns: int, until_ns: int) -> tuple[np.ndarray, np.ndarray]:
        """Times (n,) [s] after the first instant and positions (n, 3) of the ball between two instants."""
        if not self.ball.stamps:
            return np.empty(0), np.empty((0, 3))
        return self.ball.between(since_ns, 0.0, (until_ns - since_ns) * 1e-9)

    def release_between(self, since_ns: int, until_ns: int) -> Release | None:
        """How the ball left the hand between two instants; times after the first one. None if hand or flight was not seen."""
        if not (self.ball.stamps and self.hand.stamps):
            return None
        stop = (until_ns - since_ns) * 1e-9
        ball_time, ball = self.ball.between(since_ns, 0.0, stop)
        hand_time, hand = self.hand.between(since_ns, 0.0, stop)
        try:
            grip = wam_description().hand.ball_centre
            return fit_release(ball_time, ball, hand_time, hand[:, :3], hand[:, 3:], grip)
        except ValueError:
            return None

    def cut(self, name: str, until_ns: int, thresholds: VelocityThreshold = THRESHOLDS) -> Demonstration:
        """The throw, up to an instant, as a demonstration; ValueError says what is missing: motion, button, ball, basket."""
        thrown_ns = self.left_ns if self.opened_ns is None else self.opened_ns
        if thrown_ns is None:
            raise ValueError("the hand was never told to open: nothing was thrown")
        for what, stream in (("hand", self.hand), ("ball", self.ball), ("basket", self.basket), ("arm's joints", self.joints)):
            if len(stream.stamps) < 10:
                raise ValueError(f"only {len(stream.stamps)} samples of the {what}: is it tracked and published?")
        origin = self._first_of_the_world(thrown_ns)
        time, hand = self.hand.between(origin, 0.0, (until_ns - origin) * 1e-9)
        thrown = (thrown_ns - origin) * 1e-9
        segment = segment_containing(thresholds.segment(time, hand[:, :3], thrown), thrown)
        origin += round(segment.start * 1e9)
        stop = segment.stop - segment.start
        hand_time, hand = self.hand.between(origin, 0.0, stop)
        ball_time, ball = self.ball.between(origin, 0.0, (until_ns - origin) * 1e-9)
        joint_time, joints = self.joints.between(origin, -0.01, stop)
        return Demonstration(
            id=name,
            stamp_ns=origin,
            target=self._basket_position(origin, stop),
            hand_time=hand_time,
            hand_position=hand[:, :3],
            hand_quaternion=hand[:, 3:],
            ball_time=ball_time,
            ball_position=ball,
            joint_time=joint_time,
            joint_position=joints[:, :7],
            joint_velocity=joints[:, 7:],
            motion_start=to_the_nanosecond(segment.motion_start - segment.start),
            motion_stop=to_the_nanosecond(segment.motion_stop - segment.start),
            hand_opened=np.nan if self.opened_ns is None else (self.opened_ns - origin) * 1e-9,
        )

    def _first_of_the_world(self, thrown_ns: int) -> int:
        """Stamp of the first hand sample since the world was last set anew before the throw: when the log was begun changes no cut."""
        stamps = np.array(self.joints.stamps, dtype=np.int64)
        begins = stamps[1:][(np.diff(stamps) > RESET_NS) & (stamps[1:] <= thrown_ns)]
        since = begins[-1] if len(begins) else 0
        hand = [stamp for stamp in self.hand.stamps if stamp >= since]
        if not hand:
            raise ValueError("no samples of the hand since the world was set anew: is it tracked and published?")
        return hand[0]

    def _basket_position(self, origin_ns: int, stop: float) -> np.ndarray:
        """Where the basket stood during the motion; if it was hidden then, where it was seen at other times (3,)."""
        seen = self.basket.between(origin_ns, 0.0, stop)[1]
        return np.median(seen if len(seen) else self.basket.rows, axis=0)
