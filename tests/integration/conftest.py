"""The real nodes as processes over real DDS, on a ROS domain of this test run's own (tests/conftest.py)."""

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray

from dart_skill_nodes.client.graph_client import GraphClient
from dart_skill_nodes.process.graph_processes import Graph


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    """A failed test shows what its nodes said."""
    report = (yield).get_result()
    if report.failed and "tmp_path" in item.funcargs:
        for log in sorted(item.funcargs["tmp_path"].rglob("*.log")):
            report.sections.append((f"end of {log.name}", log.read_text(encoding="utf-8", errors="replace")[-2000:]))


@pytest.fixture(scope="module")
def ros():
    rclpy.init()
    yield
    rclpy.try_shutdown()


@pytest.fixture
def make_graph(ros, tmp_path):
    """Starts layouts of the graph with a coach for each; everything is ended after the test."""
    started = []

    def make(layout="composed", seed=0, extra=None):
        graph = Graph(tmp_path / f"logs_{len(started)}")
        client = GraphClient(graph.dead, name=f"coach_{len(started)}")
        started.append((graph, client))
        if layout is not None:
            graph.start_all(layout, seed, tmp_path / f"bag_{len(started)}", extra)
            client.wait_until_ready()
        return graph, client

    yield make
    for graph, client in started:
        client.close()
        graph.stop()


class Diagnoses:
    """The last message, and the last values, of every node on /diagnostics."""

    def __init__(self, client):
        self.of, self.values = {}, {}
        client.node.create_subscription(DiagnosticArray, "/diagnostics", self._take, 50)

    def _take(self, message):
        self.of.update({status.name: status.message for status in message.status})
        self.values.update({status.name: {pair.key: pair.value for pair in status.values} for status in message.status})


def wait_for(client, condition, limit=60.0, what="the condition"):
    """Spin until the condition holds; the test fails with its name when it never does."""
    import time

    until = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < until, f"{what} did not come true in {limit:.0f} s"
        client.spin()
