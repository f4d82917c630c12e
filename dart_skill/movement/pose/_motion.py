"""Motion of a pose, its attractor (7.20), and the spring-damper that follows it (7.19), on the
manifold.

With v = log_q(y), the rotation vector from the hand q to the attractor y in world axes, and
angular velocity w,
    w' = kp v - kv w,   q' = w q / 2,
which is the goal system of A. Ude, B. Nemec, T. Petric and J. Morimoto, "Orientation in Cartesian
space dynamic movement primitives", ICRA 2014, for a unit inertia. Its inverse is y = exp_q((w' +
kv w) / kp). Positions follow (7.19) and (7.20) as they stand.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common import quaternions
from dart_skill.common.checks import as_finite, as_number, as_vector
from dart_skill.movement._attractor import as_gains, critical_damping, follow_attractor
from dart_skill.movement._differentiation import smooth_derivatives
from dart_skill.movement._orientation import make_continuous
from dart_skill.movement.pose._manifold import as_points, exp_at, log_at

LARGEST_STEP = 0.05
"""Largest step of the integration of a turn, in units of the fastest time constant of the
spring-damper.
"""
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class PoseMotion(NamedTuple):
    """pose (n, 7): position [m] and unit quaternion, neighbours with near signs; velocity (n, 6)
    [m/s, rad/s] and acceleration (n, 6) [m/s^2, rad/s^2], angular ones in world axes.
    """

    pose: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


def as_poses(value: ArrayLike, name: str, n: int | None = None) -> np.ndarray:
    """Poses (n, 7), checked."""
    poses = as_points(value, name, 7, 2)
    if n is not None and len(poses) != n:
        raise ValueError(f"{name} must have {n} rows, one per stamp, got {len(poses)}")
    return poses


def as_pose(value: ArrayLike, name: str) -> np.ndarray:
    """One pose (7,), checked."""
    return as_points(value, name, 7, 1)


def pose_motion(
    time: ArrayLike,
    poses: ArrayLike,
    *,
    noise: ArrayLike | None = None,
    at: ArrayLike | None = None,
) -> PoseMotion:
    """Pose, velocity and acceleration from noisy poses (n, 7) at stamps (n,) [s], n >= 8, by
    `smooth_derivatives`.

    Orientations are smoothed as points of R^4, where no angle is singular and a turn of the world
    is a rotation. The turning s = r q in R^4 has w = 2 s' s* / r^2 and w' = 2 s'' s* / r^2 - 2 (r'
    / r) w (vector parts). Neighbours must be less than half a turn apart.

    Parameters
    ----------
    time
        Increasing stamps.
    poses
        Position and unit quaternion x, y, z, w; signs do not matter.
    noise
        Two numbers, standard deviations of position [m] and of orientation [rad], in each
        direction; default: estimated.
    at
        Stamps (m,) of the result [s], default those of the samples.
    """
    poses = as_poses(poses, "poses")
    levels = (
        [None, None] if noise is None else (as_vector(noise, "noise", 2) * [1.0, 0.5]).tolist()
    )
    straight = smooth_derivatives(time, poses[:, :3], noise=levels[0], at=at)
    rows, first, second = smooth_derivatives(
        time, make_continuous(poses[:, 3:]), noise=levels[1], at=at
    )
    square = np.square(rows).sum(1, keepdims=True)
    back = rows * quaternions.CONJUGATE
    rate = 2.0 * quaternions.product(first, back)[:, :3] / square
    change = (
        2.0 * quaternions.product(second, back)[:, :3] / square
        - 2.0 * (rows * first).sum(1, keepdims=True) / square * rate
    )
    return PoseMotion(
        np.hstack([straight.position, rows / np.sqrt(square)]),
        np.hstack([straight.velocity, rate]),
        np.hstack([straight.acceleration, change]),
    )


def as_pair(value: ArrayLike, name: str, strict: bool) -> np.ndarray:
    """Gains (2,) of position and orientation, from one number for both or two."""
    gains = as_gains(value, None, name, strict)
    if gains.shape not in ((), (2,)):
        raise ValueError(
            f"{name} must be one number, or two for position and orientation, got shape"
            f" {gains.shape}"
        )
    return np.broadcast_to(gains, 2)


def pose_attractor(
    motion: PoseMotion, stiffness: ArrayLike = 200.0, damping: ArrayLike | None = None
) -> np.ndarray:
    """(7.20) on the manifold: the attractor (n, 7) that a spring-damper follows along this motion.

    Parameters
    ----------
    motion
        PoseMotion, pose (n, 7) with velocity and acceleration (n, 6).
    stiffness
        Kp [1/s^2], one number, or two for position and orientation.
    damping
        Kv [1/s], likewise; default: critical, 2 sqrt(kp).

    Raises
    ------
    ValueError
        Where the orientation would have to be pulled by half a turn or more: a spring takes the
        shorter way.
    """
    kp = as_pair(stiffness, "stiffness", strict=True)
    kv = critical_damping(kp) if damping is None else as_pair(damping, "damping", strict=False)
    pose, (velocity, acceleration) = (
        as_poses(motion.pose, "pose"),
        (as_finite(one, "motion", 2) for one in motion[1:]),
    )
    lead = (acceleration + velocity * np.repeat(kv, 3)) / np.repeat(kp, 3)
    angles = np.linalg.norm(lead[:, 3:], axis=1)
    if angles.max() >= np.pi:
        row = int(angles.argmax())
        raise ValueError(
            f"sample {row} turns so fast that its attractor is {np.degrees(angles[row]):.0f}"
            " degrees ahead, and a spring takes the shorter way; raise the stiffness of"
            f" orientation above {kp[1]:g}, or smooth the orientations more"
        )
    return exp_at(pose, lead)


def follow_pose_attractor(
    attractor: ArrayLike,
    step: float,
    pose0: ArrayLike,
    velocity0: ArrayLike,
    stiffness: ArrayLike = 200.0,
    damping: ArrayLike | None = None,
    push: ArrayLike | None = None,
) -> PoseMotion:
    """Motion of n poses that follows an attractor (n, 7), one each `step` [s]; between them it
    moves along geodesics.

    Positions are exact (`follow_attractor`). Orientations are integrated by a Runge-Kutta method
    of fourth order in steps of a twentieth of the fastest time constant at most, which is stable
    at any rate. The hand turns to the attractor the shorter way.

    Parameters
    ----------
    pose0, velocity0
        Pose (7,) and velocity (6,) [m/s, rad/s] at the first stamp.
    stiffness, damping
        As in `pose_attractor`.
    push
        Acceleration (n, 6) [m/s^2, rad/s^2] from outside, in world axes, linear between the
        stamps; default: none.

    Raises
    ------
    ValueError
        For a push of another shape.
    """
    attractor, pose, velocity = (
        as_poses(attractor, "attractor"),
        as_pose(pose0, "pose0"),
        as_vector(velocity0, "velocity0", 6),
    )
    step = as_number(step, "step")
    kp = as_pair(stiffness, "stiffness", strict=True)
    kv = critical_damping(kp) if damping is None else as_pair(damping, "damping", strict=False)
    pushes = np.zeros((len(attractor), 6)) if push is None else as_finite(push, "push")
    if pushes.shape != (len(attractor), 6):
        raise ValueError(
            f"push must have shape ({len(attractor)}, 6), one row per stamp, got {pushes.shape}"
        )
    # (7.19) is linear: a push has the effect of a shift of the attractor by push / kp.
    straight = follow_attractor(
        attractor[:, :3] + pushes[:, :3] / kp[0], step, pose[:3], velocity[:3], kp[0], kv[0]
    )
    turns = make_continuous(attractor[:, 3:])
    rotations, rates = _spin(
        turns, pushes[:, 3:], step, pose[3:], velocity[3:], float(kp[1]), float(kv[1])
    )
    pull = kp[1] * log_at(rotations, turns) - kv[1] * rates + pushes[:, 3:]
    return PoseMotion(
        np.hstack([straight.position, rotations]),
        np.hstack([straight.velocity, rates]),
        np.hstack([straight.acceleration, pull]),
    )


def _spin(
    attractor: np.ndarray,
    push: np.ndarray,
    step: float,
    start: np.ndarray,
    rate: np.ndarray,
    kp: float,
    kv: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Quaternions (n, 4) and angular velocities (n, 3) that follow an attractor (n, 4), with a
    push (n, 3).
    """
    parts = max(1, math.ceil(step * max(math.sqrt(kp), kv) / LARGEST_STEP))
    ways = log_at(attractor[:-1], attractor[1:])
    # The attractor at the ends and middles of all parts: a part needs three of them.
    shares = np.arange(1, 2 * parts + 1)[:, None] / (2.0 * parts)
    stages = exp_at(attractor[:-1, None], shares * ways[:, None]).reshape(-1, 4)
    pushes = (push[:-1, None] + shares * np.diff(push, axis=0)[:, None]).reshape(-1, 3)
    rows = np.hstack([np.vstack([attractor[:1], stages]), np.vstack([push[:1], pushes])])
    targets = [tuple(row) for row in rows.tolist()]
    h, q, w = step / parts, tuple(start.tolist()), tuple(rate.tolist())
    made = [(*q, *w)]
    for i in range(0, len(targets) - 1, 2):
        q, w = _runge_kutta(q, w, targets[i : i + 3], h, kp, kv)
        made.append((*q, *w))
    found = np.array(made[::parts])
    return found[:, :4], found[:, 4:]


