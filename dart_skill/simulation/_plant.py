"""The WAM, a tennis ball and a basket in PyBullet: one pure step from a command to the next state.

The plant is honest: it has the torque and speed limits of the motors, rotor inertia, friction, a
gravity compensation with an error, a hand that takes time to open, and a ball with drag
(docs/sources.md has the numbers). PyBullet has no field for rotor inertia, so the step computes
the acceleration that the arm with rotors would have, and applies the torque that gives it to
PyBullet's arm.
"""

import math
import os
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from dart_skill.arm import (
    DART,
    Actuation,
    ArmState,
    Ball,
    Command,
    Grip,
    SafetyLimits,
    SafetyModule,
    Speed,
    WamDescription,
    check_command,
    check_push,
    wam_description,
    write_urdf,
)
from dart_skill.common.constants import AIR_DENSITY, N_JOINTS
from dart_skill.common.quaternions import rotate_one
from dart_skill.simulation._arm_geometry import ArmDynamics
from dart_skill.simulation._basket import Basket, basket_urdf
from dart_skill.simulation._board import Board
from dart_skill.simulation._bullet import BulletClient, connect, pybullet
from dart_skill.simulation._joint_dynamics import JointDynamics
from dart_skill.simulation._joints import JOINTS, ZEROS, Joints
from dart_skill.simulation._transmission import Encoders, Transmission

HAND_LINK_INDEX = N_JOINTS
OF_EACH_JOINT = ("start_posture", "mass_scale", "joint_stiffness", "joint_offset")
"""Settings with a number for each joint."""
NO_PARAMETERS = ("step_ns", "reset_ns", "hand_clearance", "basket", "board", "limits")
"""Settings that are no parameters of the simulator of that name."""


