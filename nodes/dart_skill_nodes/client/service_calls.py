"""Calls of services and actions from coroutines: they wait until the other side can really answer, and
say who is missing.

In DDS a client finds its server before the server finds the client, by seconds on a bad day; an
answer given in between is lost for good. A server that was killed stays on the graph for seconds
and takes requests that are not answered. `service_is_ready` is true in both cases. So a call that
must not get lost is preceded by a question that may: the parameters of the server's node, asked
again until answered. Endpoints are announced in the order in which they were made, so a server
that has found the youngest of a client's has found the older ones. It says nothing of the way
back: services of parameters are the oldest of a server, and a client that has found them may not
have found the others. A request that it sends then is lost, so the client must be ready,
too.
"""

import time
from collections.abc import Awaitable, Callable

from dart_skill_msgs.msg import Outcome, Situation
from dart_skill_msgs.srv import Judge as JudgeService
from dart_skill_msgs.srv import Look, StopDemonstration
from rcl_interfaces.srv import ListParameters
from rclpy.action import ActionClient
from rclpy.node import Node
from std_srvs.srv import Trigger

from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import Promise, answer, pause, within
from dart_skill_nodes.comms.names import full_name, namespace_of
from dart_skill_nodes.comms.presence import NO_CAMERAS, UNKNOWN, Presence, servers
from dart_skill_nodes.comms.refusals import NOT_RECORDED
from dart_skill_nodes.process.graph_processes import GraphFailure

AGAIN = 0.5
"""A question is asked again after so long [s, wall clock]."""
APPEARS = 4.0
"""For a server to be found at all: a driver with Fast DDS's own settings tells of itself every 3 s
[s, wall clock].
"""
FOUND_DEAD = 0.5
"""Where a dead one is found, the next one is waited for by so much of that time: it may be
starting.
"""
COMES_BACK = 0.7
"""For one that has gone, and may just have been started again [s, wall clock]."""
PATIENCE = 20.0
"""For an answer of a server that is there [s, wall clock]."""
LEAST_PATIENCE = 1.0
"""For the answer of a server that was found late [s, wall clock]."""
SERVES = {
    "throw": "commander",
    "teach": "teacher",
    "practice": "coach",
    "simulation": "wam_simulator",
    "bhand": "wam_simulator",
}
"""Nodes that serve under other names than their own."""
ARRIVAL = 5.0
"""Longest wait for more of what the cameras have seen of a throw [s, wall clock]."""


class ServerProbe:
    """From a client of `node` to the node that serves `service`. Poll `up` between turns of the
    executor until it is true.

    is_ready: of the client, its `service_is_ready` or `server_is_ready`.
    """

    def __init__(self, node: Node, service: str, is_ready: Callable[[], bool]):
        self._node, self._service, self._is_ready = (
            node,
            node.resolve_service_name(service),
            is_ready,
        )
        self._probe, self._questions, self._asked, self._is_up = None, [], 0.0, False
        self._server_then: Presence | None = None

    def renew(self) -> None:
        """Ask anew: what was true before may have changed."""
        self._is_up = False

    def up(self) -> bool:
        """Whether the server has answered since `renew`, and the client has found it; asks the
        server if that is not so, and time to.

        A server that takes the place of one that has gone is asked anew.
        """
        if self._is_up and not (self._server_then is not None and self._server_then.gone):
            return True
        self._is_up = False
        if any(question.done() for question in self._questions):
            if self._is_ready():
                self._settle()
        elif self._probe is None:
            if server := self._server():
                service = f"{server}/list_parameters"
                self._probe = self._node.create_client(ListParameters, service)
        elif time.monotonic() - self._asked > AGAIN and self._probe.service_is_ready():
            self._asked = time.monotonic()
            self._questions.append(
                self._probe.call_async(ListParameters.Request(prefixes=["use_sim_time"]))
            )
        return self._is_up

    def is_hopeless(
        self, waited: float, patience: float = PATIENCE, appears: float = APPEARS
    ) -> bool:
        """Whether it is in vain to wait for the server any longer than [s]: it has gone, nobody
        has appeared, or it does not answer.
        """
        there = servers(self._node, self._service)
        if (there or self._is_ready()) and not there.gone:
            return waited > patience
        return waited > (COMES_BACK if self.was_up else appears * FOUND_DEAD if there else appears)

    @property
    def was_up(self) -> bool:
        """Whether there has ever been a server."""
        return self._server_then is not None

    @property
    def why(self) -> str:
        """What to say when the server is not up."""
        if self._server_then:
            return (
                f"{self._server_then} has gone: nobody serves {self._service} any more; start it"
                " again"
            )
        if there := servers(self._node, self._service):
            return f"{there} serves {self._service} and does not answer: end it, or start it again"
        first = self._service.removeprefix(f"{namespace_of(self._node)}/").split("/")[0]
        return f"nobody serves {self._service}: start {SERVES.get(first, first)}"

    def _settle(self) -> None:
        for question in self._questions:
            self._probe.remove_pending_request(question)
        self._questions, self._asked, self._is_up = [], 0.0, True
        self._server_then = servers(self._node, self._service)

    def _server(self) -> str:
        """Full name of the node that serves, or an empty one.

        The endpoint that answers knows its node. Asking the nodes by name does not: of two with
        one name only the older is looked at, and a node that was killed or leaked hides the one
        that serves.
        """
        for info in self._node.get_publishers_info_by_topic(
            f"rr{self._service}Reply", no_mangle=True
        ):
            if info.node_name != UNKNOWN:
                return f"{info.node_namespace.rstrip('/')}/{info.node_name}"
        return ""


