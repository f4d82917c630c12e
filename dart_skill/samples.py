"""Checks of sampled signals: a time series is finite, increasing, and long enough, or says where it is
not.
"""

from __future__ import annotations

import numpy as np


def check_samples(name: str, time: np.ndarray, values: np.ndarray, least: int = 1, width: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """`time` (n,) and `values` (n, width) as float arrays; ValueError, with `name`, for what is no
    series.
    """
    time, values = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    if time.ndim != 1 or values.shape != (len(time), width):
        raise ValueError(f"{name}: need time (n,) and values (n, {width}), got {time.shape} and {values.shape}")
    if len(time) < least:
        raise ValueError(f"{name}: {len(time)} samples, need at least {least}: record longer or look for occlusion")
    finite = np.isfinite(time) & np.all(np.isfinite(values), axis=1)
    if not np.all(finite):
        index = int(np.argmin(finite))
        raise ValueError(f"{name}: sample {index} is not finite: leave out frames in which the body was lost")
    if np.any(np.diff(time) <= 0.0):
        index = int(np.argmax(np.diff(time) <= 0.0))
        raise ValueError(f"{name}: time does not increase after sample {index} ({time[index]} s): sort and drop repeats")
    return time, values


def check_unit_quaternions(name: str, quaternion: np.ndarray, n_samples: int) -> np.ndarray:
    """Quaternions (n_samples, 4), x, y, z, w, normalised; ValueError for a norm off by more than 0.001."""
    quaternion = np.asarray(quaternion, dtype=float)
    if quaternion.shape != (n_samples, 4):
        raise ValueError(f"{name}: need quaternions ({n_samples}, 4), got {quaternion.shape}")
    norm = np.linalg.norm(quaternion, axis=1, keepdims=True)
    wrong = ~(np.abs(norm[:, 0] - 1.0) <= 1e-3)
    if np.any(wrong):
        index = int(np.argmax(wrong))
        raise ValueError(f"{name}: quaternion {index} has norm {norm[index, 0]:.4f}: need norm 1, order x, y, z, w")
    # What is of unit length already stays as it is, so that data do not change by passing through here again.
    return np.where(np.abs(norm - 1.0) < 1e-12, quaternion, quaternion / norm)


def to_the_nanosecond(seconds):
    """Seconds as stamps can say them, so that data are the same before and after they were a message; numbers or arrays."""
    return np.round(np.asarray(seconds) * 1e9) * 1e-9 if np.ndim(seconds) else round(seconds * 1e9) * 1e-9
