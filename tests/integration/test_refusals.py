"""A node that gets what it cannot use goes on, counts it, and says so; what it was sent is not
lost. Nodes in this process, no graph.
"""

import importlib
import time
from contextlib import suppress
from pathlib import Path

import pytest
import rclpy
from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Execute
from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionClient, GoalResponse
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import Trigger

from dart_skill.recording import BagReader, LogTime
from dart_skill.recording.signals import INSISTING, LEAP_NS
from dart_skill_nodes.client.service_calls import ServiceCalls
from dart_skill_nodes.comms.coroutines import CoroutineActionServer, start
from dart_skill_nodes.comms.qos import CALLS
from dart_skill_nodes.comms.refusals import GuardedLifecycleNode, GuardedNode, Refusals
from dart_skill_nodes.executables.recorder import Recorder
from dart_skill_nodes.process.graph_processes import NODES
from dart_skill_nodes.process.node_base import OK, WARN, Diagnostics, make_executor
from dart_skill_nodes.process.parameters import declare
from tests.integration.conftest import until

GIGA = 1_000_000_000


@pytest.fixture
def spin(ros):
    """Spins nodes until a condition holds."""
    executor, nodes = make_executor(), []

    def spin(condition, *more):
        for node in set(more) - set(nodes):
            executor.add_node(node)
            nodes.append(node)
        until(condition, lambda: executor.spin_once(timeout_sec=0.05))

    yield spin
    executor.shutdown()
    for node in nodes:
        node.destroy_node()


def refuse(message):
    raise ValueError(f"'{message.data}' is nothing\nthat I know")


def test_every_one_of_many_calls_at_once_is_answered(spin):
    node, asking = GuardedNode("busy"), GuardedNode("asking")
    node.create_service(Trigger, "~/ask", lambda request, response: response)
    client = asking.create_client(Trigger, "/busy/ask")
    spin(client.service_is_ready, node, asking)
    answers = [client.call_async(Trigger.Request()) for _ in range(200)]
    spin(lambda: all(answer.done() for answer in answers))


def test_every_one_of_many_goals_at_once_is_answered(spin):
    """Half of fifty were not: an action server keeps ten requests unless it is told otherwise."""
    node, asking = GuardedNode("carries_out"), GuardedNode("sends")

    async def carry_out(handle):
        return Execute.Result()

    server = CoroutineActionServer(node, Execute, "/do", carry_out, lambda *_: None)
    server.register_goal_callback(lambda goal: GoalResponse.REJECT)
    client = ActionClient(asking, Execute, "/do", goal_service_qos_profile=CALLS)
    spin(client.server_is_ready, node, asking)
    sent = [client.send_goal_async(Execute.Goal()) for _ in range(200)]
    spin(lambda: all(one.done() for one in sent))


@pytest.mark.parametrize("turns", [False, True])
def test_a_server_that_answers_nothing_is_waited_for_no_longer_than_was_said(spin, turns):
    """A foreign server of plans held a goal for 20 s, where 5 s were promised."""
    asking, stuck, ended = GuardedNode("asking"), Node("stuck"), []
    stuck.create_service(Trigger, "~/plan", lambda request, response: time.sleep(0.0))
    client = asking.create_client(Trigger, "/stuck/plan")
    calls = ServiceCalls(asking)

    async def ask():
        await calls.call(client, Trigger.Request(), patience=1.0)

    begun = time.monotonic()
    start(asking, ask(), lambda _, error: ended.append(error))
    with suppress(TypeError):  # what the callback gives is no response
        spin(lambda: ended, asking, *([stuck] if turns else []))
    spin(lambda: ended, asking)
    stuck.destroy_node()
    assert "/stuck/plan" in str(ended[0]) and "stuck serves" in str(ended[0])
    assert time.monotonic() - begun < 10.0


def test_what_a_callback_refuses_is_counted_and_shown(spin):
    node, heard = GuardedNode("fussy"), []
    node.create_subscription(String, "/words", refuse, 10)
    node.create_service(Trigger, "~/fail", lambda request, response: 1 / 0)
    node.create_timer(0.01, lambda: heard.append(1) or [][0])
    words = node.create_publisher(String, "/words", 10)
    status = Diagnostics(node, lambda: (OK, "well", {}))
    status._publisher = type(
        "Kept", (), {"publish": lambda self, message: heard.append(message.status[0])}
    )()

    def refused():
        words.publish(String(data="xyzzy"))
        return node.refusals.counts["/words"] > 2 and sum(one == 1 for one in heard) > 2

    spin(refused, node)
    asked = node.create_client(Trigger, "~/fail").call_async(Trigger.Request())
    spin(asked.done)
    assert not asked.result().success and "ZeroDivisionError" in asked.result().message
    node.create_service(Trigger, "~/read", lambda request, response: Path("/nowhere").read_text())
    asked = node.create_client(Trigger, "~/read").call_async(Trigger.Request())
    spin(asked.done)
    assert asked.result().message == "/nowhere: No such file or directory"
    node.refusals.add("/words", ValueError("the last word"))
    heard.clear()
    status.publish()
    (said,) = (one for one in heard if one != 1)
    assert said.level == WARN and said.message == "well; refused on /words: the last word"
    assert int({pair.key: pair.value for pair in said.values}["/words refused"]) > 3


