"""Recordings from elsewhere: whatever its topics, files, axes and units are called, the same poses
come out.
"""

import json
from itertools import permutations, product

import numpy as np
import pytest
import yaml
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from scipy.spatial.transform import Rotation

from dart_skill.recording import (
    BagError,
    BagReader,
    serialize,
    typestore,
)
from dart_skill.recording.imports.mapping import OWN, MappingError, load_mapping, parse_mapping
from dart_skill.recording.imports.pose_stream import (
    PoseStream,
    RigidTransform,
    transformed,
    with_continuous_signs,
)
from dart_skill.recording.imports.throw_recording import convert, read_recording
from tests.paths import CONFIG
from tests.recorded_session import header
from tests.unit.recording.bag_files import write_bag

EXAMPLE = CONFIG / "recordings" / "example.yaml"
ROLES = ("hand", "ball", "basket")
N = 200
START_NS = 1_700_000_000_123_456_789
STAMPS = START_NS + np.arange(N) * 10_000_000
TO_WORLD = {"position": [0.1, -0.25, 0.02], "roll_pitch_yaw_deg": [0.0, 0.0, 90.0]}


@pytest.fixture(scope="session")
def own_bag(recorded_session):
    return recorded_session[0]


@pytest.fixture(scope="module")
def types():
    return typestore()


@pytest.fixture(scope="module")
def poses():
    """Smooth motions of the three bodies, in our axes: positions (n, 3), quaternions (n, 4) by
    role.
    """
    rng, time = np.random.default_rng(0), np.linspace(0.0, 1.0, N)[:, None]
    found = {}
    for k, role in enumerate(ROLES):
        position = (
            np.array([1.5 * k, 0.3, 1.0])
            + 0.3 * np.sin(2.0 * time + [0.0, 1.0, 2.0])
            + 1e-4 * rng.standard_normal((N, 3))
        )
        quaternion = Rotation.from_euler(
            "zyx", np.hstack([0.5 + time, 0.3 * time, -0.2 * time])
        ).as_quat()
        found[role] = position, quaternion
    return found