@dataclass(frozen=True)
class PlantSettings:
    """How the stand-in differs from a perfect arm; each value is a parameter of the simulator
    node.

    * step_ns: control period [ns].
    * reset_ns: how far a reset moves the clock on, so that everybody notices the gap [ns].
    * start_posture: joint angles after a reset (7,) [rad].
    * gravity_error: share of the gravity torque that compensation misses; calibrated arms show 5 %
      (docs/sources.md).
    * friction_scale, motor_scale: factors on the joint friction, and on what the motors can do.
    * base_turn: the arm's base stands turned about the vertical, and nobody told the controller
      [rad].
    * hand_delay, hand_spread: mean and standard deviation of the time from the command to the ball
      being free [s].
    * hand_clearance: a released ball that is farther from the hand than this can touch the hand
      again [m].
    * basket: where balls are thrown.
    * ball_mass_scale, ball_drag_scale: factors on the mass and on the drag of the ball.
    * mass_scale: factors on the masses of the links (7,).
    * stiction: what static friction is more than Coulomb friction, as a share of it.
    * joint_stiffness: of the cables between motors and links (7,) [N m/rad]; all 0: rigid.
      Encoders sit on the motors.
    * joint_offset: what the encoders read too high (7,) [rad].
    * encoder_step: of an angle [rad]; 0: none.
    * speed_filter: corner of the low-pass on the speeds [rad/s]; 0: speeds are exact.
    * command_delay: control periods until a command acts.
    * seat_spread: standard deviation of a coordinate of where the ball sits in the hand [m].
    * release_turn, release_speed: standard deviations of the direction [rad] and of the speed, as
      a share, with which it leaves the hand.
    * board: where there is one, darts are thrown at it, and there is no basket.
    * limits: that the arm's own safety module watches; None: it has none.
    """

    step_ns: int = 2_000_000
    reset_ns: int = 1_000_000_000
    start_posture: tuple[float, ...] = (0.0,) * N_JOINTS
    gravity_error: float = 0.05
    friction_scale: float = 1.0
    motor_scale: float = 1.0
    base_turn: float = 0.0
    hand_delay: float = 0.030
    hand_spread: float = 0.004
    hand_clearance: float = 0.10
    basket: Basket = Basket()
    ball_mass_scale: float = 1.0
    ball_drag_scale: float = 1.0
    mass_scale: tuple[float, ...] = (1.0,) * N_JOINTS
    stiction: float = 0.0
    joint_stiffness: tuple[float, ...] = (0.0,) * N_JOINTS
    joint_offset: tuple[float, ...] = (0.0,) * N_JOINTS
    encoder_step: float = 0.0
    speed_filter: float = 0.0
    command_delay: int = 0
    seat_spread: float = 0.0
    release_turn: float = 0.0
    release_speed: float = 0.0
    board: Board | None = None
    limits: SafetyLimits | None = None

    @property
    def step(self) -> float:
        return self.step_ns * 1e-9

    @classmethod
    def from_parameters(cls, parameters: Mapping) -> "PlantSettings":
        """Settings from the parameters of the simulator node; ValueError names a value that makes
        no sense.
        """
        basket = Basket(
            position=tuple(parameters["basket_position"]),
            radius=parameters["basket_radius"],
            depth=parameters["basket_depth"],
            restitution=parameters["basket_restitution"],
        )
        own: dict[str, Any] = {
            one.name: parameters[one.name] for one in fields(cls) if one.name not in NO_PARAMETERS
        }
        each = {name: tuple(float(value) for value in own[name]) for name in OF_EACH_JOINT}
        return cls(
            basket=basket, limits=SafetyLimits.from_parameters(parameters), **{**own, **each}
        )

    def __post_init__(self) -> None:
        for name in OF_EACH_JOINT:
            values = getattr(self, name)
            if len(values) != N_JOINTS or not np.isfinite(values).all():
                raise ValueError(f"{name} {values} is not {N_JOINTS} finite numbers")
        if not (min(self.mass_scale) > 0.0):
            raise ValueError(f"mass_scale {self.mass_scale} must be positive")
        if min(self.joint_stiffness) < 0.0 or (
            any(self.joint_stiffness) and not all(self.joint_stiffness)
        ):
            raise ValueError(
                f"joint_stiffness {self.joint_stiffness} must be positive for all joints, or 0"
                " for all"
            )

    @property
    def elastic(self) -> bool:
        return any(self.joint_stiffness)


@dataclass(frozen=True)
class PlantState:
    """Everything about the world at one instant, in the axes of the world; for models of sensors
    and for tests, never for learning.

    * stamp_ns: [ns]; episode, step: of the world, from 0 on.
    * position, velocity, effort: of the joints, (7,) each [rad], [rad/s], [N m].
    * hand_position, hand_quaternion: (3,) [m] and (4,).
    * ball_position, ball_quaternion, ball_velocity: (3,) [m], (4,), (3,) [m/s].
    * ball_held: whether the ball is in the hand.
    * basket: centre of the rim (3,) [m].
    * ball_in_basket: whether it is there; with a board, whether the dart sticks in it.
    """

    stamp_ns: int
    episode: int
    step: int
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    hand_position: np.ndarray
    hand_quaternion: np.ndarray
    ball_position: np.ndarray
    ball_quaternion: np.ndarray
    ball_velocity: np.ndarray
    ball_held: bool
    basket: np.ndarray
    ball_in_basket: bool

    @property
    def arm(self) -> ArmState:
        """What exact encoders would say of it."""
        return ArmState(self.stamp_ns, self.position, self.velocity)


RENEWED = 50
"""Episodes after which the physics server is a new one: PyBullet keeps 10 kB of every body that it
loads until it is disconnected.
"""


class LooseState(NamedTuple):
    """State of what the hand may hold: position (3,) [m], quaternion (4,) and velocity (3,) [m/s],
    as PyBullet says them.
    """

    position: tuple[float, ...]
    quaternion: tuple[float, ...]
    velocity: tuple[float, ...]


@dataclass(frozen=True)
class Braking(Command):
    """Motors shorted, as the arm does it by itself: no controller asks for its torque."""


