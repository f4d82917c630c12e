"""The managed nodes that record: cleaned up and configured again in one process, each time with a
bag of their own.
"""

import gc

import pytest
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from dart_skill.common.permissions import LIFE_CYCLE, PARAMETERS
from dart_skill.common.world import joint_names
from dart_skill.recording import BagReader
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.executables.demonstration_recorder import DemonstrationRecorder
from dart_skill_nodes.executables.mock_optitrack import MockOptitrack
from dart_skill_nodes.executables.recorder import Recorder
from dart_skill_nodes.process.node_base import make_executor
from tests.integration.conftest import until

TOPIC = "/joint_states"
DONE = TransitionCallbackReturn.SUCCESS
FIRST = {"recorder": "recording", "demonstration_recorder": "demonstrations"}
"""How bags begin that nobody has given a name."""


class Speaker:
    """An arm that says where it is all the time, with a node of its own that is spun together with
    another.
    """

    def __init__(self, rclpy, other):
        self.node = rclpy.create_node(f"speaker_beside_{other.get_name()}")
        self._publisher, self._executor, self._said = (
            self.node.create_publisher(JointState, TOPIC, 10),
            make_executor(),
            0,
        )
        self._executor.add_node(other)
        self._executor.add_node(self.node)

    def until(self, condition, what):
        until(condition, self._turn, what)

    def _turn(self):
        self._said += 1
        state = JointState(name=list(joint_names()), position=[0.0] * 7, velocity=[0.0] * 7)
        state.header.stamp = conversions.time_msg(10_000_000 * self._said)
        self._publisher.publish(state)
        self._executor.spin_once(timeout_sec=0.01)

    def close(self):
        self._executor.shutdown()
        self.node.destroy_node()


def leave(rclpy, name):
    """Wait until no node of a name is on the graph: one that was killed stays there for a while,
    and would be asked for the new one.
    """
    node = rclpy.create_node("waits")
    gc.collect()
    until(lambda: name not in node.get_node_names(), what=f"that there is no {name}")
    node.destroy_node()


@pytest.fixture
def speaker_for(ros, tmp_path, monkeypatch):
    """Makes the node in an empty working directory, where its bags go, and a speaker beside it."""
    import rclpy

    monkeypatch.chdir(tmp_path)
    made = []

    def make(node_class, name):
        leave(rclpy, name)
        node = node_class()
        made.append((node, Speaker(rclpy, node)))
        return made[-1]

    yield make
    while made:
        node, speaker = made.pop()
        speaker.close()
        node.destroy_node()
    # A managed node is in a cycle with its own services and stays on the graph until that is
    # collected.
    del node, speaker
    gc.collect()


@pytest.mark.parametrize(
    ("node_class", "name"),
    [(Recorder, "recorder"), (DemonstrationRecorder, "demonstration_recorder")],
)
def test_a_recorder_that_was_cleaned_up_begins_another_bag(
    speaker_for, tmp_path, node_class, name
):
    node, speaker = speaker_for(node_class, name)

    def writes():
        return node._bag is not None and node._bag.writer.counts.get(TOPIC, 0) > 0

    def offered():
        return sorted(speaker.node.get_service_names_and_types_by_node(node.get_name(), "/"))

    def told():
        return len(speaker.node.get_publishers_info_by_topic("/diagnostics"))

    # they are discovered one after the other
    own = {f"/{node.get_name()}/{service}" for service in (*PARAMETERS, *LIFE_CYCLE)}
    speaker.until(lambda: own <= {name for name, _ in offered()}, "the services of the node")
    speaker.until(lambda: writes() and told() == 1, "a bag that is written to")
    before = offered()
    (refused,) = node.set_parameters([Parameter("bag", value="mine")])
    assert not refused.successful and "clean it up" in refused.reason
    assert node.trigger_deactivate() == node.trigger_cleanup() == DONE
    (taken,) = node.set_parameters([Parameter("bag", value="mine")])
    assert taken.successful, taken.reason
    (tmp_path / "mine").mkdir()
    assert node.trigger_configure() == node.trigger_activate() == DONE
    speaker.until(writes, "messages in the second bag")
    speaker.until(
        lambda: told() == 1 and offered() == before, "the same services and publishers as before"
    )
    assert node.trigger_deactivate() == node.trigger_cleanup() == DONE
    (tmp_path / "mine").rmdir()
    bags = sorted(tmp_path.iterdir())
    assert {bag.name.split("_20")[0] for bag in bags} == {FIRST[name], "mine_2"}
    for bag in bags:
        with BagReader(bag) as read:
            assert read.topics[TOPIC].count > 0


CANNOT_BE = {
    "cameras.c01.position": ([1.0], "length 3"),
    "cameras.c01.look_at": ([float("nan")] * 3, "holds nan"),
    "seed": (-5, "seed"),
}


def test_cameras_that_cannot_be_are_refused(speaker_for):
    node, _ = speaker_for(MockOptitrack, "mock_optitrack")
    assert node.trigger_deactivate() == node.trigger_cleanup() == DONE
    for name, (value, said) in CANNOT_BE.items():
        (refused,) = node.set_parameters([Parameter(name, value=value)])
        assert not refused.successful and said in refused.reason, refused.reason
        assert node.describe_parameter(name).description
    assert node.trigger_configure() == DONE
