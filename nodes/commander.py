"""The commander: asks the learner for a plan, brings the arm to its start, throws, and reports what the cameras saw of it.

The control step runs in the callback of /joint_states and answers every state once, with its stamp; there is no timer in its path.
"""

import time

import numpy as np
from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Throw
from dart_skill_msgs.msg import WamCommand
from dart_skill_msgs.srv import PlanThrow
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.action import CancelResponse, GoalResponse
from rclpy.node import Node
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from dart_skill.robot.command import ArmState
from dart_skill.robot.commander import Commander, CommanderSettings, Mode, PlanRefused
from dart_skill.skill.cutting import ARRIVAL_NS
from dart_skill.skill.outcome import judge_flight
from dart_skill_nodes import conversions
from dart_skill_nodes.links import Link
from dart_skill_nodes.routines import Promise, RoutineServer, answer, finish, pause
from dart_skill_nodes.support import COMPLETE, ERROR, FRAMES, LATCHED, LOOP, OK, WALL, WARN, Diagnostics, Parameter, declare, run
from dart_skill_nodes.watching import BEFORE_NS, Watcher

TABLE = [
    Parameter("frame_id", "frame of targets, plans and wrenches"),
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
    Parameter("plan_timeout", "for the learner's answer [s, wall clock]", 0.1, 120.0),
    Parameter("learner_timeout", "a throw is stopped when the learner is silent for longer [s, wall clock]", 0.2, 60.0),
    Parameter("rim_radius", "of the basket [m]", 0.05, 1.0),
]
FEEDBACK_NS = 50_000_000

WATCH = 0.1
"""What a throw needs besides the arm is looked at so often [s, wall clock]."""


