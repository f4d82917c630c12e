"""Postures in which the hand is somewhere, for arms that have none of that name in their file."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.arm._description import ArmDescription
from dart_skill.arm._inverse import nearer, off_by
from dart_skill.arm._model import ArmModel
from dart_skill.arm._the_arm import the_arm
from dart_skill.common.configuration import arm_name

MARGIN = 0.15
"""Distance that the joints keep to the ends of their ranges [rad]."""
NEAR = 1e-4
"""The hand is there if it is nearer than this [m], [rad]."""
STARTS = 40
"""Number of drawn postures from which a solution is looked for."""
STEPS = 100
"""Number of steps of the solver from each of them."""


def ready_posture(
    name: str, position: Sequence[float], turn: Sequence[float]
) -> tuple[float, ...]:
    """Joint angles (n,) [rad] of the arm of this process: those of its file with that name, or some
    in which its hand is at a place.

    Parameters
    ----------
    name
        Of the posture.
    position, turn
        Of the hand in the world (3,) [m], and its rotation vector there (3,) [rad].

    Raises
    ------
    ValueError
        If the arm does not reach there.
    """
    return _ready(arm_name(), name, tuple(position), tuple(turn))


@lru_cache(maxsize=64)
def _ready(
    arm: str, name: str, position: tuple[float, ...], turn: tuple[float, ...]
) -> tuple[float, ...]:
    description = the_arm()
    if name in description.postures:
        return tuple(description.postures[name].tolist())
    found = posture_at(description, np.array(position), Rotation.from_rotvec(turn).as_matrix())
    return tuple(found.tolist())


def posture_at(
    description: ArmDescription, position: np.ndarray, rotation: np.ndarray
) -> np.ndarray:
    """Joint angles (n,) [rad] in which the hand has a pose, near the home posture turned to it.

    Damped least squares (Nakamura and Hanafusa, 1986), from there; where that ends elsewhere, from
    postures that are drawn, the nearest first.

    Parameters
    ----------
    position, rotation
        Of the hand in the world (3,) [m] and (3, 3).

    Raises
    ------
    ValueError
        If the arm does not reach there with `MARGIN` to the ends of its joints.
    """
    model = ArmModel(description)
    lower = description.of_joints("lower") + MARGIN
    upper = description.of_joints("upper") - MARGIN
    first, (x, y, _) = description.home.copy(), model.hand_pose(description.home)[0]
    first[0] += np.arctan2(position[1], position[0]) - np.arctan2(y, x)
    # of a joint that turns round more than once, the turns about its zero
    low, high = lower.clip(-np.pi, np.pi), upper.clip(-np.pi, np.pi)
    drawn = np.random.default_rng(0).uniform(low, high, (STARTS, len(lower)))
    for start in (first, *sorted(drawn, key=lambda one: float(np.linalg.norm(one - first)))):
        posture = start.clip(lower, upper)
        for _ in range(STEPS):
            off = off_by(model, posture, position, rotation)
            if np.abs(off).max() < NEAR:
                return posture
            posture = nearer(model, posture, off).clip(lower, upper)
    raise ValueError(
        f"arm {description.name}: no posture was found in which its hand is at"
        f" {np.round(position, 3).tolist()} m with its palm towards"
        f" {np.round(rotation[:, 2], 2).tolist()}"
    )
