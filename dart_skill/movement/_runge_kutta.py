"""Classical Runge-Kutta steps of x'' = stiffness (u(s) - x) - damping x' with a drive that is
known beforehand.

The system is linear. So the four evaluations of a step become one equation, x+ = R x + g0 u(s) +
g1 u(s + h/2) + g2 u(s + h), with matrices that depend on h only. The result is the same, and all
steps can be computed at once. `recur` and `respond` are the same recursion for a spring-damper
that is driven from stamp to stamp.
"""

import math
from typing import NamedTuple

import numpy as np


def recur(transition: np.ndarray, forcing: np.ndarray) -> np.ndarray:
    """s (2, n, d) with s[:, k] = F s[:, k - 1] + f[:, k], and s[:, 0] = f[:, 0].

    Parameters
    ----------
    transition
        F (2, 2).
    forcing
        f (2, n, d).
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


class Steps(NamedTuple):
    """m steps of integration.

    Parameters
    ----------
    stages : (2 m + 1,)
        Ends and middles of the steps.
    length
        One number, or (m,) if they differ.
    per_node
        Number of steps from one node to the next.
    """

    stages: np.ndarray
    length: float | np.ndarray
    per_node: int


def divide(nodes: np.ndarray, longest: float) -> Steps:
    """Steps from node to node (n,), none of which is longer than `longest`."""
    if len(nodes) == 1:
        return Steps(nodes, longest, 1)
    gaps = nodes[1:] - nodes[:-1]
    longest_gap = float(gaps.max())
    per_node = max(1, math.ceil(longest_gap / longest - 1e-9))
    length = gaps / per_node
    even = longest_gap - gaps.min() <= 1e-9 * longest_gap
    fractions = np.arange(2 * per_node) / (2 * per_node)
    stages = np.append(nodes[:-1, None] + gaps[:, None] * fractions, nodes[-1])
    return Steps(stages, float(length.mean()) if even else np.repeat(length, per_node), per_node)


def step_gains(
    length: float | np.ndarray, stiffness: float, damping: float
) -> tuple[np.ndarray, np.ndarray]:
    """R (..., 2, 2) and [g0, g1, g2] (..., 2, 3) on a state of position and velocity, for one step
    length or for m of them. The drive is an acceleration.
    """
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
    return eye + a + a2 / 2.0 + a3 / 6.0 + a2 @ a2 / 24.0, kicks


def integrate(
    steps: Steps, stiffness: float, damping: float, state: np.ndarray, drive: np.ndarray
) -> np.ndarray:
    """Position and velocity (2, n, d) at the n nodes.

    Parameters
    ----------
    state : (2, d)
        Position and velocity at the first node.
    drive : (2 m + 1, d)
        At the stages.
    """
    transitions, kicks = step_gains(steps.length, stiffness, damping)
    # Kicks (2, 1, 1) for one length, (2, m, 1) for many.
    first, middle, last = (kick.T.reshape(2, -1, 1) for kick in np.moveaxis(kicks, -1, 0))
    states = np.empty((2, len(drive) // 2 + 1, drive.shape[1]))
    states[:, 0] = state
    states[:, 1:] = first * drive[:-1:2] + middle * drive[1::2] + last * drive[2::2]
    if transitions.ndim == 2:
        states = recur(transitions, states)
    else:
        for k, transition in enumerate(transitions):
            states[:, k + 1] += transition @ states[:, k]
    return states[:, :: steps.per_node]
