"""The visual shapes and the joints of a URDF, as far as `dart_skill.arm._urdf` writes them:
primitives, revolute and fixed joints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from dart_skill.view._shapes import Mesh, box, cylinder, joined, sphere


@dataclass(frozen=True)
class UrdfLink:
    """A link: its name, its parent's ("" for the root), its pose there at joint angle zero,
    translation (3,) [m] and quaternion (4,) x, y, z, w, and what is seen of it, None for nothing.
    """

    name: str
    parent: str
    translation: np.ndarray
    quaternion: np.ndarray
    mesh: Mesh | None


def read_links(urdf: str) -> list[UrdfLink]:
    """The links of a URDF text, parents first; ValueError for a shape or a tree that is not
    understood.
    """
    robot = ElementTree.fromstring(urdf)
    joints = {_asked(_child(joint, "child"), "link"): joint for joint in robot.findall("joint")}
    links = [
        _link(element, joints.get(_asked(element, "name"))) for element in robot.findall("link")
    ]
    placed: dict[str, UrdfLink] = {}
    while len(placed) < len(links):
        ready = [
            link for link in links if link.name not in placed and link.parent in {"", *placed}
        ]
        if not ready:
            lost = sorted(link.name for link in links if link.name not in placed)
            raise ValueError(
                f"links {', '.join(lost)} of the URDF hang on no root: check the parents of their"
                " joints"
            )
        placed |= {link.name: link for link in ready}
    return list(placed.values())


def _link(element: ElementTree.Element, joint: ElementTree.Element | None) -> UrdfLink:
    name = _asked(element, "name")
    meshes = [_visual(visual, name) for visual in element.findall("visual")]
    parent = "" if joint is None else _asked(_child(joint, "parent"), "link")
    translation, quaternion = _origin(joint)
    return UrdfLink(name, parent, translation, quaternion, joined(meshes) if meshes else None)


def _visual(visual: ElementTree.Element, link: str) -> Mesh:
    shape = _child(visual, "geometry")[0]
    if shape.tag not in SHAPES:
        raise ValueError(f"link {link}: a <{shape.tag}> is not drawn, only {', '.join(SHAPES)}")
    translation, quaternion = _origin(visual)
    return SHAPES[shape.tag](shape).moved(translation, _matrix(quaternion))


def _origin(element: ElementTree.Element | None) -> tuple[np.ndarray, np.ndarray]:
    """Translation (3,) [m] and quaternion (4,) of the pose of a joint or a shape."""
    origin = None if element is None else element.find("origin")
    if origin is None:
        return np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
    xyz, rpy = (
        np.array(origin.get(name, "0 0 0").split(), dtype=float) for name in ("xyz", "rpy")
    )
    return xyz, _turned(rpy)


def _turned(rpy: np.ndarray) -> np.ndarray:
    """Quaternion (4,) of turns (3,) [rad] about the fixed axes x, y and z, one after the other.
    SciPy's would be a fourth of all that a replay imports.
    """
    (sx, sy, sz), (cx, cy, cz) = np.sin(rpy / 2), np.cos(rpy / 2)
    return np.array(
        [
            sx * cy * cz - cx * sy * sz,
            cx * sy * cz + sx * cy * sz,
            cx * cy * sz - sx * sy * cz,
            cx * cy * cz + sx * sy * sz,
        ]
    )


def _matrix(quaternion: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) of a unit quaternion (4,)."""
    x, y, z, w = quaternion
    return np.array(
        [
            [x * x - y * y - z * z + w * w, 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), y * y - x * x - z * z + w * w, 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), z * z - x * x - y * y + w * w],
        ]
    )


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
    "cylinder": lambda shape: cylinder(
        float(_asked(shape, "radius")), float(_asked(shape, "length"))
    ),
    "box": lambda shape: box(np.array(_asked(shape, "size").split(), dtype=float)),
}