def to_laboratory(position, quaternion):
    """Our poses in a laboratory with y up, in millimetres, turned and moved: what Motive would
    have recorded.
    """
    world = Rotation.from_euler("z", 90.0, degrees=True)
    position = world.inv().apply(position - np.array(TO_WORLD["position"]))
    up = Rotation.from_matrix([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    turned = (up.inv() * world.inv() * Rotation.from_quat(quaternion)).as_quat()
    return 1e3 * up.inv().apply(position), turned


def assert_poses(recording, poses, within=1e-9):
    for role in ROLES:
        body = recording.bodies[role]
        np.testing.assert_array_equal(body.stamp_ns, STAMPS)
        np.testing.assert_allclose(body.position, poses[role][0], atol=within, err_msg=role)
        apart = Rotation.from_quat(body.quaternion) * Rotation.from_quat(poses[role][1]).inv()
        assert apart.magnitude().max() < 1e-7 + within, f"{role}: {apart.magnitude().max()} rad"


def vector(values, names="xyz"):
    return dict(zip(names, map(float, values), strict=True))


def pose_message(kind, stamp_ns, p, q, frame_id, child):
    """Content of a message of a type with one pose."""
    pose = {"position": vector(p), "orientation": vector(q, "xyzw")}
    top = {"header": header(stamp_ns, frame_id)}
    transform = {
        **top,
        "child_frame_id": child,
        "transform": {"translation": vector(p), "rotation": vector(q, "xyzw")},
    }
    other = {
        **transform,
        "child_frame_id": "other",
        "transform": {"translation": vector([9, 9, 9]), "rotation": {"w": 1.0}},
    }
    return {
        "geometry_msgs/msg/PoseStamped": {**top, "pose": pose},
        "geometry_msgs/msg/PoseWithCovarianceStamped": {**top, "pose": {"pose": pose}},
        "nav_msgs/msg/Odometry": {**top, "child_frame_id": child, "pose": {"pose": pose}},
        "geometry_msgs/msg/TransformStamped": transform,
        "tf2_msgs/msg/TFMessage": {"transforms": [other, transform]},
        "geometry_msgs/msg/PointStamped": {**top, "point": vector(p)},
    }[kind]


def pose_messages(kind, poses, frame_id="map"):
    return [
        (f"/lab/{role}", kind, int(stamp), pose_message(kind, stamp, p, q, frame_id, role))
        for role in ROLES
        for stamp, p, q in zip(STAMPS, *poses[role], strict=True)
    ]


def topics(**more):
    return {role: {"topic": f"/lab/{role}", **more} for role in ROLES}


# topics


KINDS = ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/TransformStamped",
         "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage")  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_poses_of_every_type_are_read(tmp_path, poses, kind):
    bag = write_bag(tmp_path / "bag", pose_messages(kind, poses))
    mapping = {role: {"topic": f"/lab/{role}", "frame": "map", "child": role} for role in ROLES}
    assert_poses(read_recording(bag, parse_mapping(mapping)), poses, within=1e-15)


def test_a_ball_that_is_a_point_has_no_orientation(tmp_path, poses):
    messages = [m for m in pose_messages(KINDS[0], poses) if m[0] != "/lab/ball"]
    messages += [
        m for m in pose_messages("geometry_msgs/msg/PointStamped", poses) if m[0] == "/lab/ball"
    ]
    recording = read_recording(write_bag(tmp_path / "bag", messages), parse_mapping(topics()))
    np.testing.assert_array_equal(recording.bodies["ball"].position, poses["ball"][0])
    assert not [fault for fault in recording.faults if fault.body == "ball"]


def test_y_up_millimetres_and_a_moved_origin_become_ours(tmp_path, poses):
    lab = {role: to_laboratory(*poses[role]) for role in ROLES}
    bag = write_bag(tmp_path / "bag", pose_messages(KINDS[0], lab))
    mapping = {"axes": {"up": "y", "length": "mm", "transform": TO_WORLD}, **topics()}
    assert_poses(read_recording(bag, parse_mapping(mapping)), poses)


def test_a_body_may_have_axes_of_its_own(tmp_path, poses):
    lab = {role: to_laboratory(*poses[role]) if role == "ball" else poses[role] for role in ROLES}
    bag = write_bag(tmp_path / "bag", pose_messages(KINDS[0], lab))
    mapping = topics()
    mapping["ball"] |= {"up": "y", "length": "mm", "transform": TO_WORLD}
    assert_poses(read_recording(bag, parse_mapping(mapping)), poses)


def test_an_offset_is_that_of_our_frame_in_the_tracked_body(tmp_path, poses):
    offset = {"position": [0.02, -0.03, 0.1], "quaternion": [0.5, 0.5, 0.5, 0.5]}
    turned = Rotation.from_quat(poses["hand"][1]) * Rotation.from_quat(offset["quaternion"]).inv()
    tracked = poses["hand"][0] - turned.apply(offset["position"]), turned.as_quat()
    bag = write_bag(tmp_path / "bag", pose_messages(KINDS[0], {**poses, "hand": tracked}))
    mapping = topics()
    mapping["hand"] |= {"offset": offset}
    assert_poses(read_recording(bag, parse_mapping(mapping)), poses)


def test_a_basket_that_was_not_tracked_stands_where_the_mapping_says(tmp_path, poses):
    bag = write_bag(tmp_path / "bag", pose_messages(KINDS[0], poses))
    recording = read_recording(
        bag, parse_mapping({**topics(), "basket": {"position": [2.0, 0.3, 0.4]}})
    )
    np.testing.assert_array_equal(
        recording.bodies["basket"].position, np.tile([2.0, 0.3, 0.4], (N, 1))
    )


def test_sqlite_bags_are_read(tmp_path, types, poses):
    with Writer(tmp_path / "bag", version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connections = {}
        for topic, kind, stamp, content in sorted(
            pose_messages(KINDS[0], poses), key=lambda item: item[2]
        ):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=types)
            writer.write(connections[topic], stamp, serialize(types, kind, content))
    assert_poses(read_recording(tmp_path / "bag", parse_mapping(topics())), poses, within=1e-15)


def test_a_frame_that_is_not_the_named_one_is_an_error(tmp_path, poses):
    bag = write_bag(tmp_path / "bag", pose_messages(KINDS[0], poses))
    with pytest.raises(
        ValueError, match="/lab/hand: all 200 poses of the hand are in 'map', not 'world'"
    ):
        read_recording(bag, parse_mapping(topics(frame="world")))


def test_poses_in_several_frames_are_not_mixed(tmp_path, poses):
    """Two drivers, or one that was set up anew, on one topic: which frame is meant must be said."""
    messages = pose_messages(KINDS[0], poses)
    messages += [
        (topic, kind, stamp + 1, {**content, "header": header(stamp + 1, "camera")})
        for topic, kind, stamp, content in messages[:50]
    ]
    bag = write_bag(tmp_path / "bag", messages)
    with pytest.raises(
        ValueError,
        match=(
            "/lab/hand: .*several frames: 200 in 'map', 50 in 'camera': choose one, as hand:"
            " {frame: map};"
        ),
    ):
        read_recording(bag, parse_mapping(topics()))
    mapping = topics()
    mapping["hand"] |= {"frame": "map"}
    recording = read_recording(bag, parse_mapping(mapping))
    assert len(recording.bodies["hand"]) == N
    assert [fault.message for fault in recording.faults if fault.body == "hand"] == [
        "50 poses in 'camera', and not in 'map', are left out, for no /tf leads there"
    ]


def test_a_missing_topic_is_named_with_those_there_are(tmp_path, poses):
    bag = write_bag(tmp_path / "bag", pose_messages(KINDS[0], poses))
    with pytest.raises(
        BagError, match=r"no topic /vrpn_mocap/hand/pose for 'hand', only \['/lab/ball'"
    ):
        read_recording(bag)


def test_a_topic_of_a_wrong_type_is_an_error(tmp_path, poses):
    messages = pose_messages(KINDS[0], poses) + [
        ("/chat", "std_msgs/msg/String", START_NS, {"data": "hand"})
    ]
    bag = write_bag(tmp_path / "bag", messages)
    with pytest.raises(
        BagError,
        match="/chat has type std_msgs/msg/String; for 'hand' it must be one of PoseStamped",
    ):
        read_recording(bag, parse_mapping({**topics(), "hand": {"topic": "/chat"}}))


# joints and buttons


def joint_state(stamp, names, position, velocity):
    return {"header": header(stamp), "name": names, "position": position, "velocity": velocity}


def test_joints_are_taken_by_their_names(tmp_path, poses):
    names = [f"j{k}" for k in range(1, 8)]
    recorded = ["gripper", *names[::-1]]
    angles = np.linspace(0.0, 1.0, N)[:, None] + np.arange(7)
    states = [
        (
            "/lab/joints",
            "sensor_msgs/msg/JointState",
            int(stamp),
            joint_state(stamp, recorded, [9.0, *row[::-1]], []),
        )
        for stamp, row in zip(STAMPS, angles, strict=True)
    ]
    bag = write_bag(tmp_path / "bag", pose_messages(KINDS[0], poses) + states)
    joints = read_recording(
        bag, parse_mapping({**topics(), "joints": {"topic": "/lab/joints", "names": names}})
    ).joints
    np.testing.assert_array_equal(joints.position, angles)
    np.testing.assert_allclose(joints.velocity, 100.0 / (N - 1), rtol=1e-9)
    with pytest.raises(
        ValueError, match="messages that list gripper, j7, .*: name the arm's joints"
    ):
        read_recording(bag, parse_mapping({**topics(), "joints": {"topic": "/lab/joints"}}))
    with pytest.raises(ValueError, match="no joint 'elbow', only"):
        read_recording(
            bag,
            parse_mapping(
                {**topics(), "joints": {"topic": "/lab/joints", "names": [*names[:6], "elbow"]}}
            ),
        )


def test_joints_are_counted_as_our_arm_counts_them(tmp_path, poses):
    signs, zeros = np.array([1, -1, 1, 1, -1, 1, 1]), 0.1 * np.arange(7)
    angles = np.linspace(0.0, 1.0, N)[:, None] + np.arange(7)
    recorded = np.rad2deg(signs * (angles - zeros))
    states = [
        (
            "/lab/joints",
            "sensor_msgs/msg/JointState",
            int(stamp),
            joint_state(stamp, [f"j{k}" for k in range(7)], row, signs * 180.0),
        )
        for stamp, row in zip(STAMPS, recorded, strict=True)
    ]
    bag = write_bag(tmp_path / "bag", pose_messages(KINDS[0], poses) + states)
    where = {
        "topic": "/lab/joints",
        "angle": "deg",
        "signs": signs.tolist(),
        "zeros": zeros.tolist(),
    }
    joints = read_recording(bag, parse_mapping({**topics(), "joints": where})).joints
    np.testing.assert_allclose(joints.position, angles, atol=1e-14)
    np.testing.assert_allclose(joints.velocity, np.pi, rtol=1e-14)


@pytest.mark.parametrize(
    "kind", ["std_msgs/msg/Bool", "std_msgs/msg/Empty", "dart_skill_msgs/msg/WamCommand"]
)
def test_buttons_of_every_type(tmp_path, poses, kind):
    pressed, released = int(STAMPS[50]), int(STAMPS[60])
    grips = ((pressed - 5, 0), (pressed, 2), (released, 1))
    content = {
        "std_msgs/msg/Bool": [
            (pressed - 5, {"data": False}),
            (pressed, {"data": True}),
            (pressed + 5, {"data": True}),
            (released, {}),
        ],
        "std_msgs/msg/Empty": [(pressed, {})],
        "dart_skill_msgs/msg/WamCommand": [
            (stamp, {"header": header(stamp), "grip": grip}) for stamp, grip in grips
        ],
    }[kind]
    messages = [("/button", kind, stamp, one) for stamp, one in content]
    bag = write_bag(tmp_path / "bag", pose_messages(KINDS[0], poses) + messages)
    for role, taught in (("teacher", True), ("command", False)):
        recording = read_recording(bag, parse_mapping({**topics(), role: {"topic": "/button"}}))
        assert [(one.stamp_ns, one.taught) for one in recording.openings] == [
            (pressed, taught)
        ] and recording.has_button


@pytest.mark.parametrize(("early", "guided"), [(100_000_000, True), (2_000_000_000, False)])
def test_an_opening_by_the_controller_while_a_person_pushes_is_taught(
    tmp_path, poses, early, guided
):
    opened = int(STAMPS[-1])
    push = {"header": header(opened - early), "wrench": {"force": {"y": 3.0}}}
    idle = {"header": header(opened - 1), "wrench": {}}
    kind = "dart_skill_msgs/msg/WamCommand"
    messages = [("/push", kind, opened - early, push), ("/push", kind, opened - 1, idle)]
    messages.append(("/arm", kind, opened, {"header": header(opened), "grip": 2}))
    bag = write_bag(tmp_path / "bag", pose_messages(KINDS[0], poses) + messages)
    recording = read_recording(
        bag,
        parse_mapping({**topics(), "teacher": {"topic": "/push"}, "command": {"topic": "/arm"}}),
    )
    assert [one.taught for one in recording.openings] == [guided]


# CSV files


def write_csv(path, poses, lost=()):
    lines = [
        ",".join(
            [
                "t",
                *(
                    f"{role}_{c}"
                    for role in ROLES
                    for c in ("x", "y", "z", "qx", "qy", "qz", "qw")
                ),
            ]
        )
    ]
    for k, stamp in enumerate(STAMPS):
        cells = [f"{stamp // 10**9}.{stamp % 10**9:09d}"]
        for role in ROLES:
            values = [*poses[role][0][k], *poses[role][1][k]]
            cells += [""] * 7 if (role, k) in lost else [repr(float(value)) for value in values]
        lines.append(",".join(cells))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def csv_mapping(role):
    names = [f"{role}_{c}" for c in ("x", "y", "z", "qx", "qy", "qz", "qw")]
    return {
        "csv": "throws.csv",
        "columns": {"time": "t", "position": names[:3], "quaternion": names[3:]},
    }


def test_joints_and_instants_from_tables(tmp_path, poses):
    write_csv(tmp_path / "throws.csv", poses)
    rows = [
        [1e-9 * k * 10_000_000, *(0.1 * k + np.arange(7)), *np.full(7, 10.0)] for k in range(N)
    ]
    (tmp_path / "joints.csv").write_text(
        "\n".join(",".join(map(repr, map(float, row))) for row in rows)
    )
    (tmp_path / "opened.csv").write_text(f"when\n{START_NS + 500_000_000}\n")
    mapping = {role: csv_mapping(role) for role in ROLES}
    columns = {"time": 1, "position": list(range(2, 9)), "velocity": list(range(9, 16))}
    mapping["joints"] = {
        "csv": "joints.csv",
        "header_lines": 0,
        "columns": columns,
        "time_shift": 2.0,
    }
    mapping["teacher"] = {"csv": "opened.csv", "columns": {"time": "when"}, "time": "ns"}
    recording = read_recording(tmp_path, parse_mapping(mapping))
    np.testing.assert_allclose(recording.joints.position[:, 6], 6.0 + 0.1 * np.arange(N))
    assert recording.joints.stamp_ns[0] == 2_000_000_000 and np.all(
        recording.joints.velocity == 10.0
    )
    assert [(one.stamp_ns, one.taught) for one in recording.openings] == [
        (START_NS + 500_000_000, True)
    ]


BROKEN_TABLES = [
    ("t,hand_x\n", "1 lines, of which 1 are the header: there are no numbers"),
    ("", "the file is empty"),
    (
        "t,hand_x,hand_y,hand_z,hand_qx,hand_qy,hand_qz\n1,2,3,4,5,6,7\n",
        "no column is called 'hand_qw'; the columns are t, hand_x",
    ),
    (
        "t,hand_x,hand_y,hand_z,hand_qx,hand_qy,hand_qz,hand_qw\n0,0,0,0,0,0,0,1\n0,0,zero,0,0,0,0,1\n",
        "line 3: 'zero' is no number",
    ),
    (
        "t,hand_x,hand_y,hand_z,hand_qx,hand_qy,hand_qz,hand_qw\nnoon,0,0,0,0,0,0,1\n",
        "line 2: time 'noon' is no number",
    ),
    (
        "t,hand_x,hand_y,hand_z,hand_qx,hand_qy,hand_qz,hand_qw\n0,0,0\n",
        "line 2: 3 columns, column 4 is missing",
    ),
]


@pytest.mark.parametrize(("text", "message"), BROKEN_TABLES)
def test_broken_tables_name_file_and_line(tmp_path, text, message):
    (tmp_path / "throws.csv").write_text(text)
    with pytest.raises(ValueError, match=f"throws.csv.*{message}"):
        read_recording(tmp_path, parse_mapping({role: csv_mapping("hand") for role in ROLES}))


# axes


def test_poses_are_turned_and_moved_as_rotations_do_and_faulty_norms_stay_what_they_are():
    rng = np.random.default_rng(1)
    body, world, offset = (
        Rotation.random(50, random_state=1),
        Rotation.random(random_state=2),
        Rotation.random(random_state=3),
    )
    norm, position = (
        np.where(np.arange(50) % 5, 1.0, [0.0, 0.9] * 25)[:, None],
        rng.standard_normal((50, 3)),
    )
    stream = PoseStream("hand", np.arange(50), position, norm * body.as_quat())
    p, q = np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3])
    moved = transformed(
        stream, RigidTransform(p, world.as_quat()), RigidTransform(q, offset.as_quat())
    )
    np.testing.assert_allclose(np.linalg.norm(moved.quaternion, axis=1), norm[:, 0], atol=1e-12)
    seen = norm[:, 0] > 0.0
    turned = world * body[seen]
    np.testing.assert_allclose(
        moved.position[seen], world.apply(position[seen]) + p + turned.apply(q), atol=1e-12
    )
    assert (
        (turned * offset).inv() * Rotation.from_quat(moved.quaternion[seen])
    ).magnitude().max() < 1e-12
    np.testing.assert_allclose(
        moved.position[~seen], world.apply(position[~seen]) + p + q, atol=1e-12
    )


