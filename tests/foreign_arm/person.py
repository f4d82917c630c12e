"""A person who guides the arm by hand and elbow through a throw, opens the hand with a button, and
puts the ball back into it.
"""

from dataclasses import dataclass

import numpy as np

from tests.foreign_arm import published
from tests.foreign_arm.plant import AIR_DENSITY, PERIOD, SHOULDER

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

HAND_GRASP = (4000.0, 250.0)  # stiffness and damping of the hold at the hand [N/m, N s/m]
HAND_TWIST = (30.0, 0.6)  # the same for turning [N m/rad, N m s/rad]
ELBOW_GRASP = (1500.0, 60.0)
STRONGEST_PUSH, STRONGEST_TWIST = 150.0, 12.0  # [N, N m]
# standard deviation of a force [N] and its corner frequency [rad/s]
TREMBLE, TREMBLE_RATE = (
    0.5,
    60.0,
)


def minimum_jerk(count):
    """Share of the way (count,) from 0 to 1 of a movement with the least jerk."""
    share = np.linspace(0.0, 1.0, count)
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def limited(vector, strongest):
    """The vector, not longer than that."""
    return vector * min(1.0, strongest / max(np.linalg.norm(vector), 1e-9))


def rotation_vector(rotation):
    """Rotation (..., 3, 3), less than half a turn, as a vector (..., 3) [rad]."""
    skew = 0.5 * (rotation - np.swapaxes(rotation, -1, -2))
    axis = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    cosine = 0.5 * (np.trace(rotation, axis1=-2, axis2=-1)[..., None] - 1.0)
    return axis * np.where(sine > 1e-9, np.arctan2(sine, cosine) / np.maximum(sine, 1e-9), 1.0)


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


@dataclass(frozen=True)
class Way:
    """What both hands are led along, a row for each step: hand (n, 3), its attitude (n, 3, 3),
    elbow (n, 3), and velocities (n, 3).
    """

    hand: np.ndarray
    attitude: np.ndarray
    elbow: np.ndarray
    hand_velocity: np.ndarray
    spin: np.ndarray
    elbow_velocity: np.ndarray

    @classmethod
    def through(cls, angles, shift=(0.0, 0.0, 0.0)):
        """Of joint angles (n, 7), shifted as a whole (3,)."""
        rotations, origins = published.frames(angles)
        hand, elbow, attitude = (
            origins[:, 7] + SHOULDER + shift,
            origins[:, 3] + SHOULDER + shift,
            rotations[:, 7],
        )
        turns = rotation_vector(attitude[1:] @ np.swapaxes(attitude[:-1], -1, -2))
        spin = np.vstack([turns, turns[-1:]]) / PERIOD
        return cls(
            hand,
            attitude,
            elbow,
            np.gradient(hand, PERIOD, axis=0),
            spin,
            np.gradient(elbow, PERIOD, axis=0),
        )

    def ball(self, step):
        """Place and velocity (3,), (3,) of a held ball."""
        place = self.hand[step] + self.attitude[step] @ published.BALL_CENTRE
        return place, self.hand_velocity[step] + np.cross(self.spin[step], place - self.hand[step])


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
        self._place, self._velocity = Way.through(swing_angles(0.0, 1.0)).ball(round(0.5 / PERIOD))
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


