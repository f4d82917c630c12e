"""The WAM, a tennis ball and a basket in PyBullet: one pure step from a command to the next state.

The world is honest: the hand takes time to open, and the ball has drag (docs/sources.md has the
numbers).
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dart_skill.arm import (
    ArmDescription,
    ArmState,
    Command,
    Grip,
    HeldBall,
    check_command,
    check_push,
)
from dart_skill.common.constants import AIR_DENSITY
from dart_skill.common.quaternions import rotate
from dart_skill.simulation._arm_in_world import ArmInWorld, small_box, unseen
from dart_skill.simulation._bullet import BulletClient, connect, load_urdf, pybullet
from dart_skill.simulation._plant_settings import Board, PlantSettings, basket_urdf

RENEWED = 50
"""Episodes after which the physics server is a new one: PyBullet keeps 10 kB of every body that it
loads until it is disconnected.
"""


@dataclass(frozen=True)
class PlantState:
    """Everything about the world at one instant, in the axes of the world; for models of sensors
    and for tests, never for learning.

    Parameters
    ----------
    stamp_ns
        [ns].
    episode, step
        Of the world, from 0 on.
    position, velocity, effort
        Of the joints, (n,) each [rad], [rad/s], [N m].
    hand_position, hand_quaternion
        (3,) [m] and (4,).
    ball_position, ball_quaternion, ball_velocity
        (3,) [m], (4,), (3,) [m/s].
    ball_held
        Whether the ball is in the hand.
    basket
        Centre of the rim (3,) [m].
    ball_in_basket
        Whether it is there; with a board, whether the dart sticks in it.
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


class LooseState(NamedTuple):
    """State of what the hand may hold: position (3,) [m], quaternion (4,) and velocity (3,) [m/s],
    as PyBullet says them.
    """

    position: tuple[float, ...]
    quaternion: tuple[float, ...]
    velocity: tuple[float, ...]


