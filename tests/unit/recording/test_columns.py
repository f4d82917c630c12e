"""Numbers of many messages at once, against each message read by rosbags; what cannot be taken so
is said.
"""

from itertools import product
from pathlib import Path

import numpy as np
import pytest
import scipy.ndimage
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from dart_skill.recording.bags import (
    columns_by_layout,
    deserialize,
    header_content,
    pose_content,
    serialize,
    typestore,
)
from dart_skill.recording.imports.pose_faults import usual_steps
from dart_skill.recording.signals import read_command, read_commands

TYPES = typestore()
RNG = np.random.default_rng(0)
COMMAND = "dart_skill_msgs/msg/WamCommand"
POSE, STATE, ODOMETRY = (
    "geometry_msgs/msg/PoseStamped",
    "sensor_msgs/msg/JointState",
    "nav_msgs/msg/Odometry",
)


def pose(stamp_ns, frame="world"):
    return serialize(
        TYPES,
        POSE,
        {
            "header": header_content(stamp_ns, frame),
            "pose": pose_content(RNG.normal(size=3), RNG.normal(size=4)),
        },
    )


def state(stamp_ns, names=("a", "bc", "def"), velocities=3, efforts=0):
    content = {
        "position": RNG.normal(size=3),
        "velocity": RNG.normal(size=velocities),
        "effort": RNG.normal(size=efforts),
    }
    return serialize(
        TYPES, STATE, {"header": header_content(stamp_ns, "base"), "name": list(names), **content}
    )


def numbers_of(message):
    """All float64 of a message, field by field."""
    found = []
    for name in message.__dataclass_fields__:
        value = getattr(message, name)
        if isinstance(value, float):
            found.append(value)
        elif isinstance(value, np.ndarray) and value.dtype == np.float64:
            found += value.tolist()
        elif hasattr(value, "__dataclass_fields__"):
            found += numbers_of(value)
    return found


def odometry(stamp_ns):
    covariance = {"covariance": RNG.normal(size=36)}
    content = {
        "pose": {"pose": pose_content(RNG.normal(size=3), RNG.normal(size=4)), **covariance},
        "twist": covariance,
    }
    return serialize(
        TYPES,
        ODOMETRY,
        {"header": header_content(stamp_ns, "odom"), "child_frame_id": "hand", **content},
    )


@pytest.mark.parametrize(
    ("type_name", "make"),
    [
        (POSE, pose),
        (POSE, lambda stamp: pose(stamp, "a frame of another length")),
        (STATE, state),
        (STATE, lambda stamp: state(stamp, velocities=0)),
        (STATE, lambda stamp: state(stamp, efforts=3)),
        (ODOMETRY, odometry),
    ],
)
def test_numbers_and_stamps_are_those_of_the_messages(type_name, make):
    stamps = [0, 1, 999_999_999, 1_000_000_000, 1_732_500_000_123_456_789, -1_500_000_000]
    payloads = [make(stamp) for stamp in stamps]
    (found,), left = columns_by_layout(TYPES, type_name, payloads)
    messages = [deserialize(TYPES, type_name, data) for data in payloads]
    assert found.stamps.tolist() == stamps and str(found.example) == str(messages[0])
    assert found.index.tolist() == list(range(6)) and left == []
    np.testing.assert_array_equal(found.numbers, [numbers_of(one) for one in messages])


@pytest.mark.parametrize(
    ("type_name", "payloads"),
    [
        (POSE, [pose(0), pose(1, "earth")]),
        (POSE, [pose(0), pose(1, "elsewhere")]),
        (STATE, [state(0), state(1, names=("a", "bc", "deg"))]),
        (STATE, [state(0), state(1, velocities=0)]),
        (POSE, [pose(0), pose(1)[:-1]]),
        ("std_msgs/msg/Float64", [serialize(TYPES, "std_msgs/msg/Float64", {"data": 1.0})]),
    ],
)
def test_messages_that_differ_in_more_have_no_layout_in_common(type_name, payloads):
    found, left = columns_by_layout(TYPES, type_name, payloads)
    assert len(found) + len(left) == len(payloads)


