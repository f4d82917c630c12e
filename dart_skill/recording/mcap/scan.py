"""Reading MCAP bytes that may be damaged: records, chunks, the summary, and a walk over a file that finds its way again.

A record is taken only if its content agrees with its length to the byte. Where none begins, the walk tries what stands there as a
chunk (whose CRC then vouches for it), goes on at the next place that the summary knows, or searches the next record.
"""

from __future__ import annotations

import mmap
import re
import struct
from bisect import bisect_right
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from zlib import crc32

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from dart_skill.recording.mcap.writer import MAGIC

FOOTER_LENGTH = 9 + 20 + len(MAGIC)
_HEAD, _CHUNK_HEAD, _CHUNK_INDEX = struct.Struct("<BQ"), struct.Struct("<QQQII"), struct.Struct("<QQQQI")
_CLASSES = {
    Opcode.HEADER: Header,
    Opcode.FOOTER: Footer,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.ATTACHMENT: Attachment,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
    Opcode.METADATA: Metadata,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.STATISTICS: Statistics,
    Opcode.DATA_END: DataEnd,
    Opcode.SUMMARY_OFFSET: SummaryOffset,
}
_ANY_RECORD = re.compile(rb"(?=[\x01-\x0f].{5}\x00\x00\x00)", re.DOTALL)
_LARGEST_CHUNK = 2**30


class DamagedError(ValueError):
    """Bytes that are not what they should be, and why."""


@dataclass(frozen=True)
class Chunk:
    """A chunk as it stands in the file; records: compressed."""

    start_ns: int
    end_ns: int
    size: int
    crc: int
    compression: str
    records: memoryview

    def unpack(self) -> bytes:
        """Its records, with their size and CRC (where it has one) checked; DamagedError."""
        if self.size > _LARGEST_CHUNK:
            raise DamagedError(f"the chunk says that it holds {self.size} bytes")
        try:
            raw = _DECOMPRESS[self.compression](self.records, self.size)
        except KeyError:
            raise DamagedError(f"the chunk has the unknown compression '{self.compression}'") from None
        except (zstandard.ZstdError, RuntimeError, EOFError) as error:
            raise DamagedError(f"the chunk cannot be decompressed ({error})") from error
        if self.crc and crc32(raw) != self.crc:
            raise DamagedError("the chunk's CRC does not fit its content")
        # With a CRC that fits, it is the size that is wrong.
        if len(raw) != self.size and not self.crc:
            raise DamagedError(f"the chunk holds {len(raw)} bytes instead of {self.size}")
        return raw

    def unpack_part(self) -> bytes:
        """As many of its records as a chunk gives that was cut off."""
        if self.compression == "zstd":
            return _whole_blocks(zstandard.ZstdDecompressor().decompressobj(), self.records)
        if self.compression == "lz4":
            return _whole_blocks(lz4.frame.LZ4FrameDecompressor(), self.records)
        return bytes(self.records) if not self.compression else b""


@dataclass(frozen=True)
class ChunkIndex:
    """What the summary says of a chunk; message_indexes: place of the index of each channel's messages."""

    start_ns: int
    end_ns: int
    offset: int
    length: int
    message_indexes: dict[int, int]
    message_index_length: int
    compression: str
    compressed_size: int
    size: int


@dataclass
class Summary:
    """The summary of a file; start: its place."""

    start: int
    has_crc: bool = False
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)
    statistics: Statistics | None = None


@dataclass(frozen=True)
class Record:
    """A record that was found; repaired: what was wrong about it and could be made good."""

    offset: int
    end: int
    opcode: int
    content: memoryview
    repaired: str = ""


@dataclass(frozen=True)
class Damage:
    """A place of a file that is not what it should be. rest: a chunk that was cut off there."""

    offset: int
    end: int
    reason: str
    rest: Chunk | None = None


@contextmanager
def mapped(path: Path) -> Iterator[memoryview]:
    """The bytes of a file, read as they are needed."""
    if path.stat().st_size == 0:
        yield memoryview(b"")
        return
    with open(path, "rb") as stream:
        content = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    view = memoryview(content)
    try:
        yield view
    finally:
        view.release()
        with suppress(BufferError):  # an exception on its way out may still hold a part of it
            content.close()


