"""The limits of the arm, and the module that watches them: in the commander, and again in the arm,
as Barrett's safety module does.

A level that is passed is latched until a reset. What happens then is decided by the caller: the
commander brings the arm to a damped stop, the arm itself shorts its motors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from dart_skill.arm._arm_terms import ArmTerms
from dart_skill.arm._command import Command, Speed
from dart_skill.arm._description import ArmDescription
from dart_skill.arm._joint_checks import Levels
from dart_skill.arm._model import ArmModel
from dart_skill.arm._the_arm import the_arm
from dart_skill.common.checks import as_number, as_vector
from dart_skill.common.configuration import limit_parameters


@dataclass(frozen=True)
class SafetyLimits:
    """The entries of config/limits.yaml.

    Parameters
    ----------
    careful_elbow, careful_hand
        Fastest elbow and hand where nothing is thrown [m/s].
    fastest_elbow, fastest_hand
        The same of a throw, and of an arm that a person guides [m/s].
    torque_share
        Of the peak torque of a joint, gravity compensation included.
    joint_margin
        To the end of a joint's range, at which a throw is stopped [rad].
    joint_overrun
        Beyond the end of a joint's range [rad].
    workspace_low, workspace_high
        Corners of the box in which the hand stays, in the frame of the world (3,) [m].
    strongest_force, strongest_moment
        Of the commander's wrench, which is cut there [N], [N m].
    contact_force
        With which a careful hand presses what it carries against what that touches [N].
    human_force, human_moment
        Of a person who guides the arm [N], [N m].
    warning_share
        Of a limit, from which it is warned of.
    patience
        Limits of the arm's own safety module, as shares of these.
    """

    careful_elbow: float
    careful_hand: float
    fastest_elbow: float
    fastest_hand: float
    torque_share: float
    joint_margin: float
    joint_overrun: float
    workspace_low: tuple[float, ...]
    workspace_high: tuple[float, ...]
    strongest_force: float
    strongest_moment: float
    contact_force: float
    human_force: float
    human_moment: float
    warning_share: float
    patience: float

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            corner = field.name.startswith("workspace")
            checked = (
                tuple(as_vector(value, field.name, 3).tolist())
                if corner
                else as_number(value, field.name)
            )
            object.__setattr__(self, field.name, checked)
        low, high = self.workspace_low, self.workspace_high
        if not all(one < other for one, other in zip(low, high, strict=True)):
            raise ValueError(
                f"the workspace from {low} to {high} is empty: workspace_low is its lower corner"
            )

    @classmethod
    def from_parameters(cls, parameters: Mapping) -> SafetyLimits:
        """Limits from the parameters of a node."""
        return cls(**{field.name: parameters[field.name] for field in fields(cls)})

    @classmethod
    def configured(cls) -> SafetyLimits:
        """Those of config/limits.yaml."""
        return cls.from_parameters(limit_parameters())


class SafetyModule:
    """Watches speed of elbow and hand, torque, range of the joints and workspace, state by state.

    Attributes: `warning`, what is near its limit now, and `fault`, what first passed it, which
    stays until `reset`; both empty if none.

    Parameters
    ----------
    limits
        Of the arm.
    description
        Of the arm, default the WAM.
    patience
        Every limit is multiplied by it, default 1.
    """

    def __init__(
        self,
        limits: SafetyLimits,
        description: ArmDescription | None = None,
        patience: float = 1.0,
    ):
        description = description or the_arm()
        self._limits, self._patience = limits, patience
        self._model = ArmModel(description)
        lower, upper = description.ends
        self._middle, self._half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        self._strongest = limits.torque_share * description.of_joints("peak_torque")
        self._fastest = {
            Speed.CAREFUL: (limits.careful_elbow, limits.careful_hand),
            Speed.THROW: (limits.fastest_elbow, limits.fastest_hand),
        }
        low, high = np.array(limits.workspace_low), np.array(limits.workspace_high)
        grown = 0.5 * (patience - 1.0) * (high - low)
        self._low, self._high = (low - grown).tolist(), (high + grown).tolist()
        beyond = patience * limits.joint_overrun
        self._levels = Levels(
            self._strongest, lower - beyond, upper + beyond, low - grown, high + grown
        )
        self.warning = self.fault = ""

    def reset(self) -> None:
        """Forget the fault, after the person who is responsible has looked at the arm."""
        self.warning = self.fault = ""

    def look(
        self, position: np.ndarray, velocity: np.ndarray, torque: np.ndarray, speed: Speed
    ) -> str:
        """The fault after a state of the arm: angles (n,) [rad], speeds (n,) [rad/s], torque that
        is asked for (n,) [N m], speed level.
        """
        return self.look_at(self._model.at(position, velocity), torque, speed)

    def look_at(self, terms: ArmTerms, torque: np.ndarray, speed: Speed) -> str:
        """Check a state whose kinematics are computed already (`look`).

        Parameters
        ----------
        terms
            Of the model.
        torque, speed
            As of `look`.
        """
        if self.fault:
            return self.fault
        self.warning = ""
        if not self._levels.are_far(
            terms, torque, *self._fastest[speed], self._limits.warning_share
        ):
            self._judge(terms, torque, speed)
        return self.fault

    def _judge(self, terms: ArmTerms, torque: np.ndarray, speed: Speed) -> None:
        """What is near its limit or beyond it, in words."""
        hand = [float(at) for at in terms.position]
        speeds = terms.elbow_speed, terms.hand_speed
        shares = [one / most for one, most in zip(speeds, self._fastest[speed], strict=True)]
        shares += (np.abs(torque) / self._strongest).tolist()
        overruns = (np.abs(np.asarray(terms.q) - self._middle) - self._half).tolist()
        worst = max(shares)
        # `max` overlooks what is not a number.
        if not math.isfinite(sum(shares) + sum(overruns)):
            self.fault = "the state of the arm, or the torque that is asked for, is not finite"
        elif outside := self._outside(hand):
            self.fault = outside
        elif max(overruns) > self._patience * self._limits.joint_overrun:
            self.fault = self._overrun(terms.q, overruns)
        elif worst > self._limits.warning_share:
            self.warning = self._level(speed, speeds, torque, shares)
            self.fault = self.warning if worst > self._patience else ""

    def limited(self, command: Command, position: np.ndarray) -> Command:
        """The command, weakened as a whole where it asks a joint for more than the limit on top of
        gravity compensation.
        """
        return self.limited_at(self._model.at(position), command)

    def limited_at(self, terms: ArmTerms, command: Command) -> Command:
        """Limit a command where the kinematics are computed already (`limited`).

        Parameters
        ----------
        terms
            Of the model.
        command
            That is weakened.
        """
        share = self._levels.share(terms, command.wrench, command.joint_torque)
        if share >= 1.0:
            return command
        return Command(
            command.stamp_ns,
            share * command.wrench,
            share * command.joint_torque,
            command.grip,
            command.speed,
        )

    def _outside(self, hand: list[float]) -> str:
        """Where the hand is outside its box, in words; empty if it is inside."""
        for axis, low, at, high in zip("xyz", self._low, hand, self._high, strict=True):
            if not low <= at <= high:
                return (
                    f"the hand is at {axis} {at:.2f} m, outside the workspace of {low:g} to"
                    f" {high:g} m"
                )
        return ""

    @staticmethod
    def _overrun(position: np.ndarray, overruns: list[float]) -> str:
        j = overruns.index(max(overruns))
        return (
            f"j{j + 1} is at {position[j]:.3f} rad, {overruns[j]:.3f} rad beyond its range: are"
            " encoders and the joints' order right?"
        )

    def _level(
        self, speed: Speed, speeds: tuple[float, float], torque: np.ndarray, shares: list[float]
    ) -> str:
        """Level that is used most, in words; shares (9,) of elbow, hand and joints."""
        most = shares.index(max(shares))
        if most >= 2:
            j = most - 2
            return (
                f"j{j + 1} is asked for {torque[j]:.4g} N m; the limit is"
                f" {self._strongest[j]:.1f} N m"
            )
        of = "a throw" if speed is Speed.THROW else "an arm that does not throw"
        return (
            f"the {('elbow', 'hand')[most]} moves at {speeds[most]:.2f} m/s; the limit of {of} is"
            f" {self._fastest[speed][most]:g} m/s"
        )


def check_push(push: Command, limits: SafetyLimits) -> None:
    """ValueError for a push that is stronger than a person is: at the hand, or by the other hand
    as torques of joints, up to 1 m away.

    limits: of the arm.
    """
    fx, fy, fz, *moments = push.wrench.tolist()
    force, moment, torque = (
        math.hypot(fx, fy, fz),
        math.hypot(*moments),
        math.hypot(*push.joint_torque.tolist()),
    )
    if force > limits.human_force or moment > limits.human_moment or torque > limits.human_force:
        strongest = f"{limits.human_force:g} N and {limits.human_moment:g} N m"
        raise ValueError(
            f"no person pushes with {force:g} N, {moment:g} N m and {torque:g} N m at the joints: at"
            f" most {strongest} are taken"
        )
