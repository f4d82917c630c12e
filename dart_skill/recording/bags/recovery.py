"""Making a new bag of one whose recorder was killed, whose disk was full or lost power, or whose bytes have changed.

Kept is what can be vouched for or at least read: every chunk whose CRC fits its content, messages outside chunks, attachments and
metadata, and of a chunk that was cut off the messages that its decompressor still gives. The bag itself is never changed.
"""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema

from dart_skill.files import require_file
from dart_skill.recording.bags._disk_sync import sync_folder
from dart_skill.recording.bags._files import files_in, named_files, part_number
from dart_skill.recording.bags._metadata import (
    RECORD_NAME,
    FileMetadata,
    TopicMetadata,
    bag_metadata,
    parse_qos,
    parse_record,
    read_metadata_file,
    record_values,
    write_metadata_file,
)
from dart_skill.recording.bags.reader import BagError
from dart_skill.recording.mcap import (
    Damage,
    DamagedError,
    McapChannel,
    McapFile,
    Message,
    Record,
    Summary,
    crc_of,
    mapped,
    parse_header,
    read_definitions,
    read_summary,
    walk,
)

_OWN_LIBRARY = "dart_skill"


@dataclass(frozen=True)
class LostPlace:
    """A place of a file that is damaged or missing.

    file: its name.
    offset, n_bytes: where it is.
    reason: what is wrong there.
    messages: how many were lost there; 0 for an index or the like; None if nobody knows.
    """

    file: str
    offset: int
    n_bytes: int
    reason: str
    messages: int | None

    def __str__(self) -> str:
        lost = "an unknown number of messages" if self.messages is None else f"{self.messages} messages"
        return f"{self.file}, byte {self.offset}, {self.n_bytes} bytes: {self.reason}; {lost} lost"


@dataclass(frozen=True)
class Recovery:
    """A recovered bag: what is in it and what is not.

    * path, files: the new bag and the names of its files.
    * messages: kept, by topic.
    * lost: messages by topic, as far as statistics, message indexes, metadata.yaml or gaps in sequence numbers tell; what a recorder had
      not handed over yet when it stopped leaves no trace.
    * places: what is damaged or missing.
    * repairs: damage without loss.
    * unverified: kept messages for which no CRC vouches.
    * lost_chunks: how many were left out.
    * start_ns, end_ns: log times of the first and last message that was kept; None without messages.
    * n_attachments: how many were kept.
    * custom_data: of the new bag.
    """

    path: Path
    files: tuple[str, ...]
    messages: dict[str, int]
    lost: dict[str, int]
    places: tuple[LostPlace, ...]
    repairs: tuple[str, ...]
    unverified: int
    lost_chunks: int
    start_ns: int | None
    end_ns: int | None
    n_attachments: int
    custom_data: dict[str, str]

    @property
    def lost_bytes(self) -> int:
        """Bytes of damaged places that held messages, or may have."""
        return sum(place.n_bytes for place in self.places if place.messages != 0)

    @property
    def is_complete(self) -> bool:
        """Whether no message is known to be lost, and no place may have held one."""
        return not self.lost and all(place.messages == 0 for place in self.places)

    def __str__(self) -> str:
        kept, lost = sum(self.messages.values()), sum(self.lost.values())
        text = f"{kept} messages kept, {lost} known to be lost, {self.lost_chunks} chunks and {self.lost_bytes} bytes left out"
        return text + (f", {self.unverified} kept without a CRC that vouches for them" if self.unverified else "")


def recover(path: str | os.PathLike, output: str | os.PathLike) -> Recovery:
    """Make a new bag of what can be read of a damaged one.

    path: bag folder, with or without metadata.yaml, or a .mcap file; it is only read.
    output: folder of the new bag, which must not exist.

    Raises BagError if nothing is left to recover, FileExistsError, and OSError if the new bag cannot be written.
    """
    path, output = Path(path), Path(output)
    files, told = _input(path)
    if output.exists():
        raise FileExistsError(f"{output} exists already: bags are never overwritten, choose another name")
    if path.is_dir() and path.resolve() in output.resolve().parents:
        raise BagError(f"{output} is in the damaged bag {path}, which must not change: choose another folder")
    output.mkdir(parents=True)
    try:
        work = _Recovery(path, output, told)
        for file in files:
            work.take(file)
        return work.finish()
    except BaseException:
        shutil.rmtree(output)  # made by this call
        raise


