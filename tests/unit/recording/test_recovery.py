"""Bags made new of damaged ones: cut off anywhere, with bytes changed anywhere, with files
missing.
"""

import struct

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from dart_skill.recording import (
    BagError,
    BagReader,
    BagWriter,
    definition,
    qos_yaml,
    serialize,
    type_hash,
    typestore,
)
from dart_skill.recording.bags import check_bag, recover
from dart_skill.recording.bags.files import part_number

POINT, TEXT = "geometry_msgs/msg/PointStamped", "std_msgs/msg/String"
START_NS, STEP_NS = 10**18, 10_000_000
TYPES = typestore()


def messages(file):
    """All messages of a file by others' code that checks every CRC, in the order of the file."""
    with open(file, "rb") as stream:
        found = make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False)
        return [
            (channel.topic, one.log_time, one.publish_time, one.sequence, one.data)
            for _, channel, one in found
        ]


def bag_messages(folder):
    return [
        one for file in sorted(folder.glob("*.mcap"), key=part_number) for one in messages(file)
    ]


def record(path, n_steps=400, **options):
    rng = np.random.default_rng(0)
    with BagWriter(path, custom_data={"seed": "7"}, **options) as bag:
        for name, type_name in (("/point", POINT), ("/text", TEXT)):
            bag.add_topic(
                name,
                type_name,
                definition(TYPES, type_name),
                qos_yaml(),
                type_hash(TYPES, type_name),
            )
        bag.add_attachment("wam.yaml", "joints: 7\n")
        for step in range(n_steps):
            stamp = START_NS + step * STEP_NS
            point = dict(zip("xyz", rng.normal(size=3), strict=True))
            bag.write("/point", stamp, stamp - 5, serialize(TYPES, POINT, {"point": point}))
            if step % 10 == 0:
                bag.write(
                    "/text", stamp + 1, stamp, serialize(TYPES, TEXT, {"data": f"step {step}"})
                )
    return path