def test_a_service_refuses_with_the_reason_that_is_raised_and_succeeds_where_nothing_is(spin):
    node, reasons = GuardedNode("fussy"), [ValueError("too far"), OSError("no file"), None]

    def answer(request, response):
        if (reason := reasons.pop(0)) is not None:
            raise reason

    node.create_service(Trigger, "~/ask", answer)
    client, said = node.create_client(Trigger, "~/ask"), []
    for _ in range(len(reasons)):
        asked = client.call_async(Trigger.Request())
        spin(asked.done, node)
        said.append((asked.result().success, asked.result().message))
    assert said == [(False, "too far"), (False, "no file"), (True, "")]
    assert not node.refusals.counts, "a refusal is no fault of the node"


def test_a_parameter_that_is_no_number_is_refused(ros):
    node = GuardedNode("numbers")
    declare(node, "wam_simulator")
    (result,) = node.set_parameters([Parameter("mass_scale", value=[float("nan")] * 7)])
    assert not result.successful and "give finite numbers" in result.reason
    node.destroy_node()


def test_every_node_of_the_package_survives_what_it_is_sent():
    for name in ("recorder", "viewer", "bag_player", "effort_bridge", *NODES):
        module = importlib.import_module(f"dart_skill_nodes.executables.{name}")
        own = [
            one
            for one in vars(module).values()
            if isinstance(one, type) and one.__module__ == module.__name__
        ]
        nodes = [one for one in own if issubclass(one, Node)]
        assert nodes and all(
            issubclass(one, GuardedNode | GuardedLifecycleNode) for one in nodes
        ), name


def test_a_stream_of_bad_messages_is_no_stream_of_lines():
    lines = []
    refusals = Refusals(lines.append)
    for k in range(1000):
        assert not refusals.accepts("/words", int, f"word {k}")
    assert len(lines) == 1 and "word 0" in lines[0] and refusals.counts == {"/words": 1000}
    assert refusals.accepts("/words", int, "7") and "word 999" in refusals.recent


def test_an_error_that_is_no_refusal_says_where_it_came_from():
    refusals = Refusals(lambda text: None)
    refusals.accepts("/words", lambda: {}["x"])
    assert "KeyError at test_refusals.py:" in refusals.recent


def test_a_recorder_keeps_what_cannot_be_read_and_goes_on(spin, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where its bag goes
    sender = rclpy.create_node("sender")
    poses = sender.create_publisher(PoseStamped, "/odd/pose", 10)
    clock = sender.create_publisher(Clock, "/clock", 10)
    garbled = sender.create_publisher(PoseStamped, "/odd/bytes", 10)
    recorder = Recorder()
    spin(
        lambda: all(one.get_subscription_count() for one in (poses, clock, garbled)),
        sender,
        recorder,
    )
    early = PoseStamped()
    early.header.frame_id, early.header.stamp.sec = "world", -1
    poses.publish(early)
    poses.publish(PoseStamped())
    clock.publish(Clock(clock=Time(sec=-5)))
    garbled.publish(b"\x00\x01\x00\x00")
    garbled.publish(b"\x00\x01\x00\x00" + b"\xff" * 30)
    expected = {"/odd/pose": 2, "/clock": 1, "/odd/bytes": 2}
    spin(
        lambda: (
            {topic: recorder._bag.writer.counts.get(topic, 0) for topic in expected} == expected
        )
    )
    path = recorder._bag.writer.path
    recorder._close()
    with BagReader(path) as bag:
        assert {topic: bag.topics[topic].count for topic in expected} == expected
        assert len(list(bag.messages(expected, decode=False))) == 5


def test_a_stray_stamp_does_not_carry_the_log_away():
    log = LogTime()
    log.take("/a", 5 * GIGA)
    with pytest.raises(ValueError, match="7200 s after everything else"):
        log.take("/a", 7205 * GIGA)
    log.take("/b", 6 * GIGA)
    assert log.now_ns == 6 * GIGA


def test_a_clock_that_was_set_is_believed_when_others_say_so_or_it_insists():
    log = LogTime()
    log.take("/a", GIGA)
    with pytest.raises(ValueError):
        log.take("/a", 2 * LEAP_NS)
    log.take("/b", 2 * LEAP_NS + GIGA)
    assert log.now_ns == 2 * LEAP_NS + GIGA
    for k in range(INSISTING - 1):
        with pytest.raises(ValueError):
            log.take("/a", 4 * LEAP_NS + k)
    log.take("/a", 4 * LEAP_NS + INSISTING)
    assert log.now_ns == 4 * LEAP_NS + INSISTING