SIGNED_AXES = [
    [s + a for s, a in zip(signs, order, strict=True)]
    for order in permutations("xyz")
    for signs in product(("", "-"), repeat=3)
]


@pytest.mark.parametrize("xyz", SIGNED_AXES, ids="".join)
def test_poses_in_axes_that_point_anywhere_become_ours(tmp_path, poses, xyz):
    """All 24 right-handed axes, in which the body keeps its own, and the 24 left-handed ones, in
    which its z axis is mirrored.
    """
    matrix = np.array(
        [[(-1.0 if one[0] == "-" else 1.0) * (one[-1] == axis) for axis in "xyz"] for one in xyz]
    )
    mirror = np.diag([1.0, 1.0, np.linalg.det(matrix)])
    lab = {
        role: (
            p @ matrix,
            Rotation.from_matrix(matrix.T @ Rotation.from_quat(q).as_matrix() @ mirror).as_quat(),
        )
        for role, (p, q) in poses.items()
    }
    bag = write_bag(tmp_path / "bag", pose_messages(KINDS[0], lab))
    assert_poses(read_recording(bag, parse_mapping({"axes": {"xyz": xyz}, **topics()})), poses)


def test_signs_are_made_continuous():
    turns = Rotation.from_rotvec(np.linspace(0.0, 12.0, 100)[:, None] * [1.0, 0.0, 0.0]).as_quat()
    stream = PoseStream(
        "hand",
        np.arange(100),
        np.zeros((100, 3)),
        np.where(np.arange(100) % 3, 1.0, -1.0)[:, None] * turns,
    )
    signed = with_continuous_signs(stream).quaternion
    assert np.all(np.sum(signed[1:] * signed[:-1], axis=1) > 0.9)
    np.testing.assert_allclose(np.abs(np.sum(signed * turns, axis=1)), 1.0)


