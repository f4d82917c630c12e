"""Cables that give: motor and link of a joint are two inertias with a spring between them, and encoders sit on the motor."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dposv

from dart_skill.constants import N_JOINTS
from dart_skill.robot import Actuation

SUBSTEPS = 5
"""Of a control period of 2 ms: a wrist on its spring swings at some 100 Hz."""
DAMPING_RATIO = 0.05
"""Of a motor that swings on its spring; chosen: no measurement of the WAM's cables was found in print."""


class Transmission:
    """Springs between the motors and the links of the seven joints.

    Motor: R w' = effort - friction(w) - s; link: M v' + bias = outside + s; spring: s = K (theta - q) + D (w - v). All in joint
    coordinates, R the rotors' inertia as the joints feel it. Each part of a step is an implicit Euler step for both inertias at once.

    * stiffness: (7,) [N m/rad], all positive.
    * reflected: (7, 7) [kg m^2].
    * actuation: whose friction acts on the motors.
    """

    def __init__(self, stiffness: np.ndarray, reflected: np.ndarray, actuation: Actuation):
        self._stiffness, self._reflected, self._actuation = np.asarray(stiffness, dtype=float), reflected, actuation
        self._damping = 2.0 * DAMPING_RATIO * np.sqrt(self._stiffness * np.diag(reflected))
        self.position, self.velocity = np.zeros(N_JOINTS), np.zeros(N_JOINTS)

    def rest(self, q: np.ndarray, load: np.ndarray) -> None:
        """Motors at rest that carry a load (7,) [N m] on links at q (7,) [rad]."""
        self.position, self.velocity = q + load / self._stiffness, np.zeros(N_JOINTS)

    def advance(
        self, q: np.ndarray, velocity: np.ndarray, inertia: np.ndarray, effort: np.ndarray, outside: np.ndarray, step: float
    ) -> np.ndarray:
        """Mean acceleration (7,) of the links over a step [s] in which motors give `effort` and the world `outside`, net of the bias."""
        h, link, reached = step / SUBSTEPS, q, velocity
        coupling = h * (h * self._stiffness + self._damping)
        system = np.zeros((2 * N_JOINTS, 2 * N_JOINTS))
        joints = np.arange(N_JOINTS)
        for _ in range(SUBSTEPS):
            spring = h * self._stiffness * (self.position - link)
            system[:N_JOINTS, :N_JOINTS], system[N_JOINTS:, N_JOINTS:] = inertia, self._reflected
            system[joints, joints] += coupling
            system[N_JOINTS + joints, N_JOINTS + joints] += coupling + h * self._actuation.damping(self.velocity)
            system[joints, N_JOINTS + joints] = system[N_JOINTS + joints, joints] = -coupling
            momentum = np.concatenate([inertia @ reached + spring + h * outside, self._reflected @ self.velocity - spring + h * effort])
            speeds = dposv(system, momentum)[1]
            reached = speeds[:N_JOINTS]
            self.velocity = speeds[N_JOINTS:]
            link = link + h * reached
            self.position = self.position + h * self.velocity
        return (reached - velocity) / step


class Encoders:
    """What a driver says of the joints: angles with an offset, in steps, and speeds that are filtered differences of them.

    * offset: (7,) [rad], what the angles read too high.
    * resolution: step of an angle [rad]; 0: none.
    * speed_filter: corner of the low-pass on the differences [rad/s]; 0: speeds are exact.
    * step: control period [s].
    """

    def __init__(self, offset: np.ndarray, resolution: float, speed_filter: float, step: float):
        self._offset, self._resolution = np.asarray(offset, dtype=float), resolution
        self._gain = 1.0 - np.exp(-speed_filter * step) if speed_filter else 0.0
        self._step = step
        self._exact = not (self._offset.any() or resolution or speed_filter)
        self._last: np.ndarray | None = None
        self._speed = np.zeros(N_JOINTS)

    def reset(self) -> None:
        """The arm is somewhere else, at rest."""
        self._last, self._speed = None, np.zeros(N_JOINTS)

    def read(self, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles and speeds (7,) as reported, once a step."""
        if self._exact:
            return position, velocity
        seen = position + self._offset
        if self._resolution:
            seen = self._resolution * np.round(seen / self._resolution)
        if not self._gain:
            return seen, velocity
        if self._last is not None:
            self._speed = self._speed + self._gain * ((seen - self._last) / self._step - self._speed)
        self._last = seen
        return seen, self._speed
