"""The plant: arm with elastic drives, hand that holds the ball by contact, ball, floor and basket
in MuJoCo, stepped at 500 Hz.
"""

import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np
import yaml

from tests.foreign_arm import published
from tests.paths import CONFIG

PERIOD = 0.002
SUBSTEPS = 4
AIR_DENSITY = 1.204  # at 20 degrees [kg/m^3]
MOUNT_HEIGHT = yaml.safe_load((CONFIG / "wam.yaml").read_text(encoding="utf-8"))["mount_height"]
SHOULDER = np.array([0.0, 0.0, MOUNT_HEIGHT + published.SHOULDER_HEIGHT])

FINGER_RADIUS = 0.070  # of the knuckles about the hand's axis [m]
# from the knuckle, x outwards: on the ball, 25 degrees beyond its equator [m]
FINGERTIP = np.array([-0.0305, 0.0, 0.052])
FINGERTIP_RADIUS = 0.010
FINGER_OPEN = 1.1  # angle of an open finger, 0: tip on the ball [rad]
GRIP_TORQUE = 0.5  # at a knuckle: 8 N at the tip, published are 15 [N m]
OPENING_RAMP = 0.015  # of the torque from closing to opening [s]
OPENING_LAG = (
    0.0095  # from the start of that ramp until the tips leave the ball, measured on this plant [s]
)

BASKET_RADIUS, BASKET_DEPTH, BASKET_WALLS = 0.15, 0.35, 16


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


def finger_places():
    """Rotations (3, 3, 3) and knuckles (3, 3) of the fingers in the frame of the hand; the third
    points along y.
    """
    turns = np.array([published.about_z(angle) for angle in np.deg2rad([210.0, 330.0, 90.0])])
    return turns, turns @ [FINGER_RADIUS, 0.0, 0.0] + [0.0, 0.0, published.PALM_HEIGHT]


def palm_inertial(finger_centres):
    """Mass, centre (3,) and tensor (3, 3) of the hand without its fingers, so that the closed hand
    is as published.
    """
    mass = published.HAND_MASS - 3 * published.FINGER_MASS
    centre = (
        published.HAND_MASS * published.HAND_CENTRE
        - published.FINGER_MASS * finger_centres.sum(axis=0)
    ) / mass

    def about_origin(mass, at):
        return mass * (at @ at * np.eye(3) - np.outer(at, at))

    whole = published.tensor(published.HAND_INERTIA) + about_origin(
        published.HAND_MASS, published.HAND_CENTRE
    )
    fingers = sum(
        about_origin(published.FINGER_MASS, at) + 3e-5 * np.eye(3) for at in finger_centres
    )
    return mass, centre, whole - fingers - about_origin(mass, centre)


def add_fingers(hand, scale):
    """Three fingers with a hinge each, whose tips hold the ball; positive angles open."""
    turns, knuckles = finger_places()
    for number, (turn, knuckle) in enumerate(zip(turns, knuckles, strict=True), 1):
        finger = ElementTree.SubElement(
            hand, "body", name=f"finger{number}", pos=text(knuckle), quat=text(quaternion(turn))
        )
        hinge = {
            "axis": "0 1 0",
            "limited": "true",
            "range": f"-0.2 {FINGER_OPEN}",
            "armature": "1e-4",
            "damping": "2e-3",
        }
        ElementTree.SubElement(finger, "joint", name=f"knuckle{number}", **hinge)
        add_inertial(
            finger, scale * published.FINGER_MASS, 0.5 * FINGERTIP, scale * 3e-5 * np.eye(3)
        )
        ElementTree.SubElement(
            finger,
            "geom",
            {"class": "grip"},
            name=f"tip{number}",
            pos=text(FINGERTIP),
            size=text(FINGERTIP_RADIUS),
        )


def add_hand(parent, place, laboratory, fingers):
    """The hand on the tool plate; without `fingers` it is one lump."""
    hand = ElementTree.SubElement(
        parent, "body", name="hand", pos=text(place[0]), quat=text(quaternion(place[1]))
    )
    scale = laboratory.hand_mass_scale
    if not fingers:
        inertia = scale * published.tensor(published.HAND_INERTIA)
        add_inertial(hand, scale * published.HAND_MASS, published.HAND_CENTRE, inertia)
        return
    turns, knuckles = finger_places()
    mass, centre, inertia = palm_inertial(knuckles + turns @ (0.5 * FINGERTIP))
    add_inertial(hand, scale * mass, centre, scale * inertia)
    height, radius = published.PALM_HEIGHT, published.PALM_RADIUS
    palm = {
        "type": "cylinder",
        "size": text([radius, height / 2]),
        "pos": text([0.0, 0.0, height / 2]),
    }
    ElementTree.SubElement(hand, "geom", {"class": "grip"}, name="palm", **palm)
    add_fingers(hand, scale)