class Plant:
    """The simulated world. `reset` begins an episode, `step` advances it by one control period.

    Everything random comes from (seed, episode), so an episode does not depend on how long the one
    before it went on.
    """

    loose_body, movable_body = "ball", "basket"
    """Roles of what the hand may hold, or what moves by itself, and of what can be put somewhere.
    """
    numbers: tuple[str, ...] = ()
    """Names of the numbers of a situation that this world knows."""

    def __init__(
        self,
        settings: PlantSettings | None = None,
        seed: int = 0,
        description: WamDescription | None = None,
    ):
        self.settings = settings or PlantSettings()
        self.description = description or wam_description()
        self._seed = seed
        self._world = connect()
        self._nominal_arm = ArmDynamics(self.description)
        self._build_arm()
        self._basket = self._place_of_target()
        self._changed: PlantSettings | None = None
        self._held: int | None = None  # the constraint between hand and ball
        self._free_at: int | None = None  # the stamp at which the hand will have opened [ns]
        self._episode = 0
        self._stamp_ns = 0
        self._seen_hand: tuple[np.ndarray, np.ndarray] | None = None
        self._seen_loose: LooseState | None = None  # None until somebody asks for them
        self.reset()

    def _build_arm(self) -> None:
        """What the settings make of the arm: its motors, encoders and cables, and its dynamics
        with and without the ball.
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
        dynamics = JointDynamics(actuation, reflected, 1.0 - s.gravity_error, s.step, cables)
        self._joints = Joints(
            self._nominal_arm, dynamics, actuation, encoders, cables, self._safety
        )
        real = self._as_built()
        self._urdf = _unseen(write_urdf(real))
        self._basket_urdf: str | None = None  # made when the first world is built
        self._empty_arm = self._nominal_arm if real is self.description else ArmDynamics(real)
        ball, scale = self._projectile, s.ball_mass_scale
        loaded = replace(
            real, ball=replace(ball, mass=scale * ball.mass, inertia=scale * ball.inertia)
        )
        self._loaded_arm = ArmDynamics(loaded, ball_in_hand=True)

    def _as_built(self) -> WamDescription:
        """The description with the masses that the links really have."""
        if self.settings.mass_scale == (1.0,) * N_JOINTS:
            return self.description
        links = [
            replace(link, mass=scale * link.mass, inertia=scale * link.inertia)
            for link, scale in zip(
                self.description.links_urdf, self.settings.mass_scale, strict=True
            )
        ]
        return replace(self.description, links_urdf=tuple(links))

    @property
    def description_of_load(self) -> WamDescription:
        """The arm with what its user knows to be in its hand: a ball, or a dart where there is a
        board.
        """
        return (
            self.description
            if self.settings.board is None
            else replace(self.description, ball=DART)
        )

    @property
    def _projectile(self) -> Ball:
        return self.description.ball if self.settings.board is None else DART

    def _place_of_target(self) -> np.ndarray:
        return np.array((self.settings.board or self.settings.basket).position)

    def close(self) -> None:
        """Disconnect from PyBullet."""
        self._world.disconnect()

    def reset(self, basket: np.ndarray | None = None) -> PlantState:
        """Arm at rest in its start posture, ball in the hand; the world is built anew, time goes
        on. A board stays where it hangs.

        basket: centre of its rim (3,) [m].
        """
        self._basket = self._basket if basket is None else _checked_basket(basket)
        self._apply_change()
        if self.settings.board is not None:
            self._basket = self._place_of_target()
        self._episode += 1
        self._stamp_ns += self.settings.reset_ns
        self._step_count = 0
        self._rng = np.random.default_rng([self._seed, self._episode])
        self._scatter = np.random.default_rng([self._seed, self._episode, 1])
        self._build_world()
        self._fill_hand()
        self._commands: list[Command] = []
        self._joints.begin(
            self._world, self._arm, np.array(self.settings.start_posture), self._loaded_arm
        )
        self._seen_hand = self._seen_loose = None
        return self.state

    def change(self, settings: PlantSettings) -> None:
        """From the next reset on the plant is as `settings` say: worn joints, another ball, a base
        that was pushed. Time and seed stay.

        ValueError for what cannot change while it runs.
        """
        if (settings.step_ns, settings.reset_ns) != (
            self.settings.step_ns,
            self.settings.reset_ns,
        ):
            raise ValueError(
                "step_ns and reset_ns cannot change while a plant runs: make a new one"
            )
        if (settings.board is None) != (self.settings.board is None):
            raise ValueError(
                "a board cannot take the place of the basket while a plant runs: make a new one"
            )
        self._changed = settings

    def _apply_change(self) -> None:
        if self._changed is None:
            return
        self.settings = self._changed
        self._changed = None
        self._build_arm()

    @property
    def bodies(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """True poses of what the cameras track, by role: position (3,) [m] and quaternion (4,)."""
        return {
            "hand": (self.hand_position, self.hand_quaternion),
            self.loose_body: (np.array(self._loose.position), np.array(self._loose.quaternion)),
            self.movable_body: (self._basket, np.array([0.0, 0.0, 0.0, 1.0])),
        }

    @property
    def held_body(self) -> str:
        """Role of what the hand holds; empty: nothing."""
        return self.loose_body if self._held is not None else ""

    @property
    def succeeded(self) -> bool:
        """Whether the ball is in the basket, or the dart in the board: this world's own word, for
        judges and not for learning.
        """
        return self.state.ball_in_basket

    def set_up(
        self,
        poses: Mapping[str, tuple[np.ndarray, np.ndarray]],
        numbers: Mapping[str, float] | None = None,
    ) -> PlantState:
        """Reset, with the bodies that are named put to their poses, and what a world has of
        numbers.

        ValueError for a body that cannot be put anywhere, and for a number that this world does
        not know.
        """
        self._check_movable(poses)
        self._check_numbers(numbers or {})
        return self.reset(poses[self.movable_body][0] if poses else None)

    def put(self, role: str, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Put a body somewhere at once; ValueError for one that cannot be. position: of the body
        (3,) [m].
        """
        self._check_movable([role])
        self.place_basket(position)

    def _check_numbers(self, numbers: Iterable[str]) -> None:
        if other := sorted(set(numbers) - set(self.numbers)):
            known = ", ".join(self.numbers) or "none"
            raise ValueError(
                f"this world knows no number {', '.join(map(repr, other))}; it knows {known}"
            )

    def _check_movable(self, roles: Iterable[str]) -> None:
        if other := sorted(set(roles) - {self.movable_body}):
            raise ValueError(
                f"this world can put the {self.movable_body} somewhere, not"
                f" {', '.join(map(repr, other))}"
            )

    def place_basket(self, position: np.ndarray) -> None:
        """Put the basket, centre of its rim at position (3,), without touching anything else.
        ValueError if there is a board instead.
        """
        if self.settings.board is not None:
            raise ValueError(
                "there is a board and no basket to place: change the settings to hang it elsewhere"
            )
        self._basket = _checked_basket(position)
        self._world.resetBasePositionAndOrientation(
            self._basket_body, list(self._basket), [0, 0, 0, 1]
        )

    def step(self, command: Command, push: Command | None = None) -> None:
        """Advance by one control period under the controller's command and, if somebody guides the
        arm, their push.

        Both must answer the present state. The push acts on the arm from outside: no motor limits
        apply to it.
        """
        answers = [answer for answer in (command, push) if answer is not None]
        for answer in answers:
            check_command(answer, self._stamp_ns)
        if push is not None and self.settings.limits is not None:
            check_push(push, self.settings.limits)
        acting = self._delayed(command)
        self._obey_grip(acting.grip)
        if push is not None:
            self._obey_grip(push.grip)
        self._let_go_when_due()
        self._drive(acting, push)
        self._act_on_ball()
        board = None if self._held is not None or self._stuck else self.settings.board
        before = None if board is None else np.array(self._loose.position)
        self._world.stepSimulation()
        self._stamp_ns += self.settings.step_ns
        self._step_count += 1
        self._observe()
        if board is not None and before is not None:
            self._stick_to_the_board(board, before)

    # the arm

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

    def _drive(self, command: Command, push: Command | None) -> None:
        arm = self._loaded_arm if self._held is not None else self._empty_arm
        self._joints.drive(command, push, isinstance(command, Braking), arm)

    # the hand and the ball

    def _obey_grip(self, grip: Grip) -> None:
        if grip == Grip.CLOSE:
            self.close_hand()
        if grip == Grip.OPEN and self._held is not None and self._free_at is None:
            delay = (
                self.settings.hand_delay + self.settings.hand_spread * self._rng.standard_normal()
            )
            self._free_at = (
                self._stamp_ns + max(0, round(delay / self.settings.step)) * self.settings.step_ns
            )

    def close_hand(self) -> bool:
        """Close the hand; whether it now holds the ball: only if it was never let go, or has not
        left the hand yet.
        """
        self._free_at = None
        return self._held is not None

    def braking(self) -> Command:
        """The command of an arm whose controller is silent: motors shorted, a damped stop, as
        Barrett's safety system does it.
        """
        return Braking(self._stamp_ns, joint_torque=self._joints.braking(), speed=Speed.THROW)

    def open_hand(self) -> None:
        """Begin to open the hand, as a command with Grip.OPEN does."""
        self._obey_grip(Grip.OPEN)

    def _let_go_when_due(self) -> None:
        self._just_freed = self._free_at is not None and self._stamp_ns >= self._free_at
        if self._just_freed:
            self._world.removeConstraint(self._held)
            self._held, self._free_at = None, None
            self._scatter_release()

    def _scatter_release(self) -> None:
        """The fingers give the ball another direction and speed than the hand has."""
        s = self.settings
        if not (s.release_turn or s.release_speed):
            return
        _ = self._loose  # read before the change: the air drags at that speed
        turn, share = (
            s.release_turn * self._scatter.standard_normal(3),
            1.0 + s.release_speed * self._scatter.standard_normal(),
        )
        linear, angular = (np.array(part) for part in self._world.getBaseVelocity(self._ball))
        angle = float(np.linalg.norm(turn))
        axis = turn / angle if angle else turn
        quaternion = np.append(np.sin(angle / 2) * axis, np.cos(angle / 2))
        self._world.resetBaseVelocity(
            self._ball, (share * rotate_one(quaternion, linear)).tolist(), angular.tolist()
        )

    def _act_on_ball(self) -> None:
        """Drag; and half the gravity in the first free step, which makes PyBullet's Euler steps a
        leapfrog, exact for a parabola.
        """
        if self._held is not None or self._stuck:
            return
        x, y, z = self._loose.velocity
        drag = self._drag * math.sqrt(x * x + y * y + z * z)
        force = [drag * x, drag * y, drag * z]
        if self._just_freed:
            force[2] += 0.5 * self._ball_mass * self.description.gravity
        self._world.applyExternalForce(
            self._ball, -1, force, self._loose.position, pybullet.WORLD_FRAME
        )
        self._touch_when_clear()

    def _stick_to_the_board(self, board: Board, before: np.ndarray) -> None:
        """A dart that has met the board in the last step stays where it met it."""
        point = board.hit(before, np.array(self._loose.position))
        if point is None:
            return
        self._world.resetBasePositionAndOrientation(
            self._ball, point.tolist(), self._loose.quaternion
        )
        self._world.resetBaseVelocity(self._ball, [0, 0, 0], [0, 0, 0])
        self._world.changeDynamics(self._ball, -1, mass=0)
        self._stuck, self._seen_loose = True, None

    def _touch_when_clear(self) -> None:
        """The open fingers are not modelled: the hand can touch the ball again once it is a hand's
        breadth away.
        """
        if self._touchable:
            return
        grip = self.hand_position + rotate_one(
            self.hand_quaternion, self.description.hand.ball_centre
        )
        if np.linalg.norm(np.array(self._loose.position) - grip) > self.settings.hand_clearance:
            self._set_touchable(True)

    def _set_touchable(self, touchable: bool) -> None:
        for link in range(4, HAND_LINK_INDEX + 1):
            self._world.setCollisionFilterPair(self._ball, self._arm, -1, link, int(touchable))
        self._touchable = touchable

    def _fill_hand(self) -> None:
        """An episode begins with the ball in the hand."""
        hand = self._world.getLinkState(self._arm, HAND_LINK_INDEX, computeForwardKinematics=1)
        centre = self.description.hand.ball_centre
        if self.settings.seat_spread:
            centre = centre + self.settings.seat_spread * self._scatter.standard_normal(3)
        position = np.array(hand[4]) + rotate_one(np.array(hand[5]), centre)
        self._world.resetBasePositionAndOrientation(self._ball, position.tolist(), hand[5])
        offset, turn = in_principal_axes(hand, centre)
        self._held = self._world.createConstraint(
            self._arm,
            HAND_LINK_INDEX,
            self._ball,
            -1,
            pybullet.JOINT_FIXED,
            [0, 0, 0],
            offset,
            [0, 0, 0],
            turn,
        )
        self._free_at, self._just_freed, self._stuck = None, False, False
        self._set_touchable(False)

    # the world

    def _build_world(self) -> None:
        if self._episode % RENEWED == 0:
            self._world.disconnect()
            self._world = connect()
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
        world.setJointMotorControlArray(self._arm, JOINTS, pybullet.VELOCITY_CONTROL, forces=ZEROS)
        for joint, angle in zip(JOINTS, self.settings.start_posture, strict=True):
            world.resetJointState(self._arm, joint, angle, 0.0)
        _keep_apart(world, self._arm, _floor(world))
        self._build_things(world)

    def _build_things(self, world: BulletClient) -> None:
        """What there is beside arm and floor: the ball, and the basket if there is no board."""
        if self.settings.board is None:
            if self._basket_urdf is None:
                self._basket_urdf = _unseen(basket_urdf(self.settings.basket))
            self._basket_body = _load_urdf(world, self._basket_urdf, self._basket.tolist())
            world.changeDynamics(
                self._basket_body,
                -1,
                restitution=self.settings.basket.restitution,
                lateralFriction=0.5,
            )
        ball, s = self._projectile, self.settings
        self._ball_mass = ball.mass * s.ball_mass_scale
        self._drag = (
            -0.5
            * AIR_DENSITY
            * (s.ball_drag_scale * ball.drag_coefficient)
            * (np.pi * ball.radius**2)
        )
        self._ball = _ball_body(world, ball, self._ball_mass)

    def _observe(self) -> None:
        """Read the joints; where hand and ball are is read when somebody asks."""
        self._joints.read()
        self._seen_hand = self._seen_loose = None

    @property
    def _hand(self) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) and quaternion (4,) of the hand's frame."""
        if self._seen_hand is None:
            hand = self._world.getLinkState(self._arm, HAND_LINK_INDEX, computeForwardKinematics=1)
            self._seen_hand = np.array(hand[4]), np.array(hand[5])
        return self._seen_hand

    @property
    def _loose(self) -> LooseState:
        """State of the ball, or of what stands for it in this world."""
        if self._seen_loose is None:
            self._seen_loose = self._look_at_loose()
        return self._seen_loose

    def _look_at_loose(self) -> LooseState:
        position, quaternion = self._world.getBasePositionAndOrientation(self._ball)
        return LooseState(position, quaternion, self._world.getBaseVelocity(self._ball)[0])

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
        return self._joints.seen_angles

    @property
    def joint_velocity(self) -> list[float]:
        """Joint velocities now, as the driver reports them [rad/s]."""
        return self._joints.seen_speeds

    @property
    def joint_effort(self) -> np.ndarray:
        """Torque that reached the joints in the last step (7,) [N m]."""
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

    @property
    def state(self) -> PlantState:
        """The present state."""
        ball = np.array(self._loose.position)
        return PlantState(
            stamp_ns=self._stamp_ns,
            episode=self._episode,
            step=self._step_count,
            position=self._joints.position,
            velocity=self._joints.velocity,
            effort=self._joints.effort,
            hand_position=self.hand_position,
            hand_quaternion=self.hand_quaternion,
            ball_position=ball,
            ball_quaternion=np.array(self._loose.quaternion),
            ball_velocity=np.array(self._loose.velocity),
            ball_held=self._held is not None,
            basket=self._basket,
            ball_in_basket=(
                self._stuck
                if self.settings.board is not None
                else self.settings.basket.holds(ball, self._basket)
            ),
        )


