"""The commander: asks the learner for a plan, brings the arm to its start, throws, and reports what the cameras saw of it.

The control step runs in the callback of /joint_states and answers every state once, with its stamp; there is no timer in its path.
"""

import time
from dataclasses import dataclass, field

import numpy as np
from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Throw
from dart_skill_msgs.msg import WamCommand
from dart_skill_msgs.srv import MoveArm, PlanThrow
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.action import CancelResponse, GoalResponse
from rclpy.node import Node
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from dart_skill.robot import ArmState, Commander, CommanderSettings, Mode, PlanRefused, load_registration
from dart_skill.skill.observe import ARRIVAL_NS
from dart_skill_nodes.client.failures import CallFailed
from dart_skill_nodes.client.server_probe import ServerProbe
from dart_skill_nodes.client.service_calls import Judge, ServiceCalls
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import CoroutineActionServer, Promise, answer, finish, pause
from dart_skill_nodes.comms.joint_states import hear_joint_states
from dart_skill_nodes.comms.qos import COMPLETE, FRAMES, LATCHED, WALL
from dart_skill_nodes.process.node_base import ERROR, OK, WARN, Diagnostics, Parameter, declare, run

TABLE = [
    Parameter("frame_id", "frame of targets, plans and wrenches"),
    Parameter("tracking", "what keeps the arm on the motion that (7.19) predicts: joints, hand or none"),
    Parameter("tracking_stiffness", "pull towards the predicted motion, per unit mass [1/s^2]", 0.0, 10_000.0),
    Parameter("tracking_damping", "its damping [1/s]", 0.0, 400.0),
    Parameter("tracking_stiffness_rotation", "the same for orientation [1/s^2]", 0.0, 10_000.0),
    Parameter("tracking_damping_rotation", "its damping [1/s]", 0.0, 400.0),
    Parameter("friction_compensation", "share of the identified joint friction", 0.0, 1.0),
    Parameter("approach_speed", "fastest joint on the way to the start of a throw [rad/s]", 0.05, 2.0),
    Parameter("settle_speed", "the arm rests below this joint speed [rad/s]", 0.001, 0.5),
    Parameter("settle_time", "rest before a throw [s]", 0.0, 2.0),
    Parameter("settle_limit", "throw even if the arm does not rest for so long [s]", 0.1, 10.0),
    Parameter("strongest_force", "wrenches are cut there [N]", 1.0, 500.0),
    Parameter("strongest_moment", "wrenches are cut there [N m]", 1.0, 200.0),
    Parameter("fastest_hand", "plans and throws beyond it are refused and stopped [m/s]", 0.1, 8.0),
    Parameter("farthest_error", "distance from the plan at which a throw is stopped [m]", 0.01, 1.0),
    Parameter("longest_gap", "between two states of the arm [s]", 0.004, 5.0),
    Parameter("joint_margin", "to the end of a joint's range, at which a throw is stopped [rad]", 0.0, 0.5),
    Parameter("follow_time", "the hand stays on the plan so long after the release [s]", 0.0, 1.0),
    Parameter("watch_time", "the ball is watched so long after the hand was told to open [s]", 0.3, 5.0),
    Parameter("registration_file", "cameras and arm as `dart-skill check arm --write` measured them; empty: plans are believed"),
    Parameter("plan_timeout", "for the learner's answer [s, wall clock]", 0.1, 120.0),
    Parameter("learner_timeout", "a throw is stopped when the learner is silent for longer [s, wall clock]", 0.2, 60.0),
]
FEEDBACK_NS = 50_000_000

WATCH = 0.1
"""What a throw needs besides the arm is looked at so often [s, wall clock]."""
STATE_PATIENCE = 5.0
"""For the state of the arm that a goal's stamp names [s, wall clock]."""


class Withdrawn(Exception):
    """The goal was cancelled, or the arm stopped, before it moved; the message says by whom."""


