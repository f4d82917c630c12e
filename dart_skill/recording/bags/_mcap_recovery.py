"""What is left of an MCAP file, and of several that stand one after another in one.

Kept is what can be vouched for or at least read: every chunk whose CRC fits its content, messages
outside chunks, attachments and metadata, and of a chunk that was cut off the messages that its
decompressor still gives.
"""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from dataclasses import replace
from zlib import crc32

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from dart_skill.recording.bags._definitions import embedded_types
from dart_skill.recording.bags._recovered_bag import (
    OWN_LIBRARY,
    TOGETHER,
    FileRecovery,
    RecoveredBag,
    installed_schema,
    type_of_hash,
)
from dart_skill.recording.bags.metadata import RECORD_NAME, definition_of, parse_record
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

ROS_ENCODINGS = ("ros2msg", "ros2idl")
"""Encodings of definitions, as rosbag2 writes them."""
SMALLEST_MESSAGE = 31
"""Size of a message record without data; a shorter place held none [bytes]."""


def recover_mcap(bag: RecoveredBag, name: str, data: memoryview) -> None:
    """Take all that can be read of a file into the new bag.

    Parameters
    ----------
    name
        Of the file.
    data
        Its bytes.
    """
    n_before = bag.result.n_bytes
    bag.result.n_bytes += len(data)
    parts: list[_McapRecovery] = []
    for begin, end in extents(data):
        parts.append(_McapRecovery(bag, name, data[begin:end], begin, parts[-1:]))
    if any(part.summary is None for part in parts):
        # what stands there twice counts where the summary names it
        for part in parts:
            bag.chunk_marks |= part.marks()
    for part in parts:
        part.run(len(parts) > 1, n_before + part.begin)
    index_marks = set[int]().union(*(part.index_marks for part in parts))
    for part in parts:
        part.count_lost(index_marks)
    if len(parts) > 1:
        bag.note(f"{name} is {len(parts)} files in one:")
    crcs = [crc_of(part.data, len(part.data)) for part in parts] if len(parts) > 1 else []
    for part, crc in zip(parts, crcs, strict=False):
        same = parts[crcs.index(crc)]
        again = f", which are those of {same.begin} to {same.end} again, byte for byte"
        where = f", now in {part.out.path.name}" if part.out is not None else ""
        told = f"bytes {part.begin} to {part.end} hold {part.count} messages{where}"
        bag.note(told + (again if same is not part else ""))


