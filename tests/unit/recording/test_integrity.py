"""Every fault of a bag is found and named; a good bag has none, whoever wrote it."""

import json
import re
import shutil
import struct
import zlib

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from rosbags.rosbag2 import StoragePlugin, Writer

from dart_skill.recording import (
    BagReader,
    BagWriter,
    definition,
    qos_yaml,
    serialize,
    type_hash,
    typestore,
)
from dart_skill.recording.bags import check_bag, check_file, describe
from dart_skill.recording.mcap.records import packed
from tests.unit.recording.bag_files import mcap_file

POSE, STEP_NS, START_NS = "geometry_msgs/msg/PoseStamped", 10_000_000, 10**18
TYPES = typestore()
POSE_CDR = serialize(TYPES, POSE, {"header": {"frame_id": "world"}})


def record(path, stamps=None, **options):
    """A bag of poses on two topics."""
    with BagWriter(path, custom_data={"seed": "7"}, **options) as bag:
        for name in ("/hand", "/ball"):
            bag.add_topic(
                name,
                POSE,
                definition(TYPES, POSE),
                qos_yaml("best_effort"),
                type_hash(TYPES, POSE),
            )
        bag.add_attachment("wam.yaml", "joints: 7\n", "application/yaml")
        for stamp in (
            range(START_NS, START_NS + 300 * STEP_NS, STEP_NS) if stamps is None else stamps
        ):
            bag.write("/hand", stamp, stamp, POSE_CDR)
            bag.write("/ball", stamp, stamp, POSE_CDR)
    return path


@pytest.fixture
def bag(tmp_path):
    return record(tmp_path / "bag", chunk_size=8192)


def texts(findings, severity="error"):
    return [str(finding) for finding in findings if finding.severity == severity]


def plain(file, messages, definition_text=None, encoding="cdr", type_name=POSE, **options):
    """A file of plain `mcap`; messages: channel (1 or 2), log time, sequence, bytes."""
    text = definition(TYPES, POSE) if definition_text is None else definition_text
    told = {"encoding": encoding, "text": text} | ({} if type_name else {"schema": ""})
    name = type_name or "none"
    return mcap_file(
        file,
        [("/hand", name, told), ("/ball", name, told)],
        [(channel - 1, stamp, data, sequence) for channel, stamp, sequence, data in messages],
        **options,
    )


def patched(file, place, data):
    content = bytearray(file.read_bytes())
    content[place : place + len(data)] = data
    file.write_bytes(content)


