"""The check of one file of a bag: every byte, every index, every message."""

from __future__ import annotations

from collections import Counter, defaultdict
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import DataEnd, Header, Statistics
from rosbags.typesys.store import Typestore

from dart_skill.recording.bags._files import open_input
from dart_skill.recording.bags._finding import RECOVER, REWRITE
from dart_skill.recording.bags._message_check import LOST_BEFORE, FileFacts, MessageCheck
from dart_skill.recording.bags._sqlite import SqliteInput
from dart_skill.recording.bags._time_line import TimeLine
from dart_skill.recording.mcap import (
    Damage,
    DamagedError,
    Record,
    Summary,
    crc_of,
    mapped,
    messages_of,
    read_definitions,
    read_summary,
    walk,
)

_TOLD = (
    "message_start_time",
    "message_end_time",
    "chunk_length",
    "compression",
    "compressed_size",
    "uncompressed_size",
)
"""What the index of a chunk in the summary is compared in."""
AT_ONCE = 500
"""Messages of a topic in a SQLite file are decoded together."""
EMPTY = "the file is empty (0 bytes): its recorder stopped before the first write"


class McapCheck(MessageCheck):
    """The check of an MCAP file."""

    def __init__(
        self,
        path: Path,
        types: Typestore | None,
        line: TimeLine,
        name: str,
    ):
        super().__init__(path, types, line, name)
        self._summary: Summary | None = None
        self._chunks: dict[int, tuple] = {}  # what an index must say of each, by its place
        self._contained: dict[int, list] = {}  # of the current chunk, by its content
        self._indexed: dict[int, list] = {}  # of the current chunk, by its message indexes
        self._n_records: Counter[int] = Counter()  # by opcode
        self._n_without_crc = self._n_not_indexed = 0  # chunks
        with mapped(path) as data:
            self._check_bytes(data)
        self.topic_findings()
        self._chunk_findings()
        self._summary_findings()
        # recovery makes no bag of nothing
        if not self._topics and not self._n_records[Opcode.ATTACHMENT]:
            self.findings = [
                replace(one, remedy="") if one.remedy == REWRITE else one for one in self.findings
            ]
        self._summary, self._chunks = None, {}  # of a long bag the checks of all files are kept
        del self._types, self._own_types

    def _check_bytes(self, data: memoryview) -> None:
        try:
            self._summary = read_summary(data)
            if self._summary is None:
                self.add(
                    "warning",
                    "there is no summary: readers must read all of the file to know what is in it",
                    REWRITE,
                )
            elif not self._summary.has_crc:
                self.add("note", "the summary has no CRC")
        except DamagedError as error:
            self.add("error", str(error), RECOVER)
        # all of them, before the first message needs them
        schemas, channels = read_definitions(data, self._summary)
        self.define(schemas.values(), channels)
        for found in walk(data, self._summary):
            self._visit(found, data)
        self._end_of_chunk()

    def _visit(self, found: Record | Damage, data: memoryview) -> None:
        if isinstance(found, Damage):
            self._end_of_chunk()
            self.add(
                "error",
                f"{found.reason} ({found.end - found.offset} bytes)",
                RECOVER,
                f"byte {found.offset}",
            )
            return
        if found.repaired:
            self.add(
                "error",
                f"{found.repaired}: readers lose the chunk that stands there",
                RECOVER,
                f"byte {found.offset}",
            )
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
                self.take(message.channel, message.log_time_ns, message.sequence)
                self.decode(message.channel, [(message.log_time_ns, message.data)])
        elif found.opcode == Opcode.ATTACHMENT:
            try:
                found.parsed()
            except DamagedError as error:
                self.add("error", str(error), RECOVER, f"byte {found.offset}")
        elif found.opcode == Opcode.HEADER:
            self._header(found)
        elif found.opcode == Opcode.DATA_END:
            last = found.parsed()
            assert isinstance(last, DataEnd)
            crc = last.data_section_crc
            if crc and crc != crc_of(data, found.offset):
                self.add(
                    "error",
                    "the CRC of all before the summary does not fit: something in there has"
                    " changed",
                    RECOVER,
                )

    def _header(self, found: Record) -> None:
        header = found.parsed()
        assert isinstance(header, Header)
        profile = header.profile
        if profile != "ros2":
            self.add(
                "note",
                f"its profile is '{profile}', not 'ros2': other tools may not take it for a bag of"
                " ROS 2",
            )

    def _chunk(self, found: Record) -> None:
        chunk, where = found.chunk(), f"chunk at byte {found.offset}"
        self._contained = defaultdict(list)
        try:
            raw = chunk.unpack()
            found_of = defaultdict(list)
            for message in messages_of(raw, most=chunk.most_records):
                self.take(message.channel, message.log_time_ns, message.sequence)
                found_of[message.channel].append(message)
            for channel, messages in found_of.items():
                self._contained[channel] = [
                    (message.log_time_ns, message.place) for message in messages
                ]
                self.decode(channel, [(message.log_time_ns, message.data) for message in messages])
        except DamagedError as error:
            self._contained = {}
            self.add("error", str(error), RECOVER, where)
            return
        stamps = [stamp for entries in self._contained.values() for stamp, _ in entries]
        if stamps and (min(stamps), max(stamps)) != (chunk.start_ns, chunk.end_ns):
            self.add(
                "error",
                "its first and last time are not those of its messages: readers may miss some",
                REWRITE,
                where,
            )
        self._n_without_crc += not chunk.crc
        self._chunks[found.offset] = (
            chunk.start_ns,
            chunk.end_ns,
            found.end - found.offset,
            chunk.compression,
            len(chunk.records),
            len(raw),
        )
        self._place = where

    def _end_of_chunk(self) -> None:
        """Compare the message indexes behind a chunk with its messages."""
        if self._contained and self._indexed:
            indexed = {
                channel: sorted(entries) for channel, entries in self._indexed.items() if entries
            }
            if indexed != {
                channel: sorted(entries) for channel, entries in self._contained.items()
            }:
                self.add(
                    "error",
                    "its message index does not agree with its messages: readers may miss some",
                    REWRITE,
                    self._place,
                )
        elif self._contained:
            self._n_not_indexed += 1
        self._contained, self._indexed = {}, {}

    def _chunk_findings(self) -> None:
        if self._n_without_crc:
            self.add(
                "note",
                f"{self._n_without_crc} chunks have no CRC: changed bytes in them may go"
                " unnoticed",
            )
        if self._n_not_indexed:
            self.add(
                "warning",
                f"{self._n_not_indexed} chunks have no message index: reading in order of time is"
                " slow",
                REWRITE,
            )
        if loose := self._n_records[Opcode.MESSAGE]:
            self.add(
                "note", f"{loose} messages are outside chunks: without compression, index or CRC"
            )

    def _summary_findings(self) -> None:
        """Whether the summary agrees with what was found."""
        if self._summary is None:
            return
        found = dict(self._chunks)
        for index in self._summary.chunks:
            is_so = found.pop(index.chunk_start_offset, None)
            pairs = zip(_TOLD, is_so or (), strict=False)
            wrong = [name for name, value in pairs if getattr(index, name) != value]
            if is_so is None or wrong:
                reason = (
                    f"disagrees with it ({', '.join(wrong)})"
                    if wrong
                    else "names it, but it cannot be read"
                )
                self.add(
                    "error",
                    f"the summary {reason}",
                    REWRITE,
                    f"chunk at byte {index.chunk_start_offset}",
                )
        if found and self._summary.chunks:
            self.add(
                "error",
                f"{len(found)} chunks are not in the summary: readers miss their messages",
                REWRITE,
            )
        if self._summary.statistics is None:
            self.add("note", "the summary has no statistics")
        else:
            self._statistics_findings(self._summary.statistics)

    def _statistics_findings(self, told: Statistics) -> None:
        self.is_vouched_for = told.message_count == sum(self._n_messages.values())
        counts = {number: count for number, count in told.channel_message_counts.items() if count}
        pairs = {
            "messages": (told.message_count, sum(self._n_messages.values())),
            "messages by channel": (counts, dict(self._n_messages)),
            "chunks": (told.chunk_count, self._n_records[Opcode.CHUNK]),
            "attachments": (told.attachment_count, self._n_records[Opcode.ATTACHMENT]),
            "metadata records": (told.metadata_count, self._n_records[Opcode.METADATA]),
        }
        if self.counts:
            pairs["first and last time"] = (
                (told.message_start_time, told.message_end_time),
                (self.start_ns, self.end_ns),
            )
        for name, (said, is_so) in pairs.items():
            if said != is_so:
                self.add(
                    "warning", f"the statistics say {said} for {name}, found are {is_so}", REWRITE
                )


