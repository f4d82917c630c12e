"""What a Barrett WAM with a BarrettHand is: lengths, masses, motors, limits, shapes, read from
config/wam.yaml.

Everything that needs a number of the arm takes it from here: the URDF, the analytic model, the
limits and the occlusion model.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from dart_skill.common import flight
from dart_skill.common.configuration import load_yaml
from dart_skill.common.world import World, the_world


@dataclass(frozen=True)
class Inertial:
    """Inertial parameters of a link, in the link's frame.

    Parameters
    ----------
    mass
        [kg].
    centre
        (3,) [m], the centre of mass.
    inertia
        (3, 3) [kg m^2], about the centre of mass.
    """

    mass: float
    centre: np.ndarray
    inertia: np.ndarray


@dataclass(frozen=True)
class Joint:
    """A revolute joint as URDF has it; it turns about the z axis of its own frame.

    Parameters
    ----------
    name, parent, child
        Names of the joint and of the links that it connects.
    xyz
        Origin in the frame of the parent (3,) [m].
    roll
        Turn of the frame about the parent's x axis [rad].
    lower, upper
        Ends of its range [rad].
    peak_torque
        Of motor and transmission [N m].
    no_load_speed
        At the full voltage of the bus [rad/s].
    coulomb_friction, viscous_friction
        [N m] and [N m s/rad].
    """

    name: str
    parent: str
    child: str
    xyz: np.ndarray
    roll: float
    lower: float
    upper: float
    peak_torque: float
    no_load_speed: float
    coulomb_friction: float
    viscous_friction: float


@dataclass(frozen=True)
class Capsule:
    """A shape of the arm: a cylinder with round ends between two points of a link's frame [m]."""

    link: str
    start: np.ndarray
    end: np.ndarray
    radius: float


@dataclass(frozen=True)
class Hand:
    """The BarrettHand, closed on a ball, as one body in the frame bhand_base.

    Parameters
    ----------
    inertial
        Its mass, centre of mass and inertia.
    palm_height
        Of the palm above the mounting face [m].
    palm_radius
        Of the palm [m].
    ball_centre
        Of a held ball (3,) [m].
    """

    inertial: Inertial
    palm_height: float
    palm_radius: float
    ball_centre: np.ndarray


@dataclass(frozen=True)
class Motors:
    """Motors and transmission; one row or entry for each motor.

    Parameters
    ----------
    joint_to_motor
        (7, 7), motor angle = joint_to_motor @ joint angle.
    rotor_inertia
        (7,) [kg m^2].
    torque_constant
        (7,) [N m/A].
    resistance
        (7,) [ohm].
    no_load_speed
        (7,) at the voltage of the bus [rad/s].
    bus_voltage
        [V].
    """

    joint_to_motor: np.ndarray
    rotor_inertia: np.ndarray
    torque_constant: np.ndarray
    resistance: np.ndarray
    no_load_speed: np.ndarray
    bus_voltage: float

    @property
    def reflected_inertia(self) -> np.ndarray:
        """Rotor inertia as the joints feel it, N' J N (7, 7) [kg m^2]."""
        return self.joint_to_motor.T @ np.diag(self.rotor_inertia) @ self.joint_to_motor

    @property
    def stall_torque(self) -> np.ndarray:
        """Motor torque at standstill and full bus voltage (7,) [N m]."""
        return self.torque_constant * self.bus_voltage / self.resistance


@dataclass(frozen=True)
class HeldBall:
    """The ball, or what else is in the hand.

    Parameters
    ----------
    mass
        [kg].
    diameter
        [m].
    restitution
        Share of its speed that is left after it bounced.
    drag_coefficient
        Of a sphere, without a unit.
    inertia
        About any axis through its centre [kg m^2].
    """

    mass: float
    diameter: float
    restitution: float
    drag_coefficient: float
    inertia: float

    @classmethod
    def of(cls, world: World) -> "HeldBall":
        """The ball of a world."""
        return cls(
            world.ball_mass,
            world.ball_diameter,
            world.ball_restitution,
            world.ball_drag_coefficient,
            world.ball_inertia,
        )

    @property
    def radius(self) -> float:
        return self.diameter / 2