def test_bags_of_ours_and_of_others_have_no_faults(tmp_path, bag):
    assert check_bag(bag) == [] and check_file(bag / "bag_0.mcap") == []
    assert check_bag(record(tmp_path / "split", max_bytes=40_000, chunk_size=4096)) == []
    with Writer(tmp_path / "foreign", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/hand", POSE, typestore=TYPES)
        for stamp in range(1000):
            writer.write(connection, stamp, POSE_CDR)
    assert (
        texts(check_bag(tmp_path / "foreign"))
        == texts(check_bag(tmp_path / "foreign"), "warning")
        == []
    )
    messages = [(1, stamp, stamp, POSE_CDR) for stamp in range(500)]
    for number, options in enumerate(
        (
            {},
            {"compression": CompressionType.LZ4},
            {"use_chunking": False},
            {"index_types": IndexType.NONE},
            {"enable_crcs": False},
        )
    ):
        assert texts(check_file(plain(tmp_path / f"{number}.mcap", messages, **options))) == [], (
            options
        )


@pytest.mark.slow
def test_each_changed_byte_is_found(bag):
    """Every byte of the file is covered by a CRC or by the structure."""
    file = bag / "bag_0.mcap"
    whole, rng = file.read_bytes(), np.random.default_rng(0)
    for place in rng.integers(0, len(whole), size=120):
        patched(file, place, bytes([whole[place] ^ int(rng.integers(1, 256))]))
        findings = check_bag(bag)
        assert texts(findings), f"byte {place} of {len(whole)}"
        assert all("bag_0.mcap" in text or "metadata.yaml" in text for text in texts(findings))
        file.write_bytes(whole)


def test_each_missing_end_is_found(bag):
    file = bag / "bag_0.mcap"
    whole = file.read_bytes()
    for length in (
        0,
        1,
        8,
        9,
        100,
        len(whole) // 2,
        len(whole) - 300,
        len(whole) - 8,
        len(whole) - 1,
    ):
        file.write_bytes(whole[:length])
        reason = "empty .0 bytes" if length == 0 else "end|magic"
        found = texts(check_bag(bag))
        assert any(re.search(reason, text) for text in found), (length, found)


def test_an_index_that_disagrees_with_the_messages_is_found(bag):
    """With a CRC that was computed for it: only the comparison can tell."""
    file = bag / "bag_0.mcap"
    whole = file.read_bytes()
    with open(file, "rb") as stream:
        index = make_reader(stream).get_summary().chunk_indexes[0]
    place = index.message_index_offsets[1] + 15  # log time of the first entry
    patched(file, place, struct.pack("<Q", START_NS + 5))
    found = texts(check_bag(bag))
    assert any(
        f"chunk at byte {index.chunk_start_offset}: its message index does not agree" in text
        for text in found
    ), found
    file.write_bytes(whole)
    patched(file, index.chunk_start_offset + 9, struct.pack("<Q", START_NS - 5))
    assert any(
        "its first and last time are not those of its messages" in text
        for text in texts(check_bag(bag))
    )


def resealed(whole, change):
    """The file with its summary changed and the CRC of the summary made to fit."""
    (start,) = struct.unpack_from("<Q", whole, len(whole) - 28)
    summary = change(bytearray(whole[start : len(whole) - 37]))
    tail = whole[len(whole) - 37 : len(whole) - 12]
    return (
        whole[:start] + summary + tail + struct.pack("<I", zlib.crc32(summary + tail)) + whole[-8:]
    )


def test_statistics_and_chunk_indexes_that_disagree_are_found(bag):
    file = bag / "bag_0.mcap"
    whole = file.read_bytes()

    def more_messages(summary):
        place = summary.index(struct.pack("<QHII", 600, 1, 2, 1))
        struct.pack_into("<Q", summary, place, 601)
        return summary

    def other_chunk(summary):
        place = summary.index(struct.pack("<Q", START_NS))
        # the first chunk's, after that of the statistics
        place = summary.index(struct.pack("<Q", START_NS), place + 8)
        struct.pack_into("<Q", summary, place, START_NS + 1)
        return summary

    file.write_bytes(resealed(whole, lambda summary: summary))
    assert check_bag(bag) == []
    file.write_bytes(resealed(whole, more_messages))
    told = (
        "warning: bag_0.mcap: the statistics say 601 for messages, found are 600 (write its index"
        " anew: dart-skill bag recover)"
    )
    assert texts(check_bag(bag)) == [] and texts(check_bag(bag), "warning") == [told], (
        "no message is lost"
    )
    file.write_bytes(resealed(whole, other_chunk))
    (found,) = texts(check_bag(bag))
    assert "the summary disagrees with it (message_start_time)" in found


def test_messages_of_a_chunk_that_the_summary_does_not_name_are_read(bag):
    """The check says that readers miss them, as its statistics leave them out, too."""
    file = bag / "bag_0.mcap"
    with open(file, "rb") as stream:
        told = make_reader(stream).get_summary()
    lost, statistics = told.chunk_indexes[1], told.statistics

    def without_it(summary):
        before = packed(statistics)
        for channel, place in lost.message_index_offsets.items():
            count = struct.unpack_from("<I", file.read_bytes(), place + 11)[0] // 16
            statistics.channel_message_counts[channel] -= count
            statistics.message_count -= count
        statistics.chunk_count -= 1
        return bytes(summary).replace(packed(lost), b"").replace(before, packed(statistics))

    file.write_bytes(resealed(file.read_bytes(), without_it))
    assert any(
        "1 chunks are not in the summary: readers miss their messages" in text
        for text in texts(check_bag(bag))
    )
    with BagReader(bag) as reader:
        assert reader.message_count == len(list(reader.messages())) == 600


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda told: told.update(message_count=7), "7 for messages in all, the files say 600"),
        (lambda told: told["duration"].update(nanoseconds=3), "3 for the duration"),
        (
            lambda told: told["starting_time"].update(nanoseconds_since_epoch=3),
            "3 for the time of the first message",
        ),
        (
            lambda told: told["topics_with_message_count"][0].update(message_count=3),
            "3 for messages on /hand, the files say 300",
        ),
        (
            lambda told: told["topics_with_message_count"].pop(),
            "topics it does not name, the files say .*/ball",
        ),
        (
            lambda told: told["topics_with_message_count"][0]["topic_metadata"].update(
                type="a/msg/B"
            ),
            "a/msg/B for the type of /hand",
        ),
        (lambda told: told["files"][0].update(message_count=3), "3 for messages in bag_0.mcap"),
        (
            lambda told: told["files"][0]["duration"].update(nanoseconds=3),
            "start and duration of bag_0.mcap",
        ),
        (lambda told: told.update(duration=[3]), "misuses duration: it must be a mapping"),
    ],
)
def test_a_metadata_file_that_disagrees_is_told_and_nothing_is_lost(bag, change, reason):
    told = yaml.safe_load((bag / "metadata.yaml").read_text())
    change(told["rosbag2_bagfile_information"])
    (bag / "metadata.yaml").write_text(yaml.safe_dump(told))
    found = texts(check_bag(bag), "warning")
    assert len(found) == 1 and re.search(reason, found[0]), found
    assert texts(check_bag(bag)) == []
    with BagReader(bag) as reader:
        assert reader.message_count == 600