# the mapping file


def test_the_example_names_every_key():
    mapping = load_mapping(EXAMPLE)
    assert mapping.bodies["hand"].table.delimiter == ";" and mapping.bodies["hand"].order == "wxyz"
    assert mapping.bodies["ball"].capture.file == "take_001.csv" and mapping.bodies[
        "basket"
    ].fixed == (2.0, 0.3, 0.4)
    np.testing.assert_allclose(
        mapping.bodies["ball"].world.quaternion,
        Rotation.from_euler("z", 90, degrees=True).as_quat(),
    )
    assert (
        mapping.joints.names[0] == "j1"
        and mapping.teacher.topic == "/teach/button"
        and mapping.command is None
    )


WRONG = [
    ("hand", {"topic": "/h", "colour": 1}, "hand: unknown key 'colour'; known are .*topic"),
    ("axes", {"up": "w"}, "axes: up is 'w'; give one of z, y, x"),
    (
        "axes",
        {"xyz": ["x", "y", "-y"]},
        r"axes: xyz is .*; give where our x, y, z point in the recorded axes, as \[x, -z, y\]",
    ),
    ("axes", {"xyz": ["x", "y", "z"], "up": "y"}, "axes: give up or xyz, not both"),
    ("axes", {"inverse": "yes"}, "axes: inverse is 'yes'; give true or false"),
    ("axes", {"length": "inch"}, "axes: length is 'inch'; give one of m, cm, mm"),
    (
        "axes",
        {"transform": {"position": [1, 2]}},
        r"axes: transform: position is \[1, 2\]; give a list of 3 numbers",
    ),
    (
        "axes",
        {"transform": {"quaternion": [1, 1, 1, 1]}},
        "axes: transform: quaternion is .*norm 1",
    ),
    (
        "axes",
        {"transform": {"quaternion": [0, 0, 0, 1], "roll_pitch_yaw_deg": [0, 0, 0]}},
        "not both",
    ),
    ("hand", {}, "hand: give exactly one of topic, table, capture, position; got none of them"),
    ("hand", {"topic": "/h", "csv": "h.csv"}, "hand: give exactly one of .*; got topic, csv"),
    ("hand", {"csv": "h.csv"}, "hand: columns are missing"),
    (
        "hand",
        {"csv": "h.csv", "columns": {"time": 1}},
        "hand: columns: position is missing: give 3 names or numbers",
    ),
    (
        "hand",
        {"csv": "h.csv", "columns": {"time": 1, "position": [1, 2, 0]}},
        r"position is \[1, 2, 0\]; give 3 names",
    ),
    (
        "hand",
        {"csv": "h.csv", "columns": {"time": "t", "position": [1, 2, 3]}, "header_lines": 0},
        "column 't' has a name, but header_lines is 0",
    ),
    (
        "hand",
        {"csv": "h.csv", "delimiter": "::", "columns": {}},
        "delimiter is '::'; give one character",
    ),
    (
        "hand",
        {"csv": "h.csv", "columns": {"time": 1, "position": [1, 2, 3]}, "time": "min"},
        "time is 'min'; give one or several of stamp, log, regular, s, ms",
    ),
    ("hand", {"topic": 5}, "hand: topic is 5; give a text"),
    ("hand", "h.csv", "hand: need keys and values, got 'h.csv'"),
    (
        "joints",
        {"topic": "/j", "csv": "j.csv"},
        "joints: give exactly one of topic, table; got topic, csv",
    ),
    (
        "joints",
        {"topic": "/j", "names": ["a", "b"]},
        "joints: names is .*; give the names of 7 joints",
    ),
    (
        "joints",
        {"topic": "/j", "signs": [1, 1, 1, 2, 1, 1, 1]},
        "joints: signs is .*; give 1 or -1 for each of 7 joints",
    ),
    ("joints", {"topic": "/j", "angle": "grad"}, "joints: angle is 'grad'; give one of rad, deg"),
    (
        "button",
        {"topic": "/b"},
        (
            "unknown key 'button'; known are axes, hand, ball, basket, joints, teacher, command,"
            " frame"
        ),
    ),
    ("frame", 3, "frame is 3; give a text"),
]


