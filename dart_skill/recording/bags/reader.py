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
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from dart_skill.common.files import require_file
from dart_skill.recording.bags.files import (
    chosen_files,
    has_only_log,
    is_of_ros1,
    is_packed,
    missing_parts,
    open_any,
    part_number,
    storage_of,
    unpack_file,
    unpacked_messages,
    unpacked_name,
)
from dart_skill.recording.bags.metadata import (
    METADATA_FILE,
    RECORD_NAME,
    definition_of,
    full_name,
    known_metadata,
    lost_in,
    message_encoding,
    parse_record,
    profiles,
    topics_of,
)
from dart_skill.recording.mcap import (
    END_OF_TIME,
    BagMessage,
    DamagedError,
    McapInput,
    in_time_order,
)

if TYPE_CHECKING:
    from mcap.records import Attachment, Channel
    from rosbags.interfaces import Qos
    from rosbags.typesys.store import Typestore

    from dart_skill.recording.bags._other_inputs import Ros1Input, SqliteInput

    Input = McapInput | SqliteInput | Ros1Input

_RECOVER = (
    "the file is cut off or damaged, its recorder was probably stopped before it closed the bag:"
    " 'dart-skill bag recover' makes a new bag of what is in it"
)
OF_A_GRAPH = {
    "/wam/command": "dart_skill_msgs/msg/WamCommand",
    "/demonstrations": "dart_skill_msgs/msg/Demonstration",
}
"""Topics by which a graph is known in a bag, without its namespace, and their types."""
ROS1_SUFFIX = ".bag"
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
        Messages.
    start_ns, end_ns
        Log times of its first and last message, 0 without messages.
    library
        Its writer.
    compression
        Of its chunks, or of all of it.
    """

    path: Path
    size: int
    count: int
    start_ns: int
    end_ns: int
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
        self._inputs: list[Input] = []
        self._folder: TemporaryDirectory | None = None
        try:
            with _explained(self.path):
                for file in files:
                    with _explained(file):
                        self._inputs.append(open_any(self._unpacked(file)))
                if not metadata.get("relative_file_paths") and len(files) > 1:
                    _require_one_bag(self.path, self._inputs)
                records = (one for file in self._inputs for one in file.metadata())
                own = [parse_record(one.metadata) for one in records if one.name == RECORD_NAME]
        except BaseException:
            self.close()
            raise
        self.metadata = metadata or (own[-1] if own else {})
        filled = [file for file in self._inputs if file.message_count]
        self.start_ns = min((file.start_ns for file in filled), default=0)
        self.end_ns = max((file.end_ns for file in filled), default=0)
        # of topics, by number of the file and number of the channel
        self._names: dict[tuple[int, int], str] = {}
        self.topics = self._topics()
        self.files = [self._file(*both) for both in zip(files, self._inputs, strict=True)]
        # each file of a split bag has all of them
        schemas = (schema for file in self._inputs for schema in file.schemas.values())
        self._definitions = tuple(dict.fromkeys(map(definition_of, schemas)))
        self.custom_data: dict[str, str] = dict(self.metadata.get("custom_data") or {})
        self.message_count = sum(topic.count for topic in self.topics.values())
        self.storage = self._inputs[0].storage

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
            found = self._called(self._raw_messages(chosen, *limits, decode))
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
        types, unknown = self._all_types
        type_name = str(known)
        if isinstance(known, _DefinedType):
            others = (one for one in self._definitions if one[0] != type_name)
            wanted = frozenset([type_name])
            types, unknown = _types_in((*others, known.definition), self._other_types, wanted)
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
            return [item for file in self._inputs for item in file.attachments()]

    def close(self) -> None:
        """Close the files; twice is no error."""
        for file in self._inputs:
            file.close()
        if self._folder is not None:
            self._folder.cleanup()

    def __enter__(self) -> BagReader:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    def _check_open(self) -> None:
        if not all(file.is_open for file in self._inputs):
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

    def _raw_messages(
        self, topics: set[str], start_ns: int, stop_ns: int, with_definitions: bool
    ) -> Iterator[BagMessage]:
        """Messages in order. with_definitions: types that the bag defines in several ways are a
        `_DefinedType`.
        """
        ways = Counter(name for name, _encoding, _text in self._definitions)
        parts = []
        for k, file in enumerate(self._inputs):
            wanted = {}
            for number, channel in file.channels.items():
                name = self._names[k, number]
                if name not in topics:
                    continue
                type_name = _type_of(file, channel) or self._types[name]
                if with_definitions and ways[type_name] > 1:
                    type_name = _DefinedType(type_name)
                    type_name.definition = definition_of(file.schemas[channel.schema_id])
                wanted[number] = (name, type_name)
            parts += file.parts(wanted, start_ns, stop_ns)
        return unpacked_messages(in_time_order(parts))

    def _unpacked(self, file: Path) -> Path:
        """The file, or what it holds if it was compressed as a whole."""
        if not is_packed(file):
            return file
        self._folder = self._folder or TemporaryDirectory(prefix="dart_skill_")
        return unpack_file(file, Path(self._folder.name))

    def _topics(self) -> dict[str, TopicInfo]:
        """Counts from the files; what only metadata.yaml tells (types of schemaless channels,
        hashes, QoS) from there.

        Where channels of one topic have several encodings, those that are not CDR are topics of
        their own, named after both.
        """
        told_of = topics_of(self.metadata)
        every = [
            (k, number, channel)
            for k, file in enumerate(self._inputs)
            for number, channel in file.channels.items()
        ]
        plain = {one.topic for _, _, one in every if message_encoding(one) == "cdr"}
        found: dict[str, list[tuple[Channel, str, int]]] = {}
        for k, number, channel in every:
            encoding, file = message_encoding(channel), self._inputs[k]
            is_other = encoding != "cdr" and channel.topic in plain
            name = f"{channel.topic} ({encoding})" if is_other else channel.topic
            self._names[k, number] = name
            its = (channel, _type_of(file, channel), file.counts[number])
            found.setdefault(name, []).append(its)
        topics = {
            name: _topic(name, channels, told_of.get(channels[0][0].topic, {}))
            for name, channels in found.items()
        }
        self._types = {name: topic.type_name for name, topic in topics.items()}
        return topics

    def _file(self, file: Path, opened: Input) -> BagFile:
        """What is known of a file."""
        compression = opened.compression or self.metadata.get("compression_format") or ""
        if is_packed(file):
            compression = {".lz4": "lz4"}.get(file.suffix, "zstd")
        size, extent = file.stat().st_size, (opened.start_ns, opened.end_ns)
        return BagFile(file, size, opened.message_count, *extent, opened.library, compression)


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


def _topic(name: str, channels: list[tuple[Channel, str, int]], told: dict) -> TopicInfo:
    """A topic of a bag from its channels, with their types and numbers of messages. told: what
    metadata.yaml says of it.
    """
    filled = [one for one in channels if one[2]] or channels
    types = list(dict.fromkeys(type_name for _, type_name, _ in filled if type_name))
    types = types or [full_name(told.get("type", ""))]
    by_files = [channel.metadata for channel, _, _ in channels]
    hashes = [told.get("type_description_hash"), *(m.get("topic_type_hash") for m in by_files)]
    qos = [told.get("offered_qos_profiles"), *(m.get("offered_qos_profiles") for m in by_files)]
    return TopicInfo(
        name,
        types[0],
        sum(count for _, _, count in channels),
        next(filter(None, hashes), ""),
        next(filter(None, (profiles(name, one) for one in qos)), ()),
        message_encoding(channels[0][0]),
        tuple(types[1:]),
    )


def _type_of(file: Input, channel: Channel) -> str:
    """Message type of a channel, of CDR under its full name; empty if the file does not tell it."""
    schema = file.schemas.get(channel.schema_id)
    name = schema.name if schema is not None else ""
    return full_name(name) if message_encoding(channel) == "cdr" else name


class _DefinedType(str):
    """The name of a type that the bag defines in several ways. definition: its own: name,
    encoding, text.
    """

    definition: tuple[str, str, str]


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
        files = files or sorted(path.glob(f"*{ROS1_SUFFIX}"))
        if not files:
            raise BagError(
                f"{path}: {_lone_logs(path) or 'no .mcap file in this folder' + _of_tables(path)}"
            )
    for file in files:
        require_file(file)
    if lost := [file.name for file in files if has_only_log(file)]:
        raise BagError(
            f"{path}: {lost[0]} is empty (0 bytes), and what was recorded is in {lost[0]}-wal:"
            " 'dart-skill bag recover' reads it"
        )
    filled = [file for file in files if file.stat().st_size]
    if not filled:
        names = ", ".join(file.name for file in files)
        raise BagError(
            f"{path}: {names} is empty (0 bytes): the recorder stopped before its first write"
        )
    if len(files) > 1 and not metadata.get("relative_file_paths"):
        # a part may be missing, but not the first
        stems, numbers = zip(*map(part_number, files), strict=True)
        suffixes = {Path(unpacked_name(file.name)).suffix for file in files}
        are_parts = len(set(stems)) == len(suffixes) == 1 and len(set(numbers)) == len(files)
        reason = ""
        if files[0].suffix == ROS1_SUFFIX:
            reason = "are of ROS 1, which has no bags of several files"
        elif not are_parts or numbers[0] < 0:
            reason = "are not named as the parts of one bag (NAME_0.mcap, NAME_1.mcap ...)"
        elif numbers[0] > 0:
            reason = f"lack the first part of a bag ({missing_parts(files)[0]})"
        if reason:
            raise _not_one_bag(path, len(files), reason)
    return filled


def _not_one_bag(path: Path, count: int, reason: str) -> BagError:
    return BagError(
        f"{path}: {count} files and no metadata.yaml, and they {reason}: open one of them by its"
        " name, or 'dart-skill bag recover' makes one bag of them"
    )


def _require_one_bag(path: Path, files: list[Input]) -> None:
    """Files of a split bag without metadata.yaml (its recorder crashed) follow each other and
    agree on their topics.
    """
    types: dict[str, str] = {}
    for file in files:
        for channel in file.channels.values():
            name, own = channel.topic, _type_of(file, channel)
            if file.counts[channel.id] and types.setdefault(name, own) != own:
                raise _not_one_bag(path, len(files), f"disagree on the type of {name}")
    starts = [file.start_ns for file in files if file.message_count]
    if any(later <= earlier for earlier, later in pairwise(starts)):
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


def describe(
    path: str | os.PathLike, types: Typestore | None = None, with_definitions: bool = True
) -> dict:
    """What a bag holds, in numbers, texts, lists and dicts only (JSON). Raises BagError.

    Parameters
    ----------
    types
        Known message types.
    with_definitions
        Whether to parse those of the bag and tell of each topic if its type is defined
        (`is_defined`), which takes longer than all the rest.
    """
    with BagReader(path, types) as bag:
        duration_ns = bag.end_ns - bag.start_ns
        known = bag.types.fielddefs if with_definitions else {}
        topics = [
            {
                "name": topic.name,
                "type": topic.type_name,
                "other_types": list(topic.other_types),
                "count": topic.count,
                "rate_hz": topic.count / duration_ns * 1e9 if duration_ns else 0.0,
                "encoding": topic.encoding,
                "type_hash": topic.type_hash,
                **({"is_defined": topic.type_name in known} if with_definitions else {}),
                "qos": list(map(_described_qos, topic.qos)),
            }
            for topic in bag.topics.values()
        ]
        files = [
            {
                "path": file.path.name,
                "size_bytes": file.size,
                "message_count": file.count,
                "start_ns": file.start_ns,
                "duration_ns": file.end_ns - file.start_ns,
                "library": file.library,
            }
            for file in bag.files
        ]
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
            "files": files,
            "topics": topics,
            "attachments": [
                {"name": one.name, "media_type": one.media_type, "size_bytes": len(one.data)}
                for one in bag.attachments()
            ],
            "lost": lost_in(bag.custom_data),
            "custom_data": bag.custom_data,
        }


def _described_qos(profile: Qos) -> dict:
    return {
        name: value.name.lower()
        if hasattr(value, "name")
        else {"sec": value.sec, "nsec": value.nsec}
        if hasattr(value, "sec")
        else value
        for name, value in profile._asdict().items()
    }
