"""Numbers and names that are the same everywhere."""

from enum import IntEnum

NS_PER_S = 1_000_000_000
"""Nanoseconds of a second, in which stamps are told."""
UNTURNED = (0.0, 0.0, 0.0, 1.0)
"""The quaternion x, y, z, w of no turn."""
GRAVITY = 9.81
"""Acceleration of free fall [m/s^2]."""
AIR_DENSITY = 1.204
"""Density of dry air at 20 degrees Celsius and sea level [kg/m^3]."""
BULL_DISTANCE = 2.37
"""Distance of the face of a regulation dart board from the throwing line [m]."""
BULL_HEIGHT = 1.73
"""Height of its bull above the floor [m]."""
REMEMBERED = 2000
"""Largest number of throws of a bag that are learned from, by default: a lesson from them
takes a second.
"""
HAND = "hand"
"""Role of the body that every skill has."""
PARTITIONS = ("time", "em")
"""How the components of a mixture get their times: equal intervals, or those that EM finds."""


class Grip(IntEnum):
    """What the hand shall do; the values are those of dart_skill_msgs/WamCommand."""

    UNSPECIFIED = 0
    CLOSE = 1
    OPEN = 2
