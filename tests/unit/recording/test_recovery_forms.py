"""Recovery looks at every byte: several files in one, copies as text, indexes that point
elsewhere, files that are no bags.
"""

import base64
import gzip
import json
import struct
import zlib
from collections import Counter

import lz4.frame
import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from dart_skill.cli import main
from dart_skill.recording import BagError, BagReader, serialize, typestore
from dart_skill.recording.bags import check_bag, recover
from tests.unit.recording.bag_files import mcap_file
from tests.unit.recording.test_recovery import bag_messages, boundaries, messages, record

POINT, TEXT, BYTES = (
    "geometry_msgs/msg/PointStamped",
    "std_msgs/msg/String",
    "std_msgs/msg/UInt8MultiArray",
)
MAGIC = b"\x89MCAP0\r\n"
START_NS = 10**18
TYPES = typestore()


def mcap(path, topics=(("/point", POINT),), n_steps=200, start_ns=START_NS, seed=0, **options):
    """Bytes of a file of the `mcap` package, whose topics have the numbers 1, 2 ... and messages
    that differ.
    """
    rng, written = np.random.default_rng(seed), []
    for step in range(n_steps):
        which = step % len(topics)
        point = dict(zip("xyz", rng.normal(size=3), strict=True))
        type_name = topics[which][1]
        value = {"point": point} if type_name == POINT else {"data": f"{seed} {step}"}
        written.append((which, start_ns + step * 10**7, serialize(TYPES, type_name, value), step))
    options = {"chunk_size": 3000, "compression": CompressionType.ZSTD} | options
    return mcap_file(path, topics, written, library="another", **options).read_bytes()


def recovered(folder, data, name="damaged_0.mcap"):
    """The recovery of some bytes, of which check has no error, and its messages."""
    file = folder / name
    file.write_bytes(data)
    number = sum(1 for _ in folder.glob("new*"))
    recovery = recover(file, folder / f"new{number}")
    assert file.read_bytes() == bytes(data), "the damaged file was changed"
    assert [str(one) for one in check_bag(recovery.path) if one.severity == "error"] == []
    assert recovery.n_looked_at == recovery.n_bytes
    return recovery, bag_messages(recovery.path)


# several files in one


def test_files_one_after_the_other_are_all_read(tmp_path):
    data = mcap(tmp_path / "one.mcap")
    written = messages(tmp_path / "one.mcap")
    recovery, kept = recovered(tmp_path, data + data)
    assert kept == written + written and recovery.is_complete
    told = "\n".join(recovery.notes)
    assert (
        "is 2 files in one" in told
        and f"bytes 0 to {len(data)} hold 200 messages" in told
        and "byte for byte" in told
    )


def test_files_in_one_keep_their_own_meaning_of_the_same_numbers(tmp_path):
    topics = [
        (("/point", POINT), ("/text", TEXT)),
        (("/text", TEXT), ("/point", POINT)),
        (("/other", TEXT),),
    ]
    parts = [
        mcap(tmp_path / f"{k}.mcap", its, start_ns=START_NS * (k + 1), seed=k)
        for k, its in enumerate(topics)
    ]
    written = [one for k in range(3) for one in messages(tmp_path / f"{k}.mcap")]
    recovery, kept = recovered(tmp_path, b"".join(parts))
    assert kept == written and recovery.is_complete and len(recovery.files) == 3
    with BagReader(recovery.path) as bag:
        assert sum(1 for _ in bag.messages()) == 600


def test_a_topic_of_another_type_in_a_later_file_gets_another_name(tmp_path):
    parts = [
        mcap(tmp_path / f"{k}.mcap", [("/a", type_name)], start_ns=START_NS * (k + 1))
        for k, type_name in enumerate((POINT, TEXT))
    ]
    recovery, kept = recovered(tmp_path, b"".join(parts))
    assert len(kept) == 400 and recovery.messages == {"/a": 200, "/a_2": 200}
    assert any("/a_2" in note for note in recovery.notes)


def test_behind_a_footer_and_garbage_records_are_found(tmp_path):
    data, other = (
        mcap(tmp_path / "one.mcap"),
        mcap(tmp_path / "two.mcap", seed=1, start_ns=2 * START_NS),
    )
    headless = other[boundaries(other)[1][1][0] :]
    recovery, kept = recovered(tmp_path, data + np.random.default_rng(0).bytes(500) + headless)
    written = messages(tmp_path / "one.mcap") + messages(tmp_path / "two.mcap")
    assert kept[:200] == written[:200] and len(kept) > 350 and set(kept) <= set(written)
    assert not recovery.is_complete


