"""Whether a bag is what it says: bytes, CRCs, indexes, statistics, metadata and messages; and what it says, for people and programs.

A check reads every byte and decodes every message by the definition in the bag. It changes nothing.
"""

from __future__ import annotations

import json
import os
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from zlib import crc32

from mcap.opcode import Opcode
from mcap.records import Channel, Schema, Statistics
from rosbags.typesys.store import Typestore

from dart_skill.recording.bags._metadata import METADATA_FILE, read_metadata_file
from dart_skill.recording.bags.messages import deserialize
from dart_skill.recording.bags.reader import BagError, BagReader, embedded_types, part_number
from dart_skill.recording.mcap.scan import (
    ChunkIndex,
    Damage,
    DamagedError,
    Record,
    Summary,
    known_places,
    mapped,
    parse,
    parse_chunk,
    parse_message_index,
    read_summary,
    records_of,
    walk,
)
from dart_skill.recording.mcap.writer import MESSAGE

RECOVER = "make a new bag of what is in it: dart-skill bag recover"
REWRITE = "write its index anew: dart-skill bag recover"
SEVERITIES = ("error", "warning", "note")


@dataclass(frozen=True)
class Finding:
    """Something about a bag. severity: 'error' (something is lost or unreadable), 'warning' (look at it) or 'note'.

    place: file, topic or byte; remedy: what to do about it, empty if nothing needs to be done.
    """

    severity: str
    place: str
    message: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.severity}: {self.place}: {self.message}" + (f" ({self.remedy})" if self.remedy else "")


def check_bag(path: str | os.PathLike, types: Typestore | None = None) -> list[Finding]:
    """What is wrong with a bag folder or file, the worst first; empty if nothing is.

    types: definitions for topics whose bag holds none (`messages.typestore`).
    """
    path = Path(path)
    if not path.exists():
        return [Finding("error", str(path), "no such bag")]
    if path.is_file():
        return check_file(path, types)
    findings, checked = [], []
    metadata = _metadata_of(path, findings)
    if metadata is not None and not _is_plain_mcap(metadata):
        return _checked_by_reading(path, types)
    files = _files_of(path, metadata, findings)
    for file in files:
        if file.suffix != ".mcap":
            findings += check_file(file, types)
            continue
        checked.append(_FileCheck(file, types).run())
        findings += checked[-1].findings
    if metadata is not None:
        findings += _metadata_findings(metadata, checked)
    findings += _one_bag_findings(path, checked)
    findings = [finding for finding in findings if finding.message != _NO_MESSAGES]  # a part of a bag may well hold none
    if checked and not any(check.counts for check in checked):
        findings.append(Finding("warning", path.name, "the bag holds no messages"))
    return _sorted(findings)


def check_file(path: str | os.PathLike, types: Typestore | None = None) -> list[Finding]:
    """What is wrong with a single file of a bag, the worst first; empty if nothing is."""
    path = Path(path)
    if not path.is_file():
        return [Finding("error", str(path), "no such file")]
    if path.suffix != ".mcap":
        return _checked_by_reading(path, types)
    return _sorted(_FileCheck(path, types).run().findings)


def describe(path: str | os.PathLike, types: Typestore | None = None) -> dict:
    """What a bag holds, in numbers, texts, lists and dicts only (JSON). Raises BagError."""
    with BagReader(path, types) as bag:
        duration_ns = bag.end_ns - bag.start_ns
        attachments = bag.attachments()
        return {
            "path": str(path),
            "start_ns": bag.start_ns,
            "end_ns": bag.end_ns,
            "duration_ns": duration_ns,
            "message_count": bag.message_count,
            "storage": bag.storage,
            "compression": ", ".join(sorted({file.compression for file in bag.files} - {""})),
            "size_bytes": sum(file.size for file in bag.files),
            "has_metadata_file": (Path(path) / METADATA_FILE).is_file(),
            "ros_distro": bag.metadata.get("ros_distro") or "",
            "files": [
                {
                    "path": file.path.name,
                    "size_bytes": file.size,
                    "message_count": file.count,
                    "start_ns": file.start_ns,
                    "duration_ns": None if file.start_ns is None else file.end_ns - file.start_ns,
                    "library": file.library,
                }
                for file in bag.files
            ],
            "topics": [
                {
                    "name": topic.name,
                    "type": topic.type_name,
                    "count": topic.count,
                    "rate_hz": topic.count / duration_ns * 1e9 if duration_ns else 0.0,
                    "encoding": topic.encoding,
                    "type_hash": topic.type_hash,
                    "is_defined": topic.type_name in bag.types.fielddefs,
                    "qos": [_qos(profile) for profile in topic.qos],
                }
                for topic in bag.topics.values()
            ],
            "attachments": [{"name": one.name, "media_type": one.media_type, "size_bytes": len(one.data)} for one in attachments],
            "lost": _lost(bag.custom_data),
            "custom_data": bag.custom_data,
        }