def add_ball(world, laboratory):
    """A free ball, a thin shell."""
    ball = ElementTree.SubElement(world, "body", name="ball", pos="1 0 0.5")
    ElementTree.SubElement(ball, "freejoint", name="ball")
    mass, radius = laboratory.ball_mass, published.BALL_RADIUS
    add_inertial(ball, mass, np.zeros(3), 2 / 3 * mass * radius**2 * np.eye(3))
    ElementTree.SubElement(
        ball,
        "geom",
        {"class": "grip"},
        name="ball",
        type="sphere",
        size=text(radius),
        contype="1",
        conaffinity="0",
    )


def add_basket(world):
    """A ring of boards with a floor that may be put anywhere; its frame is at the centre of the
    rim.
    """
    basket = ElementTree.SubElement(world, "body", name="basket", mocap="true", pos="2 0 0.4")
    for angle in 2 * np.pi * np.arange(BASKET_WALLS) / BASKET_WALLS:
        turn = published.about_z(angle)
        size = [0.005, 1.02 * BASKET_RADIUS * np.tan(np.pi / BASKET_WALLS), BASKET_DEPTH / 2]
        place = turn @ [BASKET_RADIUS + 0.005, 0.0, -BASKET_DEPTH / 2]
        ElementTree.SubElement(
            basket,
            "geom",
            type="box",
            size=text(size),
            pos=text(place),
            quat=text(quaternion(turn)),
        )
    floor = {"size": text([BASKET_RADIUS, 0.01]), "pos": text([0.0, 0.0, -BASKET_DEPTH - 0.01])}
    ElementTree.SubElement(basket, "geom", type="cylinder", **floor)


def describe(laboratory, world_too=True):
    """The MJCF of the arm, or of arm, fingers, ball, floor and basket."""
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
    grip = ElementTree.SubElement(defaults, "default", {"class": "grip"})
    ElementTree.SubElement(grip, "geom", condim="4", friction="1.0 0.005 0.0001", solref="0.003 1")
    world = ElementTree.SubElement(root, "worldbody")
    if world_too:
        ElementTree.SubElement(world, "geom", name="floor", type="plane", size="10 10 0.1")
    turn = published.about_z(laboratory.base_turn)
    body = ElementTree.SubElement(
        world, "body", name="base", pos=text(SHOULDER), quat=text(quaternion(turn))
    )
    place = (np.zeros(3), np.eye(3))
    for joint in range(7):
        body, place = add_link(body, joint, place, laboratory)
    add_hand(body, place, laboratory, fingers=world_too)
    if world_too:
        add_ball(world, laboratory)
        add_basket(world)
    return ElementTree.tostring(root, encoding="unicode")


class NominalArm:
    """The arm as its controller believes it to be: published masses, a closed hand without a ball,
    a base that was not turned.
    """

    def __init__(self, laboratory):
        self.model = mujoco.MjModel.from_xml_string(describe(laboratory, world_too=False))
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


class Hand:
    """The torques of the three fingers: told to open, they let go some 45 ms later."""

    def __init__(self, laboratory, random):
        self._laboratory, self._random = laboratory, random
        self._begin = None
        self.torque = -GRIP_TORQUE

    @property
    def told_to_open(self):
        """Whether the last command was to open."""
        return self._begin is not None

    def open(self, now):
        """The command to open; a second one changes nothing."""
        if self._begin is None:
            delay = self._laboratory.hand_delay + self._laboratory.hand_spread * np.clip(
                self._random.standard_normal(), -3.0, 3.0
            )
            self._begin = now + delay - OPENING_LAG

    def close(self):
        """The command to close."""
        self._begin = None

    def act(self, now):
        """The torque at each knuckle [N m]."""
        opened = (
            0.0 if self._begin is None else np.clip((now - self._begin) / OPENING_RAMP, 0.0, 1.0)
        )
        self.torque = GRIP_TORQUE * (2.0 * opened - 1.0)
        return self.torque


