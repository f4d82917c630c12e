"""Place a part: take it, carry it to a holder that stands elsewhere and is turned, and put it in.

As in figure 7.4 of the thesis, which enters a frame along its axis: two task frames, where the
hand takes the part and the holder, both with their full orientation. The fingers close at the
beginning and open at the end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.arm import ArmDescription, with_box
from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import HAND, Demonstration
from dart_skill.skills.protocol import (
    OF_REACTING,
    Skill,
    SkillSettings,
    SkillWords,
    Solid,
    TaskOutcome,
)

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
WALL = 0.01
"""Thickness of the walls of the holder [m]."""
TABLE = (0.9, 1.8, 0.04)
"""Edges of its top, as viewers show it [m]."""


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


class Place(Skill):
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

    def check_seen(self, role: str, pose: Pose) -> None:
        """ValueError if the holder stands where the arm cannot point its hand straight down."""
        (near, far), away = self.settings.reach, float(np.hypot(*pose.position[:2]))
        if role == "holder" and not near < away < far:
            raise ValueError(
                f"the holder is {away:.2f} m from the axis of the base: put it between {near:.2f}"
                f" and {far:.2f} m from there, where the hand can point straight down"
            )

    @property
    def seat(self) -> Pose:
        """Pose of the part in the frame of the holder when it is in."""
        return Pose(np.array(self.settings.seat))

    def goal(self, situation: Situation) -> Pose:
        """In the holder."""
        return situation.pose("holder").place(self.seat)

    @property
    def world_settings(self) -> Mapping[str, Any]:
        s = self.settings
        return {
            "size": s.size,
            "mass": s.mass,
            "grasp": s.grasp,
            "depth": s.depth,
            "clearance": GAP,
            "wall": WALL,
            "holder": (*s.shown_at, s.table + s.floor),
        }

    def draw(self, rng: np.random.Generator, wide: bool = False) -> Situation:
        """A holder near `shown_at`, turned, where the arm can point its hand straight down over
        it, on the table or on something.
        """
        s = self.settings
        away, turn = (s.asked_within, s.asked_turn) if wide else (s.shown_within, s.shown_turn)
        while True:
            aside = away * rng.uniform(-1.0, 1.0, 2)
            place = np.array(s.shown_at) + aside
            if np.hypot(*aside) < away and s.reach[0] < np.hypot(*place) < s.reach[1]:
                break
        height = s.table + s.floor + rng.uniform(0.0, s.raised)
        turned = Rotation.from_rotvec([0.0, 0.0, rng.uniform(-turn, turn)]).as_quat()
        return Situation({"holder": Pose(np.append(place, height), turned)})

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

    def surroundings(self) -> Sequence[Solid]:
        """The table."""
        return (Solid("box", TABLE, (0.8, 0.0, self.settings.table - 0.5 * TABLE[2])),)

    def loaded(self, description: ArmDescription) -> ArmDescription:
        """The arm with the part in its hand."""
        s = self.settings
        return with_box(description, s.mass, s.size, s.grasp)

    @property
    def frame_names(self) -> tuple[str, ...]:
        return HAND, "holder"

    def frames(self, situation: Situation) -> list[Pose]:
        """Where the hand takes the part; and where the hand would be if the part, held as it is,
        were where the holder is.

        So a part that was taken a little askew goes into the holder all the same.
        """
        hand, part = situation.pose(HAND), situation.pose("part")
        return [hand, situation.pose("holder").place(part.sees(hand))]

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
