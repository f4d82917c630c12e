"""The impedance law: joint torques that make the hand move as a unit mass on springs and dampers
would, thesis (7.19).

The attractor's force acts on the hand's acceleration; the arm's own inertia in task space shapes
it into a wrench, so that the law holds on the arm, not only on a point mass (Khatib, 1987).
Position and orientation have an attractor each (8.4).
"""

from dataclasses import dataclass

import numpy as np

from dart_skill.arm._drive import Drive, JointSpring, turn
from dart_skill.arm._model import ArmModel, HandState
from dart_skill.arm._range import LEAST_MOBILITY, LENGTHS, time_to_end

SLOW = 0.02
"""Joint speed from which the direction of the motion tells that of the friction [rad/s]."""
WEAK = 0.1
"""Torque from which the direction of the drive tells that of the friction, in parts of the Coulomb
friction.
"""
NO_FRICTION = 1e-9
"""Torque that tells the direction of the friction of a joint that has none [N m]."""
AT_REST = np.zeros(6)
"""Velocity of an attractor [m/s, rad/s]."""


@dataclass(frozen=True)
class Reference:
    """What the hand shall do at one instant, in the axes of the world.

    Parameters
    ----------
    attractor_position, attractor_rotation
        Where the attractor pulls to, (3,) [m] and (3, 3).
    position, rotation
        Where the hand is expected to be, (3,) [m] and (3, 3).
    velocity, acceleration
        Of that motion, (6,) each, linear and angular [m/s, rad/s; m/s^2, rad/s^2].
    """

    attractor_position: np.ndarray
    attractor_rotation: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


