"""A planned throw: where the attractor goes, where the hand is expected, when the ball leaves it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from dart_skill.constants import N_JOINTS
from dart_skill.robot._registration import Registration


@dataclass(frozen=True)
class Gains:
    """Spring and damper of (7.19) per unit mass: stiffness [1/s^2] and damping [1/s]; critical damping is 2 sqrt(stiffness)."""

    stiffness: float
    damping: float

    def __post_init__(self) -> None:
        if not (np.isfinite([self.stiffness, self.damping]).all() and self.stiffness > 0 and self.damping > 0):
            raise ValueError(f"stiffness {self.stiffness} and damping {self.damping} must be finite and positive")


@dataclass(frozen=True)
class HandPath:
    """A motion of the hand frame in the world at n instants.

    time (n,) [s] from 0, increasing; position (n, 3) [m]; quaternion (n, 4) x, y, z, w; velocity and acceleration (n, 6), linear
    over angular, world axes.
    """

    time: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

    def __post_init__(self) -> None:
        n = len(self.time)
        shapes = {"time": (n,), "position": (n, 3), "quaternion": (n, 4), "velocity": (n, 6), "acceleration": (n, 6)}
        for name, shape in shapes.items():
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(f"path.{name} has shape {value.shape} or is not finite; it must be {shape} for {n} instants")
        if n < 2 or abs(self.time[0]) > 1e-9 or (np.diff(self.time) <= 0).any():
            raise ValueError("path.time must hold at least two increasing instants, from 0 on")
        _check_unit("path.quaternion", self.quaternion)

    @property
    def duration(self) -> float:
        """Time of the last instant [s]."""
        return float(self.time[-1])


@dataclass(frozen=True)
class ThrowPlan:
    """A throw at a target.

    * target: centre of the rim (3,) [m].
    * aim: the task parameter whose plan lands on the target (3,) [m].
    * predicted_landing: where the ball is expected to cross the plane of the rim (3,) [m].
    * path: the motion of the hand that is expected, at n instants.
    * attractor_position, attractor_quaternion: (n, 3) [m] and (n, 4); they pull the hand along the path by (7.19).
    * position_gains, orientation_gains: stiffness and damping of the pull, per unit mass.
    * release: time on the path's clock at which the ball leaves the hand [s].
    * open_hand: time at which the hand is told to open [s].
    * start_posture: joint angles before the throw (7,) [rad].
    * model_id: digest of the model that made the plan, default "".
    * registration: of the cameras, in whose world all this is, and the arm, which shall do it; default: the two agree.
    """

    target: np.ndarray
    aim: np.ndarray
    predicted_landing: np.ndarray
    path: HandPath
    attractor_position: np.ndarray
    attractor_quaternion: np.ndarray
    position_gains: Gains
    orientation_gains: Gains
    release: float
    open_hand: float
    start_posture: np.ndarray
    model_id: str = ""
    registration: Registration = Registration()

    def as_the_arm_has_it(self) -> ThrowPlan:
        """The same throw with the motion of the hand as the arm's own kinematics says it; target and landing stay those of the cameras."""
        if self.registration.is_none:
            return self
        position, quaternion = self.registration.poses(self.attractor_position, self.attractor_quaternion)
        path = self.registration.path(self.path)
        return replace(self, path=path, attractor_position=position, attractor_quaternion=quaternion, registration=Registration())

    def __post_init__(self) -> None:
        n = len(self.path.time)
        shapes = {"target": (3,), "aim": (3,), "predicted_landing": (3,), "attractor_position": (n, 3),
                  "attractor_quaternion": (n, 4), "start_posture": (N_JOINTS,)}  # fmt: skip
        for name, shape in shapes.items():
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(f"plan.{name} has shape {value.shape} or is not finite; it must be {shape}")
        _check_unit("plan.attractor_quaternion", self.attractor_quaternion)
        if self.open_hand > self.release:
            raise ValueError(f"plan.open_hand is {self.open_hand} s, after the release at {self.release} s")
        if not 0.0 < self.release <= self.path.duration:
            raise ValueError(f"plan.release is {self.release} s, outside the path of {self.path.duration} s")
        if not 0.0 <= self.open_hand <= self.path.duration:
            raise ValueError(f"plan.open_hand is {self.open_hand} s, outside the path of {self.path.duration} s")


def _check_unit(name: str, quaternions: np.ndarray) -> None:
    if np.abs(np.linalg.norm(quaternions, axis=1) - 1.0).max() > 1e-3:
        raise ValueError(f"{name} holds a quaternion that is not of unit length: normalise it")


def same_plan(first: ThrowPlan, second: ThrowPlan) -> bool:
    """Whether two plans are equal bit for bit, but for the name of their model."""
    return all(_equal(getattr(first, f.name), getattr(second, f.name)) for f in fields(ThrowPlan) if f.name != "model_id")


def _equal(first: Any, second: Any) -> bool:
    if isinstance(first, HandPath):
        return all(_equal(getattr(first, f.name), getattr(second, f.name)) for f in fields(HandPath))
    return bool(np.array_equal(first, second)) if isinstance(first, np.ndarray) else first == second