class Person:
    """Does one thing at a time: `act` gives the pushes on the arm, and where the ball is carried
    to, for the next step.
    """

    def __init__(self, laboratory, plant):
        self._laboratory, self._plant = laboratory, plant
        self._random = np.random.default_rng([laboratory.seed, 74])
        self._tremble = np.zeros(3)
        self._task = iter(())
        self.aim = Aim(Aim.resistance(laboratory))
        self.busy = False
        self.presses = False
        self.landing = None

    def begin(self, *tasks):
        """Do these one after the other."""
        self.busy, self._task = True, (moment for task in tasks for moment in task)

    def act(self):
        """Pushes on the plant and the carried ball's place, for one step."""
        self.presses = False
        moment = next(self._task, None)
        self.busy = moment is not None
        return moment if self.busy else ((), None)

    def _varies(self, spread):
        return self._laboratory.human * spread * np.clip(self._random.standard_normal(), -2.5, 2.5)

    def _hold(self, way, step, firmness):
        """Both hands on the arm at a step of the way: pushes for the plant."""
        place, rotation = self._plant.pose("hand")
        velocity, spin = self._plant.velocity("hand")
        keep = np.exp(-TREMBLE_RATE * PERIOD)
        self._tremble = keep * self._tremble + np.sqrt(
            1.0 - keep**2
        ) * TREMBLE * self._laboratory.human * self._random.standard_normal(3)
        force = (
            HAND_GRASP[0] * (way.hand[step] - place)
            + HAND_GRASP[1] * (way.hand_velocity[step] - velocity)
            + self._tremble
        )
        turn = rotation_vector(way.attitude[step] @ rotation.T)
        moment = HAND_TWIST[0] * turn + HAND_TWIST[1] * (way.spin[step] - spin)
        elbow, elbow_velocity = self._plant.pose("link4")[0], self._plant.velocity("link4")[0]
        second = ELBOW_GRASP[0] * (way.elbow[step] - elbow) + ELBOW_GRASP[1] * (
            way.elbow_velocity[step] - elbow_velocity
        )
        return (
            (
                "hand",
                firmness * limited(force, STRONGEST_PUSH),
                firmness * limited(moment, STRONGEST_TWIST),
            ),
            ("link4", firmness * limited(second, STRONGEST_PUSH), np.zeros(3)),
        )

    def _follow(self, way, press=None, rest=0.3):
        """Lead the arm along a way, and rest at its end; the button is pressed at step `press`."""
        count = len(way.hand)
        for step in range(count + round(rest / PERIOD)):
            self.presses = step == press
            yield self._hold(way, min(step, count - 1), min(1.0, (step + 1) * PERIOD / 0.2)), None

    def cock(self, rim, duration=2.0):
        """Lead the arm to where a swing at a rim (3,) begins."""
        start = self._plant.link_angles
        azimuth, time = self.aim.at(rim)
        share = minimum_jerk(round(duration / PERIOD) + 1)[:, None]
        angles = start + share * (swing_angles(azimuth, time)[0] - start)
        yield from self._follow(Way.through(angles), rest=0.6)

    def throw(self, rim):
        """Swing at a rim (3,), let the ball go, and watch where it comes down."""
        azimuth, duration = self.aim.at(rim)
        longer = 1.0 + self._varies(0.04)
        duration *= 1.0 + self._varies(0.008)
        shift = np.array([self._varies(0.01) for _ in range(3)])
        way = Way.through(
            swing_angles(azimuth + self._varies(0.006), duration * longer, longer), shift
        )
        release = 0.5 * duration * longer - EXPECTED_DELAY + self._varies(0.005)
        self.landing = None
        last = self._plant.pose("ball")[0]
        press = round(release / PERIOD)
        for step, moment in enumerate(self._follow(way, press)):
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

    def wait(self, duration):
        """Do nothing for a while [s]."""
        for _ in range(round(duration / PERIOD)):
            yield (), None

    def bring_ball(self, duration=0.8):
        """Carry the ball into the open hand, along the palm's axis at last, and close the fingers."""
        hand = self._plant.hand
        hand.open(self._plant.time)
        yield from self.wait(0.15)
        start = self._plant.pose("ball")[0]
        share = minimum_jerk(round(duration / PERIOD))
        for part in np.clip(1.25 * share, 0.0, 1.0):
            yield (), start + part * (self._above(0.12) - start)
        for part in minimum_jerk(100):
            yield (), self._above(0.12 * (1.0 - part))
        hand.close()
        for _ in range(120):
            yield (), self._above(0.0)
        yield from self.wait(0.2)

    def _above(self, height):
        return self._plant.grasp() + height * self._plant.pose("hand")[1][:, 2]

    def in_basket(self, rim, radius=0.15):
        """Whether the ball lies in the basket whose rim is there (3,)."""
        place = self._plant.pose("ball")[0]
        return bool(np.hypot(*(place - rim)[:2]) < radius and place[2] < rim[2])