_NO_MESSAGES = "the file holds no messages"


@dataclass
class _Topic:
    """What is learned about a channel while its messages pass."""

    name: str
    type_name: str
    last_sequence: int | None = None
    gaps: int = 0
    missing: int = 0
    undecodable: int = 0
    first_reason: str = ""


@dataclass
class _FileCheck:
    """The check of one MCAP file. What it learns of the content (by topic, in ns) serves the check of the bag."""

    path: Path
    given_types: Typestore | None = None
    findings: list[Finding] = field(default_factory=list)
    counts: Counter = field(default_factory=Counter)
    topic_types: dict[str, str] = field(default_factory=dict)
    start_ns: int | None = None
    end_ns: int | None = None
    is_whole: bool = False

    def __post_init__(self):
        self.summary: Summary | None = None
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.topics: dict[int, _Topic] = {}
        self.chunks: list[ChunkIndex] = []
        self.indexed: dict[int, list] = {}  # of the current chunk, by its message indexes
        self.contained: dict[int, list] = {}  # of the current chunk, by its content
        self.numbers, self.channel_counts = Counter(), Counter()
        self.unknown_channels, self.loose = Counter(), 0
        self.last_ns, self.jumps, self.largest_jump_ns, self.first_jump_ns = None, 0, 0, 0
        self.types, self.unknown_types = None, {}

    def run(self) -> _FileCheck:
        """Check everything."""
        if self.path.stat().st_size == 0:
            self._add("error", "the file is empty (0 bytes): its recorder stopped before the first write", "delete it")
            return self
        with mapped(self.path) as data:
            self._summary(data)
            self._definitions(data)
            for found in walk(data, known_places(self.summary) if self.summary else []):
                self._visit(found, data)
            self._end_of_chunk()
        self._topic_findings()
        self._time_findings()
        if self.summary is not None:
            self._summary_findings()
        self.is_whole = not any(finding.severity == "error" for finding in self.findings)
        return self

    def _add(self, severity: str, message: str, remedy: str = "", where: str = "") -> None:
        self.findings.append(Finding(severity, self.path.name + (f", {where}" if where else ""), message, remedy))

    def _summary(self, data: memoryview) -> None:
        try:
            self.summary = read_summary(data)
            if self.summary is None:
                self._add("warning", "there is no summary: readers must read all of the file to know what is in it", REWRITE)
            elif not self.summary.has_crc:
                self._add("note", "the summary has no CRC")
        except DamagedError as error:
            self._add("error", str(error), RECOVER)

    def _definitions(self, data: memoryview) -> None:
        """All schemas and channels, before the first message needs them."""
        if self.summary is not None and self.summary.channels:
            self.schemas, self.channels = self.summary.schemas, self.summary.channels
        else:
            for record in _defined(data):
                (self.schemas if isinstance(record, Schema) else self.channels).setdefault(record.id, record)
        texts = [(schema.name, schema.encoding, schema.data.decode(errors="replace")) for schema in self.schemas.values()]
        self.types, self.unknown_types = embedded_types(texts, self.given_types)
        for number, channel in self.channels.items():
            schema = self.schemas.get(channel.schema_id)
            self.topics[number] = _Topic(channel.topic, schema.name if schema else "")
            self.topic_types[channel.topic] = schema.name if schema else ""
            self._channel_findings(channel, schema)

    def _channel_findings(self, channel: Channel, schema: Schema | None) -> None:
        where = f"topic {channel.topic}"
        if channel.message_encoding != "cdr":
            self._add("error", f"its messages are encoded as '{channel.message_encoding}', not as cdr", "read them raw", where)
        elif schema is None:
            self._add("error", "it has no type: the schema is missing", "", where)
        elif schema.name not in self.types.fielddefs:
            reason = self.unknown_types.get(schema.name, "which the bag does not define")
            self._add("error", f"it has type {schema.name}, {reason}", "give the folder of its .msg files", where)

    def _visit(self, found: Record | Damage, data: memoryview) -> None:
        if isinstance(found, Damage):
            self._end_of_chunk()
            self._add("error", f"{found.reason} ({found.end - found.offset} bytes)", RECOVER, f"byte {found.offset}")
            return
        if found.repaired:
            self._add("error", f"{found.repaired}: readers lose the chunk that stands there", RECOVER, f"byte {found.offset}")
        if found.opcode == Opcode.MESSAGE_INDEX:
            channel, entries = parse_message_index(found.content)
            self.indexed[channel] = entries
            return
        self._end_of_chunk()
        self.numbers[found.opcode] += 1
        if found.opcode == Opcode.CHUNK:
            self._chunk(found)
        elif found.opcode == Opcode.MESSAGE:
            self.loose += 1
            self._message(bytes(data[found.offset : found.end]), 9, found.end - found.offset)
        elif found.opcode == Opcode.ATTACHMENT:
            self._readable(found)
        elif found.opcode == Opcode.HEADER:
            self._header(found)
        elif found.opcode == Opcode.DATA_END:
            crc = parse(found.opcode, found.content).data_section_crc
            if crc and crc != crc32(data[: found.offset]):
                self._add("error", "the CRC of all before the summary does not fit: something in there has changed", RECOVER)

    def _header(self, found: Record) -> None:
        profile = parse(found.opcode, found.content).profile
        if profile != "ros2":
            self._add("warning", f"its profile is '{profile}', not 'ros2': other tools may not take it for a ROS 2 bag", REWRITE)

    def _readable(self, found: Record) -> None:
        try:
            parse(found.opcode, found.content)
        except DamagedError as error:
            self._add("error", str(error), RECOVER, f"byte {found.offset}")

    def _chunk(self, found: Record) -> None:
        chunk = parse_chunk(found.content)
        where = f"chunk at byte {found.offset}"
        try:
            raw = chunk.unpack()
            self.contained = defaultdict(list)
            for opcode, begin, end in records_of(raw):
                if opcode == Opcode.MESSAGE:
                    channel, log_time = self._message(raw, begin, end)
                    self.contained[channel].append((log_time, begin - 9))
        except DamagedError as error:
            self.contained = {}
            self._add("error", str(error), RECOVER, where)
            return
        stamps = [stamp for entries in self.contained.values() for stamp, _ in entries]
        if stamps and (min(stamps), max(stamps)) != (chunk.start_ns, chunk.end_ns):
            self._add("error", "its first and last time are not those of its messages: readers may miss some", REWRITE, where)
        self.numbers["no CRC"] += not chunk.crc
        length = found.end - found.offset
        sizes = (chunk.compression, len(chunk.records), len(raw))
        self.chunks.append(ChunkIndex(chunk.start_ns, chunk.end_ns, found.offset, length, {}, 0, *sizes))

    def _end_of_chunk(self) -> None:
        """Compare the message indexes behind a chunk with its messages."""
        if self.contained and self.indexed:
            indexed = {channel: sorted(entries) for channel, entries in self.indexed.items() if entries}
            if indexed != {channel: sorted(entries) for channel, entries in self.contained.items()}:
                where = f"chunk at byte {self.chunks[-1].offset}"
                self._add("error", "its message index does not agree with its messages: readers may miss some", REWRITE, where)
        elif self.contained:
            self.numbers["not indexed"] += 1
        self.contained, self.indexed = {}, {}

    def _message(self, raw: bytes, begin: int, end: int) -> tuple[int, int]:
        """Take note of a message; returns channel and log time."""
        _, _, number, sequence, log_time, _ = MESSAGE.unpack_from(raw, begin - 9)
        self.channel_counts[number] += 1
        topic = self.topics.get(number)
        if topic is None:
            self.unknown_channels[number] += 1
            return number, log_time
        self.counts[topic.name] += 1
        if topic.last_sequence is not None and sequence > topic.last_sequence + 1:
            topic.gaps += 1
            topic.missing += sequence - topic.last_sequence - 1
        topic.last_sequence = sequence
        if self.channels[number].message_encoding == "cdr" and topic.type_name in self.types.fielddefs:
            try:
                deserialize(self.types, topic.type_name, raw[begin + 22 : end])
            except ValueError as error:
                topic.undecodable += 1
                topic.first_reason = topic.first_reason or f"the first at log time {log_time} ns: {error}"
        self._at_time(log_time)
        return number, log_time

    def _at_time(self, log_time: int) -> None:
        if self.last_ns is None:
            self.start_ns = self.end_ns = log_time
        elif log_time < self.last_ns:
            self.first_jump_ns = self.first_jump_ns if self.jumps else self.last_ns
            self.jumps += 1
            self.largest_jump_ns = max(self.largest_jump_ns, self.last_ns - log_time)
        self.last_ns = log_time
        self.start_ns, self.end_ns = min(self.start_ns, log_time), max(self.end_ns, log_time)

    def _topic_findings(self) -> None:
        for topic in self.topics.values():
            where = f"topic {topic.name}"
            if topic.undecodable:
                message = f"{topic.undecodable} messages are no {topic.type_name}; {topic.first_reason}"
                self._add("error", message, "read them raw", where)
            if topic.gaps:
                message = f"{topic.missing} messages are missing in {topic.gaps} gaps of the sequence numbers"
                self._add("warning", message, "they were lost before or while they were recorded", where)
        if self.unknown_channels:
            count, numbers = sum(self.unknown_channels.values()), sorted(self.unknown_channels)
            self._add("error", f"{count} messages are of channels {numbers}, which the file does not define", RECOVER)

    def _time_findings(self) -> None:
        if not self.counts:
            self._add("warning", _NO_MESSAGES)
        if self.jumps:
            text = f"log time jumps back {self.jumps} times, by up to {self.largest_jump_ns / 1e9:.6f} s, first at {self.first_jump_ns} ns"
            self._add("warning", text, "a clock was set, or a simulation began anew")
        if self.numbers["no CRC"]:
            self._add("note", f"{self.numbers['no CRC']} chunks have no CRC: changed bytes in them may go unnoticed")
        if self.numbers["not indexed"]:
            self._add("warning", f"{self.numbers['not indexed']} chunks have no message index: reading in order of time is slow", REWRITE)
        if self.loose:
            self._add("note", f"{self.loose} messages are outside chunks: without compression, index or CRC")

    def _summary_findings(self) -> None:
        """Whether the summary agrees with what was found."""
        found = {chunk.offset: chunk for chunk in self.chunks}
        for index in self.summary.chunks:
            chunk = found.pop(index.offset, None)
            fields = ("start_ns", "end_ns", "length", "compression", "compressed_size", "size")
            wrong = [name for name in fields if chunk is not None and getattr(index, name) != getattr(chunk, name)]
            if chunk is None or wrong:
                reason = f"disagrees with it ({', '.join(wrong)})" if wrong else "names it, but it cannot be read"
                self._add("error", f"the summary {reason}", REWRITE, f"chunk at byte {index.offset}")
        if found and self.summary.chunks:
            self._add("error", f"{len(found)} chunks are not in the summary: readers miss their messages", REWRITE)
        if self.summary.statistics is None:
            self._add("note", "the summary has no statistics")
        else:
            self._statistics_findings(self.summary.statistics)

    def _statistics_findings(self, told: Statistics) -> None:
        counts = {number: count for number, count in told.channel_message_counts.items() if count}
        pairs = {
            "messages": (told.message_count, sum(self.channel_counts.values())),
            "messages by channel": (counts, dict(self.channel_counts)),
            "chunks": (told.chunk_count, self.numbers[Opcode.CHUNK]),
            "attachments": (told.attachment_count, self.numbers[Opcode.ATTACHMENT]),
            "metadata records": (told.metadata_count, self.numbers[Opcode.METADATA]),
            "channels": (told.channel_count, len(self.channels)),
        }
        if self.counts:
            pairs["first and last time"] = ((told.message_start_time, told.message_end_time), (self.start_ns, self.end_ns))
        for name, (said, is_so) in pairs.items():
            if said != is_so:
                self._add("error", f"the statistics say {said} for {name}, found are {is_so}", REWRITE)