@pytest.mark.parametrize("chunked", [True, False])
def test_a_file_that_was_cut_off_and_another_one_behind_it(tmp_path, chunked):
    data = mcap(tmp_path / "one.mcap", use_chunking=chunked)
    other = mcap(
        tmp_path / "two.mcap", [("/text", TEXT), ("/point", POINT)], seed=1, start_ns=2 * START_NS
    )
    recovery, kept = recovered(tmp_path, data[: len(data) // 2] + other)
    assert kept[-200:] == messages(tmp_path / "two.mcap") and 60 < len(kept) - 200 < 120
    assert not recovery.is_complete and not recovery.is_exact


def test_a_bag_that_is_kept_in_another_one_stays_there(tmp_path):
    inner = mcap(tmp_path / "inner.mcap")
    with open(tmp_path / "outer.mcap", "wb") as stream:
        writer = McapWriter(stream, use_summary_offsets=False)
        writer.start("ros2", "another")
        writer.add_attachment(0, 0, "inner.mcap", "application/octet-stream", inner)
        writer.finish()
    data = (tmp_path / "outer.mcap").read_bytes()
    recovery, kept = recovered(tmp_path, data[:-20])
    assert kept == [] and recovery.n_attachments == 1


def test_zero_bytes_behind_the_end_are_told_and_hold_nothing(tmp_path):
    data = mcap(tmp_path / "one.mcap")
    recovery, kept = recovered(tmp_path, data + bytes(5000))
    assert (
        len(kept) == 200
        and recovery.is_complete
        and "5000 zero bytes" in recovery.places[0].reason
    )


def test_what_stands_there_twice_is_taken_once(tmp_path):
    data = mcap(tmp_path / "one.mcap")
    chunks = boundaries(data)[1]
    (begin, _), (end, _) = chunks[1], chunks[3]
    recovery, kept = recovered(tmp_path, data[:end] + data[begin:end] + data[end:-100])
    assert (
        kept == messages(tmp_path / "one.mcap")
        and "2 chunks" in recovery.repairs[0]
        and recovery.lost == {}
    )


# indexes that point elsewhere


def own_index(content, channel=None, entry=None):
    """A message index with another channel or first entry."""
    head = struct.pack("<H", channel) + content[2:6] if channel is not None else content[:6]
    return head + (struct.pack("<QQ", *entry) + content[22:] if entry is not None else content[6:])


@pytest.mark.parametrize(
    "change", [{"channel": 77}, {"entry": (START_NS + 1, 0)}, {"entry": (START_NS, 999_999)}]
)
def test_a_message_index_that_points_elsewhere_costs_nothing_and_is_told(tmp_path, change):
    data = bytearray(mcap(tmp_path / "one.mcap"))
    _, end = boundaries(data)[1][0]
    (length,) = struct.unpack_from("<Q", data, end + 1)
    data[end + 9 : end + 9 + length] = own_index(bytes(data[end + 9 : end + 9 + length]), **change)
    recovery, kept = recovered(tmp_path, data)
    assert kept == messages(tmp_path / "one.mcap") and recovery.is_complete
    assert "1 message indexes do not say where" in recovery.repairs[0]


def test_the_summary_of_another_file_is_not_believed(tmp_path):
    first = mcap(tmp_path / "one.mcap", [("/point", POINT), ("/text", TEXT)])
    other = mcap(
        tmp_path / "two.mcap", [("/text", TEXT), ("/point", POINT)], start_ns=2 * START_NS
    )
    end = first.index(b"\x0f\x04\0\0\0\0\0\0\0")
    begin = other.index(b"\x0f\x04\0\0\0\0\0\0\0")
    tail = bytearray(other[begin:-37])
    move = end - begin
    footer = struct.unpack_from("<QQI", other, len(other) - 28)
    head = struct.pack("<BQQQ", 2, 20, footer[0] + move, footer[1] + move if footer[1] else 0)
    tail += head + struct.pack("<I", zlib.crc32(head, zlib.crc32(tail[13:]))) + MAGIC
    recovery, kept = recovered(tmp_path, first[:end] + tail)
    assert (
        kept == messages(tmp_path / "one.mcap")
        and "summary is none of this file" in recovery.repairs[0]
    )


def test_a_chunk_without_index_and_a_chunk_index_that_points_elsewhere(tmp_path):
    data = bytearray(mcap(tmp_path / "one.mcap", enable_crcs=False))
    begin, end = boundaries(data)[1][1]
    place = bytes(data).index(struct.pack("<BQ", 8, 78), end)
    struct.pack_into("<Q", data, place + 9 + 16, begin + 3)  # of the first chunk's index
    recovery, kept = recovered(tmp_path, data)
    assert kept == messages(
        tmp_path / "one.mcap"
    ) and "names 1 chunks that are not where it says" in "".join(recovery.repairs)
    (length,) = struct.unpack_from("<Q", data, end + 1)
    recovery, kept = recovered(tmp_path, data[:end] + data[end + 9 + length : -60])
    assert kept == messages(tmp_path / "one.mcap")


# blocks that are missing


def test_without_its_head_nothing_is_called_complete(tmp_path):
    data = mcap(tmp_path / "one.mcap")
    for begin in (4, 8, 30, 500, 4096):
        recovery, kept = recovered(tmp_path, data[begin:])
        assert len(kept) >= 80 and set(kept) <= set(messages(tmp_path / "one.mcap"))
        assert not recovery.is_complete or len(kept) == 200


def test_a_block_of_zero_bytes_is_called_that(tmp_path):
    data = bytearray(mcap(tmp_path / "one.mcap", use_chunking=False))
    data[8192:12288] = bytes(4096)
    recovery, kept = recovered(tmp_path, data)
    assert 120 < len(kept) < 200 and set(kept) <= set(messages(tmp_path / "one.mcap"))
    assert "zero bytes, which the disk never stored" in recovery.places[0].reason
    assert (
        not recovery.is_complete
        and recovery.is_exact
        and recovery.lost == {"/point": 200 - len(kept)}
    ), "the statistics count"


def test_a_length_that_is_damaged_hides_no_messages(tmp_path):
    """Outside chunks only what follows a message tells its length."""
    data = bytearray(mcap(tmp_path / "one.mcap", use_chunking=False))
    place = bytes(data).index(struct.pack("<BQ", 5, 66))
    struct.pack_into("<Q", data, place + 1, 5000)
    recovery, kept = recovered(tmp_path, data)
    assert len(kept) == 199 and "its length is damaged" in recovery.places[0].reason


def test_messages_that_no_crc_vouches_for_are_kept_only_if_they_are_some(tmp_path):
    data = bytearray(
        mcap(tmp_path / "one.mcap", [("/text", TEXT)], use_chunking=False, enable_crcs=False)
    )
    place = bytes(data).index(b"0 50\0")
    data[place - 4] = 200  # the length of the text
    recovery, kept = recovered(tmp_path, data)
    assert (
        len(kept) == 199
        and "no CRC vouches" in recovery.places[0].reason
        and not recovery.is_complete
    )


def test_a_definition_that_is_damaged_is_that_which_is_installed(tmp_path):
    data = bytearray(mcap(tmp_path / "one.mcap", use_chunking=False, enable_crcs=False))
    while (place := bytes(data).find(b"float64 x")) >= 0:
        data[place : place + 7] = b"float6?"
    recovery, kept = recovered(tmp_path, data)
    assert len(kept) == 200 and "which is installed here is in its place" in recovery.repairs[0]


# encodings


def test_what_is_not_cdr_is_kept_as_it_is_and_told(tmp_path):
    told = {"schema": "ros1msg", "text": "string data", "encoding": "ros1"}
    data = struct.pack("<I", 2) + b"ab"
    channels = [("/chatter", "std_msgs/String", told)]
    mcap_file(tmp_path / "json.mcap", channels, [(0, 5, data)], profile="ros1")
    recovery = recover(tmp_path / "json.mcap", tmp_path / "new")
    assert recovery.is_complete and any("'ros1', not as cdr" in note for note in recovery.notes)
    assert (recovery.path / "new_0.mcap").read_bytes()[17:25] == struct.pack("<I", 4) + b"ros1", (
        "the profile says so, too"
    )


def test_a_wrong_profile_of_ros_2_messages_is_mended(tmp_path):
    data = mcap(tmp_path / "one.mcap").replace(
        b"\x04\0\0\0ros2\x07\0\0\0another", b"\x04\0\0\0ros3\x07\0\0\0another"
    )
    recovery, kept = recovered(tmp_path, data)
    assert len(kept) == 200 and "the profile is 'ros2'" in recovery.repairs[0]
    assert [str(one) for one in check_bag(recovery.path)] == []


def test_messages_that_were_compressed_one_by_one_are_plain_afterwards(tmp_path):
    data = serialize(TYPES, TEXT, {"data": "a" * 100})
    packed = zstandard.ZstdCompressor().compress(data)
    mcap_file(tmp_path / "one.mcap", [("/text", TEXT)], [(0, 5, packed)])
    recovery, kept = recovered(tmp_path, (tmp_path / "one.mcap").read_bytes()[:-10])
    assert [one[4] for one in kept] == [data] and "compressed one by one" in recovery.notes[0]


# copies as text


def windows(data):
    return "".join(bytes([byte]).decode("cp1252", "ignore") or chr(byte) for byte in data).encode()


COPIES = {
    "a carriage return before each line feed": lambda data: data.replace(b"\n", b"\r\n"),
    "Latin-1 as UTF-8": lambda data: data.decode("latin-1").encode(),
    "Windows-1252 as UTF-8": windows,
    "both": lambda data: data.decode("latin-1").encode().replace(b"\n", b"\r\n"),
}
LOSSY = {
    "7 bits": lambda data: bytes(byte & 0x7F for byte in data),
    "replacement characters": lambda data: data.decode("utf-8", "replace").encode(),
    "question marks": lambda data: data.decode("ascii", "replace").encode("ascii", "replace"),
    "without": lambda data: data.decode("ascii", "ignore").encode(),
    "line feeds for carriage returns": lambda data: data.replace(b"\r", b"\n"),
}


@pytest.mark.parametrize("copy", COPIES.values(), ids=COPIES)
def test_what_a_copy_as_text_put_in_is_taken_out_again(tmp_path, copy):
    data = (record(tmp_path / "bag", chunk_size=4096) / "bag_0.mcap").read_bytes()
    recovery, kept = recovered(tmp_path, copy(data))
    assert (
        kept == messages(tmp_path / "bag" / "bag_0.mcap")
        and recovery.is_complete
        and recovery.unverified == 0
    )
    assert "copied as if it were text" in recovery.notes[0] and "undone" in recovery.notes[0]


@pytest.mark.parametrize("copy", LOSSY.values(), ids=LOSSY)
def test_what_a_copy_as_text_left_out_is_named(tmp_path, copy):
    data = (record(tmp_path / "bag", chunk_size=4096) / "bag_0.mcap").read_bytes()
    with pytest.raises(
        BagError,
        match="copied as if it were text.*cannot be undone: fetch it again in binary mode",
    ):
        recovered(tmp_path, copy(data))
    assert not (tmp_path / "new0").exists()


@pytest.mark.parametrize("copy", ["lost", "put in where none was"])
def test_carriage_returns_are_put_back_where_a_crc_says_where(tmp_path, copy):
    data = (
        record(tmp_path / "bag", n_steps=3000, chunk_size=4096, flush_period_ns=10**12)
        / "bag_0.mcap"
    ).read_bytes()
    assert data.count(b"\r\n") > 5, "of chance"
    changed = data.replace(b"\r\n", b"\n")
    recovery, kept = recovered(
        tmp_path, changed if copy == "lost" else changed.replace(b"\n", b"\r\n")
    )
    written = messages(tmp_path / "bag" / "bag_0.mcap")
    assert (
        set(kept) <= set(written) and len(kept) >= 0.95 * len(written) and recovery.unverified == 0
    )


# files that are no bags


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"#ROSBAG V2.0\n" + bytes(100), "rosbag reindex"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "git lfs pull"),
        (b"<!DOCTYPE html><html>log in</html>", "web page"),
        (b"PK\x03\x04" + bytes(50), "unzip"),
        (b"\xfd7zXZ\0" + bytes(50), "xz -d"),
        (lz4.frame.compress(b"abc"), "lz4 -d"),
        (base64.b64encode(MAGIC + b"abc"), "base64 -d"),
        (bytes(10_000), "nothing but 10000 zero bytes"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_file_of_another_kind_is_named_for_what_it_is(tmp_path, content, what):
    with pytest.raises(BagError, match=f"nothing to recover: odd.mcap: it is .*{what}"):
        recovered(tmp_path, content, "odd.mcap")


@pytest.mark.parametrize(
    "pack", [gzip.compress, zstandard.ZstdCompressor().compress], ids=["gzip", "zstd"]
)
def test_a_file_that_is_compressed_as_a_whole_is_unpacked_as_far_as_it_goes(tmp_path, pack):
    data = mcap(tmp_path / "one.mcap", n_steps=6000, compression=CompressionType.NONE)
    packed = pack(data)
    for name in ("packed_0.mcap", "packed_0.mcap.zstd"):
        recovery, kept = recovered(tmp_path, packed, name)
        assert (
            len(kept) == 6000 and recovery.is_complete and "compressed with" in recovery.notes[0]
        )
    recovery, kept = recovered(tmp_path, packed[: len(packed) // 2], name)
    assert (
        1000 < len(kept) < 5000
        and not recovery.is_complete
        and "only in part" in recovery.places[0].reason
    )


# what is said


def test_the_command_says_how_much_was_looked_at_and_at_least_how_much_is_lost(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    data = bytearray(mcap(tmp_path / "one_0.mcap")[:-300])
    begin, _ = boundaries(data)[1][1]
    data[begin + 200] ^= 1
    (tmp_path / "one_0.mcap").write_bytes(data)
    assert main(["bag", "recover", "one_0.mcap"]) == 0
    told = capsys.readouterr().out
    assert (
        f"looked at {len(data)} of {len(data)} bytes (100 %)" in told
        and "lost: at least" in told
        and "complete" not in told
    )
    assert main(["bag", "recover", "one_0.mcap", "--output", "again", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (
        told["is_complete"] is False
        and told["is_exact"] is False
        and told["n_looked_at"] == len(data)
    )


# whatever happens


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Files and their messages: of ours, and of `mcap` with and without chunks."""
    folder = tmp_path_factory.mktemp("whole")
    ours = record(folder / "bag", n_steps=120, chunk_size=2000) / "bag_0.mcap"
    mcap(folder / "chunks.mcap", n_steps=60)
    mcap(folder / "plain.mcap", n_steps=60, use_chunking=False)
    return [
        (file.read_bytes(), Counter(messages(file)))
        for file in (ours, folder / "chunks.mcap", folder / "plain.mcap")
    ]


def changed(data, kind, first, second, value):
    """Bytes with one thing changed. first, second: where, as shares of the length."""
    begin, end = sorted((int(first * len(data)), int(second * len(data))))
    return {
        "cut": lambda: data[:begin],
        "head": lambda: data[begin:],
        "flip": lambda: data[:begin] + bytes([data[begin] ^ value]) + data[begin + 1 :],
        "insert": lambda: data[:begin] + bytes([value]) * (end - begin) + data[begin:],
        "delete": lambda: data[:begin] + data[end:],
        "twice": lambda: data[:end] + data[begin:end] + data[end:],
        "zero": lambda: data[:begin] + bytes(end - begin) + data[end:],
        "moved": lambda: data[:begin] + data[end:] + data[begin:end],
        "text": lambda: (
            data.replace(b"\n", b"\r\n") if value % 2 else data.replace(b"\r\n", b"\n")
        ),
        "two": lambda: data[:begin] + data,
    }[kind]()


SHARE = st.floats(0, 0.999)
KINDS = ("cut", "head", "flip", "insert", "delete", "twice", "zero", "moved", "text", "two")


@settings(max_examples=max(40, settings.default.max_examples // 2))
@given(
    which=st.integers(0, 2),
    kind=st.sampled_from(KINDS),
    places=st.tuples(SHARE, SHARE),
    value=st.integers(1, 255),
)
def test_however_a_bag_is_damaged_recovery_says_why_not_or_makes_one_that_is_right(
    tmp_path_factory, whole, which, kind, places, value
):
    data, written = whole[which]
    folder = tmp_path_factory.mktemp("any")
    try:
        recovery, kept = recovered(folder, changed(data, kind, *places, value))
    except BagError as error:
        assert "nothing to recover" in str(error)
        return
    kept = Counter(kept)
    n_missing, n_changed = (written - kept).total(), (kept - written).total()
    assert n_changed <= recovery.unverified, (
        "a message that a CRC vouches for is none that was written"
    )
    assert sum(recovery.lost.values()) <= n_missing, (
        f"{recovery.lost} are said to be lost, {n_missing} are"
    )
    n_foreign = sum(count for message, count in kept.items() if message not in written)
    assert not recovery.is_complete or n_missing == n_foreign, (
        "complete, but for bytes that no CRC vouches for, and for what stands there twice"
    )
