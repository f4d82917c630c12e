"""A workbench beside the simulated arm: a part that stands on a table, and a holder into which it
fits.

The part touches table and holder, with friction; a part that is put in askew jams. The fingers are
not modelled: a hand that closes around the part holds it as it found it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.arm import ArmDescription, ready_posture, the_arm, with_box
from dart_skill.common.constants import UNTURNED
from dart_skill.simulation._arm_in_world import small_box
from dart_skill.simulation._bullet import BulletClient, pybullet
from dart_skill.simulation._plant import Plant, PlantState, in_principal_axes
from dart_skill.simulation._plant_settings import PlantSettings

Pose = tuple[np.ndarray, np.ndarray]
"""Position (3,) [m] and quaternion (4,)."""
Boxes = tuple[list[list[float]], list[list[float]], list[list[float]]]
"""Half sizes [m], centres [m] and quaternions of the boxes of a body, in its frame."""
UPRIGHT = list(UNTURNED)
"""Quaternion of a box that stands as its body does."""
DOWN = np.array([0.0, 1.0, 0.0, 0.0])
"""A part that stands is seen from a hand that points down with its z axis against the hand's: half
a turn about y.
"""
GRASPED = 0.02
"""Distance of the part from its place in the hand up to which closing fingers get hold of it [m]."""
ALONG = 0.2
"""Lean of the part in the hand up to which closing fingers get hold of it [rad]."""
IN = 0.003
"""A part whose origin is nearer to where it ends along the holder's axis is in it [m]."""


HAND_AT, HAND_TURN = (0.43, -0.36, 1.34), (1.0773, 2.9511, 0.0)
"""Pose of a hand around the part, for arms without a posture of that name: place [m] and rotation
vector [rad], its x axis towards the base.
"""


@dataclass(frozen=True)
class Bench:
    """What stands on the table.

    Parameters
    ----------
    start_posture
        Of an arm whose hand is around the part, pointing down (n,) [rad]; default: its posture
        `bench`. Part and table stand below it.
    size
        Of the part, a box (3,) [m]; its origin is its centre, its z axis points up.
    mass
        Of the part [kg].
    grasp
        Of the part's centre in the frame of the hand (3,) [m].
    clearance
        Between part and holder, on each side [m].
    depth
        Of the holder [m].
    wall
        Thickness of its walls [m].
    friction
        Between part, holder and table.
    part_spread, part_turn
        Standard deviations of where the part stands [m], and of how it is turned [rad].
    holder
        Where the holder stands, upright, until somebody puts it elsewhere (3,) [m].
    """

    start_posture: tuple[float, ...] = field(
        default_factory=lambda: ready_posture("bench", HAND_AT, HAND_TURN)
    )
    size: tuple[float, float, float] = (0.05, 0.05, 0.10)
    mass: float = 0.35
    grasp: tuple[float, float, float] = (0.0, 0.0, 0.14)
    clearance: float = 0.003
    depth: float = 0.04
    wall: float = 0.01
    friction: float = 0.4
    part_spread: float = 0.003
    part_turn: float = 0.03
    holder: tuple[float, float, float] = (0.6, 0.1, 1.1602)

    @property
    def inertia(self) -> np.ndarray:
        """Inertia of the part about its axes (3,) [kg m^2]."""
        square = np.square(self.size)
        return self.mass / 12.0 * (square.sum() - square)

    def loaded(self, description: ArmDescription) -> ArmDescription:
        """The arm with the part as what its hand may hold."""
        return with_box(description, self.mass, self.size, self.grasp)


