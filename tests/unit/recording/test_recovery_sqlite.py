"""SQLite bags made new: cut off, with pages or header missing, with a journal or a write-ahead log
beside them.
"""

import shutil
import sqlite3
from collections import Counter

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from dart_skill.cli import main
from dart_skill.recording import (
    BagError,
    BagReader,
    definition,
    qos_yaml,
    serialize,
    type_hash,
    typestore,
)
from dart_skill.recording.bags import check_bag, recover
from tests.unit.recording.test_recovery import bag_messages

POINT, TEXT = "geometry_msgs/msg/PointStamped", "std_msgs/msg/String"
START_NS, PAGE = 10**18, 4096
TYPES = typestore()
TABLES = """
CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL,
  offered_qos_profiles TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
"""
NEWER_TABLES = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,
  encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);
ALTER TABLE topics ADD COLUMN type_description_hash TEXT NOT NULL DEFAULT '';
INSERT INTO schema VALUES (4, 'jazzy');
"""


def rows(n_steps, start_ns=START_NS, seed=0, size=10):
    """Topic, log time and bytes of messages; every tenth step has a text of `size` characters."""
    rng, found = np.random.default_rng(seed), []
    for step in range(n_steps):
        point = dict(zip("xyz", rng.normal(size=3), strict=True))
        found.append((1, start_ns + step * 10**7, serialize(TYPES, POINT, {"point": point})))
        if step % 10 == 0:
            found.append(
                (
                    2,
                    start_ns + step * 10**7 + 1,
                    serialize(TYPES, TEXT, {"data": "x" * size + str(step)}),
                )
            )
    return found


def insert(connection, messages):
    connection.executemany(
        "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", messages
    )


def database(path, messages, newer=True, types=(POINT, TEXT), defined=True):
    """A file as rosbag2 writes it, of the first or of the fourth version."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with sqlite3.connect(path) as base:
        base.executescript(TABLES + (NEWER_TABLES if newer else ""))
        for number, (name, type_name) in enumerate(
            zip(("/point", "/text"), types, strict=True), start=1
        ):
            digest = [type_hash(TYPES, type_name) if defined else ""] if newer else []
            values = (number, name, type_name, "cdr", qos_yaml(), *digest)
            base.execute(f"INSERT INTO topics VALUES ({', '.join('?' * len(values))})", values)
            if newer and defined:
                text = definition(TYPES, type_name)
                base.execute(
                    "INSERT INTO message_definitions VALUES (?, ?, 'ros2msg', ?, '')",
                    (number, type_name, text),
                )
        insert(base, messages)
    base.close()
    return path


def counted(messages):
    return Counter(
        (("/point", "/text")[topic - 1], stamp, data) for topic, stamp, data in messages
    )


def recovered(path, new):
    """The recovery of a file or folder, of which check has no error, and its messages; the source
    stays as it was.
    """
    files = [path] if path.is_file() else sorted(path.iterdir())
    before = {file.name: file.read_bytes() for file in files}
    recovery = recover(path, new)
    assert {
        file.name: file.read_bytes()
        for file in ([path] if path.is_file() else sorted(path.iterdir()))
    } == before
    assert [str(one) for one in check_bag(new) if one.severity == "error"] == []
    with BagReader(new) as bag:
        assert sum(1 for _ in bag.messages()) == sum(recovery.messages.values())
    assert sorted(file.name for file in new.iterdir()) == sorted(
        [*recovery.files, "metadata.yaml"]
    ), "nothing of the way is left"
    return recovery, Counter(
        (topic, stamp, data) for topic, stamp, _, _, data in bag_messages(new)
    )


@pytest.mark.parametrize("newer", [False, True])
def test_a_whole_file_becomes_a_bag_of_the_same_messages(tmp_path, newer):
    file = database(tmp_path / "bag" / "bag_0.db3", messages := rows(50, size=30_000), newer)
    recovery, kept = recovered(file, tmp_path / "new")
    assert kept == counted(messages) and recovery.is_complete and recovery.unverified == 55
    assert "finds it whole" in recovery.notes[0]
    with BagReader(recovery.path) as bag:
        assert bag.topics["/point"].type_hash == type_hash(TYPES, POINT), (
            "also where the file does not tell it"
        )
        assert len(bag.topics["/point"].qos) == 1


