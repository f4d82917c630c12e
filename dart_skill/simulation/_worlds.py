"""The simulated worlds by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from dart_skill.simulation._board import Board
from dart_skill.simulation._board_world import BoardWorld
from dart_skill.simulation._plant import Plant, PlantSettings

WORLDS = ("basket", "board", "bench", "belt")
"""A ball in the hand, and a basket; a dart, and a board; a part on a table, and a holder into
which it fits; a cup on a belt, and an empty hand.
"""


def make_world(
    name: str,
    settings: PlantSettings,
    seed: int = 0,
    board: Board | None = None,
    own: Mapping[str, Any] | None = None,
) -> Plant:
    """The world of that name; ValueError lists those that there are.

    * board: where it hangs, if not where config/world.yaml says.
    * own: what a skill says of it (`Skill.world_settings`): fields of `Bench`. ValueError names
      one that is none, or another world.
    """
    if name == "bench":
        return _workbench(settings, seed, own or {})
    _check_own(name, own or {}, set())
    if name == "basket":
        return Plant(settings, seed)
    if name == "board":
        return BoardWorld(settings, seed, board)
    if name == "belt":
        from dart_skill.simulation._conveyor import (
            Conveyor,
        )  # with rotations of SciPy, which throws do without

        return Conveyor(settings, seed)
    raise ValueError(f"no world '{name}': choose one of {', '.join(WORLDS)}")


def _workbench(settings: PlantSettings, seed: int, own: Mapping[str, Any]) -> Plant:
    from dart_skill.simulation._workbench import Bench, Workbench  # with rotations of SciPy, too

    _check_own("bench", own, {one.name for one in fields(Bench)})
    return Workbench(Bench(**own), settings, seed)


def _check_own(name: str, own: Mapping[str, Any], known: set[str]) -> None:
    """ValueError names what a skill says of a world that has none of this."""
    if unknown := set(own) - known:
        raise ValueError(
            f"the world '{name}' has no {', '.join(sorted(unknown))}: leave it out of the skill's"
            " world_settings"
        )
