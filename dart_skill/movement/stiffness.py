"""Stiff where the demonstrations agreed: the covariance of a retrieved movement as time-varying stiffness.

A spring that holds a unit mass against random pushes lets it stray with a variance inverse to its stiffness (equipartition). So the
stiffness along each principal axis of the covariance is c / variance, with one c for the whole movement: the axis and instant on which the
demonstrations agreed best get the largest stiffness allowed, and none gets less than the least.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.checks import as_covariances, as_finite, as_number, as_samples
from dart_skill.movement._time import as_stamps, uniform_step
from dart_skill.movement.differentiation import Motion


def stiffness_from_covariance(covariance: ArrayLike, least: float, most: float) -> np.ndarray:
    """Stiffness matrices (n, d, d) [1/s^2], symmetric, eigenvalues in [least, most], from covariances (n, d, d) of one unit.

    Movement variables of different units (metres, radians) are given one after the other: their covariances cannot be compared.
    """
    covariance = as_covariances(covariance, "covariance", np.shape(covariance))
    least, most = as_number(least, "least"), as_number(most, "most")
    if least > most:
        raise ValueError(f"the least stiffness, {least:g}, is above the largest, {most:g}")
    variance, axes = np.linalg.eigh(covariance)
    if variance.min() <= 0.0:
        worst = int(np.argmin(variance.min(axis=1)))
        raise ValueError(f"covariance {worst} has variance {variance.min():.3g} along one axis; it must be positive")
    gains = np.clip(most * variance.min() / variance, least, most)
    return np.einsum("nij,nj,nkj->nik", axes, gains, axes)


def critical_damping_matrix(stiffness: ArrayLike) -> np.ndarray:
    """2 K^(1/2) (n, d, d): critical damping along every principal axis of stiffness matrices (n, d, d)."""
    gains, axes = np.linalg.eigh(as_finite(stiffness, "stiffness", 3))
    if gains.min() < 0.0:
        raise ValueError(f"stiffness has the eigenvalue {gains.min():.3g}; it must not be negative")
    return np.einsum("nij,nj,nkj->nik", axes, 2.0 * np.sqrt(gains), axes)


def hold_to(time: ArrayLike, motion: Motion, stiffness: ArrayLike, push: ArrayLike | None = None) -> Motion:
    """What a unit mass does that shall follow a motion (n, d) with time-varying stiffness (n, d, d), pushed by push (n, d) [1/s^2].

    x'' = x''_ref + K (x_ref - x) + 2 K^(1/2) (x'_ref - x') + push. Unpushed, the motion stays as it is whatever the stiffness; only the
    answer to pushes changes. Equally spaced stamps (n,); between them K and push are held, and the step is exact (matrix exponential).
    """
    position = as_samples(motion.position, "position")
    step = uniform_step(as_stamps(time, len(position), minimum=2))
    stiffness = as_finite(stiffness, "stiffness", 3)
    n, d = position.shape
    if stiffness.shape != (n, d, d):
        raise ValueError(f"stiffness must have shape ({n}, {d}, {d}), one matrix per stamp, got {stiffness.shape}")
    push = np.zeros((n, d)) if push is None else as_samples(push, "push", d)
    if len(push) != n:
        raise ValueError(f"push must have {n} rows, one per stamp, got {len(push)}")
    error = _respond(step, stiffness, push)
    velocity = motion.velocity + error[:, d:]
    damping = np.einsum("nij,nj->ni", critical_damping_matrix(stiffness), error[:, d:])
    acceleration = motion.acceleration - np.einsum("nij,nj->ni", stiffness, error[:, :d]) - damping + push
    return Motion(position + error[:, :d], velocity, acceleration)


def _respond(step: float, stiffness: np.ndarray, push: np.ndarray) -> np.ndarray:
    """Deviation from the reference and its rate (n, 2d), from rest at the first stamp.

    Along an axis of stiffness k, w = sqrt(k), the critically damped answer over a step is
    e(h) = u + exp(-w h) ((e0 - u) + (e0' + w (e0 - u)) h) with u = push / k.
    """
    gains, axes = np.linalg.eigh(stiffness)
    w = np.sqrt(np.maximum(gains, 1e-12))
    decay = np.exp(-w * step)
    error = np.zeros((len(push), 2 * push.shape[1]))
    d = push.shape[1]
    for k in range(len(push) - 1):
        turn = axes[k]
        e, rate, rest = turn.T @ error[k, :d], turn.T @ error[k, d:], (turn.T @ push[k]) / w[k] ** 2
        slope = rate + w[k] * (e - rest)
        later = rest + decay[k] * (e - rest + slope * step)
        error[k + 1, :d] = turn @ later
        error[k + 1, d:] = turn @ (decay[k] * (slope - w[k] * (e - rest + slope * step)))
    return error
