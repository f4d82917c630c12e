"""Bags at the edge of their formats, on which reader, check and recovery must agree."""

import itertools
import sqlite3
import struct
from contextlib import closing
from zlib import crc32

import pytest
from mcap.opcode import Opcode
from mcap.writer import CompressionType

from dart_skill.recording import BagError, BagReader, definition, serialize, typestore
from dart_skill.recording.bags import check_bag, recover
from tests.unit.recording import make_corpus
from tests.unit.recording.bag_files import (
    POSE,
    POSE_CDR,
    START_NS,
    STEP_NS,
    STRING,
    mcap_file,
    sqlite_file,
    stamps,
)
from tests.unit.recording.test_recovery import bag_messages, messages
from tests.unit.recording.test_recovery_forms import MAGIC

TYPES = typestore()
TOPICS = [("/p", POSE, "", "cdr")]


def counted(path):
    with BagReader(path) as bag:
        return sum(1 for _ in bag.messages(decode=False))


def severe(path):
    return [str(one) for one in check_bag(path) if one.severity != "note"]


def errors(path):
    return [str(one) for one in check_bag(path) if one.severity == "error"]


# bytes behind what a record needs


@pytest.fixture
def padded(monkeypatch):
    """The forms of the corpus, each record with three bytes more at its end, of fields that nobody
    knows.
    """
    plain = make_corpus.packed

    def with_unknown(record):
        data = plain(record)
        # the one has data to its end, the other a fixed place
        if data[0] in (
            Opcode.MESSAGE,
            Opcode.FOOTER,
        ):
            return data
        return data[:1] + struct.pack("<Q", len(data) - 9 + 3) + data[9:] + b"\1\2\3"

    monkeypatch.setattr(make_corpus, "packed", with_unknown)
    return list(itertools.islice(make_corpus.variants(), 0, None, 5))


def test_bytes_at_the_end_of_a_record_that_nobody_knows_are_ignored(tmp_path, padded):
    assert len(padded) > 30
    for name, data in padded:
        file = tmp_path / f"{name}.mcap"
        file.write_bytes(data)
        expected = {"One": "Message" in name, "Ten": 10}.get(name[:3], 0)
        assert counted(file) == expected and errors(file) == [], name
        if "Message" not in name and "Attachment" not in name:
            continue  # there is nothing to recover
        recovery = recover(file, tmp_path / f"new_{name}")
        assert sum(recovery.messages.values()) == expected and recovery.is_complete, (
            name,
            str(recovery),
            recovery.places,
        )
        assert errors(recovery.path) == []


def test_a_record_that_is_too_short_is_damage(tmp_path):
    data = dict(make_corpus.variants())["OneMessage-ch"]
    place = data.index(b"\x0f\4\0\0\0\0\0\0\0")
    (tmp_path / "short.mcap").write_bytes(
        data[:place] + b"\x0f\2\0\0\0\0\0\0\0" + data[place + 9 : place + 11] + data[place + 13 :]
    )
    with pytest.raises(BagError, match="DATA_END record"):
        BagReader(tmp_path / "short.mcap")
    assert "DATA_END record" in errors(tmp_path / "short.mcap")[0]


def test_a_length_that_is_damaged_hides_no_records_as_unknown_bytes(tmp_path):
    file = mcap_file(
        tmp_path / "one.mcap",
        [("/p", POSE)],
        [(0, stamp, POSE_CDR) for stamp in stamps(60)],
        chunk_size=900,
    )
    data = bytearray(file.read_bytes())
    place = data.index(b"\x07", 17 + data[9])  # the first message index
    first_chunk = bytes(data).index(b"\x06", 17 + data[9])
    (length,) = struct.unpack_from("<Q", data, first_chunk + 1)
    following = first_chunk + 9 + length
    assert data[following] == Opcode.MESSAGE_INDEX and place
    (index_length,) = struct.unpack_from("<Q", data, following + 1)
    # as if the index belonged to the chunk
    struct.pack_into("<Q", data, first_chunk + 1, length + 9 + index_length)
    file.write_bytes(data)
    recovery = recover(file, tmp_path / "new")
    assert recovery.messages == {"/p": 60}
    assert errors(file) and errors(recovery.path) == []


