"""Reading bags without ROS: rosbag2 folders, with or without metadata.yaml, and single .mcap files.

Messages are decoded by the definitions in the bag, so that types of other packages need no installation.
MCAP files are read here; SQLite files, and bags whose files or messages are compressed one by one, by `rosbags`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinitionFormat

from dart_skill.files import open_file, require_file
from dart_skill.recording.bags._files import ROS1_SUFFIX, SUFFIXES, files_in, named_files, part_number
from dart_skill.recording.bags._metadata import (
    METADATA_FILE,
    METADATA_VERSION,
    RECORD_NAME,
    is_plain_mcap,
    parse_record,
    profiles,
    read_metadata_file,
)
from dart_skill.recording.mcap import END_OF_TIME, LARGEST_UNPACKED, USUAL_RATIO, BagMessage, DamagedError, McapInput, in_time_order

if TYPE_CHECKING:
    from mcap.records import Attachment
    from rosbags.typesys.store import Typestore

    from dart_skill.recording.bags._ros1 import Ros1Source

_RECOVER = (
    "the file is cut off or damaged, its recorder was probably stopped before it closed the bag:"
    " 'dart-skill bag recover' makes a new bag of what is in it"
)
_FORMATS = {MessageDefinitionFormat.MSG: "ros2msg", MessageDefinitionFormat.IDL: "ros2idl"}


OF_A_GRAPH = {"/wam/command": "dart_skill_msgs/msg/WamCommand", "/demonstrations": "dart_skill_msgs/msg/Demonstration"}
"""Topics by which a graph is known in a bag, without its namespace, and their types."""
MAPPED = (".csv", ".tsv", ".txt", ".npy", ".npz", ".mat", ".parquet", ".c3d", ".trc", ".bvh")
"""Endings of files that a mapping describes (docs/recordings.md)."""
MOST_LINES, MOST_LINES_OF_ALL, LARGEST_DEFINITION = 5_000, 20_000, 1_000_000
"""Of the definition of a type, with all that it nests, of all definitions of a bag, and characters of one: they take 0.4 ms a line."""


class BagError(ValueError):
    """A bag that cannot be read, with the reason and, where there is one, the remedy."""


@dataclass(frozen=True)
class TopicInfo:
    """A topic of a bag.

    * type_name: as package/msg/Name.
    * count: messages.
    * type_hash: RIHS01; empty where the bag does not tell it.
    * qos: profiles of `rosbags`.
    * encoding: of the messages.
    """

    name: str
    type_name: str
    count: int
    type_hash: str
    qos: tuple
    encoding: str = "cdr"


@dataclass(frozen=True)
class BagFile:
    """A file of a bag.

    size: in bytes.
    count: messages; None if nobody tells it of this file alone.
    start_ns, end_ns: log times of its first and last message, 0 without messages; None like count.
    library: its writer.
    compression: of its chunks, or of all of it.
    """

    path: Path
    size: int
    count: int | None
    start_ns: int | None
    end_ns: int | None
    library: str = ""
    compression: str = ""


class BagReader:
    """An open bag; a context manager. Raises BagError for what is no whole bag.

    * path: rosbag2 folder, or .mcap or .db3 file.
    * types: definitions for topics whose bag holds none, or what makes these when they are needed (`typestore`). The attribute of this name
      decodes the messages. Bags that define the same types share it: make another store to add to it.

    Attributes:

    * topics: TopicInfo by name.
    * files: a list of BagFile, in order.
    * storage: how rosbag2 calls the format of the files: mcap or sqlite3; ros1 for a bag of ROS 1.
    * metadata: of rosbag2, from metadata.yaml or, without it, from the file; empty if neither tells them.
    * custom_data: names and texts of the metadata, as `BagWriter` got them.
    * start_ns, end_ns: log times of the first and last message; 0 for an empty bag.
    * message_count: on all topics.
    """

    def __init__(self, path: str | os.PathLike, types: Typestore | Callable[[], Typestore] | None = None):
        self.path, self._given = Path(path), types
        files = _storage_files(self.path)
        with _explained(self.path):
            metadata = read_metadata_file(self.path) if self.path.is_dir() and (self.path / METADATA_FILE).exists() else None
            self._source = source = _open(self.path, files, metadata)
            self._definitions = tuple(dict.fromkeys(source.definitions()))  # each file of a split bag has all of them
        self.topics, self.files, self.metadata = source.topics, source.files, source.metadata
        self.start_ns, self.end_ns = source.start_ns, source.end_ns
        self.custom_data: dict[str, str] = dict(source.custom_data)
        self.message_count = sum(topic.count for topic in self.topics.values())
        suffixes = {suffix for file in self.files for suffix in file.path.suffixes}
        self.storage = "sqlite3" if ".db3" in suffixes else "ros1" if ROS1_SUFFIX in suffixes else "mcap"

    @property
    def types(self) -> Typestore:
        """Of the messages; parsed when somebody asks for the first time, which takes longer than to open a bag."""
        return self._all_types[0]

    @cached_property
    def _all_types(self) -> tuple[Typestore, dict[str, str]]:
        """All types that are known, and why others are not."""
        store, unknown = _shared_types(self._definitions)
        if self._given is None or all(topic.type_name in store.fielddefs for topic in self.topics.values()):
            return store, unknown
        return embedded_types(self._definitions, self._given() if callable(self._given) else self._given)

    def messages(
        self,
        topics: Iterable[str] | None = None,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        decode: bool = True,
        every_ns: int = 0,
    ) -> Iterator[BagMessage]:
        """Messages in order of log time.

        topics: names; None: all.
        start_ns, stop_ns: log times from the first to before the second; None: no limit.
        decode: give objects instead of CDR bytes.
        every_ns: log time at least from a message of a topic to the next one that is given; 0: all are.
        """
        chosen = self._chosen(topics)
        limits = (0 if start_ns is None else start_ns, END_OF_TIME if stop_ns is None else stop_ns)
        with _explained(self.path):
            found = self._called(self._source.messages(chosen, *limits))
            found = _thinned(found, every_ns) if every_ns else found
            yield from map(self._decoded, found) if decode else found

    def to_pandas(self, topic: str, start_ns: int | None = None, stop_ns: int | None = None) -> Any:
        """Messages of a topic as a pandas.DataFrame: a row for each, by its log time [ns]; columns as `pose.position.x`, `position[0]`.

        Stamps and durations are nanoseconds. start_ns, stop_ns: as for `messages`. ModuleNotFoundError without pandas.
        """
        from dart_skill.recording.bags._frames import frame_of

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

    def _decoded(self, message: BagMessage) -> BagMessage:
        from dart_skill.recording.bags.messages import deserialize

        topic, type_name, stamp_ns, data = message
        encoding = self.topics[topic].encoding
        if encoding != "cdr":
            raise BagError(f"{self.path}: topic {topic} is encoded as '{encoding}', not as cdr: read it raw")
        if type_name not in self.types.fielddefs:
            reason = self._all_types[1].get(type_name, "which neither the bag nor the given types define")
            raise BagError(
                f"{self.path}: topic {topic} has type {type_name}, {reason}: give a typestore with its folder of .msg files, or read it raw"
            )
        try:
            return BagMessage(topic, type_name, stamp_ns, deserialize(self.types, type_name, data))
        except ValueError as error:
            raise BagError(f"{self.path}: topic {topic}: {error}") from error


class GraphBag(BagReader):
    """An open bag of one graph, whichever namespace it ran in: /arm1/joint_states is called /joint_states here.

    namespace: that one, "" without one; found by the topics of commands and of demonstrations.

    BagError for a bag of several graphs.
    """

    def __init__(self, path: str | os.PathLike, types: Typestore | Callable[[], Typestore] | None = None):
        super().__init__(path, types)
        self.namespace = self._found_namespace()
        self._full = {self._in_graph(name): name for name in self.topics}
        self.topics = {name: replace(self.topics[full], name=name) for name, full in self._full.items()}

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
            raise BagError(f"{self.path}: of several graphs, in the namespaces {spaces}: record each into a bag of its own")
        return found.pop() if found else ""

    def _in_graph(self, name: str) -> str:
        return name.removeprefix(self.namespace) if name.startswith(f"{self.namespace}/") else name


class _McapSource:
    """The MCAP files of a bag, in order."""

    def __init__(self, path: Path, files: list[Path], metadata: dict | None):
        self._files: list[McapInput] = []
        try:
            for file in files:
                with _explained(file):
                    self._files.append(McapInput(file))
            if metadata is None and len(files) > 1:
                _require_one_bag(path, self._files)
        except BaseException:
            self.close()
            raise
        filled = [file for file in self._files if file.message_count]
        self.start_ns = min((file.start_ns for file in filled), default=0)
        self.end_ns = max((file.end_ns for file in filled), default=0)
        self.metadata = metadata if metadata is not None else self._embedded_metadata()
        self.custom_data = self.metadata.get("custom_data") or {}
        self.topics = self._topics()
        self.files = [
            BagFile(
                file.path, file.path.stat().st_size, file.message_count, file.start_ns, file.end_ns, file.header.library, file.compression
            )
            for file in self._files
        ]

    @property
    def is_open(self) -> bool:
        return all(file.is_open for file in self._files)

    def definitions(self) -> Iterator[tuple[str, str, str]]:
        """Type name, schema encoding and definition text of each type."""
        for file in self._files:
            for schema in file.schemas.values():
                yield schema.name, schema.encoding, schema.data.decode(errors="replace")

    def messages(self, topics: set[str], start_ns: int, stop_ns: int) -> Iterator[BagMessage]:
        parts = []
        for file in self._files:
            wanted = {
                number: (channel.topic, file.type_name(channel) or self.topics[channel.topic].type_name)
                for number, channel in file.channels.items()
                if channel.topic in topics
            }
            parts += file.parts(wanted, start_ns, stop_ns)
        return in_time_order(parts)

    def attachments(self) -> list[Attachment]:
        return [item for file in self._files for item in file.attachments()]

    def close(self) -> None:
        for file in self._files:
            file.close()

    def _embedded_metadata(self) -> dict:
        """What the last file tells by itself."""
        records = [record for file in self._files for record in file.metadata() if record.name == RECORD_NAME]
        return parse_record(records[-1].metadata) if records else {}

    def _topics(self) -> dict[str, TopicInfo]:
        """Counts from the files; what only metadata.yaml tells (types of schemaless channels, hashes, QoS) from there."""
        items = [item["topic_metadata"] for item in self.metadata.get("topics_with_message_count") or []]
        told_of = {told["name"]: told for told in items}
        found: dict[str, TopicInfo] = {}
        for file in self._files:
            for number, channel in file.channels.items():
                name, known = channel.topic, found.get(channel.topic)
                told = told_of.get(name, {})
                qos = told.get("offered_qos_profiles") or channel.metadata.get("offered_qos_profiles", "")
                found[name] = TopicInfo(
                    name,
                    (known and known.type_name) or file.type_name(channel) or told.get("type", ""),
                    file.counts[number] + (known.count if known else 0),
                    told.get("type_description_hash") or channel.metadata.get("topic_type_hash", ""),
                    profiles(name, qos),
                    channel.message_encoding,
                )
        return found


class _RosbagsSource:
    """A bag that `rosbags` reads."""

    def __init__(self, path: Path, files: list[Path], metadata: dict | None):
        from rosbags.rosbag2 import Reader

        for file in named_files(path, metadata or {}) or files:
            _check_compressed(file)
        self.metadata = metadata or {}
        self._reader = reader = Reader(path if metadata else files[0])
        reader.open()
        self.start_ns = reader.start_time if reader.message_count else 0
        self.end_ns = reader.end_time - 1 if reader.message_count else 0
        self.custom_data = reader.storage.metadata.custom or {}
        self.files = self._described(named_files(path, self.metadata) or files[:1])
        self.topics = {
            one.topic: TopicInfo(
                one.topic,
                one.msgtype,
                sum(other.msgcount for other in reader.connections if other.topic == one.topic),
                one.digest,
                tuple(_ext(one).offered_qos_profiles),
                _ext(one).serialization_format,
            )
            for one in reader.connections
        }

    @property
    def is_open(self) -> bool:
        return self._reader.is_open

    def _described(self, files: list[Path]) -> list[BagFile]:
        """What metadata.yaml says of each file; of a single one it is what there is in all."""
        whole = (self._reader.message_count, self.start_ns, self.end_ns)
        told = {PurePath(item["path"]).name: _told_extent(item) for item in self.metadata.get("files") or []}
        unknown = whole if len(files) == 1 else (None, None, None)
        compression = self.metadata.get("compression_format", "")
        described = []
        for file in files:
            count, start_ns, end_ns = told.get(file.name, unknown)
            described.append(BagFile(file, file.stat().st_size, count, start_ns, end_ns, compression=compression))
        return described

    def definitions(self) -> Iterator[tuple[str, str, str]]:
        """Type name, schema encoding and definition text of each type."""
        for one in self._reader.connections:
            if one.msgdef.format in _FORMATS:
                yield one.msgtype, _FORMATS[one.msgdef.format], one.msgdef.data

    def messages(self, topics: set[str], start_ns: int, stop_ns: int) -> Iterator[BagMessage]:
        chosen = [one for one in self._reader.connections if one.topic in topics]
        if not chosen:
            return
        for one, stamp_ns, data in self._reader.messages(chosen, start_ns, min(stop_ns, 2**63 - 1)):
            yield BagMessage(one.topic, one.msgtype, stamp_ns, bytes(data))

    def attachments(self) -> list[Attachment]:
        return []

    def close(self) -> None:
        if self._reader.is_open:
            self._reader.close()


def _check_compressed(file: Path) -> None:
    """BagError for a file that unpacks to far more than it is; `rosbags` would put all of it on the disk."""
    require_file(file)
    if file.suffix not in (".zstd", ".zst"):
        return
    import zstandard

    size, most = 0, max(LARGEST_UNPACKED, USUAL_RATIO * file.stat().st_size)
    with open_file(file) as stream, zstandard.ZstdDecompressor().stream_reader(stream) as unpacked:
        while part := unpacked.read(2**20):
            size += len(part)
            if size > most:
                raise BagError(f"{file.name} unpacks to more than {most} bytes: no recording is so much larger than its file")


def _told_extent(item: dict) -> tuple[int, int, int]:
    """Count, first and last log time of a file, as metadata.yaml tells them."""
    start = item["starting_time"]["nanoseconds_since_epoch"]
    return item["message_count"], start, start + item["duration"]["nanoseconds"]


def _of_tables(folder: Path) -> str:
    """What to say of a folder that holds tables or motion capture instead of a bag; empty for another one."""
    found = sorted({file.suffix.lower() for file in folder.iterdir()} & set(MAPPED))
    if not found:
        return ""
    own = folder / "mapping.yaml"
    what = "CSV" if ".csv" in found else found[0]
    return f"; its {what} files are read with --mapping {own if own.is_file() else 'FILE'}, which names their columns"


def _storage_files(path: Path) -> list[Path]:
    """Files that hold a bag's messages, in order; BagError if there are none, or several that are not one bag's."""
    if not path.exists():
        raise BagError(f"{path}: no such bag")
    if not path.is_dir():
        require_file(path)
    if path.is_file() and path.suffix not in SUFFIXES:
        raise BagError(
            f"{path}: a bag is a folder with metadata.yaml, or a .mcap or .db3 file, or a .bag file of ROS 1; others need --mapping"
        )
    files = [path] if path.is_file() else files_in(path)
    if not files and not any(path.glob("*.zstd")):
        raise BagError(f"{path}: no .mcap file in this folder{_of_tables(path)}")
    for file in files:
        require_file(file)
    empty = [file.name for file in files if file.stat().st_size == 0]
    if empty:
        raise BagError(f"{path}: {', '.join(empty)} is empty (0 bytes): the recorder stopped before its first write")
    if len(files) > 1 and not (path / METADATA_FILE).is_file():
        name, _ = part_number(files[0])
        if files[0].suffix != ".mcap" or [part_number(file) for file in files] != [(name, k) for k in range(len(files))]:
            raise _not_one_bag(path, len(files), "are not named as the parts of one bag (NAME_0.mcap, NAME_1.mcap ...)")
    return files


def _not_one_bag(path: Path, count: int, reason: str) -> BagError:
    return BagError(f"{path}: {count} files and no metadata.yaml, and they {reason}: open one of them by its name")


def _require_one_bag(path: Path, files: list[McapInput]) -> None:
    """Files of a split bag without metadata.yaml (its recorder crashed) follow each other and agree on their topics."""
    types: dict[str, str] = {}
    for file in files:
        for channel in file.channels.values():
            if types.setdefault(channel.topic, file.type_name(channel)) != file.type_name(channel):
                raise _not_one_bag(path, len(files), f"disagree on the type of {channel.topic}")
    starts = [file.start_ns for file in files if file.message_count]
    if any(later <= earlier for earlier, later in zip(starts, starts[1:], strict=False)):
        raise _not_one_bag(path, len(files), "do not follow each other in time")


def _thinned(messages: Iterable[BagMessage], every_ns: int) -> Iterator[BagMessage]:
    """Of each topic no message sooner after the last one than so long [ns]; where log time jumps back, the next one."""
    last: dict[str, int] = {}
    for one in messages:
        since = one.stamp_ns - last.get(one.topic, one.stamp_ns - every_ns)
        if since >= every_ns or since < 0:
            last[one.topic] = one.stamp_ns
            yield one


def _open(path: Path, files: list[Path], metadata: dict | None) -> _McapSource | _RosbagsSource | Ros1Source:
    """What reads the bag."""
    if files and files[0].suffix == ROS1_SUFFIX:
        from dart_skill.recording.bags._ros1 import Ros1Source

        return Ros1Source(files[0])
    if metadata is None:
        return _McapSource(path, files, None) if files[0].suffix == ".mcap" else _RosbagsSource(path, files, None)
    try:
        is_ours = is_plain_mcap(metadata) and metadata["version"] <= METADATA_VERSION
    except (KeyError, TypeError, AttributeError) as error:
        raise BagError(f"{path}: its metadata.yaml lacks or misuses {error}") from error
    if not is_ours:
        return _RosbagsSource(path, files, metadata)
    named = named_files(path, metadata)
    missing = [file.name for file in named if not file.is_file()]
    if missing or not named:
        raise BagError(f"{path}: {', '.join(missing) or 'every file'} is missing, which metadata.yaml names")
    return _McapSource(path, named, metadata)


@lru_cache(maxsize=8)
def _shared_types(definitions: tuple[tuple[str, str, str], ...]) -> tuple[Typestore, dict[str, str]]:
    """As `embedded_types` without others, once for all bags that define the same, as those of one graph do."""
    return embedded_types(definitions, None)


def embedded_types(definitions: Iterable[tuple[str, str, str]], types: Typestore | None) -> tuple[Typestore, dict[str, str]]:
    """Types that the bag defines, and those of `types` that it lacks; and why the others are unknown."""
    from rosbags.typesys import Stores, get_typestore

    found, unknown, lines = {}, {}, 0
    for name, encoding, text in dict.fromkeys(definitions):  # each file of a split bag has all of them
        own = text.count("\n") + text.count(";") + 1
        lines += own
        if own > MOST_LINES or lines > MOST_LINES_OF_ALL or len(text) > LARGEST_DEFINITION:
            unknown[name] = f"whose definition in the bag is too long: {own} lines of {lines} so far, {len(text)} characters"
            continue
        try:
            found.update(_types_in(name, encoding, text))
        except Exception as error:  # generated parsers meet arbitrary text
            unknown[name] = f"whose definition in the bag is damaged ({error})"
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(found)
    except Exception:  # two definitions that cannot be in one store, or names that are none: as many as can be
        for name, fields in found.items():
            try:
                store.register({name: fields})
            except Exception as error:
                unknown[name] = f"whose definition in the bag is damaged ({error})"
    if types is not None:
        store.register({name: types.fielddefs[name] for name in types.fielddefs.keys() - found.keys()})
    return store, unknown


@lru_cache(maxsize=256)
def _types_in(name: str, encoding: str, text: str) -> dict:
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    if encoding == "ros2msg":
        return get_types_from_msg(text, name) if text else {}
    found: dict = {}
    if encoding in ("ros2idl", "omgidl"):
        for part in text.split("=" * 80 + "\n"):
            body = part.split("\n", 1)[1] if part.startswith("IDL: ") else part
            found.update(get_types_from_idl(body) if body.strip() else {})
    return found


def _ext(connection: Connection) -> ConnectionExtRosbag2:
    assert isinstance(connection.ext, ConnectionExtRosbag2)
    return connection.ext


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
