"""Vectors of the plane and of space."""

import math

import numpy as np


def at_most(vector: np.ndarray, limit: float) -> np.ndarray:
    """A vector (n,), shortened where it is longer than a limit."""
    length = math.sqrt(vector @ vector)
    return vector if length <= limit else vector * (limit / length)