# summaries that lack definitions


def without(data, opcode, which):
    """A file without some records of one kind in its summary, whose CRC and statistics agree with
    it. which: by their order.
    """
    summary, _offsets, _ = struct.unpack_from("<QQI", data, len(data) - 28)
    kept, place, number = b"", summary, 0
    while data[place] != Opcode.FOOTER:
        end = place + 9 + struct.unpack_from("<Q", data, place + 1)[0]
        is_one = data[place] == opcode
        if data[place] not in (Opcode.SUMMARY_OFFSET, Opcode.STATISTICS) and not (
            is_one and which(number)
        ):
            kept += data[place:end]
        number, place = number + is_one, end
    footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, summary, 0)
    return data[:summary] + kept + footer + struct.pack("<I", crc32(kept + footer)) + MAGIC


@pytest.mark.parametrize("opcode", [Opcode.SCHEMA, Opcode.CHANNEL])
@pytest.mark.parametrize(
    "which", [lambda number: True, lambda number: number == 0], ids=["all", "first"]
)
@pytest.mark.parametrize("chunked", [True, False])
def test_definitions_that_the_summary_lacks_are_those_of_the_records(
    tmp_path, opcode, which, chunked
):
    channels = [("/p", POSE), ("/again", POSE), ("/t", STRING)]
    text = serialize(TYPES, STRING, {"data": "a"})
    sent = [(k % 3, stamp, text if k % 3 == 2 else POSE_CDR) for k, stamp in enumerate(stamps(30))]
    file = mcap_file(tmp_path / "one.mcap", channels, sent, chunk_size=500, use_chunking=chunked)
    file.write_bytes(without(file.read_bytes(), opcode, which))
    with BagReader(file) as bag:
        assert {name: info.type_name for name, info in bag.topics.items()} == {
            name: type_name for name, type_name in channels
        }
        assert sum(1 for _ in bag.messages()) == 30
    assert errors(file) == []
    recovery = recover(file, tmp_path / "new")
    assert (
        recovery.messages == {"/p": 10, "/again": 10, "/t": 10}
        and recovery.is_complete
        and recovery.repairs == []
    )
    assert severe(recovery.path) == []


# names of types


def test_messages_of_a_type_with_a_name_of_two_parts_are_judged(tmp_path):
    topics = [("/p", "geometry_msgs/PoseStamped", {"text": definition(TYPES, POSE)})]
    file = mcap_file(
        tmp_path / "two.mcap",
        topics,
        [(0, stamp, POSE_CDR) for stamp in stamps(30)],
        enable_crcs=False,
        use_chunking=False,
    )
    data = bytearray(file.read_bytes())
    struct.pack_into("<I", data, bytes(data).index(b"\6\0\0\0world"), 2**30)
    file.write_bytes(data)
    recovery = recover(file, tmp_path / "new")
    assert (
        recovery.messages == {"/p": 29}
        and not recovery.is_complete
        and "are no messages of its type" in str(recovery.places[0])
    )
    assert errors(recovery.path) == []


def test_the_only_message_of_a_standard_type_is_judged_too(tmp_path):
    file = mcap_file(
        tmp_path / "one.mcap",
        [("/p", POSE), ("/t", STRING)],
        [(0, 1, POSE_CDR), (1, 2, b"\0\1\0\0\xff\xff\0\0a")],
        enable_crcs=False,
    )
    recovery = recover(file, tmp_path / "new")
    assert (
        recovery.messages["/p"] == 1
        and recovery.messages["/t"] == 0
        and errors(recovery.path) == []
    )


