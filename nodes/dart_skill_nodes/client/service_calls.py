"""Calls of services and actions from coroutines: they wait until the other side can really answer,
and say who is missing.
"""

import time
from collections.abc import Awaitable, Callable

from dart_skill_msgs.msg import Outcome, Situation
from dart_skill_msgs.srv import Judge as JudgeService
from dart_skill_msgs.srv import Look, StopDemonstration
from rclpy.action import ActionClient
from rclpy.node import Node
from std_srvs.srv import Trigger

from dart_skill_nodes.client.failures import CallFailed
from dart_skill_nodes.client.server_probe import PATIENCE, ServerProbe
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import Promise, answer, pause, within
from dart_skill_nodes.comms.names import full_name
from dart_skill_nodes.comms.presence import NO_CAMERAS, Presence, servers
from dart_skill_nodes.comms.refusals import NOT_RECORDED

ARRIVAL = 5.0
"""For more of what the cameras have seen of a throw [s, wall clock]."""


class ServiceCalls:
    """Service calls in the name of a node; one link per client is kept."""

    def __init__(self, node: Node):
        self._node = node
        self._links: dict[object, ServerProbe] = {}

    async def call(self, client, request, may_refuse: bool = False, patience: float = PATIENCE):
        """Response of a service; CallFailed with the remedy if it is not served, does not answer
        within patience [s], or says no.
        """
        link = await self._linked(client, client.service_name, client.service_is_ready)
        asked = servers(self._node, client.service_name)
        response = await answer(self._node, client, request, patience, asked)
        if response is None:
            link.renew()
            raise CallFailed(_unanswered(client.service_name, asked, patience))
        if not response.success and not may_refuse:
            raise CallFailed(f"{client.service_name}: {response.message}")
        return response

    async def send(self, client: ActionClient, name: str, goal, on_feedback):
        """Handle of a goal that was accepted; CallFailed if the action is not served, does not
        answer, or refuses it.
        """
        name = full_name(self._node, name)
        await self._linked(client, f"{name}/_action/send_goal", client.server_is_ready)
        accepted = Promise()
        sent = client.send_goal_async(
            goal, feedback_callback=lambda message: on_feedback(message.feedback)
        )
        sent.add_done_callback(lambda done: accepted.keep(done.result()))
        asked = servers(self._node, f"{name}/_action/send_goal")
        handle = await within(self._node, accepted, PATIENCE, asked)
        if handle is None:
            raise CallFailed(_unanswered(name, asked, PATIENCE))
        if not handle.accepted:
            raise CallFailed(f"{name} refused the goal: another one is under way")
        return handle

    def has_reached(self, client) -> bool:
        """Whether a server has ever answered a client."""
        return client in self._links and self._links[client].was_up

    async def kept(self, name: str, promise: Promise, limit: float):
        """Value of a promise that an action's server keeps; CallFailed if that takes longer than
        the limit, or the server goes.
        """
        name = full_name(self._node, name)
        asked = servers(self._node, f"{name}/_action/send_goal")
        value = await within(self._node, promise, limit, asked)
        if value is None:
            raise CallFailed(_unanswered(name, asked, limit))
        return value

    async def _linked(self, client, service: str, is_ready: Callable[[], bool]) -> ServerProbe:
        link = self._links.setdefault(client, ServerProbe(self._node, service, is_ready))
        begun = time.monotonic()
        while not link.up():
            if link.is_hopeless(time.monotonic() - begun):
                raise CallFailed(link.why)
            await pause(self._node, 0.01)
        return link


def _unanswered(name: str, asked: Presence, limit: float) -> str:
    return (
        f"{asked} has gone before it answered {name}: start it again"
        if asked.gone
        else f"no answer from {name} in {limit:.0f} s"
    )


class RecorderCalls:
    """The demonstration recorder, for a node that lets something be recorded."""

    def __init__(self, node: Node, calls: ServiceCalls):
        self._node, self._calls = node, calls
        self._start = node.create_client(Trigger, "demonstration_recorder/start")
        self._stop = node.create_client(StopDemonstration, "demonstration_recorder/stop")

    async def start(self, let_run: Callable[[], Awaitable] | None = None) -> None:
        """From now on a throw is looked at. In a graph that has just been started every topic must
        come to the recorder first.

        let_run: lets a simulated world run that is held: nothing comes from it to a recorder that
        was started meanwhile.
        """
        for attempt in range(100):
            response = await self._calls.call(self._start, Trigger.Request(), may_refuse=True)
            if response.success:
                return
            if response.message.startswith((NO_CAMERAS, NOT_RECORDED)):
                break
            if attempt == 0 and let_run is not None:
                await let_run()
            await pause(self._node, 0.1)
        raise CallFailed(f"{self._start.service_name}: {response.message}")

    async def stop(
        self, until_ns: int, keep: bool, reason: str = ""
    ) -> StopDemonstration.Response:
        """What was recorded up to a stamp, cut out; keep: as a demonstration, else for a reason
        only as a part of the bag.
        """
        request = StopDemonstration.Request(
            keep=keep, reason=reason, until=conversions.time_msg(until_ns)
        )
        for _ in range(100):
            response = await self._calls.call(self._stop, request, may_refuse=True)
            if not response.pending:
                return response
            await pause(self._node, 0.05)
        raise CallFailed(f"the recorder still waits for sensor messages: {response.message}")


class Judge:
    """The node that judges throws, for a node that lets the arm throw."""

    def __init__(self, node: Node, calls: ServiceCalls):
        self._node, self._calls = node, calls
        self._client = node.create_client(JudgeService, "demonstration_recorder/judge")

    async def outcome(
        self, situation: Situation, told_ns: int, until_ns: int, begun_ns: int = 0
    ) -> Outcome:
        """What became of a movement for a situation, of what the cameras saw up to a stamp, once
        that has arrived.

        told_ns, begun_ns: when the fingers were told the last thing, and when it began, 0 if that
        is not known [ns].

        Where nothing more of it arrives within ARRIVAL, the throw is judged by what has come.
        CallFailed if no outcome is judged.
        """
        request = JudgeService.Request(
            situation=situation,
            begun=conversions.time_msg(begun_ns),
            told=conversions.time_msg(told_ns),
        )
        request.until = conversions.time_msg(until_ns)
        come, late = "", 0.0
        while (response := await self._calls.call(self._client, request, may_refuse=True)).pending:
            if response.message != come:  # it says up to when poses have come
                come, late = response.message, time.monotonic() + ARRIVAL
            if time.monotonic() > late:
                request.until = conversions.time_msg(0)
            await pause(self._node, 0.02)
        if not response.success:
            raise CallFailed(f"{self._client.service_name}: {response.message}")
        return response.outcome


class BodyLocator:
    """The node that sees the poses, for a node that needs to know where bodies are."""

    def __init__(self, node: Node, calls: ServiceCalls):
        self._node, self._calls = node, calls
        self._client = node.create_client(Look, "demonstration_recorder/look")

    async def look(self, until_ns: int = 0) -> Situation:
        """Where the bodies of the skill are just before a stamp; 0: now. CallFailed says which one
        is not seen.
        """
        request, since = Look.Request(until=conversions.time_msg(until_ns)), time.monotonic()
        while (response := await self._calls.call(self._client, request, may_refuse=True)).pending:
            if time.monotonic() - since > ARRIVAL:
                raise CallFailed(f"{self._client.service_name}: {response.message}")
            await pause(self._node, 0.02)
        if not response.success:
            raise CallFailed(f"{self._client.service_name}: {response.message}")
        return response.situation
