"""The simulated worlds by name, and what may happen in them to the arm, unannounced: its ball, joints,
motors, hand or base are others from then on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from dart_skill.simulation._plant import Plant
from dart_skill.simulation._plant_settings import Board, PlantSettings

WORLDS = ("basket", "board", "bench", "belt", "stove")
"""A ball in the hand, and a basket; a dart, and a board; a part on a table, and a holder into
which it fits; a cup on a belt, and an empty hand; a spoon in the hand, and a pot.
"""
CHANGES: dict[str, dict[str, Any]] = {
    "none": {},
    "heavier_ball": {"ball_mass_scale": 2.0},
    "friction": {"friction_scale": 2.0},
    "weaker_motors": {"motor_scale": 0.8},
    "slower_hand": {"hand_delay": 0.045},
    "base_turned": {"base_turn": float(np.deg2rad(5.0))},
}
"""Settings of the plant: a ball of twice the mass, joints with twice the friction, motors with 80
% of their torque, ...
"""


class BoardWorld(Plant):
    """The world of darts: a plant with a board in its settings, whose bodies have the names of
    that game.

    The numbers of a situation say what is aimed at; the world is the same for all of them.
    """

    loose_body, movable_body = "dart", "board"
    numbers = ("right", "up")

    def __init__(self, settings: PlantSettings, seed: int = 0, board: Board | None = None):
        super().__init__(replace(settings, board=board or settings.board or Board()), seed)

    def change(self, settings: PlantSettings) -> None:
        """See `Plant`; the board hangs where it did."""
        super().change(replace(settings, board=self.settings.board))

    def _check_situation(self, roles: Iterable[str], numbers: Iterable[str] = ()) -> None:
        if named := ", ".join(sorted(roles)):
            raise ValueError(
                f"the board hangs where it is (board_position): no situation puts the {named}"
                " somewhere"
            )
        super()._check_situation((), numbers)


def make_world(
    name: str,
    settings: PlantSettings,
    seed: int = 0,
    board: Board | None = None,
    own: Mapping[str, Any] | None = None,
) -> Plant:
    """The world of that name.

    Parameters
    ----------
    board
        Where it hangs, if not where config/world.yaml says.
    own
        What a skill says of it (`Skill.world_settings`): fields of `Bench`.

    Raises
    ------
    ValueError
        Lists those that there are.
    ValueError
        Names one that is none, or another world.
    """
    if name in ("bench", "stove"):
        return _workbench(name, settings, seed, own or {})
    _check_own(name, own or {}, set())
    if name == "basket":
        return Plant(settings, seed)
    if name == "board":
        return BoardWorld(settings, seed, board)
    if name == "belt":
        # with rotations of SciPy, which throws do without
        from dart_skill.simulation._conveyor import Conveyor

        return Conveyor(settings, seed)
    raise ValueError(f"no world '{name}': choose one of {', '.join(WORLDS)}")


def _workbench(name: str, settings: PlantSettings, seed: int, own: Mapping[str, Any]) -> Plant:
    # with rotations of SciPy, too
    from dart_skill.simulation._stove import Stove
    from dart_skill.simulation._workbench import Bench, Workbench

    _check_own(name, own, {one.name for one in fields(Bench)})
    kind = Stove if name == "stove" else Workbench
    return kind(Bench(**own), settings, seed)


def _check_own(name: str, own: Mapping[str, Any], known: set[str]) -> None:
    """ValueError names what a skill says of a world that has none of this."""
    if unknown := set(own) - known:
        raise ValueError(
            f"the world '{name}' has no {', '.join(sorted(unknown))}: leave it out of the skill's"
            " world_settings"
        )


def changed(settings: PlantSettings, change: str) -> PlantSettings:
    """The plant after a change, one of `CHANGES`."""
    return replace(settings, **CHANGES[change])
