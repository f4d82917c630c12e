"""What the bytes of MCAP records say (MCAP specification, version 0), with everything checked that
can be.

A record may have more bytes than it needs, as later versions may add fields at its end: they are
ignored. A record that is too short, and whatever else is wrong, is a `DamagedError` that says why.
"""

from __future__ import annotations

import mmap
import struct
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

import lz4.frame
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Header,
    McapRecord,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader

from dart_skill.common.files import open_file

MAGIC = b"\x89MCAP0\r\n"
FOOTER_LENGTH = 9 + 20 + len(MAGIC)
RECORD = struct.Struct("<BQ")
"""Opcode and length, with which every record begins."""
PARSED = frozenset(Opcode) - {Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX}
"""Opcodes of what `parse` reads."""
_CHUNK_HEAD = struct.Struct("<QQQII")
_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
LARGEST_CHUNK = 2**28
"""Largest content of a chunk that is unpacked, which is done in memory [bytes]."""
PIECE = 64
"""Size of the pieces in which a chunk that was cut off is unpacked; with zstd one becomes 2 MB at most
[bytes].
"""
USUAL_RECORDS = 10_000
"""Number of records that any chunk may have; a larger number needs a compressed byte for each."""
MOST_UNKNOWN = 64
"""Largest size of unknown fields at the end of a record that is searched [bytes]."""
READ_AT_ONCE = 2**24
"""Size of the part of a file that stays in memory while the file is gone through [bytes]."""
# what `mcap` makes of bytes that are no records
_UNREADABLE = (
    ValueError,
    struct.error,
    McapError,
    OverflowError,
    MemoryError,
)


class DamagedError(ValueError):
    """Bytes that are not what they should be, and why."""


class Message(NamedTuple):
    """A message record.

    Parameters
    ----------
    place
        Where it begins among the records that it was read from [bytes].
    channel
        Number of its channel.
    sequence
        Count by its publisher, or 0.
    log_time_ns
        When it was recorded [ns].
    publish_time_ns
        When it was published [ns].
    data
        Its bytes.
    """

    place: int
    channel: int
    sequence: int
    log_time_ns: int
    publish_time_ns: int
    data: bytes


@dataclass(frozen=True)
class Chunk:
    """A chunk as it stands in the file.

    Parameters
    ----------
    start_ns, end_ns
        Log times of its first and last message.
    size
        Bytes of its records, once they are decompressed.
    crc
        Of the decompressed records; 0 for none.
    compression
        "zstd", "lz4" or "".
    records
        Compressed.
    length
        Of the chunk's content, as its own sizes say.
    """

    start_ns: int
    end_ns: int
    size: int
    crc: int
    compression: str
    records: memoryview
    length: int

    def unpack(self) -> bytes:
        """Its records, with their size and CRC (where it has one) checked.

        Raises
        ------
        DamagedError
        """
        if self.size > LARGEST_CHUNK:
            raise DamagedError(
                f"the chunk says that it holds {self.size} bytes, more than the {LARGEST_CHUNK}"
                " that are unpacked"
            )
        try:
            raw = _DECOMPRESS[self.compression](self.records, self.size)
        except KeyError:
            raise DamagedError(
                f"the chunk has the unknown compression '{self.compression}'"
            ) from None
        except (zstandard.ZstdError, RuntimeError, EOFError) as error:
            raise DamagedError(f"the chunk cannot be decompressed ({error})") from error
        if self.crc and crc32(raw) != self.crc:
            raise DamagedError("the chunk's CRC does not fit its content")
        # With a CRC that fits, it is the size that is wrong.
        if len(raw) != self.size and not self.crc:
            raise DamagedError(f"the chunk holds {len(raw)} bytes instead of {self.size}")
        return raw

    @property
    def most_records(self) -> int:
        """Most records that a chunk of this size may have; more were made to be slow."""
        return USUAL_RECORDS + len(self.records)

    def messages_in(self, raw: bytes) -> Iterator[Message]:
        """The messages among its records.

        Parameters
        ----------
        raw
            These, unpacked.

        Raises
        ------
        DamagedError
        """
        return messages_of(raw, most=self.most_records)

    def messages_of_part(self) -> Iterator[Message]:
        """As many of its messages as a chunk gives that was cut off."""
        raw = bytes(self.records) if not self.compression else b""
        if self.compression in _PARTLY:
            limit = min(self.size, LARGEST_CHUNK)
            raw = _whole_blocks(_PARTLY[self.compression](), self.records, limit)
        return messages_of(raw, cut_off=True, most=self.most_records)


