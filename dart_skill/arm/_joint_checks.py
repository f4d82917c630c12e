"""Checks of the few numbers of a state of the arm. What is wrong, if anything is, their callers
say in words.

They are asked at every step of the arm. So they are compiled (docs/development.md):
_joint_checks.pxd beside this has the types.
"""

import math

import numpy as np

from dart_skill.arm._arm_terms import ArmTerms


def largest(values: np.ndarray) -> float:
    """The largest of a few numbers (n,), either way."""
    most = 0.0
    for i in range(values.shape[0]):
        most = max(most, abs(values[i]))
    return most


def farthest(values: np.ndarray, others: np.ndarray) -> float:
    """The largest distance between numbers (n,) and others (n,).

    Raises
    ------
    ValueError
        If they are not as many.
    """
    if values.shape[0] != others.shape[0]:
        raise ValueError(f"{np.shape(values)} numbers are compared with {np.shape(others)}")
    most = 0.0
    for i in range(values.shape[0]):
        most = max(most, abs(values[i] - others[i]))
    return most


def distance(point: np.ndarray, other: np.ndarray) -> float:
    """Between two points (3,).

    Raises
    ------
    ValueError
        For other shapes.
    """
    if point.shape[0] != 3 or other.shape[0] != 3:
        raise ValueError(
            f"there is no distance between {np.shape(point)} and {np.shape(other)} numbers: give"
            " two points (3,)"
        )
    x, y, z = point[0] - other[0], point[1] - other[1], point[2] - other[2]
    return math.sqrt(x * x + y * y + z * z)


class JointRange:
    """Ranges of the joints.

    Parameters
    ----------
    lower, upper
        Ends of each (7,) [rad].
    """

    def __init__(self, lower: np.ndarray, upper: np.ndarray):
        self._lower, self._upper = lower, upper

    def holds(self, position: np.ndarray, margin: float) -> bool:
        """Whether angles (7,) [rad] are no nearer than a margin to the ends of their ranges [rad]."""
        for j in range(self._lower.shape[0]):
            if not (
                margin <= position[j] - self._lower[j] and margin <= self._upper[j] - position[j]
            ):
                return False
        return True


class Levels:
    """Limits of joints and hand.

    Parameters
    ----------
    strongest
        Torque of a joint, gravity compensation included (7,) [N m].
    lower, upper
        Ends of the joints' ranges, as far as they are watched (7,) [rad].
    low, high
        Corners of the box in which the hand stays (3,) [m].
    """

    def __init__(
        self,
        strongest: np.ndarray,
        lower: np.ndarray,
        upper: np.ndarray,
        low: np.ndarray,
        high: np.ndarray,
    ):
        self._strongest, self._lower, self._upper, self._low, self._high = (
            strongest,
            lower,
            upper,
            low,
            high,
        )

    def are_far(
        self,
        terms: ArmTerms,
        torque: np.ndarray,
        fastest_elbow: float,
        fastest_hand: float,
        share: float,
    ) -> bool:
        """Whether nothing is beyond a limit, and no level beyond a share of it.

        Parameters
        ----------
        terms
            Of the state.
        torque
            That is asked for (7,) [N m].
        fastest_elbow, fastest_hand
            Levels of the speeds [m/s].
        share
            Of speeds and torques.

        Raises
        ------
        ValueError
            For a torque of another shape.
        """
        if torque.shape[0] != self._strongest.shape[0]:
            raise ValueError(
                f"the torque has shape {np.shape(torque)}, not {np.shape(self._strongest)}"
            )
        if not (
            terms.elbow_speed <= share * fastest_elbow and terms.hand_speed <= share * fastest_hand
        ):
            return False  # as numbers that are not finite are
        for i in range(3):
            if not self._low[i] <= terms.position[i] <= self._high[i]:
                return False
        for j in range(self._strongest.shape[0]):
            if not abs(torque[j]) <= share * self._strongest[j]:
                return False
            if not self._lower[j] <= terms.q[j] <= self._upper[j]:
                return False
        return True

    def share(self, terms: ArmTerms, wrench: np.ndarray, torque: np.ndarray) -> float:
        """What part of a command the limits allow on top of gravity compensation, 1 if all of it.

        Parameters
        ----------
        terms
            Of the state.
        wrench
            Of the hand (6,) [N], [N m].
        torque
            Of the joints, is added (7,) [N m].

        Raises
        ------
        ValueError
            For other shapes.
        """
        if wrench.shape[0] != 6 or torque.shape[0] != self._strongest.shape[0]:
            raise ValueError(
                f"the wrench has shape {np.shape(wrench)} and the torque {np.shape(torque)}, not"
                " (6,) and (7,)"
            )
        least = 1.0
        terms.find_gravity()
        for j in range(self._strongest.shape[0]):
            asked = torque[j]
            for i in range(6):
                asked += terms.jacobian[i, j] * wrench[i]
            room = max(0.0, self._strongest[j] - abs(terms.gravity[j]))
            least = min(least, room / max(abs(asked), 1e-9))
        return least
