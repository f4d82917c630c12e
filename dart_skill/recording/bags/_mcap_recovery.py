"""What is left of an MCAP file, and of several that stand one after another in one.

Kept is what can be vouched for or at least read: every chunk whose CRC fits its content, messages
outside chunks, attachments and metadata, and of a chunk that was cut off the messages that its
decompressor still gives.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from functools import cached_property
from zlib import crc32

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema

from dart_skill.recording.bags._files import plain_message
from dart_skill.recording.bags._known_types import (
    Decoder,
    installed_definition,
    schema_of,
    type_of_hash,
)
from dart_skill.recording.bags._metadata import RECORD_NAME, full_name, parse_record
from dart_skill.recording.bags._recovered_bag import (
    LAST_TIME_NS,
    OWN_LIBRARY,
    TOGETHER,
    FileRecovery,
    RecoveredBag,
    grouped_by_channel,
)
from dart_skill.recording.mcap import (
    Chunk,
    Damage,
    DamagedError,
    McapChannel,
    McapFile,
    Message,
    Record,
    Summary,
    all_definitions,
    belongs,
    crc_of,
    data_end_before,
    definitions_in,
    extents,
    parse_header,
    read_summary,
    walk,
)

SMALLEST_MESSAGE = 31
"""A shorter place held none [bytes]."""
ROS_ENCODINGS = ("ros2msg", "ros2idl")
"""Encodings of definitions, as rosbag2 writes them."""


def recover_mcap(bag: RecoveredBag, name: str, data: memoryview) -> None:
    """Take all that can be read of a file into the new bag.

    Parameters
    ----------
    name
        Of the file.
    data
        Its bytes.
    """
    bag.n_bytes += len(data)
    parts: list[_McapRecovery] = []
    for number, (begin, end) in enumerate(extents(data)):
        parts.append(
            _McapRecovery(bag, name, data[begin:end], begin, number, parts[-1] if parts else None)
        )
    marks: set[int] = set()  # of what stands there twice that counts which is in a whole file
    for part in parts if any(part.summary is None for part in parts) else ():
        marks |= part.marks() if part.summary is not None else set()
    for part in parts:
        part.is_one_of_several = len(parts) > 1
        part.run(marks)
    kept_marks = set[int]().union(*(part.kept_marks for part in parts))
    for part in parts:
        part.count_lost(kept_marks)
    if len(parts) > 1:
        _tell_parts(bag, name, parts)


def _tell_parts(bag: RecoveredBag, name: str, parts: list[_McapRecovery]) -> None:
    """Tell what belongs to which of several files in one."""
    bag.note(f"{name} is {len(parts)} files in one:")
    known: list[_McapRecovery] = []
    for part in parts:
        same = next(
            (one for one in known if len(one.data) == len(part.data) and one.crc == part.crc), None
        )
        again = (
            f", which are those of {same.begin} to {same.end} again, byte for byte"
            if same is not None
            else ""
        )
        where = f", now in {part.out.path.name}" if part.out is not None else ""
        bag.note(f"bytes {part.begin} to {part.end} hold {part.count} messages{where}{again}")
        known.append(part)


class _McapRecovery(FileRecovery):
    """One file on its way into the new bag.

    begin: where it begins in the file that it stands in [bytes].
    number: which of the files there it is.
    before: the one before it.
    """

    def __init__(
        self,
        bag: RecoveredBag,
        name: str,
        data: memoryview,
        begin: int,
        number: int,
        before: _McapRecovery | None,
    ):
        super().__init__(bag, name)
        self.data, self.begin, self.number = data, begin, number
        self.end = begin + len(data)
        self.count, self.is_one_of_several = 0, False
        self.summary: Summary | None = None
        self.kept: Counter[int] = Counter()
        self.lost: Counter[int] = Counter()
        self.unknown_channels: Counter[int] = Counter()
        self.undecodable: Counter[int] = Counter()  # by channel
        self.loose: list[Message] = []  # outside chunks, not judged yet
        self.chunks: set[int] = set()  # marks of those so far
        self.repeated: list[int] = []  # where chunks stand again
        self.found_at: set[int] = set()  # where chunks stand that the summary names
        self.last: list[Message] | None = (
            None  # of the chunk before, as long as its message indexes come
        )
        self.kept_marks: set[int] = set()  # of messages of a channel in a chunk
        # places of chunks that were left out, and what their indexes say
        self.claims: list[tuple[int, tuple[int, int, int]]] = []
        self.n_wrong_indexes = self.n_foreign = 0
        self.in_summary, self.verified, self.is_changed = False, False, False
        self.n_unverified = 0
        self.bad_chunk: int | None = (
            None  # which of the bag's places it is, if the chunk before was left out
        )
        profile = self._read_ends()
        self.chunk_places: set[int] = (
            {chunk.chunk_start_offset for chunk in self.summary.chunks}
            if self.summary is not None
            else set()
        )
        self._read_definitions()
        self._inherit(before)
        self.profile = (
            "ros2"
            if self.channels
            and all(one.message_encoding == "cdr" for one in self.channels.values())
            else profile
        )
        if profile != self.profile:
            self.repair(
                f"the profile is 'ros2', as that of its messages is, and no longer '{profile}'"
            )
        self.decoder = Decoder(self.schemas.values())
        # by number of the schema, of types that the file defines in several ways
        self.decoders: dict[int, Decoder] = {}

    def _read_ends(self) -> str:
        """Take header and summary; returns the profile."""
        try:
            header, _ = parse_header(self.data)
            profile = header.profile
            self.counted = header.library == OWN_LIBRARY
        except DamagedError:
            profile = "ros2"
            self.counted = False
        try:
            summary = read_summary(self.data)
            if summary is not None and not belongs(self.data, summary):
                self.repair(
                    "its summary is none of this file, or agrees with no chunk of it: made anew"
                )
            else:
                self.summary = summary
                end = data_end_before(self.data, summary.start) if summary is not None else None
                if end is not None and (
                    told := int.from_bytes(self.data[end + 9 : end + 13], "little")
                ):
                    self.verified = told == crc_of(self.data, end)
                    self.is_changed = not self.verified
        except DamagedError:  # the walk comes to it
            pass
        return profile

    def _read_definitions(self) -> None:
        """Take schemas and channels; of those for which no CRC vouches, such as make sense."""
        found = all_definitions(self.data, self.summary)
        self.schemas, self.channels = found.best()
        for (kind, number), records in found.others.items():
            if kind is Schema and (kind, number) not in found.vouched:
                self.schemas[number] = self._sensible(
                    [one for one in records if isinstance(one, Schema)]
                )
        for channel in self.channels.values():
            if (
                channel.schema_id
                and channel.schema_id not in self.schemas
                and (lost := self._lost_schema(channel)) is not None
            ):
                self.schemas[channel.schema_id] = lost

    def _sensible(self, schemas: list[Schema]) -> Schema:
        """The first of several for one number that can be parsed, or that which is installed here."""
        for one in schemas:
            if (
                one.encoding not in ROS_ENCODINGS
                or full_name(one.name) not in Decoder([one]).unknown
            ):
                return one
        text = installed_definition(schemas[0].name)
        done = (
            "that which is installed here is in its place"
            if text
            else "it is left out, and its messages can be read raw"
        )
        self.repair(f"the definition of {schemas[0].name} is damaged: {done}")
        return schema_of(schemas[0].name, "ros2msg", text, schemas[0].id)

    def _lost_schema(self, channel: Channel) -> Schema | None:
        """The definition of a topic whose record is lost, if the hash of its type or metadata.yaml
        tell which it is.
        """
        told = self.bag.told_topics.get(channel.topic, {})
        digest = channel.metadata.get("topic_type_hash") or told.get("type_description_hash", "")
        name = type_of_hash(digest) or told.get("type", "")
        text = installed_definition(name) if name else ""
        if not text:
            return None
        where = f"{self.name}: the definition of topic {channel.topic} is lost"
        self.bag.repairs.append(
            f"{where}: that of {name}, which is installed here, is in its place"
        )
        return schema_of(name, "ros2msg", text, channel.schema_id)

    def _inherit(self, before: _McapRecovery | None) -> None:
        """What only the file before this one in the same file defines: it may be the same
        recording, and the head of this one lost.
        """
        self.own = set(self.channels)
        if before is None:
            return
        self.schemas = before.schemas | self.schemas
        for number, channel in before.channels.items():
            if self.schemas.get(channel.schema_id) == before.schemas.get(channel.schema_id):
                self.channels.setdefault(number, channel)

    @cached_property
    def crc(self) -> int:
        """The CRC-32 of all its bytes."""
        return crc_of(self.data, len(self.data))

    def marks(self) -> set[int]:
        """What tells its chunks from others."""
        found = (
            one
            for one in walk(self.data, self.summary)
            if isinstance(one, Record) and one.opcode == Opcode.CHUNK
        )
        return {_chunk_mark(one.chunk()) for one in found}

    def run(self, marks: set[int]) -> None:
        """Take all that there is. marks: of chunks that other files in the same file have."""
        self.marks_elsewhere = marks | self.bag.chunks_before
        self.n_places_before = len(self.bag.places)
        self.bag.unpacked.before = self.begin
        # whether they are one recording or several is unknown
        self.counted = self.counted and not self.is_one_of_several
        for found in walk(self.data, self.summary, self.bag.unpacked):
            if isinstance(found, Damage):
                self._damage(found)
            else:
                self._record(found)
        self._take_loose()
        for channel in self.channels:
            if channel in self.own:
                self._channel(channel)
        self.bag.chunks_before |= self.chunks
        self._tell_repairs()
        self.n_places = len(self.bag.places)

    def _record(self, found: Record) -> None:
        if found.repaired:
            place = f"{self.name}, byte {self.begin + found.offset}"
            self.bag.repairs.append(f"{place}: {found.repaired}; its CRC vouches for the chunk")
        if found.opcode == Opcode.MESSAGE_INDEX:
            self._indexed(found)
            return
        self._end_of_indexes()
        if found.opcode == Opcode.MESSAGE:
            self.in_summary = False
            self.loose += found.messages()
            if len(self.loose) >= TOGETHER or found.end - found.offset > 2**20:
                self._take_loose()
            return
        self._take_loose()
        if found.opcode == Opcode.CHUNK:
            self.in_summary = False
            self._chunk(found)
        elif found.opcode == Opcode.ATTACHMENT:
            self._attachment(found)
        elif found.opcode == Opcode.METADATA:
            self._metadata(found)
        elif found.opcode == Opcode.DATA_END:
            self.in_summary = True
        elif found.opcode > 0x0F:
            reason = (
                f"a record of the private kind {found.opcode:#x}, which nobody else knows, is"
                " left out"
            )
            was_message = (
                found.opcode & 0x7F == Opcode.MESSAGE
                and found.end - found.offset >= SMALLEST_MESSAGE
            )
            self._lose(found.offset, found.end, reason, None if was_message else 0)

    def _take_loose(self) -> None:
        if self.loose:
            self._messages(self.loose, self.verified)
            self.loose = []

    def _chunk(self, found: Record) -> None:
        chunk = found.chunk()
        try:
            raw = chunk.unpack()
            messages = list(chunk.messages_in(raw))  # all of them, before the first is taken
            if chunk.crc and sum(
                len(message.data) for message in messages
            ) + SMALLEST_MESSAGE * len(messages) < len(raw):
                self._define(raw, chunk)
        except DamagedError as error:
            self.bag.lost_chunks += 1
            self._lose(found.offset, found.end, f"{error}; the chunk is left out", None)
            self.bad_chunk = len(self.bag.places) - 1
            return
        self.found_at.add(found.offset)
        mark = _chunk_mark(chunk)
        if found.offset not in self.chunk_places and (
            mark in self.chunks or mark in self.marks_elsewhere
        ):
            self.repeated.append(self.begin + found.offset)
            self.kept.update(message.channel for message in messages)
            return
        self.chunks.add(mark)
        if self.summary is None or self.is_one_of_several:
            self._mark_kept(messages)
        self._messages(messages, bool(chunk.crc))
        self.last = messages

    def _mark_kept(self, messages: list[Message]) -> None:
        """Remember what the index of a chunk would say: another place may have it, too, with
        nothing else.
        """
        times: dict[int, list[tuple[int, int]]] = {}
        for message in messages:
            times.setdefault(message.channel, []).append((message.log_time_ns, message.place))
        self.kept_marks |= {_mark(channel, entries)[0] for channel, entries in times.items()}

    def _define(self, raw: bytes, chunk: Chunk) -> None:
        """Definitions in a chunk with a CRC count from there on: a number may mean another topic
        than before.
        """
        for record in definitions_in(raw, chunk.most_records):
            known: dict = self.schemas if isinstance(record, Schema) else self.channels
            if known.get(record.id) == record:
                continue
            if record.id in known:
                self.n_foreign += 1
                concerned = [
                    number
                    for number, one in self.channels.items()
                    if record.id in (number, one.schema_id)
                ]
                for number in concerned:
                    self.written.pop(number, None)
            known[record.id] = record
            self.written = {
                number: channel for number, channel in self.written.items() if channel is not None
            }

    def _messages(self, messages: list[Message], verified: bool) -> int:
        """Take messages; returns how many were of a known channel, and are messages at all."""
        count, messages = 0, messages if verified else self._judged(messages)
        for message in messages:
            channel = self._channel(message.channel)
            if channel is None:
                (self.unknown_channels if verified else self.undecodable)[message.channel] += 1
                continue
            self.write(channel, *message[2:])
            self.kept[message.channel] += 1
            self._follow(channel.record.topic, message.sequence, verified)
            count += 1
        self.count += count
        self.n_unverified += 0 if verified else count
        self.bag.unverified += 0 if verified else count
        return count

    def _judged(self, messages: list[Message]) -> list[Message]:
        """Those that are messages of their type, of some that no CRC vouches for."""
        bad = {k for k, message in enumerate(messages) if message.log_time_ns > LAST_TIME_NS}
        places = grouped_by_channel(message.channel for message in messages)
        for number, its in places.items():
            channel = self.channels.get(number)
            schema = (
                self.schemas.get(channel.schema_id)
                if channel is not None and channel.message_encoding == "cdr"
                else None
            )
            if channel is not None and schema is not None:
                payloads = [messages[index].data for index in its]
                good = self._decoder(schema).decodable(
                    schema.name, [plain_message(payload) for payload in payloads]
                )
                bad |= {index for index, is_good in zip(its, good, strict=True) if not is_good}
        self.undecodable.update(messages[index].channel for index in bad)
        return (
            [message for index, message in enumerate(messages) if index not in bad]
            if bad
            else messages
        )

    def _decoder(self, schema: Schema) -> Decoder:
        """What decodes messages of a type: one of its own where the file defines it in several
        ways.
        """
        name, others = (
            full_name(schema.name),
            [one for one in self.schemas.values() if one is not schema],
        )
        others = [one for one in others if full_name(one.name) != name or one.data == schema.data]
        if len(others) == len(self.schemas) - 1:
            return self.decoder
        if schema.id not in self.decoders:
            self.decoders[schema.id] = Decoder([*others, schema])
        return self.decoders[schema.id]

    def _follow(self, name: str, sequence: int, verified: bool) -> None:
        """Our own writer counts each topic's messages from 0."""
        topic = self.bag.topics[name]
        if self.counted:
            topic.counted += 1
            if verified:
                if topic.first is None:
                    topic.first = 0 if self.bag.from_start else sequence
                topic.top = max(topic.top, sequence)

    def _channel(self, number: int) -> McapChannel | None:
        """The channel in the new file; None if no record of the damaged one defines it."""
        if number not in self.written:
            record = self.channels.get(number)
            if record is not None and number not in self.own:
                self.bag.note(
                    f"{self.name}: what topic channel {number} is, only the file before in it"
                    f" tells: {record.topic}"
                )
            self.written[number] = self._write_channel(record) if record is not None else None
        return self.written[number]

    def _file(self) -> McapFile:
        if self.out is None:
            self.out = self.bag.new_file(self.profile)
        return self.out

    def _write_channel(self, record: Channel) -> McapChannel:
        out, schema = self._file(), self.schemas.get(record.schema_id)
        told = self.bag.told_topics.get(record.topic, {})
        told_type, told_hash = told.get("type", ""), told.get("type_description_hash", "")
        if schema is None and record.schema_id:
            hint = f"; metadata.yaml says {told_type}" if told_type else ""
            self.repair(f"the definition of topic {record.topic} is lost{hint}")
            schema = Schema(id=record.schema_id, name=told_type, encoding="", data=b"")
        number = self._write_schema(out, schema) if schema is not None else 0
        type_name, type_hash = (
            schema.name if schema is not None else told_type,
            record.metadata.get("topic_type_hash", told_hash),
        )
        encoding = record.message_encoding
        channel = self.add_channel(
            record.topic,
            type_name,
            encoding,
            number,
            record.metadata,
            type_hash,
            _number(record.id, out.channels),
        )
        if encoding != "cdr":
            self.bag.note(
                f"topic {record.topic} is encoded as '{encoding}', not as cdr: its messages are"
                " kept as they are, to be read raw"
            )
        return channel

    def _write_schema(self, out: McapFile, schema: Schema) -> int:
        """Its number in the new file."""
        for number, written in out.schemas.items():
            if (written.name, written.encoding, written.data) == (
                schema.name,
                schema.encoding,
                schema.data,
            ) and number == schema.id:
                return number
        return out.add_schema(
            schema.name, schema.encoding, schema.data, _number(schema.id, out.schemas)
        )

    def _attachment(self, found: Record) -> None:
        try:
            attachment = found.parsed()
        except DamagedError as error:
            self._lose(found.offset, found.end, f"{error}; the attachment is left out", 0)
            return
        assert isinstance(attachment, Attachment)
        out = self._file()
        out.add_attachment(
            attachment.name,
            attachment.media_type,
            attachment.data,
            attachment.create_time,
            attachment.log_time,
        )
        self.bag.n_attachments += 1

    def _metadata(self, found: Record) -> None:
        record = found.parsed()
        assert isinstance(record, Metadata)
        if record.name != RECORD_NAME:
            self._file().add_metadata(record.name, record.metadata)
            return
        self.take_metadata(parse_record(record.metadata))

    def _indexed(self, found: Record) -> None:
        """The index of a chunk that was left out tells what was in it; that of another one is
        compared with it.
        """
        channel, entries = found.message_index()
        if self.bad_chunk is not None:
            self.claims.append((self.bad_chunk, _mark(channel, entries)))
        elif self.last is not None:
            content = [
                (message.log_time_ns, message.place)
                for message in self.last
                if message.channel == channel
            ]
            self.n_wrong_indexes += entries != content and sorted(entries) != sorted(content)

    def _end_of_indexes(self) -> None:
        self.bad_chunk = self.last = None

    def _damage(self, damage: Damage) -> None:
        self._take_loose()
        kind = self.data[damage.offset] if damage.offset < len(self.data) else None
        is_index = self.in_summary or (
            kind == Opcode.MESSAGE_INDEX and self._is_as_long_as_it_says(damage)
        )
        is_chunk = not is_index and (kind == Opcode.CHUNK or damage.offset in self.chunk_places)
        size = damage.end - damage.offset
        is_magic = (
            damage.offset == 0
            and damage.end == 8
            and bytes(self.data[8:9]) == bytes([Opcode.HEADER])
        )
        holds_none = is_index or is_magic or self._is_empty_end(damage)
        reason, messages = damage.reason, 0 if holds_none else None
        if damage.rest is not None:
            count = self._messages(list(damage.rest.messages_of_part()), False)
            reason += f", in a chunk, of which {count} messages could still be read"
        if is_index and damage.end > damage.offset:
            reason += "; only an index is concerned, which is made anew"
        self.bag.lost_chunks += is_chunk
        self._lose(damage.offset, damage.end, reason, messages)
        if "the rest is left out" in damage.reason:
            self.bag.n_not_looked_at += size
        self._end_of_indexes()
        self.bad_chunk = len(self.bag.places) - 1 if is_chunk else None

    def _is_as_long_as_it_says(self, damage: Damage) -> bool:
        """Whether the next record begins where the length of a damaged one says."""
        length = int.from_bytes(self.data[damage.offset + 1 : damage.offset + 9], "little")
        return damage.end == damage.offset + 9 + length

    def _is_empty_end(self, damage: Damage) -> bool:
        """Whether it is a part without head that holds nothing but zero bytes, behind a file that
        is whole.
        """
        return (
            self.number > 0
            and damage.end >= len(self.data)
            and not any(self.data[damage.offset : damage.end])
        )

    def _lose(self, offset: int, end: int, reason: str, messages: int | None) -> None:
        self.bag.lose(self.name, self.begin + offset, self.begin + end, reason, messages)

    def _tell_repairs(self) -> None:
        """What was wrong and cost nothing."""
        if self.repeated:
            count = len(self.repeated)
            self.repair(
                f"{count} chunks that were there already stand in it again, the first"
                f" at byte {self.repeated[0]}: taken once"
            )
        if self.n_wrong_indexes:
            self.repair(
                f"{self.n_wrong_indexes} message indexes do not say where the"
                " messages of their chunk are: made anew"
            )
        if self.n_foreign:
            self.repair(
                f"{self.n_foreign} numbers of topics or types change their meaning in"
                " it, where they are defined anew"
            )
        if wrong := self.chunk_places - self.found_at:
            lost = {place.offset - self.begin for place in self.bag.places[self.n_places_before :]}
            if wrong - lost:
                self.repair(
                    f"the summary names {len(wrong - lost)} chunks that are not where"
                    " it says: made anew"
                )

    def _count_claims(self, kept_marks: set[int]) -> None:
        """What the indexes of chunks say that were left out, if the same is not in the new bag
        from another place.
        """
        for index, (mark, channel, count) in self.claims:
            place, known = self.bag.places[index], mark in kept_marks
            kept_marks.add(mark)
            self.bag.places[index] = replace(
                place, messages=(place.messages or 0) + (0 if known else count)
            )
            self.lost[channel] += 0 if known else count

    def count_lost(self, kept_marks: set[int]) -> None:
        """What this file is known to have lost, by topic. kept_marks: of what was kept of it and
        of others in the same file.
        """
        self._count_claims(kept_marks)
        if self.unknown_channels:
            count = sum(self.unknown_channels.values())
            self._lose(
                0,
                0,
                f"messages of channels {sorted(self.unknown_channels)}, which no record of the"
                " file defines",
                count,
            )
        for number, count in self.undecodable.items():
            topic = (
                self.channels[number].topic
                if number in self.channels
                else f"the unknown channel {number}"
            )
            self._lose(
                0,
                0,
                f"{count} records on {topic} for which no CRC vouches are no messages of its type,"
                " and are left out",
                None,
            )
        statistics = (
            self.summary.statistics if self.summary is not None and self.summary.has_crc else None
        )
        if statistics is None:
            self.bag.is_exact = False
        else:
            expected = statistics.channel_message_counts
            self.lost = Counter(
                {number: max(0, count - self.kept[number]) for number, count in expected.items()}
            )
            if sum(self.kept.values()) >= statistics.message_count and not self.lost.total():
                self.bag.nothing_unknown(self.n_places_before, self.n_places)
        if self.is_changed and self.n_unverified:
            reason = "the CRC of all before the summary does not fit: one of the messages"
            self._lose(
                0, 0, f"{reason} without their own ({self.n_unverified}) may have changed", None
            )
        for number, count in self.lost.items():
            channel = self.written.get(number)
            if channel is not None:
                self.bag.topics[channel.record.topic].lost += count


def _chunk_mark(chunk: Chunk) -> int:
    """What tells a chunk from others."""
    return hash((chunk.start_ns, chunk.end_ns, chunk.size, chunk.crc or crc32(chunk.records)))


def _mark(channel: int, entries: list[tuple[int, int]]) -> tuple[int, int, int]:
    """What tells the messages of a channel in a chunk from others; the channel; and how many they
    are.
    """
    return hash((channel, *sorted(entries))), channel, len(entries)


def _number(wanted: int, taken: Iterable[int]) -> int:
    """The number of a schema or channel in the new file: its old one, or the next that is free."""
    taken = set(taken)
    return (
        wanted
        if wanted not in taken
        else next(number for number in range(1, 2**16) if number not in taken)
    )
