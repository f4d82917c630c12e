"""Stir: a spoon goes round in a pot that stands elsewhere, as often in a second as is asked for.

The movement repeats (representation `rhythmic`). Its last task frame is the pose that the hand would
have if the spoon, held as it is, were where the pot is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.arm import MotionPlan
from dart_skill.common.situation import Pose, Situation
from dart_skill.movement import VelocityThreshold
from dart_skill.recording import Demonstration
from dart_skill.skills.protocol import (
    OF_REACTING,
    Planner,
    SkillSettings,
    SkillWords,
    Solid,
    TaskOutcome,
)
from dart_skill.skills.table import WALL, TableSkill

FEWEST_SEEN = 20
"""Poses of the spoon in the pot that tell how it was stirred."""
INNER = 0.5
"""The first turn and the last are looked at but for so much of them: the hand sets off, and stops."""


@dataclass(frozen=True)
class StirSettings(SkillSettings):
    """Beside those of every skill:

    Parameters
    ----------
    radius, height
        Of the circle of the spoon's tip, and of that over the floor of the pot [m].
    path_tolerance
        How far the tip may be from its circle: root mean square [m].
    frequency_tolerance
        How much faster or slower than asked for, as a share.
    turns
        How many a trial has.
    inner, depth
        Inner radius and depth of the pot [m].
    wall_distance
        The spoon stays so far from the wall [m].
    mass, size
        Of the spoon, a rod [kg], (3,) [m]; its tip is at its lower end.
    grasp
        Of its centre in the frame of the hand that holds it (3,) [m].
    shown_at, shown_within, shown_turn
        About there the pot stands when it is shown in simulation (2,) [m], at most so far away [m]
        and turned [rad].
    asked_within, asked_turn
        The same of pots that are tried.
    asked_frequency
        Least and largest frequency that is tried in simulation [1/s].
    reach
        Distances from the axis of the base at which the arm points its hand straight down over a
        pot (2,) [m].
    table, floor, raised
        Height of the table, thickness of the floor of the pot, and of what it may stand on [m].
    """

    representation: str = "rhythmic"
    radius: float = 0.04
    height: float = 0.03
    path_tolerance: float = 0.006
    frequency_tolerance: float = 0.05
    turns: int = 5
    inner: float = 0.09
    depth: float = 0.08
    wall_distance: float = 0.01
    mass: float = 0.08
    size: tuple[float, ...] = (0.015, 0.015, 0.20)
    grasp: tuple[float, ...] = (0.0, 0.0, 0.12)
    shown_at: tuple[float, ...] = (0.60, 0.10)
    shown_within: float = 0.08
    shown_turn: float = 0.3
    asked_within: float = 0.20
    asked_turn: float = 0.6
    asked_frequency: tuple[float, ...] = (0.4, 1.0)
    reach: tuple[float, ...] = (0.42, 0.70)
    table: float = 1.12
    floor: float = 0.01
    raised: float = 0.03

    UNUSED: ClassVar[frozenset[str]] = OF_REACTING


class Stirred(NamedTuple):
    """How a spoon went round.

    * turns: how often.
    * frequency: turns in a second between the first half turn and the last one [1/s].
    * error: of the tip from its circle there, root mean square [m].
    * middle: of its circle there, from where it should be (3,) [m], in the frame of the pot.
    """

    turns: float
    frequency: float
    error: float
    middle: np.ndarray


class Stir(TableSkill):
    """Stir in a pot."""

    name = "stir"
    task = "stir in the pot"
    bodies = ("spoon", "pot")
    in_hand = in_the_way = "spoon"
    corrects = "pot"
    world = "stove"
    shown_by = "stir"
    numbers = ("amplitude", "frequency", "turns")
    units = MappingProxyType({"frequency": "/s"})
    settings_type = StirSettings
    settings: StirSettings

    @property
    def words(self) -> SkillWords:
        return replace(
            super().words,
            begin="hold the hand with the spoon beside the pot, still, and press Enter",
            show=(
                "bring the spoon into the pot, go round three times, lift it out, hold still for a"
                " second, press Enter"
            ),
            load="put the spoon between the fingers as it was shown, then stand back",
            then="the arm stirs",
            lessons=1,
        )

    # its world

    @property
    def tip(self) -> Pose:
        """Lower end of the spoon, in its frame."""
        return Pose(np.array([0.0, 0.0, -0.5 * self.settings.size[2]]))

    def tip_in(self, pot: Pose, place: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Where the tip is in the frame of a pot, for a place (3,) or (n, 3) [m] of the spoon and
        its quaternion (4,) or (n, 4).
        """
        tip = place + Rotation.from_quat(turn).apply(self.tip.position)
        return (tip - pot.position) @ pot.rotation

    def goal(self, situation: Situation) -> Pose:
        """The middle of the circle."""
        s = self.settings
        up = np.array([0.0, 0.0, s.height + 0.5 * s.size[2]])
        return situation.pose("pot").place(Pose(up))

    @property
    def clearance(self) -> float:
        """Between the spoon in the middle of the pot and its wall [m]."""
        return self.settings.inner - 0.5 * max(self.settings.size[:2])

    @property
    def person_settings(self) -> Mapping[str, Any]:
        return {"radius": self.settings.radius}

    def draw(self, rng: np.random.Generator, wide: bool = False) -> Situation:
        """See `TableSkill`; wide, with a frequency, and a number of turns."""
        drawn = super().draw(rng, wide)
        if not wide:
            return drawn
        slowest, fastest = self.settings.asked_frequency
        numbers = {
            "frequency": float(rng.uniform(slowest, fastest)),
            "turns": float(self.settings.turns),
        }
        return replace(drawn, numbers=numbers)

    def solids(self, role: str) -> Sequence[Solid]:
        s = self.settings
        if role == "spoon":
            x, y, z = s.size
            return (Solid("box", (x, y, z)),)
        return (Solid("cup", (s.inner, s.depth, WALL)),)

    # what is learned

    def inputs(self, situation: Situation) -> Sequence[float]:
        """None: the representation asks for the numbers by their names."""
        return []

    def cut(self, demonstration: Demonstration) -> tuple[float, float]:
        """From when the hand sets off to when it comes to rest at last: it may rest between the way
        to the pot and the turns.

        Raises
        ------
        ValueError
            If the hand does not move.
        """
        s, time = self.settings, demonstration.hand_time
        thresholds = VelocityThreshold(start=s.start_speed, stop=s.stop_speed)
        speeds = thresholds.speeds(time, demonstration.hand_position)
        if speeds.max() <= s.start_speed:
            raise ValueError(
                f"the hand is never faster than {s.start_speed} m/s: is it the recording of a hand"
                " that stirs?"
            )
        fast = np.flatnonzero(speeds > s.start_speed)
        slow = np.flatnonzero(speeds < s.stop_speed)
        before, after = slow[slow < fast[0]], slow[slow > fast[-1]]
        return (
            float(time[before[-1] if len(before) else 0]),
            float(time[after[0] if len(after) else -1]),
        )

    def refine(self, plan: MotionPlan, situation: Situation, planner: Planner) -> MotionPlan:
        """The same plan; ValueError where the spoon would meet the wall of the pot."""
        s, amplitude = self.settings, situation.numbers.get("amplitude", 1.0)
        x, y, _ = s.size
        wide = amplitude * s.radius + 0.5 * float(np.hypot(x, y))
        if wide > s.inner - s.wall_distance:
            most = (s.inner - s.wall_distance - wide) / s.radius + amplitude
            raise ValueError(
                f"amplitude {amplitude:g} brings the spoon {1e3 * (s.inner - wide):.0f} mm from the"
                f" wall of the pot, nearer than {1e3 * s.wall_distance:.0f} mm (wall_distance): ask"
                f" for at most {most:.2f}"
            )
        return plan

    # what came of it

    def stirred(self, seen: Demonstration, situation: Situation) -> Stirred:
        """How the spoon went round, as it was seen.

        Raises
        ------
        ValueError
            If it did not.
        """
        s, spoon = self.settings, seen.track("spoon")
        local = self.tip_in(situation.pose("pot"), spoon.position, spoon.quaternion)
        inside = (local[:, 2] < s.depth) & (np.hypot(*local[:, :2].T) < s.inner)
        if inside.sum() < FEWEST_SEEN:
            raise ValueError("the spoon was not seen in the pot")
        time, local = spoon.time[inside], local[inside]
        angle = np.unwrap(np.arctan2(local[:, 1], local[:, 0])) / (2.0 * np.pi)
        angle = angle if angle[-1] > angle[0] else -angle
        inner = (angle > angle[0] + INNER) & (angle < angle[-1] - INNER)
        if inner.sum() < FEWEST_SEEN:
            raise ValueError(f"the spoon went round {angle[-1] - angle[0]:.1f} times")
        time, local, turned = time[inner], local[inner], angle[inner]
        radius = s.radius * situation.numbers.get("amplitude", 1.0)
        off = np.hypot(np.hypot(*local[:, :2].T) - radius, local[:, 2] - s.height)
        return Stirred(
            turns=float(angle[-1] - angle[0]),
            frequency=float(np.polyfit(time - time[0], turned, 1)[0]),
            error=float(np.sqrt(np.mean(np.square(off)))),
            middle=_middle(local) - [0.0, 0.0, s.height],
        )

    def judge(self, seen: Demonstration, situation: Situation) -> TaskOutcome:
        """Whether the tip of the spoon went round on its circle, as often and as fast as was asked
        for.

        Parameters
        ----------
        seen
            The movement.
        """
        try:
            made = self.stirred(seen, situation)
        except ValueError as error:
            return TaskOutcome(False, np.nan, str(error))
        reason = self._missed(made, situation.numbers)
        return TaskOutcome(not reason, made.error, reason, made.middle)

    def _missed(self, made: Stirred, asked: Mapping[str, float]) -> str:
        """What is not as it was asked for, in words."""
        s = self.settings
        frequency, turns = asked.get("frequency", made.frequency), asked.get("turns", 1.0)
        if made.error > s.path_tolerance:
            return f"the spoon was {1e3 * made.error:.1f} mm from its circle (root mean square)"
        if abs(made.frequency / frequency - 1.0) > s.frequency_tolerance:
            return (
                f"it went round {made.frequency:.2f} times in a second, not {frequency:.2f} times"
            )
        if made.turns < turns - 2.0 * INNER:
            return f"it went round {made.turns:.1f} times, not {turns:.0f} times"
        return ""


def _middle(local: np.ndarray) -> np.ndarray:
    """Middle (3,) of the circle that is nearest to points (n, 3), by least squares of its equation
    in the plane (Kasa, 1976).
    """
    plane = local[:, :2]
    rows = np.column_stack([2.0 * plane, np.ones(len(plane))])
    x, y, _ = np.linalg.lstsq(rows, np.square(plane).sum(axis=1), rcond=None)[0]
    return np.array([x, y, local[:, 2].mean()])
