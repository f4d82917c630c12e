"""The one way to execute a skill in a simulated world: reset and held, goal, armed, let run,
result, held again.

The world is held until the commander has its plan, so that a movement begins at the same step
every time. On an arm without a simulator the goal alone is sent.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Execute
from dart_skill_msgs.msg import Situation
from dart_skill_msgs.srv import Reset, Step
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.node import Node
from std_srvs.srv import SetBool

from dart_skill.skills.observation import ARRIVAL_NS
from dart_skill_nodes.client.service_calls import RecorderCalls, ServiceCalls
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import Promise
from dart_skill_nodes.process.graph_processes import GraphFailure

LONGEST_TRIAL = 180.0
"""Longest wait for the answer to a goal [s, wall clock]."""
LOOK_STEPS = 100
"""Steps of a held world in which the cameras see all bodies [2 ms]."""


@dataclass
class TrialUnderWay:
    """A goal that was accepted: the goal's handle, the promise that the commander is armed, and
    that of the result.
    """

    handle: ClientGoalHandle | None = None
    armed: Promise = field(default_factory=Promise)
    over: Promise = field(default_factory=Promise)


class TrialSequence:
    """The steps of a trial as coroutines of a node.

    frame_id: of situations. simulated: whether there is a simulator that is reset and held; called
    for every trial.
    """

    def __init__(
        self,
        node: Node,
        calls: ServiceCalls,
        frame_id: str,
        simulated: Callable[[], bool] = lambda: True,
    ):
        self._node, self._calls, self._frame_id, self._simulated = node, calls, frame_id, simulated
        self.reset_client = node.create_client(Reset, "simulation/reset")
        self.pause_client = node.create_client(SetBool, "simulation/pause")
        self.action_client = ActionClient(node, Execute, "execute")
        self._step = node.create_client(Step, "simulation/step")
        self._recorder = RecorderCalls(node, calls, "look")
        self._under_way: TrialUnderWay | None = None

    async def reset(self, situation: Situation | None = None) -> Time:
        """A world that is held, with all that the hand holds in it, bodies put where a situation
        says; the stamp of its first state.
        """
        if not self._simulated():
            return Time()
        request = Reset.Request(paused=True, situation=situation or Situation())
        try:
            return (await self._calls.call(self.reset_client, request)).stamp
        except GraphFailure as failure:
            if self._calls.has_reached(self.reset_client):
                raise
            raise GraphFailure(
                f"{failure}; with a real arm start the coach with simulated:=false, as the layout"
                " hardware does"
            ) from failure

    async def look(self, asked: Situation | None = None) -> tuple[Situation, Time]:
        """Where the cameras see the bodies of the skill, in a held world that goes on for a
        moment, with the numbers that are asked for; and the stamp of its state then.
        """
        stamp = Time()
        if self._simulated():
            stamp = (await self._calls.call(self._step, Step.Request(steps=LOOK_STEPS))).stamp
        until_ns = max(0, conversions.stamp_ns(stamp) - ARRIVAL_NS)
        seen = await self._recorder.look(until_ns)
        if asked is not None:
            seen.names, seen.numbers = asked.names, asked.numbers
        return seen, stamp

    async def begin(
        self,
        situation: Situation,
        stamp: Time,
        on_phase: Callable[[str], None] = lambda phase: None,
        explore: bool = False,
    ) -> TrialUnderWay:
        """Send the goal for a situation, and let the world run when the commander is armed, or has
        refused.

        stamp: of the state after which the movement begins; zero: at once. explore: another plan
        than the best one may be tried.
        """
        goal = Execute.Goal(situation=situation, explore=explore)
        goal.header.frame_id, goal.header.stamp = self._frame_id, stamp
        trial = TrialUnderWay()

        def on_feedback(feedback: Execute.Feedback) -> None:
            on_phase(feedback.phase)
            if feedback.phase == "armed":
                trial.armed.keep(True)

        def on_result(done) -> None:
            trial.over.keep(done.result().result)
            trial.armed.keep(True)

        trial.handle = await self._calls.send(self.action_client, "execute", goal, on_feedback)
        self._under_way = trial
        trial.handle.get_result_async().add_done_callback(on_result)
        await self._calls.kept("execute", trial.armed, LONGEST_TRIAL)
        await self.hold(False)
        return trial

    async def end(self, trial: TrialUnderWay) -> Execute.Result:
        """Result of a trial that has begun, and hold the world again; GraphFailure if it takes too
        long, or the commander has gone.
        """
        try:
            result = await self._calls.kept("execute", trial.over, LONGEST_TRIAL)
        finally:
            self._under_way = None
        await self.hold(True)
        return result

    def cancel(self) -> None:
        """Cancel the trial under way, if there is one; its result tells of it."""
        if self._under_way is not None:
            self._under_way.handle.cancel_goal_async()

    async def hold(self, held: bool) -> None:
        """Hold the simulated world, or let it run."""
        if self._simulated():
            await self._calls.call(self.pause_client, SetBool.Request(data=held))