def test_a_file_that_the_metadata_names_and_that_is_missing_is_an_error(bag):
    told = yaml.safe_load((bag / "metadata.yaml").read_text())
    told["rosbag2_bagfile_information"].update(relative_file_paths=["bag_0.mcap", "bag_1.mcap"])
    (bag / "metadata.yaml").write_text(yaml.safe_dump(told))
    (found,) = texts(check_bag(bag))
    assert "bag_1.mcap: the file is missing" in found


def test_files_of_different_bags_in_a_folder_are_found(tmp_path, bag):
    other = record(tmp_path / "other")
    shutil.copy(other / "other_0.mcap", bag)
    assert "metadata.yaml does not name it" in texts(check_bag(bag), "warning")[0]
    (bag / "metadata.yaml").unlink()
    found = texts(check_bag(bag), "warning")
    assert any("different names (bag, other)" in text for text in found)
    assert any("it begins before bag_0.mcap ends" in text for text in found)
    plain(
        bag / "bag_1.mcap",
        [(1, 5, 0, b"\0\1\0\0\1\0\0\0\0")],
        definition_text="string data\n",
        type_name="std_msgs/msg/String",
    )
    assert any(
        "topic /hand has type std_msgs/msg/String here and geometry_msgs" in text
        for text in texts(check_bag(bag), "warning")
    )
    assert any("3 files and no metadata.yaml" in text for text in texts(check_bag(bag))), (
        "the reader refuses them"
    )


def test_types_encodings_and_messages_that_cannot_be_read_are_found(tmp_path):
    good = [(1, 5, 0, POSE_CDR), (1, 6, 1, POSE_CDR)]
    cases = {
        "topic /hand: it has type a/msg/B, which the bag does not define": (
            "warning",
            dict(definition_text="", type_name="a/msg/B"),
        ),
        "whose definition in the bag is damaged": (
            "error",
            dict(definition_text="float64[ x of no kind\n", type_name="a/msg/B"),
        ),
        "topic /hand: it has no type: its schema names none": ("warning", dict(type_name="")),
        "topic /hand: its messages are encoded as 'json', not as cdr": (
            "note",
            dict(encoding="json"),
        ),
    }
    for reason, (severity, options) in cases.items():
        # and nothing of the topic without messages
        (found,) = check_file(plain(tmp_path / "bad.mcap", good, **options))
        assert reason in str(found) and found.severity == severity, (reason, found)
    bad = [*good, (1, 7, 2, POSE_CDR[:40]), (1, 8, 3, b"\0\1\0\0" + b"\xff" * 80)]
    (found,) = texts(check_file(plain(tmp_path / "bad.mcap", bad)))
    assert f"topic /hand: 2 messages are no {POSE}; the first at log time 7 ns" in found


