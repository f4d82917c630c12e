"""Message definitions, hashes and CDR bytes without ROS."""

import struct
from types import SimpleNamespace

import numpy as np
import pytest

from dart_skill.recording import (
    definition,
    deserialize,
    message,
    serialize,
    type_hash,
    typestore,
)
from dart_skill.recording.bags import interface_folder


@pytest.fixture(scope="module")
def types():
    return typestore()


def test_every_interface_of_our_package_is_known_and_has_a_hash(types):
    parts = {
        "msg": [""],
        "srv": ["_Request", "_Response"],
        "action": ["_Goal", "_Result", "_Feedback"],
    }
    for kind, endings in parts.items():
        for file in interface_folder().glob(f"{kind}/*.{kind}"):
            for ending in endings:
                name = f"dart_skill_msgs/{kind}/{file.stem}{ending}"
                assert type_hash(types, name).startswith("RIHS01_"), name


def test_hashes_are_those_of_ros(types):
    """Published with ROS 2 Jazzy's own packages (std_msgs/msg/String.json and the like)."""
    expected = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    assert type_hash(types, "std_msgs/msg/String") == expected


def test_a_definition_holds_every_nested_type_once(types):
    text = definition(types, "dart_skill_msgs/msg/Demonstration")
    nested = [line.removeprefix("MSG: ") for line in text.splitlines() if line.startswith("MSG: ")]
    assert len(nested) == len(set(nested))
    assert {"std_msgs/Header", "geometry_msgs/PoseStamped", "sensor_msgs/JointState"} <= set(
        nested
    )
    assert "dart_skill_msgs/BodyTrack[] tracks" in text


def test_cdr_bytes_are_laid_out_as_the_standard_says(types):
    """Little endian; 4-byte length and text with its zero; doubles aligned to 8 after the header."""
    data = serialize(
        types,
        "geometry_msgs/msg/PointStamped",
        {
            "header": {"stamp": {"sec": 7, "nanosec": 9}, "frame_id": "world"},
            "point": {"x": 1.5, "z": -2.0},
        },
    )
    expected = (
        b"\0\1\0\0"
        + struct.pack("<iII6s", 7, 9, 6, b"world\0")
        + bytes(6)
        + struct.pack("<ddd", 1.5, 0.0, -2.0)
    )
    assert data == expected


def test_objects_with_lists_tuples_or_arrays_give_the_same_bytes(types):
    header = SimpleNamespace(stamp=SimpleNamespace(sec=1, nanosec=2), frame_id="world")
    variants = [
        SimpleNamespace(
            header=header,
            name=["a", "b"],
            position=kind([0.1, 0.2]),
            velocity=kind([1, 2]),
            effort=kind([]),
        )
        for kind in (list, tuple, np.array)
    ]
    first, *others = (
        serialize(types, "sensor_msgs/msg/JointState", variant) for variant in variants
    )
    assert all(other == first for other in others)
    decoded = deserialize(types, "sensor_msgs/msg/JointState", first)
    assert (
        decoded.name == ["a", "b"]
        and decoded.position.tolist() == [0.1, 0.2]
        and decoded.effort.size == 0
    )


def test_a_message_from_nothing_is_zero_and_survives_the_way_through_bytes(types):
    for name in ("SimulationState", "Plan", "Demonstration", "Outcome", "WamCommand"):
        name = f"dart_skill_msgs/msg/{name}"
        data = serialize(types, name, None)
        assert serialize(types, name, deserialize(types, name, data)) == data
    state = message(types, "dart_skill_msgs/msg/SimulationState")
    assert state.joint_position.tolist() == [] and state.success is False
    pose = message(types, "geometry_msgs/msg/PoseWithCovariance")
    assert pose.covariance.tolist() == [0.0] * 36


@pytest.mark.parametrize(
    ("type_name", "value", "reason"),
    [
        ("nobody/msg/Nothing", {}, "unknown message type 'nobody/msg/Nothing'"),
        ("std_msgs/msg/Header", {"frame": "world"}, "no field .'frame'"),
        ("std_msgs/msg/Header", SimpleNamespace(frame_id="world"), "has no field 'stamp'"),
        ("std_msgs/msg/Header", {"frame_id": 3}, "Header.frame_id is a string"),
        ("builtin_interfaces/msg/Time", {"sec": 2**31}, "Time.sec is a int32"),
        ("builtin_interfaces/msg/Time", {"nanosec": 0.5}, "Time.nanosec is a uint32"),
        ("geometry_msgs/msg/Point", {"x": "far"}, "Point.x is a float64"),
        (
            "geometry_msgs/msg/PoseWithCovariance",
            {"covariance": [0.0] * 6},
            "covariance has 36 elements, got 6",
        ),
        ("sensor_msgs/msg/JointState", {"position": 1.0}, "position is a sequence"),
    ],
)
def test_what_does_not_fit_the_type_is_refused_by_place(types, type_name, value, reason):
    with pytest.raises(ValueError, match=reason):
        serialize(types, type_name, value)


def test_bytes_of_another_type_are_refused(types):
    with pytest.raises(ValueError, match="are no sensor_msgs/msg/JointState"):
        deserialize(types, "sensor_msgs/msg/JointState", b"\0\1\0\0\1\0\0")


def test_definitions_of_another_package_are_loaded_from_its_folder(tmp_path):
    (tmp_path / "msg").mkdir()
    (tmp_path / "package.xml").write_text("<package><name>lab_msgs</name></package>")
    (tmp_path / "msg" / "Grip.msg").write_text(
        "geometry_msgs/Point centre  # [m]\nfloat64[<=3] force\n"
    )
    types = typestore(tmp_path)
    assert (
        deserialize(
            types, "lab_msgs/msg/Grip", serialize(types, "lab_msgs/msg/Grip", {"force": [1, 2]})
        ).force.sum()
        == 3
    )
    with pytest.raises(ValueError, match="4 elements, at most 3"):
        serialize(types, "lab_msgs/msg/Grip", {"force": [1.0] * 4})
    (tmp_path / "msg" / "Grip.msg").write_text("no such line\n/")
    with pytest.raises(ValueError, match="Grip.msg"):
        typestore(tmp_path)
    (tmp_path / "msg" / "Grip.msg").unlink()
    with pytest.raises(ValueError, match="no .msg, .srv or .action files"):
        typestore(tmp_path)