@pytest.mark.parametrize(("key", "value", "message"), WRONG)
def test_a_wrong_mapping_is_an_error_that_names_the_place(tmp_path, key, value, message):
    path = tmp_path / "mapping.yaml"
    path.write_text(yaml.safe_dump({**topics(), key: value}))
    with pytest.raises(MappingError, match=f"mapping.yaml.*{message}"):
        load_mapping(path)


def test_a_mapping_without_a_body_or_that_is_no_mapping_is_an_error(tmp_path):
    with pytest.raises(MappingError, match="nothing says where the ball is"):
        parse_mapping({"hand": {"topic": "/h"}, "basket": {"topic": "/b"}})
    for text, message in (
        ("- 1", "holds no mapping"),
        ("a: [", "no YAML"),
        ("", "holds no mapping"),
    ):
        (tmp_path / "mapping.yaml").write_text(text)
        with pytest.raises(MappingError, match=message):
            load_mapping(tmp_path / "mapping.yaml")
    with pytest.raises(MappingError, match="nowhere.yaml: No such file"):
        load_mapping(tmp_path / "nowhere.yaml")


# our own bags, and conversion


@pytest.mark.slow
def test_our_own_bags_need_no_mapping_and_have_no_fault(own_bag):
    recording = read_recording(own_bag)
    assert [fault for fault in recording.faults if not fault.is_information] == []
    assert [one.taught for one in recording.openings] == [True, True, True, False]
    with BagReader(own_bag) as bag:
        for role in ROLES:
            messages = [item.data for item in bag.messages([OWN.bodies[role].topic])]
            written = np.array(
                [
                    [m.pose.position.x, m.pose.position.y, m.pose.position.z, m.pose.orientation.w]
                    for m in messages
                ]
            )
            body = recording.bodies[role]
            np.testing.assert_array_equal(
                np.column_stack([body.position, body.quaternion[:, 3]]), written
            )