def test_a_given_type_makes_an_undefined_one_known(tmp_path):
    file = plain(tmp_path / "bare.mcap", [(1, 5, 0, POSE_CDR)], definition_text="")
    assert check_file(file) == check_file(file, TYPES) == [], "ROS 2 Jazzy has it"
    file = plain(
        tmp_path / "bare.mcap",
        [(1, 5, 0, POSE_CDR)],
        definition_text="",
        type_name="lab_msgs/msg/Pose",
    )
    given = typestore()
    given.register({"lab_msgs/msg/Pose": given.fielddefs[POSE]})
    assert len(texts(check_file(file), "warning")) == 1 and check_file(file, given) == []


def test_time_that_jumps_back_and_gaps_in_the_sequence_are_told(tmp_path):
    messages = [
        (1, stamp, sequence, POSE_CDR)
        for sequence, stamp in enumerate([100, 200, 300, 150, 160, 400])
    ]
    messages[4:] = [(1, 160, 9, POSE_CDR), (1, 400, 10, POSE_CDR)]
    found = texts(check_file(plain(tmp_path / "odd.mcap", messages)), "warning")
    assert len(found) == 2
    assert any("5 messages are missing in 1 gaps" in text for text in found), found
    assert any(
        "log time jumps back 1 times, by up to 0.000000 s, first at 300 ns" in text
        for text in found
    ), found
    looped = record(tmp_path / "looped", [*range(1, 50), *range(1, 50)])
    assert [finding.severity for finding in check_bag(looped)] == ["warning"]


def test_an_empty_bag_is_told(tmp_path):
    assert texts(check_bag(record(tmp_path / "bag", [])), "warning") == [
        "warning: bag: the bag holds no messages"
    ]
    (tmp_path / "folder").mkdir()
    assert "no .mcap file in this folder" in texts(check_bag(tmp_path / "folder"))[0]
    assert "no such bag" in texts(check_bag(tmp_path / "nothing"))[0]
    (tmp_path / "x_0.mcap").write_bytes(b"")
    assert "empty (0 bytes)" in texts(check_file(tmp_path / "x_0.mcap"))[0]


def test_a_bag_is_described_in_json(bag):
    told = json.loads(json.dumps(describe(bag)))
    assert (told["message_count"], told["start_ns"], told["duration_ns"]) == (
        600,
        START_NS,
        299 * STEP_NS,
    )
    assert told["size_bytes"] == (bag / "bag_0.mcap").stat().st_size and told["has_metadata_file"]
    assert told["custom_data"] == {"seed": "7"} and told["ros_distro"] == "jazzy"
    assert told["attachments"] == [
        {"name": "wam.yaml", "media_type": "application/yaml", "size_bytes": 10}
    ]
    (file,) = told["files"]
    assert (file["path"], file["message_count"], file["library"]) == (
        "bag_0.mcap",
        600,
        "dart_skill",
    )
    topic = told["topics"][0]
    assert (topic["name"], topic["type"], topic["count"], topic["type_hash"]) == (
        "/hand",
        POSE,
        300,
        type_hash(TYPES, POSE),
    )
    assert (
        topic["rate_hz"] == pytest.approx(300 / 2.99)
        and topic["is_defined"]
        and topic["encoding"] == "cdr"
    )
    assert topic["qos"][0]["reliability"] == "best_effort" and topic["qos"][0]["deadline"] == {
        "sec": 9223372036,
        "nsec": 854775807,
    }
    assert {
        key: value
        for key, value in describe(bag / "bag_0.mcap").items()
        if key not in ("path", "has_metadata_file")
    } == {key: value for key, value in told.items() if key not in ("path", "has_metadata_file")}
