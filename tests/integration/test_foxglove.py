"""A graph live in Foxglove: what a node publishes over DDS comes out of the server, byte for byte."""

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("foxglove")

import rclpy  # noqa: E402
from geometry_msgs.msg import PoseStamped  # noqa: E402
from rclpy.serialization import deserialize_message  # noqa: E402
from std_msgs.msg import String  # noqa: E402

from dart_skill.view import FoxgloveServer  # noqa: E402
from dart_skill_nodes.comms.qos import LATCHED  # noqa: E402
from dart_skill_nodes.process.node_base import make_executor  # noqa: E402
from dart_skill_nodes.verbs.foxglove import GraphView  # noqa: E402
from tests.foxglove_client import FoxgloveClient  # noqa: E402


@pytest.fixture
def node():
    rclpy.init()
    node = rclpy.create_node("somebody")
    yield node
    node.destroy_node()
    rclpy.shutdown()


def test_what_is_published_is_shown_and_what_is_latched_comes_to_who_is_late(node):
    poses, once = (
        node.create_publisher(PoseStamped, "/somewhere/pose", 10),
        node.create_publisher(String, "/once", LATCHED),
    )
    node.create_publisher(String, "/somewhere/_action/feedback", 10)
    once.publish(String(data="said once"))
    pose = PoseStamped()
    pose.pose.position.x, pose.header.frame_id = 1.25, "world"
    listener, executor = rclpy.create_node("listener"), make_executor()
    executor.add_node(listener)
    try:
        with FoxgloveServer(0) as server:
            view = GraphView(listener, server)

            def turn():
                poses.publish(pose)
                executor.spin_once(timeout_sec=0.01)
                view.hand_on()

            with FoxgloveClient(server.url) as waits:
                waits.hear_until(
                    lambda: {"/somewhere/pose", "/once"} <= set(waits.channels), meanwhile=turn
                )
            with FoxgloveClient(server.url) as client:
                client.hear_until(
                    lambda: {"/somewhere/pose", "/once"} <= set(client.channels), meanwhile=turn
                )
                client.ask_for("/somewhere/pose")
                client.ask_for("/once")
                client.hear_until(
                    lambda: (
                        {topic for topic, _ in client.messages} == {"/somewhere/pose", "/once"}
                    ),
                    meanwhile=turn,
                )
            assert not view.refused and not [topic for topic in client.channels if "/_" in topic]
            view.close()
    finally:
        executor.shutdown()
        listener.destroy_node()
    heard = dict(client.messages)
    assert deserialize_message(heard["/somewhere/pose"], PoseStamped) == pose
    assert deserialize_message(heard["/once"], String).data == "said once"
