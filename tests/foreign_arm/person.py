"""A person who guides the arm by hand and elbow, tells the hand to open or to close with a button,
and carries things.
"""

from dataclasses import dataclass

import numpy as np

from tests.foreign_arm import published
from tests.foreign_arm.arm import PERIOD, SHOULDER

HAND_GRASP = (4000.0, 250.0)  # stiffness and damping of the hold at the hand [N/m, N s/m]
HAND_TWIST = (30.0, 0.6)  # the same for turning [N m/rad, N m s/rad]
ELBOW_GRASP = (1500.0, 60.0)
STRONGEST_PUSH, STRONGEST_TWIST = 150.0, 12.0  # [N, N m]
# standard deviation of a force [N] and its corner frequency [rad/s]
TREMBLE, TREMBLE_RATE = (
    0.5,
    60.0,
)
TAKING_HOLD = 0.2  # until a hold is firm [s]
MOST_LEFT = np.repeat([0.02, 0.3], 3)
"""What is left of a way to go is taken out as if it were no larger [m], [rad]."""


def eased(share):
    """Minimum jerk from 0 to 1, for shares of the time (n,); before it begins 0, at its end 1."""
    share = np.clip(share, 0.0, 1.0)
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def minimum_jerk(count):
    """Share of the way (count,) from 0 to 1 of a movement with the least jerk."""
    return eased(np.linspace(0.0, 1.0, count))


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
    def along(cls, hand, attitude, elbow):
        """Of places (n, 3), attitudes (n, 3, 3) and elbows (n, 3); n is at least 2."""
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

    @classmethod
    def through(cls, angles, shift=(0.0, 0.0, 0.0)):
        """Of joint angles (n, 7), shifted as a whole (3,)."""
        rotations, origins = published.frames(angles)
        origins = origins + SHOULDER + shift
        return cls.along(origins[:, 7], rotations[:, 7], origins[:, 3])


class Person:
    """Does one thing at a time: `act` gives the pushes on the arm, and the pose to which the loose
    body is carried, for the next step.

    Attribute: tells, what the hand is told in this step, "open", "close" or nothing.

    Parameters
    ----------
    laboratory, plant
        Where the person works.
    follows
        How fast what is left of the way to go is taken out, because it is seen [1/s].
    """

    def __init__(self, laboratory, plant, follows=0.0):
        self._laboratory, self._plant, self._follows = laboratory, plant, follows
        self._random = np.random.default_rng([laboratory.seed, 74])
        self._tremble, self._left, self._held = np.zeros(3), np.zeros(6), 0
        self._task = iter(())
        self.busy = False
        self.tells = ""

    def begin(self, *tasks):
        """Do these one after the other."""
        self.busy, self._task = True, (moment for task in tasks for moment in task)

    def act(self):
        """Pushes on the plant and the carried body's pose, for one step."""
        self.tells = ""
        moment = next(self._task, None)
        self.busy = moment is not None
        pushes, carried = moment if self.busy else ((), None)
        if pushes:
            self._held += 1
        else:
            self._held, self._left = 0, np.zeros(6)
        return pushes, carried

    def varies(self, spread):
        """A number by which people vary: normal with a standard deviation, within 2.5 of it."""
        return self._laboratory.human * spread * np.clip(self._random.standard_normal(), -2.5, 2.5)

    def _off(self, way, step):
        """How far the hand is from the way (6,), and what is left of that is taken out."""
        place, rotation = self._plant.pose("hand")
        turn = rotation_vector(way.attitude[step] @ rotation.T)
        off = np.concatenate([way.hand[step] - place, turn])
        if self._follows:
            left = self._left + self._follows * PERIOD * off
            self._left = np.clip(left, -MOST_LEFT, MOST_LEFT)
        return off + self._left

    def _shake(self):
        """The force of a hand that trembles (3,)."""
        keep = np.exp(-TREMBLE_RATE * PERIOD)
        self._tremble = keep * self._tremble + np.sqrt(
            1.0 - keep**2
        ) * TREMBLE * self._laboratory.human * self._random.standard_normal(3)
        return self._tremble

    def hold(self, way, step):
        """Both hands on the arm at a step of the way: pushes for the plant."""
        firmness = min(1.0, (self._held + 1) * PERIOD / TAKING_HOLD)
        velocity, spin = self._plant.velocity("hand")
        off = self._off(way, step)
        force = (
            HAND_GRASP[0] * off[:3]
            + HAND_GRASP[1] * (way.hand_velocity[step] - velocity)
            + self._shake()
        )
        moment = HAND_TWIST[0] * off[3:] + HAND_TWIST[1] * (way.spin[step] - spin)
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

    def follow(self, way, tells=None, rest=0.3):
        """Lead the arm along a way, and rest at its end; tells: what the hand is told at steps."""
        count = len(way.hand)
        for step in range(count + round(rest / PERIOD)):
            self.tells = (tells or {}).get(step, "")
            yield self.hold(way, min(step, count - 1)), None

    def wait(self, duration):
        """Do nothing for a while [s]."""
        for _ in range(round(duration / PERIOD)):
            yield (), None