def _defined(data: memoryview) -> Iterator[Schema | Channel]:
    """Schemas and channels of a file that tells them nowhere else than among its messages."""
    for found in walk(data):
        if isinstance(found, Damage):
            continue
        try:
            if found.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                yield parse(found.opcode, found.content)
            elif found.opcode == Opcode.CHUNK:
                raw = parse_chunk(found.content).unpack()
                for opcode, begin, end in records_of(raw):
                    if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                        yield parse(opcode, raw[begin:end])
        except DamagedError:
            continue


def _metadata_of(path: Path, findings: list[Finding]) -> dict | None:
    try:
        return read_metadata_file(path)
    except FileNotFoundError:
        remedy = "the files can be read without it" + ("; dart-skill bag recover makes one" if any(path.glob("*.mcap")) else "")
        findings.append(Finding("warning", path.name, f"there is no {METADATA_FILE}: the recorder did not close the bag", remedy))
    except (ValueError, OSError) as error:
        findings.append(Finding("error", path.name, str(error), REWRITE))
    return None


def _files_of(path: Path, metadata: dict | None, findings: list[Finding]) -> list[Path]:
    """Files that are there, in order; findings for those that are missing or too many."""
    there = sorted((file for file in path.iterdir() if file.suffix in (".mcap", ".db3")), key=part_number)
    if metadata is None:
        if not there:
            findings.append(Finding("error", path.name, "no .mcap file in this folder"))
        return there
    named = [path / PurePath(str(name)).name for name in metadata.get("relative_file_paths") or []]
    for file in named:
        if not file.is_file():
            findings.append(Finding("error", file.name, f"the file is missing, which {METADATA_FILE} names", "find it, or " + REWRITE))
    for file in there:
        if file not in named:
            message = f"the file is in the folder, but {METADATA_FILE} does not name it: readers leave it out"
            findings.append(Finding("warning", file.name, message, "move it away, or " + REWRITE))
    return [file for file in named if file.is_file()]


