"""Lessons in placing, and where their holders stand."""

import numpy as np

from tests.foreign_arm import published
from tests.foreign_arm.outsider import Outsider
from tests.foreign_arm.placing.person import OVER_THE_PART, Placer
from tests.foreign_arm.placing.scene import BENCH, BenchScene
from tests.foreign_arm.session import Task


def draw_holder(random, kind):
    """Place (3,) and rotation (3, 3) of a holder that is "shown" or "asked" for: near to where the
    skill is shown, turned, and raised a little.
    """
    away, turn = BENCH[f"{kind}_within"], BENCH[f"{kind}_turn"]
    nearest, farthest = BENCH["reach"]
    while True:
        aside = away * random.uniform(-1.0, 1.0, 2)
        place = BENCH["shown_at"] + aside
        if np.hypot(*aside) < away and nearest < np.hypot(*place) < farthest:
            break
    height = BENCH["table"] + BENCH["floor"] + random.uniform(0.0, BENCH["raised"])
    return np.append(place, height), published.about_z(random.uniform(-turn, turn))


def seat(holder):
    """Pose of a part in a holder (3,), (3, 3)."""
    return holder[0] + holder[1] @ BENCH["seat"], holder[1]


class PlacingOutsider(Outsider):
    """Has a person place parts, and the arm."""

    def set_up(self, holder):
        """The holder stands there, and the open hand of a free arm is around the part."""
        self.driver.plant.stand(*holder)
        person = self.driver.person
        self.do(person.lead_back(), person.bring_part(), person.wait(0.3))

    def teach(self, holder):
        """One guided part: whether it is in the holder, and the recorder's answer to ~/stop."""
        self.set_up(holder)
        self.start()
        self.do(self.driver.person.place(seat(holder)))
        placed = self.driver.plant.scene.is_placed()
        return placed, self.stop(placed)

    def place(self, holder):
        """The arm places a part into a holder; the result of the action, and whether it is in."""
        assert self.call("/commander/release_arm", data=True).success
        self.set_up(holder)
        assert self.call("/commander/release_arm", data=False).success
        result = self.execute()
        self.driver.run(0.5)
        return result, self.driver.plant.scene.is_placed()

    def off_seat(self):
        """Where the part is, from its seat in the holder (3,) [m]."""
        return self.driver.plant.scene.seen_from("holder")[0] - BENCH["seat"]


PLACE = Task("place", BenchScene, Placer, PlacingOutsider, OVER_THE_PART)