class Plant:
    """The world at 500 Hz: `step` takes joint torques, the person's push, and where a person
    carries the ball.
    """

    def __init__(self, laboratory, posture):
        self.laboratory = laboratory
        self.model = mujoco.MjModel.from_xml_string(describe(laboratory))
        self.data = mujoco.MjData(self.model)
        names = [self.model.joint(index).name for index in range(self.model.njnt)]
        address = {name: self.model.joint(name).dofadr[0] for name in names}
        self._motor = np.array([address[f"motor{number}"] for number in range(1, 8)])
        self._drive = np.array(
            [address[f"drive{number}"] for number in range(1, 8) if f"drive{number}" in address],
            int,
        )
        self._finger = np.array([address[f"knuckle{number}"] for number in (1, 2, 3)])
        self._ball_position = self.model.joint("ball").qposadr[0]
        self._ball_speed = address["ball"]
        self._bodies = {
            name: self.model.body(name).id for name in ("hand", "ball", "basket", "link4")
        }
        self._tips = {self.model.geom(f"tip{number}").id for number in (1, 2, 3)}
        self._ball_geom = self.model.geom("ball").id
        self._area = (
            0.5 * AIR_DENSITY * laboratory.drag_coefficient * np.pi * published.BALL_RADIUS**2
        )
        self._motors = Motors()
        self.hand = Hand(laboratory, np.random.default_rng([laboratory.seed, 72]))
        self.steps = 0
        self.torque = np.zeros(7)
        self.data.qpos[self._motor] = posture
        mujoco.mj_forward(self.model, self.data)
        self.put_ball(self.grasp())
        mujoco.mj_forward(self.model, self.data)
        self.encoders = Encoders(laboratory, self.data.qpos[self._motor])

    @property
    def time(self):
        """Since the start [s]."""
        return self.steps * PERIOD

    @property
    def motor_angles(self):
        """True angles of the motors at the joints (7,)."""
        return self.data.qpos[self._motor].copy()

    @property
    def link_angles(self):
        """True angles of the links (7,): with the drives' deflection."""
        angles = self.data.qpos[self._motor].copy()
        if len(self._drive):
            angles += self.data.qpos[self._drive]
        return angles

    def pose(self, body):
        """Position (3,) and rotation (3, 3) of hand, ball, basket or link4 (its origin is the
        elbow) in the world.
        """
        index = self._bodies[body]
        return self.data.xpos[index].copy(), self.data.xmat[index].reshape(3, 3).copy()

    def velocity(self, body):
        """Linear (3,) and angular (3,) velocity of the origin of a body in world axes."""
        both = np.zeros(6)
        mujoco.mj_objectVelocity(
            self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, self._bodies[body], both, 0
        )
        return both[3:], both[:3]

    def grasp(self):
        """Where the centre of a held ball is (3,)."""
        place, turn = self.pose("hand")
        return place + turn @ published.BALL_CENTRE

    def fingers_touch(self):
        """How many fingertips touch the ball."""
        pairs = self.data.contact.geom
        return sum(
            bool(self._tips & set(pair)) and self._ball_geom in pair for pair in pairs.tolist()
        )

    def put_ball(self, place, velocity=(0.0, 0.0, 0.0)):
        """The ball is there, and moves so."""
        self.data.qpos[self._ball_position : self._ball_position + 7] = [
            *place,
            1.0,
            0.0,
            0.0,
            0.0,
        ]
        self.data.qvel[self._ball_speed : self._ball_speed + 6] = [*velocity, 0.0, 0.0, 0.0]

    def place_basket(self, rim):
        """The centre of its rim is there (3,)."""
        self.data.mocap_pos[0] = rim

    def _rub(self):
        """Coulomb friction with stiction that fades with speed, at the motors (Stribeck)."""
        laboratory = self.laboratory
        fade = np.exp(-((self.data.qvel[self._motor] / laboratory.stribeck_speed) ** 2))
        self.model.dof_frictionloss[self._motor] = laboratory.coulomb * (
            1.0 + (laboratory.stiction - 1.0) * fade
        )

    def _push(self, body, force, moment):
        """A wrench at the origin of a body for this step, world axes."""
        index = self._bodies[body]
        lever = self.data.xpos[index] - self.data.xipos[index]
        self.data.xfrc_applied[index, :3] = force
        self.data.xfrc_applied[index, 3:] = moment + np.cross(lever, force)

    def step(self, torque, push=(), carried=None):
        """Advance by 2 ms: joint torques (7,), pushes (body, force (3,), moment (3,)), the place
        (3,) of a carried ball.
        """
        self.torque = np.asarray(torque, float)
        if self.laboratory.real_motors:
            self.torque = self._motors.available(self.torque, self.data.qvel[self._motor])
        self.data.xfrc_applied[:] = 0.0
        for body, force, moment in push:
            self._push(body, force, moment)
        speed = self.data.qvel[self._ball_speed : self._ball_speed + 3]
        self.data.xfrc_applied[self._bodies["ball"], :3] = (
            -self._area * np.linalg.norm(speed) * speed
        )
        self.data.qfrc_applied[self._motor] = self.torque
        self.data.qfrc_applied[self._finger] = self.hand.act(self.time)
        self._rub()
        if carried is not None:
            self.put_ball(carried, self.velocity("hand")[0])
        mujoco.mj_step(self.model, self.data, SUBSTEPS)
        mujoco.mj_kinematics(self.model, self.data)
        self.steps += 1
        self.encoders.read(self.data.qpos[self._motor])
