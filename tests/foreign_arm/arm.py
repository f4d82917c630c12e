"""The arm in MuJoCo, with drives that give: its description, what its controller believes of it, its
motors and its encoders.
"""

import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np
import yaml

from tests.foreign_arm import published
from tests.paths import CONFIG

PERIOD = 0.002
SUBSTEPS = 4
MOUNT_HEIGHT = yaml.safe_load((CONFIG / "wam.yaml").read_text(encoding="utf-8"))["mount_height"]
SHOULDER = np.array([0.0, 0.0, MOUNT_HEIGHT + published.SHOULDER_HEIGHT])


def text(values):
    """Numbers as MJCF wants them."""
    return " ".join(f"{value:.12g}" for value in np.ravel(values))


def quaternion(rotation):
    """w, x, y, z of a rotation matrix, as MuJoCo has it."""
    result = np.zeros(4)
    mujoco.mju_mat2Quat(result, np.ravel(rotation))
    return result


def add_inertial(body, mass, centre, inertia):
    """An inertial element; `inertia` (3, 3) about the centre in the axes of the body."""
    six = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    ElementTree.SubElement(
        body, "inertial", mass=text(mass), pos=text(centre), fullinertia=text(six)
    )


def add_link(parent, joint, place, laboratory):
    """Link `joint` with its motor's coordinate, and its drive's deflection if that is elastic; the
    frame is the joint's.
    """
    body = ElementTree.SubElement(
        parent,
        "body",
        name=f"link{joint + 1}",
        pos=text(place[0]),
        quat=text(quaternion(place[1])),
    )
    # stiction does not creep
    hard = {
        "solimpfriction": "0.9999 0.9999 0.001",
        "solreffriction": "0.002 1",
    }
    common = {"axis": "0 0 1", "type": "hinge", **hard}
    ends = text([published.LOWER[joint], published.UPPER[joint]])
    motor = {
        "armature": text(published.reflected_inertia()[joint]),
        "damping": text(laboratory.viscous[joint]),
    }
    ElementTree.SubElement(
        body, "joint", name=f"motor{joint + 1}", limited="true", range=ends, **motor, **common
    )
    if laboratory.stiffness is not None:
        stiffness = laboratory.stiffness[joint]
        spring = {"stiffness": text(stiffness), "damping": text(2e-4 * stiffness)}
        ElementTree.SubElement(body, "joint", name=f"drive{joint + 1}", **spring, **common)
    alpha, a, d = published.DH[joint]
    turn = published.about_x(alpha)
    scale = laboratory.mass_scale[joint]
    inertia = published.tensor(published.PRINTED_INERTIA[joint], sign=-1.0)
    centre = np.array([a, 0.0, d]) + turn @ published.CENTRE[joint]
    add_inertial(body, scale * published.MASS[joint], centre, scale * turn @ inertia @ turn.T)
    return body, (np.array([a, 0.0, d]), turn)


def add_lump(hand, laboratory):
    """The mass of a closed hand."""
    scale = laboratory.hand_mass_scale
    inertia = scale * published.tensor(published.HAND_INERTIA)
    add_inertial(hand, scale * published.HAND_MASS, published.HAND_CENTRE, inertia)


def add_palm(hand, geometry):
    """The palm, which things touch; its further geometry as MJCF has it."""
    height = published.PALM_HEIGHT / 2
    ElementTree.SubElement(
        hand,
        "geom",
        geometry,
        name="palm",
        type="cylinder",
        size=text([published.PALM_RADIUS, height]),
        pos=text([0.0, 0.0, height]),
    )


