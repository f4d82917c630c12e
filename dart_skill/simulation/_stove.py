"""A pot beside the simulated arm, and a spoon in its hand, as it was put there.

The spoon touches the walls and the floor of the pot, with friction. What is in the pot is not
simulated.
"""

from __future__ import annotations

import numpy as np

from dart_skill.simulation._workbench import UPRIGHT, Boxes, Workbench

SIDES = 12
"""Boxes that the wall of a pot is made of."""


class Stove(Workbench):
    """A workbench whose part is a spoon, which the hand holds from the beginning of an episode on,
    and whose holder is a pot: `Bench.clearance` is between the spoon in its middle and the wall.

    The numbers of a situation say how it is stirred; the world is the same for all of them.
    """

    loose_body, movable_body = "spoon", "pot"
    numbers = ("amplitude", "frequency", "turns")

    @property
    def inner(self) -> float:
        """Inner radius of the pot [m]."""
        return self.bench.clearance + 0.5 * max(self.bench.size[:2])

    @property
    def succeeded(self) -> bool:
        """Whether the spoon is in the pot, and held."""
        place, _ = self.bodies[self.movable_body]
        local = np.array(self._loose.position) - place
        low = 0.5 * self.bench.size[2] + self.bench.depth
        return self.holds and bool(np.hypot(*local[:2]) < self.inner and local[2] < low)

    def _walls(self) -> Boxes:
        """A floor, and boxes in a ring."""
        b = self.bench
        angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
        away, half = self.inner + 0.5 * b.wall, 0.5 * b.depth
        wide = (self.inner + b.wall) * np.tan(np.pi / SIDES)
        sizes = [[self.inner, self.inner, 0.5 * b.wall]] + SIDES * [[0.5 * b.wall, wide, half]]
        ring = [[away * np.cos(one), away * np.sin(one), half] for one in angles]
        turns = [[0.0, 0.0, np.sin(0.5 * one), np.cos(0.5 * one)] for one in angles]
        centres = [[0.0, 0.0, -0.5 * b.wall], *ring]
        return sizes, centres, [UPRIGHT, *turns]

    def _fill_hand(self) -> None:
        """An episode begins with the spoon in the hand, as it was met there."""
        super()._fill_hand()
        self._grasp()
