"""The joints of the arm in PyBullet: once a step they are driven, and read.

What the arm's own electronics do is here, too: gravity compensation, limits of the motors, the
safety module, encoders. This module is compiled (docs/development.md): _joints.pxd beside it has
the types.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dart_skill.arm import Actuation, Command, SafetyModule, Speed
from dart_skill.common.constants import N_JOINTS
from dart_skill.simulation._arm_geometry import ArmDynamics
from dart_skill.simulation._bullet import BulletClient, pybullet
from dart_skill.simulation._joint_dynamics import JointDynamics, read_joints
from dart_skill.simulation._transmission import Encoders, Transmission

ZEROS = [0.0] * N_JOINTS
JOINTS = list(range(N_JOINTS))


class Joints:
    """Driven by `drive`, read by `read`, in the world of `begin`.

    Attributes: angles, speeds (7,), lists, and position, velocity (7,), arrays of the same [rad],
    [rad/s]; those with `seen` are what the encoders report; effort, torque that reached the joints
    in the last step (7,) [N m].

    Parameters
    ----------
    nominal
        The arm as its gravity compensation knows it.
    dynamics
        Of its joints.
    actuation
        Of its motors.
    encoders
        On the motors, which are those of `transmission` where cables give.
    transmission
        None where cables are rigid.
    safety
        The arm's own safety module; None: it has none.
    """

    def __init__(
        self,
        nominal: ArmDynamics,
        dynamics: JointDynamics,
        actuation: Actuation,
        encoders: Encoders,
        transmission: Transmission | None = None,
        safety: SafetyModule | None = None,
    ):
        self._nominal, self._dynamics, self._actuation = nominal, dynamics, actuation
        self._encoders, self._transmission, self._safety = encoders, transmission, safety
        self._all, self._no_torque = JOINTS, np.zeros(N_JOINTS)
        self._mode = pybullet.TORQUE_CONTROL

    def begin(
        self, world: BulletClient, arm: int, start: np.ndarray, carried: ArmDynamics
    ) -> None:
        """The arm stands at rest in a new world.

        Parameters
        ----------
        world
            With the arm.
        arm
            Body in the world.
        start
            Angles (7,) [rad].
        carried
            The arm with what its cables carry.
        """
        self._arm, self._read, self._set = (
            arm,
            world.getJointStates,
            world.setJointMotorControlArray,
        )
        self.effort = np.zeros(N_JOINTS)
        self._encoders.reset()
        if self._safety is not None:
            self._safety.reset()
        if self._transmission is not None:
            self._transmission.rest(start, carried.gravity_torque(start))
        self.read()

    def read(self) -> None:
        """Where the joints are now, and how fast."""
        self.angles, self.speeds, self.position, self.velocity = read_joints(
            self._read(self._arm, self._all)
        )
        motors: Any = self if self._transmission is None else self._transmission
        self.seen_position, self.seen_velocity = self._encoders.read(
            motors.position, motors.velocity
        )
        self.seen_angles = (
            self.angles if self.seen_position is self.position else self.seen_position.tolist()
        )
        self.seen_speeds = (
            self.speeds if self.seen_velocity is self.velocity else self.seen_velocity.tolist()
        )

    def drive(
        self, command: Command, push: Command | None, brakes: bool, arm: ArmDynamics
    ) -> None:
        """Set the torques for one step.

        Parameters
        ----------
        command
            Of the controller.
        push
            Of a person who guides the arm; it acts on the links from outside.
        brakes
            Whether the command is the arm's own braking, for which its safety module does not ask.
        arm
            As it is built, with what is in its hand.
        """
        pull = self._nominal.in_joints(self.seen_position, np.asarray(command.wrench, dtype=float))
        gravity = self._nominal.gravity_torque(self.seen_position)
        asked = self._dynamics.asked(np.asarray(command.joint_torque, dtype=float), pull, gravity)
        motors = self.velocity if self._transmission is None else self._transmission.velocity
        if self._is_stopped(self._no_torque if brakes else asked, command.speed):
            self.effort = self._actuation.braking(motors)
        else:
            self.effort = self._actuation.deliverable(asked, motors)
        outside = None if push is None else self._from_outside(push)
        inertia, bias = arm.terms(self.position, self.velocity)
        forces = self._dynamics.torque(
            inertia, bias, self.effort, outside, self.position, self.velocity
        )
        self._set(self._arm, self._all, self._mode, forces=forces)

    def _is_stopped(self, torque: np.ndarray, speed: Speed) -> bool:
        """Whether the safety module has found a fault: the motors are shorted then."""
        if self._safety is None:
            return False
        return bool(self._safety.look(self.seen_position, self.seen_velocity, torque, speed))

    def _from_outside(self, push: Command) -> np.ndarray:
        """What a person does to the joints (7,) [N m]."""
        pull = self._nominal.in_joints(self.position, np.asarray(push.wrench, dtype=float))
        return np.asarray(
            push.joint_torque if pull is None else push.joint_torque + pull, dtype=float
        )

    def braking(self) -> np.ndarray:
        """Torque of motors that are shorted (7,) [N m]."""
        return self._actuation.braking(self.velocity)
