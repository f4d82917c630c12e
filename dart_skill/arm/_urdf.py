"""The arm as a URDF: written from the description, primitive shapes for what is seen and collides.

The transforms of /tf say where the links are: what robot_state_publisher computes from a URDF.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from dart_skill.arm._description import ArmDescription, Capsule, Inertial, Joint, quaternion_of
from dart_skill.common.quaternions import product

BALL_LINK = "held_ball"
"""Link of what the hand holds."""


def write_urdf(
    description: ArmDescription, ball_in_hand: bool = False, shapes: bool = True
) -> str:
    """The arm with its hand as URDF text.

    ball_in_hand adds the ball's mass as a fixed link, for the dynamics of a loaded arm;
    shapes=False leaves out visual and collision shapes. Every link has an inertial: PyBullet gives
    a link without one a mass of 1 kg.
    """
    robot, hand = ElementTree.Element("robot", name=description.name), description.hand
    _link(robot, description.joints[0].parent, _massless(), description, shapes)
    for joint, inertial in zip(description.joints, description.links_urdf, strict=True):
        _revolute(robot, joint)
        _link(robot, joint.child, inertial, description, shapes)
    last, plate, rpy = description.joints[-1].child, description.tool_plate, description.tool_rpy
    _fixed(robot, "hand_mount", last, hand.link, plate, rpy)
    _link(robot, hand.link, hand.inertial, description, shapes)
    if ball_in_hand:
        ball = description.ball
        _fixed(robot, "grip", hand.link, BALL_LINK, hand.ball_centre, np.zeros(3))
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
    description: ArmDescription,
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
    ElementTree.SubElement(element, "origin", xyz=_text(joint.xyz), rpy=_text(joint.rpy))
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
    robot: ElementTree.Element,
    name: str,
    parent: str,
    child: str,
    xyz: np.ndarray,
    rpy: np.ndarray,
) -> None:
    element = ElementTree.SubElement(robot, "joint", name=name, type="fixed")
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=child)
    ElementTree.SubElement(element, "origin", xyz=_text(xyz), rpy=_text(rpy))


UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
"""Quaternion of no turn."""


@dataclass(frozen=True)
class Transform:
    """Pose of frame `child` in frame `parent`: translation (3,) [m], quaternion (4,) x, y, z, w."""

    parent: str
    child: str
    translation: np.ndarray
    quaternion: np.ndarray


def fixed_transforms(description: ArmDescription, world: str = "world") -> list[Transform]:
    """Those that never change: the base in the world, and the hand on the last link."""
    joints = description.joints
    return [
        Transform(
            world, joints[0].parent, np.array([0.0, 0.0, description.mount_height]), UPRIGHT
        ),
        Transform(
            joints[-1].child,
            description.hand.link,
            description.tool_plate,
            quaternion_of(description.tool_rpy),
        ),
    ]


def joint_transforms(description: ArmDescription, position: np.ndarray) -> list[Transform]:
    """Those of the joints at angles `position` (n,) [rad]: the joint's `rpy` in the frame of its
    parent, then a turn about z by the angle.

    Raises
    ------
    ValueError
        For angles of another number, or not finite.
    """
    position = np.asarray(position, dtype=float)
    n = description.n_joints
    if position.shape != (n,) or not np.all(np.isfinite(position)):
        raise ValueError(f"position = {position}: give {n} finite joint angles [rad]")
    sin, cos, none = np.sin(position / 2), np.cos(position / 2), np.zeros(n)
    quaternion = product(description.turns, np.stack([none, none, sin, cos], axis=1))
    return [
        Transform(j.parent, j.child, j.xyz, q)
        for j, q in zip(description.joints, quaternion, strict=True)
    ]