# Numbers instead of arrays: a step of arrays with three entries would take ten times longer.


def _runge_kutta(
    q: Quaternion, w: Vector, targets: list[tuple[float, ...]], h: float, kp: float, kv: float
) -> tuple[Quaternion, Vector]:
    """One step of the classical method; the quaternion is normalised."""
    first = _derivative((*q, *w), targets[0], kp, kv)
    state = (*q, *w)
    second = _derivative(_moved(state, first, 0.5 * h), targets[1], kp, kv)
    third = _derivative(_moved(state, second, 0.5 * h), targets[1], kp, kv)
    fourth = _derivative(_moved(state, third, h), targets[2], kp, kv)
    slope = [
        (a + 2.0 * (b + c) + d) / 6.0
        for a, b, c, d in zip(first, second, third, fourth, strict=True)
    ]
    x, y, z, r, *rate = _moved(state, slope, h)
    length = math.sqrt(x * x + y * y + z * z + r * r)
    return (x / length, y / length, z / length, r / length), (rate[0], rate[1], rate[2])


def _moved(state: tuple[float, ...], slope: list[float], h: float) -> tuple[float, ...]:
    return tuple(value + h * change for value, change in zip(state, slope, strict=True))


def _derivative(
    state: tuple[float, ...], target: tuple[float, ...], kp: float, kv: float
) -> list[float]:
    """q' = w q / 2 and w' = kp log_q(y) - kv w + push; target: y and push."""
    x, y, z, r, a, b, c = state
    u, v, t, s, px, py, pz = target
    # The way y q*, its sign such that it is the shorter turn.
    dx, dy, dz = (
        r * u - s * x - v * z + t * y,
        r * v - s * y - t * x + u * z,
        r * t - s * z - u * y + v * x,
    )
    real = s * r + u * x + v * y + t * z
    sine = math.sqrt(dx * dx + dy * dy + dz * dz)
    gain = (
        kp
        * (2.0 * math.atan2(sine, abs(real)) / sine if sine > 1e-12 else 2.0)
        * math.copysign(1.0, real)
    )
    return [
        0.5 * (a * r + b * z - c * y),
        0.5 * (b * r + c * x - a * z),
        0.5 * (c * r + a * y - b * x),
        -0.5 * (a * x + b * y + c * z),
        gain * dx - kv * a + px,
        gain * dy - kv * b + py,
        gain * dz - kv * c + pz,
    ]
