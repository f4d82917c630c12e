"""From the commander's commands to joint efforts, with the watchdog that a driver must have: tau =
J' w + tau_joint (+ gravity).

    WAITING -> ACTIVE -> STOPPED -> (reset) WAITING

WAITING and STOPPED damp the joints; what is wrong while commands are carried out leads to STOPPED,
and stays there until a reset. Every effort is cut to the limit of its joint, and changes
no faster than the rate of its joint, so that nothing begins with a jump.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import Enum

import numpy as np

from dart_skill.arm._command import ArmState, Command, all_finite
from dart_skill.arm._description import ArmDescription
from dart_skill.arm._model import ArmModel
from dart_skill.arm._safety import SafetyLimits, SafetyModule
from dart_skill.common.arm_choice import joint_count
from dart_skill.common.checks import as_number, as_vector
from dart_skill.common.constants import Grip

LONGEST_STEP = 0.01
"""Longest time whose change of an effort is made at once [s]."""


class BridgePhase(Enum):
    """What an effort bridge is doing."""

    WAITING = "waiting"
    ACTIVE = "active"
    STOPPED = "stopped"


@dataclass(frozen=True)
class BridgeSettings:
    """Limits and times; each is a parameter of the node effort_bridge, and its value stands in
    config/effort_bridge.yaml.

    Parameters
    ----------
    frame_id
        Axes of the wrenches.
    gravity_compensation
        Whether the torque that holds arm and hand is added; False: the effort controller's
        hardware adds it.
    torque_limit
        Of each joint, gravity included (n,) [N m].
    torque_rate
        Fastest change of each (n,) [N m/s].
    damping
        Of a joint that is stopped (n,) [N m s/rad].
    damping_limit
        Strongest damping torque (n,) [N m].
    command_timeout, state_timeout
        The arm is stopped when commands, or states, were silent for longer [s].
    limits
        Of speed, range and workspace, of config/limits.yaml; the bridge is the arm's own safety
        module, and patient as one.
    """

    frame_id: str
    gravity_compensation: bool
    torque_limit: np.ndarray
    torque_rate: np.ndarray
    damping: np.ndarray
    damping_limit: np.ndarray
    command_timeout: float
    state_timeout: float
    limits: SafetyLimits

    def __post_init__(self) -> None:
        for name in ("torque_limit", "torque_rate", "damping", "damping_limit"):
            value = as_vector(getattr(self, name), name, joint_count())
            if not np.all(value > 0.0):
                raise ValueError(
                    f"{name} is {value.tolist()}: give {joint_count()} positive numbers"
                )
            object.__setattr__(self, name, value)
        for name in ("command_timeout", "state_timeout"):
            object.__setattr__(self, name, as_number(getattr(self, name), name))

    @classmethod
    def from_parameters(cls, parameters: Mapping) -> BridgeSettings:
        """Settings from the parameters of the node."""
        own = {f.name: parameters[f.name] for f in fields(cls) if f.name != "limits"}
        return cls(**own, limits=SafetyLimits.from_parameters(parameters))


class EffortBridge:
    """Answers states of the arm with efforts. Times `now` are of a clock that never jumps [s].

    Attributes
    ----------
    phase, message
        What it does, and why it was stopped or waits.
    clipped
        How many efforts were cut to the limit of a joint.
    """

    def __init__(self, settings: BridgeSettings, description: ArmDescription | None = None):
        self.settings = settings
        self.phase, self.message, self.clipped = BridgePhase.WAITING, "no state of the arm yet", 0
        self._model = ArmModel(description)
        self._safety = SafetyModule(settings.limits, description, settings.limits.patience)
        self._state: ArmState | None = None
        self._state_at = self._command_at = 0.0
        self._command: Command | None = None
        self._publishers = 1
        self._effort = self._before = np.zeros(joint_count())  # now, and at the state before
        self._step = 0.0

    def on_publishers(self, count: int) -> None:
        """How many publish commands now: none is a silent commander, two are a fault.

        Parameters
        ----------
        count
            Their number.
        """
        self._publishers = count
        if count > 1 and self.phase is BridgePhase.ACTIVE:
            self.stop(f"{count} nodes publish commands: end all but one")

    def on_command(self, command: Command, frame_id: str, now: float) -> bool | None:
        """Take a command; whether the hand shall open (True) or close (False) now, None if nothing
        is said of it anew.

        Parameters
        ----------
        frame_id
            Of its wrench.
        """
        if self.phase is BridgePhase.STOPPED:
            return None
        if reason := self._refused(command, frame_id, now):
            if self.phase is BridgePhase.ACTIVE:
                self.stop(reason)
            else:
                self.message = reason
            return None
        said = Grip.UNSPECIFIED if self._command is None else self._command.grip
        self.phase, self.message, self._command, self._command_at = (
            BridgePhase.ACTIVE,
            "",
            command,
            now,
        )
        return None if command.grip in (said, Grip.UNSPECIFIED) else command.grip is Grip.OPEN

    def on_state(self, state: ArmState, now: float) -> np.ndarray:
        """The efforts (n,) [N m] for a state and the command that was there before it; those of
        its own command: `efforts`.
        """
        if state.position.shape != (joint_count(),) or not (
            all_finite(state.position) and all_finite(state.velocity)
        ):
            self.stop(
                f"the joint state of {state.stamp_ns} ns is not seven finite positions and"
                " velocities"
            )
            return self._held()
        before = self._state
        self._state = state
        self._state_at = now
        step = 0.0 if before is None else (state.stamp_ns - before.stamp_ns) * 1e-9
        if self.phase is BridgePhase.ACTIVE:
            self._watch(step, now)
        elif self.phase is BridgePhase.WAITING and before is None:
            self.message = "no command yet: is the commander running?"
        self._advance(min(max(step, 0.0), LONGEST_STEP))
        return self._limited(self._wanted(state))

    def efforts(self) -> np.ndarray:
        """The efforts (n,) [N m] for the newest state and the newest command; zero before there is
        a state.
        """
        return (
            np.zeros(joint_count())
            if self._state is None
            else self._limited(self._wanted(self._state))
        )

    def tick(self, now: float) -> np.ndarray | None:
        """Look at the clock: efforts (n,) [N m] when the states are silent, so that none answers
        them; None when they come.
        """
        if self._state is None:
            return None
        if self.phase is BridgePhase.ACTIVE:
            self._watch(0.0, now)
        if now - self._state_at <= self.settings.state_timeout:
            return None
        return self._held()

    def stop(self, reason: str) -> None:
        """Damp the joints from now on; the first reason is kept."""
        if self.phase is not BridgePhase.STOPPED:
            self.phase, self.message, self._command = BridgePhase.STOPPED, reason, None

    def reset(self, now: float) -> str:
        """Wait for commands again after a stop; why not, if the arm's states are silent or two
        publish commands, else empty.
        """
        if self._publishers > 1:
            return f"{self._publishers} nodes publish commands: end all but one"
        if self._state is None or now - self._state_at > self.settings.state_timeout:
            return "no states of the arm come: is its driver running?"
        self.phase, self.message, self._command = (
            BridgePhase.WAITING,
            "no command since the reset",
            None,
        )
        self._safety.reset()
        return ""

    def _refused(self, command: Command, frame_id: str, now: float) -> str:
        """Why a command is not carried out; empty if it is."""
        if self._publishers > 1:
            return f"{self._publishers} nodes publish commands: end all but one"
        if self._state is None or now - self._state_at > self.settings.state_timeout:
            return "a command came, but no state of the arm: is its driver running?"
        if frame_id != self.settings.frame_id:
            return f"a command is in frame '{frame_id}', not '{self.settings.frame_id}'"
        if not (all_finite(command.wrench) and all_finite(command.joint_torque)):
            return f"the command of {command.stamp_ns} ns is not finite"
        age = (self._state.stamp_ns - command.stamp_ns) * 1e-9
        if abs(age) > self.settings.command_timeout:
            return (
                f"a command answers a state of {age:.3f} s ago: is it of this arm, and on its"
                " clock?"
            )
        return ""

    def _watch(self, step: float, now: float) -> None:
        """Stop if commands or states were silent, by the stamps or by the clock."""
        limits = self.settings
        if self._state is None or self._command is None:
            return
        silent = max(
            now - self._command_at, (self._state.stamp_ns - self._command.stamp_ns) * 1e-9
        )
        if step < 0.0:
            self.stop(f"the stamps of the states jumped back by {-step:.3f} s")
        elif max(step, now - self._state_at) > limits.state_timeout:
            self.stop(f"no state of the arm for {max(step, now - self._state_at):.3f} s")
        elif silent > limits.command_timeout:
            self.stop(f"no command for {silent:.3f} s: is the commander running?")
        elif fault := self._safety.look(
            self._state.position,
            self._state.velocity,
            np.zeros(joint_count()),
            self._command.speed,
        ):
            self.stop(fault)

    def _wanted(self, state: ArmState) -> np.ndarray:
        """Efforts before they are limited: of the command, or of the damping."""
        limits, command = self.settings, self._command
        gravity = (
            self._model.gravity_torque(state.position)
            if limits.gravity_compensation
            else np.zeros(joint_count())
        )
        if command is None:
            return gravity + np.clip(
                -limits.damping * state.velocity, -limits.damping_limit, limits.damping_limit
            )
        return (
            gravity
            + self._model.jacobian(state.position).T @ command.wrench
            + command.joint_torque
        )

    def _held(self) -> np.ndarray:
        """Efforts while it is not known how the arm moves: gravity where it was last, if that is
        compensated here, and nothing else.
        """
        self._advance(LONGEST_STEP)
        if self._state is None or not self.settings.gravity_compensation:
            return self._limited(np.zeros(joint_count()))
        return self._limited(self._model.gravity_torque(self._state.position))

    def _advance(self, step: float) -> None:
        """From now on efforts may differ from those of this instant by what they may change in
        `step` [s].
        """
        self._before, self._step = self._effort, step

    def _limited(self, wanted: np.ndarray) -> np.ndarray:
        """Efforts within limits and rates."""
        limits = self.settings
        cut = np.clip(wanted, -limits.torque_limit, limits.torque_limit)
        self.clipped += bool(np.any(cut != wanted))
        change = limits.torque_rate * self._step
        self._effort = self._before + np.clip(cut - self._before, -change, change)
        return self._effort.copy()
