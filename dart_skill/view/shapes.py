"""Triangle meshes of primitive shapes, and of the bodies of skills, each part of a body with its
colour. Lengths are in metres.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dart_skill.common.surface import BOARD_DIAMETER
from dart_skill.darts import RADII, SECTOR_ANGLE
from dart_skill.skills.protocol import Solid

SIDES = 24
"""Number of sides of round shapes."""
BLACK = (35, 35, 35)
"""Colour of the dark single beds of a dart board."""
CREAM = (235, 222, 196)
"""Colour of the light single beds of a dart board."""
RED = (200, 45, 40)
"""Colour of the inner bull and of the doubles and trebles beside dark beds."""
GREEN = (20, 120, 70)
"""Colour of the outer bull and of the doubles and trebles beside light beds."""
DARK = (20, 20, 20)
"""Colour of the rim of a dart board."""
ARC = 6
"""Number of chords of a sector of the board."""
THICK = 0.038
"""Thickness of a board [m]."""


@dataclass(frozen=True)
class Mesh:
    """Vertices (n, 3) [m] and faces (m, 3), indices of their corners, counter-clockwise seen from
    outside.
    """

    vertices: np.ndarray
    faces: np.ndarray

    def moved(self, translation: np.ndarray, rotation: np.ndarray | None = None) -> Mesh:
        """Turned by rotation (3, 3), then shifted by translation (3,)."""
        turned = self.vertices if rotation is None else self.vertices @ np.asarray(rotation).T
        return Mesh(turned + translation, self.faces)


def joined(meshes: Iterable[Mesh]) -> Mesh:
    """Several meshes as one."""
    meshes = list(meshes)
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, first, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def sphere(radius: float, sides: int = SIDES) -> Mesh:
    """About the origin, its poles on z."""
    rows = sides // 2
    polar = np.pi * np.arange(1, rows) / rows
    around = 2 * np.pi * np.arange(sides) / sides
    rings = np.stack(
        [
            np.outer(np.sin(polar), np.cos(around)),
            np.outer(np.sin(polar), np.sin(around)),
            np.outer(np.cos(polar), np.ones(sides)),
        ],
        axis=-1,
    )
    vertices = radius * np.concatenate(
        [[[0.0, 0.0, 1.0]], rings.reshape(-1, 3), [[0.0, 0.0, -1.0]]]
    )
    here = np.arange(sides)
    there, last = (here + 1) % sides, len(vertices) - 1
    bands = [
        _band(1 + row * sides + here, 1 + row * sides + there, sides) for row in range(rows - 2)
    ]
    top = np.column_stack([np.zeros_like(here), 1 + here, 1 + there])
    bottom = np.column_stack([np.full_like(here, last), last - sides + there, last - sides + here])
    return Mesh(vertices, np.concatenate([top, *bands, bottom]))


def cylinder(radius: float, length: float, sides: int = SIDES) -> Mesh:
    """Along z, its middle at the origin, with lids."""
    return joined(
        [
            _lathe([radius, radius], [-length / 2, length / 2], sides),
            *_lids(radius, length / 2, sides),
        ]
    )


def capsule(start: np.ndarray, end: np.ndarray, radius: float) -> Mesh:
    """Between two points (3,): a cylinder and two spheres."""
    axis = end - start
    length = float(np.linalg.norm(axis))
    z = axis / length
    x = np.cross(np.eye(3)[np.abs(z).argmin()], z)
    x /= np.linalg.norm(x)
    turn = np.column_stack([x, np.cross(z, x), z])
    return joined(
        [
            sphere(radius).moved(start),
            sphere(radius).moved(end),
            cylinder(radius, length).moved(0.5 * (start + end), turn),
        ]
    )


def box(size: np.ndarray) -> Mesh:
    """With edges (3,), its middle at the origin; its sides share no corners, so that they are
    shaded flat.
    """
    square = np.array([[-0.5, -0.5, 0.5], [0.5, -0.5, 0.5], [0.5, 0.5, 0.5], [-0.5, 0.5, 0.5]])
    x, y, z = np.eye(3)
    sides = [
        np.stack(axes, axis=1)
        for axes in ((x, y, z), (x, -y, -z), (y, z, x), (-y, z, -x), (z, x, y), (z, -x, -y))
    ]
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return joined(Mesh(square @ side.T * np.asarray(size, dtype=float), faces) for side in sides)


def pyramid(half_angles: tuple[float, float], length: float) -> Mesh:
    """What a camera at the origin sees along z up to `length`: half_angles (2,) along x and y
    [rad].
    """
    x, y = length * np.tan(half_angles)
    vertices = np.array(
        [[0.0, 0.0, 0.0], [x, y, length], [-x, y, length], [-x, -y, length], [x, -y, length]]
    )
    return Mesh(
        vertices, np.array([[0, 2, 1], [0, 3, 2], [0, 4, 3], [0, 1, 4], [1, 2, 3], [1, 3, 4]])
    )


def bucket(radius: float, depth: float, wall: float, sides: int = 2 * SIDES) -> Mesh:
    """A basket: upright and open at the top, the centre of its rim at the origin.

    Parameters
    ----------
    radius
        Of the free opening.
    """
    outer, floor = radius + wall, -depth - wall
    profile = [
        (0.0, floor),
        (outer, floor),
        (outer, 0.0),
        (radius, 0.0),
        (radius, -depth),
        (0.0, -depth),
    ]
    rings = [
        _lathe((start[0], end[0]), (start[1], end[1]), sides)
        for start, end in zip(profile, profile[1:], strict=False)
    ]
    return joined(rings)


def circle(radius: float, sides: int = 2 * SIDES) -> np.ndarray:
    """A closed line (sides + 1, 3) in the horizontal plane."""
    around = 2 * np.pi * np.arange(sides + 1) / sides
    return np.column_stack([radius * np.cos(around), radius * np.sin(around), np.zeros(sides + 1)])


def _lathe(radii: Iterable[float], heights: Iterable[float], sides: int) -> Mesh:
    """The ring between two circles; facing outwards where the second one is higher."""
    around = 2 * np.pi * np.arange(sides) / sides
    circles = [
        np.column_stack([r * np.cos(around), r * np.sin(around), np.full(sides, h)])
        for r, h in zip(radii, heights, strict=True)
    ]
    here = np.arange(sides)
    return Mesh(np.concatenate(circles), _band(here + sides, (here + 1) % sides + sides, -sides))


def _lids(radius: float, half: float, sides: int) -> list[Mesh]:
    return [
        _lathe([0.0, radius], [-half, -half], sides),
        _lathe([radius, 0.0], [half, half], sides),
    ]


def _band(here: np.ndarray, there: np.ndarray, step: int) -> np.ndarray:
    """Two triangles for each side between a ring of vertices and the one that lies `step` further
    in the list, below it.
    """
    return np.concatenate(
        [
            np.column_stack([here, here + step, there]),
            np.column_stack([there, here + step, there + step]),
        ]
    )


class ColouredMesh(NamedTuple):
    """A mesh and its colour; None for that of the body."""

    mesh: Mesh
    colour: tuple[int, int, int] | None = None


def parts_of(solids: Sequence[Solid]) -> list[ColouredMesh]:
    """What is drawn of a body; of one without solids a small box, so that one sees where it is."""
    found: list[ColouredMesh] = []
    for solid in solids or (Solid("box", (0.04, 0.04, 0.04)),):
        centre = np.array(solid.centre)
        found += [
            ColouredMesh(part.mesh.moved(centre), part.colour)
            for part in MADE_OF[solid.kind](*solid.lengths)
        ]
    return found


def is_painted(solids: Sequence[Solid]) -> bool:
    """Whether every part of a body has a colour of its own, so that no colour stands for the body."""
    return all(part.colour is not None for part in parts_of(solids))


def _board() -> list[ColouredMesh]:
    """A board whose face is the plane x = 0, seen from where x is negative; z is up, and y to the
    left as the thrower sees it.
    """
    radii = np.array([0.0, *RADII]) * 1e-3
    meshes: dict[tuple[int, int, int], list[Mesh]] = {}
    for ring, colours in enumerate(
        [(RED, RED), (GREEN, GREEN), (BLACK, CREAM), (RED, GREEN), (BLACK, CREAM), (RED, GREEN)]
    ):
        for sector in range(20):
            meshes.setdefault(colours[sector % 2], []).append(
                _ring_sector(radii[ring], radii[ring + 1], sector)
            )
    turned = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    disc = (
        cylinder(0.5 * BOARD_DIAMETER, THICK, 48)
        .moved(np.zeros(3), turned)
        .moved(np.array([0.5 * THICK + 0.001, 0.0, 0.0]))
    )
    return [
        ColouredMesh(disc, DARK),
        *(ColouredMesh(joined(parts), colour) for colour, parts in meshes.items()),
    ]


def _ring_sector(inner: float, outer: float, sector: int) -> Mesh:
    """A bed of the board, in its face; sectors count clockwise from the top, as the thrower sees
    it.
    """
    angles = (sector + np.linspace(-0.5, 0.5, ARC + 1)) * SECTOR_ANGLE
    rim = np.column_stack([np.zeros(ARC + 1), -np.sin(angles), np.cos(angles)])
    here = np.arange(ARC)
    faces = np.concatenate(
        [
            np.column_stack([here, here + 1, here + ARC + 1]),
            np.column_stack([here + 1, here + ARC + 2, here + ARC + 1]),
        ]
    )
    return Mesh(np.concatenate([inner * rim, outer * rim]), faces)


def _cup(radius: float, height: float, wall: float) -> list[ColouredMesh]:
    return [ColouredMesh(bucket(radius, height, wall).moved(np.array([0.0, 0.0, height])))]


MADE_OF: dict[str, Callable[..., list[ColouredMesh]]] = {
    "box": lambda *edges: [ColouredMesh(box(np.array(edges)))],
    "sphere": lambda radius: [ColouredMesh(sphere(radius))],
    "cylinder": lambda radius, length: [ColouredMesh(cylinder(radius, length))],
    "cup": _cup,
    "board": _board,
}