def test_the_other_order_of_bytes_is_left_to_rosbags():
    swapped = bytes(
        TYPES.serialize_cdr(deserialize(TYPES, POSE, pose(5)), POSE, little_endian=False)
    )
    assert columns_by_layout(TYPES, POSE, [swapped]) == ([], [0])


# commands


def older_types():
    """The types as they were when a command had seven torques, without a count."""
    text = (Path(__file__).parents[3] / "msg_schemas/msg/WamCommand.msg").read_text()
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(
        get_types_from_msg(text.replace("float64[] joint", "float64[7] joint"), COMMAND)
    )
    return types


def command(stamp_ns, force=0.0, grip=0, frame="world", torque=(1.0,) * 7, types=TYPES):
    content = {
        "header": header_content(stamp_ns, frame),
        # the first number of the wrench, or the last one
        "wrench": {"force": {"x": force}} if grip == 1 else {"torque": {"z": force}},
        "joint_torque": np.array(torque),
        "grip": grip,
    }
    return serialize(types, COMMAND, content)


@pytest.mark.parametrize(
    "frames",
    [("world",), ("world", "another frame"), ("",)],
    ids=["one frame", "two frames", "no frame"],
)
def test_many_commands_say_what_each_of_them_says(frames):
    every = list(product([-1, 0, 5, 1_732_500_000_123_456_789], (0.0, -2.5), (0, 1, 2), frames))
    payloads = [command(*one) for one in every]
    told = [(stamp, force != 0.0, grip) for stamp, force, grip, _ in every]
    assert [read_command(one) for one in payloads] == told
    assert list(zip(*map(np.ndarray.tolist, read_commands(payloads)), strict=True)) == told


@pytest.mark.parametrize("torque", [(), (0.0,) * 6, (0.0,) * 7, (-1.0,) * 7], ids=str)
def test_the_grip_stands_behind_the_torques_of_any_arm(torque):
    payload = command(7, grip=2, frame="another frame", torque=torque)
    assert read_command(payload) == (7, False, 2)
    if len(torque) == 7:
        older = command(7, grip=2, frame="another frame", torque=torque, types=older_types())
        assert len(older) < len(payload) and read_command(older) == (7, False, 2)


def test_of_no_commands_there_is_nothing_and_of_other_bytes_an_error():
    assert [len(column) for column in read_commands([])] == [0, 0, 0]
    good = command(1)
    for wrong in (b"", good[:60], b"\x00\x00" + good[2:20]):
        with pytest.raises(ValueError, match="are no WamCommand"):
            read_commands([good, wrong])
    assert [
        column.tolist()
        for column in read_commands([good, good[:1] + b"\x00" + bytes(len(good) - 2)])
    ][0][0] == 1, "big endian"


@pytest.mark.parametrize("n", [1, 3, 11, 200])
def test_what_is_usual_among_steps_is_their_running_median(n):
    steps = np.random.default_rng(1).exponential(size=n)
    np.testing.assert_array_equal(
        usual_steps(steps), scipy.ndimage.median_filter(steps, 11, mode="nearest")
    )


def test_messages_of_several_layouts_are_taken_by_layout():
    kinds = [
        lambda stamp: state(stamp),
        lambda stamp: state(stamp, ("c", "ab", "def")),
        lambda stamp: state(stamp, velocities=0),
    ]
    payloads = [kinds[k % 3](k) for k in range(30)]
    found, left = columns_by_layout(TYPES, STATE, payloads)
    assert [columns.index.tolist() for columns in found] == [
        list(range(k, 30, 3)) for k in range(3)
    ] and not left
    for columns in found:
        for k, numbers, stamp in zip(columns.index, columns.numbers, columns.stamps, strict=True):
            one = deserialize(TYPES, STATE, payloads[k])
            assert one.name == columns.example.name and stamp == k
            np.testing.assert_array_equal(numbers, numbers_of(one))


def test_of_more_layouts_than_can_be_kept_the_rest_is_read_one_by_one():
    payloads = [state(k, (f"joint_{k}", "b", "c")) for k in range(40)]
    found, left = columns_by_layout(TYPES, STATE, payloads)
    assert [*(k for columns in found for k in columns.index), *left] == list(range(40)) and len(
        left
    ) == 24
