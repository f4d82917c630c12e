"""The virtual attractor: a unit mass pulled by a spring-damper, x'' = kp (y - x) - kv x' (thesis
(7.19)), and its inverse (7.20).

`follow_attractor` does not integrate numerically. If the attractor is linear between its samples,
the motion over a step has a closed form (matrix exponential). So the result is exact and stable at
any rate.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_finite, as_number, as_samples, as_vector
from dart_skill.movement._differentiation import Motion
from dart_skill.movement._runge_kutta import respond


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
