"""Steps towards a posture in which the hand has a pose: damped least squares (Nakamura and Hanafusa,
1986).
"""

import numpy as np

from dart_skill.arm._impedance import rotation_error
from dart_skill.arm._model import ArmModel

DAMPING = 1e-4
"""Added to J J' [m^2]: near a singular posture the steps stay short."""


def off_by(
    model: ArmModel, posture: np.ndarray, position: np.ndarray, rotation: np.ndarray
) -> np.ndarray:
    """What is missing from the hand in a posture to a pose (6,): a way [m] and a turn [rad].

    Parameters
    ----------
    position, rotation
        Of that pose in the world (3,) [m] and (3, 3).
    """
    at, turned = model.hand_pose(posture)
    return np.append(position - at, rotation_error(rotation, turned))


def nearer(model: ArmModel, posture: np.ndarray, off: np.ndarray) -> np.ndarray:
    """The posture after one step of damped least squares, which takes away what is missing.

    Parameters
    ----------
    off
        As of `off_by`.
    """
    jacobian = model.jacobian(posture)
    return posture + jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + DAMPING * np.eye(6), off)
