"""The arm in PyBullet: its joints with motors, encoders and cables, its safety module, and its hand.

The arm is honest: it has the torque and speed limits of the motors, rotor inertia, friction, and a
gravity compensation with an error (docs/sources.md has the numbers). PyBullet has no field for
rotor inertia, so a step computes the acceleration that the arm with rotors would have, and applies
the torque that gives it to PyBullet's arm.
"""

from dataclasses import dataclass, replace
from xml.etree import ElementTree

import numpy as np

from dart_skill.arm import (
    DART,
    Actuation,
    ArmDescription,
    ArmState,
    Command,
    SafetyModule,
    Speed,
    the_arm,
    write_urdf,
)
from dart_skill.simulation._bullet import (
    ArmDynamics,
    BulletClient,
    connect,
    load_urdf,
    pybullet,
)
from dart_skill.simulation._joints import Joints
from dart_skill.simulation._plant_settings import PlantSettings
from dart_skill.simulation._transmission import Encoders, Transmission


@dataclass(frozen=True)
class Braking(Command):
    """Motors shorted, as the arm does it by itself: no controller asks for its torque."""


class ArmInWorld:
    """An arm in a physics server, without anything in its hand.

    Parameters
    ----------
    settings
        Of the arm, and the control period.
    description
        Of the arm, default that of this process.
    """

    def __init__(self, settings: PlantSettings, description: ArmDescription | None = None):
        self.settings, self.description = settings, description or the_arm()
        self._world, self._models = connect(), connect()
        self._commands: list[Command] = []
        self._stamp_ns = self._step_count = 0
        self._hand_link = self.description.n_joints  # its index in PyBullet
        self._seen_hand: tuple[np.ndarray, np.ndarray] | None = None  # None until it is asked for
        self._build_arm()

    def close(self) -> None:
        """Disconnect from PyBullet."""
        self._world.disconnect()
        self._models.disconnect()

    # what it is made of

    def _build_arm(self) -> None:
        """What the settings make of the arm: its motors, encoders and cables, and its dynamics
        with and without what the hand may hold.
        """
        s = self.settings
        actuation = Actuation(self.description, s.friction_scale, s.motor_scale, s.stiction)
        encoders = Encoders(np.array(s.joint_offset), s.encoder_step, s.speed_filter, s.step)
        self._safety = (
            SafetyModule(s.limits, self.description, s.limits.patience) if s.limits else None
        )
        stiffness = np.array(s.joint_stiffness)
        reflected = self.description.motors.reflected_inertia
        cables = Transmission(stiffness, reflected, actuation) if s.elastic else None
        self._models.resetSimulation()
        self._models.setGravity(0, 0, -self.description.gravity)
        nominal, real = ArmDynamics(self._models, self.description), self._as_built()
        self._joints = Joints(s, nominal, reflected, actuation, encoders, cables, self._safety)
        self._urdf = unseen(write_urdf(real))
        self._empty_arm = ArmDynamics(self._models, real)
        ball, scale = self.description_of_load.ball, s.ball_mass_scale
        loaded = replace(
            real, ball=replace(ball, mass=scale * ball.mass, inertia=scale * ball.inertia)
        )
        self._loaded_arm = ArmDynamics(self._models, loaded, ball_in_hand=True)

    def _as_built(self) -> ArmDescription:
        """The description with the masses that the links really have."""
        links = [
            replace(link, mass=scale * link.mass, inertia=scale * link.inertia)
            for link, scale in zip(
                self.description.links_urdf, self.settings.mass_scale, strict=True
            )
        ]
        return replace(self.description, links_urdf=tuple(links))

    @property
    def description_of_load(self) -> ArmDescription:
        """The arm with what its user knows to be in its hand: a ball, or a dart where there is a
        board.
        """
        return (
            self.description
            if self.settings.board is None
            else replace(self.description, ball=DART)
        )

    def _build_arm_in_world(self) -> None:
        """A new world with nothing in it but the arm, in its start posture, and the floor."""
        world = self._world
        world.resetSimulation()
        world.setGravity(0, 0, -self.description.gravity)
        # Without contactERP=0 a bounce gains up to 10 % of its speed: Bullet pushes bodies apart
        # that met between two steps.
        world.setPhysicsEngineParameter(
            fixedTimeStep=self.settings.step, deterministicOverlappingPairs=1, contactERP=0.0
        )
        self._arm = _load_arm(
            world, self._urdf, self.description.mount_height, self.settings.base_turn
        )
        joints = list(range(self.description.n_joints))
        world.setJointMotorControlArray(
            self._arm, joints, pybullet.VELOCITY_CONTROL, forces=[0.0] * len(joints)
        )
        for joint, angle in zip(joints, self.settings.start_posture, strict=True):
            world.resetJointState(self._arm, joint, angle, 0.0)
        _keep_apart(world, self._arm, _floor(world))

    def _begin_arm(self) -> None:
        """The arm stands at rest in its start posture, in a world that was built."""
        self._commands, self._step_count = [], 0
        start = np.array(self.settings.start_posture)
        self._joints.begin(self._world, self._arm, start, self._loaded_arm)

    # a step

    def _delayed(self, command: Command) -> Command:
        """The command that acts now; none in the first periods of an episode, if commands act
        later.
        """
        if not self.settings.command_delay:
            return command
        self._commands.append(command)
        if len(self._commands) <= self.settings.command_delay:
            return Command(command.stamp_ns)
        return self._commands.pop(0)

    def _drive(self, command: Command, push: Command | None, is_loaded: bool) -> None:
        """Set the torques of the joints for one step."""
        arm = self._loaded_arm if is_loaded else self._empty_arm
        self._joints.drive(command, push, isinstance(command, Braking), arm)

    def braking(self) -> Command:
        """The command of an arm whose controller is silent: motors shorted, a damped stop, as
        Barrett's safety system does it.
        """
        return Braking(self._stamp_ns, joint_torque=self._joints.braking(), speed=Speed.THROW)

    def _observe(self) -> None:
        """Read the joints; the hand is looked at when it is asked for."""
        self._joints.read()
        self._seen_hand = None

    # what it says

    @property
    def _hand(self) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) and quaternion (4,) of the hand's frame."""
        if self._seen_hand is None:
            hand = self._world.getLinkState(self._arm, self._hand_link, computeForwardKinematics=1)
            self._seen_hand = np.array(hand[4]), np.array(hand[5])
        return self._seen_hand

    @property
    def fault(self) -> str:
        """Which limit the arm's safety module found passed: until a reset the motors are shorted.
        Empty if all is well.
        """
        return "" if self._safety is None else self._safety.fault

    @property
    def warning(self) -> str:
        """What is near a limit now."""
        return "" if self._safety is None else self._safety.warning

    @property
    def state_stamp_ns(self) -> int:
        """Stamp of the present state."""
        return self._stamp_ns

    @property
    def step_count(self) -> int:
        """Steps since the last reset."""
        return self._step_count

    @property
    def joint_position(self) -> list[float]:
        """Joint angles now, as the encoders report them [rad]."""
        return self._joints.seen_position.tolist()

    @property
    def joint_velocity(self) -> list[float]:
        """Joint velocities now, as the driver reports them [rad/s]."""
        return self._joints.seen_velocity.tolist()

    @property
    def joint_effort(self) -> np.ndarray:
        """Torque that reached the joints in the last step (n,) [N m]."""
        return self._joints.effort

    @property
    def hand_position(self) -> np.ndarray:
        """Origin of the hand frame (3,) [m]."""
        return self._hand[0]

    @property
    def hand_quaternion(self) -> np.ndarray:
        """Orientation of the hand frame (4,)."""
        return self._hand[1]

    @property
    def arm_state(self) -> ArmState:
        """The part of the present state that the arm's own sensors tell."""
        return ArmState(self._stamp_ns, self._joints.seen_position, self._joints.seen_velocity)


