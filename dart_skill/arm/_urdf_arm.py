"""Any arm with revolute joints, from its URDF and a file of config/arms/ that says what no URDF
does: which links are base and tool, where the hand holds, how high the arm stands, and limits that
the URDF has wrong.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from dart_skill.arm._arm_files import ARM_FILE
from dart_skill.arm._description import ServoGains, read_description
from dart_skill.arm._urdf import write_urdf
from dart_skill.common.configuration import (
    arm_path,
    config_path,
    read_yaml,
    ros_prefixes,
)
from dart_skill.common.files import open_file

TURNS = 2.0 * np.pi
"""End of the range of a joint without one, in either direction [rad]."""


@dataclass(frozen=True)
class UrdfJoint:
    """A revolute joint between base and tool, as the URDF has it.

    Parameters
    ----------
    name
        Of the joint.
    lower, upper
        Ends of its range [rad].
    velocity, torque
        Largest speed [rad/s] and torque [N m]; nan where the URDF does not say.
    friction, damping
        Of the joint [N m], [N m s/rad]; 0 where the URDF does not say.
    child
        The link that it moves.
    """

    name: str
    lower: float
    upper: float
    velocity: float
    torque: float
    friction: float
    damping: float
    child: str


@dataclass(frozen=True)
class UrdfArm:
    """An arm between its base and its tool.

    Parameters
    ----------
    name
        Of the arm.
    urdf
        Text of its URDF.
    base, tool
        Links between which its joints are.
    grip
        Where the hand holds, in the frame of the tool (3,) [m].
    turn
        How the hand is turned about the z axis of the tool [rad]; simulated persons begin with its x
        axis towards the base.
    mount_height
        Of the base above the floor [m].
    velocity_limits, torque_limits
        Limits by joint that count instead of those of the URDF [rad/s], [N m].
    rotors
        Inertia of the rotors as the joints feel it, by joint [kg m^2].
    servo
        Gains of the joints' servo that count instead of estimated ones (n,), by their names in
        `ServoGains`.
    postures
        Joint angles by name (n,) [rad].
    """

    name: str
    urdf: str
    base: str
    tool: str
    grip: np.ndarray = field(default_factory=lambda: np.zeros(3))
    turn: float = 0.0
    mount_height: float = 0.0
    velocity_limits: Mapping[str, float] = field(default_factory=dict)
    torque_limits: Mapping[str, float] = field(default_factory=dict)
    rotors: Mapping[str, float] = field(default_factory=dict)
    servo: Mapping[str, np.ndarray] = field(default_factory=dict)
    postures: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that base, tool and joints are there.

        Raises
        ------
        ValueError
            Names what is not.
        """
        names = [joint.name for joint in self.joints]
        for what, limits in (
            ("velocity", self.velocity_limits),
            ("torque", self.torque_limits),
            ("rotor_inertia", self.rotors),
        ):
            if unknown := [name for name in limits if name not in names]:
                raise ValueError(
                    f"arm {self.name}: {what} names {', '.join(unknown)}; its joints are"
                    f" {', '.join(names)}"
                )

    @cached_property
    def joints(self) -> tuple[UrdfJoint, ...]:
        """From the base to the tool."""
        return joints_between(self._robot, self.base, self.tool)

    @property
    def lower(self) -> np.ndarray:
        """Lower ends of the ranges of the joints (n,) [rad]."""
        return np.array([joint.lower for joint in self.joints])

    @property
    def upper(self) -> np.ndarray:
        """Upper ends (n,) [rad]."""
        return np.array([joint.upper for joint in self.joints])

    @property
    def speeds(self) -> np.ndarray:
        """Largest speeds of the joints (n,) [rad/s]."""
        return self._limits("velocity")

    @property
    def torques(self) -> np.ndarray:
        """Largest torques of the joints (n,) [N m]."""
        return self._limits("torque")

    @property
    def knows_friction(self) -> bool:
        """Whether the URDF says the friction of a joint."""
        return any(joint.friction or joint.damping for joint in self.joints)

    @property
    def rotor_inertia(self) -> np.ndarray:
        """Inertia of the rotors as the joints feel it (n,) [kg m^2]; 0 where nothing says it."""
        return np.array([self.rotors.get(joint.name, 0.0) for joint in self.joints])

    def _limits(self, what: str) -> np.ndarray:
        given: Mapping[str, float] = getattr(self, f"{what}_limits")
        limits = {j.name: given.get(j.name, getattr(j, what)) for j in self.joints}
        doubtful = self.placeholders and not set(limits) <= set(given)
        if missing := [name for name, limit in limits.items() if not limit > 0.0]:
            raise ValueError(
                f"arm {self.name}: the URDF gives no {what} of {', '.join(missing)}; write"
                f" `{what}: {{{missing[0]}: ...}}` into its file of config/arms/"
            )
        if doubtful:
            raise ValueError(
                f"arm {self.name}: {self.placeholders}; write the real `{what}` of every joint"
                " into its file of config/arms/"
            )
        return np.array(list(limits.values()))

    @property
    def placeholders(self) -> str:
        """Why the limits of the URDF look as if nobody had measured them, empty if they do not."""
        pairs = {(joint.velocity, joint.torque) for joint in self.joints}
        if len(self.joints) < 4 or len(pairs) > 1:
            return ""
        ((velocity, torque),) = pairs
        return (
            f"the URDF says {velocity:g} rad/s and {torque:g} N m for every joint, which is a"
            " placeholder"
        )

    @property
    def weightless(self) -> list[str]:
        """Links without an inertial, which PyBullet would give 1 kg."""
        return [
            link.get("name", "")
            for link in self._robot.findall("link")
            if link.find("inertial/mass") is None
        ]

    def doubts(self) -> list[str]:
        """What the URDF does not say, or says so that nobody can rely on it, in words."""
        unlimited = [j.name for j in self.joints if j.lower == -TURNS and j.upper == TURNS]
        silent = [
            what
            for what in ("velocity", "torque")
            if any(not getattr(j, what) > 0.0 for j in self.joints)
        ]
        given = min(len(self.velocity_limits), len(self.torque_limits)) == len(self.joints)
        limits = "give `velocity` and `torque`"
        said = [
            (bool(self.placeholders) and not given, f"{self.placeholders}: {limits}"),
            (bool(silent) and not given, f"no {' and no '.join(silent)} of some joints: {limits}"),
            (bool(unlimited), f"no range of {', '.join(unlimited)}: two turns are assumed"),
            (
                not self.knows_friction,
                "no friction of any joint: none is compensated, and some is simulated",
            ),
            (
                bool(self.weightless),
                f"no inertial of {_some(self.weightless)}: PyBullet would give each 1 kg",
            ),
        ]
        return [text for holds, text in said if holds]

    @cached_property
    def _robot(self) -> ElementTree.Element:
        return _parsed(self.urdf, self.name)

    @cached_property
    def model(self) -> pin.Model:
        """Pinocchio's model of the joints between base and tool; all others stand at zero."""
        text = ElementTree.tostring(self._robot, encoding="unicode")
        whole = pin.buildModelFromXML(text)
        moving = {joint.name for joint in self.joints}
        locked = [index for index in range(1, whole.njoints) if whole.names[index] not in moving]
        model = pin.buildReducedModel(whole, locked, pin.neutral(whole))
        order = [name for name in model.names if name in moving]
        if order != [joint.name for joint in self.joints]:
            raise ValueError(
                f"arm {self.name}: Pinocchio has the joints {order}, not in the order from"
                f" {self.base} to {self.tool}: its base must be the root of the URDF"
            )
        return model

    def hand(self, q: ArrayLike) -> pin.SE3:
        """Pose of the tool at angles q (n,) [rad], at its grip, in the world of which the floor is
        `mount_height` below the base.
        """
        data = self.model.createData()
        pin.framesForwardKinematics(self.model, data, np.asarray(q, dtype=float))
        base, tool = (data.oMf[self.model.getFrameId(name)] for name in (self.base, self.tool))
        grip = pin.SE3(np.eye(3), np.asarray(self.grip, dtype=float))
        held = base.actInv(tool) * self.tool_to_hand * grip
        return pin.SE3(np.eye(3), np.array([0.0, 0.0, self.mount_height])) * held

    @property
    def tool_to_hand(self) -> pin.SE3:
        """The frame of the hand in that of the tool."""
        return pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, self.turn), np.zeros(3))

    def axes(self, q: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Places (n, 3) [m] and directions (n, 3) of the joints' axes in the same world at angles q
        (n,).
        """
        data, angles = self.model.createData(), np.asarray(q, dtype=float)
        twists = pin.computeJointJacobians(self.model, data, angles)
        pin.updateFramePlacements(self.model, data)
        base = data.oMf[self.model.getFrameId(self.base)]
        places = np.array(
            [base.actInv(data.oMi[i]).translation for i in range(1, self.model.njoints)]
        )
        places[:, 2] += self.mount_height
        return places, twists[3:].T @ base.rotation

    def torque(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        """Torque (k, n) [N m] of motions (k, n) each, gravity included, hand empty."""
        data = self.model.createData()
        return np.array([pin.rnea(self.model, data, *row) for row in zip(q, qd, qdd, strict=True)])


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more


def _parsed(urdf: str, name: str) -> ElementTree.Element:
    try:
        robot = ElementTree.fromstring(urdf)
    except ElementTree.ParseError as error:
        raise ValueError(f"the URDF of {name} is no XML: {error}") from error
    if robot.tag != "robot":
        raise ValueError(
            f"the URDF of {name} begins with <{robot.tag}>, not <robot>: is it xacro or SDF?"
        )
    for joint in robot.iter("joint"):
        if joint.get("type") == "continuous":  # Pinocchio would need cosine and sine of it
            joint.set("type", "revolute")
            limit = joint.find("limit")
            limit = ElementTree.SubElement(joint, "limit") if limit is None else limit
            limit.set("lower", repr(-TURNS))
            limit.set("upper", repr(TURNS))
    return robot


def joints_between(robot: ElementTree.Element, base: str, tool: str) -> tuple[UrdfJoint, ...]:
    """The revolute joints from one link of a URDF to another.

    Raises
    ------
    ValueError
        If the links are not there, or something that is no revolute joint moves between them.
    """
    links = [link.get("name", "") for link in robot.findall("link")]
    above = {
        child.get("link"): joint
        for joint in robot.findall("joint")
        if (child := joint.find("child")) is not None
    }
    for what, link in (("base", base), ("tool", tool)):
        if link not in links:
            raise ValueError(f"the URDF has no link '{link}' as {what}; it has {', '.join(links)}")
    found, link = [], tool
    while link != base:
        if (joint := above.get(link)) is None:
            raise ValueError(f"no joints lead from '{base}' to '{tool}': '{link}' is the root")
        kind = joint.get("type")
        if kind == "revolute":
            found.append(_joint(joint))
        elif kind != "fixed":
            raise ValueError(
                f"the joint '{joint.get('name')}' between '{base}' and '{tool}' is {kind}: only"
                " revolute joints are known"
            )
        parent = joint.find("parent")
        link = parent.get("link", "") if parent is not None else ""
    if not found:
        raise ValueError(f"no joint moves between '{base}' and '{tool}'")
    return tuple(reversed(found))


def urdf_ends(urdf: str, name: str) -> tuple[str, list[str]]:
    """The root of a URDF, and the links without children to which revolute joints lead: one of these
    is the tool.

    Parameters
    ----------
    name
        Of the URDF, for errors.

    Raises
    ------
    ValueError
        If it has several roots, or nothing that revolute joints alone move.
    """
    robot = _parsed(urdf, name)
    links = [link.get("name", "") for link in robot.findall("link")]
    ends = {
        end: [one.get("link") for joint in robot.findall("joint") for one in joint.findall(end)]
        for end in ("parent", "child")
    }
    roots = [link for link in links if link not in ends["child"]]
    if len(roots) != 1:
        raise ValueError(
            f"the URDF of {name} has {len(roots)} links that are no child of a joint"
            f" ({', '.join(roots)}): an arm has one"
        )
    found = []
    for link in links:
        if link not in ends["parent"] and link != roots[0]:
            try:
                joints_between(robot, roots[0], link)
            except ValueError:  # a finger, or something fixed to the base
                continue
            found.append(link)
    if not found:
        raise ValueError(f"the URDF of {name} has no link that revolute joints alone move")
    return roots[0], found


def _joint(joint: ElementTree.Element) -> UrdfJoint:
    limit, dynamics, child = joint.find("limit"), joint.find("dynamics"), joint.find("child")

    def told(element: ElementTree.Element | None, key: str, otherwise: float) -> float:
        return otherwise if element is None else float(element.get(key, otherwise))

    lower, upper = told(limit, "lower", -TURNS), told(limit, "upper", TURNS)
    return UrdfJoint(
        joint.get("name", ""),
        *((lower, upper) if lower < upper else (-TURNS, TURNS)),
        told(limit, "velocity", np.nan),
        told(limit, "effort", np.nan),
        told(dynamics, "friction", 0.0),
        told(dynamics, "damping", 0.0),
        "" if child is None else child.get("link", ""),
    )


def load_arm(name: str) -> UrdfArm:
    """An arm of config/arms/, or of a file of that kind.

    Parameters
    ----------
    name
        Of the arm, or path of a file that ends in .yaml.

    Raises
    ------
    ValueError
        Names the file, the entry and the remedy.
    """
    path = arm_path(name)
    content = read_yaml(path)
    ARM_FILE.check(content, str(path))
    try:
        arm = UrdfArm(
            path.stem,
            read_urdf(content["urdf"], path.parent, content.get("install", "")),
            content["base"],
            content["tool"],
            np.array(content.get("grip", (0.0, 0.0, 0.0)), dtype=float),
            float(content.get("turn", 0.0)),
            float(content.get("mount_height", 0.0)),
            dict(content.get("velocity") or {}),
            dict(content.get("torque") or {}),
            dict(content.get("rotor_inertia") or {}),
            {
                name: np.array(row, dtype=float)
                for name, row in (content.get("servo") or {}).items()
            },
            {
                name: np.array(row, dtype=float)
                for name, row in (content.get("postures") or {}).items()
            },
        )
        _check_rows(arm, content)
        return arm
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _check_rows(arm: UrdfArm, content: Mapping) -> None:
    """ValueError if joints, gains or postures of a file do not fit the joints of the URDF."""
    names = [joint.name for joint in arm.joints]
    if "joints" in content and content["joints"] != names:
        raise ValueError(
            f"joints is {content['joints']}; from {arm.base} to {arm.tool} they are {names}"
        )
    known = [one.name for one in fields(ServoGains) if one.name != "ahead"]
    if unknown := sorted(set(arm.servo) - set(known)):
        raise ValueError(f"servo: unknown {', '.join(unknown)}; {', '.join(known)} are known")
    for what, rows in (("servo", arm.servo), ("postures", arm.postures)):
        for name, row in rows.items():
            if row.shape != (len(names),) or not np.isfinite(row).all():
                raise ValueError(
                    f"{what}: {name} is {row.tolist()}; give {len(names)} finite numbers, one for"
                    " each joint"
                )


def read_urdf(where: str, beside: Path = Path(), install: str = "") -> str:
    """Text of a URDF.

    Parameters
    ----------
    where
        A path, package://PACKAGE/PATH of a ROS or Python package, or a .yaml of config/ that
        describes an arm as config/wam.yaml does.
    beside
        Folder that relative paths begin at.
    install
        What brings the package, for the error.

    Raises
    ------
    FileNotFoundError
        Says where it was looked for, and what brings it.
    """
    if where.endswith(".yaml"):
        return write_urdf(read_description(config_path(where)))
    places = package_paths(where) if where.startswith("package://") else [beside / where]
    for place in places:
        if place.is_file():
            with open_file(place) as stream:
                return stream.read().decode()
    remedy = f": pip install {install}" if install else ""
    raise FileNotFoundError(
        f"no URDF {where} ({', '.join(map(str, places)) or 'its package is not installed'}){remedy}"
    )


def package_paths(where: str) -> list[Path]:
    """Where package://PACKAGE/PATH may be: in share/ of ROS packages, in a Python package, or in
    share/ of what Pinocchio's packages on PyPI install.
    """
    package, _, rest = where.removeprefix("package://").partition("/")
    spec = importlib.util.find_spec(package) if package.isidentifier() else None
    inside = [Path(p) for p in (spec.submodule_search_locations or [])] if spec else []
    shared = [p for p in Path(pin.__file__).parents if p.name == "cmeel.prefix"]
    return [
        *(prefix / "share" / package / rest for prefix in ros_prefixes()),
        *(folder / rest for folder in inside),
        *(prefix / "share" / package / rest for prefix in shared),
    ]
