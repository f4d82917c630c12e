"""Demonstrations: what is valid, and the way through messages and bags."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest

from dart_skill.common.world import joint_names
from dart_skill.recording import (
    DEMONSTRATION_TOPIC,
    DEMONSTRATION_TYPE,
    BagError,
    BagWriter,
    definition,
    demonstration_from_message,
    demonstration_message,
    deserialize,
    fill_demonstration_message,
    message,
    read_demonstrations,
    serialize,
    typestore,
)
from tests.throw_demonstrations import assert_same, throw_demonstration

ORIGIN_NS = 1_700_000_123_456_789_012


@pytest.fixture(scope="module")
def types():
    return typestore()


def make(seed=0, **changes):
    rng = np.random.default_rng(seed)
    quaternion = rng.normal(size=(20, 4))
    content = {
        "id": f"throw-{seed}",
        "stamp_ns": ORIGIN_NS + seed,
        "target": [2.0, -0.3, 0.4],
        "hand_time": 0.01 * np.arange(20) - 0.05,
        "hand_position": rng.normal(size=(20, 3)),
        "hand_quaternion": quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True),
        "ball_time": 0.01 * np.arange(30) + 0.000123457,
        "ball_position": rng.normal(size=(30, 3)),
        "joint_time": 0.01 * np.arange(10),
        "joint_position": rng.normal(size=(10, 7)),
        "joint_velocity": rng.normal(size=(10, 7)),
        "motion_start": 0.03,
        "motion_stop": 0.14,
        "hand_opened": 0.0915,
        "joint_names": tuple(f"joint_{i}" for i in range(1, 8)),
    }
    return throw_demonstration(**{**content, **changes})


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"hand_opened": float("nan"), "motion_start": float("nan"), "motion_stop": float("nan")},
        {"ball_time": [], "ball_position": np.empty((0, 3))},
        {
            "joint_time": [],
            "joint_position": np.empty((0, 7)),
            "joint_velocity": np.empty((0, 7)),
            "joint_names": joint_names(),
        },
    ],
)
def test_through_a_message_and_its_bytes_and_back(types, changes):
    original = make(**changes)
    data = serialize(types, DEMONSTRATION_TYPE, demonstration_message(types, original))
    again = demonstration_from_message(deserialize(types, DEMONSTRATION_TYPE, data))
    assert_same(original, again, 1e-15, 1e-9)
    assert serialize(types, DEMONSTRATION_TYPE, demonstration_message(types, again)) == data, (
        "and it stays the same"
    )


def test_stamps_of_the_message_are_exact_to_the_nanosecond(types):
    msg = demonstration_message(types, make())
    assert (msg.header.stamp.sec, msg.header.stamp.nanosec) == divmod(ORIGIN_NS, 10**9)
    hand, ball = (track.poses for track in msg.tracks)
    stamps = [item.header.stamp.sec * 10**9 + item.header.stamp.nanosec for item in ball]
    assert stamps == [ORIGIN_NS + 123_457 + i * 10_000_000 for i in range(30)]
    assert {item.header.frame_id for item in (*hand, *ball, *msg.joints)} == {"world"}


def test_a_hand_that_was_opened_is_an_event_and_one_that_never_was_is_none(types):
    (opened,) = demonstration_message(types, make()).events
    assert (opened.name, opened.time_from_start.sec, opened.time_from_start.nanosec) == (
        "open",
        0,
        91_500_000,
    )
    assert demonstration_message(types, make(hand_opened=float("nan"))).events == []


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (
            lambda msg: setattr(msg, "skill", "place"),
            "demonstration throw-0 is of the skill 'place', not of 'throw'",
        ),
        (
            lambda msg: setattr(msg.situation, "bodies", []),
            "situation: 0 names and 1 values: give one value for each name",
        ),
        (
            lambda msg: setattr(msg.tracks[0], "body", "foot"),
            "no track of the hand, only of ball, foot",
        ),
        (lambda msg: setattr(msg.tracks[0], "body", "ball"), "tracks: ball stands there twice"),
    ],
)
def test_a_message_of_something_else_is_refused_by_name(types, change, reason):
    msg = demonstration_message(types, make())
    change(msg)
    with pytest.raises(ValueError, match=reason):
        demonstration_from_message(msg, "throw")


@pytest.mark.skipif(
    importlib.util.find_spec("dart_skill_msgs") is None,
    reason="the interface package is not built",
)
def test_rclpy_messages_are_filled_and_read_by_the_same_code(types):
    from rclpy.serialization import deserialize_message

    def new(name):
        package, kind, name = name.split("/")
        return getattr(importlib.import_module(f"{package}.{kind}"), name)()

    original = make()
    msg = fill_demonstration_message(original, new(DEMONSTRATION_TYPE), new)
    assert_same(original, demonstration_from_message(msg), 1e-15, 1e-9)
    data = serialize(types, DEMONSTRATION_TYPE, demonstration_message(types, original))
    assert deserialize_message(bytes(data), type(msg)) == msg, (
        "what is written without ROS reads the same with it"
    )


def record(path, types, data, topic=DEMONSTRATION_TOPIC, type_name=DEMONSTRATION_TYPE):
    with BagWriter(path) as bag:
        bag.add_topic(topic, type_name, definition(types, type_name))
        for stamp, item in enumerate(data):
            bag.write(topic, stamp, stamp, item)


def test_a_bag_gives_its_demonstrations_in_order(tmp_path, types):
    originals = [make(seed) for seed in range(4)]
    messages = (demonstration_message(types, original) for original in originals)
    record(
        tmp_path / "bag", types, [serialize(types, DEMONSTRATION_TYPE, msg) for msg in messages]
    )
    for original, again in zip(originals, read_demonstrations(tmp_path / "bag"), strict=True):
        assert_same(original, again, 1e-15, 1e-9)


def test_bags_without_valid_demonstrations_are_refused(tmp_path, types):
    record(tmp_path / "none", types, [], topic="/other")
    with pytest.raises(BagError, match="no topic /demonstrations, only .'/other'"):
        read_demonstrations(tmp_path / "none")
    record(tmp_path / "text", types, [], type_name="std_msgs/msg/String")
    with pytest.raises(BagError, match="has type std_msgs/msg/String"):
        read_demonstrations(tmp_path / "text")
    empty = message(types, DEMONSTRATION_TYPE, {"id": "x", "skill": "throw"})
    record(tmp_path / "bad", types, [serialize(types, DEMONSTRATION_TYPE, empty)])
    with pytest.raises(
        BagError, match="/demonstrations: demonstration x has no track of the hand"
    ):
        read_demonstrations(tmp_path / "bad")
    with pytest.raises(BagError, match="no such bag"):
        read_demonstrations(tmp_path / "nothing")


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"id": ""}, "id of a demonstration"),
        ({"stamp_ns": 0.5}, "whole nanoseconds"),
        ({"target": [1.0, np.nan, 0.0]}, "position"),
        ({"hand_time": np.zeros(20)}, "track: time does not increase after sample 0"),
        (
            {
                "hand_time": [0.0],
                "hand_position": np.zeros((1, 3)),
                "hand_quaternion": [[0.0, 0.0, 0.0, 1.0]],
            },
            "hand: 1 samples, need at least 2",
        ),
        ({"hand_quaternion": np.full((20, 4), 0.6)}, "quaternion 0 has norm 1.2"),
        ({"hand_quaternion": np.full((19, 4), 0.5)}, r"need quaternions \(20, 4\)"),
        ({"ball_position": np.zeros((29, 3))}, "track: need time"),
        ({"ball_position": np.full((30, 3), np.inf)}, "track: sample 0 is not finite"),
        ({"joint_velocity": np.zeros((10, 6))}, "joint velocity: need time"),
        ({"motion_stop": 0.02}, "motion_stop 0.02 s lies before"),
        ({"hand_opened": np.inf}, "open = inf"),
        ({"joint_names": ("a",)}, "1 joint names, need 7"),
        ({"hand_position": np.full((20, 3), 1e308)}, "the hand of sample 0 is 1e[+]308 m"),
        ({"target": [1e308, 0.0, 0.0]}, "the basket of its situation is at .* none beyond 1000 m"),
        ({"hand_opened": 1.1e9}, "open = 1.1e[+]09 s: give at most 3600 s after its stamp"),
        (
            {"hand_time": np.append(np.arange(19) * 0.01, 5e8)},
            "time of the hand of sample 19 is 5e[+]08 s",
        ),
        ({"joint_position": np.full((10, 7), 57.3)}, "joint_position of sample 0 is 57.3 rad"),
        (
            {"joint_velocity": np.full((10, 7), -1e300)},
            "joint_velocity of sample 0 is 1e[+]300 rad/s",
        ),
    ],
)
def test_what_is_no_demonstration_is_refused_by_name(changes, reason):
    with pytest.raises(ValueError, match=reason):
        make(**changes)


def test_a_joint_state_with_missing_joints_is_named(types):
    msg = demonstration_message(types, make())
    msg.joints[3].position = msg.joints[3].position[:5]
    with pytest.raises(ValueError, match="sample 3 has 5 values, need 7"):
        demonstration_from_message(msg)


def test_demonstrations_cannot_be_changed_by_accident():
    source = np.zeros((20, 3))
    demonstration = make(hand_position=source)
    source[:] = 1.0
    assert not demonstration.hand_position.any()
    with pytest.raises(ValueError, match="read-only"):
        demonstration.hand_position[0] = 1.0
    assert replace(demonstration, id="other").id == "other"


def test_joints_are_taken_by_their_names(types):
    """A driver may give them in another order; one with names of its own gives them in the arm's."""
    order, original = [6, 0, 5, 1, 4, 2, 3], make()
    msg = demonstration_message(types, original)
    for state, position, velocity in zip(
        msg.joints, original.joint_position, original.joint_velocity, strict=True
    ):
        state.name = [joint_names()[k] for k in order]
        state.position, state.velocity = position[order], velocity[order]
    read = demonstration_from_message(msg)
    assert read.joint_names == joint_names()
    np.testing.assert_array_equal(read.joint_position, original.joint_position)
    np.testing.assert_array_equal(read.joint_velocity, original.joint_velocity)
    for state in msg.joints:
        state.name = list("abcdefg")
    np.testing.assert_array_equal(
        demonstration_from_message(msg).joint_position, original.joint_position[:, order]
    )
