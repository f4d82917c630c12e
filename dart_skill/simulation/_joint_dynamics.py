"""From what acts on the joints in a step to the torques that PyBullet applies.

PyBullet has no field for the inertia of rotors. So the acceleration that the arm with rotors and
friction has is computed first, and then the torque that gives it to PyBullet's arm without them
(inverse dynamics): torque = M acceleration + bias.

It is asked at every step of the arm. So it is compiled (docs/development.md): _joint_dynamics.pxd
beside it has the types. It takes angles as PyBullet gives them, and gives torques as PyBullet
takes them: tuples and lists.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dart_skill.arm import Actuation
from dart_skill.common.constants import N_JOINTS
from dart_skill.simulation._transmission import Transmission


def read_joints(joints: tuple) -> tuple[list[float], list[float], np.ndarray, np.ndarray]:
    """Angles [rad] and speeds [rad/s] of the joints as lists, and both as arrays (7,).

    Parameters
    ----------
    joints
        Of each joint what PyBullet says of it: first its angle, then its speed.
    """
    position, velocity = np.empty(N_JOINTS), np.empty(N_JOINTS)
    angles, speeds = position, velocity
    for i in range(N_JOINTS):
        joint = joints[i]
        angles[i] = joint[0]
        speeds[i] = joint[1]
    return [joint[0] for joint in joints], [joint[1] for joint in joints], position, velocity


class JointDynamics:
    """The joints with their rotors and friction, step by step.

    Parameters
    ----------
    actuation
        Whose friction acts on the joints.
    reflected
        Inertia of the rotors as the joints feel it (7, 7) [kg m^2].
    gravity
        Share of the gravity torque that the arm's own compensation gives.
    step
        Control period [s].
    transmission
        Where cables give; the friction then acts on its motors, and the rotors are there.
    """

    def __init__(
        self,
        actuation: Actuation,
        reflected: np.ndarray,
        gravity: float,
        step: float,
        transmission: Transmission | None = None,
    ):
        self._actuation, self._transmission = actuation, transmission
        self._reflected, self._gravity, self._step = (
            np.array(reflected, dtype=float),
            gravity,
            step,
        )
        self._with_rotors = np.zeros((N_JOINTS, N_JOINTS))
        self._net = np.zeros(N_JOINTS)

    def asked(
        self, joint_torque: np.ndarray, pull: np.ndarray | None, gravity: np.ndarray
    ) -> np.ndarray:
        """What motors are asked for (7,) [N m]: by the controller, and by the arm's own gravity
        compensation.

        Parameters
        ----------
        joint_torque
            Of the command (7,) [N m].
        pull
            The command's wrench in the joints (7,) [N m]; None for none.
        gravity
            Torque that holds the arm (7,) [N m].
        """
        result = np.empty(N_JOINTS)
        torque = result
        for j in range(N_JOINTS):
            torque[j] = joint_torque[j]
            if pull is not None:
                torque[j] += pull[j]
            torque[j] += self._gravity * gravity[j]
        return result

    def torque(
        self,
        inertia: np.ndarray,
        bias: np.ndarray,
        effort: np.ndarray,
        outside: np.ndarray | None,
        position: np.ndarray,
        velocity: np.ndarray,
    ) -> list[float]:
        """The torque (7,) [N m] with which PyBullet's arm without rotors and friction moves in a
        step as the arm with them does.

        Parameters
        ----------
        inertia
            Of the joints without rotors (7, 7) [kg m^2].
        bias
            Torque at zero acceleration (7,): gravity and Coriolis terms [N m].
        effort
            Of the motors (7,) [N m].
        outside
            What acts on the links beside it (7,) [N m]; None for nothing.
        position, velocity
            Of the joints (7,) [rad], [rad/s].
        """
        with_rotors, reflected, net, n = self._with_rotors, self._reflected, self._net, N_JOINTS
        masses, held = inertia, bias
        push: Any = effort
        given: Any = outside
        for i in range(n):
            for j in range(n):
                with_rotors[i, j] = masses[i, j] + reflected[i, j]
            net[i] = -held[i]
            if outside is not None:
                net[i] += given[i]
        if self._transmission is not None:
            reached = self._transmission.advance(
                position, velocity, inertia, effort, self._net, self._step
            )
        else:
            for i in range(n):
                net[i] += push[i]
            reached = self._actuation.acceleration(
                self._with_rotors, self._net, velocity, self._step
            )
        acceleration = reached
        forces = []
        for i in range(n):
            torque = held[i]
            for j in range(n):
                torque += masses[i, j] * acceleration[j]
            forces.append(torque)
        return forces
