"""Reading bags without ROS: rosbag2 folders, with or without metadata.yaml, and single .mcap
files.

Messages are decoded by the definitions in the bag, so that types of other packages need no
installation. Which messages there are, the files themselves say; metadata.yaml only adds what they
do not tell.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from dart_skill.common.files import open_file, require_file
from dart_skill.recording.bags._files import (
    chosen_files,
    files_in,
    has_only_log,
    is_packed,
    missing_parts,
    open_input,
    part_number,
    storage_of,
    unpack_file,
    unpacked_messages,
    unpacked_name,
)
from dart_skill.recording.bags._metadata import (
    RECORD_NAME,
    full_name,
    known_metadata,
    parse_record,
    profiles,
    topics_of,
)
from dart_skill.recording.mcap import (
    END_OF_TIME,
    BagMessage,
    DamagedError,
    McapInput,
    Part,
    in_time_order,
)

if TYPE_CHECKING:
    from mcap.records import Attachment, Channel, Schema
    from rosbags.typesys.store import Typestore

    from dart_skill.recording.bags._ros1 import Ros1Source
    from dart_skill.recording.bags._sqlite import SqliteInput

_RECOVER = (
    "the file is cut off or damaged, its recorder was probably stopped before it closed the bag:"
    " 'dart-skill bag recover' makes a new bag of what is in it"
)
OF_A_GRAPH = {
    "/wam/command": "dart_skill_msgs/msg/WamCommand",
    "/demonstrations": "dart_skill_msgs/msg/Demonstration",
}
"""Topics by which a graph is known in a bag, without its namespace, and their types."""
ROS1_SUFFIX, ROS1_MAGIC = ".bag", b"#ROSBAG "
MAPPED = (".csv", ".tsv", ".txt", ".npy", ".npz", ".mat", ".parquet", ".c3d", ".trc", ".bvh")
"""Endings of files that a mapping describes (docs/recordings.md)."""


class BagError(ValueError):
    """A bag that cannot be read, with the reason and, where there is one, the remedy."""


@dataclass(frozen=True)
class TopicInfo:
    """A topic of a bag.

    Parameters
    ----------
    type_name
        As package/msg/Name.
    count
        Messages.
    type_hash
        RIHS01; empty where the bag does not tell it.
    qos
        Profiles of `rosbags`.
    encoding
        Of the messages.
    other_types
        Of messages on the same topic, where it has several; each message says which it is of.
    """

    name: str
    type_name: str
    count: int
    type_hash: str
    qos: tuple
    encoding: str = "cdr"
    other_types: tuple[str, ...] = ()


@dataclass(frozen=True)
class BagFile:
    """A file of a bag.

    Parameters
    ----------
    size
        In bytes.
    count
        Messages; None if it is not known of this file alone.
    start_ns, end_ns
        Log times of its first and last message, 0 without messages; None like count.
    library
        Its writer.
    compression
        Of its chunks, or of all of it.
    """

    path: Path
    size: int
    count: int | None
    start_ns: int | None
    end_ns: int | None
    library: str = ""
    compression: str = ""


class BagReader:
    """An open bag; a context manager.

    Parameters
    ----------
    path
        Rosbag2 folder, or .mcap or .db3 file, or .bag file of ROS 1.
    types
        Definitions for topics whose bag holds none (`typestore`); None: those of ROS 2 Jazzy and
        ours. The attribute of this name decodes the messages. Bags that define the same types
        share it: make another store to add to it.

    Attributes
    ----------
    topics
        TopicInfo by name.
    files
        A list of BagFile, in order.
    storage
        How rosbag2 calls the format of the files: mcap or sqlite3; ros1 for a bag of ROS 1.
    metadata
        Of rosbag2, from metadata.yaml or, without it, from the file; empty if neither tells them.
    custom_data
        Names and texts of the metadata, as `BagWriter` got them.
    start_ns, end_ns
        Log times of the first and last message; 0 for an empty bag.
    message_count
        On all topics.

    Raises
    ------
    BagError
        For what is no whole bag.
    """

    def __init__(self, path: str | os.PathLike, types: Typestore | None = None):
        self.path, self._given = Path(path), types
        if not self.path.exists():
            raise BagError(f"{self.path}: no such bag")
        metadata = known_metadata(self.path) if self.path.is_dir() else {}
        files = _storage_files(self.path, metadata)
        with _explained(self.path):
            if is_of_ros1(files[0]):
                from dart_skill.recording.bags._ros1 import Ros1Source

                self._source: _Source | Ros1Source = Ros1Source(files[0])
            else:
                self._source = _Source(self.path, files, metadata)
            source = self._source
            self._definitions = source.definitions
        self.topics, self.files, self.metadata = source.topics, source.files, source.metadata
        self.start_ns, self.end_ns = source.start_ns, source.end_ns
        self.custom_data: dict[str, str] = dict(self.metadata.get("custom_data") or {})
        self.message_count = sum(topic.count for topic in self.topics.values())
        self.storage = source.storage

    @property
    def types(self) -> Typestore:
        """Types of the messages; parsed on first use, as that takes longer than to open a bag."""
        return self._all_types[0]

    @cached_property
    def _all_types(self) -> tuple[Typestore, dict[str, str]]:
        """All types that are known, and why others are not. What the bag does not define is as it
        was given, else as ROS 2 Jazzy has it.
        """
        store, unknown = _types_in(self._definitions, None, frozenset())
        names = frozenset(
            name
            for topic in self.topics.values()
            if topic.encoding == "cdr"
            for name in (topic.type_name, *topic.other_types)
        )
        if names <= store.fielddefs.keys():
            return store, unknown
        # a store that was given may get other types later
        types_in = _types_in if self._given is None else _types_in.__wrapped__
        return types_in(self._definitions, self._other_types, names)

    def _types_of(self, type_name: _DefinedType) -> tuple[Typestore, dict[str, str]]:
        """The same for a type that the bag defines in several ways. type_name: with its own
        definition.
        """
        others = (one for one in self._definitions if one[0] != type_name)
        return _types_in(
            (*others, type_name.definition), self._other_types, frozenset([type_name])
        )

    @cached_property
    def _other_types(self) -> Typestore:
        """Types that do not come from the bag."""
        from dart_skill.recording.bags.messages import shared_types

        return shared_types() if self._given is None else self._given

    def messages(
        self,
        topics: Iterable[str] | None = None,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        decode: bool = True,
        every_ns: int = 0,
    ) -> Iterator[BagMessage]:
        """Messages in order of log time.

        Parameters
        ----------
        topics
            Names; None: all.
        start_ns, stop_ns
            Log times from the first to before the second; None: no limit.
        decode
            Give objects instead of CDR bytes.
        every_ns
            Log time at least from a message of a topic to the next one that is given; 0: all are.
        """
        chosen = self._chosen(topics)
        limits = (0 if start_ns is None else start_ns, END_OF_TIME if stop_ns is None else stop_ns)
        with _explained(self.path):
            found = self._called(self._source.messages(chosen, *limits, decode))
            found = _thinned(found, every_ns) if every_ns else found
            yield from (
                (
                    one._replace(type_name=str(one.type_name), data=self.typed(one)[1])
                    for one in found
                )
                if decode
                else found
            )

    def typed(self, message: BagMessage) -> tuple[Typestore, Any]:
        """The types that a raw message is decoded by, those of the bag unless only others fit, and
        its content.

        Raises
        ------
        BagError
            If none does.
        """
        from dart_skill.recording.bags.messages import deserialize

        topic, known, _stamp_ns, data = message
        encoding = self.topics[topic].encoding
        if encoding != "cdr":
            raise BagError(
                f"{self.path}: topic {topic} is encoded as '{encoding}', not as cdr: read it raw"
            )
        types, unknown = (
            self._types_of(known) if isinstance(known, _DefinedType) else self._all_types
        )
        type_name = str(known)
        if type_name not in types.fielddefs:
            reason = unknown.get(type_name, "which neither the bag nor the given types define")
            raise BagError(
                f"{self.path}: topic {topic} has type {type_name}, {reason}: give a typestore with"
                " its folder of .msg files, or read it raw"
            )
        try:
            return types, deserialize(types, type_name, data)
        except ValueError as error:
            try:  # its definition in the bag may be wrong
                return self._other_types, deserialize(self._other_types, type_name, data)
            except ValueError:
                raise BagError(f"{self.path}: topic {topic}: {error}") from error

    def to_pandas(
        self, topic: str, start_ns: int | None = None, stop_ns: int | None = None
    ) -> Any:
        """Messages of a topic as a pandas.DataFrame: a row for each, by its log time [ns]; columns
        as `pose.position.x`, `position[0]`.

        Stamps and durations are nanoseconds.

        Parameters
        ----------
        start_ns, stop_ns
            As for `messages`.

        Raises
        ------
        ModuleNotFoundError
            Without pandas.
        """
        from dart_skill.recording.bags.columns import frame_of

        return frame_of(self.messages([topic], start_ns, stop_ns))

    def attachments(self) -> list[Attachment]:
        """Files that were kept with the bag, as `mcap` reads them: name, media_type, data, times."""
        self._check_open()
        with _explained(self.path):
            return self._source.attachments()

    def close(self) -> None:
        """Close the files; twice is no error."""
        self._source.close()

    def __enter__(self) -> BagReader:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    def _check_open(self) -> None:
        if not self._source.is_open:
            raise BagError(f"{self.path}: the bag is closed")

    def _chosen(self, topics: Iterable[str] | None) -> set[str]:
        self._check_open()
        if topics is None:
            return set(self.topics)
        wanted = {topics} if isinstance(topics, str) else set(topics)
        unknown = wanted - set(self.topics)
        if unknown:
            raise BagError(f"{self.path}: no topic {sorted(unknown)}, only {sorted(self.topics)}")
        return wanted

    def _called(self, messages: Iterator[BagMessage]) -> Iterator[BagMessage]:
        """The messages, their topics under the names that this reader gives them."""
        return messages


class GraphBag(BagReader):
    """An open bag of one graph, whichever namespace it ran in: /arm1/joint_states is called
    /joint_states here.

    Attributes
    ----------
    namespace
        That one, "" without one; found by the topics of commands and of demonstrations.

    Raises
    ------
    BagError
        For a bag of several graphs.
    """

    def __init__(self, path: str | os.PathLike, types: Typestore | None = None):
        super().__init__(path, types)
        self.namespace = self._found_namespace()
        self._full = {self._in_graph(name): name for name in self.topics}
        self.topics = {
            name: replace(self.topics[full], name=name) for name, full in self._full.items()
        }

    def _chosen(self, topics: Iterable[str] | None) -> set[str]:
        return {self._full[name] for name in super()._chosen(topics)}

    def _called(self, messages: Iterator[BagMessage]) -> Iterator[BagMessage]:
        if not self.namespace:
            return messages
        return (message._replace(topic=self._in_graph(message.topic)) for message in messages)

    def _found_namespace(self) -> str:
        found = {
            name.removesuffix(mark)
            for name, info in self.topics.items()
            for mark, type_name in OF_A_GRAPH.items()
            if name.endswith(mark) and info.type_name == type_name
        }
        if len(found) > 1:
            spaces = ", ".join(space or "/" for space in sorted(found))
            self.close()
            raise BagError(
                f"{self.path}: of several graphs, in the namespaces {spaces}: record each into a"
                " bag of its own"
            )
        return found.pop() if found else ""

    def _in_graph(self, name: str) -> str:
        return name.removeprefix(self.namespace) if name.startswith(f"{self.namespace}/") else name


class _Source:
    """The files of a bag, in order: MCAP or SQLite, as their first bytes say, packed or not."""

    def __init__(self, path: Path, files: list[Path], metadata: dict):
        self._files: list[McapInput | SqliteInput] = []
        self._folder: TemporaryDirectory | None = None
        try:
            for file in files:
                with _explained(file):
                    self._files.append(open_input(self._unpacked(file)))
            if not metadata.get("relative_file_paths") and len(files) > 1:
                _require_one_bag(path, self._files)
        except BaseException:
            self.close()
            raise
        filled = [file for file in self._files if file.message_count]
        self.start_ns = min((file.start_ns for file in filled), default=0)
        self.end_ns = max((file.end_ns for file in filled), default=0)
        self.metadata = metadata or self._embedded_metadata()
        # of topics, by number of the file and number of the channel
        self._names: dict[tuple[int, int], str] = {}
        self.topics = self._topics()
        told = self.metadata.get("compression_format") or ""
        self.files = [
            _bag_file(file, one, told) for file, one in zip(files, self._files, strict=True)
        ]

    @property
    def is_open(self) -> bool:
        return all(file.is_open for file in self._files)

    @property
    def storage(self) -> str:
        return self._files[0].storage

    @cached_property
    def definitions(self) -> tuple[tuple[str, str, str], ...]:
        """Type name, schema encoding and definition text of each type; each file of a split bag
        has all of them.
        """
        return tuple(
            dict.fromkeys(
                _definition(schema) for file in self._files for schema in file.schemas.values()
            )
        )

    def messages(
        self, topics: set[str], start_ns: int, stop_ns: int, with_definitions: bool
    ) -> Iterator[BagMessage]:
        """Messages in order. with_definitions: types that the bag defines in several ways are a
        `_DefinedType`.
        """
        parts: list[Part] = []
        ways = (
            Counter(name for name, _encoding, _text in self.definitions)
            if with_definitions
            else Counter[str]()
        )
        several = {name for name, count in ways.items() if count > 1}
        for k, file in enumerate(self._files):
            wanted = {
                number: (
                    name,
                    _type_to_read(file, channel, several) or self.topics[name].type_name,
                )
                for number, channel in file.channels.items()
                if (name := self._names[k, number]) in topics
            }
            parts += file.parts(wanted, start_ns, stop_ns)
        return unpacked_messages(in_time_order(parts))

    def attachments(self) -> list[Attachment]:
        return [item for file in self._files for item in file.attachments()]

    def close(self) -> None:
        for file in self._files:
            file.close()
        if self._folder is not None:
            self._folder.cleanup()

    def _unpacked(self, file: Path) -> Path:
        """The file, or what it holds if it was compressed as a whole."""
        if not is_packed(file):
            return file
        if self._folder is None:
            self._folder = TemporaryDirectory(prefix="dart_skill_")
        return unpack_file(file, Path(self._folder.name))

    def _embedded_metadata(self) -> dict:
        """What the last file tells by itself."""
        records = [
            record
            for file in self._files
            for record in file.metadata()
            if record.name == RECORD_NAME
        ]
        return parse_record(records[-1].metadata) if records else {}

    def _topics(self) -> dict[str, TopicInfo]:
        """Counts from the files; what only metadata.yaml tells (types of schemaless channels,
        hashes, QoS) from there.

        Where channels of one topic have several encodings, those that are not CDR are topics of
        their own, named after both.
        """
        told_of = topics_of(self.metadata)
        plain = {
            channel.topic
            for file in self._files
            for channel in file.channels.values()
            if _encoding(channel) == "cdr"
        }
        found: dict[str, list[_Channel]] = {}
        for k, file in enumerate(self._files):
            for number, channel in file.channels.items():
                encoding = _encoding(channel)
                name = (
                    channel.topic
                    if encoding == "cdr" or channel.topic not in plain
                    else f"{channel.topic} ({encoding})"
                )
                self._names[k, number] = name
                found.setdefault(name, []).append(
                    _Channel(channel, _type_of(file, channel), file.counts[number])
                )
        return {
            name: _topic(name, channels, told_of.get(channels[0].record.topic, {}))
            for name, channels in found.items()
        }


@dataclass(frozen=True)
class _Channel:
    """A channel of a topic, as a file has it. count: of its messages."""

    record: Channel
    type_name: str
    count: int


def _topic(name: str, channels: list[_Channel], told: dict) -> TopicInfo:
    """A topic of a bag from its channels. told: what metadata.yaml says of it."""
    filled = [one for one in channels if one.count] or channels
    types = list(dict.fromkeys(one.type_name for one in filled if one.type_name)) or [
        full_name(told.get("type", ""))
    ]
    told_by_files = [one.record.metadata for one in channels]
    hashes = [
        told.get("type_description_hash"),
        *(one.get("topic_type_hash") for one in told_by_files),
    ]
    qos = [
        told.get("offered_qos_profiles"),
        *(one.get("offered_qos_profiles") for one in told_by_files),
    ]
    return TopicInfo(
        name,
        types[0],
        sum(one.count for one in channels),
        next(filter(None, hashes), ""),
        next(filter(None, (profiles(name, one) for one in qos)), ()),
        _encoding(channels[0].record),
        tuple(types[1:]),
    )


def _encoding(channel: Channel) -> str:
    return "cdr" if channel.message_encoding.lower() in ("cdr", "") else channel.message_encoding


def _type_of(file: McapInput | SqliteInput, channel: Channel) -> str:
    """Message type of a channel, of CDR under its full name; empty if the file does not tell it."""
    name = file.type_name(channel)
    return full_name(name) if _encoding(channel) == "cdr" else name


class _DefinedType(str):
    """The name of a type that the bag defines in several ways. definition: its own: name,
    encoding, text.
    """

    definition: tuple[str, str, str]


def _type_to_read(file: McapInput | SqliteInput, channel: Channel, several: set[str]) -> str:
    """As `_type_of`, with its own definition if it has one of several. several: names of such
    types.
    """
    name = _type_of(file, channel)
    if name in several and (schema := file.schemas.get(channel.schema_id)) is not None:
        name = _DefinedType(name)
        name.definition = _definition(schema)
    return name


def _definition(schema: Schema) -> tuple[str, str, str]:
    return full_name(schema.name), schema.encoding, schema.data.decode(errors="replace")


def _bag_file(file: Path, opened: McapInput | SqliteInput, told: str) -> BagFile:
    """What is known of a file. told: the compression that the metadata tell."""
    compression = (
        {".lz4": "lz4"}.get(file.suffix, "zstd") if is_packed(file) else opened.compression or told
    )
    return BagFile(
        file,
        file.stat().st_size,
        opened.message_count,
        opened.start_ns,
        opened.end_ns,
        opened.library,
        compression,
    )


def _of_tables(folder: Path) -> str:
    """What to say of a folder that holds tables or motion capture instead of a bag; empty for
    another one.
    """
    found = sorted({file.suffix.lower() for file in folder.iterdir()} & set(MAPPED))
    if not found:
        return ""
    own = folder / "mapping.yaml"
    what = "CSV" if ".csv" in found else found[0]
    return (
        f"; its {what} files are read with --mapping {own if own.is_file() else 'FILE'}, which"
        " names their columns"
    )


def _lone_logs(folder: Path) -> str:
    """What to say of a folder that has only the write-ahead logs of SQLite files; empty for
    another one.
    """
    logs = [
        file.name
        for file in sorted(folder.glob("*.db3-wal"))
        if has_only_log(folder / file.name.removesuffix("-wal"))
    ]
    return (
        f"of its .db3 files there is only {', '.join(logs)}: 'dart-skill bag recover' reads it"
        if logs
        else ""
    )


def _storage_files(path: Path, metadata: dict) -> list[Path]:
    """Files that hold a bag's messages, in order; BagError if there are none, or several that are
    not one bag's.
    """
    if not path.is_dir():
        require_file(path)
        files = [path]
        if storage_of(path) is None and not is_of_ros1(path):
            raise BagError(
                f"{path}: a bag is a folder with metadata.yaml, or a .mcap or .db3 file, or a .bag"
                " file of ROS 1; what else is read needs --mapping"
            )
    else:
        files, missing = chosen_files(path, metadata)
        if missing:
            raise BagError(
                f"{path}: {', '.join(file.name for file in missing)} is missing, which"
                " metadata.yaml names"
            )
        files = files or files_in(path, (ROS1_SUFFIX,))
        if not files:
            raise BagError(
                f"{path}: {_lone_logs(path) or 'no .mcap file in this folder' + _of_tables(path)}"
            )
        if len(files) > 1 and files[0].suffix == ROS1_SUFFIX:
            raise _not_one_bag(
                path, len(files), "are of ROS 1, which has no bags of several files"
            )
    for file in files:
        require_file(file)
    if lost := [file.name for file in files if has_only_log(file)]:
        reason = f"{lost[0]} is empty (0 bytes), and what was recorded is in {lost[0]}-wal"
        raise BagError(f"{path}: {reason}: 'dart-skill bag recover' reads it")
    empty = [file for file in files if file.stat().st_size == 0]
    if len(empty) == len(files):
        names = ", ".join(file.name for file in empty)
        raise BagError(
            f"{path}: {names} is empty (0 bytes): the recorder stopped before its first write"
        )
    if len(files) > 1 and not metadata.get("relative_file_paths"):
        _require_one_name(path, files)
    return [file for file in files if file not in empty]


def _require_one_name(path: Path, files: list[Path]) -> None:
    """Files of a split bag without metadata.yaml are called NAME_0, NAME_1 ...; one of them may be
    missing, but the first.
    """
    names, numbers = zip(*map(part_number, files), strict=True)
    suffixes = {Path(unpacked_name(file.name)).suffix for file in files}
    if (
        len(suffixes) > 1
        or len(set(names)) > 1
        or len(set(numbers)) < len(files)
        or numbers[0] < 0
    ):
        raise _not_one_bag(
            path,
            len(files),
            "are not named as the parts of one bag (NAME_0.mcap, NAME_1.mcap ...)",
        )
    if numbers[0] > 0:
        raise _not_one_bag(
            path, len(files), f"lack the first part of a bag ({missing_parts(files)[0]})"
        )


def is_of_ros1(path: Path) -> bool:
    """Whether a file is a bag of ROS 1, by its first bytes."""
    with open_file(path) as stream:
        return stream.read(len(ROS1_MAGIC)) == ROS1_MAGIC


def _not_one_bag(path: Path, count: int, reason: str) -> BagError:
    return BagError(
        f"{path}: {count} files and no metadata.yaml, and they {reason}: open one of them by its"
        " name, or 'dart-skill bag recover' makes one bag of them"
    )


def _require_one_bag(path: Path, files: list[McapInput | SqliteInput]) -> None:
    """Files of a split bag without metadata.yaml (its recorder crashed) follow each other and
    agree on their topics.
    """
    types: dict[str, str] = {}
    for file in files:
        for channel in file.channels.values():
            if file.counts[channel.id] and types.setdefault(
                channel.topic, _type_of(file, channel)
            ) != _type_of(file, channel):
                raise _not_one_bag(path, len(files), f"disagree on the type of {channel.topic}")
    starts = [file.start_ns for file in files if file.message_count]
    if any(later <= earlier for earlier, later in zip(starts, starts[1:], strict=False)):
        raise _not_one_bag(path, len(files), "do not follow each other in time")


def _thinned(messages: Iterable[BagMessage], every_ns: int) -> Iterator[BagMessage]:
    """Messages of each topic that are at least so long after the last one [ns]; where log time
    jumps back, the next one.
    """
    last: dict[str, int] = {}
    for one in messages:
        since = one.stamp_ns - last.get(one.topic, one.stamp_ns - every_ns)
        if since >= every_ns or since < 0:
            last[one.topic] = one.stamp_ns
            yield one


@lru_cache(maxsize=16)
def _types_in(
    definitions: tuple[tuple[str, str, str], ...], others: Typestore | None, names: frozenset[str]
) -> tuple[Typestore, dict[str, str]]:
    """As `embedded_types`, once for all bags that define the same, as those of one graph do."""
    from dart_skill.recording.bags._definitions import embedded_types

    return embedded_types(definitions, others, names)


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Whatever a reader makes of foreign bytes becomes a BagError that names the bag."""
    try:
        yield
    except BagError:
        raise
    except DamagedError as error:
        raise BagError(f"{path}: {error}: {_RECOVER}") from error
    except Exception as error:
        reason = (str(error) or type(error).__name__).rstrip(".")
        raise BagError(f"{path}: {reason}") from error
