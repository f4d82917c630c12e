"""How noisy a tracked body is, told from its own samples, without knowledge of the cameras."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.quantiles import quantile
from dart_skill.movement import estimate_noise

LEAST = 2e-5
"""No camera system repeats a body at rest to less [m]: docs/sources.md."""
ENOUGH = 20
"""Samples that an estimate of the noise needs."""
SHARE = 0.2
"""Share of the largest speed beyond which a hand moves."""


def position_noise(time: ArrayLike, position: ArrayLike) -> float:
    """Standard deviation of a coordinate of a body's position [m], from its samples (n,) [s], (n,
    3) [m].

    Stamps that jitter are noise, too, but only of a body that moves. So the larger one of two
    counts: that of all samples and that of those in which it moved. Samples that repeat the one
    before are left out: a driver that lost a body says its last pose again.
    """
    time, position = fresh(np.asarray(time, dtype=float), np.asarray(position, dtype=float))
    if len(time) < ENOUGH:
        return LEAST
    step = usual_speeds(time, position)
    moves = np.append(step > SHARE * quantile(step, 0.99), False)
    levels = [float(estimate_noise(time, position))]
    if np.count_nonzero(moves) >= ENOUGH:
        levels.append(float(estimate_noise(time[moves], position[moves])))
    return max(LEAST, *levels)


def column_noise(time: ArrayLike, columns: ArrayLike) -> np.ndarray:
    """Standard deviation of each column of samples (n,) [s], (n, d): (d,), in the columns' units;
    at least 1e-6.

    Parameters
    ----------
    time
        (n,) [s].
    """
    time, columns = fresh(np.asarray(time, dtype=float), np.asarray(columns, dtype=float))
    return np.maximum(estimate_noise(time, columns, apart=True), 1e-6)


def fresh(time: np.ndarray, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The samples (n,), (n, d) that are not the same as the one before."""
    if not repeats(samples):
        return time, samples
    kept = np.ones(len(samples), dtype=bool)
    kept[1:] = (samples[1:] != samples[:-1]).any(axis=1)
    return time[kept], samples[kept]


def repeats(samples: np.ndarray) -> bool:
    """Whether one of the samples (n, d) is the same as the one before."""
    return bool((samples[1:] == samples[:-1]).all(axis=1).any())


def usual_speeds(time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Speeds (n - 1,) [m/s] between samples (n,) [s], (n, 3) [m], each the median of five: a leap
    of one sample does not count.
    """
    speed = np.linalg.norm(position[1:] - position[:-1], axis=1) / (time[1:] - time[:-1])
    fives = (np.arange(len(speed))[:, None] + np.arange(-2, 3)).clip(0, len(speed) - 1)
    return np.sort(speed[fives], axis=1)[:, 2]
