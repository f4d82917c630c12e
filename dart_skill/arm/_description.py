"""What an arm with its hand is: lengths, masses, motors, limits, shapes. A Barrett WAM with a
BarrettHand is read from config/wam.yaml, every other arm from its URDF (`_described_arm`).

Everything that needs a number of the arm takes it from here: the URDF, the analytic model, the
limits and the occlusion model.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.arm._arm_files import WAM_FILE
from dart_skill.common import flight
from dart_skill.common.configuration import read_yaml
from dart_skill.common.quaternions import product
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
    rpy
        Turn of the frame in that of the parent (3,): about its fixed axes x, y and z, in this
        order [rad].
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
    rpy: np.ndarray
    lower: float
    upper: float
    peak_torque: float
    no_load_speed: float
    coulomb_friction: float
    viscous_friction: float

    @property
    def rotation(self) -> np.ndarray:
        """The turn `rpy` (3, 3)."""
        return rotation_of(self.rpy)


def rotation_of(rpy: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) about the fixed axes x, y and z by three angles (3,) [rad], in this order.
    Quarter turns are exact.
    """
    (cr, cp, cy), (sr, sp, sy) = np.round([np.cos(rpy), np.sin(rpy)], 15)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def quaternion_of(rpy: np.ndarray) -> np.ndarray:
    """Quaternion (4,) of the same turns as `rotation_of`."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy / 2), np.cos(rpy / 2)
    about_x, about_y, about_z = [sr, 0.0, 0.0, cr], [0.0, sp, 0.0, cp], [0.0, 0.0, sy, cy]
    return product(np.array(about_z), product(np.array(about_y), np.array(about_x)))


@dataclass(frozen=True)
class Capsule:
    """A shape of the arm: a cylinder with round ends between two points of a link's frame [m]."""

    link: str
    start: np.ndarray
    end: np.ndarray
    radius: float


@dataclass(frozen=True)
class Hand:
    """The hand, closed on a ball, as one body in its own frame, out of which z points.

    Parameters
    ----------
    link
        Name of its frame.
    inertial
        Its mass, centre of mass and inertia.
    ball_centre
        Of a held ball (3,) [m].
    """

    link: str
    inertial: Inertial
    ball_centre: np.ndarray


@dataclass(frozen=True)
class Motors:
    """Motors and transmission; one row or entry for each motor.

    Parameters
    ----------
    joint_to_motor
        (n, n), motor angle = joint_to_motor @ joint angle.
    rotor_inertia
        (n,) [kg m^2].
    stall_torque
        Of a motor at standstill and full voltage (n,) [N m].
    no_load_speed
        (n,) at the full voltage [rad/s].
    """

    joint_to_motor: np.ndarray
    rotor_inertia: np.ndarray
    stall_torque: np.ndarray
    no_load_speed: np.ndarray

    @property
    def reflected_inertia(self) -> np.ndarray:
        """Rotor inertia as the joints feel it, N' J N (n, n) [kg m^2]."""
        return self.joint_to_motor.T @ np.diag(self.rotor_inertia) @ self.joint_to_motor


@dataclass(frozen=True)
class ServoGains:
    """Springs and dampers of the joints between motions, and along those that are fed forward.

    Parameters
    ----------
    stiffness, damping
        That hold a posture (n,) [N m/rad], [N m s/rad].
    limit
        Of their torque (n,) [N m].
    following_stiffness, following_damping
        Along a motion whose torques are fed forward (n,).
    ahead
        The springs act as if it were so much later, by the model's inertia [s] ("stable PD", Tan,
        Liu and Turk 2011); 0: as it is.
    """

    stiffness: np.ndarray
    damping: np.ndarray
    limit: np.ndarray
    following_stiffness: np.ndarray
    following_damping: np.ndarray
    ahead: float = 0.0


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
class ArmSwing:
    """A throw in the vertical plane in which m joints of the arm move the hand.

    Parameters
    ----------
    joints
        Indices of these joints (m,).
    cocked, release
        Their angles before the swing and at the release (m,) [rad].
    rates
        Their speeds at the release, for the fastest throw (m,) [rad/s].
    rest
        Angles of all joints (n,) [rad] with which the arm throws along the x axis of its base; the
        first of them turns it about the vertical.
    duration
        From the start to the release [s].
    """

    joints: np.ndarray
    cocked: np.ndarray
    release: np.ndarray
    rates: np.ndarray
    rest: np.ndarray
    duration: float


