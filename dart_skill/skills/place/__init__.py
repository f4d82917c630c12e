"""Place a part: take it, carry it to a holder that stands elsewhere and is turned, and put it in.

As in figure 7.4 of the thesis, which enters a frame along its axis: two task frames, where the
hand takes the part and the holder, both with their full orientation. The fingers close at the
beginning and open at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import Demonstration
from dart_skill.skills.protocol import (
    OF_REACTING,
    SkillSettings,
    SkillWords,
    Solid,
    TaskOutcome,
)
from dart_skill.skills.table import WALL, TableSkill

LIES = 0.3
"""The part is looked at so long after the fingers were told to open at the earliest [s]: it may
still fall.
"""

FARTHEST_ASIDE = 0.01
"""Distance from the axis of the holder beyond which a part is still on its way, or lost [m]."""
CLEAR = 0.002
"""Height above the rim below which a part may touch it [m]."""
FRAMES_BEFORE = 5
"""Frames in which a part is looked at before it may touch the rim."""

GAP = 0.003
"""Clearance between part and holder on each side [m]."""


@dataclass(frozen=True)
class PlaceSettings(SkillSettings):
    """Beside those of every skill:

    Parameters
    ----------
    seat
        Of the part's origin in the frame of the holder when it is in (3,) [m].
    depth
        Of the holder from its rim [m].
    seat_tolerance
        How far from there it may be along the axis of the holder [m].
    side_tolerance
        And across; the clearance, and what the cameras are off by [m].
    tilt_tolerance
        How far its axis may lean to that of the holder [rad].
    mass, size
        Of the part, a box [kg], (3,) [m].
    grasp
        Of its centre in the frame of the hand that holds it (3,) [m].
    shown_at
        About there the holder stands when it is shown in simulation, and there until somebody puts
        it elsewhere (2,) [m].
    shown_within, shown_turn
        At most so far away [m] and turned [rad].
    asked_within, asked_turn
        The same of holders that are tried.
    reach
        Distances from the axis of the base at which the arm points its hand straight down over a
        holder (2,) [m].
    table, floor, raised
        Height of the table, thickness of the holder's floor, and of what it may stand on [m].
    """

    seat: tuple[float, ...] = (0.0, 0.0, 0.05)
    depth: float = 0.04
    seat_tolerance: float = 0.006
    side_tolerance: float = 0.006
    tilt_tolerance: float = 0.1
    mass: float = 0.35
    size: tuple[float, ...] = (0.05, 0.05, 0.10)
    grasp: tuple[float, ...] = (0.0, 0.0, 0.14)
    shown_at: tuple[float, ...] = (0.60, 0.10)
    shown_within: float = 0.12
    shown_turn: float = 0.5
    asked_within: float = 0.30
    asked_turn: float = 1.0471975511965976
    reach: tuple[float, ...] = (0.42, 0.75)
    table: float = 1.1502
    floor: float = 0.01
    raised: float = 0.05

    UNUSED: ClassVar[frozenset[str]] = OF_REACTING


class Place(TableSkill):
    """Put a part into a holder."""

    name = "place"
    task = "put the part on its holder"
    bodies = ("part", "holder")
    in_hand = in_the_way = "part"
    corrects = "holder"
    settings_type = PlaceSettings
    settings: PlaceSettings

    @property
    def words(self) -> SkillWords:
        return replace(
            super().words,
            load="put the part between the fingers as it was shown, then stand back",
            then="the arm places it",
            demo_seconds=82.0,
        )

    @property
    def seat(self) -> Pose:
        """Pose of the part in the frame of the holder when it is in."""
        return Pose(np.array(self.settings.seat))

    def goal(self, situation: Situation) -> Pose:
        """In the holder."""
        return situation.pose("holder").place(self.seat)

    @property
    def clearance(self) -> float:
        """Between part and holder on each side [m]."""
        return GAP

    def solids(self, role: str) -> Sequence[Solid]:
        s = self.settings
        if role == "part":
            x, y, z = s.size
            return (Solid("box", (x, y, z)),)
        inner, half = 0.5 * np.array(s.size[:2]) + GAP, 0.5 * s.depth
        outer, (x, y) = inner + WALL, inner + 0.5 * WALL
        wide, deep = (WALL, 2 * outer[1], s.depth), (2 * inner[0], WALL, s.depth)
        floor = Solid("box", (2 * outer[0], 2 * outer[1], s.floor), (0.0, 0.0, -0.5 * s.floor))
        sides = [
            (wide, (x, 0.0, half)),
            (wide, (-x, 0.0, half)),
            (deep, (0.0, y, half)),
            (deep, (0.0, -y, half)),
        ]
        return (floor, *(Solid("box", size, centre) for size, centre in sides))

    def judge(self, seen: Demonstration, situation: Situation) -> TaskOutcome:
        """Whether the part is in the holder, after the fingers have opened.

        Parameters
        ----------
        seen
            The movement.
        """
        part, opened = seen.track("part"), [one.time for one in seen.events][-1:]
        if not opened or part.time[-1] < opened[0] + LIES:
            return TaskOutcome(
                False,
                np.nan,
                "the part was not seen after the hand had opened: do the cameras see into the"
                " holder?",
            )
        s, lies = self.settings, situation.pose("holder").sees(part.pose_at(part.time[-1]))
        off = lies.position - np.array(s.seat)
        error, aside, tilt = (
            float(np.linalg.norm(off)),
            float(np.hypot(*off[:2])),
            float(np.arccos(np.clip(lies.rotation[2, 2], -1.0, 1.0))),
        )
        miss = self._beside(seen, situation)
        if abs(off[2]) > s.seat_tolerance:
            reason = (
                f"the part is {1e3 * off[2]:+.0f} mm from its seat along the axis: it jammed, or"
                " lies outside"
            )
            return TaskOutcome(False, error, reason, miss)
        if aside > s.side_tolerance:
            return TaskOutcome(
                False, error, f"the part is {1e3 * aside:.0f} mm beside its seat", miss
            )
        if tilt > s.tilt_tolerance:
            return TaskOutcome(
                False, error, f"the part leans by {np.degrees(tilt):.0f} degrees", miss
            )
        return TaskOutcome(True, error, miss=miss)

    def _beside(self, seen: Demonstration, situation: Situation) -> np.ndarray:
        """How far beside the axis of the holder the part came down (3,) [m], just before it could
        touch; nan if it came down elsewhere.

        What becomes of it afterwards is the work of the walls.
        """
        holder, part = situation.pose("holder"), seen.track("part")
        local = (part.position - holder.position) @ holder.rotation - np.array(self.settings.seat)
        over = (
            (np.hypot(local[:, 0], local[:, 1]) < FARTHEST_ASIDE)
            & (local[:, 2] > self.settings.depth + CLEAR)
            & (part.time < seen.events[-1].time)
        )
        last = np.flatnonzero(over)[-FRAMES_BEFORE:]
        if len(last) < FRAMES_BEFORE:
            return np.full(3, np.nan)
        return np.append(local[last, :2].mean(axis=0), 0.0)
