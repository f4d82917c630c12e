"""What is left of an SQLite file of rosbag2: by SQLite itself as far as it finds the file whole,
else from its pages.

A journal or a write-ahead log beside the file belongs to it. SQLite takes it in when it opens a
file, so it is given a copy of all of them.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable
from contextlib import closing, nullcontext, suppress
from pathlib import Path

from mcap.records import Channel, Schema

from dart_skill.recording.bags._definitions import embedded_types
from dart_skill.recording.bags._other_inputs import copy_with_side_files
from dart_skill.recording.bags._recovered_bag import (
    TOGETHER,
    FileRecovery,
    RecoveredBag,
    grouped_by_channel,
    installed_schema,
    types_with,
)
from dart_skill.recording.bags._sqlite_pages import Pages
from dart_skill.recording.bags.columns import Decoder
from dart_skill.recording.bags.files import SIDE_FILES, plain_message, side_files
from dart_skill.recording.bags.messages import type_hash
from dart_skill.recording.bags.metadata import RECORD_KEY, definition_of, full_name, parse_record
from dart_skill.recording.mcap import Message, mapped

SMALLEST_ROW = 8
"""Smallest size of a message [bytes]."""


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
    bag.result.n_bytes += len(data) + sum(side.stat().st_size for side in beside.values())
    bag.result.is_exact = False
    one = _SqliteRecovery(bag, name)
    with mapped(beside["-wal"]) if "-wal" in beside else nullcontext() as log:
        is_whole = one.take_by_sqlite(file, scratch)
        pages = Pages(data, log)
        if not is_whole or beside or pages.has_more_than_told:
            one.take_from_pages(pages, is_whole)
    for number, channel in one.channels.items():  # topics without messages are kept, too
        one.channel(number)
        if not (schema := one.schemas[channel.schema_id]).encoding:
            bag.note(
                f"the type {schema.name} of {channel.topic} is defined neither in {name} nor here:"
                " its messages are kept, and can be read raw or where its package is installed"
            )
    one.tell_left_out()


class _SqliteRecovery(FileRecovery):
    """One file on its way into the new bag, its topics as channels and its definitions as schemas."""

    def __init__(self, bag: RecoveredBag, name: str):
        super().__init__(bag, name)
        self._reason = ""  # what SQLite says is wrong with it
        self._definitions: dict[str, tuple[str, str]] = {}  # encoding and text by type
        self._metadata = self._distro = ""
        self._rows: dict[int, int] = {}  # numbers that were taken, a bit each, 4096 together
        self._n_rows = 0

    def take_by_sqlite(self, file: Path, scratch: Path) -> bool:
        """Take what SQLite reads, if it finds nothing wrong; returns whether it did.

        Parameters
        ----------
        scratch
            A folder for a copy.
        """
        beside, before = side_files(file), self.bag.result.unverified
        if not file.is_file() or not file.stat().st_size:
            return False  # SQLite would throw the log away
        path = copy_with_side_files(file, scratch) if beside else file
        way = "mode=rw" if beside else "mode=ro&immutable=1"
        try:
            with closing(sqlite3.connect(f"{path.resolve().as_uri()}?{way}", uri=True)) as base:
                base.execute("PRAGMA cell_size_check = ON")
                found = [row[0] for row in base.execute("PRAGMA integrity_check(3)")]
                if found != ["ok"]:
                    lines = [text for line in found for text in line.splitlines()[:2]]
                    self._reason = "; ".join(lines)
                    if any("index" not in line for line in found):
                        return False
                    self.repair(
                        f"its index is damaged ({self._reason}) and not needed: the new bag has"
                        " its own"
                    )
                for table in ("topics", "message_definitions", "metadata", "schema"):
                    with suppress(sqlite3.OperationalError):  # no such table
                        for row in base.execute(f"SELECT rowid, * FROM {table}"):
                            self._take_small(row[0], row[1:], table)
                self._define()
                self._take_rows(
                    base.execute(
                        "SELECT rowid, topic_id, timestamp, data FROM messages NOT INDEXED ORDER"
                        " BY rowid"
                    )
                )
        except (sqlite3.Error, OverflowError, ValueError) as error:
            self._reason = str(error)
            return False
        for ending, side in beside.items():
            self.bag.note(
                f"{self.name}: its {SIDE_FILES[ending]} {side.name} ({side.stat().st_size} bytes)"
                " was read, on a copy"
            )
        self.bag.note(
            f"{self.name}: SQLite {sqlite3.sqlite_version} finds it whole and read"
            f" {self.bag.result.unverified - before} messages; its format has no CRC"
        )
        return True

    def take_from_pages(self, pages: Pages, is_whole: bool) -> None:
        """Take what stands on the pages and was not taken yet.

        Parameters
        ----------
        is_whole
            Whether SQLite has read the file.
        """
        unused = pages.free()
        for row, values in pages.rows(unused):
            if len(values) < 7:
                self._take_small(row, values)
        self._define()
        # the first column of messages is their rowid, which SQLite keeps beside the row
        count = self._take(
            Message(row, values[1], 0, values[2], values[2], values[3])
            for row, values in pages.rows(unused)
            if len(values) == 4
            and values[0] is None
            and all(map(isinstance, values[1:], (int, int, bytes)))
        )
        if is_whole:
            rest = f", and {pages.log_rest} bytes at the end of its log are no whole page"
            if count or pages.log_rest:
                self.bag.lose(
                    self.name,
                    f"{count} messages more were on its pages, of what its recorder did not"
                    f" complete, or of a log that is damaged{rest if pages.log_rest else ''}",
                )
            return
        self.bag.note(
            f"{self.name}: it was read page by page: {pages.n_there} pages of"
            f" {pages.size} bytes gave {count} messages"
        )
        missing, zeroed = max(0, pages.n_pages - pages.n_there), pages.zeroed()
        reasons = {
            f"SQLite finds it damaged ({self._reason})": self._reason,
            f"{missing} pages of {pages.n_pages} are missing at its end": missing,
            f"{zeroed} pages hold nothing but zero bytes": zeroed,
            f"{pages.broken} rows are there only in part": pages.broken,
        }
        told = "; ".join(text for text, is_so in reasons.items() if is_so) or "it is damaged"
        most = (missing + zeroed + pages.n_there) * pages.size // SMALLEST_ROW
        end = (missing + zeroed) * pages.size
        self.bag.lose(self.name, told, self._missing_rows(most) or None, end=end)

    def _take_small(self, row: int, columns: tuple, table: str = "") -> None:
        """Take a row of a small table, by its looks where that is not known; those of other tables
        are passed over.
        """
        first, *values = columns or (0,)
        kinds = "".join(
            "s" if isinstance(value, str) else "i" if isinstance(value, int) else "-"
            for value in values
        )
        if first is not None and first != row:
            return
        is_topic = table == "topics" or (
            not table and kinds[:1] == "s" and values[0].startswith("/")
        )
        if kinds in ("sss", "ssss", "sssss") and is_topic:  # the first versions have no QoS
            name, type_name, encoding, qos, digest = [*values, "", ""][:5]
            known = next((k for k, one in self.schemas.items() if one.name == type_name), None)
            number = known or len(self.schemas) + 1
            self.schemas.setdefault(
                number, Schema(id=number, name=type_name, encoding="", data=b"")
            )
            self.channels.setdefault(
                row,
                Channel(
                    id=row,
                    topic=name,
                    message_encoding=encoding,
                    schema_id=number,
                    metadata={"offered_qos_profiles": qos, "topic_type_hash": digest},
                ),
            )
        elif kinds in ("ssss", "sss") and full_name(values[0]).count("/") == 2:
            self._definitions.setdefault(full_name(values[0]), (values[1], values[2]))
        elif kinds == "is" and "relative_file_paths" in values[1]:
            self._metadata = values[1]
        elif kinds == "s" and (first is not None or values[0].isalpha()):
            self._distro = values[0]

    def _define(self) -> None:
        """Know topics and types from here on."""
        if self._metadata:
            self.bag.take_metadata(parse_record({RECORD_KEY: self._metadata}))
        self.bag.ros_distro = self.bag.ros_distro or self._distro
        self.schemas = {
            number: self._schema(one.name, number) or one for number, one in self.schemas.items()
        }
        for channel in self.channels.values():
            schema = self.schemas[channel.schema_id]
            if not channel.metadata["topic_type_hash"]:
                channel.metadata["topic_type_hash"] = _installed_hash(schema)

    def _schema(self, type_name: str, number: int) -> Schema | None:
        """The definition of a type: from the file, the standard types or an installed package."""
        encoding, text = self._definitions.get(full_name(type_name), ("", ""))
        if text and encoding in ("ros2msg", "ros2idl"):
            return Schema(id=number, name=type_name, encoding=encoding, data=text.encode())
        return installed_schema(type_name, number)

    def _take_rows(self, rows: Iterable[tuple]) -> None:
        """Take those rows that are messages, as SQLite reads them: it does not mind what kind
        their values are of.
        """
        n_odd = 0

        def messages() -> Iterable[Message]:
            nonlocal n_odd
            for row in rows:
                if all(map(isinstance, row, (int, int, int, bytes))):
                    yield Message(row[0], row[1], 0, row[2], row[2], row[3])
                else:
                    n_odd += 1

        self._take(messages())
        if n_odd:
            self.bag.lose(
                self.name,
                f"{n_odd} rows have no number of a topic, no time or no bytes, and are left out",
                n_odd,
            )

    def _take(self, messages: Iterable[Message]) -> int:
        """Take messages whose rows were not taken yet; returns how many. place: of the row."""
        count, together = 0, []
        for message in messages:
            together.append(message)
            if len(together) >= TOGETHER or len(message.data) > 2**20:
                count += self._take_judged(together)
                together = []
        return count + self._take_judged(together)

    def _take_judged(self, messages: list[Message]) -> int:
        """Those of them that are messages of their topic: nothing else vouches for them."""
        for number, places in grouped_by_channel(messages).items():
            payloads = [plain_message(messages[k].data) for k in places]
            if number not in self.channels:
                self._find_topic(number, payloads)
            elif number not in self.written and self.channels[number].message_encoding == "cdr":
                self._settle(self.schemas[self.channels[number].schema_id], payloads)
        taken = [one for one in self.judged(messages) if self._is_new(one.place)]
        return sum(self.write(one, False) is not None for one in taken)

    def _settle(self, schema: Schema, payloads: list[bytes]) -> None:
        """Take the definition of an installed type where that of the file fits no message, and
        this one fits all.
        """
        installed = installed_schema(schema.name, schema.id)
        if full_name(schema.name) not in self._definitions or installed is None:
            return
        if not _fits(schema, payloads) and _fits(installed, payloads):
            self.repair(
                f"its definition of {schema.name} does not fit its messages: that which is"
                " installed here does, and stands in the new bag"
            )
            self.schemas[schema.id] = installed

    def _find_topic(self, number: int, payloads: list[bytes]) -> None:
        """Find the topic of messages whose row is lost: the only one that the metadata name, which
        has no row, and whose type they are.
        """
        there = {channel.topic for channel in self.channels.values()}
        found = []
        for name, told in self.bag.told_topics.items():
            schema = self._schema(str(told.get("type", "")), len(self.schemas) + 1)
            if name not in there and schema is not None and _fits(schema, payloads):
                found.append((name, schema, str(told.get("serialization_format") or "cdr")))
        if len(found) == 1:
            ((name, schema, encoding),) = found
            self.repair(
                f"the row of topic {name} is lost: metadata.yaml names it, and its messages are of"
                " its type"
            )
            row = (number, name, schema.name, encoding)
            self._take_small(number, row, "topics")
            self._define()

    def _is_new(self, row: int) -> bool:
        """Whether a row was not taken yet; it is, from now on."""
        block, bit = row >> 12, 1 << (row & 0xFFF)
        is_new = not self._rows.get(block, 0) & bit
        self._rows[block] = self._rows.get(block, 0) | bit
        self._n_rows += is_new
        return is_new

    def _missing_rows(self, most: int) -> int:
        """How many between 1 and the last are missing; 0 for more than there can be, as then the
        last is none.
        """
        last = max(self._rows, default=0)
        count = (last << 12) + self._rows.get(last, 1).bit_length() - 1 - self._n_rows
        return count if 0 < count <= most else 0


def _fits(schema: Schema, payloads: list[bytes]) -> bool:
    """Whether a definition can be read, and all payloads are messages of it."""
    types, name = embedded_types([definition_of(schema)], None)[0], full_name(schema.name)
    return name in types.fielddefs and not any(Decoder(types).errors(name, payloads))


def _installed_hash(schema: Schema) -> str:
    """RIHS01 of a type whose definition is that which is known here; empty for another one."""
    installed, full = installed_schema(schema.name, schema.id), full_name(schema.name)
    types = types_with(full)
    return type_hash(types, full) if types is not None and installed == schema else ""
