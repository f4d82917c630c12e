"""The impedance law: joint torques that make the hand move as a unit mass on springs and dampers would, thesis (7.19).

The attractor's force acts on the hand's acceleration; the arm's own inertia in task space shapes it into a wrench, so that the law
holds on the arm, not only on a point mass (Khatib, 1987). Position and orientation have an attractor each (8.4).
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from dart_skill.robot._model import ArmModel, HandState

LENGTHS = np.array([1.0, 1.0, 1.0, 0.18, 0.18, 0.18])
"""Metres that a metre, or a radian, of the hand's motion counts for when directions are compared: 0.18 m from the wrist to the ball."""
SLOW, WEAK = 0.02, 0.1
"""Speed of a joint [rad/s], and torque that drives it in parts of its Coulomb friction, that tell in which direction friction acts."""


@dataclass(frozen=True)
class Reference:
    """What the hand shall do at one instant, in the axes of the world.

    * attractor_position, attractor_rotation: where the attractor pulls to, (3,) [m] and (3, 3).
    * position, rotation: where the hand is expected to be, (3,) [m] and (3, 3).
    * velocity, acceleration: of that motion, (6,) each, linear and angular [m/s, rad/s; m/s^2, rad/s^2].
    """

    attractor_position: np.ndarray
    attractor_rotation: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


def rotation_error(target: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Rotation vector (3,) in world axes that turns `rotation` (3, 3) into `target` (3, 3) [rad]."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (target @ rotation.T).tolist()
    x, y, z = 0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy)
    sine, cosine = math.sqrt(x * x + y * y + z * z), 0.5 * (xx + yy + zz - 1.0)
    if sine < 1e-9 and cosine < 0.0:  # half a turn: its axis is an eigenvector, either way round
        column = np.array([[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]]) + np.eye(3)
        axis = column[:, np.argmax(np.diag(column))]
        return math.pi * axis / math.sqrt(axis @ axis)
    scale = 1.0 if sine < 1e-9 else math.atan2(sine, cosine) / sine
    return np.array([scale * x, scale * y, scale * z])


def pose_error(position: np.ndarray, rotation: np.ndarray, hand: HandState) -> np.ndarray:
    """What the hand lacks to a pose (6,): way [m] over rotation vector [rad], world axes."""
    return np.concatenate([position - hand.position, rotation_error(rotation, hand.rotation)])


@dataclass(frozen=True)
class PoseGains:
    """Spring and damper of the hand per unit mass: stiffness [1/s^2] and damping [1/s], linear over angular.

    Along the axes (6,) each, or as matrices (6, 6).
    """

    stiffness: np.ndarray
    damping: np.ndarray

    @classmethod
    def of(cls, position: tuple[float, float], orientation: tuple[float, float]) -> "PoseGains":
        """From (stiffness, damping) of the position and of the orientation."""
        return cls(*np.repeat([position, orientation], 3, axis=0).T)


