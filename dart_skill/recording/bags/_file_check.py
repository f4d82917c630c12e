"""The check of one file of a bag: every byte, every index, every message; and a glance at one, which
takes no time.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from rosbags.typesys.store import Typestore

from dart_skill.recording.bags._definitions import embedded_types
from dart_skill.recording.bags._findings import RECOVER, REWRITE, Finding, TimeLine
from dart_skill.recording.bags._other_inputs import SqliteInput
from dart_skill.recording.bags.columns import Decoder
from dart_skill.recording.bags.files import open_input, unpacker_of
from dart_skill.recording.bags.messages import shared_types
from dart_skill.recording.bags.metadata import definition_of, full_name, message_encoding, profiles
from dart_skill.recording.mcap import (
    Damage,
    DamagedError,
    McapInput,
    Record,
    Summary,
    crc_of,
    mapped,
    messages_of,
    read_definitions,
    read_summary,
    walk,
)

LOST_BEFORE = "they were lost before or while they were recorded"
"""Remedy of messages that are missing by their sequence numbers."""
NO_MESSAGES = "the file holds no messages"
NOT_DEFINED = "which the bag does not define: its messages were not decoded"
GIVE_TYPES = "give the folder of its .msg files with --definitions, or read its messages raw"
OF_EVENTS = frozenset(
    {
        "rcl_interfaces/msg/Log",
        "rcl_interfaces/msg/ParameterEvent",
        "sensor_msgs/msg/Joy",
        "sensor_msgs/msg/JoyFeedback",
    }
)
"""Types of messages that come when there is something to say, however regular they look."""
AT_ONCE = 500
"""Number of messages of a SQLite file that are decoded together."""
_COMPARED = (
    "message_start_time",
    "message_end_time",
    "chunk_length",
    "compression",
    "compressed_size",
    "uncompressed_size",
)
"""Fields of the index of a chunk in the summary that are compared with the chunk."""


@dataclass
class _CheckedTopic:
    """What is learned about a channel while its messages pass.

    reason: why its messages cannot be decoded; empty if they can.
    """

    name: str
    type_name: str
    encoding: str
    has_lost_schema: bool
    count: int = 0
    reason: str = ""
    last_sequence: int | None = None
    gaps: int = 0
    missing: int = 0
    undecodable: int = 0
    first_reason: str = ""
    by_other: int = 0  # messages that only a definition from elsewhere fits


class FileFacts:
    """What is found out about a file.

    Parameters
    ----------
    name
        Of the file in findings.

    Attributes
    ----------
    findings
        In the order in which they were found.
    counts
        Messages by topic.
    start_ns, end_ns
        Log times of the first and last message; None without messages.
    is_vouched_for
        Whether the file itself has counted as many messages as there are.
    """

    def __init__(self, name: str):
        self.name = name
        self.findings: list[Finding] = []
        self.counts: Counter[str] = Counter()
        self.start_ns: int | None = None
        self.end_ns: int | None = None
        self.is_vouched_for = False
        self._topics: dict[int, _CheckedTopic] = {}  # by channel

    def topic_types(self, of_all: bool = True) -> dict[str, list[str]]:
        """Types by topic, of those that have messages.

        Parameters
        ----------
        of_all
            Of topics of all encodings, as far as the types are told; else of CDR alone.
        """
        found: dict[str, list[str]] = {}
        for topic in self._topics.values():
            is_meant = topic.type_name if of_all else topic.encoding == "cdr"
            if topic.count and is_meant:
                types = found.setdefault(topic.name, [])
                types += [topic.type_name] if topic.type_name not in types else []
        return found

    def add(self, severity: str, message: str, remedy: str = "", where: str = "") -> None:
        """Add a finding about the file.

        Parameters
        ----------
        where
            In it.
        """
        place = f"{self.name}, {where}" if where else self.name
        self.findings.append(Finding(severity, place, message, remedy))

    def take_topics(self, schemas: Mapping[int, Schema], channels: Mapping[int, Channel]) -> None:
        """Take the topics of the file."""
        for number, channel in channels.items():
            schema, encoding = schemas.get(channel.schema_id), message_encoding(channel)
            type_name = schema.name if schema is not None else ""
            self._topics[number] = _CheckedTopic(
                channel.topic,
                full_name(type_name) if encoding == "cdr" else type_name,
                encoding,
                channel.schema_id != 0 and schema is None,
            )

    def count(self, counts: Mapping[int, int]) -> None:
        """Add numbers of messages by the number of their channel, and what is to be said of all.

        Parameters
        ----------
        counts
            Of all messages of the file.
        """
        for number, topic in self._topics.items():
            topic.count = counts.get(number, 0)
            self.counts += Counter({topic.name: topic.count})
        undefined = {number: n for number, n in counts.items() if number not in self._topics}
        if undefined:
            self.add(
                "error",
                (
                    f"{sum(undefined.values())} messages are of channels {sorted(undefined)}, which"
                    " the file does not define"
                ),
                RECOVER,
            )
        if not self.counts:
            self.add("warning", NO_MESSAGES)
        for name, types in self.topic_types(of_all=False).items():
            if len(types) > 1:
                self.add(
                    "warning",
                    f"its messages have several types: {', '.join(types)}",
                    "each message is read by its own",
                    f"topic {name}",
                )

    def take_sqlite(self, file: SqliteInput) -> None:
        """Add what SQLite's tables tell without reading all of the file."""
        if file.beside:
            self.add(
                "warning",
                (
                    f"beside it lies {file.beside}: its recorder was stopped before it closed the"
                    f" file. {file.message_count} messages were read in all; where such a file is"
                    " damaged or cut off, SQLite stops without a word, and recovery may find more"
                ),
                "keep the files together, or " + RECOVER,
            )
        if file.n_unreadable:
            self.add(
                "error",
                f"{file.n_unreadable} messages cannot be read: they have no time, or no bytes",
                RECOVER,
            )


