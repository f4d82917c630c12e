"""Checks of the numbers of a state of the arm against its limits. What is wrong, if anything is,
their callers say in words.

They are asked at every step of the arm. So they are compiled (docs/development.md):
_joint_checks.pxd beside this has the types.
"""

import numpy as np

from dart_skill.arm._arm_terms import ArmTerms


class Levels:
    """Limits of joints and hand.

    Parameters
    ----------
    strongest
        Torque of a joint, gravity compensation included (n,) [N m].
    lower, upper
        Ends of the joints' ranges, as far as they are watched (n,) [rad].
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
            That is asked for (n,) [N m].
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
            Of the joints, is added (n,) [N m].

        Raises
        ------
        ValueError
            For other shapes.
        """
        if wrench.shape[0] != 6 or torque.shape[0] != self._strongest.shape[0]:
            raise ValueError(
                f"the wrench has shape {np.shape(wrench)} and the torque {np.shape(torque)}, not"
                f" (6,) and {self._strongest.shape}"
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
