"""A goal of /execute: what is asked of the learner for it, and how far it is."""

from dataclasses import dataclass, field

import numpy as np
from dart_skill_msgs.action import Execute
from dart_skill_msgs.msg import Situation
from dart_skill_msgs.srv import Plan
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.node import Node

from dart_skill.arm import Commander, Mode, MotionPlan
from dart_skill.common.rotations import of_matrices
from dart_skill.skills.execution import ReactiveGuide
from dart_skill.skills.learning import Policy
from dart_skill.skills.protocol import Skill
from dart_skill_nodes.client.service_calls import BodyLocator, ServiceCalls
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import Promise
from dart_skill_nodes.comms.presence import Presence
from dart_skill_nodes.comms.qos import FRAMES, NEWEST


class Withdrawn(Exception):
    """The goal was cancelled, or the arm stopped, before it moved; the message says by whom."""


@dataclass
class GoalUnderWay:
    """A goal of /execute, from its acceptance to its result.

    * handle: of the action.
    * client, learner: who waits for its result, and who made its plan.
    * withdrawn: why it must not move the arm any more, empty if it may.
    * armed: the commander has its plan, and the arm may move for it.
    * waits: the client was told that the world is held.
    * over: kept when the movement and the watching have ended.
    * newest_ns, fed_ns: stamps of the last state that it saw, and of the last feedback.
    * ended_ns: the stamp at which movement and watching end, None before that is known.
    """

    handle: object
    client: Presence
    learner: Presence
    withdrawn: str = ""
    armed: bool = False
    waits: bool = False
    over: Promise = field(default_factory=Promise)
    newest_ns: int = 0
    ended_ns: int | None = None
    fed_ns: int = 0

    def feed(self, phase: str, commander: Commander) -> None:
        """Tell the client the phase, with the commander's time and tracking error."""
        seconds, error = (
            float(value) if np.isfinite(value) else 0.0
            for value in (commander.time, commander.tracking_error)
        )
        self.handle.publish_feedback(
            Execute.Feedback(phase=phase, time=seconds, tracking_error=error)
        )


class Plans:
    """Asks the learner for plans of a skill, and shows them to viewers.

    * commander: who carries them out.
    * parameters: of the node: frame_id, plan_timeout.
    """

    def __init__(
        self, node: Node, calls: ServiceCalls, commander: Commander, skill: Skill, parameters: dict
    ):
        self._calls, self._commander, self._skill, self._p = calls, commander, skill, parameters
        self._bodies = BodyLocator(node, calls)
        self._client = node.create_client(Plan, "skill_learner/plan")
        self._path = node.create_publisher(Path, "~/plan", NEWEST)
        self._attractor = node.create_publisher(PoseStamped, "~/attractor", FRAMES)

    @property
    def service_name(self) -> str:
        """Of the service that is asked."""
        return self._client.service_name

    async def ask(self, goal, result) -> MotionPlan | ReactiveGuide | None:
        """What carries out a goal; None, with the reason in the result, if the learner has no
        plan.
        """
        situation = await self._whole(goal.situation, conversions.stamp_ns(goal.header.stamp))
        request = Plan.Request(situation=situation, explore=goal.explore)
        request.header.frame_id = self._p["frame_id"]
        response = await self._calls.call(
            self._client, request, may_refuse=True, patience=self._p["plan_timeout"]
        )
        if not response.success:
            result.message = response.message
            return None
        plan = result.plan = response.plan
        self._path.publish(conversions.path_msg(plan))
        if not plan.policy:
            return conversions.motion_plan(plan)
        policy = Policy.from_bytes(plan.policy.tobytes(), self._skill)
        registration = self._commander.agreed(
            policy.registration, policy.start.position, policy.start.quaternion
        )
        return policy.guide(conversions.situation(plan.situation), registration)

    def show_attractor(self, stamp_ns: int) -> None:
        """Where the hand is pulled to, while a motion is executed. stamp_ns: of the state [ns]."""
        reference = self._commander.reference
        if self._commander.mode != Mode.EXECUTING or reference is None:
            return
        message = PoseStamped()
        message.header.frame_id = self._p["frame_id"]
        conversions.set_stamp(message.header.stamp, stamp_ns)
        orientation = of_matrices(reference.attractor_rotation[None])[0]
        conversions.set_pose(message.pose, reference.attractor_position, orientation)
        self._attractor.publish(message)

    async def _whole(self, situation: Situation, stamp_ns: int) -> Situation:
        """A situation with all bodies on which a plan depends: those of which a client says
        nothing are where the cameras see them.
        """
        if set(self._skill.situated) <= set(situation.bodies):
            return situation
        seen = await self._bodies.look(stamp_ns)
        for body, pose in zip(seen.bodies, seen.poses, strict=True):
            if body in self._skill.situated and body not in situation.bodies:
                situation.bodies.append(body)
                situation.poses.append(pose)
        return situation
