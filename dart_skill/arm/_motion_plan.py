"""A motion of the hand that was planned beforehand: where it is expected, what pulls it there, and
what the fingers do meanwhile.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any

import numpy as np

from dart_skill.arm._command import Speed
from dart_skill.arm._registration import Registration
from dart_skill.common.arm_choice import joint_count
from dart_skill.common.constants import Grip
from dart_skill.common.pace import PhaseRule
from dart_skill.common.quaternions import rotate

AGREE = 1e-3
"""Lengths of quaternions are so near to 1, and stiffness matrices so near to symmetric, relative
to their size.
"""


@dataclass(frozen=True)
class Gains:
    """Spring and damper of (7.19) per unit mass: stiffness [1/s^2] and damping [1/s]; critical
    damping is 2 sqrt(stiffness).
    """

    stiffness: float
    damping: float

    @classmethod
    def critical(cls, stiffness: float) -> Gains:
        """Critically damped.

        Parameters
        ----------
        stiffness
            Of the spring, above 0.
        """
        return cls(stiffness, 2.0 * float(np.sqrt(stiffness)))

    def __post_init__(self) -> None:
        if not (
            np.isfinite([self.stiffness, self.damping]).all()
            and self.stiffness > 0
            and self.damping > 0
        ):
            raise ValueError(
                f"stiffness {self.stiffness} and damping {self.damping} must be finite and"
                " positive"
            )


@dataclass(frozen=True, eq=False)
class GainsOverTime:
    """Gains as symmetric matrices in world axes, one of each for every instant of a path:
    stiffness, damping (n, 3, 3).

    Both must be positive definite. That does not make a spring stable whose stiffness grows:
    `movement.stable_gains` does.
    """

    stiffness: np.ndarray
    damping: np.ndarray

    def turned(self, rotation: np.ndarray) -> GainsOverTime:
        """The same gains in axes to which a rotation (3, 3) leads."""
        return GainsOverTime(
            *(rotation @ gains @ rotation.T for gains in (self.stiffness, self.damping))
        )

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping"):
            value = np.asarray(getattr(self, name), dtype=float)
            check_shapes("gains", self, {name: (*value.shape[:1], 3, 3)})
            if np.abs(value - np.swapaxes(value, 1, 2)).max() > AGREE * np.abs(value).max():
                raise ValueError(f"{name} holds a matrix that is not symmetric")
            if (least := float(np.linalg.eigvalsh(value).min())) <= 0.0:
                raise ValueError(f"{name} has the eigenvalue {least:.3g}: all must be positive")


@dataclass(frozen=True)
class HandPath:
    """A motion of the hand frame in the world at n instants.

    Parameters
    ----------
    time
        (n,), from 0, increasing [s].
    position
        (n, 3) [m].
    quaternion
        (n, 4), x, y, z, w.
    velocity, acceleration
        (n, 6), linear over angular, world axes.
    """

    time: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

    def __post_init__(self) -> None:
        n = len(self.time)
        check_shapes("path", self, {"time": (n,), "position": (n, 3), "quaternion": (n, 4)})
        check_shapes("path", self, {"velocity": (n, 6), "acceleration": (n, 6)})
        if n < 2 or abs(self.time[0]) > 1e-9 or (np.diff(self.time) <= 0).any():
            raise ValueError("path.time must hold at least two increasing instants, from 0 on")
        check_unit("path.quaternion", self.quaternion)

    @property
    def duration(self) -> float:
        """Time of the last instant [s]."""
        return float(self.time[-1])

    def as_the_arm_has_it(self, registration: Registration) -> HandPath:
        """This path, which the cameras shall see, as the arm's kinematics has it.

        Parameters
        ----------
        registration
            Of cameras and arm.
        """
        position, quaternion = registration.poses(self.position, self.quaternion)
        arm = rotate(quaternion, np.array(registration.hand_shift))
        (v, w), (a, alpha) = (
            [rotate(registration.back, part) for part in (rates[:, :3], rates[:, 3:])]
            for rates in (self.velocity, self.acceleration)
        )
        velocity = np.hstack([v - np.cross(w, arm), w])
        acceleration = np.hstack([a - np.cross(alpha, arm) - np.cross(w, np.cross(w, arm)), alpha])
        return HandPath(self.time, position, quaternion, velocity, acceleration)


@dataclass(frozen=True)
class GripEvent:
    """The hand is told to open or to close at `time`, and has done so by `done`, both on the clock
    of the plan [s].
    """

    time: float
    grip: Grip
    done: float

    def __post_init__(self) -> None:
        if self.grip == Grip.UNSPECIFIED or not 0.0 <= self.time <= self.done < np.inf:
            raise ValueError(
                f"the hand is told {self.grip.name} at {self.time} s and has done so at"
                f" {self.done} s: OPEN or CLOSE, and in order"
            )


ON_AN_ARM = PhaseRule(slowest=0.01, fastest=1.5, time_constant=0.02, ignored=0.01)
"""Phase of a plan on an arm: a held arm makes it wait, and it does not hurry then. If nothing is
ignored, what an arm lags by moves the landings of throws by 1 to 5 cm; with 2.5 to 10 ms by
nothing.
"""


@dataclass(frozen=True, eq=False)
class Pace:
    """How the state of the arm drives the clock of a plan (thesis chapter 9).

    Parameters
    ----------
    gain : (n, 12)
        At each instant of the path, how far the hand is ahead [s] by its differences from the
        plan: of position [s/m], orientation as a rotation vector [s/rad], velocity [s^2/m] and
        angular velocity [s^2/rad].
    rule
        What comes of it; its rate 1 is the planned pace.
    """

    gain: np.ndarray
    rule: PhaseRule = ON_AN_ARM

    def __post_init__(self) -> None:
        check_shapes("pace", self, {"gain": (*np.shape(self.gain)[:1], 12)})


@dataclass(frozen=True, eq=False)
class ExpectedThrow:
    """What shall come of a plan that throws.

    Parameters
    ----------
    target
        Centre of the rim, or point of a board (3,) [m].
    aim
        The task parameter whose plan lands on the target (3,) [m].
    landing
        Where the ball is expected to cross the plane of the rim, or to meet the board (3,) [m].
    """

    target: np.ndarray
    aim: np.ndarray
    landing: np.ndarray

    def __post_init__(self) -> None:
        check_shapes("plan", self, dict.fromkeys(("target", "aim", "landing"), (3,)))


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """What the commander carries out.

    Parameters
    ----------
    path
        The motion of the hand that is expected, at n instants.
    attractor_position, attractor_quaternion
        (n, 3) [m] and (n, 4); they pull the hand along the path by (7.19).
    position_gains, orientation_gains
        Stiffness and damping of the pull, per unit mass.
    start_posture
        Joint angles before the motion (joints,) [rad].
    end
        Until then the hand must be where it is expected [s]. What the path has beyond is followed
        for a while, then the arm is braked.
    what
        It is, in a word, for messages.
    events
        What the fingers do, in order of time.
    carries
        Whether the hand holds something at the start.
    speed
        Level of speed that it needs.
    pace
        How the state of the arm drives the clock of the plan; None: it goes as fast as time.
    registration
        Of the cameras, in whose world all this is, and the arm, which shall do it; default: the
        two agree.
    posture
        Joint angles (n, joints) [rad] that the arm's free motion aims at; J2, J4 and J6 are left to the
        hand. None: those of the start.
    throw
        What shall be thrown where; None where nothing is. A throw opens the hand in its first
        event, and `end` is the release: what comes after is of no use to the ball.
    model_id
        Digest of the model that made the plan, default "".
    """

    path: HandPath
    attractor_position: np.ndarray
    attractor_quaternion: np.ndarray
    position_gains: Gains | GainsOverTime
    orientation_gains: Gains | GainsOverTime
    start_posture: np.ndarray
    end: float
    what: str = "motion"
    events: tuple[GripEvent, ...] = ()
    carries: bool = False
    speed: Speed = Speed.CAREFUL
    pace: Pace | None = None
    registration: Registration = field(default_factory=Registration)
    posture: np.ndarray | None = None
    throw: ExpectedThrow | None = None
    model_id: str = ""

    def __post_init__(self) -> None:
        n = len(self.path.time)
        shapes = {
            "attractor_position": (n, 3),
            "attractor_quaternion": (n, 4),
            "start_posture": (joint_count(),),
        }
        shapes |= {} if self.posture is None else {"posture": (n, joint_count())}
        check_shapes("plan", self, shapes)
        check_unit("plan.attractor_quaternion", self.attractor_quaternion)
        rows = {} if self.pace is None else {"pace.gain": self.pace.gain}
        for name in ("position_gains", "orientation_gains"):
            if isinstance(gains := getattr(self, name), GainsOverTime):
                rows |= {name: gains.stiffness, f"{name} (damping)": gains.damping}
        for name, given in rows.items():
            if len(given) != n:
                raise ValueError(
                    f"plan.{name} has {len(given)} entries, the path {n} instants: give one for"
                    " each"
                )
        if not 0.0 < self.end <= self.path.duration:
            raise ValueError(
                f"plan.end is {self.end} s, outside the path of {self.path.duration} s"
            )
        times = [event.time for event in self.events]
        if times != sorted(times) or any(event.done > self.path.duration for event in self.events):
            raise ValueError(
                f"plan.events are at {times} s: give them in order, and within the path of"
                f" {self.path.duration} s"
            )

    @property
    def thrown(self) -> ExpectedThrow:
        """What shall be thrown where; ValueError for a plan that throws nothing."""
        if self.throw is None:
            raise ValueError(f"the plan of a {self.what} throws nothing")
        return self.throw

    @property
    def open_hand(self) -> float:
        """Time of the first event [s]: in a throw, the hand is told to open."""
        return self.events[0].time

    @property
    def release(self) -> float:
        """Time at which the first event is over [s]: in a throw, the ball leaves the hand."""
        return self.events[0].done

    def opening_at(self, time: float) -> MotionPlan:
        """The same throw, whose hand is told to open at another time [s]; 0 for one before the
        start.
        """
        return replace(self, events=(replace(self.events[0], time=max(0.0, time)),))

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

    def as_the_arm_has_it(self) -> MotionPlan:
        """The same motion as the arm's own kinematics says it."""
        if self.registration.is_none:
            return self
        position, quaternion = self.registration.poses(
            self.attractor_position, self.attractor_quaternion
        )
        position_gains, orientation_gains = (
            gains if isinstance(gains, Gains) else gains.turned(self.registration.axes)
            for gains in (self.position_gains, self.orientation_gains)
        )
        return replace(
            self,
            path=self.path.as_the_arm_has_it(self.registration),
            attractor_position=position,
            attractor_quaternion=quaternion,
            position_gains=position_gains,
            orientation_gains=orientation_gains,
            registration=Registration(),
        )


