"""Bags of earlier versions: what they hold is read, and becomes a bag of today."""

import json

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from dart_skill.cli import main
from dart_skill.recording import (
    DEMONSTRATION_TOPIC,
    DEMONSTRATION_TYPE,
    OLDER_COMMAND,
    BagError,
    BagReader,
    BagWriter,
    definition,
    deserialize,
    qos_yaml,
    read_demonstrations,
    serialize,
    type_hash,
    types_for,
    upgrade,
)
from dart_skill.recording.bags import check_bag
from tests.unit.recording.test_demonstration import assert_same, make

OLDER = {
    DEMONSTRATION_TYPE: """
std_msgs/Header header
string id
geometry_msgs/Point target
geometry_msgs/PoseStamped[] hand
geometry_msgs/PointStamped[] ball
sensor_msgs/JointState[] joints
builtin_interfaces/Time motion_start
builtin_interfaces/Time motion_stop
builtin_interfaces/Time hand_opened
""",
    "dart_skill_msgs/msg/WamCommand": """
uint8 GRIP_UNSPECIFIED=0
uint8 GRIP_CLOSE=1
uint8 GRIP_OPEN=2
std_msgs/Header header
geometry_msgs/Wrench wrench
float64[7] joint_torque
uint8 grip
""",
    "dart_skill_msgs/msg/TrialOutcome": "std_msgs/Header header\nbool in_basket\n",
    "dart_skill_msgs/msg/SimulationState": "std_msgs/Header header\nbool ball_in_basket\n",
}
"""Definitions as bags before December 2026 have them; the last two are shortened."""
TOPICS = {DEMONSTRATION_TOPIC: DEMONSTRATION_TYPE, "/wam/command": "dart_skill_msgs/msg/WamCommand",
          "/outcome": "dart_skill_msgs/msg/TrialOutcome", "/simulation/state": "dart_skill_msgs/msg/SimulationState",
          "/joint_states": "sensor_msgs/msg/JointState"}  # fmt: skip


def older_types():
    types = get_typestore(Stores.ROS2_JAZZY)
    for name, text in OLDER.items():
        types.register(get_types_from_msg(text, name))
    return types