def _input(path: Path) -> tuple[list[Path], dict]:
    """Files of the bag in order, also those that are missing, and what metadata.yaml tells."""
    if not path.exists():
        raise BagError(f"{path}: no such bag")
    if not path.is_dir():
        require_file(path)
        files, told = [path], {}
    else:
        files = files_in(path, (".mcap",))
        try:
            told = read_metadata_file(path)
            named = named_files(path, told)
            files = [file for file in named if file.suffix == ".mcap"] + [file for file in files if file not in named]
        except (OSError, ValueError, TypeError):
            told = {}
    if not files or any(file.suffix != ".mcap" for file in files):
        raise BagError(f"{path}: no .mcap file to recover: only bags of MCAP files can be")
    if all(file.is_file() and file.stat().st_size == 0 for file in files):
        names = ", ".join(file.name for file in files)
        raise BagError(f"{path}: {names} is empty (0 bytes): there is nothing to recover")
    return files, told


@dataclass
class _Topic:
    type_name: str
    qos: list
    type_hash: str
    encoding: str
    kept: int = 0
    lost: int = 0
    next_sequence: int | None = None
    gaps: int = 0


class _Recovery:
    """The bag that is being made."""

    def __init__(self, path: Path, output: Path, told: dict):
        self.path, self.output = path, output
        self.from_start = path.is_dir() or part_number(path)[1] <= 0  # and not a later part of a split bag
        self.topics: dict[str, _Topic] = {}
        self.places: list[LostPlace] = []
        self.repairs: list[str] = []
        self.files: list[McapFile] = []
        self.custom_data: dict[str, str] = dict(told.get("custom_data") or {})
        self.ros_distro = told.get("ros_distro") or ""
        self.unverified = self.lost_chunks = self.n_attachments = 0
        items = told.get("topics_with_message_count") or []
        self.told_topics = {item.get("topic_metadata", {}).get("name"): item.get("topic_metadata", {}) for item in items}
        self.told_counts = {item.get("topic_metadata", {}).get("name"): item.get("message_count", 0) for item in items}

    def take(self, file: Path) -> None:
        """Recover one file into one of the new bag."""
        if not file.is_file() or file.stat().st_size == 0:
            reason = "the file is empty (0 bytes)" if file.is_file() else "the file is missing"
            self.places.append(LostPlace(file.name, 0, 0, reason, None))
            return
        with mapped(file) as data:
            _FileRecovery(self, file.name, data).run()

    def new_file(self, profile: str) -> McapFile:
        path = self.output / f"{self.output.name}_{len(self.files)}.mcap"
        self.files.append(McapFile(path, profile=profile, library=_OWN_LIBRARY))
        return self.files[-1]

    def finish(self) -> Recovery:
        """Close all files, now that it is known what they are to tell."""
        if not any(file.channels for file in self.files) and not self.n_attachments:
            reasons = "; ".join(f"{place.file}: {place.reason}" for place in self.places) or "it has no topics"
            raise BagError(f"{self.path}: there is nothing to recover: {reasons}")
        for file in self.files:
            file.end_chunk()
        filled = [file for file in self.files if file.message_count]
        result = Recovery(
            path=self.output,
            files=tuple(file.path.name for file in self.files),
            messages={name: topic.kept for name, topic in self.topics.items()},
            lost=self._lost(),
            places=tuple(self.places),
            repairs=tuple(self.repairs),
            unverified=self.unverified,
            lost_chunks=self.lost_chunks,
            start_ns=min((file.start_ns for file in filled if file.start_ns is not None), default=None),
            end_ns=max((file.end_ns for file in filled if file.end_ns is not None), default=None),
            n_attachments=self.n_attachments,
            custom_data=self.custom_data,
        )
        self.custom_data |= {"recovered_from": self.path.name, "recovery": str(result)}
        metadata = [self._close(file) for file in self.files]
        write_metadata_file(self.output, bag_metadata(metadata, self._topics(result.messages), self.custom_data, self.ros_distro))
        sync_folder(self.output.parent)
        return result

    def _close(self, file: McapFile) -> FileMetadata:
        metadata = FileMetadata.of(file)
        counts: Counter[str] = Counter()
        for channel in file.channels.values():
            counts[channel.record.topic] += channel.count
        file.add_metadata(RECORD_NAME, record_values(bag_metadata([metadata], self._topics(counts), self.custom_data, self.ros_distro)))
        file.finish()
        os.fsync(file.stream.fileno())
        file.close()
        return metadata

    def _topics(self, counts: dict[str, int]) -> list[TopicMetadata]:
        """The topics of the bag or of a file, with their counts."""
        return [
            TopicMetadata(name, topic.type_name, topic.qos, topic.type_hash, counts[name], topic.encoding)
            for name, topic in self.topics.items()
            if name in counts
        ]

    def _lost(self) -> dict[str, int]:
        """Messages known to be lost, by topic: each source is a lower bound."""
        lost = Counter({name: max(topic.lost, topic.gaps) for name, topic in self.topics.items()})
        for name, count in self.told_counts.items():
            kept = self.topics[name].kept if name in self.topics else 0
            lost[name] = max(lost[name], count - kept)
        return {name: count for name, count in lost.items() if count > 0}


