"""Poses in several frames: /tf takes them to the one that is asked for, as tf2 does."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from dart_skill.recording.imports import parse_mapping, read_recording
from dart_skill.recording.imports.frame_tree import FrameTransform, FrameTree, read_frame_tree
from tests.unit.recording.bag_files import write_bag
from tests.unit.recording.test_foreign import (
    KINDS,
    ROLES,
    STAMPS,
    header,
    pose_messages,
    topics,
    vector,
)

SECOND = 1_000_000_000
RIG = np.array([0.4, -0.2, 1.1, *Rotation.from_euler("zyx", [0.7, -0.4, 2.0]).as_quat()])
"""Where a rig stands in the world."""


@pytest.fixture(scope="module")
def poses():
    rng = np.random.default_rng(1)
    time = np.linspace(0.0, 1.0, len(STAMPS))[:, None]
    return {
        role: (
            np.array([k, 0.3, 1.0])
            + 0.3 * np.sin(2.0 * time + [0.0, 1.0, 2.0])
            + 1e-4 * rng.standard_normal((len(STAMPS), 3)),
            Rotation.from_euler("zyx", np.hstack([0.5 + time, 0.3 * time, -0.2 * time])).as_quat(),
        )
        for k, role in enumerate(ROLES)
    }


def drawn_rows(seed, n):
    rng = np.random.default_rng(seed)
    return np.hstack([rng.normal(size=(n, 3)), Rotation.random(n, random_state=seed).as_quat()])


def matrices_of(rows):
    found = np.tile(np.eye(4), (len(rows), 1, 1))
    found[:, :3, :3], found[:, :3, 3] = Rotation.from_quat(rows[:, 3:]).as_matrix(), rows[:, :3]
    return found


def moving(seed, stamps):
    return FrameTransform(stamps, stamps + 7, drawn_rows(seed, len(stamps)))


@given(st.integers(0, 10**6), st.permutations(["a", "b", "c", "d"]))
def test_a_chain_of_transforms_is_the_product_of_its_matrices(seed, order):
    """Frames hang in each other in any order, so some are gone through upwards and some downwards."""
    stamps = np.arange(20) * SECOND // 10
    transforms = {
        edge: moving(seed + k, stamps)
        for k, edge in enumerate(
            [(order[0], order[1]), (order[1], order[2]), (order[0], order[3])]
        )
    }
    rows = drawn_rows(seed + 9, len(stamps))
    found = FrameTree(transforms).moved(rows, order[2], order[3], stamps)
    up, middle, down = (matrices_of(one.rows) for one in transforms.values())
    np.testing.assert_allclose(
        matrices_of(found), np.linalg.inv(down) @ up @ middle @ matrices_of(rows), atol=1e-12
    )


def test_between_two_messages_a_transform_is_interpolated_and_beyond_them_unknown():
    stamps = np.arange(5) * SECOND // 10
    transform = moving(3, stamps)
    instants = np.array([-1, 0, SECOND // 15, SECOND // 5, 4 * SECOND // 10, SECOND])
    found = transform.at(instants, by_log=False)
    inside = instants[1:-1]
    turned = Slerp(stamps, Rotation.from_quat(transform.rows[:, 3:]))(inside)
    assert (turned.inv() * Rotation.from_quat(found[1:-1, 3:])).magnitude().max() < 1e-7
    np.testing.assert_allclose(found[1:-1, 0], np.interp(inside, stamps, transform.rows[:, 0]))
    assert np.isnan(found[[0, -1]]).all()
    np.testing.assert_array_equal(
        transform.at(stamps + 7, by_log=True), transform.at(stamps, by_log=False)
    )


def test_a_transform_that_nobody_told_for_seconds_is_unknown_between():
    transform = moving(4, np.array([0, SECOND, 4 * SECOND]))
    assert np.isnan(transform.at(np.array([2 * SECOND]), by_log=False)).all()
    same = FrameTransform(transform.stamp_ns, transform.log_ns, np.tile(RIG, (3, 1)))
    np.testing.assert_array_equal(
        same.at(np.array([-SECOND, 2 * SECOND, 9 * SECOND]), by_log=False), np.tile(RIG, (3, 1))
    )


def in_rig(position, quaternion):
    rig = Rotation.from_quat(RIG[3:])
    return (
        rig.inv().apply(position - RIG[:3]),
        (rig.inv() * Rotation.from_quat(quaternion)).as_quat(),
    )


def tf(topic, stamp, parent, child, row):
    content = {"transform": {"translation": vector(row[:3]), "rotation": vector(row[3:], "xyzw")}}
    transform = {"header": header(int(stamp), parent), "child_frame_id": child, **content}
    return topic, "tf2_msgs/msg/TFMessage", int(stamp), {"transforms": [transform]}


def written(path, poses, *more, kind=KINDS[0]):
    """A bag of which the hand is told in the rig's frame in the first half, and in the world's in
    the second.
    """
    n, hand = len(STAMPS) // 2, poses["hand"]
    told = [
        one
        for one in pose_messages(kind, poses, "world")
        if one[0] != "/lab/hand" or one[2] >= STAMPS[n]
    ]
    told += [
        one
        for one in pose_messages(kind, {**poses, "hand": in_rig(*hand)}, "rig")
        if one[0] == "/lab/hand" and one[2] < STAMPS[n]
    ]
    return write_bag(path, [*told, *more])


@pytest.mark.parametrize("kind", KINDS)
def test_poses_in_two_frames_are_one_path(tmp_path, poses, kind):
    bag = written(
        tmp_path / "bag",
        poses,
        tf("/tf_static", STAMPS[0] - 5, "/world", "rig", RIG),
        kind=kind,
    )
    mapping = {role: {"topic": f"/lab/{role}", "frame": "world", "child": role} for role in ROLES}
    recording = read_recording(bag, parse_mapping(mapping))
    hand = recording.bodies["hand"]
    np.testing.assert_array_equal(hand.stamp_ns, STAMPS)
    np.testing.assert_allclose(hand.position, poses["hand"][0], atol=1e-12)
    assert (
        Rotation.from_quat(hand.quaternion) * Rotation.from_quat(poses["hand"][1]).inv()
    ).magnitude().max() < 1e-7
    assert [fault.message for fault in recording.faults] == [
        "100 poses in 'rig' are taken to 'world' by /tf"
    ]


def test_what_tf_does_not_tell_is_left_out(tmp_path, poses):
    """A rig that moves, and of which /tf tells from the 50th frame on."""
    ends = [
        tf("/tf", STAMPS[k], "world", "rig", RIG + [1e-3 * (k > 50), *np.zeros(6)])
        for k in (50, 120)
    ]
    recording = read_recording(
        written(tmp_path / "bag", poses, *ends), parse_mapping(topics(frame="world"))
    )
    assert len(recording.bodies["hand"]) == 150
    told = [fault.message for fault in recording.faults if fault.body == "hand"]
    assert "50 poses in 'rig' are left out, for /tf does not tell where 'world' was then" in told


def test_a_frame_of_which_tf_says_nothing_is_left_out(tmp_path, poses):
    bag = written(tmp_path / "bag", poses, tf("/tf_static", STAMPS[0], "world", "another", RIG))
    recording = read_recording(bag, parse_mapping(topics(frame="world")))
    assert len(recording.bodies["hand"]) == 100
    assert (
        recording.faults[0].message
        == "100 poses in 'rig', and not in 'world', are left out, for no /tf leads there"
    )


def test_bodies_in_frames_that_differ_are_not_mixed(tmp_path, poses):
    """The hand of one camera system and the ball of another: which axes are meant must be said."""
    told = pose_messages(KINDS[0], {**poses, "hand": in_rig(*poses["hand"])}, "world")
    told = [
        (*one[:3], {**one[3], "header": header(one[2], "rig")}) if one[0] == "/lab/hand" else one
        for one in told
    ]
    bag = write_bag(tmp_path / "bag", [*told, tf("/tf_static", STAMPS[0], "world", "rig", RIG)])
    with pytest.raises(
        ValueError,
        match=r"the hand is told in 'rig' and the ball in 'world'.*ball: \{frame: rig\}",
    ):
        read_recording(bag, parse_mapping(topics()))
    hand = read_recording(bag, parse_mapping(topics(frame="world"))).bodies["hand"]
    np.testing.assert_allclose(hand.position, poses["hand"][0], atol=1e-12)
    as_told = {
        role: {"topic": f"/lab/{role}", "frame": "rig" if role == "hand" else "world"}
        for role in ROLES
    }
    hand = read_recording(bag, parse_mapping(as_told)).bodies["hand"]
    np.testing.assert_array_equal(hand.position, in_rig(*poses["hand"])[0])


def test_frames_are_compared_at_log_times_where_the_mapping_says_so(tmp_path, poses):
    """Nobody filled in the stamps of the poses, and the rig moves."""
    frames = {"/lab/hand": "rig"}
    told = [
        (*one[:3], {**one[3], "header": header(0, frames.get(one[0], "world"))})
        for one in pose_messages(KINDS[0], poses, "world")
    ]
    moves = [tf("/tf", stamp, "world", "rig", RIG + 1e-9 * stamp) for stamp in STAMPS[::20]]
    bag = write_bag(tmp_path / "bag", [*told, *moves])
    with pytest.raises(ValueError, match="the hand is told in 'rig' and the ball in 'world'"):
        read_recording(bag, parse_mapping(topics(time="log")))


def test_what_is_no_transform_is_not_taken_for_one(tmp_path):
    broken = [
        tf("/tf", 10, "world", "rig", np.zeros(7)),
        tf("/tf", 20, "world", "rig", np.full(7, np.nan)),
    ]
    tree = read_frame_tree(write_bag(tmp_path / "bag", broken))
    assert tree.moved(drawn_rows(0, 2), "rig", "world", np.array([10, 20])) is None
