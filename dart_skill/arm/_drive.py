"""What drives the arm, number by number: the springs of (7.19), and the wrench and the torques
that make the hand follow them.

With the mobility A = J M^-1 J' of the hand, a wrench A^-1 (a - dJ/dt qd) gives it the acceleration
a (Khatib, 1987). The eigenvectors of A are the directions in which the hand moves along the force.
Those in which it hardly moves are left to the posture.

It is asked at every step of the arm. So it is compiled (docs/development.md): _drive.pxd beside it
has the types.
"""

import math

import numpy as np
import scipy

from dart_skill.arm._arm_terms import ArmTerms
from dart_skill.common.small_matrices import factor_into, solve_into


def turn(target: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Rotation vector (3,) in world axes that turns `rotation` (3, 3) into `target` (3, 3) [rad]."""
    result = np.empty(3)
    _turn(target, rotation, result, 0)
    return result


def _turn(target: np.ndarray, rotation: np.ndarray, result: np.ndarray, k: int) -> None:
    """Write the rotation vector from index k on."""
    x = 0.5 * (_product(target, 2, rotation, 1) - _product(target, 1, rotation, 2))
    y = 0.5 * (_product(target, 0, rotation, 2) - _product(target, 2, rotation, 0))
    z = 0.5 * (_product(target, 1, rotation, 0) - _product(target, 0, rotation, 1))
    trace = (
        _product(target, 0, rotation, 0)
        + _product(target, 1, rotation, 1)
        + _product(target, 2, rotation, 2)
    )
    sine, cosine, scale = math.sqrt(x * x + y * y + z * z), 0.5 * (trace - 1.0), 1.0
    if sine < 1e-9 and cosine < 0.0:
        _half_turn(target, rotation, result, k)
        return
    if sine >= 1e-9:
        scale = math.atan2(sine, cosine) / sine
    result[k], result[k + 1], result[k + 2] = scale * x, scale * y, scale * z


def _half_turn(target: np.ndarray, rotation: np.ndarray, result: np.ndarray, k: int) -> None:
    """Its axis is an eigenvector, either way round: the largest column of the turn and 1."""
    axis, length = 0, 0.0
    for i in range(1, 3):
        if _product(target, i, rotation, i) > _product(target, axis, rotation, axis):
            axis = i
    for i in range(3):
        result[k + i] = _product(target, i, rotation, axis)
        if i == axis:
            result[k + i] += 1.0
        length += result[k + i] * result[k + i]
    for i in range(3):
        result[k + i] *= 3.141592653589793 / math.sqrt(length)


def _product(target: np.ndarray, i: int, rotation: np.ndarray, j: int) -> float:
    """Entry of target rotation'."""
    return (
        target[i, 0] * rotation[j, 0]
        + target[i, 1] * rotation[j, 1]
        + target[i, 2] * rotation[j, 2]
    )


class Drive:
    """Wrench and joint torques for a wanted acceleration of the hand.

    Parameters
    ----------
    lengths
        Metres that a metre, or a radian, of each direction counts for (6,).
    coulomb, viscous
        Joint friction that is compensated (n,) [N m], [N m s/rad].
    weak
        Torque (n,) [N m] that tells in which direction the friction of a joint at rest acts.
    slow
        Speed that tells it [rad/s].
    null_stiffness, null_damping
        Hold the posture in the arm's free motion [1/s^2], [1/s].
    least_mobility
        A direction that is less mobile is left to the posture gradually [1/kg].
    """

    def __init__(
        self,
        lengths: np.ndarray,
        coulomb: np.ndarray,
        viscous: np.ndarray,
        weak: np.ndarray,
        slow: float,
        null_stiffness: float,
        null_damping: float,
        least_mobility: float,
    ):
        self._lengths, self._coulomb, self._viscous, self._weak, self._slow = (
            lengths,
            coulomb,
            viscous,
            weak,
            slow,
        )
        self._null_stiffness, self._null_damping, self._least_mobility = (
            null_stiffness,
            null_damping,
            least_mobility,
        )
        n = len(coulomb)
        self._lower, self._halved = np.zeros((n, n)), np.zeros((6, n))
        self._mobility, self._directions, self._mobile = (
            np.zeros((6, 6)),
            np.zeros((6, 6)),
            np.zeros(6),
        )
        self._wanted, self._disturbing, self._wrench = np.zeros(6), np.zeros(6), np.zeros(6)
        self._free, self._null, self._total = np.zeros(n), np.zeros(n), np.zeros(n)

    def add_pull(
        self,
        terms: ArmTerms,
        position: np.ndarray,
        rotation: np.ndarray,
        velocity: np.ndarray,
        stiffness: np.ndarray,
        damping: np.ndarray,
        acceleration: np.ndarray,
    ) -> None:
        """Add what spring and damper ask of the hand of the arm in its state, which they pull to a
        pose with a velocity, to an acceleration (6,): k (y - x) + d (v_y - v).

        Parameters
        ----------
        terms
            Of the state: x and v.
        position, rotation, velocity
            y and v_y, (3,) [m], (3, 3) and (6,) [m/s, rad/s].
        stiffness, damping
            k (6,) [1/s^2] and d (6,) [1/s].
        """
        error = self._wrench
        for i in range(3):
            error[i] = position[i] - terms.position[i]
        _turn(rotation, terms.rotation, error, 3)
        for i in range(6):
            acceleration[i] += stiffness[i] * error[i] + damping[i] * (
                velocity[i] - terms.velocity[i]
            )

    def act(
        self, terms: ArmTerms, acceleration: np.ndarray, posture: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Wrench (6,) and joint torque (n,) that accelerate the hand of the arm in its state.

        Parameters
        ----------
        posture : (n,)
            In the null space.
        """
        self._shape(terms, acceleration, posture)
        return np.array(self._wanted), self._torque(terms, 1.0)

    def moved(
        self, terms: ArmTerms, acceleration: np.ndarray, posture: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The same with the friction of joints that move, and the joint acceleration (n,) that an
        arm without friction then has.
        """
        self._shape(terms, acceleration, posture)
        accelerated = np.empty(self._free.shape[0])
        solve_into(self._lower, self._total, accelerated)
        return np.array(self._wanted), self._torque(terms, 0.0), accelerated

    def _torque(self, terms: ArmTerms, driven: float) -> np.ndarray:
        """Torque (n,) beside the wrench; friction of joints at rest as they are driven (1), or as
        of joints that move (0).
        """
        result = np.empty(self._free.shape[0])
        torque = result
        for j in range(self._free.shape[0]):
            friction = self._friction(j, terms.qd[j], driven * self._total[j])
            torque[j] = terms.coriolis[j] + friction + self._null[j]
        return result

    def friction(self, qd: np.ndarray, drive: np.ndarray) -> np.ndarray:
        """Friction (n,) [N m] that is compensated at speeds qd (n,) [rad/s] of joints that torques
        drive (n,) [N m].
        """
        result = np.empty(self._free.shape[0])
        torque = result
        for j in range(self._free.shape[0]):
            torque[j] = self._friction(j, qd[j], drive[j])
        return result

    def _friction(self, joint: int, speed: float, drive: float) -> float:
        return (
            self._coulomb[joint] * math.tanh(speed / self._slow + drive / self._weak[joint])
            + self._viscous[joint] * speed
        )

    def _shape(self, terms: ArmTerms, acceleration: np.ndarray, posture: np.ndarray) -> None:
        """Wrench, torques in the null space, and both as torques of the joints."""
        if acceleration.shape[0] != 6 or posture.shape[0] != self._free.shape[0]:
            raise ValueError(
                f"acceleration has shape {np.shape(acceleration)} and posture {np.shape(posture)},"
                f" not (6,) and ({self._free.shape[0]},)"
            )
        terms.find_inertia()
        terms.find_coriolis()
        jacobian, inertia, n = terms.jacobian, terms.inertia, self._free.shape[0]
        self._find_directions(jacobian, inertia)
        for j in range(n):
            self._free[j] = (
                self._null_stiffness * (posture[j] - terms.q[j]) - self._null_damping * terms.qd[j]
            )
        for i in range(6):
            self._wanted[i] = acceleration[i] - terms.drift[i]
            self._disturbing[i] = 0.0
            for j in range(n):
                self._disturbing[i] += jacobian[i, j] * self._free[j]
        self._as_wrench(self._wanted)
        self._as_wrench(self._disturbing)
        for j in range(n):
            self._null[j] = self._total[j] = 0.0
            for i in range(n):
                self._null[j] += inertia[j, i] * self._free[i]
            for i in range(6):
                self._null[j] -= jacobian[i, j] * self._disturbing[i]
                self._total[j] += jacobian[i, j] * self._wanted[i]
            self._total[j] += self._null[j]

    def _find_directions(self, jacobian: np.ndarray, inertia: np.ndarray) -> None:
        """Eigenvectors of the mobility X X' with X = J L'^-1 and M = L L', a radian counting for
        its length.
        """
        lower, halved, mobility, n = self._lower, self._halved, self._mobility, self._free.shape[0]
        factor_into(inertia, lower)
        for i in range(6):
            for j in range(n):
                rest = self._lengths[i] * jacobian[i, j]
                for k in range(j):
                    rest -= lower[j, k] * halved[i, k]
                halved[i, j] = rest / lower[j, j]
            for j in range(i + 1):
                total = 0.0
                for k in range(n):
                    total += halved[i, k] * halved[j, k]
                mobility[i, j] = mobility[j, i] = total
        self._mobile, columns, _ = scipy.linalg.lapack.dsyev(self._mobility)
        self._directions = columns.T

    def _as_wrench(self, acceleration: np.ndarray) -> None:
        """Replace an acceleration (6,) of the hand by the wrench (6,) that gives it to the hand
        where that is mobile enough.
        """
        directions, wrench, least = self._directions, self._wrench, self._least_mobility
        for i in range(6):
            acceleration[i] *= self._lengths[i]
            wrench[i] = 0.0
        for k in range(6):
            along, mobile = 0.0, self._mobile[k]
            for i in range(6):
                along += directions[k, i] * acceleration[i]
            # The share min(mobile / least, 1)^2 of the acceleration, divided by the mobility.
            if mobile < least:
                along *= mobile / (least * least)
            else:
                along /= mobile
            for i in range(6):
                wrench[i] += along * directions[k, i]
        for i in range(6):
            acceleration[i] = self._lengths[i] * wrench[i]


class JointSpring:
    """Spring and damper of each joint.

    Parameters
    ----------
    stiffness, damping
        (n,) [N m/rad], [N m s/rad].
    limit
        Of the torque (n,) [N m].
    """

    def __init__(self, stiffness: np.ndarray, damping: np.ndarray, limit: np.ndarray):
        self._stiffness, self._damping, self._limit = stiffness, damping, limit

    def torque(
        self, q: np.ndarray, qd: np.ndarray, q_wanted: np.ndarray, qd_wanted: np.ndarray
    ) -> np.ndarray:
        """Torque (n,) [N m] from angles and speeds towards others, (n,) each."""
        result = np.empty(self._limit.shape[0])
        torque = result
        for j in range(self._limit.shape[0]):
            torque[j] = self._at(j, q_wanted[j] - q[j], qd_wanted[j] - qd[j])
        return result

    def damp(self, qd: np.ndarray) -> np.ndarray:
        """Torque (n,) [N m] against speeds (n,), of twice the damping, within twice the limits."""
        result = np.empty(self._limit.shape[0])
        torque = result
        for j in range(self._limit.shape[0]):
            torque[j] = min(
                max(-2.0 * self._damping[j] * qd[j], -2.0 * self._limit[j]), 2.0 * self._limit[j]
            )
        return result

    def _at(self, joint: int, way: float, faster: float) -> float:
        most = self._limit[joint]
        return min(max(self._stiffness[joint] * way + self._damping[joint] * faster, -most), most)


def coasted(
    q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Angles and speeds (n,) a step [s] later, at constant acceleration."""
    angles, speeds = np.empty(q.shape[0]), np.empty(q.shape[0])
    later, faster = angles, speeds
    for j in range(q.shape[0]):
        later[j] = q[j] + step * qd[j] + 0.5 * step * step * qdd[j]
        faster[j] = qd[j] + step * qdd[j]
    return angles, speeds


def cut(wrench: np.ndarray, most_force: float, most_moment: float) -> np.ndarray:
    """A wrench (6,), its force and its moment shortened to the most that they may be [N], [N m]."""
    force = math.sqrt(wrench[0] * wrench[0] + wrench[1] * wrench[1] + wrench[2] * wrench[2])
    moment = math.sqrt(wrench[3] * wrench[3] + wrench[4] * wrench[4] + wrench[5] * wrench[5])
    result = np.empty(6)
    shortened = result
    for i in range(3):
        shortened[i] = min(1.0, most_force / max(1e-9, force)) * wrench[i]
        shortened[3 + i] = min(1.0, most_moment / max(1e-9, moment)) * wrench[3 + i]
    return result
