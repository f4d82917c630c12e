"""Classical Runge-Kutta steps of x'' = stiffness (u(s) - x) - damping x' with a drive that is
known beforehand.

The system is linear. So the four evaluations of a step become one equation, x+ = R x + g0 u(s) +
g1 u(s + h/2) + g2 u(s + h), with matrices that depend on h only. The result is the same, and all
steps can be computed at once.

Linear recursions of position and velocity over equal steps: what a spring-damper does that is
driven from stamp to stamp.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np


def recur(transition: np.ndarray, forcing: np.ndarray) -> np.ndarray:
    """s (2, n, d) with s[:, k] = F s[:, k - 1] + f[:, k], and s[:, 0] = f[:, 0].

    * transition: F (2, 2).
    * forcing: f (2, n, d).
    """
    states = np.array(forcing.swapaxes(0, 1), order="C")
    for before, here in zip(states[:-1], states[1:], strict=True):
        here += transition @ before
    return states.swapaxes(0, 1)


def respond(
    transition: np.ndarray,
    now: np.ndarray,
    later: np.ndarray,
    attractor: np.ndarray,
    start: np.ndarray,
) -> np.ndarray:
    """s (2, n, d) with s[:, k] = F s[:, k - 1] + g0 y[k - 1] + g1 y[k], and s[:, 0] = start.

    * transition, now, later: F (2, 2), g0 (2,) and g1 (2,).
    * attractor: y (n, d).
    * start: (2, d).
    """
    driven = np.multiply.outer(now, attractor[:-1]) + np.multiply.outer(later, attractor[1:])
    return recur(transition, np.concatenate([start[:, None], driven], axis=1))


def one_step(
    transition: np.ndarray,
    kicks: np.ndarray,
    stiffness: float,
    damping: float,
    position: np.ndarray,
    slope: np.ndarray,
    start: np.ndarray,
    drive: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, x' and x'' (2, d) of x'' = u - stiffness (x - start) - damping x' before and after one
    step of integration.

    * transition, kicks: R (2, 2) and [g0, g1, g2] (2, 3) of the step (`step_gains`).
    * stiffness, damping: of the spring-damper.
    * position, slope: x and x' (d,) before it.
    * start: (d,).
    * drive: u (3, d) at the beginning, in the middle and at the end.
    """
    before = np.stack([position - start, slope])
    states = np.stack([before, transition @ before + kicks @ drive], axis=1)
    curvatures = drive[::2] - stiffness * states[0] - damping * states[1]
    return states[0] + start, states[1], curvatures


class Steps(NamedTuple):
    """m steps of integration.

    stages (2 m + 1,): ends and middles of the steps; length: one number, or (m,) if they differ;
    per_node: number of steps from one node to the next.
    """

    stages: np.ndarray
    length: float | np.ndarray
    per_node: int


def divide(nodes: np.ndarray, longest: float) -> Steps:
    """Steps from node to node (n,), with so many steps between two nodes that none is longer than
    `longest`.
    """
    if len(nodes) == 1:
        return Steps(nodes, longest, 1)
    gaps = nodes[1:] - nodes[:-1]
    longest_gap = float(gaps.max())
    per_node = max(1, math.ceil(longest_gap / longest - 1e-9))
    if len(gaps) == 1:
        return Steps(
            nodes[0] + longest_gap * _fractions(per_node), longest_gap / per_node, per_node
        )
    length = gaps / per_node
    even = longest_gap - gaps.min() <= 1e-9 * longest_gap
    stages = np.append(nodes[:-1, None] + gaps[:, None] * _fractions(per_node)[:-1], nodes[-1])
    return Steps(stages, float(length.mean()) if even else np.repeat(length, per_node), per_node)


@lru_cache(maxsize=16)
def _fractions(per_node: int) -> np.ndarray:
    """Ends and middles (2 per_node + 1,) of per_node equal parts of the interval from 0 to 1."""
    return np.arange(2 * per_node + 1) / (2 * per_node)


class StepGains(NamedTuple):
    """R (..., 2, 2) and [g0, g1, g2] (..., 2, 3) on a state of position and velocity, for
    accelerations as drive.
    """

    transition: np.ndarray
    kicks: np.ndarray


def step_gains(length: float | np.ndarray, stiffness: float, damping: float) -> StepGains:
    """Gains for one step length, or for m of them."""
    h = np.asarray(length, dtype=float)[..., None, None]
    a = h * np.array([[0.0, 1.0], [-stiffness, -damping]])
    a2 = a @ a
    a3 = a2 @ a
    eye = np.eye(2)
    first, middle, last = (
        eye + a + a2 / 2.0 + a3 / 4.0,
        4.0 * eye + 2.0 * a + a2 / 2.0,
        np.broadcast_to(eye, a.shape),
    )
    # The drive is an acceleration: it enters through the second column.
    kicks = h / 6.0 * np.stack([first[..., 1], middle[..., 1], last[..., 1]], axis=-1)
    return StepGains(eye + a + a2 / 2.0 + a3 / 6.0 + a2 @ a2 / 24.0, kicks)


# Online execution needs the same step length again and again.
gains_of_equal_steps = lru_cache(maxsize=64)(step_gains)


def integrate(
    steps: Steps, stiffness: float, damping: float, state: np.ndarray, drive: np.ndarray
) -> np.ndarray:
    """Position and velocity (2, n, d) at the n nodes.

    state (2, d): position and velocity at the first node; drive (2 m + 1, d): at the stages.
    """
    if isinstance(steps.length, float):
        states = _integrate_equal(
            gains_of_equal_steps(steps.length, stiffness, damping), state, drive
        )
    else:
        states = _integrate_unequal(step_gains(steps.length, stiffness, damping), state, drive)
    return states[:, :: steps.per_node]


def _integrate_equal(gains: StepGains, state: np.ndarray, drive: np.ndarray) -> np.ndarray:
    states = np.empty((2, len(drive) // 2 + 1, drive.shape[1]))
    states[:, 0] = state
    states[:, 1:] = _kicks(gains, drive)
    return recur(gains.transition, states)


def _integrate_unequal(gains: StepGains, state: np.ndarray, drive: np.ndarray) -> np.ndarray:
    states = np.empty((2, len(drive) // 2 + 1, drive.shape[1]))
    states[:, 0] = state
    states[:, 1:] = _kicks(gains, drive)
    for k, transition in enumerate(gains.transition):
        states[:, k + 1] += transition @ states[:, k]
    return states


def _kicks(gains: StepGains, drive: np.ndarray) -> np.ndarray:
    """What the drive adds in each step (2, m, d)."""
    # Gains (2, 1, 1) for one length, (2, m, 1) for many.
    first, middle, last = (kick.T.reshape(2, -1, 1) for kick in np.moveaxis(gains.kicks, -1, 0))
    return first * drive[:-1:2] + middle * drive[1::2] + last * drive[2::2]