def _metadata_findings(metadata: dict, checked: list[_FileCheck]) -> list[Finding]:
    """Whether metadata.yaml agrees with the files."""
    try:
        pairs = _metadata_pairs(metadata, checked)
        stopped = (metadata.get("custom_data") or {}).get("writing_stopped")
    except (KeyError, TypeError, AttributeError) as error:
        return [Finding("error", METADATA_FILE, f"it lacks or misuses {error}", REWRITE)]
    findings = [
        Finding("error", METADATA_FILE, f"it says {said} for {name}, the files say {is_so}", REWRITE)
        for name, (said, is_so) in pairs.items()
        if said != is_so
    ]
    if stopped:
        findings.append(Finding("warning", METADATA_FILE, f"the recorder could not write all: {stopped}"))
    return findings


def _metadata_pairs(metadata: dict, checked: list[_FileCheck]) -> dict[str, tuple]:
    """What metadata.yaml says and what is so, by name."""
    counts: Counter = sum((check.counts for check in checked), Counter())
    types = {name: type_name for check in checked for name, type_name in check.topic_types.items()}
    pairs = {"all messages": (metadata["message_count"], sum(counts.values()))}
    filled = [check for check in checked if check.counts]
    if filled:
        start, end = min(check.start_ns for check in filled), max(check.end_ns for check in filled)
        pairs["the time of the first message"] = (metadata["starting_time"]["nanoseconds_since_epoch"], start)
        pairs["the duration"] = (metadata["duration"]["nanoseconds"], end - start)
    for item in metadata["topics_with_message_count"]:
        topic = item["topic_metadata"]
        name = topic["name"]
        pairs[f"messages on {name}"] = (item["message_count"], counts.pop(name, 0))
        if types.get(name):
            pairs[f"the type of {name}"] = (topic["type"], types[name])
    pairs["topics it does not name"] = ([], sorted(counts))
    by_name = {check.path.name: check for check in checked}
    for item in metadata.get("files") or []:
        check = by_name.get(PurePath(item["path"]).name)
        if check is not None:
            pairs[f"messages in {check.path.name}"] = (item["message_count"], sum(check.counts.values()))
            if check.counts:
                times = (item["starting_time"]["nanoseconds_since_epoch"], item["duration"]["nanoseconds"])
                pairs[f"start and duration of {check.path.name}"] = (times, (check.start_ns, check.end_ns - check.start_ns))
    return pairs


