"""Bags that were made to fill the memory, to crash a parser, or to be waited for: refused in a
line, before any of that.
"""

import contextlib
import importlib
import os
import shutil
import struct
import tracemalloc
from itertools import pairwise

import lz4.frame
import numpy as np
import pytest
import yaml
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from dart_skill.recording import BagError, BagReader, BagWriter, qos_yaml
from dart_skill.recording.bags import check_bag, files, recover
from dart_skill.recording.bags.metadata import load
from dart_skill.recording.mcap import records, walk

MAGIC = b"\x89MCAP0\r\n"
SIZE, LIMIT = 4_000_000, 1_000_000
PACKED = {
    "zstd": zstandard.ZstdCompressor().compress(bytes(SIZE)),
    "zstd that does not say how large it is": (
        zstandard.ZstdCompressor(write_content_size=False).compress(bytes(SIZE))
    ),
    "lz4": lz4.frame.compress(bytes(SIZE)),
}


@pytest.fixture(autouse=True, scope="module")
def small_limits():
    """What is a bomb here is small enough to be made in no time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(records, "LARGEST_CHUNK", LIMIT)
        yield


def record(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def text(value):
    return struct.pack("<I", len(value.encode())) + value.encode()


def chunk(kind, size, data=None, crc=0):
    data = PACKED[kind] if data is None else data
    return record(
        6,
        struct.pack("<QQQI", 1, 1, size, crc)
        + text(kind[:4].strip())
        + struct.pack("<Q", len(data))
        + data,
    )


def schema(definition="string data\n", number=1, name="std_msgs/msg/String"):
    return record(3, struct.pack("<H", number) + text(name) + text("ros2msg") + text(definition))


def channel(metadata=b""):
    return record(
        4,
        struct.pack("<HH", 1, 1)
        + text("/a")
        + text("cdr")
        + struct.pack("<I", len(metadata))
        + metadata,
    )


LAUGHS = "a: &a [x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join(['*' + a] * 8)}]\n" for a, b in pairwise("abcdefgh")
)
"""A billion of them, in a few lines."""
MESSAGE = record(5, struct.pack("<HIQQ", 1, 0, 1, 1) + b"\0\1\0\0\2\0\0\0a\0")
END = record(2, struct.pack("<QQI", 0, 0, 0)) + MAGIC


def written(path, *parts, end=END):
    path.write_bytes(MAGIC + record(1, text("ros2") + text("x")) + b"".join(parts) + end)
    return path


def read(path):
    with BagReader(path) as bag:
        return list(bag.messages(decode=False))


@pytest.mark.parametrize("said", [SIZE, 100])
@pytest.mark.parametrize("kind", PACKED)
def test_a_chunk_that_holds_more_than_any_chunk_is_not_unpacked(tmp_path, kind, said):
    path = written(tmp_path / "bomb.mcap", schema(), channel(), MESSAGE, chunk(kind, said))
    with pytest.raises(
        BagError,
        match="bomb.mcap: the chunk (says that it holds 4000000 bytes|cannot be decompressed)",
    ):
        read(path)
    assert any(finding.severity == "error" for finding in check_bag(path))
    assert sum(recover(path, tmp_path / "kept").messages.values()) == 1, (
        "the message beside the bomb"
    )


@pytest.mark.parametrize("kind", PACKED)
def test_what_is_left_of_a_bomb_that_was_cut_off_is_not_unpacked_either(tmp_path, kind):
    data = PACKED[kind]
    path = written(
        tmp_path / "bomb.mcap",
        schema(),
        channel(),
        MESSAGE,
        chunk(kind, SIZE, data)[:-20],
        end=b"",
    )
    assert sum(recover(path, tmp_path / "kept").messages.values()) == 1
    (rest,) = (
        one.rest
        for one in walk(memoryview(path.read_bytes()))
        if getattr(one, "rest", None) is not None
    )
    tracemalloc.start()
    assert not list(rest.messages_of_part())
    assert tracemalloc.get_traced_memory()[1] <= 6 * LIMIT
    tracemalloc.stop()


@pytest.mark.parametrize(
    "filling",
    [bytes(9), struct.pack("<BQ", 0x90, 0)],
    ids=["no records", "records of a kind that nobody knows"],
)
def test_a_chunk_of_more_records_than_its_bytes_can_tell_apart_is_not_walked(tmp_path, filling):
    raw = filling * 100_000
    path = written(
        tmp_path / "bomb.mcap",
        schema(),
        channel(),
        chunk("zstd", len(raw), zstandard.ZstdCompressor().compress(raw)),
    )
    with pytest.raises(BagError, match="more than .* records|no record begins|reaches beyond"):
        read(path)


def test_many_chunks_that_hold_too_much_together_are_left_out(tmp_path, monkeypatch):
    module = importlib.import_module("dart_skill.recording.mcap.record_walk")
    monkeypatch.setattr(module, "LARGEST_UNPACKED", 2 * LIMIT)
    monkeypatch.setattr(module, "USUAL_RATIO", 10)
    raw = record(0x90, bytes(LIMIT - 9))
    packed = chunk("zstd", len(raw), zstandard.ZstdCompressor().compress(raw))
    path = written(tmp_path / "bomb.mcap", schema(), channel(), MESSAGE, *[packed] * 5)
    with pytest.raises(BagError, match="the chunks say that they hold 3000000 bytes"):
        read(path)


def test_files_of_one_bag_may_hold_much_together(tmp_path, monkeypatch):
    """What they hold is compared with the size of all of them."""
    module = importlib.import_module("dart_skill.recording.mcap.record_walk")
    monkeypatch.setattr(module, "LARGEST_UNPACKED", 2 * LIMIT)
    monkeypatch.setattr(module, "USUAL_RATIO", 4)
    raw = record(0x90, np.random.default_rng(0).bytes(LIMIT - 9))
    packed = chunk("zstd", len(raw), zstandard.ZstdCompressor().compress(raw))
    for k in range(4):
        written(tmp_path / f"bag_{k}.mcap", schema(), channel(), packed, MESSAGE, packed)
    recovery = recover(tmp_path, tmp_path.parent / f"{tmp_path.name}_kept")
    assert sum(recovery.messages.values()) == 4 and recovery.n_looked_at == recovery.n_bytes


@pytest.mark.parametrize(
    ("metadata", "reason"),
    [
        ("a: " + "[" * 200_000, "nested deeper than 30 levels"),
        ("<<: " + "{<<: " * 1000 + "{}" + "}" * 1000, "nested deeper than 30 levels"),
        (LAUGHS, "aliases"),
        ("a: &a [*a]", "aliases"),
        ("a: " + "y" * 3_000_000, "more than the 2000000 of any bag"),
        ("a: '", "is no YAML"),
        ("rosbag2_bagfile_information: {relative_file_paths: {}}", "misuses relative_file_paths"),
        (
            "rosbag2_bagfile_information: {relative_file_paths: [1, {}]}",
            "misuses relative_file_paths",
        ),
        (
            "rosbag2_bagfile_information: {topics_with_message_count: [{a: 1}]}",
            "misuses topics_with_message_count",
        ),
        ("rosbag2_bagfile_information: {custom_data: [1]}", "misuses custom_data"),
    ],
)
def test_metadata_that_ask_for_too_much_are_told_and_the_messages_are_read_without_them(
    tmp_path, metadata, reason
):
    (tmp_path / "bag").mkdir()
    written(tmp_path / "bag" / "bag_0.mcap", schema(), channel(), MESSAGE)
    (tmp_path / "bag" / "metadata.yaml").write_text(metadata, encoding="utf-8")
    assert len(read(tmp_path / "bag")) == 1
    assert any(
        reason in finding.message and finding.severity == "warning"
        for finding in check_bag(tmp_path / "bag")
    )
    assert sum(recover(tmp_path / "bag", tmp_path / "kept").messages.values()) == 1


def test_a_parser_that_limits_depth_itself_gives_the_same_reason(monkeypatch):
    """PyYAML 6.0.4 does."""

    def refuse(text, Loader):
        raise yaml.scanner.ScannerError(
            "while increasing flow level", None, "exceeded maximum nesting depth"
        )

    monkeypatch.setattr(yaml, "parse", refuse)
    with pytest.raises(ValueError, match="it is nested deeper than 30 levels"):
        load("a: [1]", "it")


def test_aliases_that_unfold_to_little_are_read():
    assert load("a: &a [1, 2]\nb: [*a, *a]", "it") == {"a": [1, 2], "b": [[1, 2], [1, 2]]}


def test_quality_of_service_in_a_file_is_looked_at_too(tmp_path):
    qos = text("offered_qos_profiles") + text("[" * 1000)
    path = written(tmp_path / "bomb.mcap", schema(), channel(qos), MESSAGE)
    assert len(read(path)) == 1
    with BagReader(path) as bag:
        assert bag.topics["/a"].qos == ()


@pytest.mark.parametrize(
    "verb",
    [read, check_bag, lambda path: recover(path, path.with_name("kept"))],
    ids=["read", "check", "recover"],
)
def test_a_pipe_is_not_waited_for(tmp_path, verb):
    os.mkfifo(tmp_path / "pipe.mcap")
    try:
        said = str(verb(tmp_path / "pipe.mcap"))
    except OSError as error:
        said = str(error)
    assert "pipe.mcap is a named pipe, and not a file" in said


def test_metadata_that_are_a_pipe_are_not_waited_for(tmp_path):
    (tmp_path / "bag").mkdir()
    written(tmp_path / "bag" / "bag_0.mcap", schema(), channel(), MESSAGE)
    os.mkfifo(tmp_path / "bag" / "metadata.yaml")
    assert len(read(tmp_path / "bag")) == 1
    assert any("named pipe" in finding.message for finding in check_bag(tmp_path / "bag"))


def test_a_type_of_a_hundred_thousand_fields_is_not_parsed(tmp_path):
    definition = "".join(f"int32 f{k}\n" for k in range(100_000))
    path = written(
        tmp_path / "bomb.mcap", schema(definition, name="p/msg/Bomb"), channel(), MESSAGE
    )
    assert len(read(path)) == 1, "its messages can be had as bytes"
    with (
        BagReader(path) as bag,
        pytest.raises(BagError, match="definition in the bag is too long: 100001 lines"),
    ):
        list(bag.messages())


def test_a_type_that_cannot_be_is_named_and_the_others_are_known(tmp_path):
    path = written(
        tmp_path / "odd.mcap",
        schema(),
        schema("int32 a\nint32 a\n", 2, "p/msg/Twice"),
        channel(),
        MESSAGE,
    )
    with BagReader(path) as bag:
        assert [item.data.data for item in bag.messages()] == ["a"]


def test_a_compressed_file_that_unpacks_to_far_more_is_not_put_on_the_disk(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "LARGEST_UNPACKED", LIMIT)
    monkeypatch.setattr(files, "USUAL_RATIO", 10)
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag_0.mcap.zstd").write_bytes(PACKED["zstd"])
    (tmp_path / "bag" / "metadata.yaml").write_text(
        "rosbag2_bagfile_information: {version: 5, storage_identifier: mcap, duration:"
        " {nanoseconds: 0}, message_count: 0, starting_time: {nanoseconds_since_epoch: 0},"
        " topics_with_message_count: [], compression_format: zstd, compression_mode: FILE,"
        " relative_file_paths: [bag_0.mcap.zstd]}",
        encoding="utf-8",
    )
    with pytest.raises(BagError, match="bag_0.mcap.zstd unpacks to more than 1000000 bytes"):
        read(tmp_path / "bag")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Bytes of a small bag with everything that a bag has."""
    folder = tmp_path_factory.mktemp("whole") / "bag"
    with BagWriter(folder, custom_data={"seed": "1"}) as bag:
        bag.add_topic(
            "/a",
            "std_msgs/msg/String",
            "string data\n",
            qos_yaml("reliable", "volatile", "keep_last", 10),
            "RIHS01_0",
        )
        bag.add_attachment("notes", "text")
        for k in range(20):
            bag.write("/a", k, k, b"\0\1\0\0\2\0\0\0a\0")
    return (folder / "bag_0.mcap").read_bytes(), (folder / "metadata.yaml").read_text(
        encoding="utf-8"
    )