def rotation_error(target: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Rotation vector (3,) in world axes that turns `rotation` (3, 3) into `target` (3, 3) [rad]."""
    return turn(np.asarray(target, dtype=float), np.asarray(rotation, dtype=float))


@dataclass(frozen=True)
class PoseGains:
    """Spring and damper of the hand per unit mass: stiffness [1/s^2] and damping [1/s], linear
    over angular.

    Along the axes (6,) each, or as matrices (6, 6).
    """

    stiffness: np.ndarray
    damping: np.ndarray

    @classmethod
    def of(cls, position: tuple[float, float], orientation: tuple[float, float]) -> "PoseGains":
        """From (stiffness, damping) of the position and of the orientation."""
        return cls(*np.repeat(np.array([position, orientation], dtype=float), 3, axis=0).T.copy())


class Impedance:
    """Wrench and joint torques for a wanted acceleration of the hand, by the controller's model of
    the arm.

    Parameters
    ----------
    model
        Of the arm.
    friction_compensation
        Share of the identified joint friction that is fed forward.
    null_stiffness, null_damping
        Hold the posture in the arm's free motion [1/s^2], [1/s].
    least_mobility
        A direction in which the hand is harder to accelerate than this (a shoulder or a wrist that
        is straight: axes in line) is left to the posture gradually, the less mobile the more
        [1/kg].
    weak_drive
        Torque that tells in which direction the friction of a joint at rest acts, in parts of its
        Coulomb friction.
    """

    def __init__(
        self,
        model: ArmModel,
        friction_compensation: float = 0.8,
        null_stiffness: float = 60.0,
        null_damping: float = 12.0,
        least_mobility: float = LEAST_MOBILITY,
        weak_drive: float = WEAK,
    ):
        self.model = model
        coulomb, viscous = (
            model.description.of_joints("coulomb_friction"),
            model.description.of_joints("viscous_friction"),
        )
        share = friction_compensation if model.description.knows_friction else 0.0
        self._drive = Drive(
            LENGTHS, share * coulomb, share * viscous, np.maximum(weak_drive * coulomb, NO_FRICTION),
            SLOW, null_stiffness, null_damping, least_mobility,
        )  # fmt: skip

    def friction_torque(self, qd: np.ndarray, drive: np.ndarray | None = None) -> np.ndarray:
        """The share of joint friction that is compensated (n,) [N m]; smooth through zero speed.

        Where a joint stands still, the torque (n,) [N m] that drives it stands in for its speed:
        friction holds up just that. Without, the rolls of upper arm and forearm stick or slip with
        the distance of the basket, and the ball goes up to 2 cm to one side or the other.
        """
        return self._drive.friction(qd, np.zeros(len(qd)) if drive is None else drive)

    def pulled(
        self,
        q: np.ndarray,
        qd: np.ndarray,
        reference: Reference,
        gains: PoseGains,
        tracking: PoseGains | None,
    ) -> np.ndarray:
        """Acceleration (6,) that (7.19) asks of the hand in a state of the arm, as of
        `attractor_acceleration`.

        Parameters
        ----------
        reference
            What the hand shall do.
        gains
            Of the attractor.
        tracking
            Of a second pull, towards the motion that (7.19) predicts, or None.
        """
        terms, r, add = self.model.at(q, qd), reference, self._drive.add_pull
        if gains.stiffness.ndim == 2:
            acceleration = attractor_acceleration(reference, self.model.hand_state(q, qd), gains)
        else:
            acceleration = np.zeros(6)
            add(
                terms,
                r.attractor_position,
                r.attractor_rotation,
                AT_REST,
                gains.stiffness,
                gains.damping,
                acceleration,
            )
        if tracking is not None:
            add(
                terms,
                r.position,
                r.rotation,
                r.velocity,
                tracking.stiffness,
                tracking.damping,
                acceleration,
            )
        return acceleration

    def act(
        self, q: np.ndarray, qd: np.ndarray, acceleration: np.ndarray, posture: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Wrench (6,) and additional joint torque (n,) that accelerate the hand by `acceleration`
        (6,), posture (n,) in the null space.
        """
        return self._drive.act(self.model.at(q, qd), acceleration, posture)

    def moved(
        self, q: np.ndarray, qd: np.ndarray, acceleration: np.ndarray, posture: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Wrench and torque for a state of the model itself, and the joint acceleration (n,) that it then
        has. Friction is that of joints that move: a joint that shall rest is held by its own.

        Parameters
        ----------
        posture
            That the arm's free motion aims at (n,) [rad].
        """
        return self._drive.moved(self.model.at(q, qd), acceleration, posture)


def attractor_acceleration(reference: Reference, hand: HandState, gains: PoseGains) -> np.ndarray:
    """(7.19) for position and orientation: k (y - x) - d v, linear over angular (6,).

    Parameters
    ----------
    reference
        y.
    hand
        x and v.
    gains
        k and d.
    """
    way = reference.attractor_position - hand.position
    error = np.append(way, rotation_error(reference.attractor_rotation, hand.rotation))
    if gains.stiffness.ndim == 2:
        return gains.stiffness @ error - gains.damping @ hand.velocity
    return gains.stiffness * error - gains.damping * hand.velocity


class JointServo:
    """Joint-space spring-damper with the model's inertia fed forward: moves and holds the arm
    between throws.

    Attribute: gains, those of the arm's description.

    Parameters
    ----------
    impedance
        With the model of the arm.
    """

    TAKES_OUT = 0.5
    """Rate at which what is left of the distance to a careful motion is taken out [1/s]. The
    modulus margin is 0.21 with it; at 3 1/s nothing would be left of it.
    """
    SHARE = 0.4
    """Share of the torque limits that this uses at most."""
    BRAKING_TIME = 0.12
    """In which a braked arm loses 1 - 1/e of its speed, if the torques allow it [s]."""

    def __init__(self, impedance: Impedance):
        self._impedance = impedance
        description = impedance.model.description
        self.gains = g = description.servo
        self._ends = description.ends
        self._holding = JointSpring(g.stiffness, g.damping, g.limit)
        self._following = JointSpring(g.following_stiffness, g.following_damping, g.limit)
        self._at_rest = g.ahead * g.damping + g.ahead**2 * g.stiffness
        self._along = g.ahead * g.following_damping + g.ahead**2 * g.following_stiffness
        self._stopping = 2.0 * g.ahead * g.damping

    def torque(
        self,
        q: np.ndarray,
        qd: np.ndarray,
        q_wanted: np.ndarray,
        qd_wanted: np.ndarray,
        qdd_wanted: np.ndarray,
    ) -> np.ndarray:
        """Joint torque (n,) [N m] towards a wanted joint motion, gravity excluded."""
        torque = self._steady(q, self._holding.torque(q, qd, q_wanted, qd_wanted), self._at_rest)
        if any(qd_wanted.tolist()):
            torque += self._impedance.friction_torque(qd_wanted)
        if any(qdd_wanted.tolist()):
            torque += self._impedance.model.at(q, qd).inertial_torque(qdd_wanted)
        return torque

    def hold(self, q: np.ndarray, qd: np.ndarray, posture: np.ndarray) -> np.ndarray:
        """Joint torque (n,) [N m] towards a posture at rest, gravity excluded."""
        torque = self._holding.torque(q, qd, posture, np.zeros(len(q)))
        return self._steady(q, torque, self._at_rest)

    def follow(
        self, q: np.ndarray, qd: np.ndarray, q_expected: np.ndarray, qd_expected: np.ndarray
    ) -> np.ndarray:
        """Joint torque (n,) [N m] towards an expected motion whose torques are fed forward."""
        torque = self._following.torque(q, qd, q_expected, qd_expected)
        return self._steady(q, torque, self._along)

    def take_out(
        self, torque: np.ndarray, q: np.ndarray, q_expected: np.ndarray, step: float
    ) -> np.ndarray:
        """Torque (n,) [N m] a step [s] later that takes out what is left of the distance: what
        soft joints leave of errors of gravity and friction. Only for careful motions: in the half
        second of a throw it would not help, and it would push against a person.
        """
        stiffness, most = self.gains.following_stiffness, self.SHARE * self.gains.limit
        more = torque + self.TAKES_OUT * step * stiffness * (q_expected - q)
        return np.minimum(np.maximum(more, -most), most)

    def damp(self, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        """Torque (n,) [N m] that brings an arm to a damped stop; the arm must report its speeds
        without delay.
        """
        return self._steady(q, self._holding.damp(qd), self._stopping)

    def brake(
        self, q: np.ndarray, qd: np.ndarray, start: np.ndarray, speed: np.ndarray, time: float
    ) -> np.ndarray:
        """Torque (n,) [N m] that brings an arm that was at `start` with `speed` (n,) `time` [s]
        ago to rest: speeds die away together.

        The torque is fed forward, so that no large gain acts on speeds that are measured late. A
        joint that would run into the end of its range comes to rest sooner than the others.
        """
        terms, most = self._impedance.model.at(q, qd), 2.0 * self.gains.limit
        together = max(
            self.BRAKING_TIME, float((np.abs(terms.inertial_torque(speed)) / most).max())
        )
        lasts = np.minimum(together, time_to_end(start, speed, self._ends))
        left = np.exp(-time / lasts)
        pull = self._following.torque(q, qd, start + lasts * (1.0 - left) * speed, left * speed)
        torque = pull - terms.inertial_torque(left / lasts * speed)
        return self._steady(q, np.clip(torque, -most, most), self._along)

    def _steady(self, q: np.ndarray, torque: np.ndarray, grows: np.ndarray) -> np.ndarray:
        """Torque (n,) of springs and dampers as they would be `ahead` later: without it joints that
        have little inertia would swing up between two control periods.

        Parameters
        ----------
        grows
            By how much the torque grows ahead for an acceleration (n,) [kg m^2].
        """
        if not self.gains.ahead:
            return torque
        inertia = self._impedance.model.mass_matrix(q)
        return inertia @ np.linalg.solve(inertia + np.diag(grows), torque)


def minimum_jerk(
    start: np.ndarray, end: np.ndarray, duration: float, time: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration of the rest-to-rest motion of least jerk from start to
    end (n,) at `time` [s].

    Parameters
    ----------
    duration
        Of the whole motion [s].
    """
    way, s = end - start, min(max(time / duration, 0.0), 1.0)
    share = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
    rate = 30.0 * (s * (1.0 - s)) ** 2 / duration
    change = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / duration**2
    return start + share * way, rate * way, change * way
