"""The new bag that recovery makes: its files, and what is told of it."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from dart_skill.recording.bags._files import part_number, plain_message, sync_folder
from dart_skill.recording.bags._metadata import (
    RECORD_NAME,
    FileMetadata,
    TopicMetadata,
    bag_metadata,
    parse_qos,
    record_values,
    write_metadata_file,
)
from dart_skill.recording.bags.reader import BagError
from dart_skill.recording.mcap import McapChannel, McapFile, Unpacked

OWN_LIBRARY = "dart_skill"
LAST_TIME_NS = 2**63 - 1
"""ROS has no later time [ns]."""
TOGETHER = 500
"""Messages without a CRC that are judged together."""
MOST_REASONS = 3
"""That are told of a bag of which nothing is left."""


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
        lost = (
            "an unknown number of messages"
            if self.messages is None
            else f"{self.messages} messages"
        )
        return f"{self.file}, byte {self.offset}, {self.n_bytes} bytes: {self.reason}; {lost} lost"


@dataclass(frozen=True)
class Recovery:
    """A recovered bag: what is in it and what is not.

    Parameters
    ----------
    path, files
        The new bag and the names of its files.
    messages
        Kept, by topic.
    lost
        Messages by topic, as far as statistics, message indexes, metadata.yaml or gaps in sequence
        numbers tell; what a recorder had not handed over yet when it stopped leaves no trace.
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
    files: tuple[str, ...]
    messages: dict[str, int]
    lost: dict[str, int]
    is_exact: bool
    places: tuple[LostPlace, ...]
    repairs: tuple[str, ...]
    notes: tuple[str, ...]
    unverified: int
    lost_chunks: int
    n_bytes: int
    n_looked_at: int
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
        """Whether all was looked at, no message is known to be lost, and no place may have held
        one.
        """
        return (
            not self.lost
            and all(place.messages == 0 for place in self.places)
            and self.n_looked_at == self.n_bytes
        )

    def __str__(self) -> str:
        kept, lost = sum(self.messages.values()), sum(self.lost.values())
        least = "" if self.is_exact or self.is_complete else "at least "
        text = (
            f"{kept} messages kept, {least}{lost} known to be lost, {self.lost_chunks} chunks and"
            f" {self.lost_bytes} bytes left out"
        )
        return text + (
            f", {self.unverified} kept without a CRC that vouches for them"
            if self.unverified
            else ""
        )


