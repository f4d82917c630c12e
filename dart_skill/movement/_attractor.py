"""The virtual attractor: a unit mass pulled by a spring-damper, x'' = kp (y - x) - kv x' (thesis
(7.19)), and its inverse (7.20).

`follow_attractor` does not integrate numerically. If the attractor is linear between its samples,
the motion over a step has a closed form (matrix exponential). So the result is exact and stable at
any rate.

The stiffness may vary: stiff where the demonstrations agreed. A spring holds a unit mass against
random pushes. The variance of the mass is then inverse to the stiffness of the spring
(equipartition). So the stiffness along each principal axis of the covariance is c / variance, with
one c for the whole movement. c is such that the axis and instant with the smallest variance get
the largest stiffness that is allowed. Values below the least stiffness are raised to it.

A spring that becomes stiffer while it is stretched gains energy, so such a spring may drive a mass
away from where it pulls it, whatever the damping. `stable_gains` lets the stiffness grow only as
fast as the damping takes up (Kronander and Billard, 2016).
"""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_covariances, as_finite, as_number, as_samples, as_vector
from dart_skill.movement._differentiation import Motion
from dart_skill.movement._time import as_stamps


def critical_damping(stiffness: ArrayLike) -> np.ndarray:
    """kv = 2 sqrt(kp), at which a unit mass returns fastest without overshoot.

    Parameters
    ----------
    stiffness
        Kp [1/s^2], one number or (d,).
    """
    return 2.0 * np.sqrt(as_gains(stiffness, None, "stiffness", strict=True))


def as_gains(value: ArrayLike, n_dims: int | None, name: str, strict: bool) -> np.ndarray:
    """Gains, one number or one per dimension (d,); broadcast to (n_dims,) if n_dims is given."""
    gains = as_finite(value, name)
    if (
        gains.ndim > 1
        or gains.size == 0
        or (n_dims is not None and gains.shape not in ((), (n_dims,)))
    ):
        raise ValueError(
            f"{name} must be one number or one per dimension ({n_dims}), got shape {gains.shape}"
        )
    if gains.min() < 0 or (strict and gains.min() == 0):
        raise ValueError(
            f"{name} must be {'positive' if strict else 'at least 0'}, got {gains.min():g}"
        )
    return gains if n_dims is None else np.broadcast_to(gains, n_dims)


def attractor_from_motion(
    position: ArrayLike,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    stiffness: ArrayLike,
    damping: ArrayLike | None = None,
) -> np.ndarray:
    """(7.20): attractor (n, d) of a motion: position, velocity and acceleration (n, d).

    Parameters
    ----------
    stiffness : [1/s^2]
    damping : [1/s]
        Per unit mass: one number or (d,). Damping None is critical, 2 sqrt(stiffness).

    Raises
    ------
    ValueError
        If these have not one shape.
    """
    position = as_samples(position, "position")
    velocity, acceleration = (
        as_samples(velocity, "velocity"),
        as_samples(acceleration, "acceleration"),
    )
    if not position.shape == velocity.shape == acceleration.shape:
        raise ValueError(
            f"position, velocity and acceleration must have one shape, got {position.shape},"
            f" {velocity.shape}, {acceleration.shape}"
        )
    kp = as_gains(stiffness, position.shape[1], "stiffness", strict=True)
    kv = as_gains(
        critical_damping(kp) if damping is None else damping,
        position.shape[1],
        "damping",
        strict=False,
    )
    return position + velocity * (kv / kp) + acceleration / kp