def test_a_definition_in_sqlite_under_a_name_of_two_parts_is_found(tmp_path):
    two, full = "lab_msgs/Speed", "lab_msgs/msg/Speed"
    for number, (topic_type, defined) in enumerate([(two, two), (two, full), (full, two)]):
        file = tmp_path / f"bag{number}_0.db3"
        rows = [(0, stamp, b"\0\1\0\0" + struct.pack("<d", 1.5)) for stamp in stamps(5)]
        sqlite_file(
            file,
            [("/v", topic_type, "", "cdr")],
            rows,
            definitions=[(defined, "ros2msg", "float64 speed\n")],
        )
        recovery = recover(file, tmp_path / f"new{number}")
        with BagReader(recovery.path) as bag:
            assert [message.data.speed for message in bag.messages()] == [1.5] * 5


def test_types_that_two_recordings_in_one_define_differently_are_both_read(tmp_path):
    name, parts = "lab_msgs/msg/State", []
    for number, text in enumerate(
        ["float64 speed\nfloat64 angle\n", "float64 angle\nfloat64 speed\n"]
    ):
        data = b"\0\1\0\0" + struct.pack("<2d", *[(1.0, 2.0), (2.0, 1.0)][number])
        begin = START_NS * (number + 1)
        sent = [(0, begin + k * STEP_NS, data) for k in range(20)]
        parts.append(
            mcap_file(
                tmp_path / f"{number}.mcap",
                [("/s", name, {"text": text})],
                sent,
                enable_crcs=False,
            ).read_bytes()
        )
    (tmp_path / "both.mcap").write_bytes(parts[0] + parts[1])
    recovery = recover(tmp_path / "both.mcap", tmp_path / "new")
    with BagReader(recovery.path) as bag:
        assert [(one.data.speed, one.data.angle) for one in bag.messages()] == [(1.0, 2.0)] * 40
        assert {type(one.type_name) for one in bag.messages()} == {str}
    assert errors(recovery.path) == []


def test_types_that_one_file_defines_twice_are_read_by_their_own_channel(tmp_path):
    name, text = "lab_msgs/msg/State", {"text": "float64 a\nfloat64 b\n"}
    sent = [
        (0, 1, b"\0\1\0\0" + struct.pack("<2d", 1.0, 2.0)),
        (1, 2, b"\0\1\0\0" + struct.pack("<d", 3.0)),
    ]
    file = mcap_file(
        tmp_path / "one.mcap",
        [("/s", name, text), ("/t", name, {"text": "float64 c\n"})],
        sent,
        enable_crcs=False,
    )
    new = recover(file, tmp_path / "new")
    assert new.messages == {"/s": 1, "/t": 1}
    for path in (file, new.path):
        with BagReader(path) as bag:
            first, second = bag.messages()
            assert (first.data.b, second.data.c) == (2.0, 3.0)
        assert errors(path) == []


# SQLite and what lies beside it


def log_only(folder, keep):
    """A bag whose messages are in its write-ahead log. keep: bytes of its database."""
    folder.mkdir()
    whole = sqlite_file(
        folder.with_suffix(".db3"), TOPICS, [(0, stamp, POSE_CDR) for stamp in stamps(300)]
    )
    file = folder / "bag_0.db3"
    with closing(sqlite3.connect(file)) as database, closing(sqlite3.connect(whole)) as source:
        database.execute("PRAGMA journal_mode = WAL")
        database.execute("PRAGMA wal_autocheckpoint = 0")
        database.isolation_level = None
        for statement in list(source.iterdump())[1:-1]:  # each in a transaction of its own
            database.execute(statement)
        kept = {one: one.read_bytes() for one in (file, file.with_name("bag_0.db3-wal"))}
    for one, data in kept.items():
        one.write_bytes(data[:keep] if one == file and keep is not None else data)
    if keep is None:
        file.unlink()
    return file


@pytest.mark.parametrize("keep", [0, None], ids=["empty", "missing"])
def test_a_log_without_its_database_is_told_and_kept(tmp_path, keep):
    file = log_only(tmp_path / "bag", keep)
    log = file.with_name("bag_0.db3-wal")
    before = log.read_bytes()
    for path in [file.parent, *([file] if keep == 0 else [])]:
        with pytest.raises(BagError, match="bag_0.db3-wal.*bag recover"):
            BagReader(path)
        assert "bag_0.db3-wal" in errors(path)[0] and "bag recover" in errors(path)[0]
    recovery = recover(file.parent, tmp_path / "new")
    assert recovery.messages == {"/p": 300}
    assert errors(recovery.path) == [] and log.read_bytes() == before


