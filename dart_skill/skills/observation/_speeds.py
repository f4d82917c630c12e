"""Speeds between samples of a body, and whether samples repeat."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view


def repeats(samples: np.ndarray) -> bool:
    """Whether one of the samples (n, d) is the same as the one before."""
    return bool((samples[1:] == samples[:-1]).all(axis=1).any())


def usual_speeds(time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Speeds (n - 1,) [m/s] between samples (n,) [s], (n, 3) [m], each the median of five: a leap
    of one sample does not count.
    """
    speed = np.linalg.norm(np.diff(position, axis=0), axis=1) / np.diff(time)
    return np.median(sliding_window_view(np.pad(speed, 2, mode="edge"), 5), axis=1)