def glance_at(path: Path, line: TimeLine, name: str, topics: tuple[str, ...]) -> FileFacts:
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
    facts = FileFacts(name)
    with closing(open_input(path)) as file:
        facts.take_topics(file.schemas, file.channels)
        if file.message_count:
            facts.start_ns, facts.end_ns = file.start_ns, file.end_ns
        facts.is_vouched_for = file.is_counted
        if isinstance(file, SqliteInput):
            facts.take_sqlite(file)
        facts.count({**file.counts, **file.strays})
        wanted = {
            number: line.number(one.topic)
            for number, one in file.channels.items()
            if one.topic.endswith(topics)
        }
        try:
            for numbers, stamps in file.log_times(wanted):
                line.extend(numbers, stamps)
            # files of SQLite have no sequence numbers
            lost = file.missing(wanted) if isinstance(file, McapInput) else {}
            for number, count in lost.items():
                told = f"{count} messages are missing by the sequence numbers"
                facts.add("warning", told, LOST_BEFORE, f"topic {file.channels[number].topic}")
        except DamagedError as error:
            facts.add("error", str(error), RECOVER)
    return facts


class MessageCheck(FileFacts):
    """The check of a file, whatever kind of file it is: types, decoding, sequence numbers, log
    times.

    Parameters
    ----------
    types
        Definitions for topics whose file holds none; None: those of ROS 2 Jazzy and ours.
    line
        Log times of the bag, to which those of the file are added.
    name
        Of the file in findings.
    """

    def __init__(self, types: Typestore | None, line: TimeLine, name: str):
        super().__init__(name)
        self._line = line
        self._others = Decoder(shared_types() if types is None else types)
        self._n_messages: Counter[int] = Counter()  # by channel

    def define(self, schemas: Mapping[int, Schema], channels: Mapping[int, Channel]) -> None:
        """Take the types and topics of the file, before its messages.

        Parameters
        ----------
        schemas, channels
            By number.
        """
        texts = {number: definition_of(schema) for number, schema in schemas.items()}
        ids = (channel.schema_id for channel in channels.values())
        names = [texts[number][0] for number in ids if number in texts]
        others = self._others.types
        types, self._unknown = embedded_types(texts.values(), others, names)
        ways = Counter(name for name, _encoding, _text in set(texts.values()))
        self._empty = {name for name, _encoding, text in texts.values() if not text.strip()}
        self._defined = embedded_types(texts.values(), None)[0].fielddefs.keys()
        self.take_topics(schemas, channels)
        shared = Decoder(types)
        self._decoders = dict.fromkeys(channels, shared)
        for number, channel in channels.items():
            topic, own = self._topics[number], texts.get(channel.schema_id)
            if own is not None and ways[own[0]] > 1:  # the file defines it in several ways
                of_others = [text for text in texts.values() if text[0] != own[0]]
                found, _ = embedded_types([*of_others, own], others, names)
                self._decoders[number] = Decoder(found)
            if topic.encoding == "cdr" and topic.type_name not in types.fielddefs:
                topic.reason = self._unknown.get(topic.type_name, NOT_DEFINED)
            qos = profiles(channel.topic, channel.metadata.get("offered_qos_profiles", ""))
            if topic.type_name in OF_EVENTS or any(
                profile.durability.name == "TRANSIENT_LOCAL" for profile in qos
            ):
                self._line.is_of_events(topic.name)

    def take(self, messages: Iterable[tuple[int, int, bytes, int | None]]) -> None:
        """Look at messages as they stand in the file.

        Parameters
        ----------
        messages
            Channel, log time, bytes, and number by the publisher; None without one.
        """
        payloads: dict[int, list[tuple[int, bytes]]] = defaultdict(list)
        numbers, stamps = [], []
        for number, stamp_ns, data, sequence in messages:
            self._n_messages[number] += 1
            topic = self._topics.get(number)
            if topic is None:
                continue
            if sequence is not None:
                if topic.last_sequence is not None and sequence > topic.last_sequence + 1:
                    topic.gaps += 1
                    topic.missing += sequence - topic.last_sequence - 1
                topic.last_sequence = sequence
            is_cdr = topic.encoding == "cdr"
            numbers.append(
                self._line.number(topic.name if is_cdr else f"{topic.name} ({topic.encoding})")
            )
            stamps.append(stamp_ns)
            if is_cdr and not topic.reason:
                payloads[number].append((stamp_ns, data))
        if stamps:
            self._line.extend(np.array(numbers), np.array(stamps))
            first, last = min(stamps), max(stamps)
            self.start_ns = first if self.start_ns is None else min(self.start_ns, first)
            self.end_ns = last if self.end_ns is None else max(self.end_ns, last)
        for number, its in payloads.items():
            self._decode(self._topics[number], self._decoders[number], its)

    def _decode(
        self, topic: _CheckedTopic, decoder: Decoder, messages: list[tuple[int, bytes]]
    ) -> None:
        unpack = unpacker_of(messages[0][1])
        try:
            payloads = [data if unpack is None else unpack(data) for _, data in messages]
        except DamagedError as error:
            self.add("error", str(error), RECOVER, f"topic {topic.name}")
            return
        errors = decoder.errors(topic.type_name, payloads)
        wrong = [k for k, error in enumerate(errors) if error]
        by_other = [True] * len(wrong)
        if wrong and topic.type_name in self._others.types.fielddefs:
            rest = [payloads[k] for k in wrong]
            by_other = [bool(error) for error in self._others.errors(topic.type_name, rest)]
        topic.by_other += by_other.count(False)
        for k, is_none in zip(wrong, by_other, strict=True):
            if is_none:
                topic.undecodable += 1
                topic.first_reason = topic.first_reason or (
                    f"the first at log time {messages[k][0]} ns: {errors[k]}"
                )

    def topic_findings(self) -> None:
        """Add what is to be said of the topics, once all messages have passed."""
        for number, topic in self._topics.items():
            if self._n_messages[number]:
                self._type_findings(topic, f"topic {topic.name}")
                self._message_findings(topic, f"topic {topic.name}")
        self.count(self._n_messages)

    def _type_findings(self, topic: _CheckedTopic, where: str) -> None:
        # it was taken for one without fields
        if topic.undecodable and topic.type_name in self._empty:
            topic.reason, topic.undecodable = NOT_DEFINED, 0
        unknown = self._unknown.get(topic.type_name)
        if topic.encoding != "cdr":
            self.add(
                "note",
                (
                    f"its messages are encoded as '{topic.encoding}', not as cdr: they are not decoded"
                ),
                "read them raw",
                where,
            )
        elif not topic.type_name:
            severity, text = "warning", "it has no type: its schema names none"
            if topic.has_lost_schema:
                severity, text = "error", "it has no type: its schema is missing"
            self.add(severity, text, "read its messages raw", where)
        elif topic.reason:
            severity = "error" if unknown is not None else "warning"
            self.add(severity, f"it has type {topic.type_name}, {topic.reason}", GIVE_TYPES, where)
        elif unknown is not None:
            self.add(
                "warning",
                (
                    f"it has type {topic.type_name}, {unknown}: it was decoded as it is defined"
                    " elsewhere"
                ),
                "",
                where,
            )

    def _message_findings(self, topic: _CheckedTopic, where: str) -> None:
        text = f"{topic.undecodable} messages are no {topic.type_name}"
        if topic.undecodable and topic.type_name in self._defined:
            self.add("error", f"{text}; {topic.first_reason}", "read them raw", where)
        elif topic.undecodable:
            text += f" as it is known here, and the bag does not define it; {topic.first_reason}"
            self.add("warning", text, GIVE_TYPES, where)
        if topic.by_other:
            self.add(
                "warning",
                (
                    f"{topic.by_other} messages are no {topic.type_name} as the bag defines it, but as"
                    " it is defined elsewhere"
                ),
                "they are read by that definition",
                where,
            )
        if topic.gaps:
            self.add(
                "warning",
                (
                    f"{topic.missing} messages are missing in {topic.gaps} gaps of the sequence"
                    " numbers"
                ),
                LOST_BEFORE,
                where,
            )