@dataclass
class RecoveredTopic:
    """A topic of the new bag, and how many of its messages there are.

    Parameters
    ----------
    kept, lost
        Messages.
    lost
        As the statistics and indexes of the files tell.
    first, top, counted
        Sequence numbers from the first to the highest that a recorder which counts wrote, and
        messages since.
    """

    type_name: str
    qos: list
    type_hash: str
    encoding: str
    kept: int = 0
    lost: int = 0
    first: int | None = None
    top: int = -1
    counted: int = 0

    @property
    def missing(self) -> int:
        """Messages that are missing in the numbers."""
        return 0 if self.first is None else max(0, self.top + 1 - self.first - self.counted)


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
    """

    def __init__(self, path: Path, output: Path, told: dict):
        self.path, self.output = path, output
        # and not a later part of a split bag
        self.from_start = path.is_dir() or part_number(path)[1] <= 0
        self.topics: dict[str, RecoveredTopic] = {}
        self.places: list[LostPlace] = []
        self.repairs: list[str] = []
        self.notes: list[str] = []
        self.files: list[McapFile] = []
        self.chunks_before: set[int] = set()  # marks of those in files that are done
        self.unpacked = Unpacked()
        self.custom_data: dict[str, str] = dict(told.get("custom_data") or {})
        self.ros_distro = told.get("ros_distro") or ""
        self.unverified = self.lost_chunks = self.n_attachments = self.n_bytes = (
            self.n_not_looked_at
        ) = 0
        self.is_exact = True
        self.told_topics: dict[str, dict] = {}
        self.hear_of_topics(told)
        items = told.get("topics_with_message_count") or []
        self.told_counts = {
            item["topic_metadata"]["name"]: item.get("message_count") or 0 for item in items
        }

    def new_file(self, profile: str) -> McapFile:
        """Begin the next file."""
        path = self.output / f"{self.output.name}_{len(self.files)}.mcap"
        self.files.append(McapFile(path, profile=profile, library=OWN_LIBRARY))
        return self.files[-1]

    def hear_of_topics(self, metadata: dict) -> None:
        """Know what metadata say of topics, from a file or in it; what was known before counts
        more.
        """
        for item in metadata.get("topics_with_message_count") or []:
            self.told_topics.setdefault(item["topic_metadata"]["name"], item["topic_metadata"])

    def topic(
        self, name: str, type_name: str, qos: list, type_hash: str, encoding: str
    ) -> RecoveredTopic:
        """The topic of a name; of several types under one name the metadata tell the one that is
        encoded as ROS 2 does.
        """
        known = self.topics.setdefault(name, RecoveredTopic(type_name, qos, type_hash, encoding))
        if (known.type_name, known.encoding) != (type_name, encoding):
            kinds = (
                f"{known.type_name or '?'} ({known.encoding}) and {type_name or '?'} ({encoding})"
            )
            self.note(
                f"topic {name} has messages of two kinds: {kinds}; all are kept, each under its"
                " own type"
            )
            if known.encoding != "cdr" == encoding:
                known.type_name, known.qos, known.type_hash, known.encoding = (
                    type_name,
                    qos,
                    type_hash,
                    encoding,
                )
        return known

    def free_name(self, name: str, type_name: str, own: set[str]) -> str:
        """The name of a topic in the new bag: another one where it was that of another type in a
        file before.

        Parameters
        ----------
        own
            Names of topics that the same file had already, under any type; this one is added.
        """
        known = self.topics.get(name)
        free = name
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
        if text not in self.notes:
            self.notes.append(text)

    def lose(self, file: str, offset: int, end: int, reason: str, messages: int | None) -> None:
        """Tell of a place that is damaged or missing."""
        self.places.append(LostPlace(file, offset, end - offset, reason, messages))

    def nothing_unknown(self, begin: int, end: int) -> None:
        """The places from one to before another held no message, as all are there that the
        statistics count.
        """
        self.places[begin:end] = [
            replace(place, messages=place.messages or 0) for place in self.places[begin:end]
        ]

    def finish(self) -> Recovery:
        """Close all files, now that it is known what they are to tell.

        Raises
        ------
        BagError
            If there is nothing in them.
        """
        if not any(file.channels for file in self.files) and not self.n_attachments:
            told = [f"{place.file}: {place.reason}" for place in self.places[:MOST_REASONS]] or [
                "it has no topics"
            ]
            more = len(self.places) - MOST_REASONS
            reasons = "; ".join(told) + (f"; and {more} places more" if more > 0 else "")
            raise BagError(f"{self.path}: there is nothing to recover: {reasons}")
        for file in self.files:
            file.end_chunk()
        filled = [file for file in self.files if file.message_count]
        result = Recovery(
            path=self.output,
            files=tuple(file.path.name for file in self.files),
            messages={name: topic.kept for name, topic in self.topics.items()},
            lost=self._lost(),
            is_exact=self.is_exact,
            places=tuple(self.places),
            repairs=tuple(self.repairs),
            notes=tuple(self.notes),
            unverified=self.unverified,
            lost_chunks=self.lost_chunks,
            n_bytes=self.n_bytes,
            n_looked_at=self.n_bytes - self.n_not_looked_at,
            start_ns=min(
                (file.start_ns for file in filled if file.start_ns is not None), default=None
            ),
            end_ns=max((file.end_ns for file in filled if file.end_ns is not None), default=None),
            n_attachments=self.n_attachments,
            custom_data=self.custom_data,
        )
        self.custom_data |= {"recovered_from": self.path.name, "recovery": str(result)}
        metadata = [self._close(file) for file in self.files]
        write_metadata_file(
            self.output,
            bag_metadata(
                metadata, self._topics(result.messages), self.custom_data, self.ros_distro
            ),
        )
        sync_folder(self.output.parent)
        return result

    def _close(self, file: McapFile) -> FileMetadata:
        metadata = FileMetadata.of(file)
        counts: Counter[str] = Counter()
        for channel in file.channels.values():
            counts[channel.record.topic] += channel.count
        file.add_metadata(
            RECORD_NAME,
            record_values(
                bag_metadata([metadata], self._topics(counts), self.custom_data, self.ros_distro)
            ),
        )
        file.finish()
        os.fsync(file.stream.fileno())
        file.close()
        return metadata

    def _topics(self, counts: dict[str, int]) -> list[TopicMetadata]:
        """The topics of the bag or of a file, with their counts."""
        return [
            TopicMetadata(
                name, topic.type_name, topic.qos, topic.type_hash, counts[name], topic.encoding
            )
            for name, topic in self.topics.items()
            if name in counts
        ]

    def _lost(self) -> dict[str, int]:
        """Messages known to be lost, by topic: each source is a lower bound."""
        lost = Counter(
            {name: max(topic.lost, topic.missing) for name, topic in self.topics.items()}
        )
        for name, count in self.told_counts.items():
            kept = self.topics[name].kept if name in self.topics else 0
            lost[name] = max(lost[name], count - kept)
        return {name: count for name, count in lost.items() if count > 0}


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
    written
        Channels of the new file by the number in the damaged one; None where nothing defines them.
    topics
        Names of topics that the file has in the new bag.
    """

    def __init__(self, bag: RecoveredBag, name: str):
        self.bag, self.name = bag, name
        self.out: McapFile | None = None
        self.written: dict[int, McapChannel | None] = {}
        self.topics: set[str] = set()

    def repair(self, text: str) -> None:
        """Tell of damage without loss."""
        self.bag.repairs.append(f"{self.name}: {text}")

    def take_metadata(self, metadata: dict) -> None:
        """Take what rosbag2 wrote into the file about it."""
        self.bag.custom_data |= metadata.get("custom_data") or {}
        self.bag.ros_distro = metadata.get("ros_distro") or self.bag.ros_distro

    def add_channel(
        self,
        topic: str,
        type_name: str,
        encoding: str,
        schema: int,
        metadata: dict[str, str],
        type_hash: str,
        number: int | None = None,
    ) -> McapChannel:
        """Announce a topic in the new file, under another name where its own is taken.

        Parameters
        ----------
        metadata
            Of the channel, with its QoS.
        schema, number
            Of the new file.
        """
        assert self.out is not None  # as the schema is in it
        name = self.bag.free_name(topic, type_name, self.topics)
        qos: list = []
        with suppress(ValueError):
            qos = parse_qos(topic, metadata.get("offered_qos_profiles", ""))
        self.bag.topic(name, type_name, qos, type_hash, encoding)
        return self.out.add_channel(name, encoding, schema, metadata, number)

    def write(
        self, channel: McapChannel, sequence: int, log_ns: int, publish_ns: int, data: bytes
    ) -> None:
        """Append a message to the new file, unpacked if it was compressed by itself."""
        assert self.out is not None  # as the channel is in it
        topic = channel.record.topic
        plain = plain_message(data) if channel.record.message_encoding == "cdr" else data
        if plain is not data:
            self.bag.note(f"messages of {topic} were compressed one by one: they are not any more")
        self.out.add_message(channel, sequence, log_ns, publish_ns, plain)
        self.bag.topics[topic].kept += 1


def grouped_by_channel(channels: Iterable[int]) -> dict[int, list[int]]:
    """Places of the messages of each channel.

    Parameters
    ----------
    channels
        Of all messages, in their order.
    """
    places: dict[int, list[int]] = {}
    for index, channel in enumerate(channels):
        places.setdefault(channel, []).append(index)
    return places
