"""Where cameras and arm stand to each other, from nothing but what both say of the hand: p = s Q
(a + A h) + t and R = P A H.

a, A are position and rotation of the hand by the arm's kinematics, p, R those that the cameras
see. Positions and orientations are fitted by themselves, so that a fault of one does not hide
behind the other: the scale s of lengths, a world Q that may be turned anyhow or mirrored, and the
tracked body h, H on the hand. Scale, turn and shift by Umeyama (1991), turns P and H by Shah
(2013).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dart_skill.common.quaternions import matrices

ROUNDS = 12
"""Rounds in which the parts of a fit are solved in turn."""
SETTLED = 1e-4
"""A fit is over when a round takes away a smaller share of what is left."""
LEVER = 0.1
"""Standard deviation of where the tracked body may be on the hand [m]."""
PRECISE = 0.01
"""Standard deviation of a position, against which that counts [m]."""
TOLERATED = 6.0
"""Residuals beyond so many medians are of samples that are not explained."""
LEAST_ANGLE = 0.002
"""Median of residuals that no cameras fall below [rad]."""
DOUBTFUL = 0.1
"""Error of a fit to all samples from which some may not be explained [rad]."""
LEAST_ROWS = 4
"""Samples that a beginning needs."""


@dataclass(frozen=True)
class PositionFit:
    """What explains the positions of the hand.

    Parameters
    ----------
    scale
        Length that the cameras tell, of one metre.
    world
        Orthogonal matrix (3, 3) from the axes of the arm to those of the cameras; its determinant
        is -1 where these are mirrored.
    shift
        (3,) origin of the arm in the world of the cameras, in the length of the cameras.
    lever
        (3,) tracked body in the frame of the hand [m].
    residual
        (n,) what is left of each position [m].
    """

    scale: float
    world: np.ndarray
    shift: np.ndarray
    lever: np.ndarray
    residual: np.ndarray

    @property
    def error(self) -> float:
        """Root mean square of what is left, without a tenth of the samples [m]."""
        return _trimmed(self.residual, 0.9)


@dataclass(frozen=True)
class OrientationFit:
    """What explains the orientations of the hand.

    Parameters
    ----------
    world
        Rotation (3, 3) from the axes of the arm to those of the cameras.
    hand
        Rotation (3, 3) of the tracked body in the frame of the hand.
    residual
        (n,) angles of what is left of each orientation [rad].
    """

    world: np.ndarray
    hand: np.ndarray
    residual: np.ndarray

    @property
    def error(self) -> float:
        """Root mean square of what is left, of the better two thirds of the samples [rad]."""
        return _trimmed(self.residual, 2.0 / 3.0)


def _trimmed(residual: np.ndarray, share: float) -> float:
    """Root mean square of the smallest residuals (n,), of a share of them."""
    return float(
        np.sqrt(np.mean(np.sort(np.square(residual))[: max(1, round(share * len(residual)))]))
    )


def fit_positions(
    seen: np.ndarray, place: np.ndarray, rotation: np.ndarray, may_mirror: bool = True
) -> PositionFit:
    """The fit of positions (n, 3) that cameras saw to places (n, 3) [m] and rotations (n, 3, 3) of
    the hand by the arm.

    Parameters
    ----------
    seen
        In any length.
    place, rotation
        By the arm's kinematics.
    may_mirror
        Whether a world that is mirrored will do.
    """
    scale, world, shift = (part[0] for part in similarity(seen, place[None], may_mirror))
    fit = _position_fit(seen, place, rotation, float(scale), world, shift, np.zeros(3))
    best = fit
    for _ in range(ROUNDS):
        fit = _better_positions(fit, place, rotation, seen)
        if fit.error >= (1.0 - SETTLED) * best.error and fit.error > 0.5 * best.error:
            best = min(best, fit, key=lambda one: one.error)
            continue
        best = fit
    return best


def _position_fit(
    seen: np.ndarray,
    place: np.ndarray,
    rotation: np.ndarray,
    scale: float,
    world: np.ndarray,
    shift: np.ndarray,
    lever: np.ndarray,
) -> PositionFit:
    scale = max(scale, 1e-9)
    residual = np.linalg.norm((seen - shift) @ world / scale - place - rotation @ lever, axis=1)
    return PositionFit(scale, world, shift, lever, residual)


def _better_positions(
    fit: PositionFit, place: np.ndarray, rotation: np.ndarray, seen: np.ndarray
) -> PositionFit:
    """A round of Gauss and Newton on turn, scale, shift and lever, in the axes of the arm."""
    body = place + rotation @ fit.lever
    back = (seen - fit.shift) @ fit.world / fit.scale
    n = len(body)
    design = np.zeros((n, 3, 10))
    # a small turn of the body about each axis
    design[:, :, :3] = np.cross(np.eye(3)[None], body[:, None]).transpose(0, 2, 1)
    design[:, :, 3], design[:, :, 4:7], design[:, :, 7:] = body, np.eye(3), rotation
    prior = np.zeros((3, 10))
    prior[:, 7:] = np.eye(3) / LEVER
    change = np.linalg.lstsq(
        np.vstack([design.reshape(-1, 10) / PRECISE, prior]),
        np.concatenate([(back - body).ravel() / PRECISE, -fit.lever / LEVER]),
        rcond=None,
    )[0]
    half = change[:3] / 2.0
    world = fit.world @ matrices(np.append(half, 1.0) / np.sqrt(1.0 + half @ half))
    shift = fit.shift + fit.scale * fit.world @ change[4:7]
    return _position_fit(
        seen, place, rotation, fit.scale * (1.0 + change[3]), world, shift, fit.lever + change[7:]
    )


def similarity(
    seen: np.ndarray, bodies: np.ndarray, may_mirror: bool = True
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scales (m,), orthogonal matrices (m, 3, 3) and shifts (m, 3) that take each of m sets of
    points to the same points (n, 3).

    Least squares by Umeyama, "Least-squares estimation of transformation parameters between two
    point patterns", 1991.

    Parameters
    ----------
    seen
        (n, 3) points.
    bodies
        (m, n, 3) sets of points.
    may_mirror
        Whether a matrix may have determinant -1.
    """
    centre, centres = seen.mean(axis=0), bodies.mean(axis=1)
    around = bodies - centres[:, None]
    left, values, right = np.linalg.svd(np.einsum("nd,mne->mde", seen - centre, around))
    signs = np.ones_like(values)
    if not may_mirror:
        signs[:, 2] = np.linalg.det(left @ right)
    world = left * signs[:, None] @ right
    spread = np.square(around).sum(axis=(1, 2))
    scale = (values * signs).sum(axis=1) / np.maximum(spread, 1e-12)
    return scale, world, centre - scale[:, None] * np.einsum("mde,me->md", world, centres)


