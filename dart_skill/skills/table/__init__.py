"""What skills have in common that bring what the hand holds to a body which stands on a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.arm import ArmDescription, with_box
from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import HAND
from dart_skill.skills.protocol import Skill, Solid

WALL = 0.01
"""Thickness of the walls of what stands on the table [m]."""
TABLE = (0.9, 1.8, 0.04)
"""Edges of its top, as viewers show it [m]."""


class TableSkill(Skill):
    """Base of such skills: the body `in_hand` comes to the one whose place practice `corrects`.

    Their settings have `depth` and the fields of `PlaceSettings` from `mass` on.
    """

    settings: Any

    @property
    def clearance(self) -> float:
        """Distance of what the hand holds from the walls, in the middle between them [m]."""
        raise NotImplementedError

    def check_seen(self, role: str, pose: Pose) -> None:
        """ValueError if the body stands where the arm cannot point its hand straight down."""
        (near, far), away = self.settings.reach, float(np.hypot(*pose.position[:2]))
        if role == self.corrects and not near < away < far:
            raise ValueError(
                f"the {role} is {away:.2f} m from the axis of the base: put it between {near:.2f}"
                f" and {far:.2f} m from there, where the hand can point straight down"
            )

    @property
    def world_settings(self) -> Mapping[str, Any]:
        s = self.settings
        return {
            "size": s.size,
            "mass": s.mass,
            "grasp": s.grasp,
            "depth": s.depth,
            "clearance": self.clearance,
            "wall": WALL,
            "holder": (*s.shown_at, s.table + s.floor),
        }

    def draw(self, rng: np.random.Generator, wide: bool = False) -> Situation:
        """The body near `shown_at`, turned, where the arm can point its hand straight down
        over it, on the table or on something.
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
        return Situation({self.corrects: Pose(np.append(place, height), turned)})

    def surroundings(self) -> Sequence[Solid]:
        """The table."""
        return (Solid("box", TABLE, (0.8, 0.0, self.settings.table - 0.5 * TABLE[2])),)

    def loaded(self, description: ArmDescription) -> ArmDescription:
        """The arm with what its hand holds."""
        s = self.settings
        return with_box(description, s.mass, s.size, s.grasp)

    @property
    def frame_names(self) -> tuple[str, ...]:
        return HAND, self.corrects

    def frames(self, situation: Situation) -> list[Pose]:
        """Where the hand is at the start; and where it would be if what it holds, held as it
        is, were where the body is that stands.

        So what was taken a little askew comes there all the same.
        """
        hand, held = situation.pose(HAND), situation.pose(self.in_hand)
        return [hand, situation.pose(self.corrects).place(held.sees(hand))]
