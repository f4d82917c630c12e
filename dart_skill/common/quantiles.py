"""Quantiles of few values, for what is asked of every recording."""

import numpy as np


def quantile(values: np.ndarray, share: float) -> np.ndarray:
    """As `numpy.quantile` along the first axis, which takes five times as long for few values.

    Parameters
    ----------
    values
        (n, ...).
    share
        From 0 to 1; 0.5 for the median.
    """
    ordered, place = np.sort(values, axis=0), share * (len(values) - 1)
    below = int(place)
    above = min(below + 1, len(values) - 1)
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])
