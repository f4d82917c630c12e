"""Meshes of the bodies of skills, each part with its colour."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from dart_skill.common.surface import BOARD_DIAMETER
from dart_skill.darts import RADII, SECTOR_ANGLE
from dart_skill.skills.protocol import Solid
from dart_skill.view._shapes import Mesh, box, bucket, cylinder, joined, sphere

BLACK, CREAM, RED, GREEN, DARK = (
    (35, 35, 35),
    (235, 222, 196),
    (200, 45, 40),
    (20, 120, 70),
    (20, 20, 20),
)
ARC = 6
"""Chords of a sector of the board."""
THICK = 0.038
"""Thickness of a board [m]."""


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
