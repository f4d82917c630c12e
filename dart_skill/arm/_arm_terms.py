"""What the controller's model says of one state of the arm: asked once of Pinocchio, and kept for
all who ask about the same state.

Pinocchio gives the columns J_i of the Jacobian as twists at the origin of the world, linear over
angular. With them (Featherstone, 2008)

    V = sum_i J_i qd_i            twist of the hand,
    A = sum_i (V_i x J_i) qd_i    its derivative at zero joint acceleration; V_i is the sum up to joint i.

This module is compiled (docs/development.md): _arm_terms.pxd beside it has the types.
"""

import math
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np


class ArmTerms:
    """Kinematics and dynamics of the arm in the state that was taken last, which the next state
    overwrites. The dynamics are computed when they are asked for.

    Parameters
    ----------
    pinocchio
        The module.
    model
        Pinocchio's, of the arm.
    hand
        Pinocchio's placement of the hand on the last joint.
    reflected
        Inertia of the rotors (n, n) [kg m^2].
    elbow
        Number of the joint at the elbow, from 1 on; J_i of the joints up to it move it.

    Attributes
    ----------
    q, qd
        Angles and speeds of the joints (n,) [rad], [rad/s]; are_finite, whether all are.
    position, rotation
        Of the hand (3,) [m] and (3, 3).
    jacobian, velocity
        Of the hand (6, n) and (6,), linear over angular [m/s, rad/s].
    hand_speed, elbow_speed
        [m/s].
    gravity
        Torque that holds the arm (n,) [N m], after `find_gravity`.
    inertia
        With that of the rotors (n, n) [kg m^2], after `find_inertia`.
    coriolis
        Torque of Coriolis and centrifugal terms (n,) [N m], after `find_coriolis`.
    drift
        Acceleration of the hand at zero joint acceleration (6,), after `find_coriolis`.
    """

    def __init__(
        self, pinocchio: ModuleType, model: Any, hand: Any, reflected: np.ndarray, elbow: int
    ):
        data, weightless, n = model.createData(), model.copy(), model.nv
        # there the bias torque is that of Coriolis and centrifugal terms alone
        weightless.gravity.linear = np.zeros(3)
        self._kinematics = partial(pinocchio.computeJointJacobians, model, data)
        self._weight = partial(pinocchio.computeGeneralizedGravity, model, data)
        self._inertia = partial(pinocchio.crba, model, data)
        self._bias = partial(pinocchio.nonLinearEffects, weightless, data)
        self._of_elbow = partial(
            pinocchio.getJointJacobian, model, data, elbow, pinocchio.LOCAL_WORLD_ALIGNED
        )
        # Views of Pinocchio's own numbers, which each of its passes writes anew.
        self._twists, self._upper, self._biased, self._weighed = data.J, data.M, data.nle, data.g
        wrist = data.oMi[n]
        self._data, self._wrist, self._turned, self._elbow = (
            data,
            wrist.translation,
            wrist.rotation,
            data.oMi[elbow].translation,
        )
        self._hand, self._hand_turned = (
            np.array(hand.translation),
            np.array(hand.rotation, order="C"),
        )
        self._reflected = np.array(reflected, order="C")
        self._angles, self._speeds = np.full(n, np.nan), np.full(n, np.nan)
        self.q, self.qd, self._up_to_elbow = self._angles, self._speeds, elbow
        self._twist, self._rate, self._column = np.zeros(6), np.zeros(6), np.zeros(6)
        self._has_speeds = self._has_gravity = self._has_inertia = self._has_coriolis = False
        self.position, self.rotation, self.jacobian = (
            np.zeros(3),
            np.zeros((3, 3)),
            np.zeros((6, n)),
        )
        self.velocity, self.drift, self.hand_speed, self.elbow_speed = (
            np.zeros(6),
            np.zeros(6),
            0.0,
            0.0,
        )
        self.are_finite = False
        self.inertia, self.coriolis, self.gravity = (
            np.zeros((n, n)),
            np.zeros(n),
            np.zeros(n),
        )

    def take(self, q: np.ndarray, qd: np.ndarray | None) -> None:
        """From now on all is about the state of angles q (n,) [rad] and speeds qd (n,) [rad/s].

        Without speeds, what depends on them is left out.

        Raises
        ------
        ValueError
            For other shapes.
        """
        if q.shape[0] != self.q.shape[0] or (qd is not None and qd.shape[0] != self.q.shape[0]):
            speeds = "none" if qd is None else qd.shape[0]
            raise ValueError(
                f"the arm has {self.q.shape[0]} joints, and the state {q.shape[0]} angles and {speeds}"
                " speeds"
            )
        if _differ(self.q, q):
            _copy(q, self.q)
            self._kinematics(self._angles)
            self._place_hand()
            self._has_speeds = self._has_gravity = self._has_inertia = False
        if qd is not None and (not self._has_speeds or _differ(self.qd, qd)):
            _copy(qd, self.qd)
            self._move()
            self._has_speeds, self._has_coriolis = True, False

    def find_gravity(self) -> None:
        """Compute the torque `gravity`, unless that was done in this state."""
        if not self._has_gravity:
            self._weight(self._angles)
            _copy(self._weighed, self.gravity)
            self._has_gravity = True

    def find_inertia(self) -> None:
        """Compute `inertia`, unless that was done in this state."""
        if self._has_inertia:
            return
        self._inertia(self._angles)
        n = self.q.shape[0]
        for i in range(n):
            for j in range(i, n):  # Pinocchio fills the upper triangle only
                self.inertia[i, j] = self.inertia[j, i] = self._upper[i, j] + self._reflected[i, j]
        self._has_inertia = True

    def find_coriolis(self) -> None:
        """Compute `drift` and the torque `coriolis`, unless that was done in this state."""
        if not self._has_coriolis:
            self._bias(self._angles, self._speeds)
            _copy(self._biased, self.coriolis)
            self._change()
            self._has_coriolis = True

    def hand(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position (3,), rotation (3, 3) and velocity (6,) of the hand, as arrays that stay."""
        position, rotation, velocity = np.empty(3), np.empty((3, 3)), np.empty(6)
        at, turned = position, rotation
        _copy(self.position, at)
        _copy(self.velocity, velocity)
        for i in range(3):
            for j in range(3):
                turned[i, j] = self.rotation[i, j]
        return position, rotation, velocity

    def elbow(self) -> np.ndarray:
        """Position (3,) of the elbow [m], as an array that stays."""
        position = np.empty(3)
        at = position
        _copy(self._elbow, at)
        return position

    def elbow_jacobian(self) -> np.ndarray:
        """Linear velocity of the elbow for the speeds of the joints (3, n)."""
        return self._of_elbow()[:3]

    def inertial_torque(self, acceleration: np.ndarray) -> np.ndarray:
        """Torque (n,) [N m] that gives the joints an acceleration (n,) [rad/s^2], but for gravity
        and Coriolis terms.
        """
        self.find_inertia()
        result = np.empty(self.q.shape[0])
        torque = result
        for i in range(self.q.shape[0]):
            torque[i] = 0.0
            for j in range(self.q.shape[0]):
                torque[i] += self.inertia[i, j] * acceleration[j]
        return result

    def _place_hand(self) -> None:
        """Pose of the hand, and the columns of its Jacobian."""
        position, column = self.position, self._column
        for i in range(3):
            position[i] = self._wrist[i]
            for j in range(3):
                position[i] += self._turned[i, j] * self._hand[j]
                self.rotation[i, j] = 0.0
                for k in range(3):
                    self.rotation[i, j] += self._turned[i, k] * self._hand_turned[k, j]
        for j in range(self.q.shape[0]):
            for i in range(6):
                column[i] = self._twists[i, j]
            _add_cross(column, 3, position, 0, column, 0)
            for i in range(6):
                self.jacobian[i, j] = column[i]

    def _move(self) -> None:
        """V, and from it the velocity of the hand and the speeds of hand and elbow."""
        twist, velocity, total = self._twist, self.velocity, 0.0
        for i in range(6):
            twist[i] = 0.0
        for j in range(self.q.shape[0]):
            total += self.q[j] + self.qd[j]
            for i in range(6):
                twist[i] += self._twists[i, j] * self.qd[j]
            if j + 1 == self._up_to_elbow:
                _copy(twist, velocity)
                _add_cross(twist, 3, self._elbow, 0, velocity, 0)
                self.elbow_speed = _length(velocity)
        _copy(twist, velocity)
        _add_cross(twist, 3, self.position, 0, velocity, 0)
        self.hand_speed, self.are_finite = _length(velocity), math.isfinite(total)

    def _change(self) -> None:
        """A, and from it the drift of the hand."""
        twist, rate, column, drift = self._twist, self._rate, self._column, self.drift
        for i in range(6):
            twist[i] = rate[i] = 0.0
        for j in range(self.q.shape[0]):
            for i in range(6):
                column[i] = self._twists[i, j] * self.qd[j]
                twist[i] += column[i]
            _add_cross(twist, 3, column, 0, rate, 0)
            _add_cross(twist, 0, column, 3, rate, 0)
            _add_cross(twist, 3, column, 3, rate, 3)
        _copy(rate, drift)
        _add_cross(rate, 3, self.position, 0, drift, 0)
        # of the point that is the hand's origin, not of the body's twist
        _add_cross(twist, 3, self.velocity, 0, drift, 0)


def _differ(kept: np.ndarray, values: np.ndarray) -> bool:
    """Whether some numbers (n,) are others; one that is none always is."""
    for i in range(kept.shape[0]):
        if kept[i] != values[i]:
            return True
    return False


def _copy(values: np.ndarray, kept: np.ndarray) -> None:
    for i in range(kept.shape[0]):
        kept[i] = values[i]


def _add_cross(
    left: np.ndarray, i: int, right: np.ndarray, j: int, result: np.ndarray, k: int
) -> None:
    """Add the cross product of two vectors, which begin at i and at j, to what begins at k."""
    x, y, z = left[i], left[i + 1], left[i + 2]
    a, b, c = right[j], right[j + 1], right[j + 2]
    result[k] += y * c - z * b
    result[k + 1] += z * a - x * c
    result[k + 2] += x * b - y * a


def _length(vector: np.ndarray) -> float:
    """Length of the vector of the first three numbers."""
    return math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