class _FileRecovery:
    """One file on its way into the new bag."""

    def __init__(self, bag: _Recovery, name: str, data: memoryview):
        self.bag, self.name, self.data = bag, name, data
        self.summary: Summary | None = None
        self.written: dict[int, McapChannel | None] = {}
        self.kept: Counter[int] = Counter()
        self.lost: Counter[int] = Counter()
        self.unknown_channels: Counter[int] = Counter()
        self.in_summary, self.verified = False, False
        self.bad_chunk: int | None = None  # which of the bag's places it is, if the chunk before was left out
        try:
            header, _ = parse_header(data)
            profile = header.profile
            self.counted = header.library == _OWN_LIBRARY
        except DamagedError:
            profile = "ros2"
            self.counted = False
        try:
            self.summary = read_summary(data)
            self.verified = self.summary is not None and _data_is_whole(data, self.summary.start)
        except DamagedError:  # the walk comes to it
            pass
        self.chunk_places = {chunk.chunk_start_offset for chunk in self.summary.chunks} if self.summary is not None else set()
        self.schemas, self.channels = read_definitions(data, self.summary)
        self.out = bag.new_file(profile)

    def run(self) -> None:
        for found in walk(self.data, self.summary):
            if isinstance(found, Damage):
                self._damage(found)
            else:
                self._record(found)
        for channel in self.channels:
            self._channel(channel)
        self._count_lost()

    def _record(self, found: Record) -> None:
        if found.repaired:
            self.bag.repairs.append(f"{self.name}, byte {found.offset}: {found.repaired}; its CRC vouches for the chunk")
        if found.opcode == Opcode.MESSAGE_INDEX:
            self._indexed(found)
            return
        self.bad_chunk = None
        if found.opcode == Opcode.CHUNK:
            self._chunk(found)
        elif found.opcode == Opcode.MESSAGE:
            self._messages(found.messages(), self.verified)
        elif found.opcode == Opcode.ATTACHMENT:
            self._attachment(found)
        elif found.opcode == Opcode.METADATA:
            self._metadata(found)
        elif found.opcode == Opcode.DATA_END:
            self.in_summary = True
        elif found.opcode > 0x0F:
            reason = f"a record of the private kind {found.opcode:#x}, which nobody else knows, is left out"
            self._lose(found.offset, found.end, reason, 0)

    def _chunk(self, found: Record) -> None:
        try:
            messages = list(found.messages())  # all of them, before the first is taken
        except DamagedError as error:
            self.bag.lost_chunks += 1
            self._lose(found.offset, found.end, f"{error}; the chunk is left out", None)
            self.bad_chunk = len(self.bag.places) - 1
            return
        self._messages(messages, bool(found.chunk().crc))

    def _messages(self, messages: Iterable[Message], verified: bool) -> int:
        """Take messages; returns how many were of a known channel."""
        count = 0
        for message in messages:
            channel = self._channel(message.channel)
            if channel is None:
                self.unknown_channels[message.channel] += 1
                continue
            self.out.add_message(channel, message.sequence, message.log_time_ns, message.publish_time_ns, message.data)
            self.kept[message.channel] += 1
            self._follow(self.bag.topics[channel.record.topic], message.sequence)
            count += 1
        self.bag.unverified += 0 if verified else count
        return count

    def _follow(self, topic: _Topic, sequence: int) -> None:
        """Our own writer counts each topic's messages from 0."""
        topic.kept += 1
        if self.counted:
            expected = topic.next_sequence if topic.next_sequence is not None else 0 if self.bag.from_start else sequence
            topic.gaps += max(0, sequence - expected)
            topic.next_sequence = sequence + 1

    def _channel(self, number: int) -> McapChannel | None:
        """The channel in the new file; None if no record of the damaged one defines it."""
        if number not in self.written:
            record = self.channels.get(number)
            self.written[number] = self._write_channel(record) if record is not None else None
        return self.written[number]

    def _write_channel(self, record: Channel) -> McapChannel:
        schema = self.schemas.get(record.schema_id)
        told = self.bag.told_topics.get(record.topic, {})
        told_type, told_hash = told.get("type", ""), told.get("type_description_hash", "")
        if schema is None and record.schema_id:
            hint = f"; metadata.yaml says {told_type}" if told_type else ""
            self.bag.repairs.append(f"{self.name}: the definition of topic {record.topic} is lost{hint}")
            schema = Schema(id=record.schema_id, name=told_type, encoding="", data=b"")
        if schema is not None and schema.id not in self.out.schemas:
            self.out.add_schema(schema.name, schema.encoding, schema.data, schema.id)
        type_name, type_hash = schema.name if schema is not None else told_type, record.metadata.get("topic_type_hash", told_hash)
        self.bag.topics.setdefault(record.topic, _Topic(type_name, _qos(record), type_hash, record.message_encoding))
        return self.out.add_channel(record.topic, record.message_encoding, record.schema_id, record.metadata, record.id)

    def _attachment(self, found: Record) -> None:
        try:
            attachment = found.parsed()
        except DamagedError as error:
            self._lose(found.offset, found.end, f"{error}; the attachment is left out", 0)
            return
        assert isinstance(attachment, Attachment)
        self.out.add_attachment(attachment.name, attachment.media_type, attachment.data, attachment.create_time, attachment.log_time)
        self.bag.n_attachments += 1

    def _metadata(self, found: Record) -> None:
        record = found.parsed()
        assert isinstance(record, Metadata)
        if record.name != RECORD_NAME:
            self.out.add_metadata(record.name, record.metadata)
            return
        metadata = parse_record(record.metadata)
        self.bag.custom_data |= metadata.get("custom_data") or {}
        self.bag.ros_distro = metadata.get("ros_distro") or self.bag.ros_distro

    def _indexed(self, found: Record) -> None:
        """The index of a chunk that was left out tells what was in it."""
        if self.bad_chunk is None:
            return
        channel, entries = found.message_index()
        self.lost[channel] += len(entries)
        place = self.bag.places[self.bad_chunk]
        self.bag.places[self.bad_chunk] = replace(place, messages=(place.messages or 0) + len(entries))

    def _damage(self, damage: Damage) -> None:
        kind = self.data[damage.offset] if damage.offset < len(self.data) else None
        is_index = self.in_summary or kind == Opcode.MESSAGE_INDEX
        is_chunk = not is_index and (kind == Opcode.CHUNK or damage.offset in self.chunk_places)
        reason, messages = damage.reason, 0 if is_index or damage.offset == 0 else None
        if damage.rest is not None:
            count = self._messages(damage.rest.messages_of_part(), False)
            reason += f", in a chunk, of which {count} messages could still be read"
        if is_index and damage.end > damage.offset:
            reason += "; only an index is concerned, which is made anew"
        self.bag.lost_chunks += is_chunk
        self._lose(damage.offset, damage.end, reason, messages)
        self.bad_chunk = len(self.bag.places) - 1 if is_chunk else None

    def _lose(self, offset: int, end: int, reason: str, messages: int | None) -> None:
        self.bag.places.append(LostPlace(self.name, offset, end - offset, reason, messages))

    def _count_lost(self) -> None:
        """What this file is known to have lost, by topic."""
        if self.unknown_channels:
            count = sum(self.unknown_channels.values())
            self._lose(0, 0, f"messages of channels {sorted(self.unknown_channels)}, which no record of the file defines", count)
        statistics = self.summary.statistics if self.summary is not None else None
        if statistics is not None:
            expected = statistics.channel_message_counts
            self.lost = Counter({number: max(0, count - self.kept[number]) for number, count in expected.items()})
        for number, count in self.lost.items():
            channel = self.written.get(number)
            if channel is not None:
                self.bag.topics[channel.record.topic].lost += count


def _data_is_whole(data: memoryview, summary_start: int) -> bool:
    """Whether the CRC of all before the summary vouches for it."""
    crc = int.from_bytes(data[summary_start - 4 : summary_start], "little")
    return crc != 0 and crc == crc_of(data, summary_start - 13)


def _qos(channel: Channel) -> list:
    with suppress(ValueError):
        return parse_qos(channel.topic, channel.metadata.get("offered_qos_profiles", ""))
    return []