def stamp(ns):
    return {"sec": ns // 10**9, "nanosec": ns % 10**9}


def older_content(one):
    """A demonstration as its message was."""
    header = {"stamp": stamp(one.stamp_ns), "frame_id": "world"}

    def items(time, contents):
        return [
            {"header": {"stamp": stamp(one.stamp_ns + round(1e9 * t)), "frame_id": "world"}, **c}
            for t, c in zip(time, contents, strict=True)
        ]

    def xyz(values):
        return dict(zip("xyzw", values.tolist(), strict=False))

    poses = zip(one.hand_position, one.hand_quaternion, strict=True)
    states = zip(one.joint_position, one.joint_velocity, strict=True)
    return {
        "header": header,
        "id": one.id,
        "target": xyz(one.target),
        "hand": items(one.hand_time, [{"pose": {"position": xyz(p), "orientation": xyz(q)}} for p, q in poses]),
        "ball": items(one.ball_time, [{"point": xyz(point)} for point in one.ball_position]),
        "joints": items(one.joint_time, [{"name": list(one.joint_names), "position": q, "velocity": v} for q, v in states]),
        **{n: stamp(one.stamp_ns + round(1e9 * getattr(one, n))) for n in ("motion_start", "motion_stop", "hand_opened")},
    }


@pytest.fixture(scope="module")
def older(tmp_path_factory):
    """A bag as it was recorded then, and what it holds."""
    path, types, shown = tmp_path_factory.mktemp("older") / "bag", older_types(), [make(0), make(1)]
    contents = {
        DEMONSTRATION_TOPIC: [older_content(one) for one in shown],
        "/wam/command": [{"header": {"stamp": stamp(5), "frame_id": "world"}, "joint_torque": np.arange(7.0), "grip": 2}],
        "/outcome": [{"in_basket": True}],
        "/simulation/state": [{"ball_in_basket": True}],
        "/joint_states": [{"header": {"stamp": stamp(7), "frame_id": ""}, "position": np.arange(7.0)}],
    }
    with BagWriter(path, custom_data={"seed": "7"}) as bag:
        for topic, name in TOPICS.items():
            bag.add_topic(topic, name, definition(types, name), qos_yaml(durability="transient_local"), type_hash(types, name))
        for k, (topic, messages) in enumerate(contents.items(), start=1):
            for content in messages:
                bag.write(topic, 10 * k, 10 * k, serialize(types, TOPICS[topic], content))
        bag.add_attachment("wam.yaml", "joints: []", "application/yaml")
    return path, shown


def test_the_older_definition_is_the_one_that_bags_have():
    types = older_types()
    assert type_hash(types, "dart_skill_msgs/msg/WamCommand") == OLDER_COMMAND


def test_demonstrations_of_an_older_bag_are_read_as_they_are(older):
    for one, again in zip(older[1], read_demonstrations(older[0]), strict=True):
        assert_same(one, again)


def test_a_bag_is_upgraded(older, tmp_path):
    result = upgrade(older[0], tmp_path / "new")
    assert result.converted == {DEMONSTRATION_TOPIC: 2, "/wam/command": 1} and result.copied == 1
    assert set(result.left_out) == {"/outcome", "/simulation/state"}
    assert "no dart_skill_msgs/msg/TrialOutcome any more" in result.left_out["/outcome"]
    for one, again in zip(older[1], read_demonstrations(tmp_path / "new"), strict=True):
        assert_same(one, again)
    assert not [one for one in check_bag(tmp_path / "new") if one.severity == "error"]
    with BagReader(tmp_path / "new") as bag:
        assert bag.custom_data == {"seed": "7", "upgraded_from": "bag"}
        for topic in (DEMONSTRATION_TOPIC, "/wam/command"):
            assert bag.topics[topic].type_hash == type_hash(types_for(TOPICS[topic]), TOPICS[topic])
            assert bag.topics[topic].qos[0].durability.name == "TRANSIENT_LOCAL"
        assert [one.name for one in bag.attachments()] == ["wam.yaml"]
        (command,) = bag.messages(["/wam/command"])
        assert (command.data.grip, command.data.speed, command.data.joint_torque.tolist()) == (2, 0, list(range(7)))
        (state,) = bag.messages(["/joint_states"], decode=False)
    with BagReader(older[0]) as bag:
        (before,) = bag.messages(["/joint_states"], decode=False)
    assert state.data == before.data and state.stamp_ns == before.stamp_ns


def test_there_is_nothing_to_do_for_a_bag_of_today_and_no_bag_is_overwritten(older, tmp_path):
    upgrade(older[0], tmp_path / "new")
    with pytest.raises(ValueError, match="nothing to convert"):
        upgrade(tmp_path / "new", tmp_path / "newer")
    assert not (tmp_path / "newer").exists()
    with pytest.raises(FileExistsError, match="exists already"):
        upgrade(older[0], tmp_path / "new")
    with pytest.raises(BagError, match="no such bag"):
        upgrade(tmp_path / "nothing", tmp_path / "out")


def test_the_command_says_what_it_did(older, tmp_path, capsys):
    assert main(["bag", "upgrade", str(older[0]), "--output", str(tmp_path / "new")]) == 0
    said = capsys.readouterr().out
    assert "2 messages of /demonstrations have the type of today" in said and f"new bag: {tmp_path / 'new'}" in said
    assert main(["bag", "upgrade", str(older[0]), "--output", str(tmp_path / "other"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["copied"] == 1


def test_a_demonstration_that_is_none_is_refused_by_name(tmp_path):
    types, name = older_types(), DEMONSTRATION_TYPE
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic(DEMONSTRATION_TOPIC, name, definition(types, name), qos_yaml(), type_hash(types, name))
        bag.write(DEMONSTRATION_TOPIC, 1, 1, serialize(types, name, {"id": "x"}))
    with pytest.raises(ValueError, match="demonstration x, hand: 0 samples"):
        upgrade(tmp_path / "bag", tmp_path / "new")
    assert not (tmp_path / "new").exists()
    assert deserialize(types, name, serialize(types, name, {"id": "x"})).id == "x"
