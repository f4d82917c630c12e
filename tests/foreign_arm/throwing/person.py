"""A person who guides the arm by hand and elbow through a throw, opens the hand with a button, and
puts the ball back into it.
"""

import numpy as np

from tests.foreign_arm import published
from tests.foreign_arm.arm import PERIOD
from tests.foreign_arm.person import Person, Way, minimum_jerk
from tests.foreign_arm.throwing.scene import AIR_DENSITY

COCKED = np.array([0.0, -1.10, 0.0, -0.60, 0.0, -0.55, 0.0])
"""Wound up behind the shoulder: where a swing begins; J1 turns it to the basket [rad]."""
FOLLOWED = np.array([0.0, 0.20, 0.0, 0.45, 0.0, 0.55, 0.0])
"""Where the swing would end; the ball leaves half way, where the arm is fastest, nearly straight
and 30 degrees backwards.
"""
EXPECTED_DELAY = (
    0.045  # between the button and the free ball, which the person has got used to [s]
)
FASTEST, SLOWEST = 0.9, 1.8  # durations of a swing [s]


def fall(place, velocity, height, drag):
    """Where a ball comes down through a height (3,): drag is its deceleration over the square of
    its speed [1/m].
    """
    place, velocity = np.array(place, float), np.array(velocity, float)
    gravity = np.array([0.0, 0.0, -published.GRAVITY])
    while place[2] > height or velocity[2] > 0.0:
        middle = velocity + 0.5 * PERIOD * (gravity - drag * np.linalg.norm(velocity) * velocity)
        before = place.copy()
        place += PERIOD * middle
        velocity += PERIOD * (gravity - drag * np.linalg.norm(middle) * middle)
    share = (before[2] - height) / max(before[2] - place[2], 1e-9)
    return before + share * (place - before)


def ball_on(way, step):
    """Place and velocity (3,), (3,) of a ball that is held on a way."""
    place = way.hand[step] + way.attitude[step] @ published.BALL_CENTRE
    return place, way.hand_velocity[step] + np.cross(way.spin[step], place - way.hand[step])


def swing_angles(azimuth, duration, amplitude=1.0):
    """Joint angles (n, 7) of a swing; the amplitude scales it about the posture at the release."""
    share = minimum_jerk(round(duration / PERIOD) + 1)[:, None]
    middle = 0.5 * (COCKED + FOLLOWED)
    angles = middle + amplitude * (share - 0.5) * (FOLLOWED - COCKED)
    angles[:, 0] = azimuth
    return angles


class Aim:
    """How long a swing towards a place takes: thought out with a parabola with drag, then
    corrected by what came of it.
    """

    def __init__(self, drag):
        self._drag = drag
        self._place, self._velocity = ball_on(
            Way.through(swing_angles(0.0, 1.0)), round(0.5 / PERIOD)
        )
        self.correction = np.zeros(2)  # of distance [m] and azimuth [rad]

    @staticmethod
    def resistance(laboratory):
        """Deceleration of the ball over the square of its speed [1/m]."""
        area = np.pi * published.BALL_RADIUS**2
        return 0.5 * AIR_DENSITY * laboratory.drag_coefficient * area / laboratory.ball_mass

    def _reach(self, duration, height):
        return fall(self._place, self._velocity / duration, height, self._drag)[0]

    def at(self, rim):
        """Azimuth [rad] and duration [s] for a rim (3,)."""
        distance = np.hypot(rim[0], rim[1]) + self.correction[0]
        fast, slow = FASTEST, SLOWEST
        for _ in range(30):
            middle = 0.5 * (fast + slow)
            fast, slow = (
                (middle, slow) if self._reach(middle, rim[2]) > distance else (fast, middle)
            )
        return np.arctan2(rim[1], rim[0]) + self.correction[1], 0.5 * (fast + slow)

    def learn(self, rim, landing, share=0.8):
        """From where a throw came down (3,)."""
        missed = np.hypot(*rim[:2]) - np.hypot(*landing[:2])
        turned = np.arctan2(rim[1], rim[0]) - np.arctan2(landing[1], landing[0])
        self.correction += share * np.array([missed, turned])


class Thrower(Person):
    """A person who throws with the arm."""

    def __init__(self, laboratory, plant):
        super().__init__(laboratory, plant)
        self.aim = Aim(Aim.resistance(laboratory))
        self.landing = None

    def cock(self, rim, duration=2.0):
        """Lead the arm to where a swing at a rim (3,) begins."""
        start = self._plant.link_angles
        azimuth, time = self.aim.at(rim)
        share = minimum_jerk(round(duration / PERIOD) + 1)[:, None]
        angles = start + share * (swing_angles(azimuth, time)[0] - start)
        yield from self.follow(Way.through(angles), rest=0.6)

    def throw(self, rim):
        """Swing at a rim (3,), let the ball go, and watch where it comes down."""
        azimuth, duration = self.aim.at(rim)
        longer = 1.0 + self.varies(0.04)
        duration *= 1.0 + self.varies(0.008)
        shift = np.array([self.varies(0.01) for _ in range(3)])
        way = Way.through(
            swing_angles(azimuth + self.varies(0.006), duration * longer, longer), shift
        )
        release = 0.5 * duration * longer - EXPECTED_DELAY + self.varies(0.005)
        self.landing = None
        last = self._plant.pose("ball")[0]
        press = round(release / PERIOD)
        for step, moment in enumerate(self.follow(way, {press: "open"})):
            yield moment
            last = self._watch(last, rim, step > press)
        while self.landing is None:
            yield (), None
            last = self._watch(last, rim, True)
        yield from self.wait(0.5)

    def _watch(self, last, rim, thrown):
        """Note where the ball crosses the height of the rim; its new place."""
        place = self._plant.pose("ball")[0]
        if thrown and self.landing is None and last[2] >= rim[2] > place[2]:
            self.landing = last + (last[2] - rim[2]) / (last[2] - place[2]) * (place - last)
        return place

    def bring_ball(self, duration=0.8):
        """Carry the ball into the open hand, along the palm's axis at last, and close the fingers."""
        hand = self._plant.hand
        hand.open(self._plant.time)
        yield from self.wait(0.15)
        start = self._plant.pose("ball")[0]
        share = minimum_jerk(round(duration / PERIOD))
        for part in np.clip(1.25 * share, 0.0, 1.0):
            yield (), (start + part * (self._above(0.12) - start), None)
        for part in minimum_jerk(100):
            yield (), (self._above(0.12 * (1.0 - part)), None)
        hand.close(self._plant.time)
        for _ in range(120):
            yield (), (self._above(0.0), None)
        yield from self.wait(0.2)

    def _above(self, height):
        return self._plant.grasp() + height * self._plant.pose("hand")[1][:, 2]

    def in_basket(self, rim, radius=0.15):
        """Whether the ball lies in the basket whose rim is there (3,)."""
        place = self._plant.pose("ball")[0]
        return bool(np.hypot(*(place - rim)[:2]) < radius and place[2] < rim[2])