def _load_arm(client: BulletClient, urdf: str, mount_height: float, turn: float = 0.0) -> int:
    body = load_urdf(client, urdf, [0, 0, mount_height], turn)
    for link in range(-1, client.getNumJoints(body)):
        client.changeDynamics(
            body, link, linearDamping=0, angularDamping=0, jointDamping=0, restitution=0.3
        )
    return body


def _floor(world: BulletClient) -> int:
    shape = world.createCollisionShape(pybullet.GEOM_PLANE)
    body = world.createMultiBody(0, shape, small_box(world))
    world.changeDynamics(body, -1, restitution=1.0, lateralFriction=0.7)
    return body


def _keep_apart(world: BulletClient, arm: int, floor: int) -> None:
    """The arm cannot reach the floor. Where PyBullet does not look whether it does, a step takes a
    fifth less time.
    """
    for link in range(-1, world.getNumJoints(arm)):
        world.setCollisionFilterPair(arm, floor, link, -1, 0)


def unseen(urdf: str) -> str:
    """The same bodies with a small box as the only visible shape of a link.

    PyBullet makes a mesh of every visible shape, or of every collision shape where none is
    visible, which takes ten times as long as all the rest of loading; none is looked at.
    """
    robot = ElementTree.fromstring(urdf)
    for link in robot.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
        geometry = ElementTree.SubElement(ElementTree.SubElement(link, "visual"), "geometry")
        ElementTree.SubElement(geometry, "box", size="0.01 0.01 0.01")
    return ElementTree.tostring(robot, encoding="unicode")


def small_box(world: BulletClient) -> int:
    """A visible shape that takes little time, see `unseen`."""
    return world.createVisualShape(pybullet.GEOM_BOX, halfExtents=[0.005] * 3)
