"""The commander: asks the learner for a plan, brings the arm to its start, carries it out, and
reports what the cameras saw of it.

The control step runs in the callback of /joint_states and answers every state once, with its
stamp; there is no timer in its path.
"""

import time
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Execute
from dart_skill_msgs.msg import WamCommand
from dart_skill_msgs.srv import MoveArm
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import CancelResponse, GoalResponse
from std_srvs.srv import SetBool, Trigger

from dart_skill.arm import (
    ArmState,
    Commander,
    CommanderSettings,
    Grip,
    Mode,
    MotionPlan,
    PlanRefused,
    load_registration,
    wam_description,
)
from dart_skill.recording import HAND
from dart_skill.skills.execution import ReactiveGuide
from dart_skill.skills.observation import ARRIVAL_NS
from dart_skill_nodes.arm.arm_watch import QUIET, ArmWatch
from dart_skill_nodes.arm.goal import GoalUnderWay, Plans, Withdrawn
from dart_skill_nodes.client.failures import CallFailed
from dart_skill_nodes.client.service_calls import Judge, ServiceCalls
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.arm_time import FreezeDetector
from dart_skill_nodes.comms.commands import CommandWriter, new_sender
from dart_skill_nodes.comms.coroutines import CoroutineActionServer, finish, pause
from dart_skill_nodes.comms.joint_states import StateReader, hear_joint_states
from dart_skill_nodes.comms.names import COMMANDS, pose_topic
from dart_skill_nodes.comms.presence import (
    LOOK,
    servers,
    subscribers,
)
from dart_skill_nodes.comms.qos import COMPLETE, LATCHED, WALL
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.comms.seen_in_step import SeenInStep, Sighting
from dart_skill_nodes.process.node_base import (
    ERROR,
    OK,
    WARN,
    Diagnostics,
    Parameter,
    declare,
    declare_bodies,
    run,
    skill_of,
)
from dart_skill_nodes.process.parameters import LIMITS

TABLE = [
    Parameter("frame_id", "frame of targets, plans and wrenches"),
    Parameter(
        "skill", "that it carries out: what its hand may hold, and whose bodies must be tracked"
    ),
    Parameter(
        "tracking", "what keeps the arm on the motion that (7.19) predicts: joints, hand or none"
    ),
    Parameter(
        "tracking_stiffness",
        "pull towards the predicted motion, per unit mass [1/s^2]",
        0.0,
        10_000.0,
    ),
    Parameter("tracking_damping", "its damping [1/s]", 0.0, 400.0),
    Parameter("tracking_stiffness_rotation", "the same for orientation [1/s^2]", 0.0, 10_000.0),
    Parameter("tracking_damping_rotation", "its damping [1/s]", 0.0, 400.0),
    Parameter("friction_compensation", "share of the identified joint friction", 0.0, 1.0),
    Parameter(
        "approach_speed", "fastest joint on the way to the start of a throw [rad/s]", 0.05, 2.0
    ),
    Parameter("settle_speed", "the arm rests below this joint speed [rad/s]", 0.001, 0.5),
    Parameter("settle_time", "rest before a throw [s]", 0.0, 2.0),
    Parameter("settle_limit", "throw even if the arm does not rest for so long [s]", 0.1, 10.0),
    Parameter(
        "farthest_error", "distance from the plan at which a throw is stopped [m]", 0.01, 1.0
    ),
    Parameter("longest_gap", "between two states of the arm [s]", 0.004, 5.0),
    Parameter("follow_time", "the hand stays on the plan so long after the release [s]", 0.0, 1.0),
    Parameter(
        "watch_time", "the ball is watched so long after the hand was told to open [s]", 0.3, 5.0
    ),
    Parameter(
        "registration_file",
        "cameras and arm as `dart-skill check arm --write` measured them; empty: plans are"
        " believed",
    ),
    Parameter("plan_timeout", "for the learner's answer [s, wall clock]", 0.1, 120.0),
    Parameter(
        "states_timeout",
        "a motion ends when a real arm's states are silent for longer [s, wall clock]",
        0.1,
        60.0,
    ),
    *LIMITS,
]
FEEDBACK_NS = 50_000_000

STATE_PATIENCE = 4.0
"""For the state of the arm that a goal's stamp names [s, wall clock]."""
FINDS = 3.0
"""For what a throw needs to be found [s, wall clock]."""
STOPPED = "stopped by ~/stop"


NOT_FOR_AN_ARM = (
    "tracking is 'hand', which makes an arm with motors and cables oscillate, and no simulator"
    " runs: start the commander with tracking:=joints and friction_compensation:=1.0, as the"
    " layout hardware does"
)