def same_plan(first: MotionPlan, second: MotionPlan) -> bool:
    """Whether two plans are equal bit for bit, but for the name of their model.

    Parameters
    ----------
    first, second
        The plans.
    """
    return all(
        _equal(getattr(first, f.name), getattr(second, f.name))
        for f in fields(MotionPlan)
        if f.name != "model_id"
    )


def _equal(first: Any, second: Any) -> bool:
    if is_dataclass(first) and type(first) is type(second):
        return all(_equal(getattr(first, f.name), getattr(second, f.name)) for f in fields(first))
    return (
        bool(np.array_equal(first, second)) if isinstance(first, np.ndarray) else first == second
    )


def check_shapes(what: str, owner: object, shapes: Mapping[str, tuple[int, ...]]) -> None:
    """ValueError unless attributes are finite numbers of these shapes."""
    for name, shape in shapes.items():
        value = np.asarray(getattr(owner, name), dtype=float)
        if value.shape != shape or not np.isfinite(value).all():
            raise ValueError(
                f"{what}.{name} has shape {value.shape} or is not finite; it must be {shape}"
            )


def check_unit(name: str, quaternions: np.ndarray) -> None:
    """ValueError unless quaternions (n, 4) are of unit length."""
    if np.abs(np.linalg.norm(quaternions, axis=1) - 1.0).max() > AGREE:
        raise ValueError(f"{name} holds a quaternion that is not of unit length: normalise it")
