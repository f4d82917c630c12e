"""What the motors and the transmission of an arm do to a commanded joint torque: peak torque, the motors'
torque-speed line, joint friction.

It is asked at every step of the arm. So it is compiled (docs/development.md): _actuation.pxd
beside it has the types.
"""

import math

import numpy as np

from dart_skill.arm._description import ArmDescription
from dart_skill.common.small_matrices import factor_into, solve_into

STICTION_SPEED = 1e-3
"""Joint speed [rad/s] below which Coulomb friction falls linearly to zero: a stuck joint creeps at
most this fast.
"""
STRIBECK_SPEED = 0.05
"""Joint speed [rad/s] at which static friction has fallen to Coulomb friction by 1 - 1/e: chosen,
docs/sources.md.
"""


class Actuation:
    """Torque limits and friction of the joints.

    The speed limit of a joint is that of its motors: the torque that is left falls linearly to
    zero at the no-load speed and turns into braking beyond it. J2 and J3 of the WAM, and its J5 and
    J6, share two motors each, so their limits depend on both speeds.

    Parameters
    ----------
    description
        Of the arm.
    friction_scale, motor_scale
        Factors on the joint friction, and on what the motors can do.
    stiction
        What static friction is more than Coulomb friction, as a share of it; it falls with the
        speed (Stribeck).
    """

    def __init__(
        self,
        description: ArmDescription,
        friction_scale: float = 1.0,
        motor_scale: float = 1.0,
        stiction: float = 0.0,
    ):
        motors, n = description.motors, description.n_joints
        self._n = n
        self._to_motor = np.array(motors.joint_to_motor, dtype=float)
        self._from_joint_torque = np.linalg.inv(self._to_motor.T)
        self._stall = motor_scale * motors.stall_torque
        self._slope = motor_scale * motors.stall_torque / motors.no_load_speed
        self._peak = motor_scale * description.of_joints("peak_torque")
        self.coulomb = friction_scale * description.of_joints("coulomb_friction")
        self.viscous = friction_scale * description.of_joints("viscous_friction")
        self._dry, self._wet = self.coulomb, self.viscous
        self._stiction = stiction
        self._motor, self._momentum, self._system = (
            np.zeros(n),
            np.zeros(n),
            np.zeros((n, n)),
        )

    def deliverable(self, torque: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """The torque (n,) that reaches the joints when `torque` is asked for at joint velocity
        (n,) [N m].
        """
        for i in range(self._n):
            asked = back_emf = 0.0
            for j in range(self._n):
                asked += self._from_joint_torque[i, j] * min(
                    max(torque[j], -self._peak[j]), self._peak[j]
                )
                back_emf += self._to_motor[i, j] * velocity[j]
            back_emf *= self._slope[i]
            self._motor[i] = min(max(asked, -self._stall[i] - back_emf), self._stall[i] - back_emf)
        return self._at_joints()

    def braking(self, velocity: np.ndarray) -> np.ndarray:
        """Torque (n,) of the motors when they are shorted, against joint velocity (n,) [N m]."""
        for i in range(self._n):
            speed = 0.0
            for j in range(self._n):
                speed += self._to_motor[i, j] * velocity[j]
            self._motor[i] = -self._slope[i] * speed
        return self._at_joints()

    def _at_joints(self) -> np.ndarray:
        """The motors' torques as those of the joints (n,) [N m]."""
        result = np.empty(self._n)
        torque = result
        for j in range(self._n):
            total = 0.0
            for i in range(self._n):
                total += self._to_motor[i, j] * self._motor[i]
            torque[j] = total
        return result

    def damping(self, velocity: np.ndarray) -> np.ndarray:
        """Joint friction at joint velocity (n,) as the damping (n,) [N m s/rad] that has its value
        there.
        """
        result = np.empty(self._n)
        damping = result
        for j in range(self._n):
            damping[j] = self._damping(j, velocity[j])
        return result

    def _damping(self, joint: int, velocity: float) -> float:
        speed, dry = abs(velocity), self._dry[joint]
        if self._stiction:
            dry *= 1.0 + self._stiction * math.exp(-((speed / STRIBECK_SPEED) ** 2))
        return self._wet[joint] + dry / max(speed, STICTION_SPEED)

    def acceleration(
        self, inertia: np.ndarray, torque: np.ndarray, velocity: np.ndarray, step: float
    ) -> np.ndarray:
        """Joint acceleration (n,) over one step with friction, which never turns a motion round.

        Parameters
        ----------
        inertia : (n, n)
        torque : (n,)
            Net of gravity and Coriolis terms. Coulomb friction enters as the damping that has its
            value at the speed reached, c / max(|v|, STICTION_SPEED): implicit Euler, one
            fixed-point correction.
        """
        result = np.empty(self._n)
        reached, system, momentum = result, self._system, self._momentum
        for i in range(self._n):
            total = 0.0
            for j in range(self._n):
                total += inertia[i, j] * velocity[j]
            momentum[i] = total + step * torque[i]
            reached[i] = velocity[i]
        for _ in range(2):
            for i in range(self._n):
                for j in range(i):
                    system[i, j] = inertia[i, j]
                system[i, i] = inertia[i, i] + step * self._damping(i, reached[i])
            factor_into(system, system)
            solve_into(system, momentum, reached)
        for i in range(self._n):
            reached[i] = (reached[i] - velocity[i]) / step
        return result
