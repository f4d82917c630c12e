"""The joints of the arm in PyBullet: once a step they are driven, and read.

What the arm's own electronics do is here, too: gravity compensation, limits of the motors, the
safety module, encoders.

PyBullet has no field for the inertia of rotors. So the acceleration that the arm with rotors and
friction has is computed first, and then the torque that gives it to PyBullet's arm without them
(inverse dynamics): torque = M acceleration + bias.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dart_skill.arm import Actuation, Command, SafetyModule
from dart_skill.simulation._bullet import ArmDynamics, BulletClient, pybullet
from dart_skill.simulation._plant_settings import PlantSettings
from dart_skill.simulation._transmission import Encoders, Transmission


class Joints:
    """Driven by `drive`, read by `read`, in the world of `begin`.

    Attributes: position, velocity (n,) [rad], [rad/s]; those with `seen` are what the encoders
    report; effort, torque that reached the joints in the last step (n,) [N m].

    Parameters
    ----------
    settings
        Of the arm.
    nominal
        The arm as its gravity compensation knows it.
    reflected
        Inertia of the rotors as the joints feel it (n, n) [kg m^2].
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
        settings: PlantSettings,
        nominal: ArmDynamics,
        reflected: np.ndarray,
        actuation: Actuation,
        encoders: Encoders,
        transmission: Transmission | None = None,
        safety: SafetyModule | None = None,
    ):
        self._step, self._compensated = settings.step, 1.0 - settings.gravity_error
        self._nominal, self._reflected, self._actuation = nominal, reflected, actuation
        self._encoders, self._transmission, self._safety = encoders, transmission, safety

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
            Angles (n,) [rad].
        carried
            The arm with what its cables carry.
        """
        self._world, self._arm = world, arm
        self._indices = list(range(len(start)))
        self.effort = np.zeros(len(start))
        self._encoders.reset()
        if self._safety is not None:
            self._safety.reset()
        if self._transmission is not None:
            self._transmission.rest(start, carried.gravity_torque(start))
        self.read()

    def read(self) -> None:
        """Where the joints are now, and how fast."""
        states = self._world.getJointStates(self._arm, self._indices)
        self.position, self.velocity = np.array([state[:2] for state in states]).T.copy()
        motors: Any = self if self._transmission is None else self._transmission
        self.seen_position, self.seen_velocity = self._encoders.read(
            motors.position, motors.velocity
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
        seen, wrench = self.seen_position, np.asarray(command.wrench, dtype=float)
        asked = command.joint_torque + self._compensated * self._nominal.gravity_torque(seen)
        if (pull := self._nominal.geometry.in_joints(seen, wrench)) is not None:
            asked = asked + pull
        motors = self.velocity if self._transmission is None else self._transmission.velocity
        watched = np.zeros(len(asked)) if brakes else asked
        if self._safety is not None and self._safety.look(
            seen, self.seen_velocity, watched, command.speed
        ):
            self.effort = self._actuation.braking(motors)
        else:
            self.effort = self._actuation.deliverable(asked, motors)
        inertia, bias = arm.terms(self.position, self.velocity)
        net = -bias if push is None else self._from_outside(push) - bias
        if self._transmission is None:
            acceleration = self._actuation.acceleration(
                inertia + self._reflected, net + self.effort, self.velocity, self._step
            )
        else:
            acceleration = self._transmission.advance(
                self.position, self.velocity, inertia, self.effort, net, self._step
            )
        self._world.setJointMotorControlArray(
            self._arm,
            self._indices,
            pybullet.TORQUE_CONTROL,
            forces=(inertia @ acceleration + bias).tolist(),
        )

    def _from_outside(self, push: Command) -> np.ndarray:
        """What a person does to the joints (n,) [N m]."""
        wrench = np.asarray(push.wrench, dtype=float)
        pull = self._nominal.geometry.in_joints(self.position, wrench)
        return push.joint_torque if pull is None else push.joint_torque + pull

    def braking(self) -> np.ndarray:
        """Torque of motors that are shorted (n,) [N m]."""
        return self._actuation.braking(self.velocity)