def survives(path, kept):
    """Reading, checking and recovering end, with what there is or with a line that says why not."""
    for verb in (read, check_bag, lambda path: recover(path, kept)):
        with contextlib.suppress(BagError, OSError):
            verb(path)
    shutil.rmtree(kept, ignore_errors=True)


some = settings(max_examples=max(20, settings.default.max_examples // 4))
"""Each takes three commands."""


@some
@given(
    changes=st.lists(
        st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=4
    ),
    cut=st.integers(0, 10**6),
)
def test_any_changed_bytes_are_read_or_refused(tmp_path_factory, whole, changes, cut):
    content = bytearray(whole[0])
    for place, value in changes:
        content[place % len(content)] = value
    path = tmp_path_factory.getbasetemp() / "changed.mcap"
    path.write_bytes(bytes(content[: cut % len(content)] if cut % 3 == 0 else content))
    survives(path, path.with_name("kept"))


WORDS = (
    "",
    "[]",
    "{}",
    "x",
    "-1",
    "1e999",
    "~",
    "[[]]",
    "{a: b}",
    "1970-99-99",
    "!!python/object:os.system x",
    "*a",
    "0x" + "f" * 5000,
)


@some
@given(line=st.integers(0, 10**6), value=st.sampled_from(WORDS))
def test_any_changed_metadata_are_read_or_refused(tmp_path_factory, whole, line, value):
    folder = tmp_path_factory.getbasetemp() / "odd"
    folder.mkdir(exist_ok=True)
    (folder / "bag_0.mcap").write_bytes(whole[0])
    lines = whole[1].splitlines()
    name, colon, _ = lines[line % len(lines)].partition(": ")
    lines[line % len(lines)] = f"{name}{colon or ': '}{value}"
    (folder / "metadata.yaml").write_text("\n".join(lines), encoding="utf-8")
    survives(folder, folder.with_name("kept"))


@some
@given(st.text(max_size=200))
def test_any_text_is_yaml_or_refused(content):
    with contextlib.suppress(ValueError):
        load(content, "it")