@dataclass
class GoalUnderWay:
    """A goal of /throw, from its acceptance to its result.

    withdrawn: why it must not move the arm any more, empty if it may. armed: the commander has its plan, and the arm may move for it.
    ended_ns: the stamp at which the throw and the watching of the ball end, None before that is known. silence: of the learner
    [s, wall clock].
    """

    handle: object
    withdrawn: str = ""
    armed: bool = False
    over: Promise = field(default_factory=Promise)
    ended_ns: int | None = None
    fed_ns: int = 0
    silence: float = 0.0


SIMULATED = "/simulation/state"
"""Only a simulator publishes it."""
NOT_FOR_AN_ARM = (
    "tracking is 'hand', which an arm with motors and cables does not bear, and no simulator runs: start the commander with "
    "tracking:=joints and friction_compensation:=1.0, as the layout hardware does"
)


class CommanderNode(Node):
    """Action /throw, the command topic, and services that free, hold and stop the arm."""

    def __init__(self):
        super().__init__("commander")
        self.p = declare(self, "commander.yaml", TABLE)
        measured = load_registration(self.p["registration_file"]).registration if self.p["registration_file"] else None
        self._commander = Commander(CommanderSettings.from_parameters(self.p), measured=measured)
        self._state: ArmState | None = None
        self._message = WamCommand()
        self._message.header.frame_id = self.p["frame_id"]
        self._fault = ""
        self._goal: GoalUnderWay | None = None
        self._watched = time.monotonic()  # when the learner's silence was last looked at [s, wall clock]
        self._command = self.create_publisher(WamCommand, "/wam/command", COMPLETE)
        self._attractor = self.create_publisher(PoseStamped, "~/attractor", FRAMES)
        self._plan = self.create_publisher(Path, "~/plan", LATCHED)
        calls = ServiceCalls(self)
        self._judge = Judge(self, calls)
        self._states = hear_joint_states(self, self._on_state)
        self.create_subscription(Time, "/skill_learner/heartbeat", self._on_heartbeat, 10)
        self._planner = self.create_client(PlanThrow, "/skill_learner/plan_throw")
        self._planner_link = ServerProbe(self, self._planner.srv_name, self._planner.service_is_ready)
        self.create_service(SetBool, "~/release_arm", self._on_release_arm)
        self._stops = self.create_publisher(Time, "~/stopped", 10)
        self.create_service(MoveArm, "~/move_to", self._on_move_to)
        self.create_service(Trigger, "~/stop", self._on_stop)
        accept = {"goal_callback": self._on_goal, "cancel_callback": self._on_cancel}
        self._action = CoroutineActionServer(self, Throw, "/throw", self._throw, self._finish, **accept)
        self._diagnostics = Diagnostics(self, self._describe)
        self.create_timer(WATCH, self._watch, clock=WALL)

    # the control step

    def _on_state(self, message: JointState) -> None:
        try:
            state = conversions.arm_state(message)
            if self._state is None or state.stamp_ns != self._state.stamp_ns:
                command = self._commander.step(state)
                conversions.fill_command(self._message, command)
            self._state, self._fault = state, ""
        except ValueError as error:
            self._complain(str(error))
            return
        self._command.publish(self._message)
        if self._goal is not None and self._goal.armed:
            self._follow_goal(self._goal, state)

    def _follow_goal(self, goal: GoalUnderWay, state: ArmState) -> None:
        """What a throw under way needs besides the control step: feedback, and its end."""
        if state.stamp_ns - goal.fed_ns >= FEEDBACK_NS:
            goal.fed_ns = state.stamp_ns
            self._feed(self._commander.mode.value if self._commander.throwing else "watching")
            self._publish_attractor(state)
        if goal.ended_ns is None and not self._commander.throwing:
            opened = self._commander.opened_ns
            watch = 0 if opened is None else round(self.p["watch_time"] * 1e9)
            goal.ended_ns = max(state.stamp_ns, (opened or 0) + watch)
        if goal.ended_ns is not None and state.stamp_ns >= goal.ended_ns:
            goal.over.keep()

    # the action

    def _on_goal(self, goal) -> GoalResponse:
        if self._goal is not None or self._commander.throwing:
            self.get_logger().warning("a throw is refused: another one is under way")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_cancel(self, _) -> CancelResponse:
        self._withdraw("cancelled")
        return CancelResponse.ACCEPT

    def _withdraw(self, reason: str) -> None:
        """The goal under way moves the arm no more: a throw is stopped, and one that is being planned does not begin."""
        if self._goal is not None and not self._goal.withdrawn:
            self._goal.withdrawn = reason
        if self._commander.throwing:
            self._commander.stop(reason)

    async def _throw(self, goal_handle) -> Throw.Result:
        self._goal = GoalUnderWay(goal_handle)
        target = conversions.vector(goal_handle.request.target)
        result = Throw.Result(code=Throw.Goal.OUTCOME_REFUSED, outcome=conversions.unseen_outcome_msg(target, self.p["frame_id"], 0))
        try:
            self._feed("planning")
            plan = await self._ask_for_plan(goal_handle.request, result)
            if plan is not None:
                await self._execute(plan, result)
        except (PlanRefused, ValueError) as error:
            result.message = str(error)
        except Withdrawn as reason:
            result.code, result.message = Throw.Goal.OUTCOME_STOPPED, str(reason)
        finally:
            self._goal = None
        return result

    async def _ask_for_plan(self, goal, result):
        if goal.header.frame_id not in ("", self.p["frame_id"]):
            result.message = f"the target is in frame '{goal.header.frame_id}', not '{self.p['frame_id']}'"
            return None
        if self._state is None:
            result.message = "no /joint_states yet: is the arm, or wam_simulator, running?"
            return None
        if self.p["tracking"] == "hand" and not self.count_publishers(SIMULATED):
            result.message = NOT_FOR_AN_ARM
            return None
        if not await self._planner_is_there():
            result.message = "nobody serves /skill_learner/plan_throw: start skill_learner"
            return None
        request = PlanThrow.Request(target=goal.target)
        request.header.frame_id = self.p["frame_id"]
        response = await answer(self, self._planner, request, self.p["plan_timeout"])
        if response is None:
            result.message = f"the learner gave no plan within {self.p['plan_timeout']} s"
            return None
        if not response.success:
            result.message = response.message
            return None
        result.plan = response.plan
        self._plan.publish(conversions.path_msg(response.plan))
        return conversions.plan(response.plan)

    async def _planner_is_there(self) -> bool:
        """Whether somebody plans, given the time in which a graph that has just been started finds itself."""
        self._planner_link.renew()
        for _ in range(500):
            if self._planner_link.up():
                return True
            await pause(self, 0.01)
        return False

    async def _execute(self, plan, result) -> None:
        goal = self._goal
        await self._state_of_goal(conversions.stamp_ns(goal.handle.request.header.stamp))
        if goal.withdrawn:
            raise Withdrawn(goal.withdrawn)
        self._commander.throw(plan)
        begun_ns = self._state.stamp_ns
        goal.armed = True
        self._feed("armed")
        await goal.over
        result.duration = conversions.duration_msg((self._state.stamp_ns - begun_ns) * 1e-9)
        opened_ns = self._commander.opened_ns
        if self._commander.message or opened_ns is None:
            result.code = Throw.Goal.OUTCOME_STOPPED
            result.message = self._commander.message or "the throw ended before the hand was told to open"
        else:
            result.code, result.message = Throw.Goal.OUTCOME_THROWN, "thrown"
        if opened_ns is not None:
            await self._let_judge(plan.target, opened_ns, goal.ended_ns - ARRIVAL_NS, result)

    async def _let_judge(self, target: np.ndarray, opened_ns: int, until_ns: int, result) -> None:
        """What the cameras saw of the throw; a throw that nobody judges has been made all the same."""
        try:
            result.outcome = await self._judge.outcome(target, opened_ns, until_ns)
        except CallFailed as failure:
            conversions.set_stamp(result.outcome.header.stamp, opened_ns)
            result.message += f"; nobody judged it: {failure}"

    async def _state_of_goal(self, stamp_ns: int) -> None:
        """The states that the goal knows of are answered before it is obeyed; ValueError if the one that it names does not come."""
        until = time.monotonic() + STATE_PATIENCE
        while self._state.stamp_ns < stamp_ns and not self._goal.withdrawn:
            if time.monotonic() > until:
                raise ValueError(f"the goal is stamped {stamp_ns} ns, but the arm's states have come up to {self._state.stamp_ns} ns only")
            await pause(self, 0.01)

    def _finish(self, goal_handle, result) -> None:
        if result.code != Throw.Goal.OUTCOME_THROWN:
            self.get_logger().error(f"no throw: {result.message}")
        finish(goal_handle, result.code == Throw.Goal.OUTCOME_THROWN)

    def _feed(self, phase: str) -> None:
        error = self._commander.tracking_error if np.isfinite(self._commander.tracking_error) else 0.0
        seconds = float(self._commander.time) if np.isfinite(self._commander.time) else 0.0
        self._goal.handle.publish_feedback(Throw.Feedback(phase=phase, time=seconds, tracking_error=float(error)))

    def _publish_attractor(self, state: ArmState) -> None:
        if self._commander.mode != Mode.THROWING or self._commander.reference is None:
            return
        message, reference = PoseStamped(), self._commander.reference
        message.header.frame_id = self.p["frame_id"]
        conversions.set_stamp(message.header.stamp, state.stamp_ns)
        orientation = Rotation.from_matrix(reference.attractor_rotation).as_quat()
        conversions.set_pose(message.pose, reference.attractor_position, orientation)
        self._attractor.publish(message)

    # the rest

    def _on_heartbeat(self, _) -> None:
        if self._goal is not None:
            self._goal.silence = 0.0

    def _watch(self) -> None:
        """A throw needs its learner alive, and the states of the arm: a node that died stops the arm."""
        gap, self._watched = time.monotonic() - self._watched, time.monotonic()
        goal = self._goal
        if goal is None or not goal.armed or not self._commander.throwing:
            return
        goal.silence += min(gap, 2 * WATCH)  # who was held up itself has heard nobody
        if goal.silence > self.p["learner_timeout"]:
            self._commander.stop(f"skill_learner has been silent for {goal.silence:.1f} s: is it still running? The arm was stopped")

    def _on_release_arm(self, request, response):
        try:
            self._commander.release_arm(request.data)
            response.success = True
        except PlanRefused as error:
            response.success, response.message = False, str(error)
        return response

    def _on_move_to(self, request, response):
        try:
            if self._state is None:
                raise PlanRefused("no /joint_states yet: is the arm's driver running?")
            if self._goal is not None:
                raise PlanRefused("a throw is being planned or is under way: wait for it or stop it first")
            response.duration = conversions.duration_msg(self._commander.move_to(request.posture, self._state))
            response.success = True
        except PlanRefused as error:
            response.success, response.message = False, str(error)
        return response

    def _on_stop(self, request, response):
        self._withdraw("stopped by ~/stop")
        self._commander.stop("stopped by ~/stop")
        self._stops.publish(conversions.time_msg(0 if self._state is None else self._state.stamp_ns))  # whoever would move it next
        response.success = True
        return response

    def _complain(self, text: str) -> None:
        if text != self._fault:
            self.get_logger().error(text)
        self._fault = text

    def _describe(self):
        level = ERROR if self._fault else (WARN if self._state is None else OK)
        text = self._fault or ("no /joint_states yet" if self._state is None else self._commander.mode.value)
        return level, text, {"mode": self._commander.mode.value, "last": self._commander.message}


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill commander`."""
    run(lambda: [CommanderNode()], args)


if __name__ == "__main__":
    main()
