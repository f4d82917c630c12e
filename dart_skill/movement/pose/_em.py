"""Expectation maximisation for mixtures of poses that are seen from one or several task frames at
once.

A block (n, w) holds the samples as one frame sees them: q numbers (time, inputs), a position and a
quaternion. All blocks share the responsibilities (Calinon 2016). The M step moves each mean by the
mean tangent vector of its samples and takes their covariance there (Simo-Serra, Torras and
Moreno-Noguer, "3D human pose tracking priors using geodesic mixture models", IJCV 122, 2017). When
EM has converged, each mean is the intrinsic mean of its samples.

Scales, by which the covariance floor is measured, belong to each number, to the position as a
whole and to the rotation as a whole. So a turn of all data turns the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common import quaternions
from dart_skill.common.checks import as_vector
from dart_skill.common.constants import UNTURNED
from dart_skill.mixture import (
    DEAD_SHARE,
    Parameters,
    kmeans_start,
    normalise_log,
    raise_to_floor,
)
from dart_skill.movement._placement import moments_of
from dart_skill.movement.pose._gaussians import as_rows, log_normals
from dart_skill.movement.pose._manifold import (
    as_points,
    exp_at,
    log_at,
    means_of,
    turn_covariances,
)


@dataclass(frozen=True, eq=False)
class Blocks:
    """Samples as P frames see them.

    Parameters
    ----------
    rows
        P arrays (n, w).
    seen : (P, n)
        Whether the frame is there.
    scales
        P arrays (d,), units of the tangent space.
    correlated
        Whether position and rotation of a component may be correlated beyond what the numbers say
        of both.
    """

    rows: list[np.ndarray]
    seen: np.ndarray
    scales: list[np.ndarray]
    correlated: bool = True


def scales_of(
    rows: np.ndarray, weights: np.ndarray, least: np.ndarray | float = 0.0
) -> np.ndarray:
    """Standard deviations (d,): of each number, of the position and of the rotation; at least
    `least`, 1 where all is still.
    """
    share = weights / weights.sum()
    numbers = rows[:, :-4] - rows[0, :-4]
    variance = share @ np.square(numbers - share @ numbers)
    way = log_at(means_of(rows, share[:, None])[0], rows)[:, -3:]
    groups = [
        variance[:-3],
        np.full(3, variance[-3:].mean()),
        np.full(3, (share @ np.square(way)).mean()),
    ]
    scale = np.maximum(np.sqrt(np.concatenate(groups)), least)
    return np.where(scale > 1e-12, scale, 1.0)


def tangents_at(blocks: Blocks, means: Sequence[np.ndarray]) -> list[np.ndarray]:
    """P arrays (K, n, d) of tangent vectors from means, P arrays (K, w), to all samples."""
    return [log_at(mean[:, None], rows) for mean, rows in zip(means, blocks.rows, strict=True)]


def expectation(
    blocks: Blocks, parameters: Parameters, tangents: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """E step: responsibilities (n, K) and log densities (n,)."""
    terms = [
        seen * log_normals(*one)
        for seen, *one in zip(blocks.seen, tangents, parameters.covariances, strict=True)
    ]
    return normalise_log(sum(terms, np.zeros(())).T + np.log(parameters.priors))


def maximisation(
    blocks: Blocks,
    counts: np.ndarray,
    floor: float,
    near: tuple[list[np.ndarray], list[np.ndarray]] | None = None,
) -> tuple[Parameters, list[np.ndarray]]:
    """M step from counts (n, K): parameters, and the tangent vectors from their means.

    From means and tangent vectors `near` that are given the means move by one step; else they are
    the intrinsic means.
    """
    mass = counts.sum(0)
    means, covariances, tangents = [], [], []
    for j, (rows, scale) in enumerate(zip(blocks.rows, blocks.scales, strict=True)):
        shares = _shares(counts, blocks.seen[j])
        mean = (
            means_of(rows, shares)
            if near is None
            else exp_at(near[0][j], (shares.T[:, None] @ near[1][j])[:, 0])
        )
        means.append(mean)
        tangents.append(log_at(mean[:, None], rows))
        covariances.append(_covariances(tangents[j], shares, scale, floor, blocks.correlated))
    return Parameters(mass / mass.sum(), means, covariances), tangents


def _shares(counts: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Counts (n, K) of the samples that a frame sees, normalised; a component that it does not see
    gets those of all samples.
    """
    counts = np.where(seen[:, None], counts, 0.0)
    mass = counts.sum(0)
    unowned = mass < DEAD_SHARE * mass.sum() / len(counts)
    counts = np.where(unowned, counts.sum(1, keepdims=True), counts)
    return counts / counts.sum(0)


def _covariances(
    tangents: np.ndarray, shares: np.ndarray, scale: np.ndarray, floor: float, correlated: bool
) -> np.ndarray:
    """Covariances (K, d, d) of tangent vectors (K, n, d) with shares (n, K), each eigenvalue at
    least the floor in units of scale.
    """
    scaled = tangents / scale
    scatter = np.swapaxes(scaled * shares.T[..., None], 1, 2) @ scaled
    scatter = raise_to_floor(0.5 * (scatter + np.swapaxes(scatter, 1, 2)), floor)
    return (scatter if correlated else _independent(scatter)) * np.outer(scale, scale)


def _independent(covariances: np.ndarray) -> np.ndarray:
    """Covariances (K, d, d) in which position and rotation are independent, given the numbers: the
    likeliest such ones.
    """
    q, made = covariances.shape[-1] - 6, covariances.copy()
    numbers, position, rotation = slice(0, q), slice(q, q + 3), slice(q + 3, q + 6)
    common = covariances[:, position, numbers] @ np.linalg.solve(
        covariances[:, numbers, numbers], covariances[:, numbers, rotation]
    )
    made[:, position, rotation], made[:, rotation, position] = common, np.swapaxes(common, 1, 2)
    return made


