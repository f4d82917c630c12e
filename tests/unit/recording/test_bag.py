"""Bags as rosbag2 lays them out: read back by our reader and by others' code, every message equal."""

import os
import struct
from itertools import islice as take

import numpy as np
import pytest
import yaml
import zstandard
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2.metadata import parse_qos

from dart_skill.recording import (
    BagError,
    BagReader,
    BagWriter,
    GraphBag,
    definition,
    qos_yaml,
    serialize,
    type_hash,
    typestore,
)
from dart_skill.recording.bags.metadata import profiles
from tests.unit.recording.bag_files import mcap_file, write_bag

TOPICS = {
    "/vrpn_mocap/hand/pose": ("geometry_msgs/msg/PoseStamped", qos_yaml("best_effort", depth=5)),
    "/joint_states": ("sensor_msgs/msg/JointState", qos_yaml()),
    "/simulation/state": ("dart_skill_msgs/msg/SimulationState", qos_yaml(depth=1000)),
    "/robot_description": ("std_msgs/msg/String", qos_yaml(durability="transient_local", depth=1)),
}
START_NS = 1_700_000_000_000_000_000
STEP_NS = 2_000_000


@pytest.fixture(scope="module")
def types():
    return typestore()


def random_message(types, type_name, stamp_ns, rng):
    sec, nanosec = divmod(stamp_ns, 10**9)
    header = {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": "world"}
    point = dict(zip("xyz", rng.normal(size=3), strict=True))
    content = {
        "PoseStamped": {"header": header, "pose": {"position": point, "orientation": {"w": 1.0}}},
        "JointState": {
            "header": header,
            "name": [f"joint_{i}" for i in range(7)],
            "position": rng.normal(size=7),
        },
        "SimulationState": {
            "header": header,
            "episode": 3,
            "joint_effort": rng.normal(size=7),
            "held": "ball",
        },
        "String": {"data": "<robot name='wam'/>"},
    }
    return serialize(types, type_name, content[type_name.rsplit("/", 1)[1]])


def record(path, types, n_steps=700, topics=TOPICS, **options):
    """A bag with every topic; returns the messages (topic, log time, publish time, bytes) in
    order.
    """
    rng, written = np.random.default_rng(0), []
    with BagWriter(path, **options) as bag:
        for name, (type_name, qos) in topics.items():
            bag.add_topic(
                name, type_name, definition(types, type_name), qos, type_hash(types, type_name)
            )
        for step in range(n_steps):
            for index, (name, (type_name, _)) in enumerate(topics.items()):
                if name == "/robot_description" and step:
                    continue
                stamp = START_NS + step * STEP_NS
                item = (
                    name,
                    stamp + 1000 * index,
                    stamp,
                    random_message(types, type_name, stamp, rng),
                )
                bag.write(*item)
                written.append(item)
        bag.add_attachment("wam.yaml", "joints: 7\n", "application/yaml", START_NS)
        bag.add_attachment("wam.urdf", b"<robot/>", "application/xml")
    return written


@pytest.fixture(scope="module")
def bag(tmp_path_factory, types):
    path = tmp_path_factory.mktemp("bags") / "throws"
    written = record(path, types, custom_data={"seed": "7"})
    return path, written


def test_every_crc_fits_and_definitions_come_before_their_messages(bag):
    """Read without seeking: the CRC of all before the summary is checked too."""
    path, written = bag
    with open(path / "throws_0.mcap", "rb") as stream:
        read = list(
            NonSeekingReader(stream, validate_crcs=True).iter_messages(log_time_order=False)
        )
    assert [
        (channel.topic, message.log_time, message.publish_time, message.data)
        for _, channel, message in read
    ] == written
    assert [
        message.sequence for _, channel, message in read if channel.topic == "/joint_states"
    ] == list(range(700))
    with open(path / "throws_0.mcap", "rb") as stream:
        crcs = [
            record.uncompressed_crc
            for record in StreamReader(stream, emit_chunks=True).records
            if hasattr(record, "uncompressed_crc")
        ]
    assert len(crcs) > 1 and all(crcs)


def test_the_index_of_every_chunk_finds_its_messages(bag):
    path, written = bag
    with open(path / "throws_0.mcap", "rb") as stream:
        summary = make_reader(stream).get_summary()
        counts = summary.statistics.channel_message_counts
        for index in summary.chunk_indexes:
            stream.seek(index.chunk_start_offset)
            records = list(
                take(
                    StreamReader(stream, skip_magic=True, emit_chunks=True).records,
                    1 + len(index.message_index_offsets),
                )
            )
            chunk, message_indexes = records[0], records[1:]
            raw = zstandard.decompress(chunk.data)
            for one in message_indexes:
                counts[one.channel_id] -= len(one.records)
                for log_time, place in one.records:
                    opcode, _, channel, _, its_time = struct.unpack_from("<BQHIQ", raw, place)
                    assert (opcode, channel, its_time) == (5, one.channel_id, log_time)
    assert set(counts.values()) == {0}


def test_our_reader_reads_every_message_equal_with_and_without_the_metadata_file(bag, types):
    path, written = bag
    expected = [(topic, log, data) for topic, log, _, data in written]
    for place in (path, path / "throws_0.mcap"):
        with BagReader(place) as reader:
            read = list(reader.messages(decode=False))
            assert [(m.topic, m.stamp_ns, m.data) for m in read] == expected
            assert reader.message_count == len(written)
            assert (reader.start_ns, reader.end_ns) == (expected[0][1], expected[-1][1])
            for ours, raw in zip(reader.messages(), read, strict=True):
                assert serialize(types, ours.type_name, ours.data) == raw.data


def test_choosing_topics_and_times(bag):
    path, written = bag
    start, stop = START_NS + 100 * STEP_NS, START_NS + 200 * STEP_NS
    with BagReader(path) as reader:
        read = [m.stamp_ns for m in reader.messages(["/joint_states"], start, stop, decode=False)]
        assert read == [
            log for topic, log, *_ in written if topic == "/joint_states" and start <= log < stop
        ]
        with pytest.raises(BagError, match="no topic .'/ball'.*, only .*'/joint_states'"):
            list(reader.messages(["/ball"]))


def test_topics_tell_type_count_hash_and_qos(bag, types):
    path, _ = bag
    with BagReader(path) as reader:
        topics = reader.topics
        assert {name: (info.type_name, info.count) for name, info in topics.items()} == {
            name: (type_name, 1 if name == "/robot_description" else 700)
            for name, (type_name, _) in TOPICS.items()
        }
        assert topics["/joint_states"].type_hash == type_hash(types, "sensor_msgs/msg/JointState")
        (pose,), (description,) = (
            topics["/vrpn_mocap/hand/pose"].qos,
            topics["/robot_description"].qos,
        )
        assert pose.reliability == QosReliability.BEST_EFFORT and pose.depth == 5
        assert description.durability == QosDurability.TRANSIENT_LOCAL
        assert reader.custom_data == {"seed": "7"}


def test_attachments_come_back(bag):
    with BagReader(bag[0]) as reader:
        found = {item.name: (item.media_type, item.data) for item in reader.attachments()}
    assert found == {
        "wam.yaml": ("application/yaml", b"joints: 7\n"),
        "wam.urdf": ("application/xml", b"<robot/>"),
    }


def test_the_layout_is_that_of_rosbag2(bag, types):
    path, written = bag
    assert sorted(file.name for file in path.iterdir()) == ["metadata.yaml", "throws_0.mcap"]
    information = yaml.safe_load((path / "metadata.yaml").read_text())[
        "rosbag2_bagfile_information"
    ]
    assert information["version"] == 9 and information["storage_identifier"] == "mcap"
    assert information["message_count"] == information["files"][0]["message_count"] == len(written)
    assert information["starting_time"]["nanoseconds_since_epoch"] == START_NS
    assert information["duration"]["nanoseconds"] == written[-1][1] - START_NS
    topic = information["topics_with_message_count"][0]["topic_metadata"]
    assert topic["offered_qos_profiles"][0]["reliability"] == "best_effort"
    with open(path / "throws_0.mcap", "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary, records = reader.get_summary(), list(reader.iter_metadata())
        assert reader.get_header().profile == "ros2"
    assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
    for channel in summary.channels.values():
        type_name, qos = TOPICS[channel.topic]
        assert channel.message_encoding == "cdr"
        assert channel.metadata == {
            "offered_qos_profiles": qos,
            "topic_type_hash": type_hash(types, type_name),
        }
    assert all(index.compression == "zstd" for index in summary.chunk_indexes)
    assert max(index.uncompressed_size for index in summary.chunk_indexes) < 300 * 1024
    opened, closed = (yaml.safe_load(record.metadata["serialized_metadata"]) for record in records)
    assert (opened["message_count"], closed["message_count"]) == (0, len(written))
    assert closed == information


def messages_on_disk(file):
    """Log times of the messages that a file holds, whole or cut off."""
    times = []
    with open(file, "rb") as stream:
        try:
            for found in StreamReader(stream).records:
                if isinstance(found, Message):
                    times.append(found.log_time)
        except EndOfFile:
            pass
    return times


def test_each_second_of_log_time_is_on_disk_while_the_bag_is_still_open(tmp_path, types):
    """What a recorder leaves that is killed."""
    type_name = "sensor_msgs/msg/JointState"
    data = random_message(types, type_name, START_NS, np.random.default_rng(0))
    bag = BagWriter(tmp_path / "bag")
    bag.add_topic("/joint_states", type_name, definition(types, type_name))
    times = [START_NS + step * STEP_NS for step in range(1300)]
    times += [START_NS - 10**9, START_NS - 10**9 + STEP_NS]  # time jumps back
    for stamp in times[:-2]:
        bag.write("/joint_states", stamp, stamp, data)
    assert messages_on_disk(bag.file) == times[:1000], "two whole seconds"
    for stamp in times[-2:]:
        bag.write("/joint_states", stamp, stamp, data)
    assert messages_on_disk(bag.file) == times[:-2]
    bag.flush(to_disk=True)
    assert messages_on_disk(bag.file) == times
    assert not (bag.path / "metadata.yaml").exists()
    bag.close()
    with BagReader(bag.path) as reader:
        assert [m.stamp_ns for m in reader.messages(decode=False)] == sorted(times)


def test_what_was_written_before_an_exception_is_a_whole_bag(tmp_path, types):
    with pytest.raises(RuntimeError, match="power"):
        with BagWriter(tmp_path / "bag") as bag:
            bag.add_topic("/text", "std_msgs/msg/String", definition(types, "std_msgs/msg/String"))
            bag.write("/text", 5, 5, serialize(types, "std_msgs/msg/String", {"data": "hello"}))
            assert bag.counts == {"/text": 1}
            raise RuntimeError("power")
    with BagReader(tmp_path / "bag") as reader:
        assert [m.data.data for m in reader.messages()] == ["hello"]


def test_an_existing_folder_is_refused_and_left_alone(tmp_path):
    (tmp_path / "bag").mkdir()
    with pytest.raises(FileExistsError, match="never overwritten"):
        BagWriter(tmp_path / "bag")
    assert list((tmp_path / "bag").iterdir()) == []


def test_misuse_of_the_writer_is_refused_by_name(tmp_path, types):
    text = definition(types, "std_msgs/msg/String")
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/a", "std_msgs/msg/String", text)
        for arguments, reason in (
            (("a", "std_msgs/msg/String", text), "leading slash"),
            (("/a", "std_msgs/msg/String", text), "in the bag already"),
            (("/b", "std_msgs/String", text), "package/msg/Name"),
            (("/b", "std_msgs/msg/String", "string text\n"), "another definition"),
            (("/b", "std_msgs/msg/String", text, "a: ["), "no YAML"),
            (("/b", "std_msgs/msg/String", text, "depth: 3"), "YAML list"),
        ):
            with pytest.raises(ValueError, match=reason):
                bag.add_topic(*arguments)
        with pytest.raises(ValueError, match="'/c' is not in the bag, only .'/a'"):
            bag.write("/c", 0, 0, b"\0\1\0\0")
        with pytest.raises(ValueError, match="must not be negative"):
            bag.write("/a", -1, 0, b"\0\1\0\0")
    with pytest.raises(ValueError, match="is closed"):
        bag.write("/a", 0, 0, b"\0\1\0\0")
    with pytest.raises(ValueError, match="custom_data"):
        BagWriter(tmp_path / "other", custom_data={"seed": 7})
    assert not (tmp_path / "other").exists()
    with pytest.raises(ValueError, match="QoS reliability = 'maybe'"):
        qos_yaml("maybe")


def damaged(folder, source, data):
    folder.mkdir()
    (folder / "bag.mcap").write_bytes(data(source.read_bytes()))
    return folder / "bag.mcap"


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (lambda whole: b"", "is empty \\(0 bytes\\)"),
        (lambda whole: b"SQLite format 3\0" * 9, "SQLite cannot read it"),
        (lambda whole: whole[:8], "cut off or damaged"),
        (lambda whole: whole[: len(whole) // 2], "cut off or damaged"),
        (lambda whole: whole[:-1], "cut off or damaged"),
    ],
)
def test_damaged_files_are_refused_with_a_reason(bag, tmp_path, data, reason):
    file = damaged(tmp_path / "bad", bag[0] / "throws_0.mcap", data)
    for place in (file, file.parent):
        with pytest.raises(BagError, match=reason) as caught:
            BagReader(place)
        assert "bag.mcap" in str(caught.value)


def test_a_flipped_byte_in_a_chunk_is_found(bag, tmp_path):
    def flip(whole):
        within = len(whole) // 4  # of the messages: definitions and index come behind
        return whole[:within] + bytes([whole[within] ^ 0xFF]) + whole[within + 1 :]

    file = damaged(tmp_path / "bad", bag[0] / "throws_0.mcap", flip)
    with BagReader(file) as reader, pytest.raises(BagError, match="bag.mcap"):
        list(reader.messages())


def test_truncation_at_any_byte_is_an_error_and_never_a_shorter_bag(tmp_path, types):
    record(tmp_path / "small", types, n_steps=3)
    whole = (tmp_path / "small" / "small_0.mcap").read_bytes()
    file = tmp_path / "cut.mcap"
    for length in [*range(0, 100), *np.random.default_rng(0).integers(100, len(whole), size=200)]:
        file.write_bytes(whole[:length])
        with pytest.raises(BagError):
            with BagReader(file) as reader:
                list(reader.messages())


def test_missing_bags_and_files_are_named(tmp_path, bag):
    with pytest.raises(BagError, match="no such bag"):
        BagReader(tmp_path / "nothing")
    with pytest.raises(BagError, match="no .mcap file in this folder"):
        BagReader(tmp_path)
    (tmp_path / "notes.txt").write_text("x")
    with pytest.raises(BagError, match="a bag is a folder"):
        BagReader(tmp_path / "notes.txt")
    for name in ("a_0.mcap", "a_1.mcap"):
        (tmp_path / name).write_bytes((bag[0] / "throws_0.mcap").read_bytes())
    with pytest.raises(BagError, match="2 files and no metadata.yaml"):
        BagReader(tmp_path)
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: 3")
    with pytest.raises(BagError, match="metadata"):
        BagReader(tmp_path)


def test_a_type_that_nobody_defines_can_be_read_raw_only(tmp_path, types):
    point = serialize(types, "geometry_msgs/msg/Point", {"x": 3.0})
    channels = [("/point", "lab_msgs/msg/Point"), ("/known", "geometry_msgs/msg/Point")]
    file = mcap_file(
        tmp_path / "foreign.mcap",
        [(*one, {"schema": "none", "text": ""}) for one in channels],
        [(0, 5, point), (1, 5, point)],
    )
    with BagReader(file) as reader:
        assert len(list(reader.messages(decode=False))) == 2
        assert [m.data.x for m in reader.messages("/known")] == [3.0], (
            "a standard type needs no definition"
        )
        with pytest.raises(BagError, match="/point has type lab_msgs/msg/Point, which neither"):
            list(reader.messages("/point"))
    given = typestore()
    given.register({"lab_msgs/msg/Point": given.fielddefs["geometry_msgs/msg/Point"]})
    with BagReader(file, given) as reader:
        assert [m.data.x for m in reader.messages()] == [3.0, 3.0]


def test_a_message_that_its_definition_does_not_fit_is_an_error(tmp_path):
    wrong = b"\0\1\0\0\xff\xff\0\0abc"
    write_bag(tmp_path / "bag", [("/text", "std_msgs/msg/String", 5, wrong)])
    with (
        BagReader(tmp_path / "bag") as reader,
        pytest.raises(BagError, match="/text: 11 bytes are no std_msgs"),
    ):
        list(reader.messages())


# many files of one bag


def split_bag(path, types, **limits):
    """A bag of poses at 100 Hz in several files; returns its messages."""
    type_name, rng, written = "geometry_msgs/msg/PoseStamped", np.random.default_rng(0), []
    with BagWriter(path, custom_data={"seed": "7"}, **limits) as bag:
        for name in ("/hand", "/ball"):
            bag.add_topic(
                name,
                type_name,
                definition(types, type_name),
                qos_yaml(),
                type_hash(types, type_name),
            )
        for step in range(1000):
            name, stamp = ("/hand", "/ball")[step % 2], START_NS + step * 10_000_000
            data = random_message(types, type_name, stamp, rng)
            bag.write(name, stamp, stamp, data)
            written.append((name, stamp, data))
            if step == 600:
                bag.note("lost", "/ball: 3")
    return written


@pytest.mark.parametrize(
    "limits", [{"max_duration_ns": 3_000_000_000}, {"max_bytes": 30_000, "chunk_size": 4096}]
)
def test_a_bag_is_split_into_whole_files_that_all_readers_join_again(tmp_path, types, limits):
    path = tmp_path / "bag"
    written = split_bag(path, types, **limits)
    files = [path / f"bag_{number}.mcap" for number in range(len(list(path.glob("*.mcap"))))]
    assert len(files) >= 4 and all(file.is_file() for file in files)
    with BagReader(path) as reader, AnyReader([path]) as other:
        assert [(m.topic, m.stamp_ns, m.data) for m in reader.messages(decode=False)] == written
        assert [(c.topic, stamp, bytes(raw)) for c, stamp, raw in other.messages()] == written
        assert reader.custom_data == {"seed": "7", "lost": "/ball: 3"}
        assert {name: topic.count for name, topic in reader.topics.items()} == {
            "/hand": 500,
            "/ball": 500,
        }
    information = yaml.safe_load((path / "metadata.yaml").read_text())[
        "rosbag2_bagfile_information"
    ]
    assert information["relative_file_paths"] == [file.name for file in files]
    for file, told in zip(files, information["files"], strict=True):
        with open(file, "rb") as stream:
            read = list(make_reader(stream, validate_crcs=True).iter_messages())
            stream.seek(0)
            *_, last = make_reader(stream).iter_metadata()
        closed = yaml.safe_load(last.metadata["serialized_metadata"])
        times = [message.log_time for _, _, message in read]
        assert told["path"] == file.name and told["message_count"] == closed[
            "message_count"
        ] == len(read)
        assert told["starting_time"]["nanoseconds_since_epoch"] == min(times)
        assert (
            told["duration"]["nanoseconds"]
            == max(times) - min(times)
            < limits.get("max_duration_ns", 10**18)
        )
        assert file.stat().st_size <= limits.get("max_bytes", 10**9)


def test_a_lone_file_tells_the_custom_data_hashes_and_qos(tmp_path, types):
    split_bag(tmp_path / "bag", types)
    with BagReader(tmp_path / "bag" / "bag_0.mcap") as lone, BagReader(tmp_path / "bag") as whole:
        assert lone.custom_data == whole.custom_data == {"seed": "7", "lost": "/ball: 3"}
        assert lone.topics == whole.topics and lone.topics["/hand"].type_hash


def test_a_split_bag_without_metadata_file_is_read_and_strangers_are_not(tmp_path, types):
    path = tmp_path / "bag"
    written = split_bag(path, types, max_duration_ns=1_000_000_000)  # bag_10 comes after bag_9
    (path / "metadata.yaml").unlink()
    with BagReader(path) as reader:
        assert [(m.topic, m.stamp_ns, m.data) for m in reader.messages(decode=False)] == written
        assert reader.custom_data["seed"] == "7" and len(reader.files) == 10
    missing = (path / "bag_4.mcap").read_bytes()
    record(tmp_path / "other", types, n_steps=3, topics={"/hand": TOPICS["/joint_states"]})
    (path / "bag_4.mcap").write_bytes((tmp_path / "other" / "other_0.mcap").read_bytes())
    with pytest.raises(
        BagError, match="10 files and no metadata.yaml.*disagree on the type of /hand"
    ):
        BagReader(path)
    (path / "bag_4.mcap").write_bytes(missing[:-1])
    with pytest.raises(BagError, match="bag_4.mcap.*recover"):
        BagReader(path)


def test_limits_that_make_no_sense_are_refused(tmp_path):
    for limits in ({"max_bytes": -1}, {"max_duration_ns": -1}, {"max_bytes": 1000}):
        with pytest.raises(ValueError, match="give 0 for no limit"):
            BagWriter(tmp_path / "bag", **limits)
    assert not (tmp_path / "bag").exists()


# the promise of flush


def test_a_flush_with_nothing_new_writes_nothing(tmp_path, types):
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/a", "std_msgs/msg/String", definition(types, "std_msgs/msg/String"))
        bag.write("/a", 1, 1, serialize(types, "std_msgs/msg/String", None))
        bag.flush()
        size = bag.file.stat().st_size
        for _ in range(100):
            bag.flush()
            bag.flush(to_disk=True)
        assert bag.file.stat().st_size == size


def test_what_is_flushed_to_the_disk_was_synced_after_it_was_written(tmp_path, types, monkeypatch):
    synced = []
    real = os.fdatasync
    monkeypatch.setattr(
        os, "fdatasync", lambda fd: (real(fd), synced.append(os.fstat(fd).st_size))
    )
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/a", "std_msgs/msg/String", definition(types, "std_msgs/msg/String"))
        for stamp in range(5):
            bag.write("/a", stamp, stamp, serialize(types, "std_msgs/msg/String", None))
            bag.flush(to_disk=True)
            assert synced[-1] == bag.file.stat().st_size
    assert synced[-1] == bag.file.stat().st_size, "and the end of the file when it is closed"


def test_notes_are_texts_and_end_with_the_bag(tmp_path):
    bag = BagWriter(tmp_path / "bag")
    with pytest.raises(ValueError, match="custom_data holds texts only"):
        bag.note("lost", 3)
    bag.note("lost", "3")
    bag.close()
    with pytest.raises(ValueError, match="is closed"):
        bag.note("lost", "4")
    with BagReader(bag.path) as reader:
        assert reader.custom_data == {"lost": "3"}


@pytest.mark.parametrize(
    "view",
    [
        bytearray,
        memoryview,
        lambda data: np.frombuffer(data, np.uint8),
        lambda data: memoryview(data).cast("I"),
    ],
)
def test_any_buffer_of_bytes_is_written_as_it_is_now(tmp_path, types, view):
    data = bytearray(serialize(types, "std_msgs/msg/String", {"data": "hello w"}))
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/a", "std_msgs/msg/String", definition(types, "std_msgs/msg/String"))
        bag.write("/a", 1, 1, view(data))
        data[8] = ord("j")
        for wrong in ("text", 7, b"\0\1"):
            with pytest.raises((TypeError, ValueError)):
                bag.write("/a", 1, 1, wrong)
        with pytest.raises(ValueError, match="must not be negative"):
            bag.write("/a", 1, 1.5, b"\0\1\0\0")
    with BagReader(bag.path) as reader:
        assert [m.data.data for m in reader.messages()] == ["hello w"]


# bags of others


def write_plain(file, types, stamps, **options):
    """A file of plain `mcap` with strings that say their log time."""
    messages = [
        (0, int(stamp), serialize(types, "std_msgs/msg/String", {"data": str(stamp)}))
        for stamp in stamps
    ]
    channels = [("/text", "std_msgs/msg/String")]
    return mcap_file(file, channels, messages, profile="", chunk_size=1000, **options)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"compression": CompressionType.LZ4},
        {"compression": CompressionType.NONE},
        {"use_chunking": False},
        {"index_types": IndexType.NONE},
        {"index_types": IndexType.CHUNK},
        {"use_statistics": False, "repeat_channels": False, "repeat_schemas": False},
        {
            "use_statistics": False,
            "repeat_channels": False,
            "repeat_schemas": False,
            "index_types": IndexType.NONE,
            "use_summary_offsets": False,
        },
    ],
)
@pytest.mark.parametrize("order", ["sorted", "shuffled", "twice the same time"])
def test_files_of_plain_mcap_are_read_in_order_of_log_time(tmp_path, types, options, order):
    stamps = np.arange(400)
    if order == "shuffled":
        stamps = np.random.default_rng(0).permutation(stamps)
    elif order == "twice the same time":
        stamps = np.concatenate([stamps, stamps])
    with BagReader(write_plain(tmp_path / "plain.mcap", types, stamps, **options)) as reader:
        read = list(reader.messages())
        assert [message.stamp_ns for message in read] == sorted(stamps)
        assert all(message.data.data == str(message.stamp_ns) for message in read)
        assert [m.stamp_ns for m in reader.messages("/text", 100, 103, decode=False)] == [
            s for s in sorted(stamps) if 100 <= s < 103
        ]
        assert (reader.message_count, reader.start_ns, reader.end_ns) == (len(stamps), 0, 399)


