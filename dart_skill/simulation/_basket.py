"""The basket: a real body with a floor, walls and a rim. The ball is in, or it is not."""

from collections.abc import Iterable
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from dart_skill.common.world import the_world


@dataclass(frozen=True)
class Basket:
    """An upright cylinder, open at the top.

    Parameters
    ----------
    position
        Centre of the rim (3,) [m].
    radius
        Of the free opening, default that of config/world.yaml [m].
    depth
        From the rim to the floor, default that of config/world.yaml [m].
    wall, rim
        Thickness of the wall, and diameter of the tube around the rim [m].
    restitution
        Of walls and floor, 0 to 1.
    sides
        Of the polygon that stands for the circle.
    """

    position: tuple[float, float, float] = (2.0, 0.0, the_world().rim)
    radius: float = the_world().basket_radius
    depth: float = the_world().basket_depth
    wall: float = 0.01
    rim: float = 0.012
    restitution: float = 0.3
    sides: int = 24

    def holds(self, point: np.ndarray, position: np.ndarray) -> bool:
        """Whether the point (3,) is inside the walls and below the rim of a basket at position
        (3,).
        """
        x, y, z = np.subtract(point, position).tolist()
        return x * x + y * y < self.radius**2 and -self.depth - self.wall < z < 0.0


def basket_urdf(basket: Basket) -> str:
    """URDF text of a fixed basket: a ring of boxes for the walls, a ring of capsules for the rim,
    a disc for the floor.

    PyBullet's own compound shapes hold at most 16 parts; a URDF link holds any number.
    """
    robot = ElementTree.Element("robot", name="basket")
    link = ElementTree.SubElement(robot, "link", name="basket")
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value="1.0")
    ElementTree.SubElement(
        inertial, "inertia", ixx="0.01", ixy="0", ixz="0", iyy="0.01", iyz="0", izz="0.01"
    )
    side = 2 * np.tan(np.pi / basket.sides)
    wall, rim = basket.radius + basket.wall / 2, basket.radius + basket.rim / 2
    outside = basket.radius + basket.wall
    for angle in 2 * np.pi * np.arange(basket.sides) / basket.sides:
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        size = f"{basket.wall!r} {float(outside * side)!r} {basket.depth!r}"
        _part(link, wall * direction - [0, 0, basket.depth / 2], (0, 0, angle), "box", size=size)
        _part(
            link, rim * direction, (np.pi / 2, 0, angle), "capsule",
            radius=repr(basket.rim / 2), length=repr(float(rim * side)),
        )  # fmt: skip
    floor = np.array([0, 0, -basket.depth - basket.wall / 2])
    _part(link, floor, (0, 0, 0), "cylinder", radius=repr(basket.radius), length=repr(basket.wall))
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _part(
    link: ElementTree.Element, xyz: Iterable[float], rpy: Iterable[float], shape: str, **sizes: str
) -> None:
    for kind in ("visual", "collision"):
        element = ElementTree.SubElement(link, kind)
        text = {
            "xyz": " ".join(repr(float(v)) for v in xyz),
            "rpy": " ".join(repr(float(v)) for v in rpy),
        }
        ElementTree.SubElement(element, "origin", text)
        ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), shape, sizes)
