"""A long bag needs no more memory than a short one, whatever is done with it."""

import importlib
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from dart_skill.common.world import joint_names, the_world
from dart_skill.recording import (
    BagReader,
    BagWriter,
    definition,
    qos_yaml,
    serialize,
    type_hash,
    typestore,
)
from dart_skill.recording.bags import check_bag, columns, recover
from dart_skill.recording.imports import read_in_parts, read_recording
from dart_skill.recording.mcap import (
    McapFile,
    crc_of,
    mapped,
    read_summary,
    walk,
)
from dart_skill.session import found_in
from dart_skill.skills.observation import THRESHOLDS
from tests.paths import ROOT
from tests.recorded_session import same

SECOND, STEP_NS = 1_000_000_000, 10_000_000
STATE, POSE, COMMAND = (
    "sensor_msgs/msg/JointState",
    "geometry_msgs/msg/PoseStamped",
    "dart_skill_msgs/msg/WamCommand",
)
TYPES = typestore()
BAG = ROOT / "bags" / "demonstrations"


def record(path, seconds, pause_after=2):
    """Joint states, commands and poses that differ in their numbers; the world is set anew, a
    second later, after every few seconds.
    """
    topics = {
        "/joint_states": STATE,
        "/wam/command": COMMAND,
        **dict.fromkeys(the_world().pose_topics().values(), POSE),
    }
    rng = np.random.default_rng(0)
    # apart: nobody takes one body for another
    places = {topic: np.full(3, float(k)) for k, topic in enumerate(topics)}
    with BagWriter(path, chunk_size=2**15) as bag:
        for topic, name in topics.items():
            bag.add_topic(topic, name, definition(TYPES, name), qos_yaml(), type_hash(TYPES, name))
        for step in range(seconds * SECOND // STEP_NS):
            now = (1 + step * STEP_NS // (pause_after * SECOND)) * SECOND + step * STEP_NS
            header = {
                "stamp": {"sec": now // SECOND, "nanosec": now % SECOND},
                "frame_id": "world",
            }
            for topic, name in topics.items():
                content = {"header": header}
                if name == STATE:
                    content |= {
                        "name": joint_names(),
                        **{field: rng.random(7) for field in ("position", "velocity", "effort")},
                    }
                if name == POSE:
                    places[topic] += rng.normal(0.0, 1e-3, 3)
                    content["pose"] = {
                        "position": dict(zip("xyz", places[topic].tolist(), strict=True)),
                        "orientation": {"w": 1.0},
                    }
                bag.write(topic, now, now, serialize(TYPES, name, content))
    return bag.file


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    """Files of a short bag and of one that is three times as long; without metadata.yaml, for
    whose reading 8 MB are set aside.
    """
    folder = tmp_path_factory.mktemp("bags")
    return record(folder / "short", 4), record(folder / "long", 12)


def most_memory(task):
    """That a call holds at a time, beyond what was there before [bytes]."""
    tracemalloc.start()
    try:
        task()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def grows_by(task, bags):
    """Memory by which the long bag needs more than the short one, in parts of the bytes by which
    it is longer.
    """
    short, long = bags
    for bag in bags:
        task(bag)  # what is imported and cached the first time
    return (most_memory(lambda: task(long)) - most_memory(lambda: task(short))) / (
        long.stat().st_size - short.stat().st_size
    )


def test_a_check_keeps_little_of_each_chunk(bags):
    assert grows_by(check_bag, bags) < 0.3


def test_a_recovery_keeps_little_of_each_chunk(bags, tmp_path):
    made = iter(range(10))

    def task(bag):
        assert recover(bag, tmp_path / f"whole_{next(made)}").is_complete

    assert grows_by(task, bags) < 0.3


def test_all_messages_are_read_one_chunk_after_the_other(bags):
    def task(bag):
        with BagReader(bag) as reader:
            assert (
                sum(len(message.data) for message in reader.messages(decode=False))
                > bag.stat().st_size
            )

    assert grows_by(task, bags) < 0.4


def test_a_recording_is_read_part_by_part(bags):
    def task(bag):
        assert sum(
            len(part.command_stamps) for part in read_in_parts(bag, part_ns=2 * SECOND)
        ) in (400, 1200)

    def whole(bag):
        read_recording(bag)

    assert grows_by(task, bags) < 0.5 < 3.0 < grows_by(whole, bags)


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_pages_of_a_file_are_given_back_once_they_were_read(tmp_path, monkeypatch):
    """They count as this process's memory, and of a file of 10 GB they were 10 GB."""
    monkeypatch.setattr(
        importlib.import_module("dart_skill.recording.mcap.records"), "READ_AT_ONCE", 2**20
    )
    file = McapFile(tmp_path / "large.mcap")
    for number in range(20):
        file.add_attachment(f"{number}", "x", bytes(2**20))
    file.finish()
    file.stream.close()

    def held():
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(1024 * int(line.split()[1]) for line in lines if line.startswith("RssFile"))

    before = held()
    with mapped(file.path) as data:
        summary, most = read_summary(data), 0
        for found in walk(data, summary):
            found.content[-1]
            most = max(most, held() - before)
        whole = crc_of(data, summary.start)
        most = max(most, held() - before)
    assert whole and most < 6 * 2**20


def test_a_check_decodes_only_what_differs_in_more_than_stamp_and_numbers(bags, monkeypatch):
    decoded = []
    original = columns.deserialize
    monkeypatch.setattr(
        columns,
        "deserialize",
        lambda types, name, data: decoded.append(name) or original(types, name, data),
    )
    assert check_bag(bags[0]) == []
    assert 5 <= len(decoded) < 0.2 * 5 * 400


def test_a_check_still_finds_the_one_message_that_is_none(bags, tmp_path):
    """Among hundreds that are alike."""
    with BagReader(bags[0]) as bag, BagWriter(tmp_path / "wrong") as wrong:
        info = bag.topics["/joint_states"]
        wrong.add_topic(info.name, STATE, definition(TYPES, STATE), qos_yaml(), info.type_hash)
        for k, message in enumerate(bag.messages([info.name], decode=False)):
            wrong.write(
                info.name,
                message.stamp_ns,
                message.stamp_ns,
                message.data[: 100 if k == 300 else None],
            )
    (finding,) = [one for one in check_bag(tmp_path / "wrong") if one.severity == "error"]
    assert "1 messages are no sensor_msgs/msg/JointState" in finding.message


# learning part by part


@pytest.fixture(scope="module")
def throws():
    return list(found_in([read_recording(BAG)], THRESHOLDS))


@pytest.mark.parametrize("seconds", [1, 20])
def test_parts_of_a_recording_show_the_same_throws_to_the_last_bit(throws, seconds):
    parts = list(read_in_parts(BAG, part_ns=seconds * SECOND))
    found = list(found_in(parts, THRESHOLDS))
    assert len(parts) > 3 and len(found) == len(throws) == 13
    for one, other in zip(found, throws, strict=True):
        assert same(one.demonstration, other.demonstration) == [] and one.taught == other.taught


def test_parts_are_all_of_the_recording(bags):
    parts, whole = list(read_in_parts(bags[0], part_ns=4 * SECOND // 5)), read_recording(bags[0])
    assert len(parts) == 4  # up to a pause, or twice as long
    for role, stream in whole.bodies.items():
        assert np.array_equal(
            np.concatenate([part.bodies[role].position for part in parts]), stream.position
        )
    assert np.array_equal(
        np.concatenate([part.joints.position for part in parts]), whole.joints.position
    )


def test_a_body_that_is_never_seen_is_named_at_the_end(bags, tmp_path):
    with BagReader(bags[0]) as bag, BagWriter(tmp_path / "blind") as blind:
        for name, info in bag.topics.items():
            blind.add_topic(
                name, info.type_name, definition(TYPES, info.type_name), qos_yaml(), info.type_hash
            )
        for message in bag.messages(decode=False):
            if message.topic != the_world().pose_topics()["ball"]:
                blind.write(message.topic, message.stamp_ns, message.stamp_ns, message.data)
    parts = read_in_parts(tmp_path / "blind", part_ns=2 * SECOND)
    assert len(next(parts).bodies["ball"]) == 0
    with pytest.raises(ValueError, match="no pose of the ball: was it tracked"):
        list(parts)
