"""Speeds between samples of a body, and whether samples repeat.

This module is compiled (docs/development.md): _speeds.pxd beside it has the types.
"""

import math

import numpy as np


def repeats(samples: np.ndarray) -> bool:
    """Whether one of the samples (n, d) is the same as the one before."""
    for i in range(1, samples.shape[0]):
        same = True
        for k in range(samples.shape[1]):
            same = same and samples[i, k] == samples[i - 1, k]
        if same:
            return True
    return False


def usual_speeds(time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Speeds (n - 1,) [m/s] between samples (n,) [s], (n, 3) [m], each the median of five: a leap of one sample does not count."""
    speed, found = np.empty(time.shape[0] - 1), np.empty(time.shape[0] - 1)
    _speeds(time, position, speed)
    _medians_of_five(speed, found)
    return found


def _speeds(time: np.ndarray, position: np.ndarray, speed: np.ndarray) -> None:
    """Write the speeds (n - 1,) [m/s] between samples (n,) [s], (n, 3) [m]."""
    for i in range(speed.shape[0]):
        x, y, z = position[i + 1, 0] - position[i, 0], position[i + 1, 1] - position[i, 1], position[i + 1, 2] - position[i, 2]
        speed[i] = math.sqrt(x * x + y * y + z * z) / (time[i + 1] - time[i])


def _medians_of_five(values: np.ndarray, middle: np.ndarray) -> None:
    """Write for each of the values (n,) the median of it and the two before and after; those of the ends are repeated."""
    n, ordered = values.shape[0], np.empty(5)
    for i in range(n):
        for k in range(5):
            value, place = values[min(max(i + k - 2, 0), n - 1)], k
            while place > 0 and ordered[place - 1] > value:
                ordered[place] = ordered[place - 1]
                place -= 1
            ordered[place] = value
        middle[i] = ordered[2]
