"""Cables that give: motor and link of a joint are two inertias with a spring between them, and
encoders sit on the motor.

A step of the arm asks them. So they are compiled (docs/development.md): _transmission.pxd beside
it has the types.
"""

from __future__ import annotations

import math

import numpy as np

from dart_skill.arm import Actuation
from dart_skill.common.small_matrices import factor_into, solve_into

SUBSTEPS = 5
"""Steps of a control period of 2 ms; a wrist on its spring swings at some 100 Hz."""
DAMPING_RATIO = 0.05
"""Damping of a motor that swings on its spring; chosen: no measurement of the WAM's cables was
found in print.
"""


class Transmission:
    """Springs between the motors and the links of the joints.

    Motor: R w' = effort - friction(w) - s; link: M v' + bias = outside + s; spring: s = K (theta -
    q) + D (w - v). All in joint coordinates, R the rotors' inertia as the joints feel it. Each
    part of a step is an implicit Euler step for both inertias at once.

    Attributes: position, velocity, of the motors (n,) [rad], [rad/s].

    Parameters
    ----------
    stiffness
        (n,) [N m/rad], all positive.
    reflected
        (n, n) [kg m^2].
    actuation
        Whose friction acts on the motors.
    """

    def __init__(self, stiffness: np.ndarray, reflected: np.ndarray, actuation: Actuation):
        self._stiffness, self._reflected = (
            np.array(stiffness, dtype=float),
            np.array(reflected, dtype=float),
        )
        self._actuation = actuation
        self._damping = (
            2.0 * DAMPING_RATIO * np.sqrt(np.asarray(stiffness, dtype=float) * np.diag(reflected))
        )
        n = len(self._stiffness)
        self.position, self.velocity = np.zeros(n), np.zeros(n)
        self._link, self._speeds = np.zeros(n), np.zeros(2 * n)
        self._motor_speeds = self._speeds[n:]
        self._system, self._momentum = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)

    def rest(self, q: np.ndarray, load: np.ndarray) -> None:
        """Motors at rest that carry a load (n,) [N m] on links at q (n,) [rad]."""
        self.position, self.velocity = q + load / np.asarray(self._stiffness), np.zeros(len(q))

    def advance(
        self,
        q: np.ndarray,
        velocity: np.ndarray,
        inertia: np.ndarray,
        effort: np.ndarray,
        outside: np.ndarray,
        step: float,
    ) -> np.ndarray:
        """Mean acceleration (n,) of the links over a step [s] in which motors give `effort` and
        the world `outside`, net of the bias.
        """
        position, mean = np.array(self.position), np.empty(self._link.shape[0])
        theta, acceleration, link, speeds = position, mean, self._link, self._speeds
        n, motors, h = self._link.shape[0], self.velocity, step / SUBSTEPS
        for j in range(n):
            link[j] = q[j]
            speeds[j] = velocity[j]
            speeds[n + j] = motors[j]
        for _ in range(SUBSTEPS):
            self._set_up(inertia, effort, outside, theta, h)
            factor_into(self._system, self._system)
            solve_into(self._system, self._momentum, speeds)
            for j in range(n):
                link[j] += h * speeds[j]
                theta[j] += h * speeds[n + j]
        for j in range(n):
            acceleration[j] = (speeds[j] - velocity[j]) / step
        self.position, self.velocity = position, self._motor_speeds.copy()
        return mean

    def _set_up(
        self,
        inertia: np.ndarray,
        effort: np.ndarray,
        outside: np.ndarray,
        theta: np.ndarray,
        h: float,
    ) -> None:
        """The equations of an implicit Euler step: system (14, 14) times speeds, of links over
        motors, is momentum (14,).
        """
        n, system, momentum, speeds = (
            self._link.shape[0],
            self._system,
            self._momentum,
            self._speeds,
        )
        damping = self._actuation.damping(self._motor_speeds)
        for i in range(n):
            spring = h * self._stiffness[i] * (theta[i] - self._link[i])
            coupling = h * (h * self._stiffness[i] + self._damping[i])
            of_link = of_motor = 0.0
            for j in range(n):
                system[i, j] = inertia[i, j]
                system[n + i, n + j] = self._reflected[i, j]
                system[n + i, j] = 0.0
                of_link += inertia[i, j] * speeds[j]
                of_motor += self._reflected[i, j] * speeds[n + j]
            system[i, i] += coupling
            system[n + i, n + i] += coupling + h * damping[i]
            system[n + i, i] = -coupling
            momentum[i] = of_link + spring + h * outside[i]
            momentum[n + i] = of_motor - spring + h * effort[i]


class Encoders:
    """What a driver says of the joints: angles with an offset, in steps, and speeds that are
    filtered differences of them.

    Parameters
    ----------
    offset
        (n,) [rad], what the angles read too high.
    resolution
        Step of an angle [rad]; 0: none.
    speed_filter
        Corner of the low-pass on the differences [rad/s]; 0: speeds are exact.
    step
        Control period [s].
    """

    def __init__(self, offset: np.ndarray, resolution: float, speed_filter: float, step: float):
        self._offset, self._resolution, self._step = (
            np.array(offset, dtype=float),
            resolution,
            step,
        )
        self._gain = 1.0 - math.exp(-speed_filter * step)
        self._exact = not (np.any(offset) or resolution or speed_filter)
        self._last, self._speed = np.zeros(len(offset)), np.zeros(len(offset))
        self._has_read = False

    def reset(self) -> None:
        """The arm is somewhere else, at rest."""
        self._has_read = False
        for j in range(self._speed.shape[0]):
            self._speed[j] = 0.0

    def read(self, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles and speeds (n,) as reported, once a step."""
        if self._exact:
            return position, velocity
        seen = np.empty(self._last.shape[0])
        angles, true, last, speed = seen, position, self._last, self._speed
        for j in range(self._last.shape[0]):
            angles[j] = true[j] + self._offset[j]
            if self._resolution:
                angles[j] = self._resolution * math.floor(angles[j] / self._resolution + 0.5)
            if self._has_read:
                speed[j] += self._gain * ((angles[j] - last[j]) / self._step - speed[j])
            last[j] = angles[j]
        self._has_read = True
        return seen, np.array(speed) if self._gain else velocity
