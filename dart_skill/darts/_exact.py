"""Expected score, its derivatives, and the probability and moments of each bed, exact to round-off
for any Gaussian.

Let p(x) = N(x; m, C), m = aim + bias, and q = (x - m)' C^-1 (x - m) / 2. The field F(x) = (x - m)
(1 - e^-q) / (4 pi q sqrt(det C)) has the divergence p. Let n be the normal of the wires and J the
jump of the score across them (inner minus outer). By the divergence theorem,

    E = sum_beds s_b integral_b p dx = contour-integral J F.n ds,        grad_m E = - contour-integral J p n ds.

The moments of p in a bed follow in the same way. There is no grid and no truncation.

The nodes of the contour integrals lie on the wires, which are circles of six radii, cut at the
sectors, and twenty rays. Each piece of wire separates two beds. It is divided
into panels that are short relative to the spread. Then Gauss-Legendre quadrature of the smooth
fields of the Gaussian is exact to round-off.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_samples
from dart_skill.darts._board import (
    BED_SCORES,
    MISS,
    N_BEDS,
    RADII,
    SECTOR_ANGLE,
    as_points,
    bed_of,
    direction,
)
from dart_skill.darts._spread import Spread, as_spread

PANEL = 2.5
"""Length of the longest panel, in standard deviations along the narrower axis of the spread."""
N_NODES = 8
"""Nodes of the rule of integration on a panel."""
N_NODES_SHORT = 4
"""Nodes on a short panel."""
SHORT = 0.5
"""Length up to which a panel is short, in the unit of PANEL."""


Piece = tuple[np.ndarray, np.ndarray, int, int, np.ndarray]
"""Piece of wire: nodes, weighted normals, the beds inside and outside, and its two ends."""


@dataclass(frozen=True, eq=False)
class Boundary:
    """Nodes of all pieces of wire, piece after piece.

    Parameters
    ----------
    position : (m, 2) [mm]
    normal : (m, 2) [mm]
        Normal out of the inner bed, times the quadrature weight.
    jump : (m, 2)
        Normal times the difference of the scores, inner minus outer.
    starts : (k,)
        Index of the first node of each piece.
    sides : (k, 83)
        +1 for the inner bed of a piece, -1 for the outer one.
    ends : (k, 2, 2) [mm]
        Where a piece begins and ends.
    turn : (k,)
        +1 where its normal is to the right of the way, else -1.
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


CHUNK = 1 << 16
"""Number of pairs of aim and node that are computed at a time: they stay in the cache."""
FAR = 9.0
"""A piece of wire is far from the mean beyond so many of the wider deviations: e^-q is below 3e-18
there.
"""
MOST_IS_FAR = 30.0
"""Up to this distance most pieces are far [mm], and it pays to look which ones."""
BULGE = 2.2
"""How far an arc of the board is beyond its chord at most [mm]."""
SERIES_BELOW = 1e-3
"""Exponents q below which (1 - e^-q) / q is taken from its series: the difference loses digits
there.
"""


class Derivatives(NamedTuple):
    """Expected score (n,) of aims, its gradient (n, 2) [1/mm] and its Hessian (n, 2, 2) [1/mm^2]."""

    value: np.ndarray
    gradient: np.ndarray
    hessian: np.ndarray


class BedMoments(NamedTuple):
    """For each bed: probability (83,), and the integrals of (x - m) p, (83, 2) [mm], and (x - m)(x
    - m)' p, (83, 2, 2) [mm^2].
    """

    probability: np.ndarray
    first: np.ndarray
    second: np.ndarray


