"""Bags of ROS 1: read as those of ROS 2, whatever their chunks are compressed with."""

import json

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from dart_skill.cli import main
from dart_skill.recording import BagError, BagReader
from dart_skill.recording.imports import convert, parse_mapping, read_recording

N, START_NS = 60, 1_600_000_000_123_456_789
STAMPS = START_NS + 10_000_000 * np.arange(N)
OWN = """Header header
float32 grip
time[2] instants
duration waited
"""
HEADER = "std_msgs/msg/Header"


@pytest.fixture(scope="module")
def ros1():
    from rosbags.typesys import get_types_from_msg

    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(OWN, "lab_msgs/msg/Grip"))
    store.register(
        get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf/msg/tfMessage")
    )
    return store


def header(store, k, frame="world"):
    time = store.types["builtin_interfaces/msg/Time"]
    return store.types[HEADER](
        seq=k,
        stamp=time(sec=int(STAMPS[k] // 10**9), nanosec=int(STAMPS[k] % 10**9)),
        frame_id=frame,
    )


def place(k):
    return 0.5 + 0.01 * k, np.sin(0.1 * k), 1.0 + 0.002 * k


def write(path, store, compression=None, file_format=None):
    types = store.types
    point, quaternion = (
        types["geometry_msgs/msg/Point"],
        types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.6, w=0.8),
    )
    vector, pose = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Pose"]
    time, duration = types["builtin_interfaces/msg/Time"], types["builtin_interfaces/msg/Duration"]
    writer = Writer(path)
    if compression:
        writer.set_compression(compression)
    with writer as bag:
        topics = {
            "/hand/pose": "geometry_msgs/msg/PoseStamped",
            "/vicon/ball/ball": "geometry_msgs/msg/TransformStamped",
            "/tf": "tf/msg/tfMessage",
            "/joint_states": "sensor_msgs/msg/JointState",
            "/grip": "lab_msgs/msg/Grip",
        }
        connections = {
            name: bag.add_connection(name, kind, typestore=store) for name, kind in topics.items()
        }
        for k, stamp in enumerate(STAMPS.tolist()):
            x, y, z = place(k)
            told = header(store, k)
            moved = types["geometry_msgs/msg/Transform"](
                translation=vector(x=x + 1.0, y=y, z=z), rotation=quaternion
            )
            transform = types[topics["/vicon/ball/ball"]](
                header=told, child_frame_id="ball", transform=moved
            )
            states = types[topics["/joint_states"]](
                header=told,
                name=[f"joint{j}" for j in range(7)],
                position=0.1 * k + np.arange(7.0),
                velocity=np.full(7, 10.0),
                effort=np.empty(0),
            )
            content = {
                "/hand/pose": types[topics["/hand/pose"]](
                    header=told, pose=pose(position=point(x=x, y=y, z=z), orientation=quaternion)
                ),
                "/vicon/ball/ball": transform,
                "/tf": types[topics["/tf"]](transforms=[transform]),
                "/joint_states": states,
                "/grip": types[topics["/grip"]](
                    header=told,
                    grip=0.5,
                    instants=[time(sec=1, nanosec=2), time(sec=3, nanosec=4)],
                    waited=duration(sec=5, nanosec=6),
                ),
            }
            for name, message in content.items():
                bag.write(connections[name], stamp, store.serialize_ros1(message, topics[name]))
    return path


MAPPING = {
    "hand": {"topic": "/hand/pose"},
    "ball": {"topic": "/tf", "child": "ball"},
    "basket": {"position": [2.0, 0.3, 0.4]},
    "joints": {"topic": "/joint_states"},
}


@pytest.mark.parametrize(
    "compression", [None, Writer.CompressionFormat.BZ2, Writer.CompressionFormat.LZ4]
)
def test_poses_and_joints_of_a_ros1_bag_are_read(tmp_path, ros1, compression):
    bag = write(tmp_path / "lab.bag", ros1, compression)
    recording = read_recording(bag, parse_mapping(MAPPING), mend=False)
    hand, ball = recording.bodies["hand"], recording.bodies["ball"]
    np.testing.assert_array_equal(hand.stamp_ns, STAMPS)
    np.testing.assert_array_equal(hand.position, [place(k) for k in range(N)])
    np.testing.assert_array_equal(
        ball.position, [np.add(place(k), (1.0, 0.0, 0.0)) for k in range(N)]
    )
    np.testing.assert_allclose(recording.joints.position[:, 6], 6.0 + 0.1 * np.arange(N))
    assert recording.joints.names[0] == "joint0"
    other = parse_mapping({**MAPPING, "ball": {"topic": "/vicon/ball/ball"}})
    np.testing.assert_array_equal(
        read_recording(bag, other, mend=False).bodies["ball"].position, ball.position
    )
    convert(bag, tmp_path / "ours", parse_mapping(MAPPING))
    np.testing.assert_array_equal(
        read_recording(tmp_path / "ours", mend=False).bodies["hand"].stamp_ns, STAMPS
    )


def test_its_messages_are_objects_with_all_fields(tmp_path, ros1):
    with BagReader(write(tmp_path / "lab.bag", ros1)) as bag:
        assert (
            bag.topics["/hand/pose"].type_name == "geometry_msgs/msg/PoseStamped"
            and bag.topics["/grip"].count == N
        )
        assert (bag.start_ns, bag.end_ns, bag.message_count, bag.storage) == (
            STAMPS[0],
            STAMPS[-1],
            5 * N,
            "ros1",
        )
        first, *_ = bag.messages("/grip")
        assert (
            not hasattr(first.data.header, "seq")
            and first.data.grip == 0.5
            and first.data.waited.nanosec == 6
        )
        assert first.data.instants[1].sec == 3 and first.data.header.stamp.nanosec == 123_456_789
        some = list(bag.messages("/hand/pose", int(STAMPS[10]), int(STAMPS[20])))
    assert len(some) == 10 and some[0].stamp_ns == STAMPS[10]


def test_bag_info_and_the_folder_of_a_bag(tmp_path, ros1, capsys):
    (tmp_path / "folder").mkdir()
    bag = write(tmp_path / "folder" / "lab.bag", ros1)
    for path in (bag, bag.parent):
        assert main(["bag", "info", str(path), "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        assert "/joint_states" in json.dumps(
            told
        ) and "geometry_msgs/msg/PoseStamped" in json.dumps(told)


def test_a_bag_without_its_end_names_the_remedy(tmp_path, ros1):
    data = bytearray(write(tmp_path / "lab.bag", ros1).read_bytes())
    place = data.index(b"index_pos=") + len(b"index_pos=")
    data[place : place + 8] = bytes(8)
    (tmp_path / "lab.bag").write_bytes(data)
    with pytest.raises(
        BagError,
        match="lab.bag: its recorder was stopped before it wrote the index: 'rosbag reindex'",
    ):
        BagReader(tmp_path / "lab.bag")
    (tmp_path / "lab.bag").write_bytes(b"no bag at all\n")
    with pytest.raises(BagError, match="lab.bag: "):
        BagReader(tmp_path / "lab.bag")


def as_ros1(source, path):
    """Poses and joint states of a bag as a bag of ROS 1."""
    store = get_typestore(Stores.ROS1_NOETIC)
    with BagReader(source) as bag, Writer(path) as writer:
        kinds = ("geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/JointState")
        names = [name for name, topic in bag.topics.items() if topic.type_name in kinds]
        connections = {
            name: writer.add_connection(name, bag.topics[name].type_name, typestore=store)
            for name in names
        }
        for message in bag.messages(names):
            stamp = message.data.header.stamp
            time = store.types["builtin_interfaces/msg/Time"](sec=stamp.sec, nanosec=stamp.nanosec)
            told = store.types[HEADER](seq=0, stamp=time, frame_id=message.data.header.frame_id)
            fields = {
                name: getattr(message.data, name)
                for name in message.data.__dataclass_fields__
                if not name.startswith("__")
            }
            content = store.types[message.type_name](**{**fields, "header": told})
            writer.write(
                connections[message.topic],
                message.stamp_ns,
                store.serialize_ros1(content, message.type_name),
            )
    return path
