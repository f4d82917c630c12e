"""The description of an arm from its URDF and its file of config/arms/.

What neither says is estimated, so that the arm can be simulated and moved: the servo of the joints
from their inertia, the torque that is left at a speed from the limits, shapes from where the joints
are. The file may give the servo, postures and the swing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin

from dart_skill.arm._description import (
    ArmDescription,
    Capsule,
    Hand,
    HeldBall,
    Inertial,
    Joint,
    Motors,
    ServoGains,
)
from dart_skill.arm._pointing_region import pointing_posture
from dart_skill.arm._swing_plane import SwingPlane, swing_plane
from dart_skill.arm._urdf_arm import UrdfArm, load_arm
from dart_skill.common.constants import GRAVITY
from dart_skill.common.world import the_world

FOLLOWS, HOLDS = 15.0, 30.0
"""Natural frequencies of the joints' servo along a motion, and where it holds a posture [rad/s]; those
of the WAM are 12 to 25 and 24 to 60.
"""
DAMPED = 0.7
"""Damping ratio of the servo."""
AHEAD = 0.004
"""Two control periods [s]: a state is one old when its torque acts, and joints whose axes are in
line turn against each other with hardly any inertia, as no URDF tells of rotors.
"""
SERVO_SHARE = 0.3
"""Largest torque of the servo, as a share of the joint's; that of the WAM is 0.12 to 0.5, but for J7."""
HEADROOM = 2.0
"""A joint has its whole torque up to its largest speed, none at so many times that speed, and brakes
beyond: what drives with a speed limit of their own do.
"""
RUBS = 0.03
"""Coulomb friction of a joint of which nothing is known, and its viscous friction at the largest speed,
as shares of its largest torque; those of the WAM are 0.016 to 0.047. Such friction is simulated, and
not compensated.
"""
RADIUS = 0.06
"""Radius of the capsule around the line between two joints [m]."""
SHORT = 0.03
"""Joints that are nearer to each other have no capsule between them [m]."""
PALM = 0.05
"""How far out of the mounting face the body of a hand goes [m]."""
NOTHING = Inertial(1e-6, np.zeros(3), 1e-9 * np.eye(3))
"""Inertia of a hand whose mass is counted with the last link."""
HOME = 0.3
"""Height over its base at which a hand points down in the home posture of an arm that says none [m]."""
TRIED = 20_000
"""Postures in which the arm's reach is looked for."""


def described(name: str) -> ArmDescription:
    """The arm of a file of config/arms/ that names a URDF.

    Raises
    ------
    ValueError
        Names the file, the entry and the remedy.
    """
    arm = load_arm(name)
    joints, links, hand = _chain(arm)
    plane = _plane(replace(arm, grip=np.zeros(3)))
    home = arm.postures["home"] if "home" in arm.postures else pointing_posture(arm, HOME)
    inertia = np.diag(pin.crba(arm.model, arm.model.createData(), home)) + arm.rotor_inertia
    n, tool = len(joints), arm.tool
    link = f"{tool}_hand" if tool == joints[-1].child else tool
    return ArmDescription(
        name=arm.name,
        mount_height=arm.mount_height,
        shoulder_height=float(plane.first[1]) - arm.mount_height,
        gravity=GRAVITY,
        joints=joints,
        tool_plate=hand.translation,
        tool_rpy=pin.rpy.matrixToRpy(hand.rotation),
        links_urdf=links,
        hand=Hand(link, NOTHING, np.array(arm.grip)),
        motors=Motors(np.eye(n), arm.rotor_inertia, HEADROOM * arm.torques, HEADROOM * arm.speeds),
        servo=_servo(inertia, arm.torques, arm.servo),
        elbow=int(plane.joints[1]) + 1,
        swinging=np.isin(np.arange(n), plane.joints),
        knows_friction=arm.knows_friction,
        reach=_reach(arm, plane),
        ball=HeldBall.of(the_world()),
        capsules=_capsules(joints, hand, link),
        postures={"home": home, **arm.postures},
    )


