"""Reading bags without ROS: rosbag2 folders, with or without metadata.yaml, and single .mcap files.

Messages are decoded by the definitions in the bag, so that types of other packages need no installation.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from mcap.reader import make_reader
from rosbags.interfaces import MessageDefinitionFormat
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from dart_skill.recording.messages import deserialize

_CUT_OFF = (OSError, TypeError, AssertionError, EOFError)  # what readers raise where a record ends too early


class BagError(ValueError):
    """A bag that cannot be read, with the reason and, where there is one, the remedy."""


class BagMessage(NamedTuple):
    """A message. stamp_ns: log time; data: CDR bytes or, decoded, an object with the message's fields."""

    topic: str
    type_name: str
    stamp_ns: int
    data: Any


@dataclass(frozen=True)
class TopicInfo:
    """A topic of a bag. type_hash is empty where the bag does not tell it; qos: rosbags' profiles."""

    name: str
    type_name: str
    count: int
    type_hash: str
    qos: tuple


@dataclass(frozen=True)
class BagAttachment:
    """A file that was kept with a bag."""

    name: str
    media_type: str
    data: bytes


class BagReader:
    """An open bag; a context manager.

    path: rosbag2 folder or .mcap file. types: definitions for topics whose bag holds none
    (`messages.typestore`). Raises BagError for what is no whole bag.
    """

    def __init__(self, path: str | os.PathLike, types: Typestore | None = None):
        self.path = Path(path)
        self._reader = None
        self._files = _storage_files(self.path)
        # Without its metadata.yaml a folder is as good as the file in it.
        whole = self.path.is_dir() and (self.path / "metadata.yaml").is_file()
        source = self.path if whole else self._files[0]
        with _explained(source):
            self._reader = Reader(source)
            self._reader.open()
            self.types = _embedded_types(self._reader.connections, types)

    @property
    def topics(self) -> dict[str, TopicInfo]:
        """Topics by name."""
        return {
            connection.topic: TopicInfo(
                connection.topic,
                connection.msgtype,
                sum(c.msgcount for c in self._reader.connections if c.topic == connection.topic),
                connection.digest,
                tuple(connection.ext.offered_qos_profiles),
            )
            for connection in self._reader.connections
        }

    @property
    def start_ns(self) -> int:
        """Log time of the first message; 0 for an empty bag."""
        return self._reader.start_time if self._reader.message_count else 0

    @property
    def end_ns(self) -> int:
        """Log time of the last message; 0 for an empty bag."""
        return self._reader.end_time - 1 if self._reader.message_count else 0

    @property
    def message_count(self) -> int:
        """Number of messages on all topics."""
        return self._reader.message_count

    @property
    def custom_data(self) -> dict[str, str]:
        """Names and texts of the bag's metadata, as `BagWriter` got them."""
        return dict(self._reader.storage.metadata.custom or {})

    def messages(
        self,
        topics: Iterable[str] | None = None,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        decode: bool = True,
    ) -> Iterator[BagMessage]:
        """Messages of topics (default: all) in order of log time, from start_ns to before stop_ns."""
        chosen = self._connections(topics)
        if not chosen:
            return
        raw = self._reader.messages(chosen, start_ns, stop_ns)
        while True:
            with _explained(self.path):
                item = next(raw, None)
                if item is None:
                    return
                connection, stamp_ns, data = item
                if decode:
                    data = self._decode(connection, data)
            yield BagMessage(connection.topic, connection.msgtype, stamp_ns, data)

    def attachments(self) -> list[BagAttachment]:
        """Files that were kept with the bag."""
        found = []
        for file in (file for file in self._files if file.suffix == ".mcap"):
            with _explained(file), open(file, "rb") as stream:
                items = make_reader(stream).iter_attachments()
                found += [BagAttachment(item.name, item.media_type, item.data) for item in items]
        return found

    def close(self) -> None:
        """Close the files; twice is no error."""
        if self._reader is not None and self._reader.is_open:
            self._reader.close()

    def __enter__(self) -> BagReader:
        return self

    def __exit__(self, *_exception) -> None:
        self.close()

    def _connections(self, topics):
        if not self._reader.is_open:
            raise BagError(f"{self.path}: the bag is closed")
        if topics is None:
            return self._reader.connections
        wanted = {topics} if isinstance(topics, str) else set(topics)
        unknown = wanted - set(self.topics)
        if unknown:
            raise BagError(f"{self.path}: no topic {sorted(unknown)}, only {sorted(self.topics)}")
        return [connection for connection in self._reader.connections if connection.topic in wanted]

    def _decode(self, connection, data):
        if connection.msgtype not in self.types.fielddefs:
            raise BagError(
                f"{self.path}: topic {connection.topic} has type {connection.msgtype}, which neither the bag"
                " nor the given types define: give a typestore with its folder of .msg files, or read it raw"
            )
        try:
            return deserialize(self.types, connection.msgtype, data)
        except ValueError as error:
            raise BagError(f"{self.path}: topic {connection.topic}: {error}") from error


def _storage_files(path: Path) -> list[Path]:
    """Files that hold the messages; BagError if there are none, or several in unknown order."""
    if not path.exists():
        raise BagError(f"{path}: no such bag")
    if path.is_file():
        files = [path]
        if path.suffix not in (".mcap", ".db3"):
            raise BagError(f"{path}: a bag is a folder with metadata.yaml, or a .mcap or .db3 file")
    else:
        files = sorted(file for file in path.iterdir() if file.suffix in (".mcap", ".db3"))
    if not files:
        raise BagError(f"{path}: no .mcap file in this folder")
    empty = [file.name for file in files if file.stat().st_size == 0]
    if empty:
        raise BagError(f"{path}: {', '.join(empty)} is empty (0 bytes): the recorder stopped before its first write")
    if len(files) > 1 and not (path / "metadata.yaml").is_file():
        raise BagError(f"{path}: {len(files)} files and no metadata.yaml: open one of them by its name")
    return files


def _embedded_types(connections, types: Typestore | None) -> Typestore:
    """Types that the bag defines, and those of `types` that it lacks."""
    found: dict = {}
    for connection in connections:
        text = connection.msgdef.data
        if connection.msgdef.format == MessageDefinitionFormat.MSG:
            found.update(get_types_from_msg(text, connection.msgtype))
        elif connection.msgdef.format == MessageDefinitionFormat.IDL:
            for part in text.split("=" * 80 + "\n"):
                body = part.split("\n", 1)[1] if part.startswith("IDL: ") else part
                found.update(get_types_from_idl(body) if body.strip() else {})
    store = get_typestore(Stores.EMPTY)
    store.register(found)
    if types is not None:
        store.register({name: types.fielddefs[name] for name in types.fielddefs.keys() - found.keys()})
    return store


@contextmanager
def _explained(path: Path):
    """Whatever a reader makes of foreign bytes becomes a BagError that names the bag."""
    try:
        yield
    except BagError:
        raise
    except Exception as error:
        reason = (str(error) or type(error).__name__).rstrip(".")
        if "end magic" in reason or "Truncated" in reason or isinstance(error, _CUT_OFF):
            reason += ": the file is cut off or damaged, its recorder was probably stopped before it closed the bag"
        raise BagError(f"{path}: {reason}") from error
