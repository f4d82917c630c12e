"""What is left of an SQLite file of rosbag2: by SQLite itself as far as it finds the file whole,
else from its pages.

A journal or a write-ahead log beside the file belongs to it. SQLite takes it in when it opens a
file, so it is given a copy of all of them.
"""

from __future__ import annotations

import sqlite3
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import closing, nullcontext, suppress
from dataclasses import dataclass, field
from pathlib import Path

from dart_skill.recording.bags._files import SIDE_FILES, plain_message, side_files
from dart_skill.recording.bags._known_types import (
    Decoder,
    installed_definition,
    installed_hash,
    schema_of,
)
from dart_skill.recording.bags._metadata import RECORD_KEY, full_name, parse_record
from dart_skill.recording.bags._recovered_bag import (
    LAST_TIME_NS,
    TOGETHER,
    FileRecovery,
    RecoveredBag,
    grouped_by_channel,
)
from dart_skill.recording.bags._sqlite import copy_with_side_files
from dart_skill.recording.bags._sqlite_pages import Pages, TableRow
from dart_skill.recording.mcap import McapChannel, mapped

SMALLEST_ROW = 8
"""Smallest size of a message [bytes]."""


@dataclass(frozen=True)
class _FoundTopic:
    name: str
    type_name: str
    encoding: str
    qos: str
    type_hash: str


@dataclass(frozen=True)
class _Message:
    number: int
    topic: int
    stamp_ns: int
    data: bytes


@dataclass
class _Tables:
    """The small tables of a file. topics: by number; definitions: encoding and text by type;
    metadata: text; distro: of ROS.
    """

    topics: dict[int, _FoundTopic] = field(default_factory=dict)
    definitions: dict[str, tuple[str, str]] = field(default_factory=dict)
    metadata: str = ""
    distro: str = ""

    def take(self, row: TableRow, table: str = "") -> None:
        """Take a row, by its looks where its table is not known; those of other tables are passed
        over.
        """
        first, *values = row.values if row.values else (0,)
        kinds = "".join(
            "s" if isinstance(value, str) else "i" if isinstance(value, int) else "-"
            for value in values
        )
        if first is not None and first != row.number:
            return
        is_topic = table == "topics" or (
            not table and kinds[:1] == "s" and values[0].startswith("/")
        )
        if len(kinds) in (4, 5) and set(kinds) == {"s"} and is_topic:
            name, type_name, encoding, qos, *digest = values
            self.topics.setdefault(
                row.number,
                _FoundTopic(name, type_name, encoding, qos, digest[0] if digest else ""),
            )
        elif kinds == "sss" and is_topic:  # of the first versions, without QoS
            self.topics.setdefault(
                row.number, _FoundTopic(values[0], values[1], values[2], "", "")
            )
        elif kinds in ("ssss", "sss") and full_name(values[0]).count("/") == 2:
            self.definitions.setdefault(full_name(values[0]), (values[1], values[2]))
        elif kinds == "is" and "relative_file_paths" in values[1]:
            self.metadata = values[1]
        elif kinds == "s" and first is not None or kinds == "s" and values[0].isalpha():
            self.distro = values[0]


def recover_sqlite(
    bag: RecoveredBag, name: str, file: Path, data: memoryview, scratch: Path
) -> None:
    """Take all that can be read of a file into the new bag.

    Parameters
    ----------
    bag
        The new one.
    name
        Of the file, in what is told.
    file
        Where its bytes are.
    data
        These.
    scratch
        A folder for a copy.
    """
    beside = side_files(file)
    bag.n_bytes += len(data) + sum(side.stat().st_size for side in beside.values())
    bag.is_exact = False
    one = _SqliteRecovery(bag, name)
    with mapped(beside["-wal"]) if "-wal" in beside else nullcontext() as log:
        is_whole = _take_by_sqlite(one, file, scratch)
        pages = Pages(data, log)
        if not is_whole or beside or pages.has_more_than_told:
            _take_from_pages(one, pages, is_whole)
    one.finish()