def parse(opcode: int, content: bytes | memoryview) -> McapRecord:
    """A record of any kind but chunks, messages and their indexes; DamagedError unless all of its bytes make sense."""
    kind, data = _CLASSES[Opcode(opcode)], bytes(content)
    try:
        record = kind.read(ReadDataStream(BytesIO(data)))
        builder = RecordBuilder()
        record.write(builder)
        again = builder.end()[9:]
    except (ValueError, struct.error, McapError, OverflowError, MemoryError) as error:
        raise DamagedError(f"the {kind.__name__} record is damaged ({error or type(error).__name__})") from error
    if opcode == Opcode.ATTACHMENT and again[:-4] == data[:-4]:
        if data[-4:] not in (again[-4:], b"\0\0\0\0"):
            raise DamagedError(f"the CRC of attachment '{record.name}' does not fit its content")
    elif again != data:
        raise DamagedError(f"the {kind.__name__} record has a length that does not fit its content")
    return record


def parse_chunk(content: memoryview, cut_off: bool = False) -> Chunk:
    """A chunk; DamagedError unless its parts fill it exactly. cut_off: the end of its records may be missing."""
    try:
        start, end, size, crc, name_length = _CHUNK_HEAD.unpack_from(content)
        name = bytes(content[32 : 32 + name_length])
        (compressed,) = struct.unpack_from("<Q", content, 32 + name_length)
    except struct.error as error:
        raise DamagedError("the chunk is too short") from error
    begin = 40 + name_length
    if name not in (b"", b"zstd", b"lz4") or (begin + compressed != len(content) and not cut_off):
        raise DamagedError("the chunk's sizes do not agree with each other")
    return Chunk(start, end, size, crc, name.decode(), content[begin : begin + compressed])


def parse_chunk_index(content: memoryview) -> ChunkIndex:
    """What the summary says of a chunk; DamagedError."""
    try:
        start, end, offset, length, n_bytes = _CHUNK_INDEX.unpack_from(content)
        pairs = list(struct.iter_unpack("<HQ", content[36 : 36 + n_bytes]))
        index_length, name_length = struct.unpack_from("<QI", content, 36 + n_bytes)
        rest = 48 + n_bytes
        name = bytes(content[rest : rest + name_length]).decode()
        sizes = struct.unpack("<QQ", content[rest + name_length :])
    except (struct.error, UnicodeDecodeError) as error:
        raise DamagedError("the ChunkIndex record is damaged") from error
    return ChunkIndex(start, end, offset, length, dict(pairs), index_length, name, *sizes)


def parse_message_index(content: memoryview) -> tuple[int, list[tuple[int, int]]]:
    """Channel, and log time and place in the chunk of its messages; DamagedError."""
    if len(content) < 6:
        raise DamagedError("the MessageIndex record is too short")
    channel, n_bytes = struct.unpack_from("<HI", content)
    if n_bytes != len(content) - 6 or n_bytes % 16:
        raise DamagedError("the MessageIndex record has a length that does not fit its content")
    return channel, list(struct.iter_unpack("<QQ", content[6:]))


def parse_header(data: bytes | memoryview) -> tuple[Header, int]:
    """The file's first record, and where it ends; DamagedError."""
    if bytes(data[:8]) != MAGIC:
        raise DamagedError("the file magic is invalid: this is no MCAP file, or its first bytes are damaged")
    if len(data) < 17 or data[8] != Opcode.HEADER:
        raise DamagedError("the file has no header")
    end = 17 + struct.unpack_from("<Q", data, 9)[0]
    if end > len(data):
        raise DamagedError("the file ends within its header")
    return parse(Opcode.HEADER, data[17:end]), end


def parse_footer(tail: bytes | memoryview, size: int) -> Footer:
    """The footer in a file's last bytes; size: of the file. DamagedError."""
    if len(tail) < FOOTER_LENGTH or bytes(tail[-8:]) != MAGIC:
        raise DamagedError("the file has no end")
    opcode, length = _HEAD.unpack_from(tail, len(tail) - FOOTER_LENGTH)
    if (opcode, length) != (Opcode.FOOTER, 20):
        raise DamagedError("the footer is damaged")
    footer = parse(Opcode.FOOTER, tail[-28:-8])
    if footer.summary_start and not 8 < footer.summary_start <= size - FOOTER_LENGTH:
        raise DamagedError("the footer points to no summary")
    return footer


