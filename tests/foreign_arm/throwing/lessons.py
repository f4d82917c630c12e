"""Lessons in throwing, and the places of their baskets."""

import re

import numpy as np
from dart_skill_msgs.msg import Situation
from geometry_msgs.msg import Point, Pose

from tests.foreign_arm.outsider import Outsider
from tests.foreign_arm.session import Task
from tests.foreign_arm.throwing.person import COCKED, Thrower
from tests.foreign_arm.throwing.scene import BallScene

RIM = 0.40


def rim(distance, azimuth):
    """Centre of a basket's rim (3,) at a distance [m] and an azimuth [rad]."""
    return np.array([distance * np.cos(azimuth), distance * np.sin(azimuth), RIM])


LESSONS = [
    rim(*place)
    for place in ((1.6, -0.5), (2.1, -0.3), (1.85, 0.0), (1.55, 0.25), (2.15, 0.4), (1.8, 0.6))
]
TARGETS = [rim(*place) for place in ((1.8, -0.35), (2.0, 0.2), (1.7, 0.45))]


def basket_at(x, y, z):
    """The situation of a throw: where the centre of the rim is [m]."""
    return Situation(bodies=["basket"], poses=[Pose(position=Point(x=x, y=y, z=z))])


class ThrowingOutsider(Outsider):
    """Has a person throw, and the arm."""

    def teach(self, rim, keep=False):
        """One guided throw at a basket (3,): whether it went in, and the recorder's answer to
        ~/stop; misses are kept only with `keep`.
        """
        person = self.driver.person
        self.driver.plant.stand(rim)
        self.do(person.cock(rim), person.bring_ball(), person.wait(0.3))
        self.start()
        self.do(person.throw(rim))
        hit = person.in_basket(rim)
        person.aim.learn(rim, person.landing)
        return hit, self.stop(hit or keep)

    def prepare(self, rim):
        """The basket stands there (3,), the ball is in the hand."""
        self.driver.plant.stand(rim)
        self.do(self.driver.person.bring_ball())

    def throw(self, rim):
        """The arm throws at a basket (3,); the result of the action."""
        return self.execute(basket_at(*rim))

    def help_with(self, asked):
        """See `Outsider`: bring the ball, or the basket."""
        if "put the ball into the hand" in asked:
            self.driver.person.begin(self.driver.person.bring_ball())
        elif asked.startswith("put the basket at"):
            x, y, z = (float(word) for word in re.findall(r"[xyz] (-?[0-9.]+)", asked)[:3])
            self.driver.plant.stand(np.array([x, y, z]))


THROW = Task("throw", BallScene, Thrower, ThrowingOutsider, COCKED)
