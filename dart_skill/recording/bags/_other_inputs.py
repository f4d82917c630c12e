"""SQLite files of rosbag2 (schema versions 1 to 4) and bags of ROS 1, shown as MCAP files are:
topics as channels, definitions as schemas.

They are only read: what a recorder that was stopped left beside an SQLite file, its journal or
write-ahead log, is applied to a copy. Bags of ROS 1 are read by `rosbags`: their messages become
the CDR of ROS 2, by the definitions in the bag. Types have the names of ROS 2
(`geometry_msgs/msg/PoseStamped`), and headers no `seq`.
"""

from __future__ import annotations

import shutil
import sqlite3
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING
from urllib.parse import quote

from mcap.records import Attachment, Channel, Metadata, Schema

from dart_skill.common.files import require_file
from dart_skill.recording.bags.files import SIDE_FILES, side_files
from dart_skill.recording.bags.metadata import RECORD_KEY, RECORD_NAME
from dart_skill.recording.mcap import BagMessage, DamagedError, in_arrays

if TYPE_CHECKING:
    import numpy as np

    from dart_skill.recording.mcap.reader import Part

_READABLE = "(typeof(timestamp) = 'integer' AND typeof(data) = 'blob')"
"""Condition of a row of messages with a time and bytes; SQLite does not forbid others."""
LATEST_NS = 2**63 - 1
"""Largest time of SQLite [ns]."""


def copy_with_side_files(file: Path, folder: Path) -> Path:
    """A copy of an SQLite file with what stands beside it, which SQLite may change when it opens
    it.

    Parameters
    ----------
    file
        Which is only read.
    folder
        Of the copy.

    Returns
    -------
    Path
        The copy.
    """
    for one in [file, *side_files(file).values()]:
        shutil.copyfile(one, folder / one.name)
    return folder / file.name