def expected_score(aims: ArrayLike, spread: Spread | float | ArrayLike) -> np.ndarray:
    """Expected score (...) of one dart at aims (..., 2) [mm].

    Absolute error below 1e-9 points.

    Parameters
    ----------
    spread
        A Spread, sigma [mm] or a covariance (2, 2) [mm^2].
    """
    aims, spread = as_points(aims, "aims"), as_spread(spread)
    flat = aims.reshape(-1, 2) + spread.bias
    boundary = boundary_for(spread.deviations[0])
    moment = np.einsum("md,md->m", boundary.jump, boundary.position)
    values = np.empty(len(flat))
    for rows in _chunks(len(flat), len(boundary.position)):
        field = _field(_exponent(flat[rows], boundary.position, spread), spread)
        values[rows] = field @ moment - np.einsum("nd,nd->n", field @ boundary.jump, flat[rows])
    # Far off the board round-off may be all that there is, on either side of zero.
    return np.maximum(values, 0.0).reshape(aims.shape[:-1])


def bed_probabilities(aims: ArrayLike, spread: Spread | float | ArrayLike) -> np.ndarray:
    """Probability (..., 83) of each bed (BED_NAMES) for one dart at aims (..., 2) [mm]; absolute
    error below 1e-12.

    Parameters
    ----------
    spread
        As in `expected_score`.
    """
    aims, spread = as_points(aims, "aims"), as_spread(spread)
    flat = aims.reshape(-1, 2) + spread.bias
    boundary = boundary_for(spread.deviations[0])
    probability = np.empty((len(flat), N_BEDS))
    for rows in _chunks(
        len(flat),
        (
            len(boundary.starts)
            if FAR * spread.deviations[1] < MOST_IS_FAR
            else len(boundary.position)
        ),
    ):
        probability[rows] = _flux(flat[rows], boundary, spread) @ boundary.sides
    probability[:, MISS] += 1.0
    return np.clip(probability, 0.0, 1.0).reshape(*aims.shape[:-1], N_BEDS)


def score_derivatives(aims: ArrayLike, spread: Spread | float | ArrayLike) -> Derivatives:
    """Expected score of aims (n, 2) [mm], with gradient and Hessian with respect to the aim; all
    are exact to round-off.

    Parameters
    ----------
    spread
        As in `expected_score`.
    """
    aims, spread = as_samples(aims, "aims", 2), as_spread(spread)
    boundary = boundary_for(spread.deviations[0])
    jump, position = boundary.jump, boundary.position
    outer = np.einsum("mi,mj->mij", jump, position).reshape(-1, 4)
    value, gradient, hessian = (
        np.empty(len(aims)),
        np.empty((len(aims), 2)),
        np.empty((len(aims), 2, 2)),
    )
    precision = np.linalg.inv(spread.covariance)
    for rows in _chunks(len(aims), len(position)):
        mean = aims[rows] + spread.bias
        exponent = _exponent(mean, position, spread)
        field, density = _field(exponent, spread), _density(exponent, spread)
        value[rows] = field @ (outer[:, 0] + outer[:, 3]) - np.einsum(
            "nd,nd->n", field @ jump, mean
        )
        gradient[rows] = -(density @ jump)
        moments = (density @ outer).reshape(-1, 2, 2) + np.einsum(
            "ni,nj->nij", gradient[rows], mean
        )
        hessian[rows] = -moments @ precision
    return Derivatives(value, gradient, 0.5 * (hessian + hessian.swapaxes(1, 2)))


def bed_moments(mean: np.ndarray, covariance: np.ndarray) -> BedMoments:
    """Moments of N(mean, covariance) restricted to each bed.

    Parameters
    ----------
    mean : (2,) [mm]
    covariance : (2, 2) [mm^2]
    """
    spread = Spread(covariance)
    boundary = boundary_for(spread.deviations[0])
    probability = _flux(mean[None], boundary, spread)[0] @ boundary.sides
    probability[MISS] += 1.0
    weight = (
        _density(_exponent(mean[None], boundary.position, spread), spread)[0][:, None]
        * boundary.normal
    )
    turned = np.einsum("mi,mj->mij", boundary.position - mean, weight)
    first = -(_per_bed(weight, boundary) @ covariance)
    second = (probability[:, None, None] * np.eye(2) - _per_bed(turned, boundary)) @ covariance
    return BedMoments(probability, first, 0.5 * (second + second.swapaxes(1, 2)))


