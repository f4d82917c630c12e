"""What one JointState says of the arm, by the names that it gives: the row of the arm's joints, or
why there is none.

Many drivers publish on one topic: that of the arm, that of a gripper, that of another arm. Each
message is read by its own names, in a graph that runs and from a bag, by this module.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dart_skill.common.world import joint_names, joint_order

_OTHERS = "names none of the arm's joints"


@dataclass(frozen=True)
class JointLayout:
    """What messages with the same names and as many numbers have in common.

    Parameters
    ----------
    order
        Places of the arm's joints among the names, as of `joint_order`; None where the message has
        no whole row.
    has_velocity
        Whether there is a velocity for each name.
    joints
        Which of the arm's joints are named, as numbers from 0.
    why
        What keeps the message from having a whole row; empty if nothing does.
    """

    order: list[int] | slice | None
    has_velocity: bool
    joints: tuple[int, ...]
    why: str

    @property
    def is_of_others(self) -> bool:
        """Whether the message says nothing of the arm: it names joints, and none of them is the
        arm's.
        """
        return self.why.startswith(_OTHERS)

    def row(self, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (..., 7) of the arm's joints; velocities are nan where there
        are none.

        Parameters
        ----------
        position
            Of the message, or of several (..., n).
        velocity
            The same, (..., n) or of another length.

        Raises
        ------
        ValueError
            Says why there is no row.
        """
        if self.order is None:
            raise ValueError(self.why)
        own = position[..., self.order]
        return own, velocity[..., self.order] if self.has_velocity else np.full_like(own, np.nan)


@lru_cache(maxsize=64)
def joint_layout(
    names: tuple[str, ...], n_positions: int, n_velocities: int, wanted: tuple[str, ...] = ()
) -> JointLayout:
    """What a JointState says of the arm.

    Parameters
    ----------
    names
        Of the message.
    n_positions, n_velocities
        How many of each it has.
    wanted
        Names of the arm's joints, default those of config/wam.yaml.
    """
    wanted = wanted or joint_names()
    joints = tuple(k for k, name in enumerate(wanted) if name in names)
    has_velocity = n_velocities == len(names) > 0

    def without(why: str) -> JointLayout:
        return JointLayout(None, has_velocity, joints, why)

    if names and not joints:
        remedy = "let the driver name them so, or put its names into config/wam.yaml"
        return without(f"{_OTHERS} {wanted[0]} to {wanted[-1]}, but {', '.join(names)}: {remedy}")
    if n_positions != len(names):
        return without(
            f"has {len(names)} names and {n_positions} positions: the driver must give one of each"
            " for every joint"
        )
    try:
        return JointLayout(joint_order(names, wanted), has_velocity, joints, "")
    except ValueError as error:
        return without(str(error))
