"""The check of one MCAP file: every byte, every index, every message."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Header, Schema, Statistics
from rosbags.typesys.store import Typestore

from dart_skill.recording.bags.columns import Pattern, pattern_of
from dart_skill.recording.bags.messages import deserialize
from dart_skill.recording.bags.reader import embedded_types
from dart_skill.recording.mcap import (
    Chunk,
    ChunkPlace,
    ChunkTable,
    Damage,
    DamagedError,
    Message,
    Record,
    Summary,
    crc_of,
    mapped,
    messages_of,
    read_definitions,
    read_summary,
    walk,
)

RECOVER = "make a new bag of what is in it: dart-skill bag recover"
REWRITE = "write its index anew: dart-skill bag recover"
SEVERITIES = ("error", "warning", "note")
_TOLD = "message_start_time", "message_end_time", "chunk_length", "compression", "compressed_size", "uncompressed_size"
"""What the index of a chunk in the summary is compared in."""
NO_MESSAGES = "the file holds no messages"


@dataclass(frozen=True)
class Finding:
    """Something about a bag.

    * severity: "error" (something is lost or unreadable), "warning" (look at it) or "note".
    * place: file, topic or byte.
    * remedy: what to do about it; empty if nothing needs to be done.
    * message: what it is.
    """

    severity: str
    place: str
    message: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.severity}: {self.place}: {self.message}" + (f" ({self.remedy})" if self.remedy else "")


@dataclass
class _Topic:
    """What is learned about a channel while its messages pass."""

    name: str
    type_name: str
    is_decodable: bool
    last_sequence: int | None = None
    gaps: int = 0
    missing: int = 0
    undecodable: int = 0
    first_reason: str = ""
    pattern: Pattern | None = None
    has_pattern: bool = True  # until it turns out that it has none


class FileCheck:
    """The check of a file.

    path: of the file.
    types: definitions for topics whose file holds none.

    What it found:
    findings: in the order in which they were found.
    counts: messages by topic.
    topic_types: type by topic.
    start_ns, end_ns: log times of the first and last message; None without messages.
    """

    def __init__(self, path: Path, types: Typestore | None = None):
        self.path = path
        self.findings: list[Finding] = []
        self.counts: Counter[str] = Counter()
        self.topic_types: dict[str, str] = {}
        self.start_ns: int | None = None
        self.end_ns: int | None = None
        self._summary: Summary | None = None
        self._topics: dict[int, _Topic] = {}  # by channel
        self._chunks = ChunkTable()  # what an index must say of each
        self._contained: dict[int, list] = {}  # of the current chunk, by its content
        self._indexed: dict[int, list] = {}  # of the current chunk, by its message indexes
        self._n_records: Counter[int] = Counter()  # by opcode
        self._n_messages: Counter[int] = Counter()  # by channel
        self._n_without_crc = self._n_not_indexed = 0  # chunks
        self._last_ns: int | None = None
        self._n_jumps, self._first_jump_ns, self._largest_jump_ns = 0, 0, 0  # of log time
        if path.stat().st_size == 0:
            self._add("error", "the file is empty (0 bytes): its recorder stopped before the first write", "delete it")
            return
        with mapped(path) as data:
            self._check_bytes(data, types)
        self._topic_findings()
        self._time_findings()
        self._summary_findings()
        self._summary, self._chunks = None, ChunkTable()  # of a long bag all files' checks are kept, but what they found is small
        del self._types

    def _add(self, severity: str, message: str, remedy: str = "", where: str = "") -> None:
        self.findings.append(Finding(severity, self.path.name + (f", {where}" if where else ""), message, remedy))

    def _check_bytes(self, data: memoryview, types: Typestore | None) -> None:
        try:
            self._summary = read_summary(data)
            if self._summary is None:
                self._add("warning", "there is no summary: readers must read all of the file to know what is in it", REWRITE)
            elif not self._summary.has_crc:
                self._add("note", "the summary has no CRC")
        except DamagedError as error:
            self._add("error", str(error), RECOVER)
        schemas, channels = read_definitions(data, self._summary)  # all of them, before the first message needs them
        texts = [(schema.name, schema.encoding, schema.data.decode(errors="replace")) for schema in schemas.values()]
        self._types, unknown = embedded_types(texts, types)
        for number, channel in channels.items():
            self._topics[number] = self._topic(channel, schemas.get(channel.schema_id), unknown)
        for found in walk(data, self._summary):
            self._visit(found, data)
        self._end_of_chunk()

    def _topic(self, channel: Channel, schema: Schema | None, unknown: dict[str, str]) -> _Topic:
        where, type_name = f"topic {channel.topic}", schema.name if schema else ""
        self.topic_types[channel.topic] = type_name
        is_cdr, is_known = channel.message_encoding == "cdr", type_name in self._types.fielddefs
        if not is_cdr:
            self._add("error", f"its messages are encoded as '{channel.message_encoding}', not as cdr", "read them raw", where)
        elif schema is None:
            self._add("error", "it has no type: the schema is missing", "", where)
        elif not is_known:
            reason = unknown.get(type_name, "which the bag does not define")
            self._add("error", f"it has type {type_name}, {reason}", "give the folder of its .msg files", where)
        return _Topic(channel.topic, type_name, is_cdr and is_known)

    def _visit(self, found: Record | Damage, data: memoryview) -> None:
        if isinstance(found, Damage):
            self._end_of_chunk()
            self._add("error", f"{found.reason} ({found.end - found.offset} bytes)", RECOVER, f"byte {found.offset}")
            return
        if found.repaired:
            self._add("error", f"{found.repaired}: readers lose the chunk that stands there", RECOVER, f"byte {found.offset}")
        if found.opcode == Opcode.MESSAGE_INDEX:
            channel, entries = found.message_index()
            self._indexed[channel] = entries
            return
        self._end_of_chunk()
        self._n_records[found.opcode] += 1
        if found.opcode == Opcode.CHUNK:
            self._chunk(found)
        elif found.opcode == Opcode.MESSAGE:
            for message in found.messages():
                self._count(message)
                self._decode(message.channel, [message])
        elif found.opcode == Opcode.ATTACHMENT:
            self._attachment(found)
        elif found.opcode == Opcode.HEADER:
            self._header(found)
        elif found.opcode == Opcode.DATA_END:
            last = found.parsed()
            assert isinstance(last, DataEnd)
            crc = last.data_section_crc
            if crc and crc != crc_of(data, found.offset):
                self._add("error", "the CRC of all before the summary does not fit: something in there has changed", RECOVER)

    def _header(self, found: Record) -> None:
        header = found.parsed()
        assert isinstance(header, Header)
        profile = header.profile
        if profile != "ros2":
            self._add("warning", f"its profile is '{profile}', not 'ros2': other tools may not take it for a ROS 2 bag", REWRITE)

    def _attachment(self, found: Record) -> None:
        try:
            found.parsed()
        except DamagedError as error:
            self._add("error", str(error), RECOVER, f"byte {found.offset}")

    def _chunk(self, found: Record) -> None:
        chunk, where = found.chunk(), f"chunk at byte {found.offset}"
        self._contained = defaultdict(list)
        try:
            raw = chunk.unpack()
            found_of = defaultdict(list)
            for message in messages_of(raw, most=chunk.most_records):
                self._count(message)
                found_of[message.channel].append(message)
            for channel, messages in found_of.items():
                self._contained[channel] = [(message.log_time_ns, message.place) for message in messages]
                self._decode(channel, messages)
        except DamagedError as error:
            self._contained = {}
            self._add("error", str(error), RECOVER, where)
            return
        stamps = [stamp for entries in self._contained.values() for stamp, _ in entries]
        if stamps and (min(stamps), max(stamps)) != (chunk.start_ns, chunk.end_ns):
            self._add("error", "its first and last time are not those of its messages: readers may miss some", REWRITE, where)
        self._n_without_crc += not chunk.crc
        self._chunks.append(_facts(chunk, found, len(raw)))
        self._place = where

    def _end_of_chunk(self) -> None:
        """Compare the message indexes behind a chunk with its messages."""
        if self._contained and self._indexed:
            indexed = {channel: sorted(entries) for channel, entries in self._indexed.items() if entries}
            if indexed != {channel: sorted(entries) for channel, entries in self._contained.items()}:
                self._add("error", "its message index does not agree with its messages: readers may miss some", REWRITE, self._place)
        elif self._contained:
            self._n_not_indexed += 1
        self._contained, self._indexed = {}, {}

    def _count(self, message: Message) -> None:
        self._n_messages[message.channel] += 1
        topic = self._topics.get(message.channel)
        if topic is None:
            return
        self.counts[topic.name] += 1
        if topic.last_sequence is not None and message.sequence > topic.last_sequence + 1:
            topic.gaps += 1
            topic.missing += message.sequence - topic.last_sequence - 1
        topic.last_sequence = message.sequence
        self._at_time(message.log_time_ns)

    def _decode(self, channel: int, messages: list[Message]) -> None:
        """Whether messages can be decoded: one by one, unless they differ from one that could in stamp and numbers alone."""
        topic = self._topics.get(channel)
        if topic is None or not topic.is_decodable:
            return
        if topic.pattern is not None and topic.pattern.table([message.data for message in messages]) is not None:
            return
        for message in messages:
            try:
                deserialize(self._types, topic.type_name, message.data)
            except ValueError as error:
                topic.undecodable += 1
                topic.first_reason = topic.first_reason or f"the first at log time {message.log_time_ns} ns: {error}"
        if topic.has_pattern and not topic.undecodable and len(messages) > 1:  # as those that come next may be like this one
            topic.pattern = pattern_of(self._types, topic.type_name, messages[-1].data)
            topic.has_pattern = topic.pattern is not None

    def _at_time(self, now_ns: int) -> None:
        if self._last_ns is None:
            self.start_ns = self.end_ns = now_ns
        elif now_ns < self._last_ns:
            self._first_jump_ns = self._first_jump_ns if self._n_jumps else self._last_ns
            self._n_jumps += 1
            self._largest_jump_ns = max(self._largest_jump_ns, self._last_ns - now_ns)
        self._last_ns = now_ns
        self.start_ns = now_ns if self.start_ns is None else min(self.start_ns, now_ns)
        self.end_ns = now_ns if self.end_ns is None else max(self.end_ns, now_ns)

    def _topic_findings(self) -> None:
        for topic in self._topics.values():
            where = f"topic {topic.name}"
            if topic.undecodable:
                message = f"{topic.undecodable} messages are no {topic.type_name}; {topic.first_reason}"
                self._add("error", message, "read them raw", where)
            if topic.gaps:
                message = f"{topic.missing} messages are missing in {topic.gaps} gaps of the sequence numbers"
                self._add("warning", message, "they were lost before or while they were recorded", where)
        if unknown := sorted(self._n_messages.keys() - self._topics.keys()):
            count = sum(self._n_messages[number] for number in unknown)
            self._add("error", f"{count} messages are of channels {unknown}, which the file does not define", RECOVER)

    def _time_findings(self) -> None:
        if not self.counts:
            self._add("warning", NO_MESSAGES)
        if self._n_jumps:
            most = f"{self._largest_jump_ns / 1e9:.6f}"
            text = f"log time jumps back {self._n_jumps} times, by up to {most} s, first at {self._first_jump_ns} ns"
            self._add("warning", text, "a clock was set, or a simulation began anew")
        if self._n_without_crc:
            self._add("note", f"{self._n_without_crc} chunks have no CRC: changed bytes in them may go unnoticed")
        if self._n_not_indexed:
            self._add("warning", f"{self._n_not_indexed} chunks have no message index: reading in order of time is slow", REWRITE)
        if loose := self._n_records[Opcode.MESSAGE]:
            self._add("note", f"{loose} messages are outside chunks: without compression, index or CRC")

    def _summary_findings(self) -> None:
        """Whether the summary agrees with what was found."""
        if self._summary is None:
            return
        found = {chunk.chunk_start_offset: number for number, chunk in enumerate(self._chunks)}
        for index in self._summary.chunks:
            number = found.pop(index.chunk_start_offset, None)
            is_so = index if number is None else self._chunks[number]
            wrong = [name for name in _TOLD if getattr(index, name) != getattr(is_so, name)]
            if number is None or wrong:
                reason = f"disagrees with it ({', '.join(wrong)})" if wrong else "names it, but it cannot be read"
                self._add("error", f"the summary {reason}", REWRITE, f"chunk at byte {index.chunk_start_offset}")
        if found and self._summary.chunks:
            self._add("error", f"{len(found)} chunks are not in the summary: readers miss their messages", REWRITE)
        if self._summary.statistics is None:
            self._add("note", "the summary has no statistics")
        else:
            self._statistics_findings(self._summary.statistics)

    def _statistics_findings(self, told: Statistics) -> None:
        counts = {number: count for number, count in told.channel_message_counts.items() if count}
        pairs = {
            "messages": (told.message_count, sum(self._n_messages.values())),
            "messages by channel": (counts, dict(self._n_messages)),
            "chunks": (told.chunk_count, self._n_records[Opcode.CHUNK]),
            "attachments": (told.attachment_count, self._n_records[Opcode.ATTACHMENT]),
            "metadata records": (told.metadata_count, self._n_records[Opcode.METADATA]),
            "channels": (told.channel_count, len(self._topics)),
        }
        if self.counts:
            pairs["first and last time"] = ((told.message_start_time, told.message_end_time), (self.start_ns, self.end_ns))
        for name, (said, is_so) in pairs.items():
            if said != is_so:
                self._add("error", f"the statistics say {said} for {name}, found are {is_so}", REWRITE)


def _facts(chunk: Chunk, found: Record, size: int) -> ChunkPlace:
    """What a ChunkIndex must say, as far as `_TOLD`. found: the chunk's record; size: of its records, once they are decompressed."""
    length, packed = found.end - found.offset, len(chunk.records)
    return ChunkPlace(chunk.start_ns, chunk.end_ns, found.offset, length, 0, packed, size, chunk.compression, frozenset())