def _load_arm(client: BulletClient, urdf: str, mount_height: float, turn: float = 0.0) -> int:
    body = _load_urdf(client, urdf, [0, 0, mount_height], turn)
    for link in range(-1, client.getNumJoints(body)):
        client.changeDynamics(
            body, link, linearDamping=0, angularDamping=0, jointDamping=0, restitution=0.3
        )
    return body


def _load_urdf(client: BulletClient, urdf: str, position: list[float], turn: float = 0.0) -> int:
    upright = [0.0, 0.0, float(np.sin(turn / 2)), float(np.cos(turn / 2))]
    handle, path = tempfile.mkstemp(suffix=".urdf")
    try:
        with open(handle, "w", encoding="utf-8") as file:
            file.write(urdf)
        return client.loadURDF(
            path, position, upright, useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE
        )
    finally:
        os.unlink(path)


def _unseen(urdf: str) -> str:
    """The same bodies with a small box as the only visible shape of a link.

    PyBullet makes a mesh of every visible shape, or of every collision shape where none is
    visible, which takes ten times as long as all the rest of loading; nobody looks.
    """
    robot = ElementTree.fromstring(urdf)
    for link in robot.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
        geometry = ElementTree.SubElement(ElementTree.SubElement(link, "visual"), "geometry")
        ElementTree.SubElement(geometry, "box", size="0.01 0.01 0.01")
    return ElementTree.tostring(robot, encoding="unicode")