class SqliteInput:
    """A SQLite file of a bag, open for reading, with the attributes of `McapInput`.

    Attributes
    ----------
    beside
        What was found beside the file and read with it, as a text; empty if there was nothing.
    n_unreadable
        Messages without a time, or without bytes.

    Raises
    ------
    DamagedError
        For what is none.
    """

    storage = "sqlite3"
    library = compression = ""
    is_counted = False

    def __init__(self, path: Path):
        require_file(path)
        self.path = path
        self._folder: TemporaryDirectory | None = None
        self._database: sqlite3.Connection | None = None
        self._database = self._open()
        try:
            with _explained():
                self._take_topics()
                self._take_counts()
        except BaseException:
            self.close()
            raise

    @property
    def is_open(self) -> bool:
        """Whether it can be read."""
        return self._database is not None

    def metadata(self) -> list[Metadata]:
        """What rosbag2 says of the file in it, the last one as it was when the file was closed."""
        if "metadata" not in self._columns("metadata"):
            return []
        with _explained():
            texts = self._all("SELECT metadata FROM metadata ORDER BY rowid")
        return [Metadata(name=RECORD_NAME, metadata={RECORD_KEY: str(text)}) for (text,) in texts]

    def attachments(self) -> list[Attachment]:
        """None: such files have no place for them."""
        return []

    def parts(self, wanted: dict[int, tuple[str, str]], start_ns: int, stop_ns: int) -> list[Part]:
        """See `McapInput`: one, whose messages are read as they are needed."""
        if not wanted or stop_ns <= start_ns or start_ns > LATEST_NS:
            return []
        query = (
            f"topic_id IN ({', '.join(map(str, wanted))}) AND timestamp BETWEEN"
            f" {start_ns or -LATEST_NS} AND {min(stop_ns - 1, LATEST_NS)} ORDER BY timestamp, rowid"
        )

        def read() -> Iterator[BagMessage]:
            for number, stamp_ns, data in self.rows(query):
                yield BagMessage(*wanted[number], stamp_ns, data)

        return [(self.start_ns, self.end_ns, read)]

    def rows(self, which: str = "TRUE ORDER BY rowid") -> Iterator[tuple[int, int, bytes]]:
        """Topic, log time and bytes of each message, in the order in which they were written.

        Parameters
        ----------
        which
            A condition and an order of SQL.

        Raises
        ------
        DamagedError
        """
        assert self._database is not None  # or the reader has said that the bag is closed
        with _explained():
            yield from self._database.execute(
                f"SELECT topic_id, timestamp, data FROM messages WHERE {_READABLE} AND {which}"
            )

    def faults(self) -> list[str]:
        """What SQLite finds to be wrong with its tables and indexes."""
        try:
            return [
                str(text) for (text,) in self._all("PRAGMA integrity_check(10)") if text != "ok"
            ]
        except (sqlite3.Error, UnicodeDecodeError) as error:
            return [str(error)]

    def log_times(self, wanted: Mapping[int, int]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """See `McapInput`."""
        assert self._database is not None
        query = (
            f"SELECT topic_id, timestamp FROM messages WHERE {_READABLE} AND topic_id IN"
            f" ({', '.join(map(str, wanted))}) ORDER BY rowid"
        )
        with _explained():
            rows = self._database.execute(query)
            yield from in_arrays((wanted[number], stamp_ns) for number, stamp_ns in rows)

    def close(self) -> None:
        """Close the file; twice is no error."""
        if self._database is not None:
            self._database.close()
            self._database = None
        if self._folder is not None:
            self._folder.cleanup()

    def _open(self) -> sqlite3.Connection:
        path, found = self.path, side_files(self.path)
        self.beside = ", ".join(
            f"{file.name} (a {SIDE_FILES[ending]}, which was read, too)"
            for ending, file in found.items()
        )
        if found:
            self._folder = TemporaryDirectory(prefix="dart_skill_")
            path = copy_with_side_files(self.path, Path(self._folder.name))
        uri = f"file:{quote(str(path.resolve()))}" + ("" if found else "?mode=ro&immutable=1")
        with _explained():
            # a player reads in another thread than the one that has opened the bag
            database = sqlite3.connect(uri, uri=True, check_same_thread=False)
        database.text_factory = lambda data: data.decode(errors="replace")
        return database

    def _all(self, query: str) -> list[tuple]:
        assert self._database is not None
        return self._database.execute(query).fetchall()

    def _columns(self, table: str) -> set[str]:
        return {str(row[1]) for row in self._all(f"PRAGMA table_info({table})")}

    def _take_topics(self) -> None:
        columns = self._columns("topics")
        for what, needed, there in (
            ("topics", {"id", "name", "type"}, columns),
            ("messages", {"topic_id", "timestamp", "data"}, self._columns("messages")),
        ):
            if missing := needed - there:
                raise DamagedError(
                    f"it is no bag: its table of {what} lacks {', '.join(sorted(missing))}"
                )
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        wanted = "topic_type, encoding, encoded_message_definition"
        if set(wanted.split(", ")) <= self._columns("message_definitions"):
            rows = self._all(f"SELECT {wanted} FROM message_definitions ORDER BY rowid")
            for number, (name, encoding, text) in enumerate(rows, start=1):
                self.schemas[number] = Schema(
                    id=number, name=str(name), encoding=str(encoding), data=str(text).encode()
                )
        optional = ("serialization_format", "offered_qos_profiles", "type_description_hash")
        fields = ", ".join(name if name in columns else "''" for name in optional)
        for number, name, type_name, encoding, qos, type_hash in self._all(
            f"SELECT id, name, type, {fields} FROM topics ORDER BY id"
        ):
            known = next(
                (one.id for one in self.schemas.values() if one.name == type_name),
                len(self.schemas) + 1,
            )
            self.schemas.setdefault(
                known, Schema(id=known, name=str(type_name), encoding="", data=b"")
            )
            self.channels[number] = Channel(
                id=number,
                topic=str(name),
                message_encoding=str(encoding) or "cdr",
                schema_id=known,
                metadata={"offered_qos_profiles": str(qos), "topic_type_hash": str(type_hash)},
            )

    def _take_counts(self) -> None:
        columns = f"topic_id, COUNT(*), MIN(timestamp), MAX(timestamp), SUM({_READABLE})"
        counted = self._all(f"SELECT {columns} FROM messages GROUP BY topic_id")
        self.n_unreadable = sum(row[1] - row[4] for row in counted)
        own = [row for row in counted if row[0] in self.channels]
        self.counts: Counter[int] = Counter({row[0]: row[1] for row in own})
        self.strays = {row[0]: row[1] for row in counted if row not in own}
        self.message_count = self.counts.total()
        times = [time for row in own for time in row[2:4] if type(time) is int]
        self.start_ns, self.end_ns = min(times, default=0), max(times, default=0)


@contextmanager
def _explained() -> Iterator[None]:
    try:
        yield
    # the second where what SQLite says is no text, as it quotes damaged bytes
    except (
        sqlite3.Error,
        UnicodeDecodeError,
    ) as error:
        raise DamagedError(f"SQLite cannot read it ({error})") from error


HEADER = "std_msgs/msg/Header"
RENAMED = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}
"""Types of ROS 1 that are called differently in ROS 2, and the same there."""