class CommanderNode(GuardedNode):
    """Action /execute, the command topic, and services that free, hold and stop the arm."""

    def __init__(self):
        super().__init__("commander")
        self.p = declare(self, "commander.yaml", TABLE)
        measured = (
            load_registration(self.p["registration_file"]).registration
            if self.p["registration_file"]
            else None
        )
        self._skill = skill_of(self)
        name_of = declare_bodies(self, (HAND, *self._skill.bodies))
        load = self._skill.loaded(wam_description())
        self._commander = Commander(CommanderSettings.from_parameters(self.p), load, measured)
        self._state: ArmState | None = None
        self._reader, self._writer, self._written = (
            StateReader(),
            CommandWriter(new_sender(), self.p["frame_id"]),
            b"",
        )
        self._fault = self._rivals = ""  # the latter: for which the arm was stopped
        self._goal: GoalUnderWay | None = None
        self._reacting: ReactiveGuide | None = None  # is told where the bodies are
        self._freezes = FreezeDetector()
        self._arm_fault = ""  # why the arm's own safety module has stopped it
        self._command = self.create_publisher(WamCommand, COMMANDS, COMPLETE)
        self._calls = ServiceCalls(self)
        self._judge = Judge(self, self._calls)
        self._plans = Plans(self, self._calls, self._commander, self._skill, self.p)
        self._seen = (
            SeenInStep(self, name_of, self.p["frame_id"], self._answer)
            if self._skill.reacts
            else None
        )
        self._states = hear_joint_states(self, self._on_state, raw=True)
        self._arm = ArmWatch(self, self._states, pose_topic(name_of[self._skill.moves]))
        self.create_subscription(DiagnosticStatus, "wam/safety", self._on_safety, LATCHED)
        self.create_service(SetBool, "~/release_arm", self._on_release_arm)
        self._stops = self.create_publisher(Time, "~/stopped", 10)
        self.create_service(MoveArm, "~/move_to", self._on_move_to)
        self.create_service(Trigger, "~/stop", self._on_stop)
        self.create_service(Trigger, "~/reset", self._on_reset)
        accept = {"goal_callback": self._on_goal, "cancel_callback": self._on_cancel}
        self._action = CoroutineActionServer(
            self, Execute, "execute", self._carry_out, self._finish, **accept
        )
        self._diagnostics = Diagnostics(self, self._describe)
        self.create_timer(LOOK, self._watch, clock=WALL)

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
        """Answer a state; sightings: what a motion that reacts has been told meanwhile."""
        try:
            if self._reacting is not None:
                for one in sightings:
                    self._reacting.see(*one)
            if self._state is None or state.stamp_ns != self._state.stamp_ns:
                command = self._commander.step(state)
                self._written = self._writer.write(command)
                self._arm.time.goes_on()
            self._state, self._fault = state, ""
        except ValueError as error:
            self._fault = str(error)
            raise
        self._command.publish(self._written)
        if self._goal is not None and self._goal.armed:
            self._follow_goal(self._goal, state)

    def _follow_goal(self, goal: GoalUnderWay, state: ArmState) -> None:
        """What a throw under way needs besides the control step: feedback, and its end."""
        goal.newest_ns = state.stamp_ns
        if state.stamp_ns - goal.fed_ns >= FEEDBACK_NS:
            goal.fed_ns = state.stamp_ns
            executing = self._commander.executing
            goal.feed(self._commander.mode.value if executing else "watching", self._commander)
            self._plans.show_attractor(state.stamp_ns)
        # who holds the world at the result finds an arm that can be reset
        rests = self._commander.mode != Mode.STOPPING
        if goal.ended_ns is None and not self._commander.executing and rests:
            opened = self._commander.opened_ns
            watch = (
                0
                if opened is None and self._commander.message
                else round(self.p["watch_time"] * 1e9)
            )
            goal.ended_ns = max(
                state.stamp_ns, (opened or (state.stamp_ns if watch else 0)) + watch
            )
        if goal.ended_ns is not None and state.stamp_ns >= goal.ended_ns:
            goal.over.keep()

    # the action

    def _on_goal(self, goal) -> GoalResponse:
        if self._goal is not None or self._commander.executing:
            self.get_logger().warning("a goal is refused: another one is under way")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_cancel(self, _) -> CancelResponse:
        self._withdraw("cancelled")
        return CancelResponse.ACCEPT

    def _withdraw(self, reason: str) -> None:
        """The goal under way moves the arm no more: a throw is stopped, and one that is being
        planned does not begin.
        """
        if self._goal is not None and not self._goal.withdrawn:
            self._goal.withdrawn = reason
        if self._commander.executing:
            self._commander.stop(reason)

    async def _carry_out(self, goal_handle) -> Execute.Result:
        client = subscribers(self, "execute/_action/feedback")
        self._goal = GoalUnderWay(goal_handle, client, servers(self, self._plans.service_name))
        unseen = conversions.unseen_outcome_msg(
            goal_handle.request.situation, self._skill.name, self.p["frame_id"]
        )
        result = Execute.Result(code=Execute.Goal.OUTCOME_REFUSED, outcome=unseen)
        try:
            self._goal.feed("planning", self._commander)
            plan = await self._plan(goal_handle.request, result)
            if plan is not None:
                await self._execute(plan, result)
        except (PlanRefused, ValueError, CallFailed) as error:
            waits = self._arm.time.held if self._commander.mode == Mode.STOPPING else ""
            result.message = "; ".join(filter(None, (str(error), waits)))
        except Withdrawn as reason:
            result.code, result.message = Execute.Goal.OUTCOME_STOPPED, str(reason)
        finally:
            self._goal = None
        return result

    async def _plan(self, goal, result) -> MotionPlan | ReactiveGuide | None:
        if goal.header.frame_id not in ("", self.p["frame_id"]):
            result.message = (
                f"the situation is in frame '{goal.header.frame_id}', not '{self.p['frame_id']}'"
            )
            return None
        until = time.monotonic() + FINDS  # a commander that was just started finds it by then
        while (
            (missing := self._missing()) and time.monotonic() < until and not self._goal.withdrawn
        ):
            await pause(self, LOOK)
        if missing:
            result.message = missing
            return None
        self._commander.check_free_to_move()
        return await self._plans.ask(goal, result)

    def _missing(self) -> str:
        """What a trial needs and is not there; empty if nothing."""
        if self._state is None:
            named, name = self._states.of_the_arm.others, self._arm.states_name
            strange = f"{name} {named}" if named else ""
            return (
                self._fault or strange or f"no {name} yet: is the arm, or wam_simulator, running?"
            )
        if self.p["tracking"] == "hand" and not self._arm.is_simulated:
            return NOT_FOR_AN_ARM
        if self._arm_fault and not (self._arm.rivals or self._arm.strangers):
            return (
                f"the arm's safety module has stopped it ({self._arm_fault}): look at the arm, and"
                " reset it"
            )
        return self._arm.missing(self._skill.words.outcome)

    async def _execute(self, plan: MotionPlan | ReactiveGuide, result) -> None:
        goal = self._goal
        await self._state_of_goal(conversions.stamp_ns(goal.handle.request.header.stamp))
        if goal.withdrawn:
            raise Withdrawn(goal.withdrawn)
        begun_ns = goal.newest_ns = self._state.stamp_ns
        if isinstance(plan, MotionPlan):
            self._commander.execute(plan)
        else:
            self._commander.follow(plan)
            self._reacting = plan
            self._seen.begin(begun_ns)
        goal.armed = True
        goal.feed("armed", self._commander)
        await goal.over
        if self._reacting is not None:
            self._reacting = None
            self._seen.end()
        result.duration = conversions.duration_msg((goal.newest_ns - begun_ns) * 1e-9)
        opened_ns = self._commander.opened_ns
        opens = any(event.name == conversions.WORDS[Grip.OPEN] for event in result.plan.events)
        if self._commander.message or (opens and opened_ns is None):
            result.code = Execute.Goal.OUTCOME_STOPPED
            result.message = (
                self._commander.message
                or f"the {self._skill.name} ended before the hand was told to open"
            )
        else:
            result.code, result.message = Execute.Goal.OUTCOME_EXECUTED, "executed"
        if opened_ns is not None or not opens:
            watched = goal.ended_ns is not None and not goal.withdrawn
            await self._let_judge(
                begun_ns,
                opened_ns or goal.newest_ns,
                goal.ended_ns - ARRIVAL_NS if watched else 0,
                result,
            )

    async def _let_judge(self, begun_ns: int, told_ns: int, until_ns: int, result) -> None:
        """What the cameras saw of the movement; one that is not judged has been made all the same.
        until_ns: 0: what has come.
        """
        try:
            result.outcome = await self._judge.outcome(
                result.plan.situation, told_ns, until_ns, begun_ns
            )
            if not result.outcome.seen and self._arm.unseen:
                result.message += f"; not seen: {self._arm.unseen}"
        except CallFailed as failure:
            conversions.set_stamp(result.outcome.header.stamp, told_ns)
            result.message += f"; nobody judged it: {failure}"

    async def _state_of_goal(self, stamp_ns: int) -> None:
        """The states that the goal knows of are answered before it is obeyed; ValueError if the
        one that it names does not come.
        """
        until = time.monotonic() + STATE_PATIENCE
        while not self._goal.withdrawn and (
            self._state is None or self._state.stamp_ns < stamp_ns
        ):
            if time.monotonic() > until:
                raise ValueError(
                    f"the goal is stamped {stamp_ns} ns, but the arm's states have come up to"
                    f" {self._state.stamp_ns} ns only"
                )
            await pause(self, 0.01)

    def _finish(self, goal_handle, result) -> None:
        if result.code != Execute.Goal.OUTCOME_EXECUTED:
            self.get_logger().error(f"no {self._skill.name}: {result.message}")
        finish(goal_handle, result.code == Execute.Goal.OUTCOME_EXECUTED)

    # the rest

    def _watch(self) -> None:
        """See who is there, and end what must not go on without them."""
        self._arm.look()
        self._notice_a_gap()
        self._stop_for_rivals()
        moves = self._commander.executing or self._commander.moving
        if self._state is not None and (
            silent := self._arm.states_ended(moves, self.p["states_timeout"])
        ):
            self._stop_for(silent)
            self._state, self._fault = None, silent
            if self._goal is not None:
                self._goal.over.keep()  # nothing is known of the arm any more
        if self._commander.mode == Mode.FREE and (gone := self._arm.guide_gone):
            self._commander.stop(gone)
        if self._goal is not None:
            self._watch_goal(self._goal)

    def _stop_for(self, reason: str) -> None:
        """Withdraw the goal and stop the arm, and say why."""
        self.get_logger().error(reason)
        self._withdraw(reason)
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
        frozen = self._freezes.frozen()
        if self._goal is not None and frozen:
            self._withdraw(f"the commander was held up for {frozen:.1f} s")

    def _watch_goal(self, goal: GoalUnderWay) -> None:
        if goal.client.gone:
            self._withdraw(f"{goal.client} has gone, who asked for the {self._skill.name}")
        if goal.armed and self._commander.executing and goal.learner.gone:
            self._withdraw(
                f"{goal.learner} has gone during the {self._skill.name}: start it again"
            )
        if goal.armed and not goal.waits and self._arm.time.held:
            goal.waits = True
            goal.feed("held", self._commander)
            self.get_logger().warning(f"the {self._skill.name} waits: {self._arm.time.held}")
        if goal.armed and not goal.withdrawn and self._arm.time.stalled:
            self._withdraw(self._arm.time.stalled)
        if goal.armed and goal.withdrawn and self._arm.time.silence > QUIET:
            goal.over.keep()  # no state will tell when the arm rests: time stands still

    def _on_safety(self, message: DiagnosticStatus) -> None:
        """What the arm's own safety module says; it needs no answer: it has stopped the arm
        already.
        """
        self._arm_fault = message.message if message.level == ERROR else ""
        if self._arm_fault:
            self._stop_for(f"the arm's safety module stopped it: {self._arm_fault}")

    def _on_release_arm(self, request, response):
        try:
            if request.data and self._goal is not None:
                raise PlanRefused(
                    f"a {self._skill.name} is being planned or is under way: stop it before the"
                    " arm is released (~/stop)"
                )
            self._commander.release_arm(request.data)
            self._arm.release(request.data)
            response.success = True
        except PlanRefused as error:
            response.success, response.message = False, str(error)
        return response

    def _on_move_to(self, request, response):
        try:
            if self._state is None:
                raise PlanRefused(f"no {self._arm.states_name} yet: is the arm's driver running?")
            if self._goal is not None:
                raise PlanRefused(
                    f"a {self._skill.name} is being planned or is under way: wait for it or stop"
                    " it first"
                )
            response.duration = conversions.duration_msg(
                self._commander.move_to(request.posture, self._state)
            )
            response.success = True
        except PlanRefused as error:
            response.success, response.message = False, str(error)
        return response

    def _on_stop(self, request, response):
        self._withdraw(STOPPED)
        self._commander.stop(STOPPED, until_reset=True)
        # by what would move it next
        self._stops.publish(
            conversions.time_msg(0 if self._state is None else self._state.stamp_ns)
        )
        response.success = True
        return response

    def _on_reset(self, request, response):
        try:
            if self._goal is not None:
                raise PlanRefused(
                    f"the {self._skill.name} that was stopped has not ended yet: call"
                    " /commander/reset again"
                )
            self._commander.reset()
            response.success = True
        except PlanRefused as error:
            response.success, response.message = False, str(error)
        return response

    def _describe(self):
        stopped = self._commander.stopped_by
        level = (
            ERROR
            if self._fault or self._arm.rivals
            else (WARN if self._state is None or stopped else OK)
        )
        mode = (
            f"no {self._arm.states_name} yet"
            if self._state is None
            else self._commander.mode.value
        )
        text = self._fault or self._arm.rivals or mode
        text += f", {stopped}: call /commander/reset" if stopped else ""
        if (near := self._commander.warning) and level == OK:
            level, text = WARN, f"{text}; {near}"
        newest_ns = 0 if self._state is None else self._state.stamp_ns
        return (
            level,
            text,
            {
                "mode": self._commander.mode.value,
                "last": self._commander.message,
                "newest_state_ns": newest_ns,
            },
        )


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill commander`."""
    run(lambda: [CommanderNode()], args)


if __name__ == "__main__":
    main()
