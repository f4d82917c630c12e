"""The wires of the board as quadrature nodes.

The score is constant in each bed. So an integral over the board of the score times a gradient or
divergence becomes an integral along the wires (divergence theorem). The wires are circles of six
radii, cut at the sectors, and twenty rays. Each piece of wire separates two beds. It is divided
into panels that are short relative to the spread. Then Gauss-Legendre quadrature of the smooth
fields of the Gaussian is exact to round-off.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dart_skill.darts._board import BED_SCORES, N_BEDS, RADII, SECTOR_ANGLE, bed_of, direction

PANEL = 2.5
"""Length of the longest panel, in standard deviations along the narrower axis of the spread."""
N_NODES, N_NODES_SHORT = 8, 4
SHORT = 0.5


Piece = tuple[np.ndarray, np.ndarray, int, int, np.ndarray]
"""Piece of wire: nodes, weighted normals, the beds inside and outside, and its two ends."""


@dataclass(frozen=True, eq=False)
class Boundary:
    """Nodes of all pieces of wire, piece after piece.

    * position (m, 2) [mm].
    * normal (m, 2) [mm]: normal out of the inner bed, times the quadrature weight.
    * jump (m, 2): normal times the difference of the scores, inner minus outer.
    * starts (k,): index of the first node of each piece.
    * sides (k, 83): +1 for the inner bed of a piece, -1 for the outer one.
    * ends (k, 2, 2) [mm]: where a piece begins and ends; turn (k,): +1 where its normal is to the
      right of the way, else -1.
    """

    position: np.ndarray
    normal: np.ndarray
    jump: np.ndarray
    starts: np.ndarray
    sides: np.ndarray
    ends: np.ndarray
    turn: np.ndarray


def boundary_for(narrowest: float) -> Boundary:
    """Nodes that are fine enough for a Gaussian with the smallest standard deviation `narrowest`
    [mm]; similar ones share them.
    """
    return _boundary(int(np.floor(2.0 * np.log2(narrowest))))


@lru_cache(maxsize=8)
def _boundary(half_octaves: int) -> Boundary:
    spread = 2.0 ** (0.5 * half_octaves)
    pieces = [*_arcs(spread), *_rays(spread)]
    sizes = [len(position) for position, *_ in pieces]
    inner, outer = (np.array([piece[which] for piece in pieces]) for which in (2, 3))
    ends = np.array([piece[4] for piece in pieces])
    way, outward = ends[:, 1] - ends[:, 0], np.array([piece[1][0] for piece in pieces])
    turn = np.sign(way[:, 1] * outward[:, 0] - way[:, 0] * outward[:, 1])
    sides = np.eye(N_BEDS)[inner] - np.eye(N_BEDS)[outer]
    normal = np.concatenate([piece[1] for piece in pieces])
    step = np.repeat(BED_SCORES[inner] - BED_SCORES[outer], sizes)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    arrays = (
        np.concatenate([piece[0] for piece in pieces]),
        normal,
        normal * step[:, None],
        starts,
        sides,
        ends,
        turn,
    )
    for array in arrays:
        array.flags.writeable = False
    return Boundary(*arrays)


def _arcs(spread: float) -> Iterator[Piece]:
    for ring, radius in enumerate(RADII):
        parameter, weight = _panels(radius * SECTOR_ANGLE, spread)
        for sector in range(20):
            outward, beds = (
                direction(sector - 0.5 + parameter),
                (int(bed_of(ring, sector)), int(bed_of(ring + 1, sector))),
            )
            yield (
                radius * outward,
                outward * weight[:, None],
                *beds,
                radius * direction(sector + np.array([-0.5, 0.5])),
            )


def _rays(spread: float) -> Iterator[Piece]:
    for ring in range(2, 6):
        near, far = RADII[ring - 1], RADII[ring]
        parameter, weight = _panels(far - near, spread)
        for sector in range(20):
            along = direction(sector + 0.5)
            clockwise = np.array([along[1], -along[0]])
            position, ends = (
                (near + (far - near) * parameter)[:, None] * along,
                np.array([[near], [far]]) * along,
            )
            yield (
                position,
                weight[:, None] * clockwise,
                int(bed_of(ring, sector)),
                int(bed_of(ring, (sector + 1) % 20)),
                ends,
            )


def _panels(length: float, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes between 0 and 1 along a piece of wire, and their weights, whose sum is its length."""
    n_panels = int(np.ceil(length / (PANEL * spread)))
    node, weight = np.polynomial.legendre.leggauss(
        N_NODES_SHORT if length < SHORT * spread else N_NODES
    )
    nodes = (np.arange(n_panels)[:, None] + 0.5 * (node + 1.0)) / n_panels
    return nodes.ravel(), np.tile(0.5 * weight * length / n_panels, n_panels)
