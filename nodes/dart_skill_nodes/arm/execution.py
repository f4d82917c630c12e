"""A goal of /execute: what is asked of the learner for it, the motion that it becomes, and what becomes
of that.
"""

import time
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from dart_skill_msgs.action import Execute
from dart_skill_msgs.msg import Plan as PlanMsg
from dart_skill_msgs.msg import Situation
from dart_skill_msgs.srv import GetPlan, Plan
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.node import Node

from dart_skill.arm import (
    ArmDescription,
    ArmState,
    Commander,
    Grip,
    Mode,
    MotionPlan,
    PlanRefused,
    Reference,
    rehearse,
    still_plan,
)
from dart_skill.common.quaternions import of_matrices
from dart_skill.skills.execution import ReactiveGuide
from dart_skill.skills.learning import Policy
from dart_skill.skills.observation import ARRIVAL_NS
from dart_skill.skills.protocol import Skill
from dart_skill_nodes.arm.arm_watch import QUIET, ArmWatch
from dart_skill_nodes.client.service_calls import RecorderCalls, ServiceCalls
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import Promise, in_thread, pause
from dart_skill_nodes.comms.presence import Presence, servers, subscribers
from dart_skill_nodes.comms.qos import FRAMES, NEWEST
from dart_skill_nodes.comms.seen_in_step import SeenInStep
from dart_skill_nodes.comms.this_machine import LOOK
from dart_skill_nodes.process.graph_processes import GraphFailure

FEEDBACK_NS = 50_000_000
"""Time between two messages of feedback [ns, by the stamps of states]."""
STATE_PATIENCE = 4.0
"""Longest wait for the state of the arm that a goal's stamp names [s, wall clock]."""
LET_RUN = 5.0
"""Longest wait for who holds a simulated world in which a motion shall begin [s, wall clock]."""
FINDS = 3.0
"""Longest wait for what a trial needs, until it is found [s, wall clock]."""
PLANS_KEPT = 16
"""Newest plans that `~/get_plan` gives; a plan has 50 to 200 kB."""


@dataclass
class GoalUnderWay:
    """A goal of /execute, from its acceptance to its result.

    * handle: of the action.
    * client, learner: who waits for its result, and who made its plan.
    * withdrawn: why it must not move the arm any more, empty if it may.
    * armed: the commander has its plan, and the arm may move for it.
    * waits: the client was told that the world is held.
    * over: kept when the movement and the watching have ended.
    * begun_ns, newest_ns, fed_ns: stamps of the first and the last state that it saw, and of the
      last feedback.
    * ended_ns: the stamp at which movement and watching end, None before that is known.
    """

    handle: object
    client: Presence
    learner: Presence
    withdrawn: str = ""
    armed: bool = False
    waits: bool = False
    over: Promise = field(default_factory=Promise)
    begun_ns: int = 0
    newest_ns: int = 0
    ended_ns: int | None = None
    fed_ns: int = 0