def _take_by_sqlite(one: _SqliteRecovery, file: Path, scratch: Path) -> bool:
    """Take what SQLite reads, if it finds nothing wrong; returns whether it did."""
    beside, before = side_files(file), one.bag.unverified
    if not file.is_file() or not file.stat().st_size:
        return False  # SQLite would throw the log away
    path = copy_with_side_files(file, scratch) if beside else file
    try:
        with closing(
            sqlite3.connect(
                f"{path.resolve().as_uri()}?{'mode=rw' if beside else 'mode=ro&immutable=1'}",
                uri=True,
            )
        ) as base:
            base.execute("PRAGMA cell_size_check = ON")
            found = [row[0] for row in base.execute("PRAGMA integrity_check(3)")]
            if found != ["ok"]:
                one.reason = "; ".join(text for line in found for text in line.splitlines()[:2])
                if any("index" not in line for line in found):
                    return False
                one.repair(
                    f"its index is damaged ({one.reason}) and not needed: the new bag has its own"
                )
            one.define(_small_tables(base))
            one.take_rows(
                base.execute(
                    "SELECT rowid, topic_id, timestamp, data FROM messages NOT INDEXED ORDER BY"
                    " rowid"
                )
            )
    except (sqlite3.Error, OverflowError, ValueError) as error:
        one.reason = str(error)
        return False
    for ending, side in beside.items():
        one.bag.note(
            f"{one.name}: its {SIDE_FILES[ending]} {side.name} ({side.stat().st_size} bytes) was"
            " read, on a copy"
        )
    how = (
        f"{one.name}: SQLite {sqlite3.sqlite_version} finds it whole and read"
        f" {one.bag.unverified - before} messages"
    )
    one.bag.note(how + "; its format has no CRC")
    return True


def _small_tables(base: sqlite3.Connection) -> _Tables:
    tables = _Tables()
    for name in ("topics", "message_definitions", "metadata", "schema"):
        with suppress(sqlite3.OperationalError):  # no such table
            for row in base.execute(f"SELECT rowid, * FROM {name}"):
                tables.take(TableRow(row[0], tuple(row[1:])), name)
    return tables