def _one_bag_findings(path: Path, checked: list[_FileCheck]) -> list[Finding]:
    """Signs that the files of a folder are of different bags."""
    findings, types = [], {}
    if len(stems := sorted({part_number(check.path)[0] for check in checked})) > 1:
        message = f"its files have different names ({', '.join(stems)}): they may be of different bags"
        findings.append(Finding("warning", path.name, message, "give each bag a folder of its own"))
    for check in checked:
        for topic, type_name in check.topic_types.items():
            if types.setdefault(topic, type_name) != type_name:
                message = f"topic {topic} has type {type_name} here and {types[topic]} in a file before: they are of different bags"
                findings.append(Finding("error", check.path.name, message, "give each bag a folder of its own"))
    filled = [check for check in checked if check.counts]
    for before, after in zip(filled, filled[1:], strict=False):
        if after.start_ns < before.end_ns:
            message = f"it begins before {before.path.name} ends: the files are of different bags, or log time jumped back"
            findings.append(Finding("warning", after.path.name, message))
    return findings


def _is_plain_mcap(metadata: dict) -> bool:
    """Whether the files are MCAP as it stands, and not SQLite, nor compressed as a whole or message by message."""
    mode = str(metadata.get("compression_mode") or "none").lower()
    return metadata.get("storage_identifier", "mcap") == "mcap" and mode not in ("file", "message")