def in_principal_axes(link_state: tuple, point: np.ndarray) -> tuple[list[float], list[float]]:
    """A point of a link, and the link's axes, in the frame that PyBullet measures from: centre of
    mass, principal axes.
    """
    centre, turn = np.array(link_state[2]), np.array(link_state[3])
    back = np.array([-turn[0], -turn[1], -turn[2], turn[3]])
    return rotate_one(back, point - centre).tolist(), back.tolist()


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


def small_box(world: BulletClient) -> int:
    """A visible shape that takes little time, see `_unseen`."""
    return world.createVisualShape(pybullet.GEOM_BOX, halfExtents=[0.005] * 3)


def _ball_body(world: BulletClient, ball: Ball, mass: float) -> int:
    shape = world.createCollisionShape(pybullet.GEOM_SPHERE, radius=ball.radius)
    body = world.createMultiBody(mass, shape, small_box(world))
    inertia = [ball.inertia * mass / ball.mass] * 3
    world.changeDynamics(
        body, -1, restitution=ball.restitution, linearDamping=0, angularDamping=0, rollingFriction=1e-3,
        localInertiaDiagonal=inertia, ccdSweptSphereRadius=ball.radius / 2,
    )  # fmt: skip
    return body


def _checked_basket(position: np.ndarray) -> np.ndarray:
    position = np.array(position, dtype=float)
    if position.shape != (3,) or not np.isfinite(position).all():
        raise ValueError(
            f"basket position {position} is not three finite numbers: give the centre of the rim"
            " in metres"
        )
    return position