def test_a_log_that_is_damaged_is_warned_of_and_recovery_finds_more(tmp_path):
    file = sqlite_file(
        tmp_path / "bag_0.db3", TOPICS, [(0, stamp, POSE_CDR) for stamp in stamps(300)], wal=True
    )
    log = file.with_name("bag_0.db3-wal")
    data = bytearray(log.read_bytes())
    data[len(data) // 2] ^= 1
    log.write_bytes(data)
    read = counted(file)
    (told,) = [one for one in severe(file) if "beside it lies" in one]
    assert f"{read} messages were read in all" in told and "recovery may find more" in told
    assert sum(recover(file, tmp_path / "new").messages.values()) > read


def test_rows_whose_values_are_of_other_kinds_are_told(tmp_path):
    file = sqlite_file(
        tmp_path / "bag_0.db3",
        TOPICS,
        [*((0, stamp, POSE_CDR) for stamp in stamps(5)), (0, 7, None), (0, "now", POSE_CDR)],
    )
    recovery = recover(file, tmp_path / "new")
    assert recovery.messages == {
        "/p": 5
    } and "2 rows have no number of a topic, no time or no bytes" in str(recovery.places[0])


def test_topics_whose_names_begin_with_no_slash_are_recovered(tmp_path):
    file = sqlite_file(
        tmp_path / "bag_0.db3",
        [("AAA", POSE, "", "cdr")],
        [(0, stamp, POSE_CDR) for stamp in stamps(5)],
    )
    assert recover(file, tmp_path / "new").messages == {"AAA": 5}


def test_a_bag_with_nothing_in_it_has_no_remedy_that_makes_nothing(tmp_path):
    (tmp_path / "none.mcap").write_bytes(dict(make_corpus.variants())["NoData"])
    assert not any("recover" in one for one in severe(tmp_path / "none.mcap"))


# parts that are missing


def test_a_bag_without_metadata_is_read_without_its_missing_part(tmp_path):
    bag = tmp_path / "bag"
    bag.mkdir()
    for number in (0, 2, 10, 11):
        sent = [(0, START_NS * (number + 1) // 8 + k * STEP_NS, POSE_CDR) for k in range(5)]
        mcap_file(bag / f"bag_{number}.mcap", [("/p", POSE)], sent)
    assert counted(bag) == 20 and errors(bag) == []
    assert any("bag_1, bag_3 to bag_9 is missing" in one for one in severe(bag)), severe(bag)
    recovery = recover(bag, tmp_path / "new")
    assert (
        recovery.messages == {"/p": 20}
        and not recovery.is_complete
        and [place.file for place in recovery.places] == ["bag_1", "bag_3 to bag_9"]
    )
    (bag / "bag_0.mcap").unlink()
    with pytest.raises(
        BagError, match="lack the first part of a bag .bag_0 to bag_1.*bag recover"
    ):
        BagReader(bag)
    assert "lack the first part" in errors(bag)[0]
    assert recover(bag, tmp_path / "late").messages == {"/p": 15}


def test_parts_in_one_file_of_which_one_has_what_another_lost_lose_nothing(tmp_path):
    file = mcap_file(
        tmp_path / "one.mcap",
        [("/p", POSE)],
        [(0, stamp, POSE_CDR) for stamp in stamps(60)],
        chunk_size=900,
        compression=CompressionType.NONE,
    )
    data = file.read_bytes()
    places = [place for place in range(len(data)) if data[place : place + 5] == b"world"]
    parts = []
    for damaged in (5, 50):
        part = bytearray(data)
        part[places[damaged] + 20] ^= 1
        parts.append(bytes(part[:-60]))
    (tmp_path / "both.mcap").write_bytes(parts[0] + data[:8] + parts[1][8:])
    recovery = recover(tmp_path / "both.mcap", tmp_path / "new")
    assert set(bag_messages(recovery.path)) == set(messages(file)) and recovery.lost == {}, (
        recovery
    )
