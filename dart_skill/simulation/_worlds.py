"""The simulated worlds by name."""

from __future__ import annotations

from dart_skill.simulation._board import Board
from dart_skill.simulation._board_world import BoardWorld
from dart_skill.simulation._conveyor import Conveyor
from dart_skill.simulation._plant import Plant, PlantSettings
from dart_skill.simulation._workbench import Workbench

WORLDS = ("basket", "board", "bench", "belt")
"""A ball in the hand, and a basket; a dart, and a board; a part on a table, and a holder into which it fits; a cup on a belt, and an empty
hand.
"""


def make_world(name: str, settings: PlantSettings, seed: int = 0, board: Board | None = None) -> Plant:
    """The world of that name; ValueError lists those that there are. board: where it hangs, if not where config/world.yaml says."""
    if name == "basket":
        return Plant(settings, seed)
    if name == "board":
        return BoardWorld(settings, seed, board)
    if name == "bench":
        return Workbench(settings=settings, seed=seed)
    if name == "belt":
        return Conveyor(settings, seed)
    raise ValueError(f"no world '{name}': choose one of {', '.join(WORLDS)}")