def boundaries(data):
    """Where records begin and the chunks among them, by the lengths alone."""
    places, chunks, place = [8], [], 8
    while place < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, place)
        if opcode == 6:
            chunks.append((place, place + 9 + length))
        place += 9 + length
        places.append(place)
    return places, chunks


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A file, its messages, its record boundaries and its chunks."""
    file = record(tmp_path_factory.mktemp("whole") / "bag", chunk_size=4096) / "bag_0.mcap"
    data = file.read_bytes()
    return data, messages(file), *boundaries(data)


@pytest.fixture
def damaged(tmp_path):
    """What makes a damaged file and recovers it."""
    count = iter(range(10**6))

    def recovered(data):
        number = next(count)
        file = tmp_path / f"damaged{number}_0.mcap"
        file.write_bytes(data)
        try:
            return recover(file, tmp_path / f"new{number}")
        finally:
            assert file.read_bytes() == bytes(data), "the damaged file was changed"

    return recovered


def kept_of(recovery):
    """The messages of a recovered bag, after all has been said about it that must hold for any."""
    kept = bag_messages(recovery.path)
    assert sum(recovery.messages.values()) == len(kept)
    errors = [str(finding) for finding in check_bag(recovery.path) if finding.severity == "error"]
    assert errors == []
    with BagReader(recovery.path) as bag:
        assert bag.message_count == len(kept) == sum(1 for _ in bag.messages())
    return kept


def test_a_whole_bag_is_recovered_to_the_same_messages(tmp_path, whole):
    path = record(tmp_path / "bag", chunk_size=4096)
    recovery = recover(path, tmp_path / "new")
    assert kept_of(recovery) == whole[1]
    assert (
        recovery.is_complete
        and recovery.places == []
        and recovery.lost == {}
        and recovery.unverified == 0
    )
    assert (recovery.start_ns, recovery.end_ns) == (whole[1][0][1], whole[1][-1][1])
    assert recovery.messages == {"/point": 400, "/text": 40} and recovery.n_attachments == 1
    with BagReader(path) as before, BagReader(recovery.path) as after:
        assert after.topics == before.topics
        assert after.attachments() == before.attachments()
        assert after.custom_data["seed"] == "7" and after.custom_data["recovered_from"] == "bag"
        assert "440 messages kept, 0 known to be lost" in after.custom_data["recovery"]


def test_cut_off_at_every_record_boundary_all_chunks_before_are_kept(damaged, tmp_path):
    """Of four chunks."""
    file = record(tmp_path / "bag", n_steps=150, chunk_size=4096) / "bag_0.mcap"
    data, written = file.read_bytes(), messages(file)
    places, chunks = boundaries(data)
    assert len(chunks) == 4
    for place in places[:-1]:
        n_chunks = sum(end <= place for _, end in chunks)
        if not n_chunks and place < chunks[0][0]:
            continue  # the test after the next
        recovery = damaged(data[:place])
        kept = kept_of(recovery)
        last = max((one[1] for one in kept), default=0)
        assert kept == [one for one in written if one[1] <= last], f"cut off at {place}"
        assert recovery.lost_chunks == 0 and recovery.unverified == 0
        assert len(kept) == len(written) if n_chunks == len(chunks) else len(kept) < len(written)


@pytest.mark.slow
def test_cut_off_at_random_bytes_what_is_kept_is_what_was_written(whole, damaged):
    data, written, _, chunks = whole
    for place in np.random.default_rng(1).integers(chunks[0][1], len(data), size=40):
        recovery = damaged(data[:place])
        kept = kept_of(recovery)
        assert kept == written[: len(kept)]
        complete = [chunk for chunk in chunks if chunk[1] <= place]
        assert len(kept) - recovery.unverified == len(kept_of(damaged(data[: complete[-1][1]])))
        assert not recovery.is_complete or len(kept) == len(written)


def test_cut_off_before_the_first_topic_there_is_nothing_to_recover(whole, damaged, tmp_path):
    data, _, places, _ = whole
    for place in (1, 7, 8, 12, *places[1:3]):
        with pytest.raises(BagError, match="damaged.*nothing to recover"):
            damaged(data[:place])
    assert not list(tmp_path.glob("new*")), "no half bag is left"


@pytest.mark.slow
def test_a_changed_byte_costs_its_chunk_and_no_more_and_the_loss_is_told(whole, damaged):
    data, written, _, chunks = whole
    rng = np.random.default_rng(2)
    for place in rng.integers(0, len(data), size=100):
        changed = bytearray(data)
        changed[place] ^= int(rng.integers(1, 256))
        recovery = damaged(changed)
        kept = kept_of(recovery)
        rest = iter(written)
        assert all(one in rest for one in kept), (
            f"byte {place}: messages that were not written, or in another order"
        )
        n_lost = len(written) - len(kept)
        assert sum(recovery.lost.values()) == n_lost, (
            f"byte {place}: {n_lost} lost, told are {recovery.lost}"
        )
        hit = [chunk for chunk in chunks if chunk[0] <= place < chunk[1]]
        assert n_lost <= (61 if hit else 0), f"byte {place}: {n_lost} lost"
        assert not n_lost or (
            recovery.lost_chunks == 1 and str(hit[0][0]) in str(recovery.places[0])
        ), recovery.places


@pytest.mark.slow
def test_a_changed_length_or_opcode_of_a_chunk_costs_nothing(whole, damaged):
    data, written, _, chunks = whole
    for begin, _ in chunks[1:4]:
        for offset in range(9):
            for cut in (len(data), len(data) - 1000):  # with the summary and without
                changed = bytearray(data[:cut])
                changed[begin + offset] ^= 0x81
                recovery = damaged(changed)
                assert len(recovery.repairs) == 1 and f"byte {begin}" in recovery.repairs[0]
                assert kept_of(recovery) == written


def test_bytes_that_are_missing_or_too_many_do_not_hide_what_follows(whole, damaged):
    """No summary, no message index: only the looks of the records lead back to them."""
    data, written, _, chunks = whole
    (first, end), (second, _) = chunks[2], chunks[3]
    for changed in (
        data[: first + 500] + data[end - 3 :],
        data[:end] + bytes(700) + data[second:],
        data[:first] + data[first + 50 :],
    ):
        kept = kept_of(damaged(changed[:-200]))
        assert len(kept) >= len(written) - 61
        rest = iter(written)
        assert all(one in rest for one in kept)


def test_messages_of_a_chunk_that_was_cut_off_are_read_as_far_as_they_go_and_called_unverified(
    damaged, tmp_path
):
    """Chunks of several blocks of the compressor (128 KiB)."""
    file = (
        record(tmp_path / "bag", n_steps=4000, chunk_size=300_000, flush_period_ns=10**12)
        / "bag_0.mcap"
    )
    data, written = file.read_bytes(), messages(file)
    ((begin, end),) = boundaries(data)[1][:1]
    recovery = damaged(data[: end - 100])
    kept = kept_of(recovery)
    assert kept == written[: len(kept)] and recovery.unverified == len(kept) > 1000
    assert "could still be read" in recovery.places[0].reason and "without a CRC" in str(recovery)


def test_a_changed_attachment_is_left_out_by_name(whole, damaged):
    changed = bytearray(whole[0])
    changed[whole[0].index(b"joints: 7")] ^= 1
    recovery = damaged(changed)
    assert (
        recovery.n_attachments == 0
        and "'wam.yaml'" in recovery.places[0].reason
        and recovery.places[0].messages == 0
    )
    assert kept_of(recovery) == whole[1]


def test_split_bags_are_recovered_whatever_their_files_lack(tmp_path):
    path = record(tmp_path / "bag", n_steps=1200, chunk_size=4096, max_bytes=20_000)
    files = sorted(path.glob("*.mcap"), key=part_number)
    written = [messages(file) for file in files]
    assert len(files) > 4
    files[1].write_bytes(b"")
    files[2].write_bytes(files[2].read_bytes()[:-10])
    recovery = recover(path, tmp_path / "new")
    assert kept_of(recovery) == [one for part in written[:1] + written[2:] for one in part]
    assert sum(recovery.lost.values()) == len(written[1])
    assert [(place.file, place.reason) for place in recovery.places][0] == (
        "bag_1.mcap",
        "the file is empty (0 bytes)",
    )
    files[1].unlink()
    (path / "metadata.yaml").unlink()
    recovery = recover(path, tmp_path / "again")
    assert kept_of(recovery) == [one for part in written[:1] + written[2:] for one in part]
    assert sum(recovery.lost.values()) == len(written[1]), "gaps in the sequence numbers tell it"


def test_bags_of_others_are_recovered(tmp_path):
    """`rosbags` writes no CRC, so that what is kept is called unverified; its file ends before the
    second chunk does.
    """
    data = serialize(
        TYPES,
        "std_msgs/msg/UInt8MultiArray",
        {"data": np.random.default_rng(0).integers(0, 255, 1000, np.uint8)},
    )
    with Writer(tmp_path / "foreign", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(
            "/bytes", "std_msgs/msg/UInt8MultiArray", typestore=TYPES
        )
        for stamp in range(2000):
            writer.write(connection, stamp, data)
    file = tmp_path / "foreign" / "foreign.mcap"
    file.write_bytes(file.read_bytes()[:1_500_000])
    recovery = recover(tmp_path / "foreign", tmp_path / "new")
    kept = kept_of(recovery)
    assert len(kept) == recovery.unverified > 1400 and {one[4] for one in kept} == {data}
    assert recovery.lost == {"/bytes": 2000 - len(kept)}, "metadata.yaml tells how many there were"
    with AnyReader([recovery.path]) as reader:
        assert [stamp for _, stamp, _ in reader.messages()] == list(range(len(kept)))


@pytest.mark.parametrize(
    "compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD]
)
@pytest.mark.parametrize("chunked", [True, False])
def test_files_of_plain_mcap_are_recovered_with_their_encodings_and_metadata(
    tmp_path, compression, chunked
):
    file = tmp_path / "plain.mcap"
    with open(file, "wb") as stream:
        writer = McapWriter(
            stream,
            chunk_size=2000,
            compression=compression,
            use_chunking=chunked,
            index_types=IndexType.NONE,
        )
        writer.start("", "another")
        schema = writer.register_schema("T", "jsonschema", b"{}")
        for topic, number in (("a", schema), ("b", 0)):
            writer.register_channel(topic, "json", number, {"key": topic})
        writer.add_metadata("place", {"lab": "one"})
        for stamp in range(300):
            writer.add_message(1 + stamp % 2, stamp, b'{"x": %d}' % stamp, stamp + 1, 17)
        writer.finish()
    written = messages(file)
    file.write_bytes(file.read_bytes()[:-300])
    recovery = recover(file, tmp_path / "new")
    kept = bag_messages(recovery.path)
    assert kept == written[: len(kept)] and len(kept) > 200
    assert recovery.unverified == (0 if chunked else len(kept))
    with open(recovery.path / "new_0.mcap", "rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert {record.name for record in reader.iter_metadata()} == {"rosbag2", "place"}
        assert [
            (one.topic, one.message_encoding, one.schema_id, one.metadata)
            for one in summary.channels.values()
        ] == [
            ("a", "json", 1, {"key": "a"}),
            ("b", "json", 0, {"key": "b"}),
        ]


def test_nothing_is_overwritten_and_nonsense_is_refused(tmp_path):
    path = record(tmp_path / "bag", n_steps=3)
    (tmp_path / "there").mkdir()
    with pytest.raises(FileExistsError, match="never overwritten"):
        recover(path, tmp_path / "there")
    with pytest.raises(BagError, match="choose another folder"):
        recover(path, path / "new")
    with pytest.raises(BagError, match="no such bag"):
        recover(tmp_path / "nothing", tmp_path / "new")
    with pytest.raises(BagError, match="no .mcap file and no .db3 file to recover"):
        recover(tmp_path / "there", tmp_path / "new")
    (tmp_path / "empty.mcap").write_bytes(b"")
    with pytest.raises(BagError, match="empty.mcap is empty .0 bytes."):
        recover(tmp_path / "empty.mcap", tmp_path / "new")
    (tmp_path / "random.mcap").write_bytes(np.random.default_rng(0).bytes(100_000))
    with pytest.raises(
        BagError, match="nothing to recover: random.mcap: the file magic is invalid"
    ):
        recover(tmp_path / "random.mcap", tmp_path / "new")
    assert not (tmp_path / "new").exists()
    assert sorted(file.name for file in path.iterdir()) == ["bag_0.mcap", "metadata.yaml"]
