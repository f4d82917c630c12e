"""Checks of stamps: seconds, strictly increasing, and equally spaced where that is needed."""

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_vector


def as_stamps(time: ArrayLike, n_samples: int | None = None, minimum: int = 1) -> np.ndarray:
    """Strictly increasing stamps (n_samples,) in seconds, at least `minimum` of them."""
    time = as_vector(time, "time", n_samples)
    if len(time) < minimum:
        raise ValueError(f"time holds {len(time)} stamps; at least {minimum} are needed")
    later = time[1:] > time[:-1]
    if not later.all():
        first = int(np.argmin(later))
        raise ValueError(
            f"time must increase, but goes from {time[first]} to {time[first + 1]} at index"
            f" {first}; sort the samples and drop repeated stamps"
        )
    return time


def uniform_step(time: np.ndarray) -> float:
    """Step [s] of at least two equally spaced stamps (n,)

    Raises
    ------
    ValueError
        If a step differs by more than 10^-6 of it.
    """
    step = (time[-1] - time[0]) / (len(time) - 1)
    worst = np.abs(np.diff(time) - step).max()
    if worst > 1e-6 * step:
        raise ValueError(
            f"time must be equally spaced, but steps differ from {step:g} s by up to {worst:.3g}"
            " s; give a grid such as start + step * arange(n)"
        )
    return float(step)
