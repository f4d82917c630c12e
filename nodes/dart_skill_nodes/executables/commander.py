"""The commander: asks the learner for a plan, brings the arm to its start, carries it out, and
reports what the cameras saw of it.

The control step runs in the callback of /joint_states and answers every state once, with its
stamp; there is no timer in its path.
"""

from collections.abc import Sequence
from functools import partial

from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Execute
from dart_skill_msgs.msg import WamCommand
from dart_skill_msgs.srv import MoveArm
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import CancelResponse, GoalResponse
from std_srvs.srv import SetBool, Trigger

from dart_skill.arm import (
    ArmDescription,
    ArmState,
    Commander,
    CommanderSettings,
    Mode,
    PlanRefused,
    Registration,
    load_registration,
    the_arm,
)
from dart_skill.recording import HAND
from dart_skill_nodes.arm.arm_watch import NOT_FOR_AN_ARM, ArmWatch
from dart_skill_nodes.arm.execution import Execution
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.commands import CommandWriter, new_sender
from dart_skill_nodes.comms.coroutines import CoroutineActionServer, finish, say_why_it_ended
from dart_skill_nodes.comms.joint_states import StateReader, hear_joint_states
from dart_skill_nodes.comms.names import COMMANDS, pose_topic
from dart_skill_nodes.comms.qos import COMPLETE, LATCHED, WALL
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.comms.seen_in_step import SeenInStep, Sighting
from dart_skill_nodes.comms.this_machine import LOOK, FreezeDetector
from dart_skill_nodes.process.node_base import ERROR, OK, WARN, Diagnostics, run
from dart_skill_nodes.process.parameters import declare, declare_bodies, skill_of

STOPPED = "stopped by ~/stop"


