"""What passes between a controller and the arm in one control period."""

import math
from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np

from dart_skill.common.arm_choice import joint_count
from dart_skill.common.constants import Grip

REST_SPEED = 0.05
"""An arm rests, and a stop is over, when no joint is faster [rad/s]."""


class Speed(IntEnum):
    """Level of speed that a command needs, of config/limits.yaml; the values are those of
    dart_skill_msgs/WamCommand.
    """

    CAREFUL = 0
    THROW = 1


@dataclass(frozen=True)
class ArmState:
    """What the arm's own sensors tell at one instant.

    Parameters
    ----------
    stamp_ns
        Int [ns].
    position
        Joint angles (n,) [rad].
    velocity
        Joint velocities (n,) [rad/s].
    """

    stamp_ns: int
    position: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True)
class Command:
    """An answer to a state. The arm adds gravity compensation by itself.

    Parameters
    ----------
    stamp_ns
        Of the state [ns].
    wrench
        (6,), force [N] and moment [N m] at the hand frame's origin, world axes.
    joint_torque
        (n,), is added to J' wrench [N m].
    grip
        What the hand shall do.
    speed
        The level that it may move with.
    """

    stamp_ns: int
    wrench: np.ndarray = field(default_factory=lambda: np.zeros(6))
    joint_torque: np.ndarray = field(default_factory=lambda: np.zeros(joint_count()))
    grip: Grip = Grip.UNSPECIFIED
    speed: Speed = Speed.CAREFUL

    def answering(self, stamp_ns: int) -> "Command":
        """The same command as the answer to a later state; what the hand was told is not told
        again.
        """
        return Command(stamp_ns, self.wrench, self.joint_torque, speed=self.speed)


class HeldCommand:
    """The newest command of one sender, for an arm that does not wait for an answer to each of its
    states.

    Parameters
    ----------
    longest
        Age beyond which a command does not hold any more [s].
    """

    def __init__(self, longest: float):
        self._longest_ns, self._told = round(longest * 1e9), Grip.UNSPECIFIED
        self._newest: Command | None = None

    @property
    def has_come(self) -> bool:
        """Whether there was any command."""
        return self._newest is not None

    def is_for(self, stamp_ns: int) -> bool:
        """Whether the newest command answers a state.

        Parameters
        ----------
        stamp_ns
            Int of the state [ns].
        """
        return self._newest is not None and self._newest.stamp_ns >= stamp_ns

    def take(self, command: Command) -> None:
        """The next one has come.

        Parameters
        ----------
        command
            Of this sender.

        Raises
        ------
        ValueError
            If it answers a state before that of the newest.
        """
        if self._newest is not None and command.stamp_ns < self._newest.stamp_ns:
            newest = self._newest.stamp_ns
            raise ValueError(
                f"it is stamped {command.stamp_ns} ns, before the one of {newest} ns that is"
                " obeyed: out of order"
            )
        self._newest = command
        if command.grip != Grip.UNSPECIFIED:
            # a newer command that comes before the next state must not swallow it
            self._told = command.grip

    def answer_to(self, stamp_ns: int) -> Command | None:
        """The newest command as the answer to a state; None if there is none that is young enough.
        Each grip is said once.

        Parameters
        ----------
        stamp_ns
            Int of the state [ns].
        """
        told = self._told
        self._told = Grip.UNSPECIFIED
        if self._newest is None or stamp_ns - self._newest.stamp_ns > self._longest_ns:
            return None
        return replace(self._newest.answering(stamp_ns), grip=told)


def all_finite(values: np.ndarray) -> bool:
    """Whether the few numbers of an array (n,) are finite; at this size four times as fast as
    np.isfinite(values).all().
    """
    return math.isfinite(sum(values.tolist()))


def check_command(command: Command, stamp_ns: int) -> None:
    """ValueError with the reason unless the command is finite, of the right shape and answers the
    state of `stamp_ns`.
    """
    for name, shape in (("wrench", (6,)), ("joint_torque", (joint_count(),))):
        value = np.asarray(getattr(command, name), dtype=float)
        if value.shape != shape:
            raise ValueError(f"command.{name} has shape {value.shape}, not {shape}")
        if not all_finite(value):
            raise ValueError(f"command.{name} is {value}: send finite numbers")
    if command.stamp_ns != stamp_ns:
        raise ValueError(
            f"the command answers the state of {command.stamp_ns} ns, but the arm is at {stamp_ns}"
            " ns: echo its stamp"
        )
