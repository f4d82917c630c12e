"""Rows of an SQLite file that is damaged, read from its pages themselves
(https://www.sqlite.org/fileformat2.html).

A table is a tree of pages. Only its leaves hold rows, and each leaf says by itself where they are.
So every page of the file that looks like a leaf is read, whatever is left of the tree above it, of
the header and of the indexes. Long rows go on in a chain of overflow pages. Frames of a
write-ahead log replace the pages that they are newer than.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import TypeAlias

from dart_skill.recording.mcap import give_back

LEAF = 0x0D
"""First byte of a page of rows."""
FIRST_HEADER = 100
"""Bytes of the first page before its own head."""
SIZES = [2**power for power in range(9, 17)]
"""Sizes that a page may have [bytes]."""
USUAL_SIZE = 4096
"""Usual size of a page, since 2016 [bytes]."""
LARGEST_ROW = 2**30
"""Largest row of SQLite [bytes]."""
_WAL_HEAD = 32
"""Size of the head of a write-ahead log [bytes]."""
_FRAME_HEAD = 24
"""Size of the head of each of its frames [bytes]."""
_INTEGERS = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}
"""Bytes of a whole number by its serial type."""


TableRow: TypeAlias = "tuple[int, tuple]"
"""A row of some table: its rowid, and the values of its columns: int, float, str, bytes or None."""


class Pages:
    """The pages of a file.

    Parameters
    ----------
    data
        Bytes of the file.
    log
        Bytes of the write-ahead log beside it.

    Attributes
    ----------
    size
        Of a page [bytes].
    n_pages
        That there should be.
    n_there
        That are there.
    broken
        Rows of which a part is missing.
    has_more_than_told
        Whether there are pages behind those that the header tells of.
    log_rest
        Bytes at the end of the log that are no page.
    """

    def __init__(self, data: memoryview, log: memoryview | None = None):
        self._data, self._log = data, log if log is not None else memoryview(b"")
        self.size = self._page_size()
        self._frames = dict(self._newest_frames())
        self._usable = self.size - (data[20] if self._has_header and data[20] < 32 else 0)
        told = struct.unpack_from(">I", data, 28)[0] if self._has_header else 0
        self.n_there = max(len(data) // self.size, max(self._frames, default=0))
        self.n_pages = max(self.n_there, told if told < 2 * self.n_there + 2**20 else 0)
        self.has_more_than_told = 0 < told < len(data) // self.size
        self.log_rest = max(0, len(self._log) - _WAL_HEAD) % (_FRAME_HEAD + self.size)
        self.broken = self._left = (
            0  # the second: bytes that rows may have in all, for a chain of pages may go round
        )

    @property
    def _has_header(self) -> bool:
        return bytes(self._data[:15]) == b"SQLite format 3"

    def _page_size(self) -> int:
        for data, form, place in ((self._data, ">H", 16), (self._log, ">I", 8)):
            if len(data) >= place + 4:
                (told,) = struct.unpack_from(form, data, place)
                told = 65536 if told == 1 else told
                if told in SIZES:
                    return told

        def size_of_leaves(size: int) -> float:
            """How well the first pages fit a size of pages; the usual one is preferred."""
            begins = range(size, min(len(self._data), 2**22), size)
            pages = (self._data[begin : begin + size] for begin in begins)
            count = sum(_pointers(page, 0) is not None for page in pages)
            return count * size * (1 + 0.001 * (size == USUAL_SIZE))

        return max([USUAL_SIZE, *SIZES], key=size_of_leaves)

    def _newest_frames(self) -> Iterator[tuple[int, int]]:
        """Page number and place in the log of each frame that belongs to the log as it is, the
        newer ones last.
        """
        log = self._log
        if len(log) < _WAL_HEAD:
            return
        salt = bytes(log[16:24])
        for place in range(
            _WAL_HEAD, len(log) - _FRAME_HEAD - self.size + 1, _FRAME_HEAD + self.size
        ):
            number = struct.unpack_from(">I", log, place)[0]
            if bytes(log[place + 8 : place + 16]) == salt and number:
                yield number, place + _FRAME_HEAD

    def page(self, number: int) -> memoryview | None:
        """A page by its number, from 1; None if it is not there."""
        if number in self._frames:
            return self._log[self._frames[number] : self._frames[number] + self.size]
        begin = (number - 1) * self.size
        return (
            self._data[begin : begin + self.size]
            if 0 <= begin and begin + self.size <= len(self._data)
            else None
        )

    def _each(self) -> Iterator[tuple[int, memoryview]]:
        """Numbers and pages, as far as they are there, few of them in memory at a time."""
        held = 0
        for number in range(1, self.n_there + 1):
            if len(self._data):
                held = give_back(self._data, held, min(number * self.size, len(self._data)))
            page = self.page(number)
            if page is not None:
                yield number, page

    def rows(self, without: set[int]) -> Iterator[TableRow]:
        """All rows on leaves.

        Parameters
        ----------
        without
            Numbers of pages that are not looked at.
        """
        self.broken = 0
        self._left = 4 * (len(self._data) + len(self._log)) + 2**20
        for number, page in self._each():
            if number in without:
                continue
            for place in _pointers(page, FIRST_HEADER * (number == 1 and page[0] != LEAF)) or ():
                try:
                    yield self._row(page, place)
                except (ValueError, struct.error, IndexError):
                    self.broken += 1

    def zeroed(self) -> int:
        """How many pages hold nothing but zero bytes."""
        return sum(number > 1 and page[0] == 0 and not any(page) for number, page in self._each())

    def free(self) -> set[int]:
        """Pages that are not in use: rows on them were deleted. Empty where the list of them is
        damaged.
        """
        found: set[int] = set()
        if not self._has_header or len(self._data) < FIRST_HEADER:
            return found
        trunk, count = struct.unpack_from(">II", self.page(1) or self._data, 32)
        while trunk:
            page = self.page(trunk)
            if page is None or trunk in found:
                return set()
            following, leaves = struct.unpack_from(">II", page)
            if leaves > self.size // 4 - 2:
                return set()
            found |= {trunk, *struct.unpack_from(f">{leaves}I", page, 8)}
            trunk = following
        return found if len(found) == count else set()

    def _row(self, page: memoryview, place: int) -> TableRow:
        size, place = _varint(page, place)
        number, place = _varint(page, place)
        self._left -= size
        if size > LARGEST_ROW or self._left < 0:
            raise ValueError("larger than any row, or than what is left of the file")
        return (
            number if number < 2**63 else number - 2**64,
            _values(self._payload(page, place, size)),
        )

    def _payload(self, page: memoryview, place: int, size: int) -> bytes:
        """The bytes of a row, which begin on a page and may go on on others."""
        usable, most = self._usable, self._usable - 35
        here = size
        if size > most:
            least = (usable - 12) * 32 // 255 - 23
            here = least + (size - least) % (usable - 4)
            here = here if here <= most else least
        if place + here > usable:
            raise ValueError("it reaches beyond its page")
        parts, left = [page[place : place + here]], size - here
        following = struct.unpack_from(">I", page, place + here)[0] if left else 0
        while left:
            overflow = self.page(following) if following else None
            if overflow is None:
                raise ValueError("the chain of its pages ends early")
            following = struct.unpack_from(">I", overflow)[0]
            parts.append(overflow[4 : min(usable, 4 + left)])
            left -= len(parts[-1])
            if bool(left) != bool(following):
                raise ValueError("the chain of its pages is not as long as the row")
        return b"".join(parts)


def _pointers(page: memoryview, begin: int) -> list[int] | None:
    """Where the rows of a leaf begin; None for a page that is none. begin: of its head."""
    if len(page) < begin + 8 or page[begin] != LEAF:
        return None
    count, content = struct.unpack_from(">HH", page, begin + 3)
    first = begin + 8 + 2 * count
    content = content or 65536
    if first > len(page) or content > len(page) or (count and content < first):
        return None
    return [
        place
        for place in struct.unpack_from(f">{count}H", page, begin + 8)
        if content <= place < len(page)
    ]


def _varint(data: bytes | memoryview, place: int) -> tuple[int, int]:
    """A number of 1 to 9 bytes, and where it ends."""
    value = data[place]
    if value < 0x80:
        return value, place + 1
    value &= 0x7F
    for number in range(1, 8):
        byte = data[place + number]
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, place + number + 1
    return value << 8 | data[place + 8], place + 9


def _values(payload: bytes) -> tuple:
    """The columns of a row; ValueError unless they fill it exactly."""
    head, at = _varint(payload, 0)
    kinds = []
    while at < head:
        kind, at = _varint(payload, at)
        kinds.append(kind)
    if at != head or head > len(payload):
        raise ValueError("its head is damaged")
    values, place = [], head
    for kind in kinds:
        value, place = _value(payload, place, kind)
        values.append(value)
    if place != len(payload):
        raise ValueError("its columns do not fill it")
    return tuple(values)


def _value(payload: bytes, place: int, kind: int) -> tuple[int | float | str | bytes | None, int]:
    """A value by its serial type, and where it ends."""
    if kind in _INTEGERS:
        end = place + _INTEGERS[kind]
        return int.from_bytes(payload[place:end], "big", signed=True), end
    if kind == 7:
        return struct.unpack_from(">d", payload, place)[0], place + 8
    if kind in (0, 8, 9):
        return (None, 0, 1)[max(0, kind - 7)], place
    if kind < 12:
        raise ValueError("it has a value of no type")
    end = place + (kind - 12) // 2
    if end > len(payload):
        raise ValueError("a value reaches beyond it")
    return (payload[place:end].decode() if kind % 2 else payload[place:end]), end
