"""Whether a message is read depends on its topic and type alone: all that describes a bag may be
missing, wrong or damaged.
"""

import shutil
import struct

import lz4.frame
import pytest
import yaml
import zstandard
from mcap.writer import CompressionType, IndexType
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from dart_skill.recording import BagError, BagReader, deserialize, message, serialize
from dart_skill.recording.bags import check_bag, check_file, describe
from tests.unit.recording.bag_files import (
    POSE,
    POSE_CDR,
    START_NS,
    STEP_NS,
    STRING,
    TYPES,
    mcap_file,
    metadata_of,
    sqlite_file,
    stamps,
    write_metadata,
)

QOS = {
    "none": "",
    "of Jazzy": (
        "- history: keep_last\n  depth: 10\n  reliability: reliable\n  durability: volatile\n "
        " deadline: {sec: 0, nsec: 0}\n"
    ),
    "numbers without deadline": "- history: 1\n  depth: 5\n  reliability: 1\n  durability: 2\n",
    "no YAML": "- [",
    "another kind": "reliable",
    "a mapping": "{depth: 3, reliability: best_effort}",
    "odd values": "- {depth: many, deadline: 3, history: [], lifespan: {sec: x}}",
}
POSES = [(0, stamp, POSE_CDR) for stamp in stamps()]


def read(path, topics=None, **options):
    with BagReader(path, **options) as bag:
        return list(bag.messages(topics))


def is_whole(path, count=20, topic="/p"):
    """Whether all poses are read, decoded and counted, and nothing that the check says is an
    error.
    """
    found = read(path, [topic])
    assert [one.data.pose.position.x for one in found] == [3.0] * count and {
        one.type_name for one in found
    } == {POSE}
    with BagReader(path) as bag:
        assert bag.topics[topic].count == count
    return [one for one in check_bag(path) if one.severity != "note"]


def said(findings):
    return " | ".join(map(str, findings))


def folder_of(path, told=None, file=None, **writing):
    path.mkdir()
    file = file or sqlite_file
    name = "bag_0.db3" if file is sqlite_file else "bag_0.mcap"
    file(path / name, [("/p", POSE, "", "cdr")] if file is sqlite_file else [("/p", POSE)], POSES)
    if told is not None:
        write_metadata(path, told, **writing)
    return path


# quality of service


@pytest.mark.parametrize("qos", QOS.values(), ids=QOS)
def test_quality_of_service_decides_nothing(tmp_path, qos):
    mcap_file(
        tmp_path / "a.mcap", [("/p", POSE, {"metadata": {"offered_qos_profiles": qos}})], POSES
    )
    sqlite_file(tmp_path / "a.db3", [("/p", POSE, qos, "cdr")], POSES)
    assert is_whole(tmp_path / "a.mcap") == is_whole(tmp_path / "a.db3") == []
    told = metadata_of(9, ["bag_0.db3"], [("/p", POSE, 20)], 20)
    told["topics_with_message_count"][0]["topic_metadata"]["offered_qos_profiles"] = qos
    assert is_whole(folder_of(tmp_path / "bag", told)) == []
    assert json_able(describe(tmp_path / "bag"))


def json_able(told):
    return yaml.safe_dump(told) != ""


def test_what_a_profile_does_not_say_is_as_ros_has_it_and_what_is_none_is_not_known(tmp_path):
    with BagReader(
        mcap_file(
            tmp_path / "a.mcap",
            [("/p", POSE, {"metadata": {"offered_qos_profiles": QOS["a mapping"]}})],
            POSES,
        )
    ) as bag:
        (profile,) = bag.topics["/p"].qos
    assert (profile.depth, profile.reliability.name, profile.durability.name) == (
        3,
        "BEST_EFFORT",
        "VOLATILE",
    )


# metadata.yaml


