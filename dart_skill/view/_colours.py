"""Colours of the view as red, green, blue from 0 to 255: Okabe and Ito, Color Universal Design (2008), one for each kind of thing."""

BLACK, GREY, LIGHT, WHITE = (0, 0, 0), (119, 119, 119), (187, 187, 187), (255, 255, 255)
ORANGE, SKY, GREEN, YELLOW = (230, 159, 0), (86, 180, 233), (0, 158, 115), (240, 228, 66)
BLUE, VERMILION, PURPLE = (0, 114, 178), (213, 94, 0), (204, 121, 167)

ARM, HAND, BALL, BASKET, CAMERA = (200, 200, 205), (90, 90, 95), VERMILION, BLUE, GREY
ATTRACTOR, EXECUTED, DEMONSTRATION, REGION = ORANGE, BLACK, GREY, LIGHT
GAUSSIANS = (GREEN, SKY, PURPLE, YELLOW)
"""Of groups of Gaussians, in the order in which they first come."""


def hexadecimal(colour: tuple[int, int, int]) -> str:
    """As a web page wants it, for example "#0072b2"."""
    return "#" + "".join(f"{part:02x}" for part in colour)