def test_a_converted_recording_is_a_bag_of_ours(tmp_path, poses):
    lab = {role: to_laboratory(*poses[role]) for role in ROLES}
    messages = pose_messages(KINDS[0], lab)
    ball = [k for k, item in enumerate(messages) if item[0] == "/lab/ball"]
    for k in ball[20:23]:
        messages[k] = (*messages[k][:3], {**messages[k][3], "pose": messages[ball[19]][3]["pose"]})
    messages.append(("/button", "std_msgs/msg/Empty", int(STAMPS[100]), {}))
    mapping = parse_mapping(
        {
            "axes": {"up": "y", "length": "mm", "transform": TO_WORLD},
            **topics(),
            "teacher": {"topic": "/button"},
        }
    )
    convert(write_bag(tmp_path / "lab", messages), tmp_path / "ours", mapping)
    recording = read_recording(tmp_path / "ours")
    np.testing.assert_allclose(recording.bodies["hand"].position, poses["hand"][0], atol=1e-9)
    np.testing.assert_array_equal(
        recording.bodies["ball"].stamp_ns, np.delete(STAMPS, [20, 21, 22])
    )
    assert [(one.stamp_ns, one.taught) for one in recording.openings] == [(STAMPS[100], True)]
    with BagReader(tmp_path / "ours") as bag:
        faults = json.loads(bag.custom_data["faults"])
        assert [(one["kind"], one["body"], one["count"], one["repaired"]) for one in faults] == [
            ("stale", "ball", 3, True)
        ]
        assert bag.custom_data["source"] == "lab"
    with AnyReader([tmp_path / "ours"]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
    assert counts == {
        "/vrpn_mocap/hand/pose": N,
        "/vrpn_mocap/ball/pose": N - 3,
        "/vrpn_mocap/basket/pose": N,
        "/wam/teacher_wrench": 1,
    }


def test_converting_never_overwrites(tmp_path, own_bag):
    (tmp_path / "ours").mkdir()
    (tmp_path / "ours" / "precious").write_text("data")
    with pytest.raises((ValueError, OSError)):
        convert(own_bag, tmp_path / "ours")
    assert [path.name for path in (tmp_path / "ours").iterdir()] == ["precious"]


def test_a_source_that_is_not_there_is_an_error(tmp_path):
    with pytest.raises(BagError, match="no such bag or folder"):
        read_recording(tmp_path / "nowhere")


def test_a_body_without_a_single_pose_is_named(tmp_path, poses):
    bag = write_bag(tmp_path / "bag", pose_messages("geometry_msgs/msg/TransformStamped", poses))
    with pytest.raises(ValueError, match="/lab/hand: no pose of the hand: was it tracked"):
        read_recording(bag, parse_mapping(topics(child="glove")))
