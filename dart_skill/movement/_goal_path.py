"""How the goal of a discrete primitive moves: a smooth path from start to goal, and its attractor
(7.20).

A spring-damper that is pulled by this attractor follows the path.
"""

from typing import TypeVar

import numpy as np

Number = TypeVar("Number", float, np.ndarray)

# The blend is s^5 times this polynomial, lowest power first: its first four derivatives are zero
# at s = 0 and s = 1.
BLEND = [126.0, -420.0, 540.0, -315.0, 70.0]
# For up to so many values, Python numbers are faster than arrays; an online step needs three
# values.
FEW = 5


def blend(progress: np.ndarray) -> np.ndarray:
    """Path (n,) from 0 at s <= 0 to 1 at s >= 1, four times differentiable.

    So an integration of fourth order keeps its order, wherever its steps are.
    """
    return _polynomial(np.clip(progress, 0.0, 1.0), 5, BLEND)


class BlendAttractor:
    """(7.20) for the blend: the attractor that makes a spring-damper move along it.

    * stiffness: of the spring-damper [1/s^2].
    * damping: of the spring-damper [1/s].
    """

    def __init__(self, stiffness: float, damping: float):
        path, powers = np.concatenate([np.zeros(5), BLEND]), np.arange(1.0, 10.0)
        velocity = powers * path[1:]
        path[:-1] += velocity * (damping / stiffness)
        path[:-2] += powers[:-1] * velocity[1:] / stiffness
        self._coefficients = path[3:].tolist()

    def __call__(self, progress: np.ndarray) -> np.ndarray:
        if len(progress) <= FEW:
            return np.array(
                [
                    _polynomial(min(max(s, 0.0), 1.0), 3, self._coefficients)
                    for s in progress.tolist()
                ]
            )
        return _polynomial(np.clip(progress, 0.0, 1.0), 3, self._coefficients)


def _polynomial(s: Number, power: int, coefficients: list[float]) -> Number:
    """s^power (c_0 + c_1 s + ...) by Horner's rule."""
    value = coefficients[-1] * s
    for coefficient in coefficients[-2:0:-1]:
        value += coefficient
        value *= s
    return (value + coefficients[0]) * s**power
