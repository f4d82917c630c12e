"""Links between nodes: whoever serves is asked, whatever else is on the graph."""

from types import SimpleNamespace

import pytest
import rclpy
from dart_skill_msgs.action import Practice
from rclpy.action import ActionServer
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger

from dart_skill_nodes.client.graph_client import GraphClient
from dart_skill_nodes.client.service_calls import APPEARS, FOUND_DEAD, PATIENCE, ServerProbe
from tests.integration.conftest import until


class Process:
    """A node in a context of its own, which other nodes see as another process."""

    def __init__(self, name, **options):
        self._context = Context()
        rclpy.init(context=self._context)
        self.node = rclpy.create_node(name, context=self._context, **options)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)

    def spin(self):
        self._executor.spin_once(timeout_sec=0.01)

    def close(self):
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()


@pytest.fixture
def process():
    made = []

    def make(name, **options):
        made.append(Process(name, **options))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_a_node_that_serves_nothing_does_not_hide_the_one_of_its_name_that_does(process):
    """As a killed or a leaked node does for a while. The older of two is all that ROS looks at
    when it is asked for a node by its name.
    """
    ghost = process("served", start_parameter_services=False, enable_rosout=False)
    asking = process("asking")
    until(lambda: "served" in asking.node.get_node_names(), lambda: (ghost.spin(), asking.spin()))
    served = process("served")
    served.node.create_service(Trigger, "/asked", lambda request, response: response)
    client = asking.node.create_client(Trigger, "/asked")
    link = ServerProbe(asking.node, "/asked", client.service_is_ready)
    until(link.up, lambda: (ghost.spin(), asking.spin(), served.spin()))
    assert asking.node.get_node_names().count("served") == 2


def test_a_younger_client_gets_a_link_of_its_own(ros, process, monkeypatch):
    """What an older one learned says nothing of whether the server has found the younger: its
    first answer would be lost.
    """
    made = []

    class Watched(ServerProbe):
        def __init__(self, node, service, is_ready):
            super().__init__(node, service, is_ready)
            made.append(sorted(client.srv_name for client in node.clients))

    monkeypatch.setattr("dart_skill_nodes.client.service_calls.ServerProbe", Watched)
    served = process("served")
    served.node.create_service(
        Trigger, "/asked", lambda request, response: Trigger.Response(success=True)
    )
    asking = GraphClient(dead=lambda: served.spin() or "")
    for clients in (1, 2):
        client = asking.node.create_client(Trigger, "/asked")
        assert asking.call(client, Trigger.Request()).success
        assert asking.call(client, Trigger.Request()).success
        assert [names.count("/asked") for names in made] == list(range(1, clients + 1))
    asking.close()


def test_what_is_asked_waits_until_the_client_has_found_its_server(ros, process, monkeypatch):
    """On a busy machine a server's parameters may be found, and answer, before its other services:
    a request to those goes to nobody.
    """
    served = process("served")
    served.node.create_service(
        Trigger, "/asked", lambda request, response: Trigger.Response(success=True)
    )
    server = ActionServer(
        served.node,
        Practice,
        "/practice",
        lambda handle: handle.succeed() or Practice.Result(success=True),
    )
    asking = GraphClient(dead=lambda: served.spin() or "")
    client = asking.node.create_client(Trigger, "/asked")
    for found, ask in (
        (client, lambda: asking.call(client, Trigger.Request())),
        (asking.practice_action, lambda: asking.practise(throws=1)),
    ):
        name = "service_is_ready" if found is client else "server_is_ready"
        asked, is_ready = [], getattr(found, name)
        monkeypatch.setattr(
            found,
            name,
            lambda asked=asked, is_ready=is_ready: (
                asked.append(is_ready()) or (asked[-1] and len(asked) > 20)
            ),
        )
        assert ask().success
        assert len(asked) > 20
    server.destroy()
    asking.close()


class Endpoints:
    """Of servers: how many are on the graph, and whether all are dead."""

    def __init__(self, count, gone):
        self.count, self.gone = count, gone

    def __bool__(self):
        return self.count > 0


@pytest.mark.parametrize(
    "there, is_ready, waits",
    [
        (Endpoints(0, False), False, APPEARS),
        (Endpoints(1, True), True, FOUND_DEAD * APPEARS),
        (Endpoints(1, False), True, PATIENCE),
    ],
)
def test_after_a_server_that_died_before_it_was_asked_another_one_is_waited_for_more_briefly(
    monkeypatch, there, is_ready, waits
):
    monkeypatch.setattr(
        "dart_skill_nodes.client.service_calls.servers", lambda node, service: there
    )
    node = SimpleNamespace(resolve_service_name=lambda name: name)
    link = ServerProbe(node, "/asked", lambda: is_ready)
    assert not link.is_hopeless(0.9 * waits) and link.is_hopeless(1.1 * waits)