def _checked_by_reading(path: Path, types: Typestore | None) -> list[Finding]:
    """A bag or file that only its reader knows: whether all of it can be read and decoded, and is as much as it says."""
    try:
        with BagReader(path, types) as bag:
            found = Counter(message.topic for message in bag.messages())
            told = {topic.name: topic.count for topic in bag.topics.values()}
    except BagError as error:
        return [Finding("error", path.name, str(error))]
    findings = [
        Finding("error", f"{path.name}, topic {name}", f"it is said to have {count} messages, found are {found[name]}")
        for name, count in told.items()
        if count != found[name]
    ]
    findings += [] if found else [Finding("warning", path.name, "the bag holds no messages")]
    return [*findings, Finding("note", path.name, "its format has no CRC: it was read as a whole, but changed bytes may go unnoticed")]


def _sorted(findings: list[Finding]) -> list[Finding]:
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))


def _lost(custom_data: dict[str, str]) -> dict[str, int] | None:
    """Messages that the recorder lost, by topic; None if it does not say."""
    try:
        lost = json.loads(custom_data.get("lost", ""))
    except ValueError:
        return None
    return lost if isinstance(lost, dict) else None


def _qos(profile) -> dict:
    """A profile of rosbags as JSON holds it."""
    return {
        name: value.name.lower() if hasattr(value, "name") else {"sec": value.sec, "nsec": value.nsec} if hasattr(value, "sec") else value
        for name, value in profile._asdict().items()
    }
