"""What the WAM's motors and cables do to a commanded joint torque: peak torque, the motors' torque-speed line, joint friction.

Products of matrices this small are written as a.dot(b), which takes half the time of a @ b: they are made at every step of the arm.
"""

import numpy as np
import scipy

from dart_skill.constants import N_JOINTS
from dart_skill.robot._description import WamDescription

STICTION_SPEED = 1e-3
"""Joint speed [rad/s] below which Coulomb friction falls linearly to zero: a stuck joint creeps at most this fast."""
STRIBECK_SPEED = 0.05
"""Joint speed [rad/s] at which static friction has fallen to Coulomb friction by 1 - 1/e: chosen, docs/sources.md."""


class Actuation:
    """Torque limits and friction of the seven joints.

    The speed limit of a joint is that of its motors: the torque that is left falls linearly to zero at the no-load speed and
    turns into braking beyond it. J2 and J3, and J5 and J6, share two motors each, so their limits depend on both speeds.

    * description: of the arm.
    * friction_scale, motor_scale: factors on the joint friction, and on what the motors can do.
    * stiction: what static friction is more than Coulomb friction, as a share of it; it falls with the speed (Stribeck).
    """

    def __init__(self, description: WamDescription, friction_scale: float = 1.0, motor_scale: float = 1.0, stiction: float = 0.0):
        motors = description.motors
        self._to_motor = motors.joint_to_motor
        self._from_joint_torque = np.linalg.inv(motors.joint_to_motor.T)
        self._stall = motor_scale * motors.stall_torque
        self._slope = self._stall / motors.no_load_speed
        self._peak = motor_scale * description.of_joints("peak_torque")
        self._least, self._backwards = -self._peak, -self._stall
        self.coulomb = friction_scale * description.of_joints("coulomb_friction")
        self.viscous = friction_scale * description.of_joints("viscous_friction")
        self._stiction = stiction

    def deliverable(self, torque: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """The torque (7,) that reaches the joints when `torque` is asked for at joint velocity (7,) [N m]."""
        motor = self._from_joint_torque.dot(np.minimum(np.maximum(torque, self._least), self._peak))
        back_emf = self._slope * self._to_motor.dot(velocity)
        return self._to_motor.T.dot(np.minimum(np.maximum(motor, self._backwards - back_emf), self._stall - back_emf))

    def braking(self, velocity: np.ndarray) -> np.ndarray:
        """Torque (7,) of the motors when they are shorted, against joint velocity (7,) [N m]."""
        return -self._to_motor.T @ (self._slope * (self._to_motor @ velocity))

    def damping(self, velocity: np.ndarray) -> np.ndarray:
        """Joint friction at joint velocity (7,) as the damping (7,) [N m s/rad] that has its value there."""
        speed = np.abs(velocity)
        dry = self.coulomb
        if self._stiction:
            dry = dry * (1.0 + self._stiction * np.exp(-np.square(speed / STRIBECK_SPEED)))
        return self.viscous + dry / np.maximum(speed, STICTION_SPEED)

    def acceleration(self, inertia: np.ndarray, torque: np.ndarray, velocity: np.ndarray, step: float) -> np.ndarray:
        """Joint acceleration (7,) over one step with friction, which never turns a motion round.

        inertia (7, 7), torque (7,) net of gravity and Coriolis terms. Coulomb friction enters as the damping that has its
        value at the speed reached, c / max(|v|, STICTION_SPEED): implicit Euler, one fixed-point correction.
        """
        momentum = inertia.dot(velocity) + step * torque
        reached = velocity
        for _ in range(2):
            damping = self.damping(reached)
            damped = inertia.copy()
            damped.ravel()[:: N_JOINTS + 1] += step * damping  # the diagonal
            reached = scipy.linalg.lapack.dposv(damped, momentum)[1]  # symmetric and positive definite
        return (reached - velocity) / step