class Workbench(Plant):
    """The arm with a bench. `reset` puts the part back, around which the open hand is, and the
    holder where it is wanted.
    """

    def __init__(
        self, bench: Bench | None = None, settings: PlantSettings | None = None, seed: int = 0
    ):
        self.bench = bench or Bench()
        self._holder: Pose = np.array(self.bench.holder), np.array([0.0, 0.0, 0.0, 1.0])
        own = replace(settings or PlantSettings(), start_posture=self.bench.start_posture)
        super().__init__(own, seed, self.bench.loaded(the_arm()))

    loose_body, movable_body = "part", "holder"

    def change(self, settings: PlantSettings) -> None:
        """See `Plant`; the posture in which the hand is around the part stays."""
        super().change(replace(settings, start_posture=self.bench.start_posture))

    def set_up(
        self, poses: Mapping[str, Pose], numbers: Mapping[str, float] | None = None
    ) -> PlantState:
        """See `Plant`."""
        self._check_situation(poses, numbers or {})
        if poses:
            self.stand(poses[self.movable_body])
        return self.reset()

    def put(self, role: str, position: np.ndarray, quaternion: np.ndarray) -> None:
        """See `Plant`.

        Parameters
        ----------
        position
            Of the body (3,) [m].
        """
        self._check_situation([role])
        self.stand((position, quaternion))
        self._world.resetBasePositionAndOrientation(
            self._holder_body, self._holder[0].tolist(), self._holder[1].tolist()
        )

    @property
    def succeeded(self) -> bool:
        """Whether the part lies in the holder, and is not held."""
        turn = Rotation.from_quat(self._holder[1])
        local = turn.inv().apply(np.array(self._loose.position) - self._holder[0])
        seat = 0.5 * self.bench.size[2]
        return self._held is None and bool(
            np.hypot(*local[:2]) < 2.0 * self.bench.clearance and abs(local[2] - seat) < IN
        )

    def stand(self, holder: Pose) -> None:
        """From the next reset on the holder stands at a pose: the centre of its floor, its z axis
        along its opening.
        """
        self._holder = np.array(holder[0], dtype=float), np.array(holder[1], dtype=float)

    @property
    def bodies(self) -> dict[str, Pose]:
        """True poses of what the cameras track."""
        return {
            "hand": (self.hand_position, self.hand_quaternion),
            self.loose_body: (np.array(self._loose.position), np.array(self._loose.quaternion)),
            self.movable_body: self._holder,
        }

    @property
    def table(self) -> float:
        """Height of its top [m]."""
        return self._table

    @property
    def holds(self) -> bool:
        """Whether the part is in the hand."""
        return self._held is not None

    @property
    def pressing(self) -> np.ndarray:
        """Force (3,) with which a part that is held presses against the holder [N], by the engine;
        0 where it is not held.
        """
        if self._held is None:
            return np.zeros(3)
        force = np.zeros(3)
        for contact in self._world.getContactPoints(self._ball, self._holder_body):
            for size, direction in ((9, 7), (10, 11), (12, 13)):
                force -= contact[size] * np.array(contact[direction])
        return force

    # what is different from an arm with a ball

    def _build_things(self, world: BulletClient) -> None:
        b = self.bench
        hand = world.getLinkState(self._arm, self._hand_link, computeForwardKinematics=1)
        turn = Rotation.from_quat(hand[5])
        stands = (
            np.array(hand[4])
            + turn.apply(b.grasp)
            + b.part_spread * np.append(self._scatter.standard_normal(2), 0.0)
        )
        up = turn * Rotation.from_quat(DOWN)
        yaw = np.arctan2(*up.as_matrix()[1::-1, 0]) + b.part_turn * self._scatter.standard_normal()
        self._table = float(stands[2] - 0.5 * b.size[2])
        self._ball_mass = b.mass
        shape = world.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=[0.5 * side for side in b.size]
        )
        self._ball = world.createMultiBody(
            b.mass,
            shape,
            small_box(world),
            stands.tolist(),
            [0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)],
        )
        world.changeDynamics(
            self._ball, -1, restitution=0.0, lateralFriction=b.friction, linearDamping=0, angularDamping=0,
            localInertiaDiagonal=b.inertia.tolist(),
        )  # fmt: skip
        self._fixed(world, [[0.45, 0.9, 0.02]], [[0.8, 0.0, self._table - 0.02]], [UPRIGHT])
        self._holder_body = self._fixed(world, *self._walls(), pose=self._holder)

    def _walls(self) -> Boxes:
        """Half sizes, centres and quaternions of the boxes that a holder is made of, in its own
        frame: a floor and four walls.
        """
        b = self.bench
        inner = 0.5 * np.array(b.size[:2]) + b.clearance
        outer, half = inner + b.wall, 0.5 * b.depth
        sizes = (
            [[*outer, 0.5 * b.wall]]
            + 2 * [[0.5 * b.wall, outer[1], half]]
            + 2 * [[inner[0], 0.5 * b.wall, half]]
        )
        x, y = inner + 0.5 * b.wall
        centres = [
            [0.0, 0.0, -0.5 * b.wall],
            [x, 0.0, half],
            [-x, 0.0, half],
            [0.0, y, half],
            [0.0, -y, half],
        ]
        return sizes, centres, [UPRIGHT] * len(sizes)

    def _fixed(
        self,
        world: BulletClient,
        sizes: list[list[float]],
        centres: list[list[float]],
        turns: list[list[float]],
        pose: Pose | None = None,
    ) -> int:
        """A body of boxes that nothing moves."""
        shape = world.createCollisionShapeArray(
            [pybullet.GEOM_BOX] * len(sizes),
            halfExtents=sizes,
            collisionFramePositions=centres,
            collisionFrameOrientations=turns,
        )
        position, quaternion = pose or (np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
        body = world.createMultiBody(0, shape, -1, position.tolist(), quaternion.tolist())
        world.changeDynamics(body, -1, restitution=0.0, lateralFriction=self.bench.friction)
        return body

    def _fill_hand(self) -> None:
        """An episode begins with an open hand around the part."""
        self._held, self._free_at, self._just_freed, self._stuck = None, None, False, False
        self._set_touchable(False)

    def close_hand(self) -> bool:
        """Close the hand.

        Returns
        -------
        bool
            Whether it now holds the part: only if the part is between the fingers.
        """
        self._free_at = None
        if self._held is None and self._is_between_the_fingers():
            self._grasp()
        return self._held is not None

    def _seen_from_hand(self) -> tuple[np.ndarray, Rotation]:
        """Place (3,) of the part in the frame of the hand, and its turn."""
        back = Rotation.from_quat(self.hand_quaternion).inv()
        return back.apply(
            np.array(self._loose.position) - self.hand_position
        ), back * Rotation.from_quat(self._loose.quaternion)

    def _is_between_the_fingers(self) -> bool:
        place, turn = self._seen_from_hand()
        leans = np.arccos(np.clip(-turn.as_matrix()[2, 2], -1.0, 1.0))
        return float(np.linalg.norm(place - self.bench.grasp)) < GRASPED and leans < ALONG

    def _grasp(self) -> None:
        place, turn = self._seen_from_hand()
        hand = self._world.getLinkState(self._arm, self._hand_link, computeForwardKinematics=1)
        offset, back = in_principal_axes(hand, place)
        local = Rotation.from_quat(back) * turn
        self._held = self._world.createConstraint(
            self._arm,
            self._hand_link,
            self._ball,
            -1,
            pybullet.JOINT_FIXED,
            [0, 0, 0],
            offset,
            [0, 0, 0],
            local.as_quat().tolist(),
        )

    def _scatter_release(self) -> None:
        """Fingers that open leave the part where it is."""

    def _act_on_ball(self) -> None:
        """Nothing but gravity and what it touches acts on the part."""