class ServiceCalls:
    """Calls of services and actions in the name of a node, as coroutines.

    patience, appears: for an answer, and for a server to appear [s, wall clock].
    """

    def __init__(self, node: Node, patience: float = PATIENCE, appears: float = APPEARS):
        self._node, self._patience, self._appears = node, patience, appears
        self._probes: dict[object, ServerProbe] = {}

    async def call(self, client, request, may_refuse: bool = False, patience: float | None = None):
        """Response of a service; GraphFailure with the remedy if it is not served, does not answer
        within patience [s] from the call on, or says no.
        """
        patience = self._patience if patience is None else patience
        until = time.monotonic() + patience
        probe = await self.reach(client, patience=patience)
        asked = servers(self._node, client.service_name)
        left = max(until - time.monotonic(), LEAST_PATIENCE)
        response = await answer(self._node, client, request, left, asked)
        if response is None:
            probe.renew()
            raise GraphFailure(_unanswered(client.service_name, asked, patience))
        if not (may_refuse or getattr(response, "success", True)):
            raise GraphFailure(f"{client.service_name}: {response.message}")
        return response

    async def send(self, client: ActionClient, name: str, goal, on_feedback):
        """Handle of a goal that was accepted; GraphFailure if the action is not served, does not
        answer, or refuses it.
        """
        await self.reach(client, name)
        accepted, name = Promise(), full_name(self._node, name)
        sent = client.send_goal_async(
            goal, feedback_callback=lambda message: on_feedback(message.feedback)
        )
        sent.add_done_callback(lambda done: accepted.keep(done.result()))
        handle = await self.kept(name, accepted, self._patience)
        if not handle.accepted:
            raise GraphFailure(f"{name} refused the goal: another one is under way")
        return handle

    async def act(
        self,
        client: ActionClient,
        name: str,
        goal,
        patience: float,
        sent: Callable[[object], None] = lambda handle: None,
        on_feedback: Callable[[object], None] = lambda feedback: None,
    ):
        """Result of a goal that is accepted, and waited for so long [s, wall clock]; GraphFailure as
        of `send` and `kept`. sent: called with the goal's handle.
        """
        handle, over = await self.send(client, name, goal, on_feedback), Promise()
        sent(handle)
        handle.get_result_async().add_done_callback(lambda done: over.keep(done.result().result))
        return await self.kept(name, over, patience)

    def has_reached(self, client) -> bool:
        """Whether a server has ever answered a client."""
        return client in self._probes and self._probes[client].was_up

    async def kept(self, name: str, promise: Promise, limit: float):
        """Value of a promise that an action's server keeps; GraphFailure if that takes longer than
        the limit, or the server goes.
        """
        name = full_name(self._node, name)
        asked = servers(self._node, f"{name}/_action/send_goal")
        value = await within(self._node, promise, limit, asked)
        if value is None:
            raise GraphFailure(_unanswered(name, asked, limit))
        return value

    async def reach(
        self,
        client,
        action: str = "",
        limit: float | None = None,
        patience: float | None = None,
    ) -> ServerProbe:
        """Wait until a client can ask its server and is answered; GraphFailure if it is not served.

        Each client has a probe of its own, made after it: an older one says nothing of whether the
        server has found a younger client.

        * action: name of the action of an action client.
        * limit: [s, wall clock]; by default as long as it is worth while.
        * patience: for the answer of a server that is there, by default that of all calls
          [s, wall clock].
        """
        service = f"{action}/_action/send_goal" if action else client.service_name
        is_ready = client.server_is_ready if action else client.service_is_ready
        probe = self._probes.get(client) or self._probes.setdefault(
            client, ServerProbe(self._node, service, is_ready)
        )
        begun = time.monotonic()
        while not probe.up():
            waited = time.monotonic() - begun
            if (
                probe.is_hopeless(
                    waited, self._patience if patience is None else patience, self._appears
                )
                if limit is None
                else waited > limit
            ):
                raise GraphFailure(probe.why)
            await pause(self._node, 0.01)
        return probe