def _plane(arm: UrdfArm) -> SwingPlane:
    """One along which the hand points, if there is one."""
    try:
        return swing_plane(arm, points_along=True)
    except ValueError:
        return swing_plane(arm)


def _chain(arm: UrdfArm) -> tuple[tuple[Joint, ...], tuple[Inertial, ...], pin.SE3]:
    """Joints and links in frames whose z axes are the axes of the joints, and the hand in the last."""
    model, data = arm.model, arm.model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)
    tool = model.frames[model.getFrameId(arm.tool)]
    before = data.oMf[model.getFrameId(arm.base)].inverse()
    parent, joints, links, rubs = arm.base, [], [], _friction(arm)
    for k, joint in enumerate(arm.joints, start=1):
        axis = pin.getJointJacobian(model, data, k, pin.LOCAL)[3:, k - 1]
        turn = pin.SE3(_onto(axis), np.zeros(3))
        placed = before * model.jointPlacements[k] * turn
        body = turn.actInv(model.inertias[k])
        joints.append(
            Joint(
                joint.name,
                parent,
                joint.child,
                placed.translation.copy(),
                pin.rpy.matrixToRpy(placed.rotation),
                joint.lower,
                joint.upper,
                float(arm.torques[k - 1]),
                float(arm.speeds[k - 1]),
                *rubs[k - 1],
            )
        )
        links.append(Inertial(body.mass, body.lever.copy(), body.inertia.copy()))
        before, parent = turn.inverse(), joint.child
    return tuple(joints), tuple(links), before * tool.placement * arm.tool_to_hand


def _friction(arm: UrdfArm) -> np.ndarray:
    """Coulomb and viscous friction (n, 2) [N m], [N m s/rad]; assumed where nothing is known."""
    if arm.knows_friction:
        return np.array([(joint.friction, joint.damping) for joint in arm.joints])
    return RUBS * np.column_stack([arm.torques, arm.torques / arm.speeds])


def _onto(axis: np.ndarray) -> np.ndarray:
    """The shortest rotation (3, 3) that turns z onto a unit vector (3,)."""
    if axis[2] < -1.0 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    return pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).toRotationMatrix()


def _servo(
    inertia: np.ndarray, torques: np.ndarray, given: Mapping[str, np.ndarray]
) -> ServoGains:
    """Springs that make each joint swing with a given frequency in the home posture; entries of
    the file of the arm count instead.
    """
    gains = {
        "stiffness": HOLDS**2 * inertia,
        "damping": 2.0 * DAMPED * HOLDS * inertia,
        "limit": SERVO_SHARE * torques,
        "following_stiffness": FOLLOWS**2 * inertia,
        "following_damping": 2.0 * DAMPED * FOLLOWS * inertia,
    }
    return ServoGains(**{**gains, **given}, ahead=AHEAD)


def _reach(arm: UrdfArm, plane: SwingPlane) -> float:
    """Greatest distance of the hand from the shoulder in the plane, within the joints' ranges."""
    lower, upper = arm.lower[plane.joints], arm.upper[plane.joints]
    rng, width, middle, best = np.random.default_rng(0), upper - lower, 0.5 * (lower + upper), 0.0
    for _ in range(6):
        angles = (middle + width * (rng.random((TRIED, len(lower))) - 0.5)).clip(lower, upper)
        far = np.linalg.norm(plane.places(angles)[:, -1] - plane.first, axis=1)
        if far.max() > best:
            best, middle = float(far.max()), angles[far.argmax()]
        width = 0.5 * width
    return best


def _capsules(joints: tuple[Joint, ...], hand: pin.SE3, tool: str) -> tuple[Capsule, ...]:
    """From each joint to the next, and of the hand."""
    frames = [joints[0].parent, *(joint.child for joint in joints)]
    ends = [*(joint.xyz for joint in joints), hand.translation]
    links = [
        Capsule(frame, np.zeros(3), end, RADIUS)
        for frame, end in zip(frames, ends, strict=True)
        if np.linalg.norm(end) > SHORT
    ]
    palm = Capsule(tool, np.zeros(3), np.array([0.0, 0.0, PALM]), 0.8 * RADIUS)
    return (*links, palm)