@dataclass(frozen=True)
class WamDescription:
    """All of config/wam.yaml, and the ball of config/world.yaml.

    Parameters
    ----------
    mount_height
        Of the base above the floor [m].
    shoulder_height
        Of the shoulder above the base [m].
    gravity
        [m/s^2].
    dh
        (7, 3) of Denavit and Hartenberg: alpha [rad], a [m], d [m].
    joints
        The seven joints, from the base to the hand.
    tool_plate
        (3,) origin of the mounting face in the frame of the last link [m].
    links_urdf, links_dh
        The links, in the frames of the URDF and in those of Denavit and Hartenberg.
    hand
        The hand with a ball in it.
    motors
        Motors and transmission.
    ball
        The ball that is thrown.
    capsules
        Shapes of the links that are seen, collide and hide what is behind them.
    home
        Joint angles of the home pose (7,) [rad].
    """

    mount_height: float
    shoulder_height: float
    gravity: float
    dh: np.ndarray
    joints: tuple[Joint, ...]
    tool_plate: np.ndarray
    links_urdf: tuple[Inertial, ...]
    links_dh: tuple[Inertial, ...]
    hand: Hand
    motors: Motors
    ball: HeldBall
    capsules: tuple[Capsule, ...]
    home: np.ndarray

    @property
    def shoulder(self) -> np.ndarray:
        """Centre of the shoulder in the world (3,) [m]."""
        return np.array([0.0, 0.0, self.mount_height + self.shoulder_height])

    @property
    def reach(self) -> float:
        """Distance from the shoulder to the hand frame of the stretched arm [m]; the elbow is
        offset from both its links.
        """
        (_, _, _), _, (_, offset, upper), (_, back, _), (_, _, fore), _, (_, _, wrist) = self.dh
        return float(np.hypot(upper, offset) + np.hypot(fore, back) + wrist)

    def of_joints(self, field: str) -> np.ndarray:
        """One field of all joints as an array (7,), for example "peak_torque"."""
        return np.array([getattr(joint, field) for joint in self.joints])


def with_box(
    description: WamDescription, mass: float, size: Sequence[float], centre: Sequence[float]
) -> WamDescription:
    """The arm with a solid box as what its hand may hold: mass [kg], edges (3,) [m], its centre in
    the frame of the hand (3,) [m].

    Parameters
    ----------
    size
        Its edges.
    """
    square = np.square(size)
    inertia = mass / 12.0 * (square.sum() - square)
    load = HeldBall(mass, float(size[0]), 0.0, 0.0, float(inertia.max()))
    return replace(
        description,
        ball=load,
        hand=replace(description.hand, ball_centre=np.array(centre, dtype=float)),
    )


DART = HeldBall(
    mass=flight.DART.mass,
    diameter=flight.DART.diameter,
    restitution=0.1,
    drag_coefficient=flight.DART.drag_coefficient,
    inertia=2e-5,
)
"""A dart as the hand holds and throws it. Inertia: of a rod with its mass and a length of 10 cm
[kg m^2].
"""


@cache
def wam_description() -> WamDescription:
    """The arm of config/wam.yaml."""
    return parse_description(load_yaml("wam.yaml"))


def parse_description(content: dict) -> WamDescription:
    """The description from the nested dictionaries of a wam.yaml.

    Raises
    ------
    KeyError
        Names what is missing.
    """
    links = content["links"]
    return WamDescription(
        mount_height=content["mount_height"],
        shoulder_height=content["shoulder_height"],
        gravity=content["gravity"],
        dh=np.array(
            [(row["alpha_quarter_turns"] * np.pi / 2, row["a"], row["d"]) for row in content["dh"]]
        ),
        joints=tuple(_joint(entry) for entry in content["joints"]),
        tool_plate=np.array(content["tool_plate"]["xyz"]),
        links_urdf=tuple(_inertial(link["mass"], link["urdf"]) for link in links),
        links_dh=tuple(_inertial(link["mass"], link["dh"]) for link in links),
        hand=_hand(content["hand"]),
        motors=_motors(content["transmission"], content["motors"]),
        ball=HeldBall.of(the_world()),
        capsules=tuple(
            Capsule(c["link"], np.array(c["from"]), np.array(c["to"]), c["radius"])
            for c in content["capsules"]
        ),
        home=np.array(content["poses"]["home"]),
    )


def symmetric(entries: list[float]) -> np.ndarray:
    """Inertia tensor (3, 3) from ixx, ixy, ixz, iyy, iyz, izz."""
    ixx, ixy, ixz, iyy, iyz, izz = entries
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])


def _inertial(mass: float, entry: dict) -> Inertial:
    return Inertial(mass, np.array(entry["centre"]), symmetric(entry["inertia"]))


def _joint(entry: dict) -> Joint:
    fields = {
        key: value for key, value in entry.items() if key not in ("xyz", "roll_quarter_turns")
    }
    return Joint(
        xyz=np.array(entry["xyz"]), roll=entry["roll_quarter_turns"] * np.pi / 2, **fields
    )


def _hand(entry: dict) -> Hand:
    inertial = _inertial(entry["mass"], entry)
    return Hand(
        inertial, entry["palm_height"], entry["palm_radius"], np.array(entry["ball_centre"])
    )


def _motors(transmission: dict, motors: dict) -> Motors:
    arrays = {
        key: np.array(value)
        for key, value in {**transmission, **motors}.items()
        if key != "bus_voltage"
    }
    return Motors(bus_voltage=motors["bus_voltage"], **arrays)
