"""Time-varying stiffness from the covariance of a retrieved movement: stiff where the
demonstrations agreed.

A spring holds a unit mass against random pushes. The variance of the mass is then inverse to the
stiffness of the spring (equipartition). So the stiffness along each principal axis of the
covariance is c / variance, with one c for the whole movement. c is such that the axis and instant
with the smallest variance get the largest stiffness that is allowed. Values below the least
stiffness are raised to it.

A spring that becomes stiffer while it is stretched gains energy, so such a spring may drive a mass
away from where it pulls it, whatever the damping. `stable_gains` lets the stiffness grow only as
fast as the damping takes up (Kronander and Billard, 2016).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_covariances, as_finite, as_number, as_samples
from dart_skill.movement._differentiation import Motion
from dart_skill.movement._time import as_stamps, uniform_step

SHRINKS = 0.8
"""Factor by which a step of the stiffness that is too large becomes smaller."""
MOST_TRIALS = 60
"""Largest number of times that a step is made smaller."""


def stiffness_from_covariance(covariance: ArrayLike, least: float, most: float) -> np.ndarray:
    """Symmetric stiffness matrices (n, d, d) [1/s^2] with eigenvalues in [least, most], from
    covariances (n, d, d).

    All d movement variables must have the same unit. Call it separately for metres and radians:
    their variances cannot be compared.

    Raises
    ------
    ValueError
        For a variance that is not positive, or if least is above most.
    """
    covariance = as_covariances(covariance, "covariance", np.shape(covariance))
    least, most = as_number(least, "least"), as_number(most, "most")
    if least > most:
        raise ValueError(f"the least stiffness, {least:g}, is above the largest, {most:g}")
    variance, axes = np.linalg.eigh(covariance)
    if variance.min() <= 0.0:
        worst = int(np.argmin(variance.min(axis=1)))
        raise ValueError(
            f"covariance {worst} has variance {variance.min():.3g} along one axis; it must be"
            " positive"
        )
    gains = np.clip(most * variance.min() / variance, least, most)
    return np.einsum("nij,nj,nkj->nik", axes, gains, axes)


def critical_damping_matrix(stiffness: ArrayLike) -> np.ndarray:
    """2 K^(1/2) (n, d, d): critical damping along every principal axis of stiffness matrices (n,
    d, d).

    Raises
    ------
    ValueError
        For a negative eigenvalue.
    """
    gains, axes = np.linalg.eigh(as_finite(stiffness, "stiffness", 3))
    if gains.min() < 0.0:
        raise ValueError(
            f"stiffness has the eigenvalue {gains.min():.3g}; it must not be negative"
        )
    return np.einsum("nij,nj,nkj->nik", axes, 2.0 * np.sqrt(gains), axes)


def stable_gains(time: ArrayLike, stiffness: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and critical damping (n, d, d), linear between the stamps, with which x'' = K (y -
    x)
    - D x' is stable for every y.

    It is, if for some a > 0 both D - a and 2 a K - K' - a D' are positive semidefinite at all
    times (Kronander and Billard, Stability Considerations for Variable Impedance Control, 2016,
    theorem 1, for a unit mass). Here a is half the least damping. Where the wanted stiffness grows
    faster, it is followed as fast as this allows; it may fall at any rate.

    Parameters
    ----------
    time : (n,)
        Stamps [s], n at least 2.
    stiffness : (n, d, d)
        Wanted, positive definite, per unit mass [1/s^2].

    Raises
    ------
    ValueError
        For an eigenvalue that is not positive.
    """
    stiffness = as_finite(stiffness, "stiffness", 3)
    steps = np.diff(as_stamps(time, len(stiffness), minimum=2))
    least = float(np.linalg.eigvalsh(stiffness).min())
    if least <= 0.0:
        raise ValueError(f"stiffness has the eigenvalue {least:.3g}; all must be positive")
    rate, gains, damping = np.sqrt(least), np.empty_like(stiffness), np.empty_like(stiffness)
    gains[0], damping[0] = stiffness[0], critical_damping_matrix(stiffness[:1])[0]
    for k, step in enumerate(steps):
        gains[k + 1], damping[k + 1] = _grown(gains[k], damping[k], stiffness[k + 1], step, rate)
    return gains, damping


