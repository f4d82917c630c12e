"""Reach into a cup that moves: over its rim, and down to its middle.

Two task frames: where the hand starts, and the cup, which moves. The model is asked at every state
of the arm with the cup where it is seen then, so it need not be known what the cup will do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.common.situation import Pose, Situation
from dart_skill.movement import VelocityThreshold
from dart_skill.recording import HAND, Demonstration
from dart_skill.skills.protocol import Skill, SkillSettings, SkillWords, Solid, TaskOutcome

WIDE = 0.05
"""Radius of a cup, as viewers show it: nothing touches it [m]."""
WAY = ("way_x", "way_y", "way_z")
"""Numbers of a situation that say how far the cup goes [m]."""
UNHURRIED = {"start": 4.0, "duration": 10.0, "steady": 0.0}
"""Numbers of a belt that is slow enough for a mouse; at its usual speed a person would have one
second [s].
"""
RESTING = 0.2
"""Where the hand ends is the median of what was seen for so long after it has come to rest in the
cup [s].
"""


@dataclass(frozen=True)
class ReachSettings(SkillSettings):
    """Beside those of every skill:

    Parameters
    ----------
    middle
        Where the hand shall end, in the frame of the cup (3,) [m].
    rim
        Height of the cup's rim in its frame [m].
    rim_tolerance
        How far from the axis of the cup the hand may be when it comes past the rim [m].
    end_tolerance
        How far from the middle it may be at the end [m].
    shown_at, shown_within
        In simulation, cups are shown about this place when the hand sets off, and within so much
        of it (3,) [m].
    way, way_time
        They go so far at most (3,) [m], in this time [s]: at constant speed, or from rest to rest.
    turn
        They are turned by so much about the vertical at most [rad]; the belt runs where it likes.
    asked
        Cups that are tried are so many times farther away, and so many times faster, at most.
    reach
        Distances from the axis of the base within which the arm can reach down [m]; the cup keeps
        them for `awhile` [s].
    """

    representation: str = "autonomous"
    middle: tuple[float, ...] = (0.0, 0.0, 0.0)
    rim: float = 0.06
    rim_tolerance: float = 0.01
    end_tolerance: float = 0.01
    shown_at: tuple[float, ...] = (0.62, 0.0, 1.10)
    shown_within: tuple[float, ...] = (0.08, 0.15, 0.05)
    way: tuple[float, ...] = (0.05, 0.20, 0.0)
    way_time: float = 2.4
    turn: float = 0.5
    asked: float = 1.5
    reach: tuple[float, ...] = (0.42, 0.75)
    awhile: float = 3.4


class Reach(Skill):
    """Reach into a cup that moves."""

    name = "reach"
    task = "reach into the cup"
    bodies = ("cup",)
    world = "belt"
    turns_hand = False
    bodies_move = True
    shown_by = "follow"
    started_by = in_the_way = "cup"
    corrects = "cup"
    numbers = (*WAY, "steady", "start", "duration", "tunnel")
    units = MappingProxyType(
        {**dict.fromkeys(WAY, "m"), "start": "s", "duration": "s", "tunnel": "s"}
    )
    settings_type = ReachSettings
    settings: ReachSettings

    @property
    def words(self) -> SkillWords:
        return replace(
            super().words,
            stand="put the cup where the belt begins, and let the cameras see it",
            then="the belt may start",
            start="start the belt: the arm reaches as soon as the cup moves",
            demo_seconds=72.0,
        )

    def solids(self, role: str) -> Sequence[Solid]:
        return (Solid("cup", (WIDE, self.settings.rim, 0.003)),)

    def cut(self, demonstration: Demonstration) -> tuple[float, float]:
        """From when the hand begins to move to when it rests in the cup, as seen from there: the
        cup may go on.

        Raises
        ------
        ValueError
            If the hand does not move.
        """
        d, s = demonstration, self.settings
        speeds = self._speeds(d.hand_time, d.hand_position)
        fastest = int(np.argmax(speeds))
        if speeds[fastest] <= s.start_speed:
            raise ValueError(
                f"the hand is never faster than {s.start_speed} m/s: is it the recording of a"
                " reach?"
            )
        # A hand that was only taken, and sank a little, has not begun.
        rests = np.flatnonzero(speeds[:fastest] < s.stop_speed)
        rested = int(rests[-1]) if len(rests) else 0
        begins = rested + int(np.argmax(speeds[rested:] > s.start_speed))
        return float(d.hand_time[begins]), self._rests_at(d, self._from_cup(d))

    def draw(self, rng: np.random.Generator, wide: bool = False) -> Situation:
        """A cup on a belt that the arm reaches; the numbers are those of the simulated world
        `belt`.
        """
        s, size = self.settings, self.settings.asked if wide else 1.0
        while True:
            begin = np.array(s.shown_at) + size * rng.uniform(-1.0, 1.0, 3) * s.shown_within
            way = size * rng.uniform(-1.0, 1.0, 3) * s.way
            turn, steady = rng.uniform(-s.turn, s.turn), bool(rng.integers(2))
            share = s.awhile / s.way_time if steady else min(1.0, s.awhile / s.way_time)
            far = [float(np.hypot(*place[:2])) for place in (begin, begin + share * way)]
            if s.reach[0] < min(far) and max(far) < s.reach[1]:
                break
        numbers = {
            "way_x": way[0],
            "way_y": way[1],
            "way_z": way[2],
            "duration": s.way_time,
            "steady": steady,
        }
        upright = Rotation.from_rotvec([0.0, 0.0, turn]).as_quat()
        return Situation(
            {"cup": Pose(begin, upright)}, {name: float(value) for name, value in numbers.items()}
        )

    def in_words(self, situation: Situation) -> str:
        """Where the cup is, and how it moves."""
        numbers = dict(situation.numbers)
        x, y, z = (f"{round(numbers.pop(name, 0.0), 2) + 0.0:+.2f}" for name in WAY)
        ends = "at one speed" if numbers.pop("steady", 1.0) else "and rests"
        moves = any(name in situation.numbers for name in WAY)
        said = Situation(situation.poses, numbers).in_words(units=self.units)
        return f"{said}; it moves by {x}, {y}, {z} m {ends}" if moves else said

    def unhurried(self, situation: Situation) -> Situation:
        """The cup sets off later, goes as far in more time, and rests there."""
        return replace(situation, numbers={**situation.numbers, **UNHURRIED})

    def inputs(self, situation: Situation) -> Sequence[float]:
        """None: how the belt will run is nothing that the arm knows."""
        return []

    def distances(self, seen: Demonstration) -> tuple[float, float]:
        """Distances of the hand from the cup's axis as it passes the rim, and from the middle at
        the end [m].

        Parameters
        ----------
        seen
            The movement.

        Raises
        ------
        ValueError
            If it did not.
        """
        at_rim, miss = self._places(seen)
        return float(np.hypot(*at_rim[:2])), float(np.linalg.norm(miss))

    def _places(self, seen: Demonstration) -> tuple[np.ndarray, np.ndarray]:
        """Where the hand came past the rim, and ended from the middle, (3,) each, as the cup sees
        it [m]; ValueError if nowhere.
        """
        time, local = seen.hand_time, self._from_cup(seen)
        stop = self._rests_at(seen, local)
        k = self._past_rim(local)
        at_rim = _between(local[k], local[k + 1], self.settings.rim)
        return (
            at_rim,
            np.median(local[(time >= stop) & (time <= stop + RESTING)], axis=0)
            - self.settings.middle,
        )

    def judge(self, seen: Demonstration, situation: Situation) -> TaskOutcome:
        """Whether the hand came into the cup without touching its rim, and ended in its middle.

        Parameters
        ----------
        seen
            The movement.
        """
        try:
            at_rim, miss = self._places(seen)
        except ValueError as error:
            return TaskOutcome(False, np.nan, str(error))
        s, rim, end = self.settings, float(np.hypot(*at_rim[:2])), float(np.linalg.norm(miss))
        reason = ""
        if rim > s.rim_tolerance:
            reason = f"the hand was {1e3 * rim:.0f} mm from the axis of the cup at its rim"
        elif end > s.end_tolerance:
            reason = f"the hand ended {1e3 * end:.0f} mm from the middle of the cup"
        return TaskOutcome(not reason, end, reason, miss)

    # what was seen from the cup

    def _from_cup(self, seen: Demonstration) -> np.ndarray:
        """The hand in the frame of the cup, at the stamps of the hand (n, 3) [m]."""
        cup = seen.track("cup").resampled(seen.hand_time)
        return (
            Rotation.from_quat(cup.quaternion)
            .inv()
            .apply(seen.track(HAND).position - cup.position)
        )

    def _past_rim(self, local: np.ndarray) -> int:
        """Index of the last sample above the rim before the hand stayed below it; ValueError if it
        did not.
        """
        above = np.flatnonzero(local[:, 2] > self.settings.rim)
        if not len(above) or above[-1] >= len(local) - 2:
            raise ValueError(
                f"the hand did not come into the cup: it was seen last {1e3 * local[-1, 2]:.0f} mm"
                " above its floor"
            )
        return int(above[-1])

    def _rests_at(self, seen: Demonstration, local: np.ndarray) -> float:
        """When the hand has come to rest in the cup [s]; ValueError if it did not."""
        time, below = seen.hand_time, np.arange(len(local)) > self._past_rim(local)
        speeds = self._speeds(time, local)
        rests = np.flatnonzero(below & (speeds < self.settings.stop_speed))
        if not len(rests):
            raise ValueError(
                "the hand did not come to rest in the cup: it was never slower than"
                f" {speeds[below].min():.2f} m/s there"
            )
        return float(time[rests[0]])

    def _speeds(self, time: np.ndarray, position: np.ndarray) -> np.ndarray:
        return VelocityThreshold(
            start=self.settings.start_speed, stop=self.settings.stop_speed
        ).speeds(time, position)


def _between(before: np.ndarray, after: np.ndarray, height: float) -> np.ndarray:
    """The point (3,) at a height on the line between two others."""
    return before + (before[2] - height) / (before[2] - after[2]) * (after - before)