class Ros1Input:
    """A bag of ROS 1, open for reading, with the attributes of `McapInput` that a reader needs.

    Raises
    ------
    ValueError
        For what is none, as rosbags says it.
    """

    storage = "ros1"
    library = compression = ""

    def __init__(self, path: Path):
        from rosbags.rosbag1 import Reader
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self._reader = reader = Reader(path)
        try:
            reader.open()
        except Exception as error:
            if "not indexed" not in str(error):
                raise
            raise ValueError(
                "its recorder was stopped before it wrote the index: 'rosbag reindex' of ROS 1"
                " makes it whole"
            ) from error
        self._store = store = get_typestore(Stores.EMPTY)
        connections = sorted(reader.connections, key=lambda one: one.topic)
        names = {one.id: RENAMED.get(one.msgtype, one.msgtype) for one in connections}
        found: dict = dict(get_typestore(Stores.ROS1_NOETIC).fielddefs)
        for one in connections:
            found |= get_types_from_msg(one.msgdef.data, names[one.id])
        store.register({**found, HEADER: get_typestore(Stores.ROS2_JAZZY).fielddefs[HEADER]})
        self.schemas, self.channels = {}, {}
        for one in connections:
            self.schemas[one.id] = Schema(
                id=one.id,
                name=names[one.id],
                encoding="ros2msg",
                data=store.generate_msgdef(names[one.id], ros_version=2)[0].encode(),
            )
            self.channels[one.id] = Channel(
                id=one.id, topic=one.topic, message_encoding="cdr", schema_id=one.id, metadata={}
            )
        self.counts = Counter({one.id: one.msgcount for one in connections})
        self.message_count = reader.message_count
        self.start_ns = reader.start_time if reader.message_count else 0
        self.end_ns = reader.end_time - 1 if reader.message_count else 0

    @property
    def is_open(self) -> bool:
        """Whether messages can be read."""
        return self._reader.bio is not None

    def metadata(self) -> list[Metadata]:
        """None: such bags have no place for them."""
        return []

    def attachments(self) -> list[Attachment]:
        """None, neither."""
        return []

    def parts(self, wanted: dict[int, tuple[str, str]], start_ns: int, stop_ns: int) -> list[Part]:
        """See `McapInput`: one, whose messages are read as they are needed."""
        chosen = [one for one in self._reader.connections if one.id in wanted]

        def read() -> Iterator[BagMessage]:
            for one, stamp_ns, data in self._reader.messages(
                chosen, start_ns, min(stop_ns, LATEST_NS)
            ):
                topic, type_name = wanted[one.id]
                cdr = self._store.ros1_to_cdr(data, RENAMED.get(one.msgtype, one.msgtype))
                yield BagMessage(topic, type_name, stamp_ns, bytes(cdr))

        return [(self.start_ns, self.end_ns, read)] if chosen else []

    def close(self) -> None:
        """Close the file; twice is no error."""
        if self.is_open:
            self._reader.close()