def _grown(
    stiffness: np.ndarray, damping: np.ndarray, wanted: np.ndarray, step: float, rate: float
) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and damping (d, d) a step [s] later: as near to the wanted stiffness as the
    damping takes up.
    """
    share = 1.0
    for _ in range(MOST_TRIALS):
        after = stiffness + share * (wanted - stiffness)
        its_damping = critical_damping_matrix(after[None])[0]
        growth = (after - stiffness + rate * (its_damping - damping)) / step
        if all(
            np.linalg.eigvalsh(2.0 * rate * gains - growth)[0]
            >= -1e-9 * rate * np.abs(gains).max()
            for gains in (stiffness, after)
        ):
            return after, its_damping
        share *= SHRINKS
    return stiffness, damping


def attractor_with_gains(motion: Motion, stiffness: ArrayLike, damping: ArrayLike) -> np.ndarray:
    """Attractor (n, d) with which K (y - x) - D x' makes a motion (n, d): (7.20) for stiffness and
    damping matrices (n, d, d).
    """
    stiffness, damping = as_finite(stiffness, "stiffness", 3), as_finite(damping, "damping", 3)
    pull = motion.acceleration + np.einsum("nij,nj->ni", damping, motion.velocity)
    return motion.position + np.linalg.solve(stiffness, pull[..., None])[..., 0]


def hold_to(
    time: ArrayLike, motion: Motion, stiffness: ArrayLike, push: ArrayLike | None = None
) -> Motion:
    """Motion (n, d) of a unit mass that follows a reference motion with time-varying stiffness,
    and is pushed.

    x'' = x''_ref + K (x_ref - x) + 2 K^(1/2) (x'_ref - x') + push. Without a push the result is
    the reference, whatever the stiffness; the stiffness changes only the response to pushes.

    Parameters
    ----------
    time : (n,)
        Equally spaced stamps [s], n at least 2.
    motion
        The reference, (n, d).
    stiffness : (n, d, d)
        K per unit mass [1/s^2], constant between the stamps.
    push : (n, d)
        Acceleration from outside, in units of the motion per s^2, constant between the stamps;
        default None, no push.

    Raises
    ------
    ValueError
        For stiffness or push of another shape.
    """
    position = as_samples(motion.position, "position")
    step = uniform_step(as_stamps(time, len(position), minimum=2))
    stiffness = as_finite(stiffness, "stiffness", 3)
    n, d = position.shape
    if stiffness.shape != (n, d, d):
        raise ValueError(
            f"stiffness must have shape ({n}, {d}, {d}), one matrix per stamp, got"
            f" {stiffness.shape}"
        )
    push = np.zeros((n, d)) if push is None else as_samples(push, "push", d)
    if len(push) != n:
        raise ValueError(f"push must have {n} rows, one per stamp, got {len(push)}")
    error = _respond(step, stiffness, push)
    velocity = motion.velocity + error[:, d:]
    damping = np.einsum("nij,nj->ni", critical_damping_matrix(stiffness), error[:, d:])
    acceleration = (
        motion.acceleration - np.einsum("nij,nj->ni", stiffness, error[:, :d]) - damping + push
    )
    return Motion(position + error[:, :d], velocity, acceleration)


def _respond(step: float, stiffness: np.ndarray, push: np.ndarray) -> np.ndarray:
    """Deviation from the reference and its rate (n, 2d), both zero at the first stamp.

    Along an axis of stiffness k, w = sqrt(k), the critically damped response over a step h is
    exactly e(h) = u + exp(-w h) ((e0 - u) + (e0' + w (e0 - u)) h) with u = push / k.
    """
    gains, axes = np.linalg.eigh(stiffness)
    w = np.sqrt(np.maximum(gains, 1e-12))
    decay = np.exp(-w * step)
    error = np.zeros((len(push), 2 * push.shape[1]))
    d = push.shape[1]
    for k in range(len(push) - 1):
        turn = axes[k]
        e, rate, rest = (
            turn.T @ error[k, :d],
            turn.T @ error[k, d:],
            (turn.T @ push[k]) / w[k] ** 2,
        )
        slope = rate + w[k] * (e - rest)
        later = rest + decay[k] * (e - rest + slope * step)
        error[k + 1, :d] = turn @ later
        error[k + 1, d:] = turn @ (decay[k] * (slope - w[k] * (e - rest + slope * step)))
    return error
