"""The new bag that recovery makes, what is told of it, and the way of a damaged file into it, which
is the same for every kind of file.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

from mcap.records import Channel, Schema
from rosbags.typesys.store import Typestore

from dart_skill.recording.bags._definitions import embedded_types
from dart_skill.recording.bags.columns import Decoder
from dart_skill.recording.bags.files import part_number, plain_message, sync_folder
from dart_skill.recording.bags.messages import definition, shared_types, type_hash, types_for
from dart_skill.recording.bags.metadata import (
    RECORD_NAME,
    TopicMetadata,
    bag_metadata,
    definition_of,
    full_name,
    parse_qos,
    record_values,
    topics_of,
    write_metadata_file,
)
from dart_skill.recording.bags.reader import BagError
from dart_skill.recording.mcap import McapChannel, McapFile, Message

OWN_LIBRARY = "dart_skill"
LAST_TIME_NS = 2**63 - 1
"""Largest time of ROS [ns]."""
TOGETHER = 500
"""Messages without a CRC that are judged together."""
MOST_REASONS = 3
"""Most reasons that are told of a bag of which nothing is left."""


@dataclass(frozen=True)
class LostPlace:
    """A place of a file that is damaged or missing.

    Parameters
    ----------
    file
        Its name.
    offset, n_bytes
        Where it is.
    reason
        What is wrong there.
    messages
        How many were lost there; 0 for an index or the like; None if that is not known.
    """

    file: str
    offset: int
    n_bytes: int
    reason: str
    messages: int | None

    def __str__(self) -> str:
        count = "an unknown number of" if self.messages is None else self.messages
        return (
            f"{self.file}, byte {self.offset}, {self.n_bytes} bytes: {self.reason}; {count}"
            " messages lost"
        )


@dataclass
class Recovery:
    """A recovered bag: what is in it and what is not.

    Parameters
    ----------
    path, files
        The new bag and the names of its files.
    messages
        Kept, by topic.
    lost
        Messages by topic, as far as statistics, metadata.yaml or gaps in sequence numbers tell;
        what a recorder had not handed over yet when it stopped leaves no trace.
    is_exact
        Whether statistics that are vouched for count all messages of all files; else `lost` is the
        least that is lost.
    places
        What is damaged or missing.
    repairs
        Damage without loss.
    notes
        What else there is to know, as that there were several files in one.
    unverified
        Kept messages for which no CRC vouches.
    lost_chunks
        How many were left out.
    n_bytes, n_looked_at
        Bytes of all files, and how many of them were looked at.
    start_ns, end_ns
        Log times of the first and last message that was kept; None without messages.
    n_attachments
        How many were kept.
    custom_data
        Of the new bag.
    """

    path: Path
    files: list[str] = field(default_factory=list)
    messages: dict[str, int] = field(default_factory=dict)
    lost: dict[str, int] = field(default_factory=dict)
    is_exact: bool = True
    places: list[LostPlace] = field(default_factory=list)
    repairs: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    unverified: int = 0
    lost_chunks: int = 0
    n_bytes: int = 0
    n_looked_at: int = 0
    start_ns: int | None = None
    end_ns: int | None = None
    n_attachments: int = 0
    custom_data: dict[str, str] = field(default_factory=dict)

    @property
    def lost_bytes(self) -> int:
        """Bytes of damaged places that held messages, or may have."""
        return sum(place.n_bytes for place in self.places if place.messages != 0)

    @property
    def is_complete(self) -> bool:
        """Whether all was looked at, no message is known to be lost, and no place may have held
        one.
        """
        is_kept = not self.lost and all(place.messages == 0 for place in self.places)
        return is_kept and self.n_looked_at == self.n_bytes

    def __str__(self) -> str:
        least = "" if self.is_exact or self.is_complete else "at least "
        return (
            f"{sum(self.messages.values())} messages kept, {least}{sum(self.lost.values())} known"
            f" to be lost, {self.lost_chunks} chunks and {self.lost_bytes} bytes left out"
        ) + (
            f", {self.unverified} kept without a CRC that vouches for them"
            if self.unverified
            else ""
        )


@dataclass
class RecoveredTopic(TopicMetadata):
    """A topic of the new bag, and how many of its messages are there and are lost.

    * lost: messages, as the statistics of the files tell.
    * first, top, counted: sequence numbers from the first to the highest that a recorder which
      counts wrote, and messages since.
    """

    lost: int = 0
    first: int | None = None
    top: int = -1
    counted: int = 0


class RecoveredBag:
    """The bag that is being made.

    Parameters
    ----------
    path
        Of the damaged one.
    output
        Folder of the new one, which is there.
    told
        What the metadata.yaml of the damaged one says.

    Attributes
    ----------
    result
        What is told of it.
    """

    def __init__(self, path: Path, output: Path, told: dict):
        self.path, self.output = path, output
        self.result = Recovery(output, custom_data=dict(told.get("custom_data") or {}))
        # and not a later part of a split bag
        self.from_start = path.is_dir() or part_number(path)[1] <= 0
        self.topics: dict[str, RecoveredTopic] = {}
        self.files: list[McapFile] = []
        self.n_not_looked_at = self.n_unpacked = 0  # bytes
        self.chunk_marks: set[int] = set()  # of chunks that are there already
        self.ros_distro = told.get("ros_distro") or ""
        self.told_topics = topics_of(told)
        self._told_counts = {
            name: topic["message_count"] or 0 for name, topic in self.told_topics.items()
        }

    def new_file(self, profile: str) -> McapFile:
        """Begin the next file."""
        path = self.output / f"{self.output.name}_{len(self.files)}.mcap"
        self.files.append(McapFile(path, profile=profile, library=OWN_LIBRARY))
        return self.files[-1]

    def take_metadata(self, metadata: dict) -> None:
        """Take what rosbag2 wrote into a file about it; what metadata.yaml says of topics counts
        more.
        """
        self.told_topics = topics_of(metadata) | self.told_topics
        self.result.custom_data |= metadata.get("custom_data") or {}
        self.ros_distro = metadata.get("ros_distro") or self.ros_distro

    def add_topic(self, topic: RecoveredTopic) -> None:
        """Take a topic; of several types under one name the metadata tell the one that is encoded
        as ROS 2 does.
        """
        known = self.topics.setdefault(topic.name, topic)
        if (known.type_name, known.encoding) == (topic.type_name, topic.encoding):
            return
        kinds = " and ".join(f"{one.type_name or '?'} ({one.encoding})" for one in (known, topic))
        self.note(
            f"topic {topic.name} has messages of two kinds: {kinds}; all are kept, each under its"
            " own type"
        )
        if known.encoding != "cdr" == topic.encoding:
            known.type_name, known.encoding = topic.type_name, topic.encoding
            known.qos, known.type_hash = topic.qos, topic.type_hash

    def free_name(self, name: str, type_name: str, own: set[str]) -> str:
        """The name of a topic in the new bag: another one where it was that of another type in a
        file before.

        Parameters
        ----------
        own
            Names of topics that the same file had already, under any type; this one is added.
        """
        known, free = self.topics.get(name), name
        if known is not None and known.type_name != type_name and name not in own:
            names = (f"{name}_{number}" for number in range(2, 2**16))
            free = next(
                one
                for one in names
                if one not in self.topics or self.topics[one].type_name == type_name
            )
            self.note(
                f"topic {name} has type {known.type_name} before and {type_name} here, which is in"
                f" the new bag as {free}"
            )
        own.add(free)
        return free

    def note(self, text: str) -> None:
        """Tell something, once."""
        if text not in self.result.notes:
            self.result.notes.append(text)

    def lose(
        self, file: str, reason: str, messages: int | None = None, begin: int = 0, end: int = 0
    ) -> None:
        """Tell of a place that is damaged or missing."""
        self.result.places.append(LostPlace(file, begin, end - begin, reason, messages))

    def finish(self) -> Recovery:
        """Close all files, now that it is known what they are to tell.

        Raises
        ------
        BagError
            If there is nothing in them.
        """
        result, places = self.result, self.result.places
        if not any(file.channels for file in self.files) and not result.n_attachments:
            told = [f"{place.file}: {place.reason}" for place in places[:MOST_REASONS]]
            if len(places) > MOST_REASONS:
                told.append(f"and {len(places) - MOST_REASONS} places more")
            reasons = "; ".join(told or ["it has no topics"])
            raise BagError(f"{self.path}: there is nothing to recover: {reasons}")
        for file in self.files:
            file.end_chunk()
        result.files = [file.path.name for file in self.files]
        result.n_looked_at = result.n_bytes - self.n_not_looked_at
        result.messages = {name: topic.count for name, topic in self.topics.items()}
        result.lost = self._lost()
        starts = [file.start_ns for file in self.files if file.start_ns is not None]
        ends = [file.end_ns for file in self.files if file.end_ns is not None]
        result.start_ns, result.end_ns = min(starts, default=None), max(ends, default=None)
        result.custom_data |= {"recovered_from": self.path.name, "recovery": str(result)}
        for file in self.files:
            counts: Counter[str] = Counter()
            for channel in file.channels.values():
                counts[channel.record.topic] += channel.count
            file.add_metadata(RECORD_NAME, record_values(self._metadata([file], counts)))
            file.finish()
            os.fsync(file.stream.fileno())
            file.stream.close()
        write_metadata_file(self.output, self._metadata(self.files, result.messages))
        sync_folder(self.output.parent)
        return result

    def _metadata(self, files: list[McapFile], counts: dict[str, int]) -> dict:
        """Metadata of the bag or of a file, with the messages of its topics."""
        topics = [
            replace(topic, count=counts[name])
            for name, topic in self.topics.items()
            if name in counts
        ]
        return bag_metadata(files, topics, self.result.custom_data, self.ros_distro)

    def _lost(self) -> dict[str, int]:
        """Messages known to be lost, by topic: each source is a lower bound."""
        lost: Counter[str] = Counter()
        for name, topic in self.topics.items():
            missing = 0 if topic.first is None else topic.top + 1 - topic.first - topic.counted
            lost[name] = max(topic.lost, missing)
        for name, count in self._told_counts.items():
            kept = self.topics[name].count if name in self.topics else 0
            lost[name] = max(lost[name], count - kept)
        return dict(+lost)


class FileRecovery:
    """A damaged file on its way into the new bag.

    Parameters
    ----------
    bag
        The new bag.
    name
        Of the file, in what is told.

    Attributes
    ----------
    out
        The file of the new bag; None until something is written.
    profile
        Of that file.
    schemas, channels
        What the damaged one defines, by number.
    written
        Channels of the new file by the number in the damaged one; None where nothing defines them.
    """

    def __init__(self, bag: RecoveredBag, name: str):
        self.bag, self.name = bag, name
        self.out: McapFile | None = None
        self.profile = "ros2"
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.written: dict[int, McapChannel | None] = {}
        self.unknown: Counter[int] = Counter()  # messages by the number of their channel
        self.undecodable: Counter[int] = Counter()  # by channel
        self._topics: set[str] = set()  # that the file has in the new bag
        self._decoders: dict[tuple, Decoder] = {}  # by the definitions that they know
        # definitions by which a message could be decoded, or that are as they are installed here
        self._proved: set[tuple] = set()

    def repair(self, text: str) -> None:
        """Tell of damage without loss."""
        self.bag.result.repairs.append(f"{self.name}: {text}")

    def decodable(self, schema: Schema, payloads: Sequence[bytes]) -> list[bool]:
        """Which of the payloads are messages of a type, by the definitions of the file, of which
        this one counts if there are several.

        All of them if the definition cannot be read, or fits none of its messages so far and is
        not that which is installed here.
        """
        texts = map(definition_of, [*self.schemas.values(), schema])
        key = tuple({text[0]: text for text in texts}.values())
        if key not in self._decoders:
            self._decoders[key] = Decoder(embedded_types(key, None)[0])
        decoder, name = self._decoders[key], full_name(schema.name)
        own, others = decoder.types.fielddefs.get(name), types_with(name)
        if own is None:
            return [True] * len(payloads)
        found = [not one for one in decoder.errors(name, payloads)]
        if any(found) or (others is not None and own == others.fielddefs[name]):
            self._proved.add((key, name))
        return found if (key, name) in self._proved else [True] * len(payloads)

    def judged(self, messages: list[Message]) -> list[Message]:
        """Those that are messages of their type, of some that no CRC vouches for."""
        bad = {
            k for k, message in enumerate(messages) if not 0 <= message.log_time_ns <= LAST_TIME_NS
        }
        for number, places in grouped_by_channel(messages).items():
            channel = self.channels.get(number)
            schema = channel and self.schemas.get(channel.schema_id)
            if channel is not None and schema and channel.message_encoding == "cdr":
                good = self.decodable(schema, [plain_message(messages[k].data) for k in places])
                bad |= {index for index, is_good in zip(places, good, strict=True) if not is_good}
        self.undecodable.update(messages[index].channel for index in bad)
        return [message for index, message in enumerate(messages) if index not in bad]

    def channel(self, number: int) -> McapChannel | None:
        """The channel in the new file; None if nothing in the damaged one defines it."""
        if number not in self.written:
            record = self.channels.get(number)
            self.written[number] = self._write_channel(record) if record is not None else None
        return self.written[number]

    def write(self, message: Message, is_verified: bool) -> McapChannel | None:
        """Append a message to the new file, unpacked if it was compressed by itself; returns its
        channel, None if nothing defines that.
        """
        channel = self.channel(message.channel)
        if channel is None:
            (self.unknown if is_verified else self.undecodable)[message.channel] += 1
            return None
        assert self.out is not None  # as the channel is in it
        topic, data = channel.record.topic, message.data
        plain = plain_message(data) if channel.record.message_encoding == "cdr" else data
        if plain is not data:
            self.bag.note(f"messages of {topic} were compressed one by one: they are not any more")
        self.out.add_message(
            channel, message.sequence, message.log_time_ns, message.publish_time_ns, plain
        )
        self.bag.topics[topic].count += 1
        self.bag.result.unverified += not is_verified
        return channel

    def tell_left_out(self) -> None:
        """Tell which messages could not be taken."""
        if count := self.unknown.total():
            self.bag.lose(
                self.name,
                (
                    f"messages of channels {sorted(self.unknown)}, which nothing in the file defines"
                ),
                count,
            )
        for number, count in self.undecodable.items():
            known = self.channels.get(number)
            topic = known.topic if known is not None else f"the unknown channel {number}"
            self.bag.lose(
                self.name,
                (
                    f"{count} records on {topic} for which no CRC vouches are no messages of its type,"
                    " and are left out"
                ),
            )

    def _write_channel(self, record: Channel) -> McapChannel:
        """Announce a topic in the new file, under another name where its own is taken."""
        self.out = out = self.out or self.bag.new_file(self.profile)
        schema, told = self.schemas.get(record.schema_id), self.bag.told_topics.get(record.topic)
        told_type = (told or {}).get("type", "")
        if schema is None and record.schema_id:
            hint = f"; metadata.yaml says {told_type}" if told_type else ""
            self.repair(f"the definition of topic {record.topic} is lost{hint}")
            schema = Schema(id=record.schema_id, name=told_type, encoding="", data=b"")
        number, type_name = 0, told_type
        if schema is not None:
            type_name, number = schema.name, schema.id
            if out.schemas.get(number) != schema:
                number = _free_number(number, out.schemas)
                out.add_schema(schema.name, schema.encoding, schema.data, number)
        encoding, metadata = record.message_encoding, record.metadata
        qos: list = []
        with suppress(ValueError):
            qos = parse_qos(record.topic, metadata.get("offered_qos_profiles", ""))
        digest = metadata.get("topic_type_hash", (told or {}).get("type_description_hash", ""))
        name = self.bag.free_name(record.topic, type_name, self._topics)
        self.bag.add_topic(RecoveredTopic(name, type_name, qos, digest, encoding=encoding))
        if encoding != "cdr":
            self.bag.note(
                f"topic {record.topic} is encoded as '{encoding}', not as cdr: its messages are"
                " kept as they are, to be read raw"
            )
        return out.add_channel(
            name, encoding, number, metadata, _free_number(record.id, out.channels)
        )


def _free_number(wanted: int, taken: Iterable[int]) -> int:
    """The number of a schema or channel in the new file: its old one, or the next that is free."""
    numbers = (wanted, *range(1, 2**16))
    return next(one for one in numbers if 0 < one < 2**16 and one not in set(taken))


def grouped_by_channel(messages: Sequence[Message]) -> dict[int, list[int]]:
    """Places of the messages of each channel."""
    places: dict[int, list[int]] = {}
    for index, message in enumerate(messages):
        places.setdefault(message.channel, []).append(index)
    return places


# types that are installed here


@cache
def types_with(type_name: str) -> Typestore | None:
    """Types that include one, None if it is installed nowhere.

    Parameters
    ----------
    type_name
        As package/msg/Name.
    """
    with suppress(ValueError):
        return types_for(type_name)
    return None


def type_of_hash(digest: str) -> str:
    """Name of the standard type with a RIHS01 hash; empty if there is none."""
    return _names_by_hash().get(digest, "") if digest else ""


@cache
def _names_by_hash() -> dict[str, str]:
    types, found = shared_types(), {}
    for name in types.fielddefs:
        with suppress(Exception):  # some have no hash
            found[type_hash(types, name)] = name
    return found


def installed_schema(type_name: str, number: int) -> Schema | None:
    """The definition of a type as it is installed here, under a number; None if it is not."""
    full = full_name(type_name)
    types = types_with(full)
    if types is None:
        return None
    data = definition(types, full).encode()
    return Schema(id=number, name=type_name, encoding="ros2msg", data=data)
