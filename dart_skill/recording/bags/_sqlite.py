"""SQLite files of rosbag2 (schema versions 1 to 4), shown as MCAP files are: topics as channels,
definitions as schemas.

They are only read: what a recorder that was stopped left beside a file, its journal or write-ahead
log, is applied to a copy.
"""

from __future__ import annotations

import shutil
import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING
from urllib.parse import quote

from mcap.records import Attachment, Channel, Metadata, Schema

from dart_skill.common.files import require_file
from dart_skill.recording.bags._files import SIDE_FILES, side_files
from dart_skill.recording.bags._metadata import RECORD_KEY, RECORD_NAME
from dart_skill.recording.mcap import BagMessage, DamagedError, Part, in_arrays

if TYPE_CHECKING:
    import numpy as np

_READABLE = "(typeof(timestamp) = 'integer' AND typeof(data) = 'blob')"
"""A row of messages with a time and bytes; SQLite does not forbid others."""
LATEST_NS = 2**63 - 1
"""SQLite has no larger time."""


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
        self._database, self.beside = self._opened()
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

    def type_name(self, channel: Channel) -> str:
        """Message type of a topic."""
        return self.schemas[channel.schema_id].name

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
        """As of `McapInput`: one, whose messages are read as they are needed."""
        if not wanted or stop_ns <= start_ns or start_ns > LATEST_NS:
            return []
        return [
            Part(self.start_ns, self.end_ns, partial(self._messages, wanted, start_ns, stop_ns))
        ]

    def rows(self) -> Iterator[tuple[int, int, int, bytes]]:
        """Row, topic, log time and bytes of each message in the order in which they were written.

        Raises
        ------
        DamagedError
        """
        with _explained():
            yield from self._rows(
                "SELECT rowid, topic_id, timestamp, data FROM messages ORDER BY rowid"
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
        """As of `McapInput`."""
        assert self._database is not None
        marks = ", ".join(map(str, wanted))
        query = (
            f"SELECT topic_id, timestamp FROM messages WHERE topic_id IN ({marks}) AND {_READABLE}"
            " ORDER BY rowid"
        )
        with _explained():
            yield from in_arrays(
                (wanted[number], stamp_ns) for number, stamp_ns in self._database.execute(query)
            )

    def missing(self, wanted: Collection[int]) -> dict[int, int]:
        """As of `McapInput`: these files have no sequence numbers."""
        return {}

    def close(self) -> None:
        """Close the file; twice is no error."""
        if self._database is not None:
            self._database.close()
            self._database = None
        if self._folder is not None:
            self._folder.cleanup()

    def _opened(self) -> tuple[sqlite3.Connection, str]:
        path, found = self.path, side_files(self.path)
        told = ", ".join(
            f"{file.name} (a {SIDE_FILES[ending]}, which was read, too)"
            for ending, file in found.items()
        )
        if found:
            self._folder = TemporaryDirectory(prefix="dart_skill_")
            path = copy_with_side_files(self.path, Path(self._folder.name))
        # a player reads in another thread than the one that has opened the bag
        uri = f"file:{quote(str(path.resolve()))}" + ("" if found else "?mode=ro&immutable=1")
        with _explained():
            database = sqlite3.connect(uri, uri=True, check_same_thread=False)
        database.text_factory = lambda data: data.decode(errors="replace")
        return database, told

    def _all(self, query: str) -> list[tuple]:
        assert self._database is not None  # or the reader has said that the bag is closed
        return self._database.execute(query).fetchall()

    def _columns(self, table: str) -> set[str]:
        return {str(row[1]) for row in self._all(f"PRAGMA table_info({table})")}

    def _take_topics(self) -> None:
        columns = self._columns("topics")
        if missing := {"id", "name", "type"} - columns:
            raise DamagedError(
                f"it is no bag: its table of topics lacks {', '.join(sorted(missing))}"
            )
        if missing := {"topic_id", "timestamp", "data"} - self._columns("messages"):
            raise DamagedError(
                f"it is no bag: its table of messages lacks {', '.join(sorted(missing))}"
            )
        self.schemas = {schema.id: schema for schema in self._definitions()}
        self.channels: dict[int, Channel] = {}
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
            told = {"offered_qos_profiles": str(qos), "topic_type_hash": str(type_hash)}
            self.channels[number] = Channel(
                id=number,
                topic=str(name),
                message_encoding=str(encoding) or "cdr",
                schema_id=known,
                metadata=told,
            )

    def _definitions(self) -> Iterator[Schema]:
        if not {"topic_type", "encoding", "encoded_message_definition"} <= self._columns(
            "message_definitions"
        ):
            return
        rows = self._all(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            " ORDER BY rowid"
        )
        for number, (name, encoding, text) in enumerate(rows, start=1):
            yield Schema(
                id=number, name=str(name), encoding=str(encoding), data=str(text).encode()
            )

    def _take_counts(self) -> None:
        columns = f"topic_id, COUNT(*), MIN(timestamp), MAX(timestamp), SUM({_READABLE})"
        counted = self._all(f"SELECT {columns} FROM messages GROUP BY topic_id")
        self.counts: Counter[int] = Counter(
            {number: count for number, count, *_ in counted if number in self.channels}
        )
        self.strays = {
            number: count for number, count, *_ in counted if number not in self.channels
        }
        self.n_unreadable = sum(
            count - readable for _number, count, _first, _last, readable in counted
        )
        self.message_count = sum(self.counts.values())
        times = [
            time
            for number, _, first, last, _ in counted
            if number in self.channels
            for time in (first, last)
            if type(time) is int
        ]
        self.start_ns, self.end_ns = (min(times), max(times)) if times else (0, 0)

    def _messages(
        self, wanted: dict[int, tuple[str, str]], start_ns: int, stop_ns: int
    ) -> Iterator[BagMessage]:
        marks = ", ".join(str(int(number)) for number in wanted)
        query = (
            f"SELECT rowid, topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks})"
            " AND timestamp BETWEEN ? AND ? ORDER BY timestamp, rowid"
        )
        with _explained():
            for _row, number, stamp_ns, data in self._rows(
                query, (start_ns or -LATEST_NS, min(stop_ns - 1, LATEST_NS))
            ):
                yield BagMessage(*wanted[number], stamp_ns, data)

    def _rows(
        self, query: str, limits: tuple[int, ...] = ()
    ) -> Iterator[tuple[int, int, int, bytes]]:
        """Rows of messages; without those whose time is no number or whose data are no bytes,
        which SQLite does not forbid.
        """
        assert self._database is not None
        for row, number, stamp_ns, data in self._database.execute(query, limits):
            if type(stamp_ns) is int and isinstance(data, bytes):
                yield row, number, stamp_ns, data


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
