"""The WAM as a URDF: written from the description, primitive shapes for what is seen and collides.

The transforms of /tf say where the links are: what robot_state_publisher computes from a URDF.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from dart_skill.arm._description import Capsule, Inertial, Joint, WamDescription
from dart_skill.common.constants import N_JOINTS

HAND_LINK = "bhand_base"
"""Link of the hand."""
BALL_LINK = "held_ball"
"""Link of what the hand holds."""


def write_urdf(
    description: WamDescription, ball_in_hand: bool = False, shapes: bool = True
) -> str:
    """The arm with its hand as URDF text.

    ball_in_hand adds the ball's mass as a fixed link, for the dynamics of a loaded arm;
    shapes=False leaves out visual and collision shapes. Every link has an inertial: PyBullet gives
    a link without one a mass of 1 kg.
    """
    robot = ElementTree.Element("robot", name="wam")
    _link(robot, "wam_base", _massless(), description, shapes)
    for joint, inertial in zip(description.joints, description.links_urdf, strict=True):
        _revolute(robot, joint)
        _link(robot, joint.child, inertial, description, shapes)
    _fixed(robot, "bhand_mount", description.joints[-1].child, HAND_LINK, description.tool_plate)
    _link(robot, HAND_LINK, description.hand.inertial, description, shapes)
    if ball_in_hand:
        ball = description.ball
        _fixed(robot, "grip", HAND_LINK, BALL_LINK, description.hand.ball_centre)
        _link(
            robot,
            BALL_LINK,
            Inertial(ball.mass, np.zeros(3), ball.inertia * np.eye(3)),
            description,
            False,
        )
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding="unicode") + "\n"


def _massless() -> Inertial:
    return Inertial(1e-9, np.zeros(3), 1e-12 * np.eye(3))


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _link(
    robot: ElementTree.Element,
    name: str,
    inertial: Inertial,
    description: WamDescription,
    shapes: bool,
) -> None:
    link = ElementTree.SubElement(robot, "link", name=name)
    element = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(element, "origin", xyz=_text(inertial.centre), rpy="0 0 0")
    ElementTree.SubElement(element, "mass", value=repr(float(inertial.mass)))
    tensor = inertial.inertia
    names = {
        "ixx": (0, 0),
        "ixy": (0, 1),
        "ixz": (0, 2),
        "iyy": (1, 1),
        "iyz": (1, 2),
        "izz": (2, 2),
    }
    ElementTree.SubElement(
        element, "inertia", {key: repr(float(tensor[ij])) for key, ij in names.items()}
    )
    for capsule in description.capsules if shapes else ():
        if capsule.link == name:
            _shape(link, capsule)


def _shape(link: ElementTree.Element, capsule: Capsule) -> None:
    """A capsule as URDF has it: a cylinder between two spheres."""
    centre, axis = (capsule.start + capsule.end) / 2, capsule.end - capsule.start
    length = float(np.linalg.norm(axis))
    for kind in ("visual", "collision"):
        for point in (capsule.start, capsule.end):
            _geometry(link, kind, point, (0.0, 0.0, 0.0), "sphere", radius=repr(capsule.radius))
        _geometry(
            link,
            kind,
            centre,
            _tilt(axis),
            "cylinder",
            radius=repr(capsule.radius),
            length=repr(length),
        )


def _geometry(
    link: ElementTree.Element,
    kind: str,
    xyz: Iterable[float],
    rpy: Iterable[float],
    shape: str,
    **sizes: str,
) -> None:
    element = ElementTree.SubElement(link, kind)
    ElementTree.SubElement(element, "origin", xyz=_text(xyz), rpy=_text(rpy))
    ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), shape, sizes)


def _tilt(axis: np.ndarray) -> tuple[float, float, float]:
    """Roll, pitch and yaw that turn z onto the axis."""
    x, y, z = axis / np.linalg.norm(axis)
    return 0.0, float(np.arctan2(np.hypot(x, y), z)), float(np.arctan2(y, x))


def _revolute(robot: ElementTree.Element, joint: Joint) -> None:
    element = ElementTree.SubElement(robot, "joint", name=joint.name, type="revolute")
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.child)
    ElementTree.SubElement(
        element, "origin", xyz=_text(joint.xyz), rpy=_text((joint.roll, 0.0, 0.0))
    )
    ElementTree.SubElement(element, "axis", xyz="0 0 1")
    limits = {
        "lower": joint.lower,
        "upper": joint.upper,
        "effort": joint.peak_torque,
        "velocity": joint.no_load_speed,
    }
    ElementTree.SubElement(
        element, "limit", {key: repr(float(value)) for key, value in limits.items()}
    )
    friction = {"damping": joint.viscous_friction, "friction": joint.coulomb_friction}
    ElementTree.SubElement(
        element, "dynamics", {key: repr(float(value)) for key, value in friction.items()}
    )


def _fixed(
    robot: ElementTree.Element, name: str, parent: str, child: str, xyz: np.ndarray
) -> None:
    element = ElementTree.SubElement(robot, "joint", name=name, type="fixed")
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=child)
    ElementTree.SubElement(element, "origin", xyz=_text(xyz), rpy="0 0 0")


UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
"""Quaternion of no turn."""


@dataclass(frozen=True)
class Transform:
    """Pose of frame `child` in frame `parent`: translation (3,) [m], quaternion (4,) x, y, z, w."""

    parent: str
    child: str
    translation: np.ndarray
    quaternion: np.ndarray


def fixed_transforms(description: WamDescription, world: str = "world") -> list[Transform]:
    """Those that never change: the base in the world, and the hand on the last link."""
    joints = description.joints
    return [
        Transform(
            world, joints[0].parent, np.array([0.0, 0.0, description.mount_height]), UPRIGHT
        ),
        Transform(joints[-1].child, HAND_LINK, description.tool_plate, UPRIGHT),
    ]


def joint_transforms(description: WamDescription, position: np.ndarray) -> list[Transform]:
    """Those of the joints at angles `position` (7,) [rad]: a turn about the parent's x by the
    joint's roll, then about z by the angle.

    Raises
    ------
    ValueError
        For angles of another number, or not finite.
    """
    position = np.asarray(position, dtype=float)
    if position.shape != (N_JOINTS,) or not np.all(np.isfinite(position)):
        raise ValueError(f"position = {position}: give {N_JOINTS} finite joint angles [rad]")
    roll = description.of_joints("roll")
    (sin_roll, cos_roll), (sin, cos) = (
        (np.sin(angle / 2), np.cos(angle / 2)) for angle in (roll, position)
    )
    quaternion = np.stack(
        [sin_roll * cos, -sin_roll * sin, cos_roll * sin, cos_roll * cos], axis=1
    )
    return [
        Transform(j.parent, j.child, j.xyz, q)
        for j, q in zip(description.joints, quaternion, strict=True)
    ]
