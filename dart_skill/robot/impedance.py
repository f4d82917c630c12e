"""The impedance law: joint torques that make the hand move as a unit mass on springs and dampers would, thesis (7.19).

The attractor's force acts on the hand's acceleration; the arm's own inertia in task space shapes it into a wrench, so that the law
holds on the arm, not only on a point mass (Khatib, 1987). Position and orientation have an attractor each (8.4).
"""

from dataclasses import dataclass

import numpy as np

from dart_skill.robot.model import ArmModel, HandState


@dataclass(frozen=True)
class Reference:
    """What the hand shall do at one instant, world axes.

    attractor: position (3,) and rotation (3, 3) that pull; position, rotation, velocity (6,): the motion that is expected of the
    pull; acceleration (6,) of that motion.
    """

    attractor_position: np.ndarray
    attractor_rotation: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


def rotation_error(target: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Rotation vector (3,) in world axes that turns `rotation` (3, 3) into `target` (3, 3) [rad]."""
    turn = target @ rotation.T
    axis = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine, cosine = float(np.sqrt(axis @ axis)), 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0)
    if sine < 1e-9:
        return axis
    return axis * (np.arctan2(sine, cosine) / sine)


class Impedance:
    """Wrench and joint torques for a wanted acceleration of the hand, by the controller's model of the arm.

    friction_compensation is the share of the identified joint friction that is fed forward; null_stiffness and null_damping
    [1/s^2, 1/s] hold the posture in the arm's free motion; conditioning is the damping of the task-space inverse [kg^-1] that keeps
    the wrench bounded where the arm is stretched.
    """

    def __init__(
        self,
        model: ArmModel,
        friction_compensation: float = 0.8,
        null_stiffness: float = 60.0,
        null_damping: float = 12.0,
        conditioning: float = 3e-3,
    ):
        self.model = model
        self._coulomb = friction_compensation * model.description.of_joints("coulomb_friction")
        self._viscous = friction_compensation * model.description.of_joints("viscous_friction")
        self._null_stiffness = null_stiffness
        self._null_damping = null_damping
        self._conditioning = conditioning * np.diag([1.0, 1.0, 1.0, 30.0, 30.0, 30.0])

    def friction_torque(self, qd: np.ndarray) -> np.ndarray:
        """The share of joint friction that is compensated (7,) [N m]; smooth through zero speed."""
        return self._coulomb * np.tanh(qd / 0.02) + self._viscous * qd

    def act(self, q: np.ndarray, qd: np.ndarray, acceleration: np.ndarray, posture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Wrench (6,) and additional joint torque (7,) that accelerate the hand by `acceleration` (6,), posture (7,) in the null space."""
        jacobian = self.model.jacobian(q)
        inertia = self.model.mass_matrix(q)
        mobility = np.linalg.solve(inertia, jacobian.T)
        task = acceleration - self.model.jacobian_drift(q, qd)
        wrench = np.linalg.solve(jacobian @ mobility + self._conditioning, task)
        free = inertia @ (self._null_stiffness * (posture - q) - self._null_damping * qd)
        free -= jacobian.T @ np.linalg.solve(jacobian @ mobility + self._conditioning, mobility.T @ free)
        return wrench, self.model.coriolis_torque(q, qd) + self.friction_torque(qd) + free


def attractor_acceleration(
    reference: Reference, hand: HandState, position_gains: tuple[float, float], orientation_gains: tuple[float, float]
) -> np.ndarray:
    """(7.19) for position and orientation: k (y - x) - d v, linear over angular (6,)."""
    (kp, dp), (ko, do) = position_gains, orientation_gains
    linear = kp * (reference.attractor_position - hand.position) - dp * hand.linear
    angular = ko * rotation_error(reference.attractor_rotation, hand.rotation) - do * hand.angular
    return np.concatenate([linear, angular])


def tracking_acceleration(
    reference: Reference, hand: HandState, position_gains: tuple[float, float], orientation_gains: tuple[float, float]
) -> np.ndarray:
    """A second pull, towards the motion that (7.19) predicts: zero as long as the arm does what was predicted (6,)."""
    (kp, dp), (ko, do) = position_gains, orientation_gains
    linear = kp * (reference.position - hand.position) + dp * (reference.velocity[:3] - hand.linear)
    angular = ko * rotation_error(reference.rotation, hand.rotation) + do * (reference.velocity[3:] - hand.angular)
    return np.concatenate([linear, angular])


class JointServo:
    """Joint-space spring-damper with the model's inertia fed forward: moves and holds the arm between throws.

    Gains and torque limits are those of Barrett's own position controller (wam_facts, section 3).
    """

    STIFFNESS = np.array([900.0, 2500.0, 600.0, 500.0, 50.0, 50.0, 8.0])
    DAMPING = np.array([10.0, 20.0, 5.0, 2.0, 0.5, 0.5, 0.05])
    LIMIT = np.array([25.0, 20.0, 15.0, 15.0, 5.0, 5.0, 5.0])

    def __init__(self, impedance: Impedance):
        self._impedance = impedance

    def torque(self, q, qd, q_wanted, qd_wanted, qdd_wanted) -> np.ndarray:
        """Joint torque (7,) [N m] towards a wanted joint motion, gravity excluded."""
        feedback = self.STIFFNESS * (q_wanted - q) + self.DAMPING * (qd_wanted - qd)
        feed_forward = self._impedance.model.mass_matrix(q) @ qdd_wanted + self._impedance.friction_torque(qd_wanted)
        return np.clip(feedback, -self.LIMIT, self.LIMIT) + feed_forward

    def damp(self, qd: np.ndarray) -> np.ndarray:
        """Torque (7,) that brings the arm to a damped stop [N m]."""
        return np.clip(-2.0 * self.DAMPING * qd, -2.0 * self.LIMIT, 2.0 * self.LIMIT)


def minimum_jerk(start: np.ndarray, end: np.ndarray, duration: float, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration of the rest-to-rest motion of least jerk from start to end (n,) at `time` [s]."""
    s = min(max(time / duration, 0.0), 1.0)
    way = end - start
    position = start + way * (10 - 15 * s + 6 * s * s) * s**3
    velocity = way * (30 * s**2 * (1 - s) ** 2) / duration
    acceleration = way * (60 * s * (1 - s) * (1 - 2 * s)) / duration**2
    return position, velocity, acceleration