class SqliteCheck(MessageCheck):
    """The check of a SQLite file."""

    def __init__(
        self,
        path: Path,
        types: Typestore | None,
        line: TimeLine,
        name: str,
    ):
        super().__init__(path, types, line, name)
        try:
            file = SqliteInput(path)
        except DamagedError as error:
            self.add("error", str(error), RECOVER)
            return
        try:
            self._check(file)
        finally:
            file.close()

    def _check(self, file: SqliteInput) -> None:
        _sqlite_findings(self, file)
        for fault in file.faults():
            self.add("error", f"SQLite says: {fault}", RECOVER)
        self.define(file.schemas.values(), file.channels)
        waiting: dict[int, list[tuple[int, bytes]]] = defaultdict(list)
        try:
            for _row, number, stamp_ns, data in file.rows():
                self.take(number, stamp_ns)
                waiting[number].append((stamp_ns, data))
                if len(waiting[number]) >= AT_ONCE:
                    self.decode(number, waiting.pop(number))
        except DamagedError as error:
            self.add("error", str(error), RECOVER)
        for number, messages in waiting.items():
            self.decode(number, messages)
        self.topic_findings()
        self.add(
            "note",
            "its format has no CRC: it was read as a whole, but changed bytes may go unnoticed",
        )
        del self._types, self._own_types


