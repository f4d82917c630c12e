"""A discrete pose primitive that the state of the robot drives: `PrimitiveCourse` over position and
the rotation vector e from the goal to the hand, q = exp(e) g, in which the primitive is linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common import quaternions
from dart_skill.movement._autonomous import Moment, StateFrame, Turning
from dart_skill.movement._primitive_course import PrimitiveCourse, answers
from dart_skill.movement.pose._primitives import DiscretePosePrimitive
from dart_skill.movement.pose._rotation_vectors import nearest, turning


@dataclass(frozen=True, eq=False)
class PosePrimitiveCourse(PrimitiveCourse):
    """The answers of a fitted pose primitive over position and rotation vector, d = 6; `goal` is a
    pose (7,).

    Parameters
    ----------
    start_turn
        (3,), rotation vector from the goal to the start that was shown: of the two turns between
        them the one that is nearer is made [rad].
    """

    start_turn: np.ndarray

    def moment(
        self, frames: Sequence[StateFrame], phase: float, inputs: ArrayLike | None = None
    ) -> Moment:
        """See `PrimitiveCourse`; with the turning of the hand, while the frames do not turn."""
        (b, db, ddb), rest, _ = self._at(phase)
        first, last = (self.frame_motion(frames[k]).axes for k in (0, -1))
        goal = self.goal[3:]
        begin = nearest(quaternions.of_matrices((last.T @ first)[None])[0], goal, self.start_turn)
        ways = (share * begin for share in (1.0 - b, -db, -ddb))
        vectors = [way + row for way, row in zip(ways, rest[:, 3:], strict=True)]
        turned, velocity, acceleration = turning(*vectors)
        rotation = quaternions.matrices(quaternions.product(turned, goal))
        made = Turning(last @ rotation, last @ velocity, last @ acceleration)
        return replace(super().moment(frames, phase, inputs), turning=made)


def pose_answers(
    primitive: DiscretePosePrimitive, time: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`answers` of a fitted pose primitive: b (n, 3) and r (n, 3, 6), with derivatives."""
    return answers(primitive._inner, time)
