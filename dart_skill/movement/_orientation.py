"""Orientation of the hand as angle of attack alpha, side slip beta and roll (thesis 8.4.1), and
the quaternion algebra around it.

In a task frame (x towards the target, y horizontally left, z up) the hand's z axis points along
    d = (cos(beta) cos(alpha), sin(beta), cos(beta) sin(alpha)),
so alpha is the elevation in the throwing plane: 0 towards the target, 90 degrees straight up, more
than that if the hand points backwards. beta is the deviation to the left. The whole rotation is
    R = R_y(-alpha) R_z(beta) R_x(roll) R_y(90 deg).
Its last factor turns the hand's z axis to x. So the identity quaternion has alpha = 90 degrees and
beta = roll = 0. If
|beta| < 90 degrees, the three angles are unique but for full turns of alpha and roll, and they vary continuously.
Quaternions are rows x, y, z, w; angles are in radians.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common import quaternions as unchecked
from dart_skill.common.checks import as_finite, as_samples
from dart_skill.common.quaternions import CONJUGATE, product, to_vectors
from dart_skill.movement._time import as_stamps


def normalise(quaternions: ArrayLike) -> np.ndarray:
    """Quaternions (n, 4) scaled to length 1.

    Raises
    ------
    ValueError
        For one of length zero.
    """
    quaternions = as_samples(quaternions, "quaternions", 4)
    lengths = np.sqrt(np.einsum("ni,ni->n", quaternions, quaternions))
    if lengths.min() < 1e-6:
        raise ValueError(
            f"quaternion {int(lengths.argmin())} has length {lengths.min():.3g}; it says no"
            " orientation"
        )
    return quaternions / lengths[:, None]


def make_continuous(quaternions: ArrayLike) -> np.ndarray:
    """Unit quaternions (n, 4) with signs such that neighbours have a non-negative dot product; the
    first keeps its sign.
    """
    return _continuous(normalise(quaternions))


def _continuous(unit_quaternions: np.ndarray) -> np.ndarray:
    flips = np.einsum("ni,ni->n", unit_quaternions[1:], unit_quaternions[:-1]) < 0
    if not flips.any():
        return unit_quaternions
    return unit_quaternions * np.append(1.0, np.where(flips, -1.0, 1.0).cumprod())[:, None]


def multiply(left: ArrayLike, right: ArrayLike) -> np.ndarray:
    """Hamilton products (n, 4) of unit quaternions (n, 4): the rotation by `right`, then by
    `left`.

    One of them may have one row, which is then used for all rows of the other.

    Raises
    ------
    ValueError
        If these are not equally many.
    """
    left, right = normalise(left), normalise(right)
    if len(left) != len(right) and 1 not in (len(left), len(right)):
        raise ValueError(
            f"cannot multiply {len(left)} quaternions by {len(right)}; give equally many, or one"
        )
    return product(left, right)


def rotate(quaternions: ArrayLike, vectors: ArrayLike) -> np.ndarray:
    """Vectors (n, 3) rotated by quaternions (n, 4); one of them may have one row for all rows of
    the other.

    Raises
    ------
    ValueError
        If these are not equally many.
    """
    quaternions, vectors = normalise(quaternions), as_samples(vectors, "vectors", 3)
    if len(quaternions) != len(vectors) and 1 not in (len(quaternions), len(vectors)):
        raise ValueError(
            f"cannot rotate {len(vectors)} vectors by {len(quaternions)} quaternions; give equally"
            " many, or one"
        )
    return unchecked.rotate(quaternions, vectors)


def turn_about_z(quaternions: ArrayLike, angle: float) -> np.ndarray:
    """Orientations (n, 4) turned by an angle [rad] about the vertical.

    -azimuth turns from the world into a task frame, +azimuth back.

    Parameters
    ----------
    quaternions
        (n, 4).
    """
    half = 0.5 * float(as_finite(angle, "angle", 0))
    return product(np.array([0.0, 0.0, np.sin(half), np.cos(half)]), normalise(quaternions))


def pointing_angles(directions: ArrayLike) -> np.ndarray:
    """(n, 2) alpha in (-pi, pi] and beta of directions (n, 3) of any length.

    Raises
    ------
    ValueError
        For a direction of length zero.
    """
    directions = as_samples(directions, "directions", 3)
    lengths = np.linalg.norm(directions, axis=1)
    if lengths.min() == 0:
        raise ValueError(f"direction {int(lengths.argmin())} has length zero; it points nowhere")
    x, y, z = directions.T
    return np.stack([np.arctan2(z, x), np.arctan2(y, np.hypot(x, z))], axis=1)


def angles_from_quaternions(
    quaternions: ArrayLike, alpha_near: float = np.pi / 2, roll_near: float = 0.0
) -> np.ndarray:
    """Angles alpha, beta, roll (n, 3) [rad] of hand orientations (n, 4) in the task frame.

    alpha and roll have no jumps along the sequence. The first alpha is within half a turn of
    `alpha_near`, the first roll within half a turn of `roll_near`. So with the default all
    demonstrations get the same branch, even if the hand starts pointing backwards and below the
    horizontal (alpha up to 270 degrees). Near |beta| = 90 degrees alpha and roll are ill-defined.

    Parameters
    ----------
    quaternions
        (n, 4).
    """
    unit = normalise(quaternions)
    ahead, (x, y, z) = (unchecked.rotate(unit, axis).T for axis in np.eye(3)[[2, 1]])
    alpha, beta = (
        np.arctan2(ahead[2], ahead[0]),
        np.arctan2(ahead[1], np.hypot(ahead[0], ahead[2])),
    )
    sine, cosine = np.sin(alpha), np.cos(alpha)
    # With roll = 0 the y axis (x, y, z) would point to the left; roll turns it up.
    up, left = cosine * z - sine * x, np.cos(beta) * y - np.sin(beta) * (cosine * x + sine * z)
    roll = np.arctan2(up, left)
    smooth, near = np.unwrap([alpha, roll]), np.array([[alpha_near], [roll_near]])
    smooth += 2.0 * np.pi * np.ceil((near - smooth[:, :1]) / (2.0 * np.pi) - 0.5)
    return np.stack([smooth[0], beta, smooth[1]], axis=1)


def quaternions_from_angles(angles: ArrayLike) -> np.ndarray:
    """Unit quaternions (n, 4) in the task frame, with signs as in `make_continuous`, from alpha,
    beta, roll (n, 3) [rad].

    Parameters
    ----------
    angles
        Alpha, beta, roll.
    """
    half = 0.5 * as_samples(angles, "angles", 3).T
    (a, b, r), (ca, cb, cr) = np.sin(half), np.cos(half)
    pointing = np.stack([-a * b, -a * cb, ca * b, ca * cb], axis=1)  # R_y(-alpha) R_z(beta)
    rolled = np.sqrt(0.5) * np.stack([r, cr, r, cr], axis=1)  # R_x(roll) R_y(90 deg)
    return _continuous(product(pointing, rolled))


def angular_velocity(time: ArrayLike, quaternions: ArrayLike) -> np.ndarray:
    """Angular velocity (n, 3) [rad/s] of orientations (n, 4) at increasing stamps (n,) [s], in the
    frame of the orientations.

    The mean rates between neighbours (logarithm of the relative rotation) are interpolated to the
    stamps. This is exact for a constant rate, and of second order otherwise. Neighbours must be
    less than half a turn apart.

    Parameters
    ----------
    quaternions
        (n, 4).
    """
    quaternions = normalise(quaternions)
    time = as_stamps(time, len(quaternions), 2)
    rates = (
        to_vectors(product(quaternions[1:], quaternions[:-1] * CONJUGATE)) / np.diff(time)[:, None]
    )
    if len(rates) == 1:
        return np.repeat(rates, 2, axis=0)
    middles = 0.5 * (time[1:] + time[:-1])
    slopes = np.diff(rates, axis=0) / np.diff(middles)[:, None]
    piece = np.clip(np.searchsorted(middles, time) - 1, 0, len(slopes) - 1)
    return rates[piece] + slopes[piece] * (time - middles[piece])[:, None]