class CommanderNode(Node):
    """Action /throw, the command topic, and services that free, hold and stop the arm."""

    def __init__(self):
        super().__init__("commander")
        self.p = declare(self, "commander.yaml", TABLE)
        self._commander = Commander(CommanderSettings.from_parameters(self.p))
        self._state: ArmState | None = None
        self._message = WamCommand()
        self._message.header.frame_id = self.p["frame_id"]
        self._fault, self._goal, self._over = "", None, None
        self._silence, self._watched = 0.0, time.monotonic()  # of the learner [s, wall clock]; when that was last looked at
        self._command = self.create_publisher(WamCommand, "/wam/command", COMPLETE)
        self._attractor = self.create_publisher(PoseStamped, "~/attractor", FRAMES)
        self._plan = self.create_publisher(Path, "~/plan", LATCHED)
        self._watcher = Watcher(self, self.p["frame_id"], on_pose=self._check_over)
        self.create_subscription(JointState, "/joint_states", self._on_state, LOOP)
        self.create_subscription(Time, "/skill_learner/heartbeat", self._on_heartbeat, 10)
        self._planner = self.create_client(PlanThrow, "/skill_learner/plan_throw")
        self._planner_link = Link(self, self._planner.srv_name)
        self.create_service(SetBool, "~/release_arm", self._on_release_arm)
        self.create_service(Trigger, "~/stop", self._on_stop)
        accept = {"goal_callback": self._on_goal, "cancel_callback": lambda _: CancelResponse.ACCEPT}
        self._action = RoutineServer(self, Throw, "/throw", self._throw, self._finish, **accept)
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
        if self._goal is not None:
            self._follow_goal(state)

    def _follow_goal(self, state: ArmState) -> None:
        """What a throw under way needs besides the control step: feedback, cancellation, its end."""
        if self._goal.is_cancel_requested and self._commander.throwing:
            self._commander.stop("cancelled")
        if state.stamp_ns - self._fed_ns >= FEEDBACK_NS:
            self._fed_ns = state.stamp_ns
            self._feed(self._commander.mode.value if self._commander.throwing else "watching")
            self._publish_attractor(state)
        if self._ended_ns is None and not self._commander.throwing:
            opened = self._commander.opened_ns
            watch = 0 if opened is None else round(self.p["watch_time"] * 1e9)
            self._ended_ns = max(state.stamp_ns, (opened or 0) + watch)
        self._check_over()

    def _check_over(self) -> None:
        """The throw is over when its end has come and what the cameras saw until shortly before it has arrived."""
        if self._over is None or self._over.kept or self._ended_ns is None or self._state is None:
            return
        arrived = self._watcher.has_all_until(self._ended_ns - ARRIVAL_NS) or self._commander.opened_ns is None
        late = time.monotonic() - self._alive > 5.0
        if self._state.stamp_ns >= self._ended_ns and (arrived or late):
            self._over.keep()

    # the action

    def _on_goal(self, goal) -> GoalResponse:
        if self._goal is not None or self._commander.throwing:
            self.get_logger().warning("a throw is refused: another one is under way")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    async def _throw(self, goal_handle) -> Throw.Result:
        self._goal, self._ended_ns, self._over, self._fed_ns = goal_handle, None, None, 0
        self._watcher.clear()
        result = Throw.Result(code=Throw.Goal.OUTCOME_REFUSED)
        try:
            self._feed("planning")
            await self._watcher.listen()
            plan = await self._ask_for_plan(goal_handle.request, result)
            if plan is not None:
                await self._execute(plan, result)
        except (PlanRefused, ValueError) as error:
            result.message = str(error)
        finally:
            self._goal = None
            self._watcher.rest()
        return result

    async def _ask_for_plan(self, goal, result):
        if goal.header.frame_id not in ("", self.p["frame_id"]):
            result.message = f"the target is in frame '{goal.header.frame_id}', not '{self.p['frame_id']}'"
            return None
        if self._state is None:
            result.message = "no /joint_states yet: is the arm, or wam_simulator, running?"
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
        first_ns = conversions.stamp_ns(self._goal.request.header.stamp)
        while self._state.stamp_ns < first_ns:  # the states that the goal knows of are answered before it is obeyed
            await pause(self, 0.01)
        self._commander.throw(plan)
        begun_ns = self._state.stamp_ns
        self._alive, self._silence = time.monotonic(), 0.0
        self._over = Promise()
        self._feed("armed")
        await self._over
        result.duration = conversions.duration_msg((self._state.stamp_ns - begun_ns) * 1e-9)
        thrown = self._commander.opened_ns is not None
        stopped = bool(self._commander.message)
        result.code = Throw.Goal.OUTCOME_STOPPED if stopped or not thrown else Throw.Goal.OUTCOME_THROWN
        result.message = self._commander.message or "thrown"
        if thrown:
            log, opened, until = self._watcher.log, self._commander.opened_ns, self._ended_ns - ARRIVAL_NS
            outcome = judge_flight(*log.ball_between(opened, until), plan.target, self.p["rim_radius"])
            release = log.release_between(opened - BEFORE_NS, until)
            result.outcome = conversions.outcome_msg(outcome, plan.target, self.p["frame_id"], opened, release)

    def _finish(self, goal_handle, result) -> None:
        if result.code != Throw.Goal.OUTCOME_THROWN:
            self.get_logger().error(f"no throw: {result.message}")
        finish(goal_handle, result.code == Throw.Goal.OUTCOME_THROWN)

    def _feed(self, phase: str) -> None:
        error = self._commander.tracking_error if np.isfinite(self._commander.tracking_error) else 0.0
        seconds = float(self._commander.time) if np.isfinite(self._commander.time) else 0.0
        self._goal.publish_feedback(Throw.Feedback(phase=phase, time=seconds, tracking_error=float(error)))

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
        self._silence = 0.0

    def _watch(self) -> None:
        """A throw needs its learner alive, and the states of the arm: a node that died stops the arm."""
        gap, self._watched = time.monotonic() - self._watched, time.monotonic()
        if self._goal is None or not self._commander.throwing or self._over is None:
            return
        self._silence += min(gap, 2 * WATCH)  # who was held up itself has heard nobody
        if self._silence > self.p["learner_timeout"]:
            self._commander.stop(f"skill_learner has been silent for {self._silence:.1f} s: is it still running? The arm was stopped")

    def _on_release_arm(self, request, response):
        try:
            self._commander.release_arm(request.data)
            response.success = True
        except PlanRefused as error:
            response.success, response.message = False, str(error)
        return response

    def _on_stop(self, request, response):
        self._commander.stop("stopped by ~/stop")
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