@pytest.mark.parametrize("version", range(1, 10))
@pytest.mark.parametrize("file", [sqlite_file, mcap_file])
def test_metadata_of_every_version_of_rosbag2_are_read(tmp_path, version, file):
    name, storage = ("bag_0.db3", "sqlite3") if file is sqlite_file else ("bag_0.mcap", "mcap")
    told = metadata_of(
        version, [name if version >= 4 else f"bag/{name}"], [("/p", POSE, 20)], 20, storage=storage
    )
    assert is_whole(folder_of(tmp_path / "bag", told, file)) == []


CHANGES = {
    "an old folder": lambda told: told.update(
        relative_file_paths=["/somewhere/old bag/bag_0.db3"]
    ),
    "a folder of Windows": lambda told: told.update(
        relative_file_paths=["C:\\bags\\old\\bag_0.db3"]
    ),
    "another name": lambda told: told.update(relative_file_paths=["recorded_0.db3"]),
    "an unknown storage": lambda told: told.update(storage_identifier="my_plugin"),
    "the other storage": lambda told: told.update(storage_identifier="mcap"),
    "no storage": lambda told: told.pop("storage_identifier"),
    "no version": lambda told: told.pop("version"),
    "a later version": lambda told: told.update(version=12),
    "a version that is none": lambda told: told.update(version="nine"),
    "no topics": lambda told: told.pop("topics_with_message_count"),
    "other topics": (
        lambda told: told["topics_with_message_count"][0]["topic_metadata"].update(name="/q")
    ),
    "another type": (
        lambda told: told["topics_with_message_count"][0]["topic_metadata"].update(type="a/msg/B")
    ),
    "another encoding": (
        lambda told: told["topics_with_message_count"][0]["topic_metadata"].update(
            serialization_format="wrong"
        )
    ),
    "fewer messages": lambda told: told.update(message_count=3),
    "other times": lambda told: told.update(
        starting_time={"nanoseconds_since_epoch": 5}, duration={"nanoseconds": 1}
    ),
    "no times": lambda told: (
        told.pop("starting_time"),
        told.pop("duration"),
        told.pop("message_count"),
    ),
    "no file names": lambda told: told.pop("relative_file_paths"),
    "a wrong compression": lambda told: told.update(
        compression_mode="MESSAGE", compression_format="zstd"
    ),
    "an unknown compression": lambda told: told.update(
        compression_mode="FILE", compression_format="xz"
    ),
    "numbers as custom data": lambda told: told.update(custom_data={"operator": 7}),
    "a list as custom data": lambda told: told.update(custom_data=[1]),
    "texts as files": lambda told: told.update(files=["bag_0.db3"]),
    "nothing at all": lambda told: told.clear(),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_metadata_that_are_wrong_or_missing_hide_no_message(tmp_path, change):
    told = metadata_of(9, ["bag_0.db3"], [("/p", POSE, 20)], 20)
    change(told)
    assert {one.severity for one in is_whole(folder_of(tmp_path / "bag", told))} <= {"warning"}


@pytest.mark.parametrize(
    ("encoding", "ending"), [("utf-8-sig", "\r\n"), ("utf-16", "\r\n"), ("latin-1", "\n")]
)
def test_metadata_that_an_editor_has_saved_are_read(tmp_path, encoding, ending):
    told = metadata_of(9, ["bag_0.db3"], [("/p", POSE, 20)], 20)
    told["custom_data"] = {"operator": "Jürgen"}
    assert is_whole(folder_of(tmp_path / "bag", told, encoding=encoding, ending=ending)) == []


@pytest.mark.parametrize("text", ["a: [", "", "[]", "rosbag2_bagfile_information:", "\0\1"])
def test_metadata_that_are_none_are_a_warning(tmp_path, text):
    path = folder_of(tmp_path / "bag")
    (path / "metadata.yaml").write_text(text)
    (found,) = is_whole(path)
    assert "metadata.yaml" in str(found) and found.severity == "warning"


def test_what_metadata_say_too_much_may_be_lost_unless_the_file_knows_better(tmp_path):
    for file, severity in ((sqlite_file, "error"), (mcap_file, "warning")):
        name = "bag_0.db3" if file is sqlite_file else "bag_0.mcap"
        path = folder_of(tmp_path / name, metadata_of(9, [name], [("/p", POSE, 21)], 21), file)
        assert {one.severity for one in is_whole(path) if "says 21" in one.message} == {severity}


# SQLite


@pytest.mark.parametrize("version", [1, 2, 3, 4])
def test_tables_of_every_version_are_read_as_rosbags_reads_them(tmp_path, version):
    file = sqlite_file(
        tmp_path / "a.db3",
        [("/p", POSE, "", "cdr"), ("/none", STRING, "", "cdr")],
        POSES[::-1],
        version,
    )
    before = file.read_bytes()
    assert said(is_whole(file)) in (
        "",
        (
            "warning: a.db3: log time jumps back 19 times, by up to 0.010000 s, first at"
            " 1000000000190000000 ns, on /p (a clock was set, or a simulation began anew)"
        ),
    )
    with Reader(file) as other, BagReader(file) as ours:
        assert [(one.topic, stamp, data) for one, stamp, data in other.messages()] == [
            (one.topic, one.stamp_ns, one.data) for one in ours.messages(decode=False)
        ]
        assert (ours.start_ns, ours.end_ns + 1, ours.message_count) == (
            other.start_time,
            other.end_time,
            other.message_count,
        )
        limits = START_NS + 3 * STEP_NS, START_NS + 7 * STEP_NS
        assert [one.stamp_ns for one in ours.messages(["/p"], *limits)] == stamps()[3:7]
        assert list(ours.messages(["/none"])) == []
    assert file.read_bytes() == before and sorted(one.name for one in tmp_path.iterdir()) == [
        "a.db3"
    ], "it is only read"


def test_what_a_recorder_left_in_a_write_ahead_log_is_read_and_told_and_stays(tmp_path):
    file = sqlite_file(tmp_path / "a.db3", [("/p", POSE, "", "cdr")], POSES, wal=True)
    before = {one.name: one.read_bytes() for one in tmp_path.iterdir()}
    (found,) = is_whole(file)
    assert (
        "beside it lies a.db3-wal (a write-ahead log, which was read, too)" in found.message
        and found.severity == "warning"
    )
    assert {one.name: one.read_bytes() for one in tmp_path.iterdir()} == before


def test_what_a_recorder_had_half_written_is_undone_by_its_journal(tmp_path):
    import sqlite3

    file = sqlite_file(tmp_path / "a b#1%.db3", [("/p", POSE, "", "cdr")], POSES)
    journal = tmp_path / "a b#1%.db3-journal"
    with sqlite3.connect(file) as database:
        database.execute("PRAGMA cache_size = 5")
        database.executemany(
            "INSERT INTO messages (topic_id, timestamp, data) VALUES (1, ?, ?)",
            [(k, POSE_CDR) for k in range(3000)],
        )
        kept = file.read_bytes(), journal.read_bytes()
        database.rollback()
    database.close()
    file.write_bytes(kept[0])
    journal.write_bytes(kept[1])
    (found,) = is_whole(file)
    assert "(a journal, which was read, too)" in found.message
    assert (file.read_bytes(), journal.read_bytes()) == kept


def test_a_database_that_is_damaged_or_none_is_refused_and_the_check_says_so(tmp_path):
    whole = sqlite_file(tmp_path / "a.db3", [("/p", POSE, "", "cdr")], POSES * 50).read_bytes()
    for name, data in {"none": b"x" * 500, "cut": whole[: len(whole) // 2], "empty": b""}.items():
        (tmp_path / f"{name}.db3").write_bytes(data)
        with pytest.raises(BagError, match=f"{name}.db3"):
            read(tmp_path / f"{name}.db3")
        assert any(one.severity == "error" for one in check_file(tmp_path / f"{name}.db3")), name
    changed = bytearray(whole)
    changed[4096 * 3 : 4096 * 4] = bytes(4096)
    (tmp_path / "b.db3").write_bytes(changed)
    assert any(
        "SQLite" in one.message and one.severity == "error"
        for one in check_file(tmp_path / "b.db3")
    )
    import sqlite3

    with sqlite3.connect(tmp_path / "other.db3") as database:
        database.execute("CREATE TABLE people(name TEXT)")
    with pytest.raises(BagError, match="it is no bag: its table of topics lacks id, name, type"):
        read(tmp_path / "other.db3")


def test_rows_that_belong_to_no_topic_or_have_no_bytes_are_errors(tmp_path):
    file = sqlite_file(
        tmp_path / "a.db3",
        [("/p", POSE, "", "cdr")],
        [*POSES, (4, START_NS, POSE_CDR), (0, START_NS, None)],
    )
    with BagReader(file) as bag:
        assert len(list(bag.messages(["/p"]))) == 20
    text = said(check_file(file))
    assert (
        "1 messages are of channels [5]" in text
        and "1 messages cannot be read: they have no time, or no bytes" in text
    )


# compression


@pytest.mark.parametrize("pack", [zstandard.ZstdCompressor().compress, lz4.frame.compress])
@pytest.mark.parametrize("kind", ["sqlite", "mcap"])
def test_messages_that_were_compressed_one_by_one_say_so_themselves(tmp_path, pack, kind):
    packed = [(topic, stamp, pack(data)) for topic, stamp, data in POSES]
    if kind == "mcap":
        file = mcap_file(tmp_path / "a.mcap", [("/p", POSE)], packed)
    else:
        file = sqlite_file(tmp_path / "a.db3", [("/p", POSE, "", "cdr")], packed)
    assert is_whole(file) == []


@pytest.mark.parametrize(
    ("ending", "pack"),
    [(".zstd", zstandard.ZstdCompressor().compress), (".lz4", lz4.frame.compress)],
)
@pytest.mark.parametrize("told", [True, False])
def test_files_that_were_compressed_as_a_whole_are_read(tmp_path, ending, pack, told):
    path = folder_of(tmp_path / "bag")
    file = path / "bag_0.db3"
    (path / f"bag_0.db3{ending}").write_bytes(pack(file.read_bytes()))
    file.unlink()
    if told:
        write_metadata(path, metadata_of(5, [f"bag_0.db3{ending}"], [("/p", POSE, 20)], 20))
    assert [one for one in is_whole(path) if "there is no metadata.yaml" not in one.message] == []
    assert is_whole(path / f"bag_0.db3{ending}") == []
    assert describe(path)["compression"] in ("zstd", "lz4")
    (path / f"bag_0.db3{ending}").write_bytes(b"no compressed bytes")
    with pytest.raises(BagError, match="cannot be unpacked"):
        read(path)
    assert any("cannot be unpacked" in one.message for one in check_bag(path))


# channels, schemas, types


def test_channels_of_one_topic_that_are_described_differently_are_one_topic(tmp_path):
    told = [
        {},
        {"metadata": {"offered_qos_profiles": "- ["}},
        {"text": "", "metadata": {"topic_type_hash": "RIHS01_2"}},
        {"text": "float64[ x"},
    ]
    file = mcap_file(
        tmp_path / "a.mcap",
        [("/p", POSE, one) for one in told],
        [(k % 4, s, d) for k, (_, s, d) in enumerate(POSES)],
    )
    assert {one.severity for one in is_whole(file)} <= {"warning"}


def test_one_topic_with_two_types_gives_each_message_by_its_own(tmp_path):
    words = serialize(TYPES, STRING, {"data": "a"})
    messages = [(k % 2, stamp, words if k % 2 else POSE_CDR) for k, stamp in enumerate(stamps())]
    for file in (
        mcap_file(tmp_path / "a.mcap", [("/p", POSE), ("/p", STRING)], messages),
        sqlite_file(
            tmp_path / "a.db3", [("/p", POSE, "", "cdr"), ("/p", STRING, "", "cdr")], messages
        ),
    ):
        found = read(file, ["/p"])
        assert [one.data.data for one in found if one.type_name == STRING] == ["a"] * 10 and len(
            found
        ) == 20
        with BagReader(file) as bag:
            assert (bag.topics["/p"].type_name, bag.topics["/p"].other_types) == (POSE, (STRING,))
        assert describe(file)["topics"][0]["other_types"] == [STRING]
        told = said(check_file(file))
        assert any(
            f"its messages have several types: {both}" in told
            for both in (f"{POSE}, {STRING}", f"{STRING}, {POSE}")
        )


@pytest.mark.parametrize(
    ("encoding", "schema", "text"),
    [
        ("json", "jsonschema", "{}"),
        ("protobuf", "protobuf", "\1\2"),
        ("ros1", "ros1msg", "float64 x\n"),
        ("json", "", ""),
        ("cbor", "x", "y"),
    ],
)
def test_other_encodings_beside_cdr_are_named_and_read_raw(tmp_path, encoding, schema, text):
    other = {"encoding": encoding, "schema": schema, "text": text}
    channels = [("/p", POSE), ("/p", "foxglove.Pose", other), ("/q", "foxglove.Pose", other)]
    file = mcap_file(
        tmp_path / "a.mcap",
        channels,
        [one for pose in POSES for one in (pose, (1, pose[1], b"{}"), (2, pose[1], b"{}"))],
    )
    assert is_whole(file) == []
    with BagReader(file) as bag:
        assert bag.message_count == 60 and {*bag.topics} == {"/p", "/q", f"/p ({encoding})"}
        raw = list(bag.messages([f"/p ({encoding})", "/q"], decode=False))
        assert [one.data for one in raw] == [b"{}"] * 40
        with pytest.raises(
            BagError, match=f"/q is encoded as '{encoding}', not as cdr: read it raw"
        ):
            list(bag.messages(["/q"]))
    assert (
        said(check_file(file)).count(f"its messages are encoded as '{encoding}', not as cdr") == 2
    )


@pytest.mark.parametrize(
    "name", ["geometry_msgs/PoseStamped", "geometry_msgs::msg::dds_::PoseStamped_", POSE]
)
@pytest.mark.parametrize("text", ["", None])
def test_a_type_has_many_names(tmp_path, name, text):
    from dart_skill.recording import definition

    told = {"text": definition(TYPES, POSE) if text is None else text}
    assert is_whole(mcap_file(tmp_path / "a.mcap", [("/p", name, told)], POSES)) == []
    assert is_whole(sqlite_file(tmp_path / "a.db3", [("/p", name, "", "cdr")], POSES)) == []
    if "::" not in name:
        assert (
            deserialize(TYPES, name, POSE_CDR).pose.position.x
            == 3.0
            == message(TYPES, name, {"pose": {"position": {"x": 3}}}).pose.position.x
        )
        assert (
            serialize(
                TYPES, name, {"header": {"frame_id": "world"}, "pose": {"position": {"x": 3.0}}}
            )
            == POSE_CDR
        )


@pytest.mark.parametrize(
    "told",
    [
        {"schema": "", "text": ""},
        {"text": "nonsense ! of no kind"},
        {"text": "uint8 x\n"},
        {"schema": "unknown", "text": ""},
    ],
)
def test_the_definition_of_a_standard_type_is_needed_by_nobody(tmp_path, told):
    """It is missing, no definition at all, or another type's."""
    path = tmp_path / "bag"
    path.mkdir()
    mcap_file(path / "bag_0.mcap", [("/p", POSE, told)], POSES)
    write_metadata(path, metadata_of(9, ["bag_0.mcap"], [("/p", POSE, 20)], 20, storage="mcap"))
    found = read(path)
    assert [one.data.pose.position.x for one in found] == [3.0] * 20
    if told.get("schema", "x"):
        assert {one.severity for one in check_bag(path)} <= {"warning"}


IDL = """module lab_msgs { module msg { struct Reading { double value; string<8> unit; }; }; };
"""


def test_definitions_in_idl_with_and_without_heads_and_with_other_line_ends(tmp_path):
    data = struct.pack("<4sdI2s", b"\0\1\0\0", 2.5, 2, b"m\0")
    for text in (IDL, f"{'=' * 80}\nIDL: lab_msgs/msg/Reading\n{IDL}", IDL.replace("\n", "\r\n")):
        file = mcap_file(
            tmp_path / "a.mcap",
            [("/r", "lab_msgs/msg/Reading", {"schema": "ros2idl", "text": text})],
            [(0, START_NS, data)],
        )
        assert [(one.data.value, one.data.unit) for one in read(file)] == [
            (2.5, "m")
        ] and check_file(file) == []
    text = (
        "float64 value\r\nNested unit\r\n"
        + "=" * 30
        + "\r\nMSG: lab_msgs/Nested\r\nstring<=8 data\r\n"
    )
    file = mcap_file(
        tmp_path / "a.mcap", [("/r", "lab_msgs/Reading", {"text": text})], [(0, START_NS, data)]
    )
    assert [(one.data.value, one.data.unit.data) for one in read(file)] == [
        (2.5, "m")
    ] and check_file(file) == []


def test_big_endian_is_read_and_what_no_reader_decodes_is_named(tmp_path):
    store = get_typestore(Stores.ROS2_JAZZY)
    big = bytes(store.serialize_cdr(deserialize(TYPES, POSE, POSE_CDR), POSE, little_endian=False))
    assert (
        is_whole(
            mcap_file(tmp_path / "a.mcap", [("/p", POSE)], [(0, stamp, big) for stamp in stamps()])
        )
        == []
    )
    for kind, name in ((7, "XCDR version 2"), (3, "a list of parameters")):
        file = mcap_file(
            tmp_path / "b.mcap", [("/p", POSE)], [(0, START_NS, bytes((0, kind)) + POSE_CDR[2:])]
        )
        with pytest.raises(BagError, match=f"they are encoded as {name}"):
            read(file)
        assert any(name in one.message and one.severity == "error" for one in check_file(file))


# files and summaries


def test_a_folder_may_be_called_otherwise_than_its_files(tmp_path):
    path = tmp_path / "thursday (copy)"
    path.mkdir()
    for k in range(3):
        mcap_file(
            path / f"recording_{k}.mcap",
            [("/p", POSE)],
            [(0, stamp + k * 10**9, data) for _, stamp, data in POSES],
        )
    (found,) = is_whole(path, 60)
    assert "there is no metadata.yaml" in found.message


def test_a_file_without_bytes_beside_others_hides_none(tmp_path):
    path = folder_of(tmp_path / "bag")
    shutil.copy(path / "bag_0.db3", path / "bag_1.db3")
    (path / "bag_1.db3").write_bytes(b"")
    assert len(read(path)) == 20 and any(
        "bag_1.db3" in str(one) and one.severity == "error" for one in check_bag(path)
    )


def test_a_bag_of_ros_1_that_ends_at_once_is_refused_by_the_check_too(tmp_path):
    (tmp_path / "a.bag").write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(BagError, match="a.bag: "):
        read(tmp_path / "a.bag")
    assert "error: a.bag" in said(check_bag(tmp_path / "a.bag"))


@pytest.mark.parametrize("profile", ["", "ros1", "x" * 50])
@pytest.mark.parametrize(
    "options",
    [
        {"use_statistics": False},
        {"repeat_channels": False, "repeat_schemas": False},
        {"index_types": IndexType.NONE, "use_summary_offsets": False},
        {"use_chunking": False, "compression": CompressionType.NONE},
        {"enable_crcs": False, "enable_data_crcs": True},
    ],
    ids=str,
)
def test_profile_and_parts_of_the_summary_are_optional(tmp_path, profile, options):
    channels = [("/p", POSE), ("/nobody", STRING)]
    found = is_whole(mcap_file(tmp_path / "a.mcap", channels, POSES, profile, **options))
    assert {one.severity for one in found} <= {"warning"}
    notes = [one.message for one in check_file(tmp_path / "a.mcap") if "profile" in one.message]
    assert notes == [
        f"its profile is '{profile}', not 'ros2': other tools may not take it for a bag of ROS 2"
    ]
