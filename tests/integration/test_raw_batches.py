"""What is taken out of the middleware in batches: losses are those of one publisher, and what
cannot be heard is named.
"""

import pytest
import rclpy
from rclpy.node import Node
from std_msgs.msg import Int32, String

from dart_skill_nodes.comms.raw_batches import Numbering, RawBatches
from tests.integration.conftest import until

ONE, TWO = frozenset({b"a"}), frozenset({b"a", b"b"})


@pytest.fixture
def node(ros):
    """A node that is spun by `spin`."""
    node = rclpy.create_node("ears")
    yield node
    node.destroy_node()


def spin(node: Node, condition, what):
    until(condition, lambda: rclpy.spin_once(node, timeout_sec=0.01), what)


def test_gaps_in_the_numbers_of_one_publisher_are_losses():
    numbering = Numbering(publishers=ONE)
    numbering.count([5, 6, 9], publishers=1)
    assert numbering.lost == 0, "not before it is known that nobody else joined"
    numbering.look(ONE)
    numbering.count([12, 1, 2], publishers=1)  # started again
    numbering.look(ONE)
    assert numbering.lost == 4


def test_the_numbers_of_several_publishers_are_no_losses():
    numbering = Numbering(publishers=ONE)
    for numbers, there, seen in (
        ([500, 501, 7, 502, 8], 1, TWO),  # one has joined, unseen as yet
        ([503, 9, 700], 2, TWO),
        ([701, 10], 1, ONE),  # and left
        ([702, 703], 1, ONE),
        ([704, 900, 705], 2, ONE),  # joined and left between two looks
        ([706, 708], 1, ONE),
    ):
        numbering.count(numbers, there)
        numbering.look(seen)
    assert numbering.lost == 1, "of the last numbers alone"


def test_a_publisher_that_joins_and_leaves_makes_no_loss(node):
    ears, heard = RawBatches(node), []
    ears.listen("/said")
    first = node.create_publisher(String, "/said", 100)

    def say(*publishers):
        for publisher in publishers:
            publisher.publish(String(data="x"))
        heard.extend(ears.take())

    def said_by(count, *publishers):
        return lambda: (
            say(*publishers) or node.count_publishers("/said") == count and len(heard) > 20
        )

    spin(node, said_by(1, first), "one that is heard")
    second = node.create_publisher(String, "/said", 100)
    for publishers in ((first, second), (second,), (first, second)):
        heard.clear()
        spin(node, said_by(2, *publishers), "two that are heard")
    node.destroy_publisher(second)
    heard.clear()
    spin(node, said_by(1, first), "one alone")
    ears.close()
    assert ears.lost == {} and ears.strange == {}


@pytest.fixture
def stranger():
    """A node as of another process: within one, a topic has one type."""
    context = rclpy.Context()
    rclpy.init(context=context)
    yield rclpy.create_node("stranger", context=context)
    rclpy.try_shutdown(context=context)


def test_a_topic_that_changes_its_type_is_named(node, stranger):
    ears = RawBatches(node)
    ears.listen("/said")
    text = node.create_publisher(String, "/said", 10)
    spin(node, lambda: not ears.missing, "the text")
    node.destroy_publisher(text)
    stranger.create_publisher(Int32, "/said", 10)
    spin(node, lambda: ears.strange, "the number")
    assert ears.strange == {
        "/said": (
            "stranger publishes /said as std_msgs/msg/Int32, which is not the std_msgs/msg/String"
            " that is heard"
        )
    }
    ears.close()
