"""The real nodes as processes over real DDS, on a ROS domain of this test run's own
(tests/conftest.py).
"""

import time
from contextlib import contextmanager

import numpy as np
import pytest
import rclpy
from dart_skill_msgs.msg import WamCommand
from dart_skill_msgs.srv import Plan
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from dart_skill_nodes.client.graph_client import GraphClient
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import LOOP
from dart_skill_nodes.process.graph_processes import NODES, Graph

RUNNING = []
"""Folders of the graphs that are there now, with their logs."""


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    """A failed test shows what its nodes said."""
    report = (yield).get_result()
    if report.failed:
        folders = {*RUNNING, *([item.funcargs["tmp_path"]] if "tmp_path" in item.funcargs else [])}
        for log in sorted({log for folder in folders for log in folder.rglob("*.log")}):
            report.sections.append(
                (f"end of {log.name}", log.read_text(encoding="utf-8", errors="replace")[-2000:])
            )


@pytest.fixture(scope="module")
def ros():
    rclpy.init()
    yield
    rclpy.try_shutdown()


@contextmanager
def graphs(folder):
    """A function that starts layouts of the graph with a client for each; everything is ended
    afterwards.

    The demonstrations of the n-th are recorded to `bag_n` in the folder. Two that are there at
    once must have no node in common.
    """
    started = []

    def make(layout="composed", seed=0, extra=None, remappings=None, skill="", namespace=""):
        graph = Graph(folder / f"logs_{len(started)}", remappings or {}, namespace=namespace)
        name = f"coach_{len(started)}"
        # a busy machine starts nodes slowly
        client = GraphClient(graph.dead, name, appears=60.0, namespace=namespace)
        started.append((graph, client))
        if layout is not None:
            graph.start_all(layout, seed, folder / f"bag_{len(started)}", extra, skill)
            client.wait_until_ready()
        return graph, client

    RUNNING.append(folder)
    try:
        yield make
    finally:
        for graph, client in started:
            client.close()
            graph.stop()
        RUNNING.remove(folder)


@pytest.fixture
def make_graph(ros, tmp_path):
    """Starts layouts of the graph for one test."""
    with graphs(tmp_path) as make:
        yield make


@pytest.fixture(scope="module")
def make_shared_graph(ros, tmp_path_factory):
    """Starts layouts of the graph for all tests of a module: each leaves it as it found it, and
    none starts one of its own meanwhile.
    """
    with graphs(tmp_path_factory.mktemp("shared")) as make:
        yield make


def teach_and_learn(client, targets):
    """One lesson for each target (n, 3), and a model of all."""
    for target in targets:
        lesson = client.teach(target)
        assert lesson.success, lesson.message
    return client.learn()


def processes_of(node):
    """DDS topics that each process of the graph publishes, those that it subscribes to, and
    namespace and name of each of its nodes.

    Topics of hidden nodes are among them. Namespaces are as Graph has them: "", "/arm1". The
    process of the tests is left out: other tests may have made nodes of any names in it. One that
    was killed is there until the middleware forgets it.
    """
    ends, own = {}, (node.get_namespace().rstrip("/"), node.get_name())
    for topic, _ in node.get_topic_names_and_types(no_demangle=True):
        for k, look in enumerate(
            (node.get_publishers_info_by_topic, node.get_subscriptions_info_by_topic)
        ):
            for end in look(topic, no_mangle=True):
                process = ends.setdefault(bytes(end.endpoint_gid)[:12], (set(), set(), set()))
                process[k].add(topic)
                process[2].add((end.node_namespace.rstrip("/"), end.node_name))
    return [one for one in ends.values() if own not in one[2]]


def endpoints_of_processes(node, alone=False):
    """By namespace and name of each of our nodes, the topics of its process: published, and
    subscribed to.

    alone: of processes with one of our nodes only, which are those of this graph where other tests
    have left several nodes in one process.
    """
    found = {}
    for publishes, hears, nodes in processes_of(node):
        own = [one for one in nodes if one[1] in NODES]
        if len(own) == 1 or not alone:
            found |= dict.fromkeys(own, (publishes, hears))
    return found


def plan_request(target):
    """What the learner is asked for a plan with."""
    return Plan.Request(header=Header(frame_id="world"), situation=conversions.at_place(target))


class Diagnoses:
    """The last message, and the last values, of every node on /diagnostics."""

    def __init__(self, client):
        self.of, self.values = {}, {}
        client.node.create_subscription(DiagnosticArray, "/diagnostics", self._take, 50)

    def _take(self, message):
        self.of.update({status.name: status.message for status in message.status})
        self.values.update(
            {
                status.name: {pair.key: pair.value for pair in status.values}
                for status in message.status
            }
        )


def until(condition, turn=lambda: time.sleep(0.02), what="the condition", limit=60.0):
    """Call `turn` until the condition holds; the test fails with its name when it never does. what:
    in words, or a function that has them then.
    """
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, (
            f"{what() if callable(what) else what} did not come true in {limit:.0f} s"
        )
        turn()


def wait_for(client, condition, limit=60.0, what="the condition"):
    """The same, and a client lets messages come in meanwhile."""
    until(condition, client.spin, what, limit)


def catch_up(client, seconds=0.05):
    """Spin for a while: each call of spin takes one message, and more may have come meanwhile."""
    end = time.monotonic() + seconds
    until(lambda: time.monotonic() > end, client.spin)


def wait_for_end(graph, client, executable):
    """The process of an executable, when it has ended by itself."""
    process = graph.processes.pop(executable)
    wait_for(client, lambda: process.poll() is not None, what=f"the end of {executable}")
    return process


class Joints:
    """The newest joint state."""

    def __init__(self, client):
        self.message, self.count = None, 0
        client.node.create_subscription(JointState, "/joint_states", self._take, LOOP)

    def _take(self, message):
        self.message, self.count = message, self.count + 1

    @property
    def newest_ns(self):
        return conversions.stamp_ns(self.message.header.stamp)

    @property
    def fastest(self):
        return np.abs(self.message.velocity).max()


def answer(state, command, frame="world", **fields):
    """Publish a command for the newest state, as the commander does."""
    message = WamCommand(**fields)
    message.header.stamp, message.header.frame_id = state.message.header.stamp, frame
    command.publish(message)


def start_throw(client, target):
    """Future of the result of a throw that has begun, and the goal's handle."""
    handle = client.begin(conversions.at_place(target)).handle
    return handle.get_result_async(), handle


def begin_slow_throw(client, joints, target, speed_factor=0.4):
    """A throw that is under way, with time to interfere: the arm moves. Future of its result, and
    the goal's handle.
    """
    client.set_parameters("/wam_simulator", {"speed_factor": speed_factor})
    result, handle = start_throw(client, target)

    def moves():
        assert not result.done(), result.result().result.message
        return joints.message is not None and joints.fastest > 0.3

    wait_for(client, moves, what="the arm moves")
    return result, handle
