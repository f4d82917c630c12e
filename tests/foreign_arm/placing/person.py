"""A person who leads the arm's hand with a part in it to a holder and lets the part go, and who
puts the part back onto the table.
"""

import numpy as np

from tests.foreign_arm import published
from tests.foreign_arm.arm import PERIOD, SHOULDER
from tests.foreign_arm.cameras import turned_by
from tests.foreign_arm.person import Person, Way, eased, minimum_jerk, rotation_vector
from tests.foreign_arm.placing.scene import BENCH, SIZE

OVER_THE_PART = np.array([-0.7, 0.6, 0.0, 1.9, 0.0, 0.6416, 0.0])
"""The hand points down and is around the part on the table (7,) [rad]."""
FOLLOWS = 6.0  # how fast what is left of the way is taken out: a person sees it [1/s]
LIFT, ABOVE = 0.10, 0.07  # of the part over where it stood, and over where it goes [m]
# of a part out of a holder, and of the hand off a part; higher, J6 would come to its end [m]
TAKEN_OUT, CLEAR = 0.06, 0.12
CARRYING, LOWERING, BACK = 3.0, 2.5, 1.5  # durations of ways: the last of an empty hand [s]
AIM = 0.0007  # of where the part is put in: what a person cannot see [m]
UPPER_ARM = np.hypot(*published.DH[2, 1:])  # from the shoulder to the elbow [m]
LOWER_ARM = np.hypot(published.DH[3, 1], published.DH[4, 2])  # to the wrist [m]


def elbows(hands):
    """Places (n, 3) of the elbow above the line from the shoulder to hands (n, 3) that point down."""
    x, y, z = (hands - SHOULDER).T
    radius, height = np.hypot(x, y), z + published.DH[6, 2]
    far = np.hypot(radius, height)
    cosine = (UPPER_ARM**2 + far**2 - LOWER_ARM**2) / (2.0 * UPPER_ARM * far)
    # from the vertical to the line from the shoulder to the elbow
    lean = np.arctan2(radius, height) - np.arccos(np.clip(cosine, -1.0, 1.0))
    azimuth = np.arctan2(y, x)
    across = np.sin(lean)
    up = np.column_stack([across * np.cos(azimuth), across * np.sin(azimuth), np.cos(lean)])
    return SHOULDER + UPPER_ARM * up


def arch(first, last, height, duration):
    """Places (n, 3) and rotations (n, 3, 3) from one pose to another: up to a height, over, and
    down.

    The height is that of the first or the last pose where one of them is higher.
    """
    share = np.linspace(0.0, 1.0, round(duration / PERIOD) + 1)
    up, over, down = eased(share / 0.3), eased((share - 0.2) / 0.55), eased((share - 0.65) / 0.35)
    places = first[0] + over[:, None] * (last[0] - first[0])
    top = max(height, first[0][2], last[0][2])
    places[:, 2] = first[0][2] + up * (top - first[0][2]) + down * (last[0][2] - top)
    turn = rotation_vector(last[1] @ first[1].T)
    return places, np.array([turned_by(part * turn) for part in over]) @ first[1]


def lowered(first, place, duration):
    """The same straight down to a place (3,), with the rotation of the first pose."""
    share = minimum_jerk(round(duration / PERIOD) + 1)[:, None]
    places = first[0] + share * (place - first[0])
    return places, np.broadcast_to(first[1], (len(places), 3, 3))


class Placer(Person):
    """A person who places parts with the arm."""

    def __init__(self, laboratory, plant):
        super().__init__(laboratory, plant, FOLLOWS)
        self._start = plant.pose("hand")

    @staticmethod
    def _leading(places, rotations):
        """The way of a hand through places (n, 3) and rotations (n, 3, 3)."""
        return Way.along(places, rotations, elbows(places))

    def _staying(self):
        """The way of a hand that stays where it is."""
        place, rotation = self._plant.pose("hand")
        return self._leading(np.array([place, place]), np.array([rotation, rotation]))

    def place(self, seat):
        """Close the hand, carry the part to above a seat (3,), (3, 3) and look, lower it, open the
        hand, and wait.
        """
        yield from self.follow(self._staying(), {round(0.4 / PERIOD): "close"}, rest=0.8)
        part, hand = self._plant.pose("part"), self._plant.pose("hand")
        # the hand as the part sees it, held as it was found
        offset, turn = part[1].T @ (hand[0] - part[0]), part[1].T @ hand[1]

        def carrying(places, rotations):
            return self._leading(places + rotations @ offset, rotations @ turn)

        place = seat[0] + [self.varies(AIM), self.varies(AIM), 0.0]
        above = place + [0.0, 0.0, ABOVE + self.varies(0.01)]
        over = above, turned_by([0.0, 0.0, self.varies(0.01)]) @ seat[1]
        longer = 1.0 + self.varies(0.05)
        way = carrying(*arch(part, over, part[0][2] + LIFT, CARRYING * longer))
        yield from self.follow(way, rest=0.4)
        way = carrying(*lowered(over, place, LOWERING * longer))
        opens = len(way.hand) + round(0.3 / PERIOD)
        yield from self.follow(way, {opens: "open"}, rest=1.2)

    def lead_back(self):
        """Lead the empty hand up, and over to above where the part shall stand."""
        yield from self.follow(self._staying(), {0: "open"}, rest=0.3)
        above = self._start[0] + [0.0, 0.0, CLEAR]
        height = self._plant.pose("hand")[0][2] + TAKEN_OUT
        yield from self._lead((above, self._start[1]), height)

    def bring_part(self):
        """Carry the part back to about where it stood, and lead the hand down over it."""
        stands = self._start[0] + self._start[1] @ BENCH["grasp"]
        stands[:2] += self.varies(0.003), self.varies(0.003)
        stands[2] = BENCH["table"] + SIZE[2] / 2
        across = -self._start[1][:, 0]
        yaw = np.arctan2(across[1], across[0]) + self.varies(0.03)
        first = self._plant.pose("part")
        height = first[0][2] + TAKEN_OUT
        for pose in zip(*arch(first, (stands, published.about_z(yaw)), height, BACK), strict=True):
            yield (), pose
        yield from self._lead(self._start, 0.0)

    def _lead(self, last, height):
        """Lead the empty hand to a pose."""
        places, rotations = arch(self._plant.pose("hand"), last, height, BACK)
        yield from self.follow(self._leading(places, rotations))