@dataclass(frozen=True)
class ArmDescription:
    """An arm with n joints, and what its hand holds.

    Parameters
    ----------
    name
        Of the arm, as in config/arms/.
    mount_height
        Of the base above the floor [m].
    shoulder_height
        Of the shoulder above the base [m].
    gravity
        [m/s^2].
    joints
        From the base to the hand.
    tool_plate, tool_rpy
        Origin of the hand's frame in that of the last link (3,) [m], and how it is turned there
        (3,), as `Joint.rpy` [rad].
    links_urdf
        The links, in the frames of their joints.
    hand
        The hand with a ball in it.
    motors
        Motors and transmission.
    servo
        Gains of the joints' servo.
    elbow
        Number of the joint, from 1 on, at whose origin the elbow is.
    swinging
        Whether a joint moves the hand in the vertical plane of a throw (n,).
    knows_friction
        Whether the friction of the joints was measured; what is assumed is not compensated.
    reach
        Distance from the shoulder to the hand's frame of the stretched arm [m].
    ball
        The ball that is thrown.
    capsules
        Shapes of the links that are seen, collide and hide what is behind them.
    postures
        Joint angles (n,) [rad] of postures with names; `home` is one.
    dh, links_dh
        Of Denavit and Hartenberg (n, 3): alpha [rad], a [m], d [m]; and the links in these frames.
        None: the model of the controller is made from `joints`, too.
    """

    name: str
    mount_height: float
    shoulder_height: float
    gravity: float
    joints: tuple[Joint, ...]
    tool_plate: np.ndarray
    links_urdf: tuple[Inertial, ...]
    hand: Hand
    motors: Motors
    servo: ServoGains
    elbow: int
    swinging: np.ndarray
    reach: float
    ball: HeldBall
    capsules: tuple[Capsule, ...]
    postures: Mapping[str, np.ndarray]
    knows_friction: bool = True
    tool_rpy: np.ndarray = field(default_factory=lambda: np.zeros(3))
    dh: np.ndarray | None = None
    links_dh: tuple[Inertial, ...] = ()

    @property
    def home(self) -> np.ndarray:
        """Joint angles of the home pose (n,) [rad]."""
        return self.postures["home"]

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @cached_property
    def turns(self) -> np.ndarray:
        """Quaternions (n, 4) of `Joint.rpy`."""
        return np.array([quaternion_of(joint.rpy) for joint in self.joints])

    @property
    def shoulder(self) -> np.ndarray:
        """Centre of the shoulder in the world (3,) [m]."""
        return np.array([0.0, 0.0, self.mount_height + self.shoulder_height])

    @cached_property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper ends of the joints' ranges (n,) each [rad]."""
        return self.of_joints("lower"), self.of_joints("upper")

    def of_joints(self, field: str) -> np.ndarray:
        """One field of all joints as an array (n,), for example "peak_torque"."""
        return np.array([getattr(joint, field) for joint in self.joints])


def with_box(
    description: ArmDescription, mass: float, size: Sequence[float], centre: Sequence[float]
) -> ArmDescription:
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


def read_description(path: Path) -> ArmDescription:
    """The description of a file that is made as config/wam.yaml is.

    Raises
    ------
    ConfigurationError
        Names the file, the entry and what it must be.
    """
    content = read_yaml(path)
    WAM_FILE.check(content, str(path))
    return parse_description(content)


def parse_description(content: dict) -> ArmDescription:
    """The description from the nested dictionaries of a wam.yaml.

    Raises
    ------
    KeyError
        Names what is missing.
    """
    links, dh = content["links"], _dh(content["dh"])
    gains: Any = {name: np.array(row) for name, row in content["servo"].items()}
    return ArmDescription(
        name="wam",
        mount_height=content["mount_height"],
        shoulder_height=content["shoulder_height"],
        gravity=content["gravity"],
        dh=dh,
        joints=tuple(_joint(entry) for entry in content["joints"]),
        tool_plate=np.array(content["tool_plate"]["xyz"]),
        links_urdf=tuple(_inertial(link["mass"], link["urdf"]) for link in links),
        links_dh=tuple(_inertial(link["mass"], link["dh"]) for link in links),
        hand=_hand(content["hand"]),
        motors=_motors(content["transmission"], content["motors"]),
        servo=ServoGains(**gains),
        elbow=content["elbow"],
        swinging=np.isin(np.arange(len(links)) + 1, content["swing"]["joints"]),
        reach=_reach(dh),
        ball=HeldBall.of(the_world()),
        capsules=tuple(
            Capsule(c["link"], np.array(c["from"]), np.array(c["to"]), c["radius"])
            for c in content["capsules"]
        ),
        postures={name: np.array(row) for name, row in content["poses"].items()},
    )


def parse_swing(entry: Mapping, n_joints: int) -> ArmSwing:
    """How a person throws with an arm, from the entry `swing` of its file."""
    cocked, release, rates = (np.array(entry[key]) for key in ("cocked", "release", "rates"))
    rest = np.array(entry.get("rest", np.zeros(n_joints)), dtype=float)
    joints, duration = np.array(entry["joints"]) - 1, float(entry["duration"])
    return ArmSwing(joints, cocked, release, rates, rest, duration)


def _dh(rows: list[dict]) -> np.ndarray:
    return np.array([(row["alpha_quarter_turns"] * np.pi / 2, row["a"], row["d"]) for row in rows])


def _reach(dh: np.ndarray) -> float:
    """Reach of the stretched arm [m], whose elbow is offset from both its links."""
    (_, _, _), _, (_, offset, upper), (_, back, _), (_, _, fore), _, (_, _, wrist) = dh
    return float(np.hypot(upper, offset) + np.hypot(fore, back) + wrist)


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
    rpy = np.array([entry["roll_quarter_turns"] * np.pi / 2, 0.0, 0.0])
    return Joint(xyz=np.array(entry["xyz"]), rpy=rpy, **fields)


def _hand(entry: dict) -> Hand:
    inertial = _inertial(entry["mass"], entry)
    return Hand(
        "bhand_base",
        inertial,
        np.array(entry["ball_centre"]),
    )


def _motors(transmission: dict, motors: dict) -> Motors:
    constant, resistance = np.array(motors["torque_constant"]), np.array(motors["resistance"])
    return Motors(
        np.array(transmission["joint_to_motor"]),
        np.array(transmission["rotor_inertia"]),
        constant * motors["bus_voltage"] / resistance,
        np.array(motors["no_load_speed"]),
    )
