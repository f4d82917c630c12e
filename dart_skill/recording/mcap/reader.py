"""Reading whole MCAP files: topics from the summary, messages chunk by chunk in order of log time.

Damage is an error here (`DamagedError`); `_mcap_scan` says how it is found, and `recovery` what can be done about it.
"""

from __future__ import annotations

import heapq
import mmap
import struct
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema

from dart_skill.recording.mcap.scan import (
    FOOTER_LENGTH,
    Chunk,
    ChunkIndex,
    Damage,
    DamagedError,
    Summary,
    mapped,
    parse,
    parse_chunk,
    parse_footer,
    parse_header,
    parse_summary,
    records_of,
    walk,
)

_FIELDS = struct.Struct("<BQH4xQ")  # of a message record: opcode, length, channel, log time
_HEAD = struct.Struct("<BQ")
_STAMP = itemgetter(2)
END_OF_TIME = 2**64


class BagMessage(NamedTuple):
    """A message. stamp_ns: log time; data: CDR bytes or, decoded, an object with the message's fields."""

    topic: str
    type_name: str
    stamp_ns: int
    data: Any


class McapInput:
    """A whole MCAP file, open for reading.

    counts: messages by channel number. Raises DamagedError for what is no whole file.
    """

    def __init__(self, path: Path):
        self.path = path
        self._stream = open(path, "rb")
        try:
            size = self._stream.seek(0, 2)
            self.header, self._data_start = self._read_header()
            footer = parse_footer(self._at(max(0, size - FOOTER_LENGTH), FOOTER_LENGTH), size)
            summary = parse_summary(memoryview(self._at(footer.summary_start, size)), footer) if footer.summary_start else None
            self._loose = False  # messages outside chunks
            self._take(summary) if summary is not None and _is_complete(summary) else self._scan()
        except BaseException:
            self._stream.close()
            raise

    @property
    def is_open(self) -> bool:
        """Whether it can be read."""
        return not self._stream.closed

    @property
    def compression(self) -> str:
        """Of the chunks; several are separated by commas."""
        return ", ".join(sorted({chunk.compression for chunk in self._chunks} - {""}))

    def type_name(self, channel: Channel) -> str:
        """Message type of a channel; empty if the file does not tell it."""
        schema = self.schemas.get(channel.schema_id)
        return schema.name if schema is not None else ""

    def metadata(self) -> list[Metadata]:
        """Metadata records, in the order in which they were written."""
        return [parse(Opcode.METADATA, self._record(place)) for place in self._metadata_places]

    def attachments(self) -> list:
        """Attachments (`mcap.records.Attachment`)."""
        return [parse(Opcode.ATTACHMENT, self._record(place)) for place in self._attachment_places]

    def parts(self, wanted: dict[int, tuple[str, str]], start_ns: int, stop_ns: int) -> list[tuple[int, int, Callable]]:
        """First and last log time of each part of the file that may hold messages of these channels and times, and what reads it.

        wanted: topic and type by channel number. A part is a list of BagMessage in order of log time.
        """
        if self._loose:
            return [(self.start_ns, self.end_ns, lambda: self._loose_messages(wanted, start_ns, stop_ns))]
        return [
            (chunk.start_ns, chunk.end_ns, lambda chunk=chunk: self._chunk_messages(chunk, wanted, start_ns, stop_ns))
            for chunk in self._chunks
            if start_ns <= chunk.end_ns and chunk.start_ns < stop_ns and not wanted.keys().isdisjoint(chunk.message_indexes)
        ]

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def _at(self, place: int, length: int) -> bytes:
        self._stream.seek(place)
        return self._stream.read(length)

    def _record(self, place: int) -> bytes:
        """Content of the record at a place."""
        _opcode, length = _HEAD.unpack(self._at(place, 9))
        return self._at(place + 9, length)

    def _read_header(self):
        head = self._at(0, 17)
        length = struct.unpack_from("<Q", head, 9)[0] if len(head) == 17 else 0
        return parse_header(self._at(0, 17 + min(length, 2**20)))

    def _take(self, summary: Summary) -> None:
        statistics = summary.statistics
        self.schemas: dict[int, Schema] = summary.schemas
        self.channels: dict[int, Channel] = summary.channels
        self.counts = Counter(statistics.channel_message_counts)
        self.message_count = statistics.message_count
        self.start_ns, self.end_ns = statistics.message_start_time, statistics.message_end_time
        self._chunks = summary.chunks
        self._metadata_places = [index.offset for index in summary.metadata]
        self._attachment_places = [index.offset for index in summary.attachments]

    def _scan(self) -> None:
        """What the summary would say, from the whole file."""
        self.schemas, self.channels, self.counts = {}, {}, Counter()
        self._chunks, self._metadata_places, self._attachment_places, stamps = [], [], [], []
        with mapped(self.path) as data:
            for found in walk(data):
                if isinstance(found, Damage):
                    raise DamagedError(f"{found.reason} (at byte {found.offset})")
                if found.opcode == Opcode.CHUNK:
                    chunk = parse_chunk(found.content)
                    counts, its_stamps = self._survey(chunk.unpack())
                    if counts:
                        stamps += its_stamps
                        self._chunks.append(_index(found, chunk, its_stamps, counts))
                elif found.opcode == Opcode.MESSAGE:
                    self._loose = True
                    stamps.append(self._count(found.content))
                elif found.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._define(parse(found.opcode, found.content))
                elif found.opcode == Opcode.METADATA:
                    self._metadata_places.append(found.offset)
                elif found.opcode == Opcode.ATTACHMENT:
                    self._attachment_places.append(found.offset)
                found = None  # holds the file's bytes
        self.message_count = self.counts.total() if hasattr(self.counts, "total") else sum(self.counts.values())
        self.start_ns, self.end_ns = min(stamps, default=0), max(stamps, default=0)

    def _define(self, record: Schema | Channel) -> None:
        kept = self.schemas if isinstance(record, Schema) else self.channels
        kept[record.id] = record

    def _count(self, content: memoryview) -> int:
        """Count a message; returns its log time."""
        channel, stamp = struct.unpack_from("<H4xQ", content)
        self.counts[channel] += 1
        return stamp

    def _survey(self, raw: bytes) -> tuple[set[int], list[int]]:
        """Channels and log times of a chunk's messages, which are counted."""
        channels, stamps, view = set(), [], memoryview(raw)
        for opcode, begin, end in records_of(raw):
            if opcode == Opcode.MESSAGE:
                stamps.append(self._count(view[begin:end]))
                channels.add(struct.unpack_from("<H", raw, begin)[0])
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._define(parse(opcode, view[begin:end]))
        return channels, stamps

    def _chunk_messages(self, index: ChunkIndex, wanted: dict, start_ns: int, stop_ns: int) -> list[BagMessage]:
        try:
            record = self._at(index.offset, index.length)
            if len(record) < 9 or _HEAD.unpack_from(record) != (Opcode.CHUNK, len(record) - 9):
                raise DamagedError("no chunk begins there")
            raw = parse_chunk(memoryview(record)[9:]).unpack()
            return messages_in(raw, 0, len(raw), wanted, start_ns, stop_ns)
        except (DamagedError, struct.error) as error:
            raise DamagedError(f"the chunk at byte {index.offset} of {self.path.name} is damaged: {error}") from error

    def _loose_messages(self, wanted: dict, start_ns: int, stop_ns: int) -> list[BagMessage]:
        """All of a file with messages outside chunks: nothing tells where their times are, so it is read into memory."""
        found: list[BagMessage] = []
        with mmap.mmap(self._stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
            size = len(content) - FOOTER_LENGTH
            found += messages_in(content, self._data_start, size, wanted, start_ns, stop_ns)
        for chunk in self._chunks:
            found += self._chunk_messages(chunk, wanted, start_ns, stop_ns)
        return sorted(found, key=_STAMP)


def messages_in(raw, place: int, end: int, wanted: dict[int, tuple[str, str]], start_ns: int, stop_ns: int) -> list[BagMessage]:
    """Messages among the records from a place to an end, in order of log time; wanted: topic and type by channel number."""
    found, in_order, last, fields = [], True, 0, _FIELDS.unpack_from
    append, new, info = found.append, tuple.__new__, wanted.get
    while place < end - 30:
        opcode, length, channel, stamp = fields(raw, place)
        begin, place = place + 31, place + 9 + length
        if opcode != 5:
            continue
        if place > end or length < 22:
            raise DamagedError("a message reaches beyond its end")
        its = info(channel)
        if its is not None and start_ns <= stamp < stop_ns:
            in_order = in_order and stamp >= last
            last = stamp
            append(new(BagMessage, (*its, stamp, raw[begin:place])))
    if not in_order:
        found.sort(key=_STAMP)
    return found


def in_time_order(parts: Iterable[tuple[int, int, Callable]]) -> Iterator[BagMessage]:
    """Messages of all parts (`McapInput.parts`) in order of log time; parts that overlap in time are merged."""
    group: list[tuple[int, int, Callable]] = []
    until = 0
    for part in sorted(parts, key=itemgetter(0)):
        if group and part[0] >= until:
            yield from _merged(group)
            group = []
        group.append(part)
        until = max(until, part[1])
    yield from _merged(group)


def _merged(group: list[tuple[int, int, Callable]]) -> Iterator[BagMessage]:
    if len(group) == 1:
        yield from group[0][2]()
        return
    for message in heapq.merge(*map(_when_due, group), key=_STAMP):
        if message[0] is not None:
            yield message


def _when_due(part: tuple[int, int, Callable]) -> Iterator:
    """A part's messages, read when the merge has come to its first log time."""
    yield (None, None, part[0])
    yield from part[2]()


def _is_complete(summary: Summary) -> bool:
    """Whether the summary tells where all messages are: each is in a chunk that has indexes."""
    statistics = summary.statistics
    if statistics is None or statistics.schema_count != len(summary.schemas) or statistics.channel_count != len(summary.channels):
        return False
    indexed = sum(chunk.message_index_length - 15 * len(chunk.message_indexes) for chunk in summary.chunks) // 16
    lists = statistics.metadata_count == len(summary.metadata) and statistics.attachment_count == len(summary.attachments)
    return lists and indexed == statistics.message_count


def _index(found, chunk: Chunk, stamps: list[int], channels: set[int]) -> ChunkIndex:
    offsets = dict.fromkeys(channels, 0)
    place = (found.offset, found.end - found.offset)
    return ChunkIndex(min(stamps), max(stamps), *place, offsets, 0, chunk.compression, len(chunk.records), chunk.size)
