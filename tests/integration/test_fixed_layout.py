"""Messages that are read and written as bytes are those that rclpy reads and writes."""

import numpy as np
import pytest
from dart_skill_msgs.msg import BodyState, SimulationState, WamCommand
from geometry_msgs.msg import PoseStamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, Int64, String

from dart_skill.common.constants import NS_PER_S
from dart_skill_nodes.comms.conversions import EPISODE_AND_STEP, ground_truth, leading_stamp_bytes
from dart_skill_nodes.comms.fixed_layout import FixedLayout, LayoutReader

NAMES = st.text(st.characters(min_codepoint=32, max_codepoint=0x24F), max_size=12)
FLOATS = st.floats(allow_nan=True, allow_infinity=True)
STAMPS = st.integers(0, 2**31 * NS_PER_S - 1)


def of(sizes, names, frame_id):
    message = JointState(name=names)
    message.header.frame_id = frame_id
    message.position, message.velocity, message.effort = ([0.0] * size for size in sizes)
    return message


@given(st.tuples(*[st.integers(0, 9)] * 3), st.lists(NAMES, max_size=8), NAMES, STAMPS, st.data())
def test_joint_states_of_any_shape_and_names(sizes, names, frame_id, ns, data):
    layout = FixedLayout(of(sizes, names, frame_id))
    values = np.array(data.draw(st.lists(FLOATS, min_size=sum(sizes), max_size=sum(sizes))))
    written = layout.pack(ns, values)
    message = deserialize_message(written, JointState)
    assert message.header.stamp.sec * NS_PER_S + message.header.stamp.nanosec == ns
    assert (message.name, message.header.frame_id) == (names, frame_id)
    np.testing.assert_array_equal([*message.position, *message.velocity, *message.effort], values)
    reader = LayoutReader(JointState)
    for _ in range(2):  # decoded whole, then by its layout
        like, stamp_ns, numbers = reader.read(serialize_message(message))
        assert (like.name, like.header.frame_id, stamp_ns) == (names, frame_id, ns)
        np.testing.assert_array_equal(numbers, values)
    assert len(reader._layouts) == 1


@pytest.mark.parametrize("grip", (0, 1, 2))
def test_commands(grip):
    example = WamCommand(joint_torque=[0.0] * 7, grip=grip, speed=1, sender=2**32 - 1)
    example.header.frame_id = "arm"
    values = np.random.default_rng(0).standard_normal(13)
    message = deserialize_message(FixedLayout(example).pack(5, values), WamCommand)
    assert (message.grip, message.speed, message.sender, message.header.frame_id) == (
        grip,
        1,
        2**32 - 1,
        "arm",
    )
    wrench = message.wrench
    numbers = [
        wrench.force.x,
        wrench.force.y,
        wrench.force.z,
        wrench.torque.x,
        wrench.torque.y,
        wrench.torque.z,
        *message.joint_torque,
    ]
    np.testing.assert_array_equal(numbers, values)


def test_a_layout_that_changes_is_another_one():
    reader, example = LayoutReader(WamCommand), WamCommand(sender=1)
    for sender, grip in [(1, 0), (1, 2), (7, 0), (1, 0), (7, 0)]:
        example.sender, example.grip = sender, grip
        like, _, _ = reader.read(serialize_message(example))
        assert (like.sender, like.grip) == (sender, grip)
    assert len(reader._layouts) == 3


def test_no_more_layouts_are_remembered_than_a_few():
    reader = LayoutReader(WamCommand)
    for sender in range(100):
        assert reader.read(serialize_message(WamCommand(sender=sender)))[0].sender == sender
    assert len(reader._layouts) == 8


def test_what_lies_between_the_fields_does_not_count():
    # 6 bytes of name, so that two lie between
    example = PoseStamped(header=Header(frame_id="world"))
    layout, written = FixedLayout(example), bytearray(FixedLayout(example).pack(1, np.arange(7.0)))
    written[22:28] = b"\xff" * 6
    assert layout.fits(bytes(written))
    written[16] ^= 1
    assert not layout.fits(bytes(written)), "it is in another frame"


def truth_of(*bodies):
    nothing = [0.0] * 7
    return SimulationState(
        joint_position=nothing,
        joint_velocity=nothing,
        joint_effort=nothing,
        held="ball",
        bodies=[BodyState(name=name) for name in bodies],
    )


def test_all_that_stands_in_nested_messages():
    example = truth_of("hand", "ball")
    layout = FixedLayout(example)
    message = deserialize_message(layout.pack(0, np.arange(float(layout.count))), SimulationState)
    assert list(message.joint_velocity) == list(np.arange(7.0, 14.0))
    assert (
        message.bodies[1].twist.angular.z == layout.count - 2
        and message.base_turn == layout.count - 1
    )


def test_bytes_that_are_no_such_message_are_refused():
    reader = LayoutReader(JointState)
    good = serialize_message(of((7, 7, 7), list("abcdefg"), "world"))
    reader.read(good)
    for bad in (b"", good[:7], good[:40], good[:-60]):
        with pytest.raises(ValueError, match="no JointState"):
            reader.read(bad)
    with pytest.raises(ValueError, match="stamps are not negative"):
        reader.read(good[:4] + b"\xff" * 8 + good[12:])


def test_fields_that_are_not_known_are_named():
    with pytest.raises(ValueError, match="int64"):
        FixedLayout(Int64())
    with pytest.raises(AttributeError):
        LayoutReader(String).read(serialize_message(String()))


def test_a_stamp_alone():
    from rosgraph_msgs.msg import Clock

    clock = deserialize_message(leading_stamp_bytes(12 * NS_PER_S + 34), Clock).clock
    assert (clock.sec, clock.nanosec) == (12, 34)


def test_counters_are_no_part_of_a_layout():
    example = truth_of("hand")
    layout, reader = (
        FixedLayout(example, EPISODE_AND_STEP),
        LayoutReader(SimulationState, EPISODE_AND_STEP),
    )
    for step in (3, 2**32 - 1):
        data = layout.pack(9, np.arange(float(layout.count)), 2, step)
        message = deserialize_message(data, SimulationState)
        assert (message.episode, message.step) == (2, step)
        for _ in range(2):
            truth = ground_truth(*reader.read_all(data))
            assert (truth.stamp_ns, truth.episode, truth.step, truth.base_turn) == (
                9,
                2,
                step,
                layout.count - 1,
            )
            assert list(truth.bodies["hand"][1]) == [24.0, 25.0, 26.0, 27.0] and list(
                truth.joint_position
            ) == list(range(7))
    assert len(reader._layouts) == 1
