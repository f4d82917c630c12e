"""Whether a service can really be asked: its server takes requests, and its answers come back.

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
from collections.abc import Callable

from rcl_interfaces.srv import ListParameters
from rclpy.node import Node

from dart_skill_nodes.comms.names import namespace_of
from dart_skill_nodes.comms.presence import UNKNOWN, Presence, servers

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


SERVES = {
    "throw": "commander",
    "teach": "teacher",
    "practice": "coach",
    "simulation": "wam_simulator",
    "bhand": "wam_simulator",
}
"""Nodes that serve under other names than their own."""


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
        if self._answered():
            if self._is_ready():
                self._settle()
        elif self._probe is None:
            self._probe = self._make_probe()
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
        first = self._service.removeprefix(f"{namespace_of(self._node)}/").split("/")[0]
        return f"nobody serves {self._service}: start {SERVES.get(first, first)}"

    def _answered(self) -> bool:
        return any(question.done() for question in self._questions)

    def _settle(self) -> None:
        for question in self._questions:
            self._probe.remove_pending_request(question)
        self._questions, self._asked, self._is_up = [], 0.0, True
        self._server_then = servers(self._node, self._service)

    def _make_probe(self):
        server = self._server()
        return (
            self._node.create_client(ListParameters, f"{server}/list_parameters")
            if server
            else None
        )

    def _server(self) -> str:
        """Full name of the node that serves, or an empty one.

        The endpoint that answers knows its node. Asking the nodes by name does not: of two with
        one name only the older is looked at, and a node that was killed or leaked hides the one
        that serves. So that is left to middlewares that name the topics of answers otherwise.
        """
        for info in self._node.get_publishers_info_by_topic(
            f"rr{self._service}Reply", no_mangle=True
        ):
            if info.node_name != UNKNOWN:
                return f"{info.node_namespace.rstrip('/')}/{info.node_name}"
        return self._server_by_name()

    def _server_by_name(self) -> str:
        for name, space in self._node.get_node_names_and_namespaces():
            try:
                services = self._node.get_service_names_and_types_by_node(name, space)
            # rclpy raises NodeNameNonExistentError for one that has just left
            except RuntimeError:
                continue
            if any(service == self._service for service, _ in services):
                return f"{space.rstrip('/')}/{name}"
        return ""