def _unanswered(name: str, asked: Presence, limit: float) -> str:
    return (
        f"{asked} has gone before it answered {name}: start it again"
        if asked.gone
        else f"no answer from {name} in {limit:.0f} s: {asked} serves it, and may be busy or stuck"
    )


OF_THE_RECORDER = {
    "start": Trigger,
    "stop": StopDemonstration,
    "judge": JudgeService,
    "look": Look,
}
"""Services of the demonstration recorder."""


class RecorderCalls:
    """The demonstration recorder, which sees the poses, for a node that lets something be recorded,
    that lets the arm move, or that needs to know where bodies are.

    services: those of OF_THE_RECORDER that the node needs; it has the permission for no others.
    """

    def __init__(self, node: Node, calls: ServiceCalls, *services: str):
        self._node, self._calls = node, calls
        self._of = {
            name: node.create_client(OF_THE_RECORDER[name], f"demonstration_recorder/{name}")
            for name in services
        }

    async def start(self, let_run: Callable[[], Awaitable] | None = None) -> None:
        """From now on a throw is looked at. In a graph that has just been started every topic must
        come to the recorder first.

        let_run: lets a simulated world run that is held: nothing comes from it to a recorder that
        was started meanwhile.
        """
        for attempt in range(100):
            response = await self._calls.call(
                self._of["start"], Trigger.Request(), may_refuse=True
            )
            if response.success:
                return
            if response.message.startswith((NO_CAMERAS, NOT_RECORDED)):
                break
            if attempt == 0 and let_run is not None:
                await let_run()
            await pause(self._node, 0.1)
        raise GraphFailure(f"{self._of['start'].service_name}: {response.message}")

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
            response = await self._calls.call(self._of["stop"], request, may_refuse=True)
            if not response.pending:
                return response
            await pause(self._node, 0.05)
        raise GraphFailure(f"the recorder still waits for sensor messages: {response.message}")

    async def outcome(
        self, situation: Situation, told_ns: int, until_ns: int, begun_ns: int = 0
    ) -> Outcome:
        """What became of a movement for a situation, of what the cameras saw up to a stamp, once
        that has arrived.

        told_ns, begun_ns: when the fingers were told the last thing, and when it began, 0 if that
        is not known [ns].

        Where nothing more of it arrives within ARRIVAL, the throw is judged by what has come.
        GraphFailure if no outcome is judged.
        """
        request = JudgeService.Request(situation=situation)
        request.begun, request.told = map(conversions.time_msg, (begun_ns, told_ns))
        request.until = conversions.time_msg(until_ns)

        def is_late() -> None:
            request.until = conversions.time_msg(0)

        return (await self._once_it_has_come(self._of["judge"], request, is_late)).outcome

    async def look(self, until_ns: int = 0) -> Situation:
        """Where the bodies of the skill are just before a stamp; 0: now. GraphFailure says which one
        is not seen.
        """
        request = Look.Request(until=conversions.time_msg(until_ns))
        return (await self._once_it_has_come(self._of["look"], request)).situation

    async def _once_it_has_come(self, client, request, is_late=None):
        """Response of a service that waits for poses. is_late: called when nothing more has come
        for ARRIVAL; without it that fails.
        """
        come, late = "", 0.0
        while (response := await self._calls.call(client, request, may_refuse=True)).pending:
            if response.message != come:  # it says up to when poses have come
                come, late = response.message, time.monotonic() + ARRIVAL
            if time.monotonic() > late:
                if is_late is None:
                    break
                is_late()
            await pause(self._node, 0.02)
        if not response.success:
            raise GraphFailure(f"{client.service_name}: {response.message}")
        return response