class _McapRecovery(FileRecovery):
    """One file on its way into the new bag.

    begin: where it begins in the file that it stands in [bytes].
    before: the one before it in there, if there is one.
    """

    def __init__(
        self,
        bag: RecoveredBag,
        name: str,
        data: memoryview,
        begin: int,
        before: list[_McapRecovery],
    ):
        super().__init__(bag, name)
        self.data, self.begin, self.end = data, begin, begin + len(data)
        self.count = self._n_unverified = self._n_redefined = 0
        self._kept: Counter[int] = Counter()
        self._loose: list[Message] = []  # outside chunks, not judged yet
        self._found_at: set[int] = set()  # where chunks stand that the summary names
        self._repeated: list[int] = []  # where chunks stand again
        self._last: list[Message] | None = None  # of the chunk before, while its indexes come
        # of the bag's places the one of the chunk before, if that was left out
        self._bad_chunk: int | None = None
        # such places, and channel, number of messages and mark of an index of theirs
        self._claims: list[tuple[int, int, int, int]] = []
        self.index_marks: set[int] = set()  # of indexes of chunks that were kept
        self._n_wrong_indexes = 0
        self._chunk_places: set[int] = set()  # where the summary says that they are
        self._is_verified = self._is_changed = self._in_summary = False
        self.summary = self._read_ends()
        if self.summary is not None:
            self._chunk_places |= {chunk.chunk_start_offset for chunk in self.summary.chunks}
        self._read_definitions()
        self._own = set(self.channels)
        for one in before:
            # it may be the same recording, and the head of this file lost
            inherited = one.channels.items()
            self.schemas = one.schemas | self.schemas
            self.channels = {
                number: channel
                for number, channel in inherited
                if self.schemas.get(channel.schema_id) == one.schemas.get(channel.schema_id)
            } | self.channels
        encodings = {one.message_encoding for one in self.channels.values()}
        if self.profile != "ros2" and encodings == {"cdr"}:
            self.repair(
                "the profile is 'ros2', as that of its messages is, and no longer"
                f" '{self.profile}'"
            )
            self.profile = "ros2"

    def _read_ends(self) -> Summary | None:
        """Take the header; returns the summary, None where there is none that can be believed."""
        self._counts = False  # whether our own writer numbered the messages of each topic from 0
        with suppress(DamagedError):
            header, _ = parse_header(self.data)
            self.profile, self._counts = header.profile, header.library == OWN_LIBRARY
        try:
            summary = read_summary(self.data)
        except DamagedError:  # the walk comes to it
            return None
        if summary is not None and not belongs(self.data, summary):
            self.repair(
                "its summary is none of this file, or agrees with no chunk of it: made anew"
            )
            return None
        end = data_end_before(self.data, summary.start) if summary is not None else None
        told = int.from_bytes(self.data[end + 9 : end + 13], "little") if end else 0
        if told and end:
            self._is_verified = told == crc_of(self.data, end)
            self._is_changed = not self._is_verified
        return summary

    def _read_definitions(self) -> None:
        """Take schemas and channels; of those for which no CRC vouches, such as make sense."""
        vouched, others = all_definitions(self.data, self.summary)
        for key, found in (others | {key: [one] for key, one in vouched.items()}).items():
            kind, number = key
            if kind is Channel:
                self.channels[number] = found[0]
            else:
                self.schemas[number] = found[0] if key in vouched else self._sensible(found)
        for channel in self.channels.values():
            number, told = channel.schema_id, self.bag.told_topics.get(channel.topic, {})
            if not number or number in self.schemas:
                continue
            digest = channel.metadata.get("topic_type_hash") or told.get(
                "type_description_hash", ""
            )
            name = type_of_hash(digest) or told.get("type", "")
            lost = installed_schema(name, number) if name else None
            if lost is not None:
                self.schemas[number] = lost
                self.repair(
                    f"the definition of topic {channel.topic} is lost: that of {name}, which is"
                    " installed here, is in its place"
                )

    def _sensible(self, schemas: list[Schema]) -> Schema:
        """The first of several for one number that can be parsed, or that which is installed here."""
        for one in schemas:
            name, encoding, text = definition_of(one)
            is_known = encoding not in ROS_ENCODINGS
            if is_known or name not in embedded_types([(name, encoding, text)], None)[1]:
                return one
        name, number = schemas[0].name, schemas[0].id
        installed = installed_schema(name, number)
        done = "that which is installed here is in its place"
        if installed is None:
            done = "it is left out, and its messages can be read raw"
        self.repair(f"the definition of {name} is damaged: {done}")
        return installed or Schema(id=number, name=name, encoding="ros2msg", data=b"")

    def marks(self) -> set[int]:
        """What tells the chunks from others that its summary names."""
        return {
            _mark(found.chunk())
            for found in (walk(self.data, self.summary) if self.summary is not None else ())
            if isinstance(found, Record) and found.opcode == Opcode.CHUNK
        }

    def run(self, is_one_of_several: bool, n_before: int) -> None:
        """Take all that there is.

        Parameters
        ----------
        n_before
            Of bytes of the bag before this file.
        """
        bag = self.bag
        self._first_place = len(bag.result.places)
        # whether they are one recording or several is unknown
        self._counts = self._counts and not is_one_of_several
        for found in walk(self.data, self.summary, (n_before, bag.n_unpacked)):
            if isinstance(found, Damage):
                self._damage(found)
            elif found.opcode == Opcode.MESSAGE_INDEX:
                self._indexed(found)
            else:
                self._last = self._bad_chunk = None
                self._record(found)
        self._take_loose()
        for channel in self._own:
            self.channel(channel)
        self._tell_repairs()
        self._end_place = len(bag.result.places)

    def channel(self, number: int) -> McapChannel | None:
        if number not in self.written and number in self.channels and number not in self._own:
            self.bag.note(
                f"{self.name}: what topic channel {number} is, only the file before in it tells:"
                f" {self.channels[number].topic}"
            )
        return super().channel(number)

    def _record(self, found: Record) -> None:
        if found.repaired:
            self.bag.result.repairs.append(
                f"{self.name}, byte {self.begin + found.offset}: {found.repaired}; its CRC vouches"
                " for the chunk"
            )
        if found.opcode == Opcode.MESSAGE:
            self._in_summary = False
            self._loose += found.messages()
            if len(self._loose) >= TOGETHER or found.end - found.offset > 2**20:
                self._take_loose()
            return
        self._take_loose()
        if found.opcode == Opcode.CHUNK:
            self._in_summary = False
            self.bag.n_unpacked += found.chunk().size
            self._chunk(found)
        elif found.opcode == Opcode.ATTACHMENT:
            try:
                one = found.parsed()
            except DamagedError as error:
                self._lose(found, f"{error}; the attachment is left out", 0)
                return
            times = one.create_time, one.log_time
            self._file().add_attachment(one.name, one.media_type, one.data, *times)
            self.bag.result.n_attachments += 1
        elif found.opcode == Opcode.METADATA:
            record = found.parsed()
            if record.name == RECORD_NAME:
                self.bag.take_metadata(parse_record(record.metadata))
            else:
                self._file().add_metadata(record.name, record.metadata)
        elif found.opcode == Opcode.DATA_END:
            self._in_summary = True
        elif found.opcode > 0x0F:
            was_message = (
                found.opcode & 0x7F == Opcode.MESSAGE
                and found.end - found.offset >= SMALLEST_MESSAGE
            )
            self._lose(
                found,
                f"a record of the private kind {found.opcode:#x}, which is unknown, is left out",
                None if was_message else 0,
            )

    def _file(self) -> McapFile:
        self.out = self.out or self.bag.new_file(self.profile)
        return self.out

    def _take_loose(self) -> None:
        self._messages(self._loose, self._is_verified)
        self._loose = []

    def _chunk(self, found: Record) -> None:
        chunk = found.chunk()
        try:
            raw = chunk.unpack()
            messages = list(chunk.messages_in(raw))  # all of them, before the first is taken
            sizes = sum(SMALLEST_MESSAGE + len(message.data) for message in messages)
            if chunk.crc and sizes < len(raw):
                self._define(raw, chunk)
        except DamagedError as error:
            self.bag.result.lost_chunks += 1
            self._lose(found, f"{error}; the chunk is left out")
            self._bad_chunk = len(self.bag.result.places) - 1
            return
        self._found_at.add(found.offset)
        mark = _mark(chunk)
        if found.offset not in self._chunk_places and mark in self.bag.chunk_marks:
            self._repeated.append(self.begin + found.offset)
            self._kept.update(message.channel for message in messages)
            return
        self.bag.chunk_marks.add(mark)
        self._messages(messages, bool(chunk.crc))
        self._last = messages

    def _indexed(self, found: Record) -> None:
        """The index of a chunk that was left out tells what was in it; that of another one is
        compared with it.
        """
        channel, entries = found.message_index()
        mark = hash((channel, *entries))
        if self._bad_chunk is not None:
            self._claims.append((self._bad_chunk, channel, len(entries), mark))
        elif self._last is not None:
            messages = (one for one in self._last if one.channel == channel)
            self.index_marks.add(mark)
            self._n_wrong_indexes += sorted(entries) != sorted(
                (one.log_time_ns, one.place) for one in messages
            )

    def _define(self, raw: bytes, chunk: Chunk) -> None:
        """Definitions in a chunk with a CRC count from there on: a number may mean another topic
        than before.
        """
        for record in definitions_in(raw, chunk.most_records):
            known: dict = self.schemas if isinstance(record, Schema) else self.channels
            if known.get(record.id) == record:
                continue
            if record.id in known:
                self._n_redefined += 1
                for number, one in self.channels.items():
                    if record.id in (number, one.schema_id):
                        self.written.pop(number, None)
            known[record.id] = record
            self.written = {
                number: channel for number, channel in self.written.items() if channel is not None
            }

    def _messages(self, messages: list[Message], is_verified: bool) -> int:
        """Take messages; returns how many were of a known channel, and are messages at all."""
        count = 0
        for message in messages if is_verified else self.judged(messages):
            channel = self.write(message, is_verified)
            if channel is None:
                continue
            count += 1
            self._kept[message.channel] += 1
            if self._counts:
                topic = self.bag.topics[channel.record.topic]
                topic.counted += 1
                if is_verified:
                    if topic.first is None:
                        topic.first = 0 if self.bag.from_start else message.sequence
                    topic.top = max(topic.top, message.sequence)
        self.count += count
        self._n_unverified += 0 if is_verified else count
        return count

    def _damage(self, damage: Damage) -> None:
        self._take_loose()
        begin, end, reason = damage.offset, damage.end, damage.reason
        kind = self.data[begin] if begin < len(self.data) else None
        length = int.from_bytes(self.data[begin + 1 : begin + 9], "little")
        # the next record begins where its length says
        is_index = self._in_summary or (kind == Opcode.MESSAGE_INDEX and end == begin + 9 + length)
        is_magic = (begin, end) == (0, 8) and bytes(self.data[8:9]) == bytes([Opcode.HEADER])
        is_empty_end = self.begin > 0 and end >= len(self.data) and not any(self.data[begin:end])
        if damage.rest is not None:
            count = self._messages(list(damage.rest.messages_of_part()), False)
            reason += f", in a chunk, of which {count} messages could still be read"
        if is_index and end > begin:
            reason += "; only an index is concerned, which is made anew"
        is_chunk = not is_index and (kind == Opcode.CHUNK or begin in self._chunk_places)
        self.bag.result.lost_chunks += is_chunk
        self._lose(damage, reason, 0 if is_index or is_magic or is_empty_end else None)
        self._last = None
        self._bad_chunk = len(self.bag.result.places) - 1 if is_chunk else None
        if "the rest is left out" in damage.reason:
            self.bag.n_not_looked_at += end - begin

    def _lose(self, place: Record | Damage, reason: str, messages: int | None = None) -> None:
        begin, end = self.begin + place.offset, self.begin + place.end
        self.bag.lose(self.name, reason, messages, begin, end)

    def _tell_repairs(self) -> None:
        """What was wrong and cost nothing."""
        if self._repeated:
            self.repair(
                f"{len(self._repeated)} chunks that were there already stand in it again, the first"
                f" at byte {self._repeated[0]}: taken once"
            )
        if self._n_wrong_indexes:
            self.repair(
                f"{self._n_wrong_indexes} message indexes do not say where the messages of their"
                " chunk are: made anew"
            )
        if self._n_redefined:
            self.repair(
                f"{self._n_redefined} numbers of topics or types change their meaning in it, where"
                " they are defined anew"
            )
        lost = {place.offset - self.begin for place in self.bag.result.places[self._first_place :]}
        if wrong := self._chunk_places - self._found_at - lost:
            self.repair(
                f"the summary names {len(wrong)} chunks that are not where it says: made anew"
            )

    def count_lost(self, index_marks: set[int]) -> None:
        """What this file is known to have lost, by topic.

        Parameters
        ----------
        index_marks
            Of chunks that were kept, of this file and of others in the same: what a chunk held
            that was left out may be in the new bag from another place.
        """
        result, lost = self.bag.result, Counter[int]()
        for index, claimed, count, mark in self._claims:
            place, count = result.places[index], 0 if mark in index_marks else count
            index_marks.add(mark)
            result.places[index] = replace(place, messages=(place.messages or 0) + count)
            lost[claimed] += count
        self.tell_left_out()
        if self._is_changed and self._n_unverified:
            self.bag.lose(
                self.name,
                (
                    "the CRC of all before the summary does not fit: one of the messages without their"
                    f" own ({self._n_unverified}) may have changed"
                ),
            )
        statistics = self.summary and self.summary.has_crc and self.summary.statistics
        if statistics:
            lost = Counter(statistics.channel_message_counts) - self._kept
            if self._kept.total() >= statistics.message_count and not lost:
                its = slice(self._first_place, self._end_place)
                result.places[its] = [
                    replace(place, messages=place.messages or 0) for place in result.places[its]
                ]
        else:
            result.is_exact = False
        for number, count in lost.items():
            channel = self.written.get(number)
            if channel is not None:
                self.bag.topics[channel.record.topic].lost += count


def _mark(chunk: Chunk) -> int:
    """What tells a chunk from others."""
    return hash((chunk.start_ns, chunk.end_ns, chunk.size, chunk.crc or crc32(chunk.records)))
