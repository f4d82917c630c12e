"""What a person does with a hand at every step, in numbers: the hold of a spring and a damper, and
the swing in mind as a quintic.

This module is compiled (docs/development.md): _hold.pxd beside it has the types.
"""

import math

import numpy as np


class Hold:
    """A spring and a damper between the hand in mind and the hand as it is.

    * stiffness, damping: of the position [N/m, N s/m].
    * turning_stiffness, turning_damping: of the orientation [N m/rad, N m s/rad].
    """

    def __init__(
        self, stiffness: float, damping: float, turning_stiffness: float, turning_damping: float
    ):
        self._k, self._d, self._kr, self._dr = (
            stiffness,
            damping,
            turning_stiffness,
            turning_damping,
        )

    def pull(
        self,
        wanted: np.ndarray,
        wanted_velocity: np.ndarray,
        stray: np.ndarray,
        position: np.ndarray,
        velocity: np.ndarray,
        error: np.ndarray,
    ) -> np.ndarray:
        """Force and moment (6,) [N, N m] at the hand.

        * wanted, wanted_velocity: of the hand in mind (3,) [m] and (6,) [m/s, rad/s].
        * stray: how far the person strays from that (3,) [m].
        * position, velocity: of the hand as it is (3,) and (6,).
        * error: rotation vector (3,) from the hand as it is to the one in mind [rad].
        """
        result = np.empty(6)
        wrench = result
        for i in range(3):
            wrench[i] = self._k * (wanted[i] + stray[i] - position[i]) + self._d * (
                wanted_velocity[i] - velocity[i]
            )
            wrench[i + 3] = self._kr * error[i] + self._dr * (
                wanted_velocity[i + 3] - velocity[i + 3]
            )
        return result


class Quintic:
    """The quintic with given ends and no acceleration there; its coefficients stay the same while
    it is followed.

    * start, start_rate: of the joints where it begins (n,) [rad], [rad/s]; end, end_rate: where it
      ends.
    * duration: [s].
    """

    def __init__(
        self,
        start: np.ndarray,
        start_rate: np.ndarray,
        end: np.ndarray,
        end_rate: np.ndarray,
        duration: float,
    ):
        v0, v1, way = start_rate * duration, end_rate * duration, end - start
        third, fourth, fifth = (
            10 * way - 6 * v0 - 4 * v1,
            -15 * way + 8 * v0 + 7 * v1,
            6 * way - 3 * v0 - 3 * v1,
        )
        self._rows, self._duration = (
            np.array([start, v0, third, fourth, fifth], dtype=float),
            duration,
        )
        self._two = 2.0

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Position and velocity (n,) [rad], [rad/s].

        * time: since its start [s].
        """
        n, s = self._rows.shape[1], time / self._duration
        square = math.pow(
            s, self._two
        )  # not s * s, whose last bit may differ: recorded demonstrations have these
        place, rate = np.empty(n), np.empty(n)
        position, velocity = place, rate
        for i in range(n):
            v0, c3, c4, c5 = self._rows[1, i], self._rows[2, i], self._rows[3, i], self._rows[4, i]
            position[i] = self._rows[0, i] + s * (v0 + square * (c3 + s * (c4 + s * c5)))
            velocity[i] = (
                v0 + square * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5))
            ) / self._duration
        return place, rate