def parse_summary(content: memoryview, footer: Footer) -> Summary:
    """The summary; content: from its start to the end of the file. DamagedError."""
    end = len(content) - FOOTER_LENGTH
    if footer.summary_crc and crc32(content[: end + 25]) != footer.summary_crc:
        raise DamagedError("the summary's CRC does not fit its content")
    summary, place = Summary(footer.summary_start, bool(footer.summary_crc)), 0
    while place < end:
        if place + 9 > end:
            raise DamagedError("the summary ends within a record")
        opcode, length = _HEAD.unpack_from(content, place)
        place, begin = place + 9 + length, place + 9
        if place > end:
            raise DamagedError("a record of the summary reaches beyond it")
        _add_to(summary, opcode, content[begin:place])
    return summary


def _add_to(summary: Summary, opcode: int, content: memoryview) -> None:
    if opcode == Opcode.CHUNK_INDEX:
        summary.chunks.append(parse_chunk_index(content))
    elif opcode in _CLASSES:
        record = parse(opcode, content)
        if opcode == Opcode.SCHEMA:
            summary.schemas[record.id] = record
        elif opcode == Opcode.CHANNEL:
            summary.channels[record.id] = record
        elif opcode == Opcode.STATISTICS:
            summary.statistics = record
        elif opcode == Opcode.ATTACHMENT_INDEX:
            summary.attachments.append(record)
        elif opcode == Opcode.METADATA_INDEX:
            summary.metadata.append(record)


def read_summary(data: memoryview) -> Summary | None:
    """The summary of a file's bytes, None if it has none; DamagedError."""
    footer = parse_footer(data[-FOOTER_LENGTH:], len(data))
    return parse_summary(data[footer.summary_start :], footer) if footer.summary_start else None


def records_of(raw: bytes | memoryview, cut_off: bool = False) -> Iterator[tuple[int, int, int]]:
    """Opcode, begin and end of the content of each record in a chunk's bytes; DamagedError where one reaches beyond them.

    cut_off: stop there instead.
    """
    place, size = 0, len(raw)
    while place < size:
        opcode, length = _HEAD.unpack_from(raw, place) if place + 9 <= size else (0, size)
        begin, place = place + 9, place + 9 + length
        if place > size or (opcode == Opcode.MESSAGE and length < 22):
            if cut_off:
                return
            raise DamagedError("a record in the chunk reaches beyond it")
        yield opcode, begin, place


def walk(data: memoryview, known: list[int] = ()) -> Iterator[Record | Damage]:
    """Every record of a file's bytes after the magic, in order, and the places between them that are damaged.

    known: sorted places where records begin (the summary's). Ends after the footer.
    """
    place, size = (len(MAGIC) if bytes(data[:8]) == MAGIC else 0), len(data)
    if place == 0:
        place = _next_record(data, min(8, size), known) if size < 17 or data[8] != Opcode.HEADER else 8
        yield Damage(0, place, "the file magic is invalid")
    while place < size:
        found = _record_at(data, place)
        if isinstance(found, Damage):
            found = _chunk_at(data, place, found.reason) or _skipped(data, found, known)
        yield found
        place = found.end
        if isinstance(found, Record) and found.opcode == Opcode.FOOTER:
            if bytes(data[place:]) != MAGIC:
                yield Damage(place, size, "the file does not end with the magic")
            return
    yield Damage(size, size, "the file ends without footer")


def known_places(summary: Summary) -> list[int]:
    """Where records begin, as the summary says."""
    places = {summary.start}
    for chunk in summary.chunks:
        places |= {chunk.offset, chunk.offset + chunk.length, *chunk.message_indexes.values()}
    places |= {index.offset for index in (*summary.attachments, *summary.metadata)}
    return sorted(places)


def _record_at(data: memoryview, place: int) -> Record | Damage:
    """The record that begins at a place, or why there is none."""
    if place + 9 > len(data):
        return Damage(place, len(data), "the file ends within a record")
    opcode, length = _HEAD.unpack_from(data, place)
    end = place + 9 + length
    if opcode == 0 or 0x0F < opcode < 0x80:
        return Damage(place, end, "no record begins here")
    content = data[place + 9 : min(end, len(data))]
    if end > len(data):
        return Damage(place, len(data), "the file ends within a record", _rest(opcode, length, content))
    try:
        if opcode == Opcode.CHUNK:
            parse_chunk(content)
        elif opcode == Opcode.CHUNK_INDEX:
            parse_chunk_index(content)
        elif opcode == Opcode.MESSAGE_INDEX:
            parse_message_index(content)
        elif opcode == Opcode.MESSAGE and length < 22:
            raise DamagedError("the message is too short")
        elif opcode in _CLASSES and opcode != Opcode.ATTACHMENT:
            parse(opcode, content)
        elif opcode == Opcode.ATTACHMENT:
            _check_attachment(content)
        elif opcode >= 0x80 and _chunk_at(data, place, "") is not None:
            raise DamagedError("the chunk's opcode is damaged")
    except DamagedError as error:
        return Damage(place, end, str(error))
    return Record(place, end, opcode, content)


