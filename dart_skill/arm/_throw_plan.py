"""A planned throw: where the attractor goes, where the hand is expected, when the ball leaves it."""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from dart_skill.arm._command import Speed
from dart_skill.arm._motion_plan import (
    Gains,
    GainsOverTime,
    GripEvent,
    HandPath,
    MotionPlan,
    Pace,
    check_shapes,
)
from dart_skill.arm._registration import Registration
from dart_skill.common.constants import Grip


@dataclass(frozen=True)
class ThrowPlan:
    """A throw at a target.

    Parameters
    ----------
    target
        Centre of the rim (3,) [m].
    aim
        The task parameter whose plan lands on the target (3,) [m].
    predicted_landing
        Where the ball is expected to cross the plane of the rim (3,) [m].
    path
        The motion of the hand that is expected, at n instants.
    attractor_position, attractor_quaternion
        (n, 3) [m] and (n, 4); they pull the hand along the path by (7.19).
    position_gains, orientation_gains
        Stiffness and damping of the pull, per unit mass.
    release
        Time on the path's clock at which the ball leaves the hand [s].
    open_hand
        Time at which the hand is told to open [s].
    start_posture
        Joint angles before the throw (7,) [rad].
    model_id
        Digest of the model that made the plan, default "".
    registration
        Of the cameras, in whose world all this is, and the arm, which shall do it; default: the
        two agree.
    pace
        How the state of the arm drives the clock of the throw; default None: it goes as fast as
        time.
    """

    target: np.ndarray
    aim: np.ndarray
    predicted_landing: np.ndarray
    path: HandPath
    attractor_position: np.ndarray
    attractor_quaternion: np.ndarray
    position_gains: Gains | GainsOverTime
    orientation_gains: Gains
    release: float
    open_hand: float
    start_posture: np.ndarray
    model_id: str = ""
    registration: Registration = Registration()
    pace: Pace | None = None

    @property
    def motion(self) -> MotionPlan:
        """What the arm does for it: the hand opens, the ball is gone at the release, and what
        comes after is of no use to the ball.
        """
        return MotionPlan(
            path=self.path,
            attractor_position=self.attractor_position,
            attractor_quaternion=self.attractor_quaternion,
            position_gains=self.position_gains,
            orientation_gains=self.orientation_gains,
            start_posture=self.start_posture,
            end=self.release,
            what="throw",
            events=(GripEvent(self.open_hand, Grip.OPEN, self.release),),
            carries=True,
            speed=Speed.THROW,
            pace=self.pace,
            registration=self.registration,
        )

    def begin_ns(self, opened_ns: int, commands_ns: np.ndarray) -> int:
        """Stamp [ns] of the command with which a throw by this plan began, from the stamp of the
        command that opened the hand.

        The hand opens with the first command at or after its time in the plan, so the throw began
        at the stamp of a command. This is only true where time drives the plan.

        Parameters
        ----------
        opened_ns
            Stamp of the command that opened the hand [ns].
        commands_ns
            (n,) stamps of all commands [ns].
        """
        latest = opened_ns - round(self.open_hand * 1e9) + 1
        return int(
            commands_ns[max(int(np.searchsorted(commands_ns, latest, side="right")) - 1, 0)]
        )

    def __post_init__(self) -> None:
        check_shapes("plan", self, dict.fromkeys(("target", "aim", "predicted_landing"), (3,)))
        if self.open_hand > self.release:
            raise ValueError(
                f"plan.open_hand is {self.open_hand} s, after the release at {self.release} s"
            )
        if not 0.0 < self.release <= self.path.duration:
            raise ValueError(
                f"plan.release is {self.release} s, outside the path of {self.path.duration} s"
            )
        if not self.open_hand >= 0.0:
            raise ValueError(f"plan.open_hand is {self.open_hand} s, outside the path")
        _ = self.motion  # or a ValueError that says what of it is wrong


def same_plan(first: ThrowPlan, second: ThrowPlan) -> bool:
    """Whether two plans are equal bit for bit, but for the name of their model.

    Parameters
    ----------
    first, second
        The plans.
    """
    return all(
        _equal(getattr(first, f.name), getattr(second, f.name))
        for f in fields(ThrowPlan)
        if f.name != "model_id"
    )


def _equal(first: Any, second: Any) -> bool:
    if is_dataclass(first) and type(first) is type(second):
        return all(_equal(getattr(first, f.name), getattr(second, f.name)) for f in fields(first))
    return (
        bool(np.array_equal(first, second)) if isinstance(first, np.ndarray) else first == second
    )
