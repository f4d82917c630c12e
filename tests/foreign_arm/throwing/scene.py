"""The scene of a throw: fingers that hold a ball by contact, the ball, floor and basket."""

import xml.etree.ElementTree as ElementTree

import numpy as np

from tests.foreign_arm import published
from tests.foreign_arm.arm import add_inertial, add_palm, quaternion, text
from tests.foreign_arm.plant import Scene

AIR_DENSITY = 1.204  # at 20 degrees [kg/m^3]
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


def add_hand(hand, laboratory):
    """Palm and fingers."""
    scale = laboratory.hand_mass_scale
    turns, knuckles = finger_places()
    mass, centre, inertia = palm_inertial(knuckles + turns @ (0.5 * FINGERTIP))
    add_inertial(hand, scale * mass, centre, scale * inertia)
    add_palm(hand, {"class": "grip"})
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


class BallScene(Scene):
    """A ball between fingers, and a basket."""

    loose, movable = "ball", "basket"
    grasp = published.BALL_CENTRE

    def describe(self, root, hand, laboratory):
        """See `Scene`."""
        grip = ElementTree.SubElement(root.find("default"), "default", {"class": "grip"})
        ElementTree.SubElement(
            grip, "geom", condim="4", friction="1.0 0.005 0.0001", solref="0.003 1"
        )
        add_hand(hand, laboratory)
        world = root.find("worldbody")
        add_ball(world, laboratory)
        add_basket(world)

    def begin(self, plant):
        """The ball is in the hand."""
        self._plant, model = plant, plant.model
        self._knuckles = [model.joint(f"knuckle{number}").dofadr[0] for number in (1, 2, 3)]
        self._tips = {model.geom(f"tip{number}").id for number in (1, 2, 3)}
        self._ball = model.geom("ball").id
        plant.put(plant.grasp())

    def act(self, plant):
        """Fingers close or open, and the air brakes the ball."""
        plant.data.qfrc_applied[self._knuckles] = self.knuckle_torque(plant.time)
        speed, area = plant.loose_velocity, np.pi * published.BALL_RADIUS**2
        drag = 0.5 * AIR_DENSITY * plant.laboratory.drag_coefficient * area
        plant.push("ball", -drag * np.linalg.norm(speed) * speed)

    def knuckle_torque(self, now):
        """Of each finger [N m]."""
        opened = (self._plant.hand.since_free(now) + OPENING_LAG) / OPENING_RAMP
        return GRIP_TORQUE * (2.0 * np.clip(opened, 0.0, 1.0) - 1.0)

    def fingers_touch(self):
        """How many fingertips touch the ball."""
        pairs = self._plant.data.contact.geom
        return sum(bool(self._tips & set(pair)) and self._ball in pair for pair in pairs.tolist())