def _rest(opcode: int, length: int, content: memoryview) -> Chunk | None:
    """The chunk that a file's end cuts off, if that is what stands there."""
    if opcode != Opcode.CHUNK:
        return None
    try:
        chunk = parse_chunk(content, cut_off=True)
        declared = 40 + len(chunk.compression) + struct.unpack_from("<Q", content, 32 + len(chunk.compression))[0]
    except DamagedError:
        return None
    return chunk if declared == length else None


def _check_attachment(content: memoryview) -> None:
    """Sizes only: an attachment whose CRC is wrong is still a record, to be named and left out."""
    try:
        place = 16
        for _ in range(2):
            place += 4 + struct.unpack_from("<I", content, place)[0]
        place += 8 + struct.unpack_from("<Q", content, place)[0] + 4
    except struct.error as error:
        raise DamagedError("the Attachment record is damaged") from error
    if place != len(content):
        raise DamagedError("the Attachment record has a length that does not fit its content")


def _chunk_at(data: memoryview, place: int, reason: str) -> Record | None:
    """What stands at a place as a chunk, whatever its opcode and length say, if its own sizes and CRC agree."""
    content = data[place + 9 :]
    try:
        chunk = parse_chunk(content, cut_off=True)
        end = place + 9 + 40 + len(chunk.compression) + struct.unpack_from("<Q", content, 32 + len(chunk.compression))[0]
        if end > len(data) or not chunk.crc:
            return None
        chunk.unpack()
    except DamagedError:
        return None
    return Record(place, end, Opcode.CHUNK, data[place + 9 : end], repaired=reason)


def _skipped(data: memoryview, damage: Damage, known: list[int]) -> Damage:
    """The damage as far as the next record. A chunk's rest is one only where nothing comes after it."""
    end = _next_record(data, damage.offset + 1, known)
    return Damage(damage.offset, end, damage.reason, damage.rest if end == len(data) else None)


def _next_record(data: memoryview, place: int, known: list[int]) -> int:
    """Where the next record begins, at or after a place: by the summary, or by its looks; the end of the data without one."""
    size, index = len(data), bisect_right(known, place - 1)
    limit = min(known[index], size) if index < len(known) else size
    for match in _ANY_RECORD.finditer(data, place, min(size, limit + 8)):
        begin = match.start()
        if begin >= limit:
            break
        found = _record_at(data, begin)
        if isinstance(found, Record) and _goes_on(data, found):
            return begin
    return limit


def _goes_on(data: memoryview, record: Record) -> bool:
    """Whether the bytes of a record that was searched are one indeed: chunks by content, others by what follows."""
    if record.opcode == Opcode.CHUNK:
        try:
            parse_chunk(record.content).unpack()
        except DamagedError:
            return False
        return True
    if record.opcode == Opcode.FOOTER:
        return bytes(data[record.end :]) == MAGIC
    following = bytes(data[record.end : record.end + 9])
    if len(following) < 9:
        return not following
    opcode, length = _HEAD.unpack(following)
    return 0 < opcode <= 0x0F and record.end + 9 + length <= len(data)


def _whole_blocks(decompressor, data: memoryview) -> bytes:
    """What a decompressor gives before the end or the damage of its input."""
    parts = []
    try:
        for begin in range(0, len(data), 4096):
            parts.append(decompressor.decompress(bytes(data[begin : begin + 4096])))
    except (zstandard.ZstdError, RuntimeError, EOFError):
        pass
    return b"".join(parts)


def _zstd(records: memoryview, size: int) -> bytes:
    if zstandard.frame_content_size(records) > _LARGEST_CHUNK:
        raise zstandard.ZstdError("it says that it is larger than 1 GiB")
    return zstandard.ZstdDecompressor().decompress(records, max_output_size=size)


def _lz4(records: memoryview, _size: int) -> bytes:
    return lz4.frame.decompress(records)


_DECOMPRESS = {"": lambda records, _size: bytes(records), "zstd": _zstd, "lz4": _lz4}