def follow_attractor(
    attractor: ArrayLike,
    step: float,
    position0: ArrayLike,
    velocity0: ArrayLike,
    stiffness: ArrayLike,
    damping: ArrayLike | None = None,
) -> Motion:
    """Motion (n, d) that follows an attractor (n, d) by (7.19).

    The attractor is sampled every `step` seconds and linear in between. The motion is at the same
    stamps. Its row 0 is the start: position0 and velocity0 (d,).

    Parameters
    ----------
    stiffness, damping
        As in `attractor_from_motion`.
    """
    attractor = as_samples(attractor, "attractor")
    n_dims = attractor.shape[1]
    step = as_number(step, "step")
    start = np.stack(
        [as_vector(position0, "position0", n_dims), as_vector(velocity0, "velocity0", n_dims)]
    )
    kp = as_gains(stiffness, n_dims, "stiffness", strict=True)
    kv = as_gains(
        critical_damping(kp) if damping is None else damping, n_dims, "damping", strict=False
    )
    if (kp == kp[0]).all() and (kv == kv[0]).all():
        position, velocity = _respond(attractor, step, start, float(kp[0]), float(kv[0]))
        return Motion(position, velocity, kp * (attractor - position) - kv * velocity)
    position, velocity = np.empty_like(attractor), np.empty_like(attractor)
    for pair in {(float(p), float(v)) for p, v in zip(kp, kv, strict=True)}:
        dims = (kp == pair[0]) & (kv == pair[1])
        position[:, dims], velocity[:, dims] = _respond(
            attractor[:, dims], step, start[:, dims], *pair
        )
    return Motion(position, velocity, kp * (attractor - position) - kv * velocity)


@lru_cache(maxsize=64)
def discretise(
    step: float, stiffness: float, damping: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """F (2, 2), g0 (2,) and g1 (2,) of one step s+ = F s + g0 y + g1 y+ of the state s = (x, x' /
    w), w = sqrt(kp).

    During the step the attractor goes linearly from y to y+. A plan asks for the same ones again
    and again: they are kept, and read-only.
    """
    w = np.sqrt(stiffness)
    generator = np.zeros((4, 4))
    generator[:2] = step * np.array([[0.0, w, 0.0, 0.0], [-w, -damping, w, 0.0]])
    generator[2, 3] = 1.0
    from scipy.linalg import expm  # a lesson needs it, and what only plays a plan does not

    flow = expm(generator)
    parts = flow[:2, :2], flow[:2, 2] - flow[:2, 3], flow[:2, 3]
    for part in parts:
        part.flags.writeable = False
    return parts


def _respond(
    attractor: np.ndarray, step: float, start: np.ndarray, stiffness: float, damping: float
) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity (n, d) for one pair of gains, from start (2, d)."""
    unit = np.sqrt(stiffness)
    position, velocity = respond(
        *discretise(step, stiffness, damping), attractor, start / np.array([[1.0], [unit]])
    )
    return position, unit * velocity


def recur(transition: np.ndarray, forcing: np.ndarray) -> np.ndarray:
    """s (2, n, d) with s[:, k] = F s[:, k - 1] + f[:, k], and s[:, 0] = f[:, 0].

    Parameters
    ----------
    transition
        F (2, 2).
    forcing
        f (2, n, d).
    """
    _, n, d = forcing.shape
    states, ahead = forcing.reshape(2, n * d).copy(), d
    # After each round a state holds what came twice as many steps before it.
    while ahead < n * d:
        states[:, ahead:] += transition @ states[:, :-ahead]
        transition, ahead = transition @ transition, 2 * ahead
    return states.reshape(2, n, d)


def respond(
    transition: np.ndarray,
    now: np.ndarray,
    later: np.ndarray,
    attractor: np.ndarray,
    start: np.ndarray,
) -> np.ndarray:
    """s (2, n, d) with s[:, k] = F s[:, k - 1] + g0 y[k - 1] + g1 y[k], and s[:, 0] = start.

    Parameters
    ----------
    transition, now, later
        F (2, 2), g0 (2,) and g1 (2,).
    attractor
        y (n, d).
    start
        (2, d).
    """
    driven = np.multiply.outer(now, attractor[:-1]) + np.multiply.outer(later, attractor[1:])
    return recur(transition, np.concatenate([start[:, None], driven], axis=1))


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
