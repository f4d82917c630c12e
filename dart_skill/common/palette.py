"""Which colour stands for what, in figures, reports, the live page, markers and the files of other
viewers: one colour for one thing.

Okabe and Ito, Color Universal Design (2008): colour-blind people tell these eight apart.
Quantities have viridis (`figures`). Colours are red, green, blue from 0 to 255.
"""

from __future__ import annotations

import colorsys

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
DARK_PAGE = (22, 24, 27)
"""Background of pages and figures in dark mode."""
DARK_INK = (230, 230, 230)
"""Text and lines in dark mode that are black on white."""

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
HAND_STRIPE = DARK_INK
"""In scenes every other piece of the way of the hand, so that it is seen on a dark ground, too."""
FLOOR = (160, 160, 165)
"""Lines of the floor, on a light ground and on a dark one."""
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

GREYISH = 12
"""A colour whose parts differ by less is a grey."""
PALE_FROM = 0.9
"""Lightness from which a colour is that of an area behind other things."""
SEEN = 4.5
"""Contrast with the dark page that text needs at least (WCAG 2.2, 1.4.3)."""

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


def in_the_dark(colour: Colour) -> Colour:
    """What takes the place of a colour of a page or figure in dark mode.

    Greys and pale colours change from dark to light, or from light to dark. Other colours stay, or
    become lighter until they are seen on the dark page.
    """
    hue, lightness, saturation = colorsys.rgb_to_hls(*unit(colour))
    if max(colour) - min(colour) < GREYISH:
        ink, page = DARK_INK, DARK_PAGE
        red, green, blue = (
            round(dark + lightness * (light - dark)) for dark, light in zip(ink, page, strict=True)
        )
        return red, green, blue
    if lightness > PALE_FROM:
        red, green, blue = (
            round(255 * part) for part in colorsys.hls_to_rgb(hue, 0.18, 0.5 * saturation)
        )
        return red, green, blue
    found, white = colour, 0.0
    while contrast(found, DARK_PAGE) < SEEN:
        white += 0.02
        red, green, blue = (round(part + white * (255 - part)) for part in colour)
        found = (red, green, blue)
    return found


def contrast(one: Colour, other: Colour) -> float:
    """Ratio of the luminances of two colours, from 1 to 21 (WCAG 2.2)."""
    low, high = sorted((_luminance(one), _luminance(other)))
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: Colour) -> float:
    linear = [
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
        for part in unit(colour)
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def unit(colour: Colour) -> tuple[float, float, float]:
    """As messages of ROS want it: parts from 0 to 1."""
    red, green, blue = (part / 255 for part in colour)
    return red, green, blue