class FileGlance(FileFacts):
    """What a file says of its messages, and their log times by its indexes: nothing is
    decompressed where they are.

    Parameters
    ----------
    path, line, name
        As of `MessageCheck`.
    topics
        Endings of the names of topics whose log times are looked at.

    Raises
    ------
    DamagedError
        If the file cannot be opened.
    """

    def __init__(self, path: Path, line: TimeLine, name: str, topics: tuple[str, ...]):
        super().__init__(name)
        with closing(open_input(path)) as file:
            for number, channel in file.channels.items():
                self.take_topic(
                    number, channel, file.schemas.get(channel.schema_id), file.counts[number]
                )
                self.counts += Counter({channel.topic: file.counts[number]})
            if file.message_count:
                self.start_ns, self.end_ns = file.start_ns, file.end_ns
            self.is_vouched_for = file.is_counted
            if isinstance(file, SqliteInput):
                _sqlite_findings(self, file)
            self.file_findings(file.strays)
            wanted = {
                number: line.number(one.name)
                for number, one in self._topics.items()
                if one.name.endswith(topics)
            }
            try:
                for numbers, stamps in file.log_times(wanted):
                    line.extend(numbers, stamps)
                for number, count in file.missing(wanted).items():
                    told = f"{count} messages are missing by the sequence numbers"
                    self.add("warning", told, LOST_BEFORE, f"topic {self._topics[number].name}")
            except DamagedError as error:
                self.add("error", str(error), RECOVER)


def _sqlite_findings(facts: FileFacts, file: SqliteInput) -> None:
    """Add what SQLite's tables tell without reading all of the file."""
    if file.beside:
        text = (
            f"beside it lies {file.beside}: its recorder was stopped before it closed the file."
            f" {file.message_count} messages were"
        )
        text += (
            " read in all; where such a file is damaged or cut off, SQLite stops without a word,"
            " and recovery may find more"
        )
        facts.add("warning", text, "keep the files together, or " + RECOVER)
    if file.n_unreadable:
        facts.add(
            "error",
            f"{file.n_unreadable} messages cannot be read: they have no time, or no bytes",
            RECOVER,
        )