def _per_bed(values: np.ndarray, boundary: Boundary) -> np.ndarray:
    """Sums (83, ...) of values (m, ...) at the nodes along the wires around each bed."""
    return np.tensordot(boundary.sides.T, np.add.reduceat(values, boundary.starts, axis=0), axes=1)


def _flux(means: np.ndarray, boundary: Boundary, spread: Spread) -> np.ndarray:
    """Flux (n, k) of F through each piece of wire, for each mean (n, 2).

    Far from the mean F is that of a source of strength 1: its flux is the angle at which the piece
    is seen, over 2 pi.
    """
    far = FAR * spread.deviations[1]
    if far > MOST_IS_FAR:
        return _flux_of_nodes(means, boundary.position, boundary.normal, boundary.starts, spread)
    flux = boundary.turn * _angles(means, boundary, spread) / (2.0 * np.pi)
    begin, end = boundary.ends[:, 0], boundary.ends[:, 1]
    distance = (
        np.linalg.norm(means[:, None] - 0.5 * (begin + end), axis=2)
        - 0.5 * np.linalg.norm(end - begin, axis=1)
        - BULGE
    )
    near = distance < far
    stops = np.append(boundary.starts[1:], len(boundary.position))
    for piece in np.flatnonzero(near.any(axis=0)):
        rows, nodes = np.flatnonzero(near[:, piece]), slice(boundary.starts[piece], stops[piece])
        flux[rows, piece] = _flux_of_nodes(
            means[rows], boundary.position[nodes], boundary.normal[nodes], np.zeros(1, int), spread
        )[:, 0]
    return flux


def _angles(means: np.ndarray, boundary: Boundary, spread: Spread) -> np.ndarray:
    """Angles (n, k) from the begin to the end of each piece as seen from each mean, where the
    Gaussian is round.
    """
    whiten = _whitening(spread)
    begin, end = (
        (boundary.ends[:, which] @ whiten)[None] - (means @ whiten)[:, None] for which in (0, 1)
    )
    cross = begin[..., 0] * end[..., 1] - begin[..., 1] * end[..., 0]
    return np.arctan2(cross, np.einsum("nkd,nkd->nk", begin, end))


def _flux_of_nodes(
    means: np.ndarray, position: np.ndarray, normal: np.ndarray, starts: np.ndarray, spread: Spread
) -> np.ndarray:
    across = np.einsum("md,md->m", normal, position) - means @ normal.T
    across *= _field(_exponent(means, position, spread), spread)
    return np.add.reduceat(across, starts, axis=1)


def _whitening(spread: Spread) -> np.ndarray:
    return np.linalg.inv(np.linalg.cholesky(spread.covariance)).T


def _exponent(means: np.ndarray, position: np.ndarray, spread: Spread) -> np.ndarray:
    """q (n, m) at nodes (m, 2) for each of the means (n, 2)."""
    whiten = _whitening(spread)
    nodes, means = position @ whiten, means @ whiten
    first, second = (nodes[:, axis] - means[:, axis, None] for axis in (0, 1))
    np.multiply(first, first, out=first)
    np.multiply(second, second, out=second)
    first += second
    first *= 0.5
    return first


def _field(exponent: np.ndarray, spread: Spread) -> np.ndarray:
    """(1 - e^-q) / (4 pi q sqrt(det C)); relative error below 1e-12. exp is several times faster
    than expm1.
    """
    field = np.negative(exponent)
    np.exp(field, out=field)
    np.subtract(1.0, field, out=field)
    near = exponent < SERIES_BELOW
    np.divide(field, exponent, out=field, where=~near)
    if near.any():
        q = exponent[near]
        field[near] = 1.0 - q * (0.5 - q * (1.0 / 6.0 - q / 24.0))
    field *= 1.0 / (4.0 * np.pi * spread.sigma**2)
    return field


def _density(exponent: np.ndarray, spread: Spread) -> np.ndarray:
    return np.exp(-exponent) / (2.0 * np.pi * spread.sigma**2)


def _chunks(n_aims: int, n_nodes: int) -> list[slice]:
    size = max(1, CHUNK // n_nodes)
    return [slice(start, start + size) for start in range(0, n_aims, size)]
