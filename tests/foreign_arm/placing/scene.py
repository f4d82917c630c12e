"""The scene of placing: a part on a table, a hand that holds it compliantly, and a holder with
walls.
"""

import xml.etree.ElementTree as ElementTree

import numpy as np
import yaml

from tests.foreign_arm.arm import add_inertial, add_lump, add_palm, quaternion, text
from tests.foreign_arm.plant import Scene
from tests.paths import CONFIG

# sizes of part and holder, and where holders stand
BENCH = yaml.safe_load((CONFIG / "skills/place.yaml").read_text(encoding="utf-8"))
SIZE, DEPTH, FLOOR = np.array(BENCH["size"]), BENCH["depth"], BENCH["floor"]
PLAY, WALL = (
    0.003,
    0.01,
)  # of the part in the holder on each side; of the walls (docs/skills.md) [m]
TABLE = np.array([0.45, 0.9, 0.02])  # half sizes [m]
BETWEEN, LEAN = 0.02, 0.2  # closing fingers hold what is so near its place in the hand [m], [rad]
TOUCHABLE = {"friction": "0.4 0.005 0.0001", "solref": "0.004 1"}
"""What part, holder and table are to each other: the friction of plastics, and hard."""
GRIP = {"solref": "0.02 1", "solimp": "0.9 0.9 0.001 0.5 2", "torquescale": "2"}
"""Of three fingertips with pads: 10 N move the part in the hand by 1.2 mm, 0.5 N m turn it by 5
degrees.
"""
SEATED = 0.003  # a part that is nearer to the floor of the holder is in [m]


def add_box(body, half, place=(0.0, 0.0, 0.0), **geometry):
    """A box, by half its sizes (3,) and its centre (3,) in the body [m]."""
    ElementTree.SubElement(
        body, "geom", type="box", size=text(half), pos=text(place), **{**TOUCHABLE, **geometry}
    )


def add_part(world):
    """A free box, whose origin is its centre."""
    part = ElementTree.SubElement(world, "body", name="part", pos="0 0 3")
    ElementTree.SubElement(part, "freejoint", name="part")
    square, mass = np.square(SIZE), BENCH["mass"]
    add_inertial(part, mass, np.zeros(3), mass / 12.0 * np.diag(square.sum() - square))
    add_box(part, SIZE / 2, name="part", contype="1", conaffinity="0")


def add_holder(world):
    """A floor and four walls that may be put anywhere; the origin is the middle of the floor."""
    holder = ElementTree.SubElement(world, "body", name="holder", mocap="true", pos="0.6 0 1.2")
    inner = SIZE[:2] / 2 + PLAY
    outer, (x, y) = inner + WALL, inner + WALL / 2
    add_box(holder, [*outer, FLOOR / 2], [0.0, 0.0, -FLOOR / 2])
    for side in (-1.0, 1.0):
        add_box(holder, [WALL / 2, outer[1], DEPTH / 2], [side * x, 0.0, DEPTH / 2])
        add_box(holder, [inner[0], WALL / 2, DEPTH / 2], [0.0, side * y, DEPTH / 2])


class BenchScene(Scene):
    """A part, a table, and a holder. The fingers are not modelled: closed, they hold the part as
    they found it, like a spring with a damper.
    """

    loose, movable = "part", "holder"
    grasp = np.array(BENCH["grasp"])

    def describe(self, root, hand, laboratory):
        """See `Scene`."""
        add_lump(hand, laboratory)
        add_palm(hand, {**TOUCHABLE, "contype": "1"})
        world = root.find("worldbody")
        table = ElementTree.SubElement(world, "body", name="table", pos=f"0.8 0 {BENCH['table']}")
        add_box(table, TABLE, [0.0, 0.0, -TABLE[2]])
        add_part(world)
        add_holder(world)
        equality = ElementTree.SubElement(root, "equality")
        ElementTree.SubElement(
            equality, "weld", name="grip", body1="hand", body2="part", active="false", **GRIP
        )

    def begin(self, plant):
        """The open hand is around the part."""
        self._plant, self._grip = plant, plant.model.equality("grip").id
        self._closed = False
        plant.hand.open(plant.time - 1.0)  # long ago
        place, turn = plant.pose("hand")
        plant.put(plant.grasp(), rotation=turn @ np.diag([-1.0, 1.0, -1.0]))

    @property
    def holds(self):
        """Whether the part is in the hand."""
        return bool(self._plant.data.eq_active[self._grip])

    def act(self, plant):
        """The fingers take the part, or let it go."""
        closed = plant.hand.holds(plant.time)
        if closed and not self._closed:
            self._take()
        elif not closed:
            plant.data.eq_active[self._grip] = 0
        self._closed = closed

    def seen_from(self, body):
        """Place (3,) and rotation (3, 3) of the part in the frame of a body."""
        (place, turn), (part, turned) = self._plant.pose(body), self._plant.pose("part")
        return turn.T @ (part - place), turn.T @ turned

    def _take(self):
        """Hold the part where it is, if it is between the fingers."""
        place, turn = self.seen_from("hand")
        between = np.linalg.norm(place - self.grasp) < BETWEEN
        if not between or -turn[2, 2] < np.cos(LEAN):
            return
        # a weld's anchor in the part, then the part's pose in the hand
        self._plant.model.eq_data[self._grip, :10] = [0.0, 0.0, 0.0, *place, *quaternion(turn)]
        self._plant.data.eq_active[self._grip] = 1

    def is_placed(self):
        """Whether the part lies in the holder, upright, and is not held."""
        place, turn = self.seen_from("holder")
        off = place - [0.0, 0.0, SIZE[2] / 2]
        return bool(
            not self.holds
            and np.abs(off[:2]).max() < 2 * PLAY
            and abs(off[2]) < SEATED
            and turn[2, 2] > np.cos(0.1)
        )