class Execution:
    """Carries out goals of a node, one at a time, with a commander.

    * arm: tells whether all are there without whom it must not move.
    * seen: poses for a motion that is corrected by them, in step with the states; None for a skill
      that is too fast for that.
    * parameters: of the node, in force: frame_id, plan_timeout, watch_time.

    Attributes: goal, the one under way; state, the newest one of the arm, None without one; plans,
    the newest ones by their id, oldest first.
    """

    def __init__(
        self,
        node: Node,
        commander: Commander,
        skill: Skill,
        arm: ArmWatch,
        seen: SeenInStep | None,
        parameters: dict,
    ):
        self._node, self._commander, self._skill, self._p = node, commander, skill, parameters
        self._arm, self._seen = arm, seen
        self.goal: GoalUnderWay | None = None
        self.state: ArmState | None = None
        self.plans: dict[str, PlanMsg] = {}
        self._calls = ServiceCalls(node)
        self._recorder = RecorderCalls(node, self._calls, "judge", "look")
        self._planner = node.create_client(Plan, "skill_learner/plan")
        node.create_service(GetPlan, "~/get_plan", self._on_get_plan)
        self._path = node.create_publisher(Path, "~/plan", NEWEST)
        self._attractor = node.create_publisher(PoseStamped, "~/attractor", FRAMES)

    def withdraw(self, reason: str) -> None:
        """The goal under way moves the arm no more: a motion is stopped, and one that is being
        planned does not begin.
        """
        if self.goal is not None and not self.goal.withdrawn:
            self.goal.withdrawn = reason
        if self._commander.executing:
            self._commander.stop(reason)

    async def carry_out(self, goal_handle, missing) -> Execute.Result:
        """The result of a goal. missing: gives what a trial needs and is not there, empty if
        nothing.
        """
        client = subscribers(self._node, "execute/_action/feedback")
        learner = servers(self._node, self._planner.service_name)
        self.goal = GoalUnderWay(goal_handle, client, learner)
        request, frame_id = goal_handle.request, self._p["frame_id"]
        unseen = conversions.unseen_outcome_msg(request.situation, self._skill.name, frame_id)
        result = Execute.Result(code=Execute.Goal.OUTCOME_REFUSED, outcome=unseen)
        try:
            self._feed("planning")
            if request.header.frame_id not in ("", frame_id):
                raise ValueError(
                    f"the situation is in frame '{request.header.frame_id}', not '{frame_id}'"
                )
            await self._find_what_it_needs(missing)
            self._commander.check_free_to_move()
            await self._execute(await self._plan(request, result), result)
        except (ValueError, GraphFailure) as error:
            waits = self._arm.time.held if self._commander.mode == Mode.STOPPING else ""
            result.message = "; ".join(filter(None, (str(error), waits)))
        finally:
            self.goal = None
        return result

    async def _find_what_it_needs(self, missing) -> None:
        """A commander that was just started finds it within FINDS; ValueError says what it does
        not find.
        """
        until = time.monotonic() + FINDS
        while lacks := missing():
            if time.monotonic() > until or self.goal.withdrawn:
                raise ValueError(lacks)
            await pause(self._node, LOOK)

    async def _plan(self, goal, result) -> MotionPlan | ReactiveGuide:
        """What carries out a goal; ValueError, with the learner's reason, if it has no plan."""
        situation = await self._whole(goal.situation, conversions.stamp_ns(goal.header.stamp))
        request = Plan.Request(situation=situation, explore=goal.explore)
        request.header.frame_id = self._p["frame_id"]
        response = await self._calls.call(
            self._planner, request, may_refuse=True, patience=self._p["plan_timeout"]
        )
        if not response.success:
            raise ValueError(response.message)
        result.plan_id = self._keep(response.plan)
        # the arm waits for answers meanwhile
        path, plan = await in_thread(self._node, self._prepare, response.plan)
        self._path.publish(path)
        return plan

    def _keep(self, plan: PlanMsg) -> str:
        """Keep a plan for who asks for it later; its id, which is that of the goal."""
        plan_id = bytes(self.goal.handle.goal_id.uuid).hex()
        self.plans[plan_id] = plan
        if len(self.plans) > PLANS_KEPT:
            del self.plans[next(iter(self.plans))]
        return plan_id

    def _on_get_plan(self, request: GetPlan.Request, response: GetPlan.Response) -> None:
        """Give a plan by its id; ValueError says which ones there are."""
        plan_id = request.plan_id or next(reversed(self.plans), "")
        if plan_id not in self.plans:
            there = f"the newest {len(self.plans)} are: {', '.join(self.plans)}"
            raise ValueError(
                f"there is no plan '{plan_id}'; {there}"
                if self.plans
                else "nothing was planned yet"
            )
        response.plan_id, response.plan = plan_id, self.plans[plan_id]

    def _read(self, message: PlanMsg) -> tuple[Path, MotionPlan | ReactiveGuide]:
        """The way of the hand in a plan, for viewers, and what carries it out."""
        path = conversions.path_msg(message)
        if not message.policy:
            return path, conversions.motion_plan(message)
        policy = Policy.from_bytes(message.policy.tobytes(), self._skill)
        registration = self._commander.agreed(
            policy.registration, policy.start.position, policy.start.quaternion
        )
        return path, policy.guide(conversions.situation(message.situation), registration)

    def _prepare(self, message: PlanMsg) -> tuple[Path, MotionPlan | ReactiveGuide]:
        """The same, with what the commander needs before it begins; PlanRefused if it will not."""
        path, plan = self._read(message)
        if isinstance(plan, MotionPlan):
            self._commander.prepare(plan)
        return path, plan

    def rehearse(self, spare: Commander, description: ArmDescription) -> None:
        """Go through a motion once before there is an arm: what is loaded on the way would make
        the first one late. spare: a commander that no arm listens to.
        """
        still = still_plan(description, self._skill.speed)
        _, plan = self._read(conversions.plan_msg(still, self._p["frame_id"]))
        # limits may forbid it; then the arm's first motion loads what is missing
        with suppress(PlanRefused):
            rehearse(spare, plan)
        if spare.reference is not None:
            self._attractor_msg(spare.reference, 0)

    async def _whole(self, situation: Situation, stamp_ns: int) -> Situation:
        """A situation with all bodies on which a plan depends: those of which a client says
        nothing are where the cameras see them.
        """
        if set(self._skill.situated) <= set(situation.bodies):
            return situation
        # what the cameras saw before, as before a reset, is not where the bodies are now; while
        # time is held no more is seen
        newest_ns = 0 if self._arm.time.is_held else self.state.stamp_ns
        seen = await self._recorder.look(stamp_ns or newest_ns)
        for body, pose in zip(seen.bodies, seen.poses, strict=True):
            if body in self._skill.situated and body not in situation.bodies:
                situation.bodies.append(body)
                situation.poses.append(pose)
        return situation

    async def _execute(self, plan: MotionPlan | ReactiveGuide, result) -> None:
        goal = self.goal
        await self._state_of_goal(conversions.stamp_ns(goal.handle.request.header.stamp))
        if goal.withdrawn:
            result.code, result.message = Execute.Goal.OUTCOME_STOPPED, goal.withdrawn
            return
        begun_ns = goal.begun_ns = goal.newest_ns = self.state.stamp_ns
        if isinstance(plan, MotionPlan):
            self._commander.execute(plan)
        else:
            self._commander.follow(plan)
        if self._seen is not None:
            self._seen.begin(begun_ns)
        goal.armed = True
        self._arm.time.goes_on()  # who holds the world lets it run when the plan is there
        self._feed("armed")
        await goal.over
        if self._seen is not None:
            self._seen.end()
        result.duration = conversions.duration_msg((goal.newest_ns - begun_ns) * 1e-9)
        opened_ns = self._commander.opened_ns
        told = self.plans[result.plan_id].events
        opens = any(event.name == conversions.WORDS[Grip.OPEN] for event in told)
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
            until_ns = goal.ended_ns - ARRIVAL_NS if watched else 0
            await self._let_judge(begun_ns, opened_ns or goal.newest_ns, until_ns, result)

    async def _let_judge(self, begun_ns: int, told_ns: int, until_ns: int, result) -> None:
        """What the cameras saw of the movement; one that is not judged has been made all the same.
        until_ns: 0: what has come.
        """
        try:
            result.outcome = await self._recorder.outcome(
                self.plans[result.plan_id].situation, told_ns, until_ns, begun_ns
            )
            if not result.outcome.seen and self._arm.unseen:
                result.message += f"; not seen: {self._arm.unseen}"
        except GraphFailure as failure:
            conversions.set_stamp(result.outcome.header.stamp, told_ns)
            result.message += f"; nobody judged it: {failure}"

    async def _state_of_goal(self, stamp_ns: int) -> None:
        """The states that the goal knows of are answered before it is obeyed; ValueError if the
        one that it names does not come.
        """
        until = time.monotonic() + STATE_PATIENCE
        while not self.goal.withdrawn and (self.state is None or self.state.stamp_ns < stamp_ns):
            if time.monotonic() > until:
                come = "" if self.state is None else f" up to {self.state.stamp_ns} ns only"
                raise ValueError(
                    f"the goal is stamped {stamp_ns} ns, but the arm's states have come{come}"
                )
            await pause(self._node, 0.01)

    def follow(self, state: ArmState) -> None:
        """What a goal under way needs after the control step has answered a state: feedback, and
        its end.
        """
        goal = self.goal
        self.state = state
        if goal is None or not goal.armed:
            return
        executing = self._commander.executing
        goal.newest_ns = state.stamp_ns
        if state.stamp_ns - goal.fed_ns >= FEEDBACK_NS:
            goal.fed_ns = state.stamp_ns
            self._feed(self._commander.mode.value if executing else "watching")
            self._show_attractor(state.stamp_ns)
        # who holds the world at the result finds an arm that can be reset
        rests = self._commander.mode != Mode.STOPPING
        if goal.ended_ns is None and not executing and rests:
            opened = self._commander.opened_ns
            stopped = opened is None and self._commander.message
            watch_ns = 0 if stopped else round(self._p["watch_time"] * 1e9)
            since = opened or (state.stamp_ns if watch_ns else 0)
            goal.ended_ns = max(state.stamp_ns, since + watch_ns)
        if goal.ended_ns is not None and state.stamp_ns >= goal.ended_ns:
            goal.over.keep()

    def watch(self) -> None:
        """Withdraw a goal that must not go on: those who wait for it, or who made its plan, have
        gone, or time stands still. To be called every LOOK.
        """
        goal, name = self.goal, self._skill.name
        if goal is None:
            return
        if goal.client.gone:
            self.withdraw(f"{goal.client} has gone, who asked for the {name}")
        if not goal.armed:
            return
        if self._commander.executing and goal.learner.gone:
            self.withdraw(f"{goal.learner} has gone during the {name}: start it again")
        if (held := self._arm.time.held) and not goal.waits:
            goal.waits = True
            self._feed("held")
            self._node.get_logger().warning(f"the {name} waits: {held}")
        if held and goal.newest_ns == goal.begun_ns and self._arm.time.silence > LET_RUN:
            self.withdraw(held)
        if not goal.withdrawn and self._arm.time.stalled:
            self.withdraw(self._arm.time.stalled)
        if goal.withdrawn and self._arm.time.silence > QUIET:
            goal.over.keep()  # no state will tell when the arm rests: time stands still

    def lose_states(self) -> None:
        """Nothing is known of the arm any more."""
        self.state = None
        if self.goal is not None:
            self.goal.over.keep()

    def _feed(self, phase: str) -> None:
        """Tell the client the phase, with the commander's time and tracking error."""
        seconds, error = np.nan_to_num(
            [self._commander.time, self._commander.tracking_error], posinf=0.0, neginf=0.0
        ).tolist()
        self.goal.handle.publish_feedback(
            Execute.Feedback(phase=phase, time=seconds, tracking_error=error)
        )

    def _show_attractor(self, stamp_ns: int) -> None:
        """Where the hand is pulled to, while a motion is executed. stamp_ns: of the state [ns]."""
        reference = self._commander.reference
        if self._commander.mode == Mode.EXECUTING and reference is not None:
            self._attractor.publish(self._attractor_msg(reference, stamp_ns))

    def _attractor_msg(self, reference: Reference, stamp_ns: int) -> PoseStamped:
        message = PoseStamped()
        message.header.frame_id = self._p["frame_id"]
        conversions.set_stamp(message.header.stamp, stamp_ns)
        orientation = of_matrices(reference.attractor_rotation[None])[0]
        conversions.set_pose(message.pose, reference.attractor_position, orientation)
        return message