def test_of_a_bag_that_is_thinned_each_topic_has_a_message_now_and_then(bag):
    path, written = bag
    with BagReader(path) as reader:
        everything = [(item.topic, item.stamp_ns) for item in reader.messages(decode=False)]
        some = [
            (item.topic, item.stamp_ns)
            for item in reader.messages(decode=False, every_ns=50_000_000)
        ]
    assert set(some) < set(everything) and {topic for topic, _ in some} == {
        topic for topic, _ in everything
    }
    for topic in {topic for topic, _ in some}:
        stamps = np.array([stamp for name, stamp in some if name == topic])
        assert (np.diff(stamps) >= 50_000_000).all()
        all_of_it = np.array([stamp for name, stamp in everything if name == topic])
        assert stamps[0] == all_of_it[0]


def test_a_graph_is_read_whichever_namespace_it_ran_in(tmp_path):
    commands = "dart_skill_msgs/msg/WamCommand"
    topics = {
        "/arm1/wam/command": commands,
        "/arm1/wam/other": "std_msgs/msg/String",
        "/arm12/wam/other": "std_msgs/msg/String",
        "/tf": "std_msgs/msg/String",
    }
    _write_empty(tmp_path / "bag", topics)
    with GraphBag(tmp_path / "bag") as bag:
        assert bag.namespace == "/arm1"
        assert set(bag.topics) == {"/wam/command", "/wam/other", "/arm12/wam/other", "/tf"}
        assert [message.topic for message in bag.messages(["/wam/other", "/tf"])] == [
            "/wam/other",
            "/tf",
        ]
        assert bag.topics["/wam/other"].name == "/wam/other"
        with pytest.raises(BagError, match=r"no topic \['/arm1/wam/other'\]"):
            next(bag.messages(["/arm1/wam/other"]))