def test_the_name_does_not_matter_and_metadata_neither(tmp_path):
    messages = rows(20)
    database(tmp_path / "a.mcap", messages)
    assert recovered(tmp_path / "a.mcap", tmp_path / "new")[1] == counted(messages)
    database(tmp_path / "bag" / "bag_0.db3", messages)
    (tmp_path / "bag" / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    assert recovered(tmp_path / "bag", tmp_path / "again")[1] == counted(messages)


def test_several_files_of_one_bag(tmp_path):
    parts = [rows(20, START_NS * (k + 1), k) for k in range(3)]
    for k, messages in enumerate(parts):
        database(tmp_path / "bag" / f"bag_{k}.db3", messages)
    middle = tmp_path / "bag" / "bag_1.db3"
    middle.write_bytes(middle.read_bytes()[:-PAGE])
    recovery, kept = recovered(tmp_path / "bag", tmp_path / "new")
    assert kept <= counted(sum(parts, [])) and kept >= counted(parts[0] + parts[2])
    assert (
        len(recovery.files) == 3
        and not recovery.is_complete
        and "pages of" in recovery.places[0].reason
    )


def test_types_that_nobody_defines_are_kept_without_definition(tmp_path):
    file = database(
        tmp_path / "bag_0.db3", rows(5), types=("other_msgs/msg/Odd", TEXT), defined=False
    )
    recovery = recover(file, tmp_path / "new")
    assert recovery.messages == {
        "/point": 5,
        "/text": 1,
    } and "other_msgs/msg/Odd of /point is defined neither" in "".join(recovery.notes)
    with BagReader(recovery.path) as bag:
        assert (
            len(list(bag.messages(["/point"], decode=False))) == 5
            and len(list(bag.messages(["/text"]))) == 1
        )


def test_a_definition_that_fits_no_message_is_not_taken(tmp_path):
    """As in rosbag2's own test resources, which have others in their place."""
    file = database(tmp_path / "bag_0.db3", messages := rows(20))
    with sqlite3.connect(file) as base:
        base.execute("UPDATE message_definitions SET encoded_message_definition = 'uint8 level'")
    base.close()
    recovery, kept = recovered(file, tmp_path / "new")
    assert kept == counted(messages) and "does not fit its messages" in recovery.repairs[0]


# damage


@pytest.mark.parametrize("size", [10, 30_000], ids=["short", "long"])
def test_a_file_that_was_cut_off_gives_what_its_pages_hold(tmp_path, size):
    file = database(tmp_path / "bag_0.db3", messages := rows(400, size=size))
    data = file.read_bytes()
    file.write_bytes(data[: len(data) * 2 // 3])
    recovery, kept = recovered(file, tmp_path / "new")
    assert kept <= counted(messages) and kept.total() > 150 and not recovery.is_complete
    assert "missing at its end" in recovery.places[0].reason and "page by page" in "".join(
        recovery.notes
    )


@pytest.mark.parametrize("page", [0, 3, 9])
def test_pages_of_zero_bytes_cost_what_was_on_them(tmp_path, page):
    file = database(tmp_path / "bag_0.db3", messages := rows(400))
    data = bytearray(file.read_bytes())
    data[page * PAGE : (page + 1) * PAGE] = bytes(PAGE)
    file.write_bytes(data)
    recovery, kept = recovered(file, tmp_path / "new")
    assert kept <= counted(messages) and kept.total() > 300
    assert "nothing but zero bytes" in recovery.places[0].reason or page == 0
    known = sum(place.messages or 0 for place in recovery.places)
    assert known <= 440 - kept.total(), "what is told is the least"


def test_a_header_that_is_damaged_does_not_matter(tmp_path):
    file = database(tmp_path / "bag_0.db3", messages := rows(400, size=10_000))
    data = file.read_bytes()
    for number, head in enumerate(
        (bytes(100), np.random.default_rng(0).bytes(100), b"SQLite format 3\0" + bytes(84))
    ):
        file.write_bytes(head + data[100:])
        assert recovered(file, tmp_path / f"new{number}")[1] == counted(messages)


def test_an_index_that_is_damaged_is_not_needed(tmp_path):
    file = database(tmp_path / "bag_0.db3", messages := rows(400))
    with sqlite3.connect(file) as base:
        (root,) = base.execute(
            "SELECT rootpage FROM sqlite_master WHERE name = 'timestamp_idx'"
        ).fetchone()
    base.close()
    data = bytearray(file.read_bytes())
    data[(root - 1) * PAGE : root * PAGE] = bytes(PAGE)
    file.write_bytes(data)
    assert recovered(file, tmp_path / "new")[1] == counted(messages)


def test_rows_that_were_deleted_stay_deleted(tmp_path):
    file = database(tmp_path / "bag_0.db3", messages := rows(400))
    with sqlite3.connect(file) as base:
        base.execute("DELETE FROM messages WHERE topic_id = 1 AND id < 400")
    base.close()
    left = [
        one for number, one in enumerate(messages, start=1) if not (one[0] == 1 and number < 400)
    ]
    assert recovered(file, tmp_path / "new")[1] == counted(left)


def test_the_row_of_a_topic_that_is_lost_is_found_by_the_type_of_its_messages(tmp_path):
    file = database(tmp_path / "bag" / "bag_0.db3", messages := rows(50))
    with sqlite3.connect(file) as base:
        base.execute("DELETE FROM topics WHERE id = 1")
    base.close()
    topic = (
        "{topic_metadata: {name: /point, type: geometry_msgs/msg/PointStamped,"
        " serialization_format: cdr}, message_count: 50}"
    )
    (file.parent / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information: {{topics_with_message_count: [{topic}]}}"
    )
    recovery, kept = recovered(file.parent, tmp_path / "new")
    assert kept == counted(messages) and "the row of topic /point is lost" in recovery.repairs[0]


@pytest.mark.parametrize(
    ("copy", "what"),
    [
        (
            lambda data: bytes(byte & 0x7F for byte in data),
            "the highest bit of each byte was cleared",
        ),
        (lambda data: data.decode("utf-8", "replace").encode(), "the replacement character"),
    ],
)
def test_a_copy_as_text_is_named(tmp_path, copy, what):
    file = database(tmp_path / "bag_0.db3", rows(400))
    file.write_bytes(copy(file.read_bytes()))
    with pytest.raises(BagError, match=f"{what}.*fetch it again in binary mode"):
        recover(file, tmp_path / "new")


def test_carriage_returns_that_a_copy_put_in_are_taken_out_again(tmp_path):
    file = database(tmp_path / "bag_0.db3", messages := rows(400))
    file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n"))
    recovery, kept = recovered(file, tmp_path / "new")
    assert kept == counted(messages) and recovery.is_complete and "undone" in recovery.notes[0]


def test_a_file_that_was_compressed_and_cut_off(tmp_path):
    file = database(tmp_path / "bag" / "bag_0.db3", messages := rows(6000))
    packed = zstandard.ZstdCompressor().compress(file.read_bytes())
    file.unlink()
    file.with_suffix(".db3.zstd").write_bytes(packed[: len(packed) // 2])
    recovery, kept = recovered(tmp_path / "bag", tmp_path / "new")
    assert kept <= counted(messages) and kept.total() > 1000 and not recovery.is_complete


# what its recorder left beside it


@pytest.fixture
def killed(tmp_path):
    """What makes a copy of a bag as it is on the disk now, as its recorder is killed."""
    count = iter(range(10))

    def copy(folder):
        return shutil.copytree(folder, tmp_path / f"killed{next(count)}")

    return copy


def test_a_write_ahead_log_is_read_whole_damaged_or_without_its_end(tmp_path, killed):
    file = database(tmp_path / "bag" / "bag_0.db3", first := rows(100))
    base = sqlite3.connect(file)
    base.execute("PRAGMA journal_mode = WAL")
    base.execute("PRAGMA wal_autocheckpoint = 0")
    insert(base, second := rows(300, 2 * START_NS, 1))
    base.commit()
    folder = killed(tmp_path / "bag")
    recovery, kept = recovered(folder, tmp_path / "new0")
    assert (
        kept == counted(first + second)
        and recovery.is_complete
        and "write-ahead log bag_0.db3-wal" in recovery.notes[0]
    )
    log = folder / "bag_0.db3-wal"
    data = bytearray(log.read_bytes())
    data[2000] ^= 1
    log.write_bytes(data)
    recovery, kept = recovered(folder, tmp_path / "new1")
    assert kept.total() >= 400 and not recovery.is_complete
    log.write_bytes(data[: len(data) // 2])
    recovery, kept = recovered(folder, tmp_path / "new2")
    assert kept >= counted(first) and kept.total() > len(first) and not recovery.is_complete
    base.close()


def test_all_messages_in_the_log_and_none_in_the_file(tmp_path, killed):
    (tmp_path / "bag").mkdir()
    base = sqlite3.connect(tmp_path / "bag" / "bag_0.db3")
    base.execute("PRAGMA journal_mode = WAL")
    base.executescript(TABLES)
    for number, (name, type_name) in enumerate((("/point", POINT), ("/text", TEXT)), start=1):
        base.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')", (number, name, type_name))
    insert(base, messages := rows(200))
    base.commit()
    folder = killed(tmp_path / "bag")
    base.close()
    assert recovered(folder, tmp_path / "new0")[1] == counted(messages)
    (folder / "bag_0.db3").write_bytes(b"")
    assert recovered(folder, tmp_path / "new1")[1] == counted(messages)
    (folder / "bag_0.db3").unlink()
    recovery, kept = recovered(folder, tmp_path / "new2")
    assert (
        kept == counted(messages)
        and "only its write-ahead log is there" in recovery.places[0].reason
    )


def test_a_transaction_that_was_not_completed_gives_what_is_on_the_pages(tmp_path, killed):
    """With its journal, and without: rosbag2 keeps none on the disk unless it is told to."""
    file = database(tmp_path / "bag" / "bag_0.db3", first := rows(100))
    base = sqlite3.connect(file)
    base.execute("PRAGMA cache_size = 2")
    insert(base, second := rows(300, 2 * START_NS, 1))
    folder = killed(tmp_path / "bag")
    base.rollback()
    base.close()
    recovery, kept = recovered(folder, tmp_path / "new0")
    assert "journal bag_0.db3-journal" in recovery.notes[0] and not recovery.is_complete
    assert counted(first) <= kept <= counted(first + second) and kept.total() > len(first) + 100
    (folder / "bag_0.db3-journal").unlink()
    recovery, kept = recovered(folder, tmp_path / "new1")
    assert (
        counted(first) <= kept <= counted(first + second)
        and kept.total() > len(first) + 100
        and not recovery.is_complete
    )


# whatever happens


def test_the_command_recovers_sqlite_too(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    database(tmp_path / "bag_0.db3", rows(20))
    assert main(["bag", "recover", "bag_0.db3"]) == 0
    told = capsys.readouterr().out
    assert (
        "22 messages on 2 topics kept" in told
        and "complete: nothing is lost" in told
        and "SQLite" in told
    )
    (tmp_path / "odd.db3").write_bytes(np.random.default_rng(0).bytes(50_000))
    assert main(["bag", "recover", "odd.db3"]) == 1
    assert "nothing to recover" in capsys.readouterr().err


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    file = database(
        tmp_path_factory.mktemp("whole") / "bag_0.db3", messages := rows(200, size=5000)
    )
    return file.read_bytes(), counted(messages)


SHARE = st.floats(0, 0.999)


@settings(max_examples=max(20, settings.default.max_examples // 4))
@given(
    kind=st.sampled_from(["cut", "flip", "zero", "page", "two"]),
    places=st.tuples(SHARE, SHARE),
    value=st.integers(1, 255),
)
def test_however_a_file_is_damaged_recovery_says_why_not_or_makes_a_bag_that_is_right(
    tmp_path_factory, whole, kind, places, value
):
    data, written = whole
    begin, end = (int(share * len(data)) for share in places)
    block = begin // PAGE * PAGE
    changed = {
        "cut": data[:begin],
        "flip": data[:begin] + bytes([data[begin] ^ value]) + data[begin + 1 :],
        "zero": data[:block] + bytes(PAGE) + data[block + PAGE :],
        "page": data[:block] + np.random.default_rng(value).bytes(PAGE) + data[block + PAGE :],
        "two": data + data[: end // PAGE * PAGE],
    }[kind]
    folder = tmp_path_factory.mktemp("any")
    (folder / "bag_0.db3").write_bytes(changed)
    try:
        recovery, kept = recovered(folder / "bag_0.db3", folder / "new")
    except BagError as error:
        assert "nothing to recover" in str(error) or "empty" in str(error)
        return
    n_missing = (written - kept).total()
    may_change = kind in ("flip", "zero", "page")  # no CRC tells what is in a long row
    assert (kept - written).total() <= may_change
    assert sum(recovery.lost.values()) <= n_missing
    assert not recovery.is_complete or not n_missing or may_change
