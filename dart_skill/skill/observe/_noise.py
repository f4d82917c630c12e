"""How noisy a tracked body is, told from its own samples: nobody has to know the cameras."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.medians import quantile
from dart_skill.movement import estimate_noise

LEAST = 2e-5
"""No camera system repeats a body at rest to less [m]: docs/sources.md."""
ENOUGH = 20
"""Samples that an estimate of the noise needs."""
SHARE = 0.2
"""Of the largest speed: what is faster moves."""


def position_noise(time: ArrayLike, position: ArrayLike) -> float:
    """Standard deviation of a coordinate of a body's position [m], from its samples (n,) [s], (n, 3) [m].

    Stamps that jitter are noise, too, but only of a body that moves. So the larger one of two counts: that of all samples and that of
    those in which it moved. Samples that repeat the one before are left out: a driver that lost a body says its last pose again.
    """
    time, position = fresh(np.asarray(time, dtype=float), np.asarray(position, dtype=float))
    if len(time) < ENOUGH:
        return LEAST
    step = _median_of_five(np.linalg.norm(np.diff(position, axis=0), axis=1) / np.diff(time))
    moves = np.append(step > SHARE * quantile(step, 0.99), False)
    levels = [float(estimate_noise(time, position))]
    if np.count_nonzero(moves) >= ENOUGH:
        levels.append(float(estimate_noise(time[moves], position[moves])))
    return max(LEAST, *levels)


def _median_of_five(values: np.ndarray) -> np.ndarray:
    """For each of the values (n,) the median of it and the two before and after; those of the ends are repeated."""
    longer = np.concatenate([values[:1], values[:1], values, values[-1:], values[-1:]])
    return np.sort([longer[k : k + len(values)] for k in range(5)], axis=0)[2]


def column_noise(time: ArrayLike, columns: ArrayLike) -> np.ndarray:
    """Standard deviation of each column of samples (n,) [s], (n, d): (d,), in the columns' units; at least 1e-6. time: (n,) [s]."""
    time, columns = fresh(np.asarray(time, dtype=float), np.asarray(columns, dtype=float))
    return np.maximum([float(estimate_noise(time, column[:, None])) for column in columns.T], 1e-6)


def fresh(time: np.ndarray, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The samples (n,), (n, d) that are not the same as the one before."""
    if len(samples) == 0:
        return time, samples
    kept = np.append(True, (samples[1:] != samples[:-1]).any(axis=1))
    return (time, samples) if kept.all() else (time[kept], samples[kept])