def describe(laboratory, scene=None):
    """The MJCF of the arm, or of arm, floor, and the hand and the things of a scene."""
    root = ElementTree.Element("mujoco", model="wam")
    ElementTree.SubElement(root, "compiler", angle="radian")
    options = {
        "timestep": text(PERIOD / SUBSTEPS),
        "gravity": text([0.0, 0.0, -published.GRAVITY]),
    }
    option = ElementTree.SubElement(
        root, "option", integrator="implicitfast", cone="elliptic", impratio="5", **options
    )
    ElementTree.SubElement(option, "flag", energy="enable")
    defaults = ElementTree.SubElement(root, "default")
    ElementTree.SubElement(defaults, "geom", contype="0", conaffinity="1")
    world = ElementTree.SubElement(root, "worldbody")
    if scene is not None:
        ElementTree.SubElement(world, "geom", name="floor", type="plane", size="10 10 0.1")
    turn = published.about_z(laboratory.base_turn)
    body = ElementTree.SubElement(
        world, "body", name="base", pos=text(SHOULDER), quat=text(quaternion(turn))
    )
    place = (np.zeros(3), np.eye(3))
    for joint in range(7):
        body, place = add_link(body, joint, place, laboratory)
    hand = ElementTree.SubElement(
        body, "body", name="hand", pos=text(place[0]), quat=text(quaternion(place[1]))
    )
    if scene is None:
        add_lump(hand, laboratory)
    else:
        scene.describe(root, hand, laboratory)
    return ElementTree.tostring(root, encoding="unicode")


class NominalArm:
    """The arm as its controller believes it to be: published masses, a closed hand without a ball,
    a base that was not turned.
    """

    def __init__(self, laboratory):
        self.model = mujoco.MjModel.from_xml_string(describe(laboratory))
        self.data = mujoco.MjData(self.model)
        self._hand = self.model.body("hand").id
        self._jacobian = np.zeros((2, 3, 7))

    def take(self, angles):
        """Go to the measured joint angles (7,)."""
        self.data.qpos[:] = angles
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def gravity(self):
        """Torques (7,) that hold the arm [N m]."""
        torques = np.zeros(7)
        mujoco.mj_rne(self.model, self.data, 0, torques)
        return torques

    def jacobian(self):
        """Of the origin of the hand in world axes, linear over angular (6, 7)."""
        mujoco.mj_jacBody(self.model, self.data, self._jacobian[0], self._jacobian[1], self._hand)
        return self._jacobian.reshape(6, 7)

    def hand(self):
        """Position (3,) and rotation (3, 3) of the hand's frame in the world."""
        return self.data.xpos[self._hand].copy(), self.data.xmat[self._hand].reshape(3, 3).copy()


class Motors:
    """Motor torques from wanted joint torques, within what controllers and bus voltage allow."""

    def __init__(self):
        self._to_joint = published.JOINT_TO_MOTOR.T
        self._to_motor = np.linalg.inv(self._to_joint)
        peaks = published.PUCK_PEAK_JOINT
        self._peak = np.abs(peaks / np.abs(published.JOINT_TO_MOTOR).sum(axis=0))
        self._stall = published.TORQUE_CONSTANT * published.BUS_VOLTAGE / published.RESISTANCE

    def available(self, wanted, speeds):
        """Joint torques (7,) of the wanted ones (7,) at joint speeds (7,)."""
        share = published.JOINT_TO_MOTOR @ speeds / published.NO_LOAD_SPEED
        highest = np.minimum(self._peak, self._stall * (1.0 - share))
        lowest = np.maximum(-self._peak, -self._stall * (1.0 + share))
        return self._to_joint @ np.clip(self._to_motor @ wanted, lowest, highest)


class Encoders:
    """Joint angles and speeds as libbarrett makes them of the motors' encoders."""

    def __init__(self, laboratory, angles):
        self._offset = laboratory.joint_offset
        self._counts = laboratory.encoder_counts
        self._from_motor = np.linalg.inv(published.JOINT_TO_MOTOR)
        self._keep = np.exp(-published.SPEED_FILTER * PERIOD)
        self.speeds = np.zeros(7)
        self.angles = self._measured(angles)

    def _measured(self, angles):
        if not self._counts:
            return angles + self._offset
        step = 2 * np.pi / self._counts
        return (
            self._from_motor @ (step * np.floor(published.JOINT_TO_MOTOR @ angles / step))
            + self._offset
        )

    def read(self, angles):
        """Take the true angles (7,) of the motors, seen from the joints."""
        measured = self._measured(angles)
        self.speeds = (
            self._keep * self.speeds + (1.0 - self._keep) * (measured - self.angles) / PERIOD
        )
        self.angles = measured