class Plant(ArmInWorld):
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
        description: ArmDescription | None = None,
    ):
        super().__init__(settings or PlantSettings(), description)
        self._seed, self._episode = seed, 0
        self._basket = np.array((self.settings.board or self.settings.basket).position)
        self._changed: PlantSettings | None = None
        self._held: int | None = None  # the constraint between hand and ball
        self._free_at: int | None = None  # the stamp at which the hand will have opened [ns]
        self._seen_loose: LooseState | None = None  # None until it is asked for
        self.reset()

    def reset(self, basket: np.ndarray | None = None) -> PlantState:
        """Arm at rest in its start posture, ball in the hand; the world is built anew, time goes
        on. A board stays where it hangs.

        Parameters
        ----------
        basket
            Centre of its rim (3,) [m].
        """
        self._basket = self._basket if basket is None else _checked_basket(basket)
        if self._changed is not None:
            self.settings, self._changed = self._changed, None
            self._build_arm()
        if self.settings.board is not None:
            self._basket = np.array(self.settings.board.position)
        self._episode += 1
        self._stamp_ns += self.settings.reset_ns
        self._rng = np.random.default_rng([self._seed, self._episode])
        self._scatter = np.random.default_rng([self._seed, self._episode, 1])
        if self._episode % RENEWED == 0:
            self._world.disconnect()
            self._world = connect()
        self._build_arm_in_world()
        self._build_things(self._world)
        self._fill_hand()
        self._begin_arm()
        self._seen_hand = self._seen_loose = None
        return self.state

    def change(self, settings: PlantSettings) -> None:
        """From the next reset on the plant is as `settings` say: worn joints, another ball, a base
        that was pushed. Time and seed stay.

        Raises
        ------
        ValueError
            For what cannot change while it runs.
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

        Raises
        ------
        ValueError
            For a body that cannot be put anywhere, and for a number that this world does not know.
        """
        self._check_situation(poses, numbers or {})
        return self.reset(poses[self.movable_body][0] if poses else None)

    def put(self, role: str, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Put a body somewhere at once.

        Parameters
        ----------
        position
            Of the body (3,) [m].

        Raises
        ------
        ValueError
            For one that cannot be.
        """
        self._check_situation([role])
        self.place_basket(position)

    def _check_situation(self, roles: Iterable[str], numbers: Iterable[str] = ()) -> None:
        """ValueError for bodies that cannot be put somewhere, and numbers that are not known."""
        if other := sorted(set(roles) - {self.movable_body}):
            raise ValueError(
                f"this world can put the {self.movable_body} somewhere, not"
                f" {', '.join(map(repr, other))}"
            )
        if unknown := sorted(set(numbers) - set(self.numbers)):
            known = ", ".join(self.numbers) or "none"
            raise ValueError(
                f"this world knows no number {', '.join(map(repr, unknown))}; it knows {known}"
            )

    def place_basket(self, position: np.ndarray) -> None:
        """Put the basket, centre of its rim at position (3,), without touching anything else.

        Raises
        ------
        ValueError
            If there is a board instead.
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
        """Advance by one control period under the controller's command and, if a person guides the
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
        self.obey(acting.grip)
        if push is not None:
            self.obey(push.grip)
        self._let_go_when_due()
        self._drive(acting, push, is_loaded=self._held is not None)
        self._act_on_ball()
        board = None if self._held is not None or self._stuck else self.settings.board
        before = None if board is None else np.array(self._loose.position)
        self._world.stepSimulation()
        self._stamp_ns += self.settings.step_ns
        self._step_count += 1
        self._observe()
        if board is not None and before is not None:
            self._stick_to_the_board(board, before)

    # the hand and the ball

    def obey(self, grip: Grip) -> None:
        """Begin to open or close the hand, as a command with this grip does."""
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
        """Close the hand.

        Returns
        -------
        bool
            Whether it now holds the ball: only if it was never let go, or has not left the hand
            yet.
        """
        self._free_at = None
        return self._held is not None

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
            self._ball, (share * rotate(quaternion, linear)).tolist(), angular.tolist()
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
        grip = self.hand_position + rotate(self.hand_quaternion, self.description.hand.ball_centre)
        if np.linalg.norm(np.array(self._loose.position) - grip) > self.settings.hand_clearance:
            self._set_touchable(True)

    def _set_touchable(self, touchable: bool) -> None:
        for link in range(self.description.elbow, self._hand_link + 1):
            self._world.setCollisionFilterPair(self._ball, self._arm, -1, link, int(touchable))
        self._touchable = touchable

    def _fill_hand(self) -> None:
        """An episode begins with the ball in the hand."""
        hand = self._world.getLinkState(self._arm, self._hand_link, computeForwardKinematics=1)
        centre = self.description.hand.ball_centre
        if self.settings.seat_spread:
            centre = centre + self.settings.seat_spread * self._scatter.standard_normal(3)
        position = np.array(hand[4]) + rotate(np.array(hand[5]), centre)
        self._world.resetBasePositionAndOrientation(self._ball, position.tolist(), hand[5])
        offset, turn = in_principal_axes(hand, centre)
        self._held = self._world.createConstraint(
            self._arm,
            self._hand_link,
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

    def _build_things(self, world: BulletClient) -> None:
        """What there is beside arm and floor: the ball, and the basket if there is no board."""
        if self.settings.board is None:
            shape = unseen(basket_urdf(self.settings.basket))
            self._basket_body = load_urdf(world, shape, self._basket.tolist())
            world.changeDynamics(
                self._basket_body,
                -1,
                restitution=self.settings.basket.restitution,
                lateralFriction=0.5,
            )
        ball, s = self.description_of_load.ball, self.settings
        self._ball_mass = ball.mass * s.ball_mass_scale
        self._drag = (
            -0.5
            * AIR_DENSITY
            * (s.ball_drag_scale * ball.drag_coefficient)
            * (np.pi * ball.radius**2)
        )
        self._ball = _ball_body(world, ball, self._ball_mass)

    def _observe(self) -> None:
        super()._observe()
        self._seen_loose = None

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


def in_principal_axes(link_state: tuple, point: np.ndarray) -> tuple[list[float], list[float]]:
    """A point of a link, and the link's axes, in the frame that PyBullet measures from: centre of
    mass, principal axes.
    """
    centre, turn = np.array(link_state[2]), np.array(link_state[3])
    back = np.array([-turn[0], -turn[1], -turn[2], turn[3]])
    return rotate(back, point - centre).tolist(), back.tolist()


def _ball_body(world: BulletClient, ball: HeldBall, mass: float) -> int:
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