def iterate(
    blocks: Blocks,
    weights: np.ndarray,
    start: Parameters,
    floor: float,
    tolerance: float,
    max_iterations: int,
) -> tuple[Parameters, float, int, bool]:
    """EM from parameters: what was found, its log-likelihood, the weighted mean per sample, the
    number of iterations, and whether they converged. A component that loses its samples is
    dropped.
    """
    weights = weights / weights.mean()
    parameters, tangents, previous = start, tangents_at(blocks, start.means), -np.inf
    for iteration in range(1, max_iterations + 1):
        shares, log_density = expectation(blocks, parameters, tangents)
        likelihood = float(weights @ log_density) / len(weights)
        if abs(likelihood - previous) <= tolerance:
            return parameters, likelihood, iteration, True
        previous, counts = likelihood, shares * weights[:, None]
        alive = counts.sum(0) > DEAD_SHARE
        near = [mean[alive] for mean in parameters.means], [one[alive] for one in tangents]
        parameters, tangents = maximisation(blocks, counts[:, alive], floor, near)
    return parameters, previous, max_iterations, False


def responsibilities_by_kmeans(
    blocks: Blocks, weights: np.ndarray, n_components: int, rng: np.random.Generator
) -> np.ndarray:
    """(n, K) by k-means++ of the tangent vectors at the mean of all samples, in units of their
    spread, over all blocks.
    """
    share = weights[:, None] / weights.sum()
    flat = [
        log_at(means_of(rows, share), rows) / scale
        for rows, scale in zip(blocks.rows, blocks.scales, strict=True)
    ]
    return kmeans_start(np.hstack(flat), weights, n_components, rng)


IDENTITY = np.array(UNTURNED)
"""Orientation of the axes of the world."""


@dataclass(frozen=True, eq=False)
class PoseFrame:
    """Task frame of poses: a place and axes of its own. Columns before the pose, such as time,
    pass through.

    Parameters
    ----------
    position : (3,)
        Origin of the frame in the world [m].
    orientation : (4,)
        Of its axes in the world, unit quaternion x, y, z, w; default: the axes of the world.

    Raises
    ------
    ValueError
        For what is not finite, has another shape, or for a quaternion whose length is not 1.
    """

    position: np.ndarray
    orientation: np.ndarray = field(default_factory=IDENTITY.copy)

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", as_vector(self.position, "position", 3))
        object.__setattr__(self, "orientation", as_points(self.orientation, "orientation", 4, 1))

    def to_frame(self, rows: ArrayLike) -> np.ndarray:
        """Rows (n, q + 7) of the world as the frame sees them."""
        return see(as_rows(rows, "rows"), self.position, self.orientation)

    def from_frame(self, rows: ArrayLike) -> np.ndarray:
        """Rows (n, q + 7) of this frame in the world."""
        return place(as_rows(rows, "rows"), self.position, self.orientation)


PoseCourse = PoseFrame | Sequence[PoseFrame | None] | None
"""A frame: one for all samples, or one for each of them; None where it is missing."""


def see(rows: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """Rows (..., q + 7) of the world in frames at positions (..., 3) with orientations (..., 4)."""
    back = orientation * quaternions.CONJUGATE
    local = quaternions.rotate(back, rows[..., -7:-4] - position)
    return _joined(rows, local, quaternions.product(back, rows[..., -4:]))


def place(rows: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """Rows (..., q + 7) of frames at positions (..., 3) with orientations (..., 4) in the world."""
    world = quaternions.rotate(orientation, rows[..., -7:-4]) + position
    return _joined(rows, world, quaternions.product(orientation, rows[..., -4:]))


def _joined(rows: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    numbers = np.broadcast_to(rows[..., :-7], (*orientation.shape[:-1], rows.shape[-1] - 7))
    return np.concatenate([numbers, position, orientation], axis=-1)


@dataclass(frozen=True, eq=False)
class Stage:
    """P frames at m moments: position (m, P, 3), orientation (m, P, 4), seen (m, P)."""

    position: np.ndarray
    orientation: np.ndarray
    seen: np.ndarray

    @classmethod
    def of(
        cls, courses: Sequence[PoseCourse], n: int, name: str, n_frames: int | None = None
    ) -> Stage:
        """Frames as given for n moments; a single moment if none of them moves."""
        moments = moments_of(courses, n, name, n_frames, (PoseFrame,))
        seen = np.array([[frame is not None for frame in row] for row in moments])
        if not seen.any(1).all():
            raise ValueError(
                f"all task frames are missing at moment {int(seen.any(1).argmin())} of {name};"
                " give one at least"
            )
        frames = [[frame or PoseFrame(np.zeros(3)) for frame in row] for row in moments]
        return cls(
            np.array([[frame.position for frame in row] for row in frames]),
            np.array([[frame.orientation for frame in row] for row in frames]),
            seen,
        )

    def place(self, means: np.ndarray, covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gaussians of the frames in the world: means (P, K, w) as (m, K, P, w), covariances (P,
        K, d, d) as (m, K, P, d, d).
        """
        world = place(means, self.position[:, :, None], self.orientation[:, :, None])
        turned = turn_covariances(
            covariances,
            quaternions.matrices(self.orientation)[:, :, None],
            covariances.shape[-1] - 6,
        )
        return np.swapaxes(world, 1, 2), np.swapaxes(turned, 1, 2)
