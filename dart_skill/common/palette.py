"""Which colour stands for what, in figures, reports, the live page, markers and the files of other
viewers: one colour for one thing.

Okabe and Ito, Color Universal Design (2008): colour-blind people tell these eight apart.
Quantities have viridis (`figures`). Colours are red, green, blue from 0 to 255.
"""

from __future__ import annotations

Colour = tuple[int, int, int]
"""Red, green, blue from 0 to 255."""

BLACK = (0, 0, 0)
GREY = (119, 119, 119)
LIGHT = (187, 187, 187)
ORANGE = (230, 159, 0)
SKY = (86, 180, 233)
GREEN = (0, 158, 115)
YELLOW = (240, 228, 66)
BLUE = (0, 114, 178)
VERMILION = (213, 94, 0)
PURPLE = (204, 121, 167)
PALE = (234, 245, 252)
"""The inside of something blue."""

ARM = (200, 200, 205)
"""Links of the arm."""
JOINT = (125, 125, 132)
"""Housings of its joints."""
FINGERS = (90, 90, 95)
"""Fingers of the hand."""
CAMERA = GREY
"""Cameras and what they see of the room."""
REGION = LIGHT
"""Where a target may be."""
BASKET = BLUE
"""Where something shall come to: a basket, a holder, a board, a cup."""
BALL = VERMILION
"""What is moved: a ball in the hand, in flight and where it came down; a part."""
HAND = BLACK
"""The way of the hand as it is seen."""
PLANNED = LIGHT
"""The way of the hand as it was expected; it is drawn broad, below the one that is seen."""
ATTRACTOR = ORANGE
"""What pulls the hand."""
DEMONSTRATION = GREY
"""What a person showed: ways of the hand, and baskets (dashed)."""
RELEASE = PURPLE
"""The instant at which ball and hand part."""
GAUSSIANS = (GREEN, SKY, PURPLE, YELLOW)
"""Colours of groups of Gaussians, in the order in which they first come."""
GAUSSIAN = GAUSSIANS[0]
"""Gaussians of one group."""
SUCCESS = BASKET
"""What ended in the basket has its colour; its mark is a ring."""
FAILURE = BALL
"""What did not keeps the colour of the ball; its mark is a cross."""
STOP = VERMILION
"""What ends a movement at once, and what tells of an error."""
LEVELS = (GREEN, ORANGE, VERMILION, GREY)
"""Status of a node: ok, warning, error, stale, as diagnostic_msgs numbers them."""

THINGS = {
    "basket": BASKET,
    "ball": BALL,
    "hand": HAND,
    "attractor": ATTRACTOR,
    "demonstration": DEMONSTRATION,
    "release": RELEASE,
    "gaussian": GAUSSIAN,
}
"""What is seen together in a figure or on a page, and must be told apart."""


def hexadecimal(colour: Colour) -> str:
    """As web pages and matplotlib want it, for example "#0072b2"."""
    return "#" + "".join(f"{part:02x}" for part in colour)


def unit(colour: Colour) -> tuple[float, float, float]:
    """As messages of ROS want it: parts from 0 to 1."""
    red, green, blue = (part / 255 for part in colour)
    return red, green, blue
