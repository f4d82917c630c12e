"""Linear recursions of position and velocity over equal steps: what a spring-damper does that is driven from stamp to stamp.

This module is compiled (docs/development.md): _recursion.pxd beside it has the types.
"""

import numpy as np


def recur(transition: np.ndarray, forcing: np.ndarray) -> np.ndarray:
    """s (2, n, d) with s[:, k] = F s[:, k - 1] + f[:, k], and s[:, 0] = f[:, 0].

    * transition: F (2, 2).
    * forcing: f (2, n, d).
    """
    n, n_dims = forcing.shape[1], forcing.shape[2]
    found = np.empty((2, n, n_dims))
    state = found
    for dim in range(n_dims):
        state[0, 0, dim], state[1, 0, dim] = forcing[0, 0, dim], forcing[1, 0, dim]
    for k in range(1, n):
        for dim in range(n_dims):
            x, v = state[0, k - 1, dim], state[1, k - 1, dim]
            state[0, k, dim] = transition[0, 0] * x + transition[0, 1] * v + forcing[0, k, dim]
            state[1, k, dim] = transition[1, 0] * x + transition[1, 1] * v + forcing[1, k, dim]
    return found


def respond(transition: np.ndarray, now: np.ndarray, later: np.ndarray, attractor: np.ndarray, start: np.ndarray) -> np.ndarray:
    """s (2, n, d) with s[:, k] = F s[:, k - 1] + g0 y[k - 1] + g1 y[k], and s[:, 0] = start.

    * transition, now, later: F (2, 2), g0 (2,) and g1 (2,).
    * attractor: y (n, d).
    * start: (2, d).
    """
    n, n_dims = attractor.shape[0], attractor.shape[1]
    found = np.empty((2, n, n_dims))
    state = found
    for dim in range(n_dims):
        state[0, 0, dim], state[1, 0, dim] = start[0, dim], start[1, dim]
    for k in range(1, n):
        for dim in range(n_dims):
            x, v, before, here = state[0, k - 1, dim], state[1, k - 1, dim], attractor[k - 1, dim], attractor[k, dim]
            state[0, k, dim] = transition[0, 0] * x + transition[0, 1] * v + (now[0] * before + later[0] * here)
            state[1, k, dim] = transition[1, 0] * x + transition[1, 1] * v + (now[1] * before + later[1] * here)
    return found


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
    """x, x' and x'' (2, d) of x'' = u - stiffness (x - start) - damping x' before and after one step of integration.

    * transition, kicks: R (2, 2) and [g0, g1, g2] (2, 3) of the step (`step_gains`).
    * stiffness, damping: of the spring-damper.
    * position, slope: x and x' (d,) before it.
    * start: (d,).
    * drive: u (3, d) at the beginning, in the middle and at the end.
    """
    n_dims = position.shape[0]
    places, slopes, curvatures = np.empty((2, n_dims)), np.empty((2, n_dims)), np.empty((2, n_dims))
    place, rate, curvature = places, slopes, curvatures
    for dim in range(n_dims):
        x, v = position[dim] - start[dim], slope[dim]
        first, middle, last = drive[0, dim], drive[1, dim], drive[2, dim]
        y = transition[0, 0] * x + transition[0, 1] * v + (kicks[0, 0] * first + kicks[0, 1] * middle + kicks[0, 2] * last)
        w = transition[1, 0] * x + transition[1, 1] * v + (kicks[1, 0] * first + kicks[1, 1] * middle + kicks[1, 2] * last)
        place[0, dim], place[1, dim], rate[0, dim], rate[1, dim] = position[dim], start[dim] + y, v, w
        curvature[0, dim], curvature[1, dim] = first - stiffness * x - damping * v, last - stiffness * y - damping * w
    return places, slopes, curvatures
