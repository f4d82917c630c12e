"""Between what cameras see of the hand and what the arm's own kinematics says of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dart_skill.common.quaternions import CONJUGATE, matrices, product, rotate, unit

if TYPE_CHECKING:
    from dart_skill.arm._motion_plan import HandPath

ZERO, SAME = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Registration:
    """Where the world of the cameras lies in that of the arm, and the tracked body on the hand.

    The cameras see R = turn R_arm hand_turn and p = turn (p_arm + R_arm hand_shift) + shift where
    the arm's kinematics says R_arm and p_arm. Turns are quaternions.

    * turn, shift: of the arm's base in the world of the cameras, (4,) and (3,) [m].
    * hand_turn, hand_shift: of the tracked body in the frame of the hand, (4,) and (3,) [m].
    * delay: of the stamps of the cameras after those of the joints [s].
    """

    turn: tuple[float, ...] = SAME
    shift: tuple[float, ...] = ZERO
    hand_turn: tuple[float, ...] = SAME
    hand_shift: tuple[float, ...] = ZERO
    delay: float = 0.0

    def __post_init__(self) -> None:
        for name in ("turn", "shift", "hand_turn", "hand_shift"):
            value = tuple(float(number) for number in getattr(self, name))
            size = 4 if name.endswith("turn") else 3
            if len(value) != size or not np.isfinite(value).all():
                raise ValueError(
                    f"registration.{name} is {value}; it must be {size} finite numbers"
                )
            if size == 4 and not abs(np.linalg.norm(value) - 1.0) < 1e-3:
                raise ValueError(
                    f"registration.{name} is {value}; it must be a quaternion of unit length"
                )
            object.__setattr__(self, name, value)
        if not np.isfinite(self.delay):
            raise ValueError(f"registration.delay is {self.delay} s; it must be finite")

    @property
    def is_none(self) -> bool:
        """Whether cameras and arm agree."""
        return (self.turn, self.shift, self.hand_turn, self.hand_shift) == (SAME, ZERO, SAME, ZERO)

    @cached_property
    def _back(self) -> np.ndarray:
        """From the world of the cameras to that of the arm, a unit quaternion (4,)."""
        return unit(np.array(self.turn)) * CONJUGATE

    @cached_property
    def _hand_back(self) -> np.ndarray:
        """From the tracked body to the hand, a unit quaternion (4,)."""
        return unit(np.array(self.hand_turn)) * CONJUGATE

    @property
    def axes(self) -> np.ndarray:
        """Rotation (3, 3) from the axes of the cameras' world to those of the arm's."""
        return matrices(self._back)

    def poses(self, position: np.ndarray, quaternion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the arm says of hands that the cameras see at (n, 3), (n, 4). position, quaternion:
        as the cameras see them.
        """
        if self.is_none:
            return position, quaternion
        turned = unit(product(product(self._back, quaternion), self._hand_back))
        return rotate(self._back, position - np.array(self.shift)) - rotate(
            turned, np.array(self.hand_shift)
        ), turned

    def of_body(
        self, position: np.ndarray, quaternion: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where a body other than the hand that the cameras see at a pose (3,), (4,) is in the
        world of the arm.
        """
        if self.is_none:
            return position, quaternion
        return rotate(self._back, position - np.array(self.shift)), unit(
            product(self._back, quaternion)
        )

    def path(self, path: HandPath) -> HandPath:
        """A path that the cameras shall see, as the arm's kinematics has it."""
        if self.is_none:
            return path
        back = self._back
        position, quaternion = self.poses(path.position, path.quaternion)
        arm = rotate(quaternion, np.array(self.hand_shift))
        (v, w), (a, alpha) = (
            [rotate(back, part) for part in (rates[:, :3], rates[:, 3:])]
            for rates in (path.velocity, path.acceleration)
        )
        velocity = np.hstack([v - np.cross(w, arm), w])
        acceleration = np.hstack([a - np.cross(alpha, arm) - np.cross(w, np.cross(w, arm)), alpha])
        return replace(
            path,
            position=position,
            quaternion=quaternion,
            velocity=velocity,
            acceleration=acceleration,
        )