class Impedance:
    """Wrench and joint torques for a wanted acceleration of the hand, by the controller's model of the arm.

    * model: of the arm.
    * friction_compensation: share of the identified joint friction that is fed forward.
    * null_stiffness, null_damping: hold the posture in the arm's free motion [1/s^2], [1/s].
    * least_mobility: a direction in which the hand is harder to accelerate than this (a shoulder or a wrist that is straight: axes in line)
      is left to the posture gradually, the less mobile the more [1/kg].
    """

    def __init__(
        self,
        model: ArmModel,
        friction_compensation: float = 0.8,
        null_stiffness: float = 60.0,
        null_damping: float = 12.0,
        least_mobility: float = 0.08,
    ):
        self.model = model
        self._coulomb = friction_compensation * model.description.of_joints("coulomb_friction")
        self._viscous = friction_compensation * model.description.of_joints("viscous_friction")
        self._weak_drive = WEAK * model.description.of_joints("coulomb_friction")
        self._null_stiffness = null_stiffness
        self._null_damping = null_damping
        self._least_mobility = least_mobility

    def friction_torque(self, qd: np.ndarray, drive: np.ndarray | float = 0.0) -> np.ndarray:
        """The share of joint friction that is compensated (7,) [N m]; smooth through zero speed.

        Where a joint stands still, the torque (7,) [N m] that drives it stands in for its speed: friction holds up just that. Without, the
        rolls of upper arm and forearm stick or slip with the distance of the basket, and the ball goes up to 2 cm to one side or the other.
        """
        return self._coulomb * np.tanh(qd / SLOW + drive / self._weak_drive) + self._viscous * qd

    def act(self, q: np.ndarray, qd: np.ndarray, acceleration: np.ndarray, posture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Wrench (6,) and additional joint torque (7,) that accelerate the hand by `acceleration` (6,), posture (7,) in the null space."""
        drive = self._drive(q, qd, acceleration, posture)
        friction = self.friction_torque(qd, drive.total)
        return drive.wrench, self.model.coriolis_torque(q, qd) + friction + drive.null_torque

    def moved(
        self, q: np.ndarray, qd: np.ndarray, acceleration: np.ndarray, posture: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The same for a state of the model itself, and the joint acceleration (7,) that it then has. Friction is that of joints that move:
        a joint that shall rest is held by its own. posture: that the arm's free motion aims at (7,) [rad].
        """
        drive = self._drive(q, qd, acceleration, posture)
        torque = self.model.coriolis_torque(q, qd) + self.friction_torque(qd) + drive.null_torque
        return drive.wrench, torque, scipy.linalg.lapack.dposv(drive.inertia, drive.total)[1]

    def _drive(self, q: np.ndarray, qd: np.ndarray, acceleration: np.ndarray, posture: np.ndarray) -> "_Drive":
        jacobian, inertia = self.model.jacobian(q), self.model.mass_matrix(q)
        scaled = LENGTHS[:, None] * jacobian
        lapack = scipy.linalg.lapack
        mobility, directions, _ = lapack.dsyev(scaled.dot(lapack.dposv(inertia, scaled.T)[1]))
        free = self._null_stiffness * (posture - q) - self._null_damping * qd
        # One factorisation for both: the wrench, and the part of the free motion that would move the hand.
        wanted = LENGTHS * np.array([acceleration - self.model.jacobian_drift(q, qd), jacobian.dot(free)])
        share = np.minimum(mobility / self._least_mobility, 1.0) ** 2
        wrench, disturbing = LENGTHS * (wanted.dot(directions) * (share / mobility)).dot(directions.T)
        null_torque = inertia.dot(free) - jacobian.T.dot(disturbing)
        return _Drive(wrench, null_torque, jacobian.T.dot(wrench) + null_torque, inertia)


class _Drive(NamedTuple):
    """What accelerates the arm: wrench at the hand (6,), torques in the null space (7,), both as joint torques (7,), inertia (7, 7)."""

    wrench: np.ndarray
    null_torque: np.ndarray
    total: np.ndarray
    inertia: np.ndarray


def attractor_acceleration(reference: Reference, hand: HandState, gains: PoseGains) -> np.ndarray:
    """(7.19) for position and orientation: k (y - x) - d v, linear over angular (6,). reference: y; hand: x and v; gains: k and d."""
    error = pose_error(reference.attractor_position, reference.attractor_rotation, hand)
    if gains.stiffness.ndim == 2:
        return gains.stiffness @ error - gains.damping @ hand.velocity
    return gains.stiffness * error - gains.damping * hand.velocity


def tracking_acceleration(reference: Reference, hand: HandState, gains: PoseGains) -> np.ndarray:
    """A second pull, towards the motion that (7.19) predicts: zero as long as the arm does what was predicted (6,)."""
    error = pose_error(reference.position, reference.rotation, hand)
    return gains.stiffness * error + gains.damping * (reference.velocity - hand.velocity)


class JointServo:
    """Joint-space spring-damper with the model's inertia fed forward: moves and holds the arm between throws.

    PoseGains and torque limits are those of Barrett's own position controller (libbarrett, wam7w.conf; docs/sources.md).
    """

    STIFFNESS = np.array([900.0, 2500.0, 600.0, 500.0, 50.0, 50.0, 8.0])
    DAMPING = np.array([10.0, 20.0, 5.0, 2.0, 0.5, 0.5, 0.05])
    LIMIT = np.array([25.0, 20.0, 15.0, 15.0, 5.0, 5.0, 5.0])
    LEAST = -LIMIT
    FOLLOWING = PoseGains(np.array([360.0, 250.0, 120.0, 50.0, 7.5, 10.0, 1.6]), np.array([10.0, 10.0, 3.5, 2.0, 0.25, 0.35, 0.05]))
    """Of a motion that is fed forward [N m/rad], [N m s/rad]: parts of the vendor's gains that leave a modulus margin of 0.25 with cables
    of half the stiffness of config/fleet.yaml, speeds behind a low-pass of 180 rad/s and a delay of a period: docs/fleet.md.
    """
    TAKES_OUT, SHARE = 0.5, 0.4
    """What is left of the distance to a careful motion is taken out at this rate [1/s], with this share of the limits at most. The modulus
    margin is 0.21 with it; at 3 1/s nothing would be left of it.
    """
    BRAKING_TIME = 0.12
    """In which a braked arm loses 1 - 1/e of its speed, if the torques allow it [s]."""

    def __init__(self, impedance: Impedance):
        self._impedance = impedance

    def torque(self, q: np.ndarray, qd: np.ndarray, q_wanted: np.ndarray, qd_wanted: np.ndarray, qdd_wanted: np.ndarray) -> np.ndarray:
        """Joint torque (7,) [N m] towards a wanted joint motion, gravity excluded."""
        feedback = self.STIFFNESS * (q_wanted - q) + self.DAMPING * (qd_wanted - qd)
        torque = np.minimum(np.maximum(feedback, self.LEAST), self.LIMIT)
        if any(qd_wanted.tolist()):
            torque += self._impedance.friction_torque(qd_wanted)
        return torque + self._impedance.model.mass_matrix(q) @ qdd_wanted if any(qdd_wanted.tolist()) else torque

    def follow(self, q: np.ndarray, qd: np.ndarray, q_expected: np.ndarray, qd_expected: np.ndarray) -> np.ndarray:
        """Joint torque (7,) [N m] towards an expected motion whose torques are fed forward."""
        feedback = self.FOLLOWING.stiffness * (q_expected - q) + self.FOLLOWING.damping * (qd_expected - qd)
        return np.minimum(np.maximum(feedback, self.LEAST), self.LIMIT)

    def take_out(self, torque: np.ndarray, q: np.ndarray, q_expected: np.ndarray, step: float) -> np.ndarray:
        """Torque (7,) [N m] a step [s] later that takes out what is left of the distance: what soft joints leave of errors of gravity and
        friction. Only for careful motions: in the half second of a throw it would not help, and it would push against a person.
        """
        more = torque + self.TAKES_OUT * step * self.FOLLOWING.stiffness * (q_expected - q)
        return np.minimum(np.maximum(more, -self.SHARE * self.LIMIT), self.SHARE * self.LIMIT)

    def damp(self, qd: np.ndarray) -> np.ndarray:
        """Torque (7,) [N m] that brings an arm to a damped stop; the arm must report its speeds without delay."""
        return np.clip(-2.0 * self.DAMPING * qd, -2.0 * self.LIMIT, 2.0 * self.LIMIT)

    def brake(self, q: np.ndarray, qd: np.ndarray, start: np.ndarray, speed: np.ndarray, time: float) -> np.ndarray:
        """Torque (7,) [N m] that brings an arm that was at `start` with `speed` (7,) `time` [s] ago to rest: speeds die away together.

        The torque is fed forward, so that no large gain acts on speeds that are measured late.
        """
        strongest = 2.0 * self.LIMIT
        needed = self._impedance.model.mass_matrix(q) @ speed
        longest = max(self.BRAKING_TIME, float(np.max(np.abs(needed) / strongest)))
        left = math.exp(-time / longest)
        expected = start + longest * (1.0 - left) * speed
        torque = -needed * left / longest + self.follow(q, qd, expected, left * speed)
        return np.minimum(np.maximum(torque, -strongest), strongest)


def minimum_jerk(start: np.ndarray, end: np.ndarray, duration: float, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration of the rest-to-rest motion of least jerk from start to end (n,) at `time` [s].

    duration: of the whole motion [s].
    """
    s = min(max(time / duration, 0.0), 1.0)
    way = end - start
    position = start + way * (10 - 15 * s + 6 * s * s) * s**3
    velocity = way * (30 * s**2 * (1 - s) ** 2) / duration
    acceleration = way * (60 * s * (1 - s) * (1 - 2 * s)) / duration**2
    return position, velocity, acceleration