def _take_from_pages(one: _SqliteRecovery, pages: Pages, is_whole: bool) -> None:
    """Take what stands on the pages and was not taken yet."""
    bag, tables, unused = one.bag, one.tables, pages.free()
    for row in pages.rows(unused):
        if len(row.values) < 7:
            tables.take(row)
    one.define(tables)
    count = one.take(_messages_of(pages.rows(unused)))
    if is_whole:
        if count or pages.log_rest:
            rest = (
                f", and {pages.log_rest} bytes at the end of its log are no whole page"
                if pages.log_rest
                else ""
            )
            more = (
                f"{count} messages more were on its pages, of what its recorder did not complete,"
                f" or of a log that is damaged{rest}"
            )
            bag.lose(one.name, 0, 0, more, None)
        return
    bag.note(
        f"{one.name}: it was read page by page: {pages.n_there} pages of {pages.size} bytes gave"
        f" {count} messages"
    )
    missing, zeroed = max(0, pages.n_pages - pages.n_there), pages.zeroed()
    reasons = [f"SQLite finds it damaged ({one.reason})"] if one.reason else []
    reasons += [f"{missing} pages of {pages.n_pages} are missing at its end"] if missing else []
    reasons += [f"{zeroed} pages hold nothing but zero bytes"] if zeroed else []
    reasons += [f"{pages.broken} rows are there only in part"] if pages.broken else []
    lost = one.numbers.missing((missing + zeroed + pages.n_there) * pages.size // SMALLEST_ROW)
    bag.lose(
        one.name,
        0,
        (missing + zeroed) * pages.size,
        "; ".join(reasons) or "it is damaged",
        lost or None,
    )


def _messages_of(rows: Iterable[TableRow]) -> Iterator[_Message]:
    """Those rows that are messages, by their looks."""
    for row in rows:
        if len(row.values) == 4:
            first, topic, stamp, data = row.values
            if (
                first is None
                and isinstance(topic, int)
                and isinstance(stamp, int)
                and isinstance(data, bytes)
            ):
                yield _Message(row.number, topic, stamp, data)


class _Numbers:
    """Numbers of rows, a bit each where they are dense."""

    def __init__(self) -> None:
        self._bits: dict[int, int] = {}
        self._count = 0

    def add(self, number: int) -> bool:
        """Whether it is new."""
        block, bit = number >> 12, 1 << (number & 0xFFF)
        bits = self._bits.get(block, 0)
        if bits & bit:
            return False
        self._bits[block] = bits | bit
        self._count += 1
        return True

    def missing(self, most: int) -> int:
        """How many between 1 and the last are missing; 0 for more than there can be, as then the
        last is none.
        """
        last = max(self._bits, default=0)
        count = (last << 12) + self._bits.get(last, 1).bit_length() - 1 - self._count
        return count if 0 < count <= most else 0


class _SqliteRecovery(FileRecovery):
    """One file on its way into the new bag. name: of the file; reason: what SQLite says is wrong
    with it.
    """

    def __init__(self, bag: RecoveredBag, name: str):
        super().__init__(bag, name)
        self.reason = ""
        self.tables = _Tables()
        self.numbers = _Numbers()
        self.unknown: Counter[int] = Counter()
        self.undecodable: Counter[str] = Counter()
        self.n_odd = 0  # rows that are no messages

    def define(self, tables: _Tables) -> None:
        """Know topics and types from here on."""
        self.tables = tables
        texts = {
            topic.type_name: self._definition(topic.type_name) for topic in tables.topics.values()
        }
        self.texts = {name: found for name, found in texts.items() if found is not None}
        self.decoder = Decoder([schema_of(name, *found) for name, found in self.texts.items()])
        if tables.metadata:
            metadata = parse_record({RECORD_KEY: tables.metadata})
            self.bag.hear_of_topics(metadata)
            self.take_metadata(metadata)
        self.bag.ros_distro = self.bag.ros_distro or tables.distro

    def _definition(self, type_name: str) -> tuple[str, str] | None:
        """Encoding and text of a type: from the file, the standard types or an installed package."""
        encoding, text = self.tables.definitions.get(full_name(type_name), ("", ""))
        if text and encoding in ("ros2msg", "ros2idl"):
            return encoding, text
        text = installed_definition(type_name)
        return ("ros2msg", text) if text else None

    def _settle(self, topic: _FoundTopic, payloads: list[bytes]) -> None:
        """Take the definition of an installed type where that of the file fits no message, and
        this one fits all.
        """
        name = topic.type_name
        text = installed_definition(name) if full_name(name) in self.tables.definitions else ""
        if not text or self.decoder.fits(name, payloads):
            return
        other = Decoder([schema_of(name, "ros2msg", text)])
        if other.fits(name, payloads):
            self.repair(
                f"its definition of {name} does not fit its messages: that which is installed here"
                " does, and stands in the new bag"
            )
            self.texts[name] = ("ros2msg", text)
            self.decoder = Decoder([schema_of(name, *found) for name, found in self.texts.items()])

    def _lost_topic(self, number: int, payloads: list[bytes]) -> _FoundTopic | None:
        """The topic of messages whose row is lost: the only one that the metadata name, which has
        no row, and whose type they are.
        """
        there = {topic.name for topic in self.tables.topics.values()}
        found = []
        for name, told in self.bag.told_topics.items():
            text = self._definition(type_name := str(told.get("type", "")))
            if (
                name not in there
                and text is not None
                and Decoder([schema_of(type_name, *text)]).fits(type_name, payloads)
            ):
                found.append(
                    _FoundTopic(
                        name, type_name, str(told.get("serialization_format") or "cdr"), "", ""
                    )
                )
        if len(found) != 1:
            return None
        self.repair(
            f"the row of topic {found[0].name} is lost: metadata.yaml names it, and its messages"
            " are of its type"
        )
        self.tables.topics[number] = found[0]
        self.define(self.tables)
        return found[0]

    def take_rows(self, rows: Iterable[tuple]) -> None:
        """Take those rows that are messages, as SQLite reads them: it does not mind what kind
        their values are of.
        """
        good = (row for row in rows if self._is_message(row))
        self.take(_Message(*row) for row in good)
        if self.n_odd:
            reason = f"{self.n_odd} rows have no number of a topic, no time or no bytes"
            self.bag.lose(self.name, 0, 0, f"{reason}, and are left out", self.n_odd)

    def _is_message(self, row: tuple) -> bool:
        is_one = all(
            isinstance(value, kind)
            for value, kind in zip(row, (int, int, int, bytes), strict=True)
        )
        self.n_odd += not is_one
        return is_one

    def take(self, messages: Iterable[_Message]) -> int:
        """Take messages that were not taken yet; returns how many."""
        count, together = 0, []
        for message in messages:
            together.append(message)
            if len(together) >= TOGETHER or len(message.data) > 2**20:
                count += self._take_judged(together)
                together = []
        return count + self._take_judged(together)

    def _take_judged(self, messages: list[_Message]) -> int:
        """Those of them that are messages of their topic: nothing else vouches for them."""
        good: set[int] = set()
        for number, its in grouped_by_channel(message.topic for message in messages).items():
            payloads = [plain_message(messages[index].data) for index in its]
            topic = self.tables.topics.get(number) or self._lost_topic(number, payloads)
            if topic is None:
                self.unknown[number] += len(its)
                continue
            if number not in self.written and topic.encoding == "cdr":
                self._settle(topic, payloads)
            is_good = (
                self.decoder.decodable(topic.type_name, payloads)
                if topic.encoding == "cdr"
                else [True] * len(its)
            )
            in_time = [0 <= messages[index].stamp_ns <= LAST_TIME_NS for index in its]
            its_good = [
                index
                for index, one, other in zip(its, is_good, in_time, strict=True)
                if one and other
            ]
            good.update(its_good)
            if len(its_good) < len(its):
                self.undecodable[topic.name] += len(its) - len(its_good)
        taken = [
            message
            for index, message in enumerate(messages)
            if index in good and self.numbers.add(message.number)
        ]
        for message in taken:
            channel = self._channel(message.topic)
            assert channel is not None  # as the topic is known
            self.write(channel, 0, message.stamp_ns, message.stamp_ns, message.data)
        self.bag.unverified += len(taken)
        return len(taken)

    def _channel(self, number: int) -> McapChannel | None:
        if number not in self.written:
            topic = self.tables.topics.get(number)
            self.written[number] = self._write_channel(topic) if topic is not None else None
        return self.written[number]

    def _write_channel(self, topic: _FoundTopic) -> McapChannel:
        if self.out is None:
            self.out = self.bag.new_file(
                "ros2" if all(one.encoding == "cdr" for one in self.tables.topics.values()) else ""
            )
        encoding, text = self.texts.get(topic.type_name, ("", ""))
        if not text:
            self.bag.note(
                f"the type {topic.type_name} of {topic.name} is defined neither in {self.name} nor"
                " here: its messages are kept, and can be read raw or where its package is"
                " installed"
            )
        written = (
            number for number, one in self.out.schemas.items() if one.name == topic.type_name
        )
        schema = next(written, None) or self.out.add_schema(
            topic.type_name, encoding, text.encode()
        )
        digest = topic.type_hash or installed_hash(topic.type_name, text)
        metadata = {"offered_qos_profiles": topic.qos, "topic_type_hash": digest}
        return self.add_channel(
            topic.name, topic.type_name, topic.encoding, schema, metadata, digest
        )

    def finish(self) -> None:
        """Tell what could not be taken; topics without messages are kept, too."""
        for number in self.tables.topics:
            self._channel(number)
        if count := self.unknown.total():
            self.bag.lose(
                self.name,
                0,
                0,
                f"{count} messages of topics {sorted(self.unknown)}, which no row names",
                count,
            )
        for topic, count in self.undecodable.items():
            self.bag.lose(
                self.name,
                0,
                0,
                f"{count} rows on {topic} are no messages of its type, and are left out",
                None,
            )
