"""The wires of the board as quadrature nodes.

The score is constant in each bed, so an integral over the board of score times a gradient or divergence is one along the wires
(divergence theorem): circles of six radii cut at the sectors, and twenty rays. Each piece separates two beds. Panels short against
the spread make Gauss-Legendre quadrature of the Gaussian's smooth fields along them exact to round-off.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dart_skill.darts._board import BED_SCORES, N_BEDS, RADII, SECTOR_ANGLE, bed_of, direction

PANEL = 2.5
"""Longest panel in standard deviations of the narrower axis of the spread."""
N_NODES, N_NODES_SHORT = 8, 4
SHORT = 0.5


@dataclass(frozen=True, eq=False)
class Boundary:
    """Nodes of all pieces of wire, piece after piece.

    position (m, 2) [mm]; normal (m, 2): out of the inner bed, times the quadrature weight [mm]; jump (m, 2): normal times inner
    minus outer score; starts (k,): first node of each piece; sides (k, 83): +1 for the inner bed of a piece and -1 for the outer.
    """

    position: np.ndarray
    normal: np.ndarray
    jump: np.ndarray
    starts: np.ndarray
    sides: np.ndarray


def boundary_for(narrowest: float) -> Boundary:
    """Nodes fine enough for a Gaussian whose smallest standard deviation is `narrowest` [mm]; shared by similar ones."""
    return _boundary(int(np.floor(2.0 * np.log2(narrowest))))


@lru_cache(maxsize=8)
def _boundary(half_octaves: int) -> Boundary:
    spread = 2.0 ** (0.5 * half_octaves)
    pieces = [*_arcs(spread), *_rays(spread)]
    sizes = [len(position) for position, *_ in pieces]
    inner, outer = (np.array([piece[which] for piece in pieces]) for which in (2, 3))
    sides = np.eye(N_BEDS)[inner] - np.eye(N_BEDS)[outer]
    normal = np.concatenate([piece[1] for piece in pieces])
    step = np.repeat(BED_SCORES[inner] - BED_SCORES[outer], sizes)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    arrays = np.concatenate([piece[0] for piece in pieces]), normal, normal * step[:, None], starts, sides
    for array in arrays:
        array.flags.writeable = False
    return Boundary(*arrays)


def _arcs(spread: float):
    for ring, radius in enumerate(RADII):
        parameter, weight = _panels(radius * SECTOR_ANGLE, spread)
        for sector in range(20):
            outward = direction(sector - 0.5 + parameter)
            yield radius * outward, outward * weight[:, None], int(bed_of(ring, sector)), int(bed_of(ring + 1, sector))


def _rays(spread: float):
    for ring in range(2, 6):
        near, far = RADII[ring - 1], RADII[ring]
        parameter, weight = _panels(far - near, spread)
        for sector in range(20):
            along = direction(sector + 0.5)
            clockwise = np.array([along[1], -along[0]])
            position = (near + (far - near) * parameter)[:, None] * along
            yield position, weight[:, None] * clockwise, int(bed_of(ring, sector)), int(bed_of(ring, (sector + 1) % 20))


def _panels(length: float, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes in 0..1 along a piece and their weights, which sum to its length."""
    n_panels = int(np.ceil(length / (PANEL * spread)))
    node, weight = np.polynomial.legendre.leggauss(N_NODES_SHORT if length < SHORT * spread else N_NODES)
    nodes = (np.arange(n_panels)[:, None] + 0.5 * (node + 1.0)) / n_panels
    return nodes.ravel(), np.tile(0.5 * weight * length / n_panels, n_panels)
