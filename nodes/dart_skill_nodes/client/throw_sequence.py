"""The one way to throw in a simulated world: reset and held, goal, armed, let run, result, held again.

The world is held until the commander has its plan, so that a throw begins at the same step every time. On an arm without a simulator the
goal alone is sent.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Throw
from dart_skill_msgs.srv import Reset
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.node import Node
from std_srvs.srv import SetBool

from dart_skill_nodes.client.failures import CallFailed
from dart_skill_nodes.client.service_calls import ServiceCalls
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import Promise

LONGEST_THROW = 120.0
"""Of the answer to a throw [s, wall clock]."""


@dataclass
class ThrowUnderWay:
    """A throw that was accepted: the goal's handle, the promise that the commander is armed, and that of the result."""

    handle: ClientGoalHandle | None = None
    armed: Promise = field(default_factory=Promise)
    over: Promise = field(default_factory=Promise)


class ThrowSequence:
    """The steps of a throw as coroutines of a node.

    frame_id: of targets. simulated: whether there is a simulator that is reset and held; called for every throw.
    """

    def __init__(self, node: Node, calls: ServiceCalls, frame_id: str, simulated: Callable[[], bool] = lambda: True):
        self._node, self._calls, self._frame_id, self._simulated = node, calls, frame_id, simulated
        self.reset_client = node.create_client(Reset, "/simulation/reset")
        self.pause_client = node.create_client(SetBool, "/simulation/pause")
        self.action_client = ActionClient(node, Throw, "/throw")
        self._under_way: ThrowUnderWay | None = None

    async def reset(self, basket: np.ndarray | None = None) -> Time:
        """A world that is held, with the ball in the hand, its basket put to (3,), or left where it is; the stamp of its first state."""
        if not self._simulated():
            return Time()
        request = Reset.Request(paused=True)
        if basket is not None:
            request.move_basket, request.basket = True, conversions.point(basket)
        try:
            return (await self._calls.call(self.reset_client, request)).stamp
        except CallFailed as failure:
            if self._calls.has_reached(self.reset_client):
                raise
            raise CallFailed(f"{failure}; with a real arm start the coach with simulated:=false, as the layout hardware does") from failure

    async def begin(self, target: np.ndarray, first_stamp: Time, on_phase: Callable[[str], None] = lambda phase: None) -> ThrowUnderWay:
        """Send the goal for a target (3,), and let the world run when the commander is armed, or has refused."""
        goal = Throw.Goal(target=conversions.point(target))
        goal.header.frame_id, goal.header.stamp = self._frame_id, first_stamp
        throw = ThrowUnderWay()

        def on_feedback(feedback: Throw.Feedback) -> None:
            on_phase(feedback.phase)
            if feedback.phase == "armed":
                throw.armed.keep(True)

        def on_result(done) -> None:
            throw.over.keep(done.result().result)
            throw.armed.keep(True)

        throw.handle = await self._calls.send(self.action_client, "/throw", goal, on_feedback)
        self._under_way = throw
        throw.handle.get_result_async().add_done_callback(on_result)
        await self._calls.kept("/throw", throw.armed, LONGEST_THROW)
        await self.hold(False)
        return throw

    async def end(self, throw: ThrowUnderWay) -> Throw.Result:
        """Result of a throw that has begun, and hold the world again; CallFailed if it takes too long, or the commander has gone."""
        try:
            result = await self._calls.kept("/throw", throw.over, LONGEST_THROW)
        finally:
            self._under_way = None
        await self.hold(True)
        return result

    def cancel(self) -> None:
        """Cancel the throw under way, if there is one; its result tells of it."""
        if self._under_way is not None:
            self._under_way.handle.cancel_goal_async()

    async def hold(self, held: bool) -> None:
        """Hold the simulated world, or let it run."""
        if self._simulated():
            await self._calls.call(self.pause_client, SetBool.Request(data=held))