def fit_orientations(
    seen: np.ndarray, rotation: np.ndarray, rounds: int = ROUNDS, starts: int = 1
) -> OrientationFit:
    """The fit of rotations (n, 3, 3) that cameras saw to those by the arm (n, 3, 3); samples that
    nothing explains do not count.

    It begins with the closed form of Shah, "Solving the robot-world/hand-eye calibration problem
    using the Kronecker product", 2013.

    Parameters
    ----------
    seen
        Of the tracked body, in the world of the cameras.
    rotation
        Of the hand, by the arm's kinematics.
    rounds
        In which samples that are not explained lose weight, at most.
    starts
        Beginnings: with all samples, and where that is doubtful with parts of them, which may be
        free of what is not explained.
    """
    fit = _orientation_fit(seen, rotation, *_closed_form(seen, rotation))
    if fit.error > DOUBTFUL:
        parts = [np.arange(k, len(seen), starts - 1) for k in range(starts - 1)]
        begun = [
            _orientation_fit(seen, rotation, *_closed_form(seen[rows], rotation[rows]))
            for rows in parts
            if len(rows) >= LEAST_ROWS
        ]
        fit = min([fit, *begun], key=lambda one: one.error)
    for _ in range(rounds):
        farthest = TOLERATED * max(float(np.median(fit.residual)), LEAST_ANGLE)
        weight = np.square(np.maximum(0.0, 1.0 - np.square(fit.residual / farthest)))
        world = _rotation(np.einsum("n,nij,nkj->ik", weight, seen, rotation @ fit.hand))
        hand = _rotation(np.einsum("n,nji,njk->ik", weight, world @ rotation, seen))
        before, fit = fit, _orientation_fit(seen, rotation, world, hand)
        if abs(before.error - fit.error) <= SETTLED * fit.error:
            break
    return fit


def _orientation_fit(
    seen: np.ndarray, rotation: np.ndarray, world: np.ndarray, hand: np.ndarray
) -> OrientationFit:
    left = (world @ rotation @ hand).transpose(0, 2, 1) @ seen
    return OrientationFit(world, hand, turn_angles(left))


def turn_angles(rotation: np.ndarray) -> np.ndarray:
    """Angles (n,) of rotations (n, 3, 3) [rad]."""
    trace = np.trace(rotation, axis1=1, axis2=2)
    axis = rotation[:, [2, 0, 1], [1, 2, 0]] - rotation[:, [1, 2, 0], [2, 0, 1]]
    return np.arctan2(np.linalg.norm(axis, axis=1), trace - 1.0)


def _closed_form(seen: np.ndarray, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Turns of world and hand: seen hand' = world rotation, summed as Kronecker products."""
    product = np.einsum("nij,nkl->ikjl", seen, rotation).reshape(9, 9)
    left, _values, right = np.linalg.svd(product)
    # vec(world) and vec(hand') are a pair of singular vectors, up to one sign for both.
    world, hand = left[:, 0].reshape(3, 3), right[0].reshape(3, 3)
    sign = np.sign(np.linalg.det(world)) or 1.0
    return _rotation(sign * world), _rotation(sign * hand).T


def _rotation(matrix: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) that is nearest to a matrix (3, 3)."""
    left, _values, right = np.linalg.svd(matrix)
    return left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