class CommanderNode(GuardedNode):
    """Action /execute, the command topic, and services that free, hold and stop the arm."""

    def __init__(self):
        super().__init__("commander")
        self.p = declare(self, "commander")
        file = self.p["registration_file"]
        measured = load_registration(file).registration if file else None
        self._skill = skill_of(self)
        name_of = declare_bodies(self, (HAND, *self._skill.bodies))
        load = self._skill.loaded(the_arm())
        made, self._output = self._output_for(load, measured)
        self._commander = made() if self._output is None else made(controller=self._output)
        self._reader, self._written = StateReader(), b""
        self._writer = CommandWriter(new_sender(), self.p["frame_id"])
        self._fault = self._rivals = ""  # the latter: for which the arm was stopped
        self._freezes, self._arm_fault = FreezeDetector(), ""  # the latter: of its safety module
        self._command = self.create_publisher(WamCommand, COMMANDS, COMPLETE)
        watched, frame_id = self._skill.watched, self.p["frame_id"]
        self._seen = SeenInStep(self, name_of, frame_id, self._answer) if watched else None
        self._states = hear_joint_states(self, self._on_state, raw=True)
        self._arm = ArmWatch(self, self._states, pose_topic(name_of[self._skill.moves]))
        self.execution = Execution(
            self, self._commander, self._skill, self._arm, self._seen, self.p
        )
        self.create_subscription(DiagnosticStatus, "wam/safety", self._on_safety, LATCHED)
        self._stops = self.create_publisher(Time, "~/stopped", 10)
        self.create_service(SetBool, "~/release_arm", self._on_release_arm)
        self.create_service(MoveArm, "~/move_to", self._on_move_to)
        self.create_service(Trigger, "~/stop", self._on_stop)
        self.create_service(Trigger, "~/reset", self._on_reset)
        carry_out = partial(self.execution.carry_out, missing=self._missing)
        accept = {"goal_callback": self._on_goal, "cancel_callback": self._on_cancel}
        self._action = CoroutineActionServer(
            self, Execute, "execute", carry_out, self._finish, **accept
        )
        self._diagnostics = Diagnostics(self, self._describe)
        self.create_timer(LOOK, self._watch, clock=WALL)
        self.execution.rehearse(made(), load)

    def _output_for(self, load: ArmDescription, measured: Registration | None):
        """What makes commanders, and the controller of an arm that takes trajectories."""
        settings = CommanderSettings.from_parameters(self.p)
        if settings.output == "torque":
            return partial(Commander, settings, load, measured), None
        # these need parts of SciPy that no arm that takes torques waits for
        from dart_skill.arm import TrajectoryCommander
        from dart_skill_nodes.arm.trajectory_output import TrajectoryOutput

        return partial(TrajectoryCommander, settings, load, measured), TrajectoryOutput(
            self, self.p
        )

    # the control step

    def _on_state(self, data: bytes) -> None:
        self._notice_a_gap()
        if self._arm.rivals:
            return
        try:
            state = self._reader.read(data)
        except ValueError as error:
            self._fault = str(error)
            raise
        if self._arm.leaps(state):
            self._arm.look_for_rivals()
            self._stop_for_rivals()
            return
        if self._seen is not None and self._seen.goes_on:
            self._seen.offer(state.stamp_ns, state)
        else:
            self._answer(state)

    def _answer(self, state: ArmState, sightings: Sequence[Sighting] = ()) -> None:
        """Answer a state; sightings: what the cameras delivered meanwhile."""
        try:
            for one in sightings:
                self._commander.see(*one)
            newest = self.execution.state
            if newest is None or state.stamp_ns != newest.stamp_ns:
                self._written = self._writer.write(self._commander.step(state))
                self._arm.time.goes_on()
            self._fault = ""
        except ValueError as error:
            self._fault = str(error)
            raise
        self._command.publish(self._written)
        self.execution.follow(state)

    # the action

    def _on_goal(self, goal) -> GoalResponse:
        if self.execution.goal is not None or self._commander.executing:
            self.get_logger().warning("a goal is refused: another one is under way")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_cancel(self, _) -> CancelResponse:
        self.execution.withdraw("cancelled")
        return CancelResponse.ACCEPT

    def _missing(self) -> str:
        """What a trial needs and is not there; empty if nothing."""
        if self.execution.state is None:
            name, named = self._arm.states_name, self._states.of_the_arm.others
            said = self._fault or (f"{name} {named}" if named else "")
            return said or f"no {name} yet: is the arm, or wam_simulator, running?"
        if self._output is not None and (silent := self._output.missing):
            return silent
        takes_torques = self._output is None
        if takes_torques and self.p["tracking"] == "hand" and not self._arm.is_simulated:
            return NOT_FOR_AN_ARM
        return self._arm.missing(self._skill.words.outcome, self._arm_fault)

    def _finish(self, goal_handle, result) -> None:
        if result.code != Execute.Goal.OUTCOME_EXECUTED:
            say_why_it_ended(self, goal_handle, f"no {self._skill.name}: {result.message}")
        finish(goal_handle, result.code == Execute.Goal.OUTCOME_EXECUTED)

    # the rest

    def _watch(self) -> None:
        """See who is there, and end what must not go on without them."""
        self._arm.look()
        self._notice_a_gap()
        self._stop_for_rivals()
        moves = self._commander.executing or self._commander.moving
        if self.execution.state is not None and (
            silent := self._arm.states_ended(moves, self.p["states_timeout"])
        ):
            self._stop_for(silent)
            self._fault = silent
            self.execution.lose_states()
        if self._commander.mode == Mode.FREE and (gone := self._arm.guide_gone):
            self._commander.stop(gone)
        self.execution.watch()

    def _stop_for(self, reason: str) -> None:
        """Withdraw the goal and stop the arm, and say why."""
        self.get_logger().error(reason)
        self.execution.withdraw(reason)
        self._commander.stop(reason)

    def _stop_for_rivals(self) -> None:
        rivals = self._arm.rivals
        if rivals and rivals != self._rivals:
            self._stop_for(rivals)
        self._rivals = rivals

    def _notice_a_gap(self) -> None:
        """A commander that was frozen withdraws its goal. One whose timers wait, because states
        come as fast as they can, was not.
        """
        if frozen := self._freezes.frozen():
            self.execution.withdraw(f"the commander was held up for {frozen:.1f} s")

    def _on_safety(self, message: DiagnosticStatus) -> None:
        """What the arm's own safety module says; it needs no answer: it has stopped the arm
        already.
        """
        self._arm_fault = message.message if message.level == ERROR else ""
        if self._arm_fault:
            self._stop_for(f"the arm's safety module stopped it: {self._arm_fault}")

    def _check_idle(self, remedy: str) -> None:
        if self.execution.goal is not None:
            raise PlanRefused(f"a {self._skill.name} is being planned or is under way: {remedy}")

    def _on_release_arm(self, request, response):
        if request.data:
            self._check_idle("stop it before the arm is released (~/stop)")
        self._commander.release_arm(request.data)
        self._arm.release(request.data)

    def _on_move_to(self, request, response):
        if self.execution.state is None:
            raise PlanRefused(f"no {self._arm.states_name} yet: is the arm's driver running?")
        self._check_idle("wait for it or stop it first")
        seconds = self._commander.move_to(request.posture, self.execution.state)
        response.duration = conversions.duration_msg(seconds)

    def _on_stop(self, request, response):
        self.execution.withdraw(STOPPED)
        self._commander.stop(STOPPED, until_reset=True)
        # by what would move it next
        self._stops.publish(conversions.time_msg(self._newest_ns))

    @property
    def _newest_ns(self) -> int:
        """Stamp of the newest state; 0 without one."""
        return 0 if self.execution.state is None else self.execution.state.stamp_ns

    def _on_reset(self, request, response):
        if self.execution.goal is not None:
            raise PlanRefused(
                f"the {self._skill.name} that was stopped has not ended yet: call"
                " /commander/reset again"
            )
        self._commander.reset()

    def _describe(self):
        stopped, mode = self._commander.stopped_by, self._commander.mode.value
        silent = self.execution.state is None
        fault = self._fault or self._arm.rivals
        level = ERROR if fault else WARN if silent or stopped else OK
        text = fault or (f"no {self._arm.states_name} yet" if silent else mode)
        text += f", {stopped}: call /commander/reset" if stopped else ""
        if (near := self._commander.warning) and level == OK:
            level, text = WARN, f"{text}; {near}"
        values = {"mode": mode, "last": self._commander.message}
        return level, text, {**values, "newest_state_ns": self._newest_ns}


def _started() -> list[CommanderNode]:
    node = CommanderNode()
    node.get_logger().info("ready")  # the first line of a logger takes 0.2 s: before any motion
    return [node]


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill commander`."""
    run(_started, args)


if __name__ == "__main__":
    main()