def test_a_bag_of_two_graphs_is_refused_and_both_are_named(tmp_path):
    _write_empty(
        tmp_path / "bag",
        dict.fromkeys(("/wam/command", "/arm2/wam/command"), "dart_skill_msgs/msg/WamCommand"),
    )
    with pytest.raises(
        BagError,
        match="several graphs, in the namespaces /, /arm2: record each into a bag of its own",
    ):
        GraphBag(tmp_path / "bag")


def _write_empty(path, topics):
    """A bag with a message of only zeros on each topic."""
    write_bag(path, [(name, kind, ns, {}) for ns, (name, kind) in enumerate(topics.items(), 1)])


# types and profiles


def test_bags_that_define_the_same_share_their_types(tmp_path):
    types = typestore()
    for name in ("first", "second"):
        write_bag(tmp_path / name, [("/words", "std_msgs/msg/String", 1, {"data": name})])
    with BagWriter(tmp_path / "bare") as bag:
        bag.add_topic("/words", "std_msgs/msg/String", "")
        bag.write("/words", 1, 1, serialize(types, "std_msgs/msg/String", {"data": "bare"}))
    with BagReader(tmp_path / "first") as first, BagReader(tmp_path / "second") as second:
        assert first.types is second.types and [one.data.data for one in first.messages()] == [
            "first"
        ]
    for given in (None, types):  # a standard type needs no definition
        with BagReader(tmp_path / "bare", given) as bare:
            assert [one.data.data for one in bare.messages()] == ["bare"]


@pytest.mark.parametrize(
    "text",
    [
        "",
        qos_yaml(),
        qos_yaml("best_effort", durability="transient_local", depth=3),
        qos_yaml().replace("reliable", "3").replace("keep_last", "2"),
        qos_yaml().replace("reliable", "nonsense").replace("keep_last", "77"),
    ],
)
def test_profiles_are_those_that_rosbags_reads(text):
    assert profiles("/a", text) == tuple(parse_qos(text))
    assert profiles("/a", yaml.safe_load(text) or []) == tuple(parse_qos(text))
