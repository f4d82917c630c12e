"""How a simulated arm and its world differ from a perfect one, with the targets in it.

The basket is a real body with a floor, walls and a rim. The ball is in, or it is not. What meets
the face of the dart board sticks there, seen by the cameras like a ball is.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any
from xml.etree import ElementTree

import numpy as np

from dart_skill.arm import SafetyLimits
from dart_skill.common.arm_choice import joint_count
from dart_skill.common.surface import BOARD_DIAMETER, BoardFace
from dart_skill.common.world import the_world

OF_EACH_JOINT = ("start_posture", "mass_scale", "joint_stiffness", "joint_offset")
"""Settings with a number for each joint."""
HEAVIEST = 10.0
"""Largest factor on the mass of a link: the motors hold no more."""
STIFFEST = 1e6
"""Largest stiffness of a cable [N m/rad]; 0 stands for a rigid one."""
NO_PARAMETERS = ("step_ns", "reset_ns", "hand_clearance", "basket", "board", "limits")
"""Settings that are no parameters of the simulator of that name."""


def _of_all(values: Iterable[float]) -> tuple[float, ...]:
    """A number for every joint of the arm; one stands for all of them."""
    told = tuple(float(value) for value in values)
    return told * joint_count() if len(told) == 1 else told


def each_joint(value: float) -> Any:
    """A field of a dataclass that is the same number for every joint of the arm."""
    return field(default_factory=lambda: (value,) * joint_count())


@dataclass(frozen=True)
class Basket:
    """An upright cylinder, open at the top.

    Parameters
    ----------
    position
        Centre of the rim (3,) [m].
    radius
        Of the free opening, default that of config/world.yaml [m].
    depth
        From the rim to the floor, default that of config/world.yaml [m].
    wall, rim
        Thickness of the wall, and diameter of the tube around the rim [m].
    restitution
        Of walls and floor, 0 to 1.
    sides
        Of the polygon that stands for the circle.
    """

    position: tuple[float, float, float] = (2.0, 0.0, the_world().rim)
    radius: float = the_world().basket_radius
    depth: float = the_world().basket_depth
    wall: float = 0.01
    rim: float = 0.012
    restitution: float = 0.3
    sides: int = 24

    def holds(self, point: np.ndarray, position: np.ndarray) -> bool:
        """Whether the point (3,) is inside the walls and below the rim of a basket at position
        (3,).
        """
        x, y, z = np.subtract(point, position).tolist()
        return x * x + y * y < self.radius**2 and -self.depth - self.wall < z < 0.0


def basket_urdf(basket: Basket) -> str:
    """URDF text of a fixed basket: a ring of boxes for the walls, a ring of capsules for the rim,
    a disc for the floor.

    PyBullet's own compound shapes hold at most 16 parts; a URDF link holds any number.
    """
    robot = ElementTree.Element("robot", name="basket")
    link = ElementTree.SubElement(robot, "link", name="basket")
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value="1.0")
    ElementTree.SubElement(
        inertial, "inertia", ixx="0.01", ixy="0", ixz="0", iyy="0.01", iyz="0", izz="0.01"
    )
    side = 2 * np.tan(np.pi / basket.sides)
    wall, rim = basket.radius + basket.wall / 2, basket.radius + basket.rim / 2
    outside = basket.radius + basket.wall
    for angle in 2 * np.pi * np.arange(basket.sides) / basket.sides:
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        size = f"{basket.wall!r} {float(outside * side)!r} {basket.depth!r}"
        _part(link, wall * direction - [0, 0, basket.depth / 2], (0, 0, angle), "box", size=size)
        _part(
            link, rim * direction, (np.pi / 2, 0, angle), "capsule",
            radius=repr(basket.rim / 2), length=repr(float(rim * side)),
        )  # fmt: skip
    floor = np.array([0, 0, -basket.depth - basket.wall / 2])
    _part(link, floor, (0, 0, 0), "cylinder", radius=repr(basket.radius), length=repr(basket.wall))
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _part(
    link: ElementTree.Element, xyz: Iterable[float], rpy: Iterable[float], shape: str, **sizes: str
) -> None:
    for kind in ("visual", "collision"):
        element = ElementTree.SubElement(link, kind)
        text = {
            "xyz": " ".join(repr(float(v)) for v in xyz),
            "rpy": " ".join(repr(float(v)) for v in rpy),
        }
        ElementTree.SubElement(element, "origin", text)
        ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), shape, sizes)


@dataclass(frozen=True)
class Board:
    """A round board that faces the arm's base axis; its position is the bull's centre on the face.

    The default, of config/world.yaml, is regulation: the bull 1.73 m above the floor, 2.37 m from
    where the thrower stands, the base axis.

    Parameters
    ----------
    thickness : [m]
        Of what the cameras cannot see through.
    """

    position: tuple[float, float, float] = the_world().board_position
    thickness: float = 0.038

    @cached_property
    def face(self) -> BoardFace:
        return BoardFace(self.position)

    def hit(self, before: np.ndarray, after: np.ndarray) -> np.ndarray | None:
        """Where a dart that moved from one point (3,) to another met the face of the board (3,),
        if it did.

        Parameters
        ----------
        before, after
            The two points.
        """
        face = self.face
        first, last = (face.distance - point @ face.normal for point in (before, after))
        if not first > 0.0 >= last:
            return None
        point = before + first / (first - last) * (after - before)
        return point if face.holds(point) else None

    @cached_property
    def capsules(self) -> tuple[np.ndarray, np.ndarray]:
        """The board as upright rods behind its face: ends (c, 2, 3) and radii (c,), to hide things
        from cameras.
        """
        face, radius = self.face, 0.5 * self.thickness
        aside = np.arange(-5, 6) * self.thickness
        half = np.sqrt(np.maximum((0.5 * BOARD_DIAMETER) ** 2 - aside**2, 0.0)) - radius
        middle = np.array(self.position) + radius * face.normal + aside[:, None] * face.axes[:, 1]
        up = half[:, None] * face.axes[:, 0]
        return np.stack([middle - up, middle + up], axis=1), np.full(len(aside), radius)


@dataclass(frozen=True)
class PlantSettings:
    """How the stand-in differs from a perfect arm; each value is a parameter of the simulator
    node.

    Parameters
    ----------
    step_ns
        Control period [ns].
    reset_ns
        How far a reset moves the clock on, so that everybody notices the gap [ns].
    start_posture
        Joint angles after a reset (n,) [rad].
    gravity_error
        Share of the gravity torque that compensation misses; calibrated arms show 5 %
        (docs/sources.md).
    friction_scale, motor_scale
        Factors on the joint friction, and on what the motors can do.
    base_turn
        The arm's base stands turned about the vertical, which the controller does not know [rad].
    hand_delay, hand_spread
        Mean and standard deviation of the time from the command to the ball being free [s].
    hand_clearance
        A released ball that is farther from the hand than this can touch the hand again [m].
    basket
        Where balls are thrown.
    ball_mass_scale, ball_drag_scale
        Factors on the mass and on the drag of the ball.
    mass_scale
        Factors on the masses of the links (n,).
    stiction
        What static friction is more than Coulomb friction, as a share of it.
    joint_stiffness
        Of the cables between motors and links (n,) [N m/rad]; all 0: rigid. Encoders sit on the
        motors.
    joint_offset
        What the encoders read too high (n,) [rad].
    encoder_step
        Of an angle [rad]; 0: none.
    speed_filter
        Corner of the low-pass on the speeds [rad/s]; 0: speeds are exact.
    command_delay
        Control periods until a command acts.
    seat_spread
        Standard deviation of a coordinate of where the ball sits in the hand [m].
    release_turn, release_speed
        Standard deviations of the direction [rad] and of the speed, as a share, with which it
        leaves the hand.
    board
        Where there is one, darts are thrown at it, and there is no basket.
    limits
        That the arm's own safety module watches; None: it has none.
    """

    step_ns: int = 2_000_000
    reset_ns: int = 1_000_000_000
    start_posture: tuple[float, ...] = each_joint(0.0)
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
    mass_scale: tuple[float, ...] = each_joint(1.0)
    stiction: float = 0.0
    joint_stiffness: tuple[float, ...] = each_joint(0.0)
    joint_offset: tuple[float, ...] = each_joint(0.0)
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
        """Settings from the parameters of the simulator node.

        Raises
        ------
        ValueError
            Names a value that makes no sense.
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
        each = {name: _of_all(own[name]) for name in OF_EACH_JOINT}
        return cls(
            basket=basket, limits=SafetyLimits.from_parameters(parameters), **{**own, **each}
        )

    def __post_init__(self) -> None:
        for name in OF_EACH_JOINT:
            values = getattr(self, name)
            if len(values) != joint_count() or not np.isfinite(values).all():
                raise ValueError(f"{name} {values} is not {joint_count()} finite numbers")
        if not (0.0 < min(self.mass_scale) and max(self.mass_scale) <= HEAVIEST):
            raise ValueError(
                f"mass_scale {self.mass_scale} must be positive, and {HEAVIEST:g} at most"
            )
        if max(self.joint_stiffness) > STIFFEST:
            raise ValueError(
                f"joint_stiffness {self.joint_stiffness} is above {STIFFEST:g} N m/rad"
            )
        if np.abs(self.joint_offset).max() > np.pi:
            raise ValueError(f"joint_offset {self.joint_offset} is more than half a turn")
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
