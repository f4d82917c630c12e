"""The visual shapes and the joints of a URDF, as far as `dart_skill.robot._urdf` writes them: primitives, revolute and fixed joints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.view._shapes import Mesh, box, cylinder, joined, sphere


@dataclass(frozen=True)
class UrdfLink:
    """A link: its name, its parent's ("" for the root), its pose there at joint angle zero, translation (3,) [m] and quaternion (4,)
    x, y, z, w, and what is seen of it, None for nothing.
    """

    name: str
    parent: str
    translation: np.ndarray
    quaternion: np.ndarray
    mesh: Mesh | None


def read_links(urdf: str) -> list[UrdfLink]:
    """The links of a URDF text, parents first; ValueError for a shape or a tree that is not understood."""
    robot = ElementTree.fromstring(urdf)
    joints = {_asked(_child(joint, "child"), "link"): joint for joint in robot.findall("joint")}
    links = [_link(element, joints.get(_asked(element, "name"))) for element in robot.findall("link")]
    placed: dict[str, UrdfLink] = {}
    while len(placed) < len(links):
        ready = [link for link in links if link.name not in placed and link.parent in {"", *placed}]
        if not ready:
            lost = sorted(link.name for link in links if link.name not in placed)
            raise ValueError(f"links {', '.join(lost)} of the URDF hang on no root: check the parents of their joints")
        placed |= {link.name: link for link in ready}
    return list(placed.values())


def _link(element: ElementTree.Element, joint: ElementTree.Element | None) -> UrdfLink:
    name = _asked(element, "name")
    meshes = [_visual(visual, name) for visual in element.findall("visual")]
    parent = "" if joint is None else _asked(_child(joint, "parent"), "link")
    translation, rotation = _origin(joint)
    return UrdfLink(name, parent, translation, rotation.as_quat(), joined(meshes) if meshes else None)


def _visual(visual: ElementTree.Element, link: str) -> Mesh:
    shape = _child(visual, "geometry")[0]
    if shape.tag not in SHAPES:
        raise ValueError(f"link {link}: a <{shape.tag}> is not drawn, only {', '.join(SHAPES)}")
    translation, rotation = _origin(visual)
    return SHAPES[shape.tag](shape).moved(translation, rotation.as_matrix())


def _origin(element: ElementTree.Element | None) -> tuple[np.ndarray, Rotation]:
    origin = None if element is None else element.find("origin")
    if origin is None:
        return np.zeros(3), Rotation.identity()
    xyz, rpy = (np.array(origin.get(name, "0 0 0").split(), dtype=float) for name in ("xyz", "rpy"))
    return xyz, Rotation.from_euler("xyz", rpy)


def _child(element: ElementTree.Element, tag: str) -> ElementTree.Element:
    found = element.find(tag)
    if found is None:
        raise ValueError(f"a <{element.tag}> of the URDF lacks its <{tag}>")
    return found


def _asked(element: ElementTree.Element, attribute: str) -> str:
    value = element.get(attribute)
    if value is None:
        raise ValueError(f"a <{element.tag}> of the URDF lacks its {attribute}")
    return value


SHAPES: dict[str, Callable[[ElementTree.Element], Mesh]] = {
    "sphere": lambda shape: sphere(float(_asked(shape, "radius"))),
    "cylinder": lambda shape: cylinder(float(_asked(shape, "radius")), float(_asked(shape, "length"))),
    "box": lambda shape: box(np.array(_asked(shape, "size").split(), dtype=float)),
}
