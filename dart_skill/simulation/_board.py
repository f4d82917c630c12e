"""The dart board. What meets the board's face sticks there, seen by the cameras like a ball is."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dart_skill.common.surface import BOARD_DIAMETER, BoardFace
from dart_skill.common.world import the_world


@dataclass(frozen=True)
class Board:
    """A round board that faces the arm's base axis; its position is the bull's centre on the face.

    The default, of config/world.yaml, is regulation: the bull 1.73 m above the floor, 2.37 m from
    where the thrower stands, the base axis.

    Parameters
    ----------
    thickness : [m]
        Of what the cameras cannot see through.
    """

    position: tuple[float, float, float] = the_world().board_position
    thickness: float = 0.038

    @cached_property
    def face(self) -> BoardFace:
        return BoardFace(self.position)

    def hit(self, before: np.ndarray, after: np.ndarray) -> np.ndarray | None:
        """Where a dart that moved from one point (3,) to another met the face of the board (3,),
        if it did.

        Parameters
        ----------
        before, after
            The two points.
        """
        face = self.face
        first, last = (face.distance - point @ face.normal for point in (before, after))
        if not first > 0.0 >= last:
            return None
        point = before + first / (first - last) * (after - before)
        return point if face.holds(point) else None

    @cached_property
    def capsules(self) -> tuple[np.ndarray, np.ndarray]:
        """The board as upright rods behind its face: ends (c, 2, 3) and radii (c,), to hide things
        from cameras.
        """
        face, radius = self.face, 0.5 * self.thickness
        aside = np.arange(-5, 6) * self.thickness
        half = np.sqrt(np.maximum((0.5 * BOARD_DIAMETER) ** 2 - aside**2, 0.0)) - radius
        middle = np.array(self.position) + radius * face.normal + aside[:, None] * face.axes[:, 1]
        up = half[:, None] * face.axes[:, 0]
        return np.stack([middle - up, middle + up], axis=1), np.full(len(aside), radius)