@dataclass(frozen=True)
class Summary:
    """The summary of a file.

    Parameters
    ----------
    start
        Its place in the file.
    has_crc
        Whether a CRC vouches for it.
    schemas, channels
        By number.
    chunks, attachments, metadata
        Where they are.
    statistics
        None if it has none.
    """

    start: int
    has_crc: bool = False
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)
    statistics: Statistics | None = None


@contextmanager
def mapped(path: Path) -> Iterator[memoryview]:
    """The bytes of a file of any size, read as they are needed."""
    if path.stat().st_size == 0:
        yield memoryview(b"")
        return
    with open_file(path) as stream:
        content = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    view = memoryview(content)
    try:
        yield view
    finally:
        view.release()
        with suppress(BufferError):  # an exception on its way out may still hold a part of it
            content.close()


def give_back(data: memoryview, held: int, place: int) -> int:
    """Free the memory of a file's bytes once many were read.

    Parameters
    ----------
    data
        The bytes of `mapped`; what is freed is read again where it is needed again.
    held
        The same, as it was returned the last time.
    place
        Up to which bytes were read.

    Returns
    -------
    int
        Where those begin that are still held.
    """
    if place - held < READ_AT_ONCE:
        return held
    if isinstance(data.obj, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
        data.obj.madvise(mmap.MADV_DONTNEED)
    return place


def crc_of(data: memoryview, end: int) -> int:
    """CRC of a file's bytes before an end, of which few are in memory at a time."""
    crc = held = 0
    for begin in range(0, end, READ_AT_ONCE):
        stop = min(begin + READ_AT_ONCE, end)
        crc, held = crc32(data[begin:stop], crc), give_back(data, held, stop)
    return crc


def parse(opcode: int, content: bytes | memoryview, check_crc: bool = True) -> Any:
    """A record with an opcode of `PARSED`, as `mcap` reads it (McapRecord).

    Parameters
    ----------
    check_crc
        Of an attachment, the only one of them that has one.

    Raises
    ------
    DamagedError
        Unless all of its fields make sense.
    """
    return parse_with_length(opcode, content, check_crc)[0]


def parse_with_length(
    opcode: int, content: bytes | memoryview, check_crc: bool = True
) -> tuple[McapRecord, int]:
    """The same, and how many bytes of the content its fields take; what follows them belongs to
    fields that are not known here.
    """
    data = bytes(content)
    try:
        record = next(
            StreamReader(BytesIO(RECORD.pack(opcode, len(data)) + data), skip_magic=True).records
        )
        again = packed(record)[RECORD.size :]
    except _UNREADABLE as error:
        raise DamagedError(
            f"the {Opcode(opcode).name} record is damaged ({error or type(error).__name__})"
        ) from error
    known = data[: len(again)]
    if isinstance(record, Attachment) and again[:-4] == known[:-4]:
        if check_crc and known[-4:] not in (again[-4:], b"\0\0\0\0"):
            raise DamagedError(f"the CRC of attachment '{record.name}' does not fit its content")
    elif again != known:
        raise DamagedError(
            f"the {Opcode(opcode).name} record has a length that does not fit its content"
        )
    return record, len(again)


def packed(record: McapRecord) -> bytes:
    """A record as it stands in a file, with its opcode and length."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def parse_chunk(content: memoryview, cut_off: bool = False) -> Chunk:
    """A chunk.

    Parameters
    ----------
    cut_off
        The end of its records may be missing.

    Raises
    ------
    DamagedError
        If its parts are longer than it.
    """
    try:
        start, end, size, crc, name_length = _CHUNK_HEAD.unpack_from(content)
        name = bytes(content[32 : 32 + name_length])
        (compressed,) = struct.unpack_from("<Q", content, 32 + name_length)
    except struct.error as error:
        raise DamagedError("the chunk is too short") from error
    begin = 40 + name_length
    if name not in (b"", b"zstd", b"lz4") or (begin + compressed > len(content) and not cut_off):
        raise DamagedError("the chunk's sizes do not agree with each other")
    return Chunk(
        start,
        end,
        size,
        crc,
        name.decode(),
        content[begin : begin + compressed],
        begin + compressed,
    )


def message_index(content: memoryview) -> tuple[int, memoryview]:
    """Channel, and the bytes of log time and place in the chunk of its messages, 8 each.

    Raises
    ------
    DamagedError
    """
    if len(content) < 6:
        raise DamagedError("the MESSAGE_INDEX record is too short")
    channel, n_bytes = struct.unpack_from("<HI", content)
    if n_bytes > len(content) - 6 or n_bytes % 16:
        raise DamagedError("the MESSAGE_INDEX record has a length that does not fit its content")
    return channel, content[6 : 6 + n_bytes]


def records_of(
    raw: bytes | memoryview, cut_off: bool = False, most: int | None = None
) -> Iterator[tuple[int, int, int]]:
    """Opcode, begin and end of the content of each record in a chunk.

    Parameters
    ----------
    cut_off
        Stop there instead.
    most
        DamagedError for more records.

    Raises
    ------
    DamagedError
        Where one reaches beyond it.
    """
    place, size, left = 0, len(raw), len(raw) if most is None else most
    while place < size:
        left -= 1
        if left < 0:
            raise DamagedError(
                f"the chunk has more than {most} records, which is more than its compressed bytes"
                " can tell apart"
            )
        opcode, length = (
            RECORD.unpack_from(raw, place) if place + RECORD.size <= size else (0, size)
        )
        begin, place = place + RECORD.size, place + RECORD.size + length
        if (
            place > size
            or opcode == 0
            or (opcode == Opcode.MESSAGE and length < _MESSAGE_HEAD.size)
        ):
            if cut_off:
                return
            raise DamagedError("a record in the chunk reaches beyond it")
        yield opcode, begin, place


def messages_of(raw: bytes, cut_off: bool = False, most: int | None = None) -> Iterator[Message]:
    """The messages among the records of a chunk.

    Parameters
    ----------
    raw, cut_off, most
        As for that.

    Raises
    ------
    DamagedError
        As from `records_of`.
    """
    for opcode, begin, end in records_of(raw, cut_off, most):
        if opcode == Opcode.MESSAGE:
            channel, sequence, log_time, publish_time = _MESSAGE_HEAD.unpack_from(raw, begin)
            yield Message(
                begin - RECORD.size,
                channel,
                sequence,
                log_time,
                publish_time,
                raw[begin + _MESSAGE_HEAD.size : end],
            )


def parse_header(data: bytes | memoryview) -> tuple[Header, int]:
    """The first record of a file, and where it ends.

    Parameters
    ----------
    data
        The first bytes of the file.

    Raises
    ------
    DamagedError
    """
    if bytes(data[:8]) != MAGIC:
        raise DamagedError(
            "the file magic is invalid: this is no MCAP file, or its first bytes are damaged"
        )
    if len(data) < 17 or data[8] != Opcode.HEADER:
        raise DamagedError("the file has no header")
    end = 17 + struct.unpack_from("<Q", data, 9)[0]
    if end > len(data):
        raise DamagedError("the file ends within its header")
    return parse(Opcode.HEADER, data[17:end]), end


def read_summary(data: memoryview, with_crc: bool = False) -> Summary | None:
    """The summary of a file's bytes, None if it has none.

    Parameters
    ----------
    with_crc
        Take one without a CRC for none.

    Raises
    ------
    DamagedError
    """
    if len(data) < FOOTER_LENGTH or bytes(data[-8:]) != MAGIC:
        raise DamagedError("the file has no end")
    end = len(data) - FOOTER_LENGTH
    if RECORD.unpack_from(data, end) != (Opcode.FOOTER, 20):
        raise DamagedError("the footer is damaged")
    footer = parse(Opcode.FOOTER, data[-28:-8])
    start, crc = footer.summary_start, footer.summary_crc
    if start and not 8 < start <= end:
        raise DamagedError("the footer points to no summary")
    if not start or (with_crc and not crc):
        return None
    if crc and crc_of(data[start : end + 25], end + 25 - start) != crc:
        raise DamagedError("the summary's CRC does not fit its content")
    found: dict[type, list[Any]] = defaultdict(list)
    try:
        for record in StreamReader(BytesIO(data[start:]), skip_magic=True).records:
            found[type(record)].append(record)
    except _UNREADABLE as error:
        raise DamagedError(f"the summary is damaged ({error or type(error).__name__})") from error
    return Summary(
        start,
        bool(crc),
        {schema.id: schema for schema in found[Schema]},
        {channel.id: channel for channel in found[Channel]},
        found[ChunkIndex],
        found[AttachmentIndex],
        found[MetadataIndex],
        next(iter(found[Statistics][-1:]), None),
    )


def defines_all(summary: Summary) -> bool:
    """Whether a summary has all schemas and channels of its file: those that chunks, channels and
    statistics name.

    Without statistics only message indexes tell which channels there are.

    Parameters
    ----------
    summary
        Of the file.
    """
    schemas, known, told = summary.schemas.keys(), summary.channels.keys(), summary.statistics
    if any(
        channel.schema_id and channel.schema_id not in schemas
        for channel in summary.channels.values()
    ):
        return False
    if any(
        not known >= chunk.message_index_offsets.keys()
        or (told is None and not chunk.message_index_offsets)
        for chunk in summary.chunks
    ):
        return False
    if told is None:
        return len(summary.chunks) > 0
    # rosbag2's writer counts only the channels that have messages
    return (
        told.schema_count <= len(schemas)
        and told.channel_count <= len(known)
        and known >= told.channel_message_counts.keys()
    )


def data_end_before(data: memoryview, place: int) -> int | None:
    """Where the DATA_END record begins that ends at a place; None if none does.

    Parameters
    ----------
    data
        The bytes of the file.
    """
    for begin in range(place - 13, max(len(MAGIC), place - 13 - MOST_UNKNOWN) - 1, -1):
        if RECORD.unpack_from(data, begin) == (Opcode.DATA_END, place - begin - RECORD.size):
            return begin
    return None


def _whole_blocks(decompressor: Any, data: memoryview, limit: int) -> bytes:
    """What a decompressor gives before the end or the damage of its input, or before it has given
    more than the limit [bytes].
    """
    parts, size = [], 0
    try:
        for begin in range(0, len(data), PIECE):
            parts.append(decompressor.decompress(bytes(data[begin : begin + PIECE])))
            size += len(parts[-1])
            if size > limit:
                break
    except (zstandard.ZstdError, RuntimeError, EOFError):
        pass
    return b"".join(parts)


def _zstd(records: memoryview, size: int) -> bytes:
    if zstandard.frame_content_size(records) > LARGEST_CHUNK:
        raise zstandard.ZstdError(f"it says that it holds more than {LARGEST_CHUNK} bytes")
    return zstandard.ZstdDecompressor().decompress(records, max_output_size=size)


def _lz4(records: memoryview, size: int) -> bytes:
    # the chunk's size may be what is damaged: then its CRC tells
    for limit in (size, LARGEST_CHUNK):
        decompressor = lz4.frame.LZ4FrameDecompressor()
        raw: bytes = decompressor.decompress(bytes(records), max_length=limit + 1)
        if decompressor.eof:
            return raw
        if len(raw) <= limit:
            raise EOFError("its end is missing")
    raise EOFError(f"it holds more than {LARGEST_CHUNK} bytes")


_DECOMPRESS = {"": lambda records, _size: bytes(records), "zstd": _zstd, "lz4": _lz4}
"""What unpacks a chunk of a size."""
_PARTLY: dict[str, Callable] = {
    "zstd": lambda: zstandard.ZstdDecompressor().decompressobj(),
    "lz4": lz4.frame.LZ4FrameDecompressor,
}
"""What unpacks the pieces of a chunk."""
