"""Linear recursions of position and velocity over equal steps: what a spring-damper does that is
driven from stamp to stamp.
"""

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
