"""A dart in the hand, and a board in front of the arm."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from dart_skill.simulation._board import Board
from dart_skill.simulation._plant import Plant, PlantSettings


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
        """As of every plant; the board hangs where it did."""
        super().change(replace(settings, board=self.settings.board))

    def _check_movable(self, roles: Iterable[str]) -> None:
        if named := ", ".join(sorted(roles)):
            raise ValueError(
                f"the board hangs where it is (board_position): no situation puts the {named}"
                " somewhere"
            )
