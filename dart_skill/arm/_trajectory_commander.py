"""A commander for arms whose controllers take positions: a motion is sent as a whole, as a path of
the joints in time, and watched while the arm makes it.

It has the modes of `Commander`, and answers every state with a command without wrench and torques,
which tells the fingers only. A cancelled path, of a motion that is stopped for whatever reason, is
braked by the controller.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from dart_skill.arm._command import ArmState, Command
from dart_skill.arm._commander import Commander, Mode
from dart_skill.arm._description import ArmDescription
from dart_skill.arm._guide import Fingers, Guide, PlanGuide
from dart_skill.arm._joint_trajectory import JointTrajectory, planned_trajectory, way_to
from dart_skill.arm._motion_plan import MotionPlan
from dart_skill.arm._plan_checks import CommanderSettings, PlanRefused, check_plan, registered
from dart_skill.arm._registration import Registration
from dart_skill.common.arm_choice import joint_count
from dart_skill.common.constants import Grip

ENDS_LATE = 2.0
"""A controller says so long after the end of a trajectory at the latest that the arm is there [s]."""
MOVES = 0.2
"""Speed of the joints together from which it shows how late the arm is [rad/s]."""
SLOWER = 0.5
"""Share of its fastest so far below which an arm that is braked shows it no more: what it is behind does
not become less as fast as its speed.
"""
TRUSTED = 0.3
"""Share of what a state says about that by which it is corrected."""
LONGEST_PERIOD = 0.05
"""No longer time between two states is one of an arm that tells them regularly [s]."""
ON_A_PATH = (Mode.MOVING, Mode.APPROACHING, Mode.EXECUTING, Mode.FOLLOWING_THROUGH)
"""Modes in which a path may be under way; in every other it is cancelled."""


class TrajectoryController(Protocol):
    """Moves the joints along a path. One path at a time: a new one takes the place of the last."""

    @property
    def has_taken(self) -> bool:
        """Whether it knows the newest path, so that the arm moves when that begins."""
        ...

    def follow(
        self, trajectory: JointTrajectory, start_ns: int, ended: Callable[[str], None]
    ) -> None:
        """Move along a trajectory.

        Parameters
        ----------
        trajectory
            Its first instant is where the arm rests now.
        start_ns
            Stamp of the arm's states at which it begins [ns].
        ended
            To be called when the arm has come to its end, with an empty text, or when it will not
            come there, with the reason.
        """
        ...

    def cancel(self) -> None:
        """Stop the arm where it is."""
        ...

    def tell_hand(self, grip: Grip) -> None:
        """Open or close the hand now."""
        ...


class NoController:
    """A `TrajectoryController` of an arm that is not there, for rehearsals."""

    has_taken = True

    def follow(
        self, trajectory: JointTrajectory, start_ns: int, ended: Callable[[str], None]
    ) -> None:
        """See `TrajectoryController`."""

    def cancel(self) -> None:
        """See `TrajectoryController`."""

    def tell_hand(self, grip: Grip) -> None:
        """See `TrajectoryController`."""


@dataclass(frozen=True)
class UnderWay:
    """A trajectory that the controller follows, and the stamp at which it begins [ns]."""

    trajectory: JointTrajectory
    start_ns: int


class TrajectoryCommander(Commander):
    """Sends motions to a controller of trajectories.

    Attribute: lag, by how much the arm is later than its trajectory, as its states tell [s].

    Parameters
    ----------
    settings, description, measured
        As of `Commander`.
    controller
        Of the arm.
    """

    def __init__(
        self,
        settings: CommanderSettings | None = None,
        description: ArmDescription | None = None,
        measured: Registration | None = None,
        controller: TrajectoryController | None = None,
    ):
        super().__init__(settings, description, measured)
        self._controller = controller or NoController()
        self._under_way: UnderWay | None = None
        self._planned: JointTrajectory | None = None  # until it is sent
        self._prepared: tuple[MotionPlan, JointTrajectory] | None = None
        self._fingers, self._told = Fingers((), False), Grip.UNSPECIFIED
        self.lag, self._usual_lag, self._period, self._stamp_ns = 0.0, 0.0, 0.0, 0
        self._peak = 0.0  # speed of the joints together so far, on the path under way [rad/s]

    def prepare(self, plan: MotionPlan) -> None:
        """See `Commander`: the path of a throw takes a second.

        Raises
        ------
        PlanRefused
            As of `execute`.
        """
        arm = registered(plan, self._measured).as_the_arm_has_it()
        check_plan(arm, self.settings, self._description)
        self._prepared = plan, planned_trajectory(arm, self.settings, self._description)

    def execute(self, plan: MotionPlan) -> None:
        """See `Commander`."""
        self._check_ready()
        if self._prepared is None or self._prepared[0] is not plan:
            self.prepare(plan)
        assert self._prepared is not None  # it was prepared just now
        arm = registered(plan, self._measured).as_the_arm_has_it()
        super().follow(PlanGuide(arm, self.settings.follow_time))
        self._planned, self._prepared = self._prepared[1], None

    def follow(self, guide: Guide) -> None:
        """See `Commander`: refused, for who is asked at every state has no path to send.

        Raises
        ------
        PlanRefused
            Always.
        """
        raise PlanRefused(
            f"a {guide.what} that is decided while the arm moves needs an arm that takes torques;"
            " this one takes trajectories (output of the commander): learn a model that plans"
        )

    def stop(self, reason: str, until_reset: bool = False) -> None:
        """See `Commander`; the controller brakes the arm."""
        self._cancel()
        self._planned = None
        super().stop(reason, until_reset)

    def step(self, state: ArmState) -> Command:
        """See `Commander`."""
        between = (state.stamp_ns - self._stamp_ns) * 1e-9
        if 0.0 < between <= LONGEST_PERIOD:
            self._period = between
        command = super().step(state)
        self._stamp_ns = state.stamp_ns
        if self.mode not in ON_A_PATH:
            self._cancel()
        elif self._under_way is not None:
            self._watch(state, self._under_way)
        return command

    # one method per mode

    def _begin(self, guide: Guide, state: ArmState) -> None:
        self._told = Grip.UNSPECIFIED
        super()._begin(guide, state)

    def _begin_way(self, mode: Mode, posture: np.ndarray, state: ArmState) -> None:
        super()._begin_way(mode, posture, state)
        self._send(way_to(self._start, posture, self._duration), state)

    def _on_the_way(self, state: ArmState) -> Command:
        if self._under_way is None:
            return super()._on_the_way(state)
        if self._is_overdue(state):
            self.stop(f"the arm has not come to its posture {ENDS_LATE:g} s after its time")
        return self._command(state, self._no_torque)

    def _executing(self, state: ArmState) -> Command:
        if self._planned is not None:
            self._fingers = Fingers(self._planned.events, self._planned.carries)
            self._send(self._planned, state)
            self._planned = None
        if self._under_way is None:  # it was refused, or is over
            if self.mode is Mode.EXECUTING:
                self._enter(Mode.FOLLOWING_THROUGH, state)
            return self._come_to_rest(state)
        time = self._on_the_path(state, self._under_way)
        now = self._look(state, max(time, 0.0))
        if now is None:
            return self._come_to_rest(state)
        nearest = time + 0.5 * self._period
        self._note_grip(self._fingers.at(nearest)[0], state)
        ahead = self._fingers.at(nearest + self.settings.trajectory.hand_lead)[0]
        if ahead not in (self._told, Grip.UNSPECIFIED):
            self._told = ahead
            self._controller.tell_hand(ahead)
        return self._command(state, self._no_torque, grip=self._grip)

    def _come_to_rest(self, state: ArmState) -> Command:
        follows = self.mode is Mode.FOLLOWING_THROUGH and self._under_way is not None
        if follows and not self._is_overdue(state):
            return self._command(state, self._no_torque, grip=self._grip)
        return super()._come_to_rest(state)

    _ANSWERS: Mapping[Mode, Callable] = {
        **Commander._ANSWERS,
        Mode.APPROACHING: _on_the_way,
        Mode.MOVING: _on_the_way,
        Mode.EXECUTING: _executing,
        Mode.FOLLOWING_THROUGH: _come_to_rest,
        Mode.STOPPING: _come_to_rest,
    }

    # helpers

    def _command(
        self,
        state: ArmState,
        torque: np.ndarray,
        wrench: np.ndarray | None = None,
        grip: Grip = Grip.UNSPECIFIED,
    ) -> Command:
        """As of `Commander`, but nothing pulls: the controller holds the arm."""
        return super()._command(state, np.zeros(joint_count()), None, grip)

    def _send(self, trajectory: JointTrajectory, state: ArmState) -> None:
        """The controller follows a trajectory, from so soon on that the hand is told at the stamp of
        a state: states may come 8 ms after one another, in which a ball that is thrown goes 3 cm.
        """
        told = trajectory.events[0].time if trajectory.events else 0.0
        lead = self.settings.trajectory.trajectory_lead + told + self.lag
        if self._period:
            lead = np.ceil(lead / self._period) * self._period
        start_ns = state.stamp_ns + round(1e9 * (lead - told - self.lag))
        self._under_way, self._peak = UnderWay(trajectory, start_ns), 0.0
        self._controller.follow(trajectory, start_ns, partial(self._ended, trajectory))

    def _ended(self, trajectory: JointTrajectory, error: str) -> None:
        """The controller is done with a trajectory, or gave it up."""
        if self._under_way is None or self._under_way.trajectory is not trajectory:
            return
        self._under_way = None
        if not error:
            self._usual_lag = self.lag
        else:
            self.lag = self._usual_lag
            self.stop(f"the arm's controller gave the motion up: {error}")

    def _cancel(self) -> None:
        if self._under_way is not None:
            self._under_way, self.lag = None, self._usual_lag
            self._controller.cancel()

    def _on_the_path(self, state: ArmState, under_way: UnderWay) -> float:
        """Time on its path at which the arm is [s]."""
        return (state.stamp_ns - under_way.start_ns) * 1e-9 - self.lag

    def _is_overdue(self, state: ArmState) -> bool:
        """Whether the controller should have said long ago that the arm is there."""
        way = self._under_way
        return way is not None and (
            self._on_the_path(state, way) > way.trajectory.duration + ENDS_LATE
        )

    def _watch(self, state: ArmState, under_way: UnderWay) -> None:
        """How late the arm is, and whether it leaves its path."""
        limits, time = self.settings.trajectory, self._on_the_path(state, under_way)
        if state.stamp_ns > under_way.start_ns and not self._controller.has_taken:
            self.stop(
                "the arm's controller has not answered before the motion begins: is it active? Else"
                f" raise trajectory_lead, which is {limits.trajectory_lead:g} s"
            )
            return
        expected, speed = under_way.trajectory.at(time)
        off = expected - state.position
        along = float(np.linalg.norm(speed))
        self._peak = max(self._peak, along)
        shows = along > max(MOVES, SLOWER * self._peak)
        if shows:
            self.lag += TRUSTED * float(off @ speed) / along**2
        j = int(np.abs(off).argmax())
        if abs(off[j]) > limits.trajectory_tolerance:
            self.stop(
                f"{self._description.joints[j].name} is {abs(off[j]):.2f} rad from its trajectory,"
                f" farther than {limits.trajectory_tolerance:g} rad: does something hold the arm,"
                " or does its controller run?"
            )
        elif shows and self.lag > limits.longest_lag:
            self.stop(
                f"the arm is {self.lag:.2f} s late on its trajectory, later than"
                f" {limits.longest_lag:g} s: is the speed of its pendant at 100 %?"
            )