def check_sqlite(path: Path, check: MessageCheck) -> None:
    """Check an SQLite file."""
    try:
        file = SqliteInput(path)
    except DamagedError as error:
        check.add("error", str(error), RECOVER)
        return
    with closing(file):
        check.take_sqlite(file)
        for fault in file.faults():
            check.add("error", f"SQLite says: {fault}", RECOVER)
        check.define(file.schemas, file.channels)
        waiting: list[tuple[int, int, bytes, None]] = []
        try:
            for number, stamp_ns, data in file.rows():
                waiting.append((number, stamp_ns, data, None))
                if len(waiting) >= AT_ONCE:
                    check.take(waiting)
                    waiting = []
        except DamagedError as error:
            check.add("error", str(error), RECOVER)
        check.take(waiting)
        check.topic_findings()
        check.add(
            "note",
            "its format has no CRC: it was read as a whole, but changed bytes may go unnoticed",
        )


class McapCheck(MessageCheck):
    """The check of an MCAP file.

    Parameters
    ----------
    path
        Of the file; the others: as of `MessageCheck`.
    """

    def __init__(self, path: Path, types: Typestore | None, line: TimeLine, name: str):
        super().__init__(types, line, name)
        self._chunks: dict[int, tuple] = {}  # what an index must say of each, by its place
        self._contained: dict[int, list] = {}  # of the current chunk, by its content
        self._indexed: dict[int, list] = {}  # of the current chunk, by its message indexes
        self._n_records: Counter[int] = Counter()  # by opcode
        self._n_without_crc = self._n_not_indexed = 0  # chunks
        with mapped(path) as data:
            summary = self._summary_of(data)
            # all of them, before the first message needs them
            self.define(*read_definitions(data, summary))
            for found in walk(data, summary):
                self._visit(found, data)
            self._end_of_chunk()
        self.topic_findings()
        if self._n_without_crc:
            self.add(
                "note",
                (
                    f"{self._n_without_crc} chunks have no CRC: changed bytes in them may go unnoticed"
                ),
            )
        if self._n_not_indexed:
            self.add(
                "warning",
                (
                    f"{self._n_not_indexed} chunks have no message index: reading in order of time is"
                    " slow"
                ),
                REWRITE,
            )
        if loose := self._n_records[Opcode.MESSAGE]:
            self.add(
                "note", (f"{loose} messages are outside chunks: without compression, index or CRC")
            )
        if summary is not None:
            self._compare(summary)
        # recovery makes no bag of nothing
        if not self._topics and not self._n_records[Opcode.ATTACHMENT]:
            self.findings = [
                replace(one, remedy="") if one.remedy == REWRITE else one for one in self.findings
            ]
        # of a long bag the checks of all files are kept
        del self._chunks, self._decoders, self._others

    def _summary_of(self, data: memoryview) -> Summary | None:
        try:
            summary = read_summary(data)
        except DamagedError as error:
            self.add("error", str(error), RECOVER)
            return None
        if summary is None:
            self.add(
                "warning",
                "there is no summary: readers must read all of the file to know what is in it",
                REWRITE,
            )
        elif not summary.has_crc:
            self.add("note", "the summary has no CRC")
        return summary

    def _visit(self, found: Record | Damage, data: memoryview) -> None:
        where = f"byte {found.offset}"
        if isinstance(found, Damage):
            self._end_of_chunk()
            self.add(
                "error", (f"{found.reason} ({found.end - found.offset} bytes)"), RECOVER, where
            )
            return
        if found.repaired:
            self.add(
                "error",
                f"{found.repaired}: readers lose the chunk that stands there",
                RECOVER,
                where,
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
            self.take((m.channel, m.log_time_ns, m.data, m.sequence) for m in found.messages())
        elif found.opcode == Opcode.ATTACHMENT:
            try:
                found.parsed()
            except DamagedError as error:
                self.add("error", str(error), RECOVER, where)
        elif found.opcode == Opcode.HEADER and (profile := found.parsed().profile) != "ros2":
            self.add(
                "note",
                (
                    f"its profile is '{profile}', not 'ros2': other tools may not take it for a bag of"
                    " ROS 2"
                ),
            )
        elif found.opcode == Opcode.DATA_END:
            crc = found.parsed().data_section_crc
            if crc and crc != crc_of(data, found.offset):
                self.add(
                    "error",
                    "the CRC of all before the summary does not fit: something in there has changed",
                    RECOVER,
                )

    def _chunk(self, found: Record) -> None:
        chunk = found.chunk()
        self._place = f"chunk at byte {found.offset}"
        try:
            raw = chunk.unpack()
            messages = list(messages_of(raw, most=chunk.most_records))
        except DamagedError as error:
            self.add("error", str(error), RECOVER, self._place)
            return
        self.take((m.channel, m.log_time_ns, m.data, m.sequence) for m in messages)
        for message in messages:
            entry = message.log_time_ns, message.place
            self._contained.setdefault(message.channel, []).append(entry)
        stamps = [message.log_time_ns for message in messages]
        if stamps and (min(stamps), max(stamps)) != (chunk.start_ns, chunk.end_ns):
            self.add(
                "error",
                "its first and last time are not those of its messages: readers may miss some",
                REWRITE,
                self._place,
            )
        self._n_without_crc += not chunk.crc
        sizes = found.end - found.offset, chunk.compression, len(chunk.records), len(raw)
        self._chunks[found.offset] = (chunk.start_ns, chunk.end_ns, *sizes)

    def _end_of_chunk(self) -> None:
        """Compare the message indexes behind a chunk with its messages."""
        if self._contained and self._indexed:
            indexed, contained = (
                {channel: sorted(entries) for channel, entries in one.items() if entries}
                for one in (self._indexed, self._contained)
            )
            if indexed != contained:
                self.add(
                    "error",
                    "its message index does not agree with its messages: readers may miss some",
                    REWRITE,
                    self._place,
                )
        elif self._contained:
            self._n_not_indexed += 1
        self._contained, self._indexed = {}, {}

    def _compare(self, summary: Summary) -> None:
        """Whether the summary agrees with what was found."""
        found = dict(self._chunks)
        for index in summary.chunks:
            is_so = found.pop(index.chunk_start_offset, None)
            pairs: Any = zip(_COMPARED, is_so or (), strict=False)
            wrong = [name for name, value in pairs if getattr(index, name) != value]
            text = "the summary names it, but it cannot be read"
            if wrong:
                text = f"the summary disagrees with it ({', '.join(wrong)})"
            if is_so is None or wrong:
                self.add("error", text, REWRITE, f"chunk at byte {index.chunk_start_offset}")
        if found and summary.chunks:
            self.add(
                "error",
                f"{len(found)} chunks are not in the summary: readers miss their messages",
                REWRITE,
            )
        told, n_records = summary.statistics, self._n_records
        if told is None:
            self.add("note", "the summary has no statistics")
            return
        total = self._n_messages.total()
        self.is_vouched_for = told.message_count == total
        by_channel = {number: n for number, n in told.channel_message_counts.items() if n}
        pairs = {
            "messages": (told.message_count, total),
            "messages by channel": (by_channel, dict(self._n_messages)),
            "chunks": (told.chunk_count, n_records[Opcode.CHUNK]),
            "attachments": (told.attachment_count, n_records[Opcode.ATTACHMENT]),
            "metadata records": (told.metadata_count, n_records[Opcode.METADATA]),
        }
        if self.counts:
            said_times = told.message_start_time, told.message_end_time
            pairs["first and last time"] = (said_times, (self.start_ns, self.end_ns))
        for name, (said, value) in pairs.items():
            if said != value:
                self.add(
                    "warning",
                    f"the statistics say {said} for {name}, found are {value}",
                    REWRITE,
                )
