"""Files that were copied as if they were text, which changed some of their bytes everywhere.

The first bytes of MCAP are made to show it, as those of PNG: one above 127, carriage return and
line feed. In a file without them the bytes themselves show it: no line feed without a carriage
return before it, or no byte above 127.

* What a copy put in (a carriage return before each line feed, two bytes of UTF-8 for one) is taken
  out again, without loss.
* A carriage return that a copy left out is put back where the CRC of the chunk says that it was.
* Where many bytes became one and the same, nothing can be done.
"""

from __future__ import annotations

import re
from codecs import getincrementaldecoder
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations
from math import comb
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode

from dart_skill.recording.mcap import DamagedError, mapped, parse_header, read_summary
from dart_skill.recording.mcap.records import MAGIC, PARSED, RECORD, parse_chunk, parse_with_length

LOOKED_AT = 2**22
"""Part of a file without telling first bytes that is looked at [bytes]."""
ENOUGH = 16
"""Line feeds, all with a carriage return before them, are no chance."""
MOST_TRIES = 1000
"""For the places of carriage returns in a chunk."""
MOST_MISSING = 64
"""Carriage returns in a record."""
MANY = 2000
"""Bytes that are not zero, of which none is above 127, are no chance either."""
_AT_ONCE = 2**20
_MAGIC = MAGIC.replace(b"\r", b"")
_LOOKS = re.compile(rb"(?=(?:[\x01-\x0f].{5}\x00\x00\x00|\x89MCAP0\n))", re.DOTALL)
_HIGH = {  # what became of the first byte, 0x89
    b"\x89": "",
    b"\xc2\x89": "each byte above 127 became two, of UTF-8",
    b"\xe2\x80\xb0": "each byte above 127 became a character of Windows-1252, in UTF-8",
    b"\xef\xbf\xbd": "each byte above 127 became the replacement character of UTF-8",
    b"?": "each byte above 127 became a question mark",
    b"\x09": "the highest bit of each byte was cleared",
    b"": "each byte above 127 was left out",
}
_ENDS = {  # what became of carriage return and line feed
    b"\r\n": "",
    b"\r\r\n": "a carriage return was put before each line feed",
    b"\r\n\r\n": "carriage returns and line feeds became both",
    b"\n\n": "each carriage return became a line feed",
    b"\n": "carriage returns before line feeds were left out",
    b"\r\r": "each line feed became a carriage return",
    b"\r": "each line feed was left out",
}
_UNDONE = (b"\xc2\x89", b"\xe2\x80\xb0")


@dataclass(frozen=True)
class Copied:
    """How a file was copied as text.

    Parameters
    ----------
    text
        What is said of it.
    high
        What became of the byte 0x89.
    ends
        Of CR LF.
    is_mcap
        What it is.
    """

    high: bytes
    ends: bytes
    text: str
    is_mcap: bool = True


def how_copied(data: memoryview) -> Copied | None:
    """How a file was copied as text, by its bytes; None for one that was not.

    Parameters
    ----------
    data
        Its bytes.
    """
    head = bytes(data[:32])
    for high, of_high in _HIGH.items():
        if head.startswith(high + b"MCAP0"):
            rest = head[len(high) + 5 :]
            found = [ends for ends in _ENDS if rest.startswith(ends + b"\x01")]
            if found and (of_high or _ENDS[found[0]]):
                return Copied(high, found[0], _said([of_high, _ENDS[found[0]]]))
    return _by_all_bytes(data)


def _said(what: list[str]) -> str:
    return "it was copied as if it were text: " + " and ".join(filter(None, what))


def _by_all_bytes(data: memoryview) -> Copied | None:
    """The same of a file whose first bytes do not tell, if it is not whole."""
    is_mcap = bytes(data[:8]) == MAGIC
    if not (is_mcap or bytes(data[:15]) == b"SQLite format 3") or (is_mcap and _is_whole(data)):
        return None
    part = bytes(data[:LOOKED_AT])
    ends = part.count(b"\n")
    if ends >= ENOUGH and ends == part.count(b"\r\n") and (is_mcap or len(data) % 512):
        return Copied(
            b"\x89",
            b"\r\n",
            _said(["a carriage return was put before each line feed that had none"]),
            is_mcap,
        )
    high = len(re.findall(rb"[\x80-\xff]", part))
    if not is_mcap and high == 0 and len(part) - part.count(0) >= MANY:
        return Copied(b"\x09", b"\r\n", _said([_HIGH[b"\x09"]]), is_mcap)
    if not is_mcap and 3 * ENOUGH <= high <= 3.6 * part.count(b"\xef\xbf\xbd"):
        return Copied(b"\xef\xbf\xbd", b"\r\n", _said([_HIGH[b"\xef\xbf\xbd"]]), is_mcap)
    return None


def _is_whole(data: memoryview) -> bool:
    try:
        parse_header(data[:LOOKED_AT])
        read_summary(data)
    except DamagedError:
        return False
    return True


def as_it_was(copied: Copied, data: memoryview, folder: Path) -> tuple[Path, str, bool] | None:
    """Write a file as it was before it was copied.

    Parameters
    ----------
    copied
        How it was.
    data
        Its bytes.
    folder
        Of the new file.

    Returns
    -------
    tuple[Path, str, bool] | None
        It, what was done and whether that is all, None if nothing can be done.
    """
    if copied.high not in (b"\x89", *_UNDONE) or copied.ends not in (b"\r\n", b"\r\r\n", b"\n"):
        return None
    parts: Iterator[bytes] = (
        bytes(data[begin : begin + _AT_ONCE]) for begin in range(0, len(data), _AT_ONCE)
    )
    if copied.high in _UNDONE:
        parts = _encoded(parts, copied.high != b"\xc2\x89")
    if copied.ends == b"\r\r\n" or (copied.ends == b"\r\n" and copied.high == b"\x89"):
        parts = _without_returns(parts)
    path = folder / "as_it_was"
    try:
        with open(path, "xb") as out:
            out.writelines(parts)
    except UnicodeError:
        return None
    with mapped(path) as undone:
        if not copied.is_mcap or bytes(undone[:8]) == MAGIC:
            return path, "this was undone", True
        with open(folder / "returned", "xb") as out:
            returns = _Returns(undone, out)
            returns.write()
    text = (
        f"of {returns.changed} records that lost a carriage return, {returns.mended} have it"
        " again, where their CRC says"
    )
    return folder / "returned", text, returns.mended == returns.changed


def _without_returns(parts: Iterator[bytes]) -> Iterator[bytes]:
    """Without the carriage return before each line feed."""
    held = b""
    for part in parts:
        part = held + part
        held = b"\r" if part.endswith(b"\r") else b""
        yield part[: len(part) - len(held)].replace(b"\r\n", b"\n")
    yield held


def _encoded(parts: Iterator[bytes], for_windows: bool) -> Iterator[bytes]:
    """A byte again for each character; UnicodeError where there are others."""
    decoder = getincrementaldecoder("utf-8")()
    table = (
        {
            ord(bytes([byte]).decode("cp1252", "ignore") or chr(byte)): byte
            for byte in range(128, 256)
        }
        if for_windows
        else {}
    )
    for part in parts:
        yield decoder.decode(part).translate(table).encode("latin-1")
    yield decoder.decode(b"", final=True).encode("latin-1")


class _Returns:
    """Carriage returns that are put back before line feeds, record by record: the length of each
    says how many are missing.

    * data: the bytes without them; out: gets those with them.
    * changed, mended: records that lost some, and those of them that are as they were.
    """

    def __init__(self, data: memoryview, out: BinaryIO):
        self._data, self._out = data, out
        self.changed = self.mended = 0

    def write(self) -> None:
        """Write all of the file."""
        data, place = self._data, 0
        while place < len(data):
            if bytes(data[place : place + len(_MAGIC)]) == _MAGIC:
                self._out.write(MAGIC)
                place += len(_MAGIC)
                continue
            missing = self._missing(place)
            if missing is None:
                following = self._next(place + 1)
                self._out.write(data[place:following])
                place = following
                continue
            opcode, length = RECORD.unpack_from(data, place)
            begin, place = place + RECORD.size, place + RECORD.size + length - missing
            self._out.write(
                RECORD.pack(opcode, length)
                + self._content(opcode, bytes(data[begin:place]), missing)
            )

    def _content(self, opcode: int, content: bytes, missing: int) -> bytes:
        """The content of a record as it was; with zero bytes at its end, which make it no record,
        where nothing says how it was.
        """
        if not missing:
            return content
        self.changed += 1
        places = [match.start() for match in re.finditer(b"\n", content)]
        tries: Iterable[tuple[int, ...]] = [tuple(places)] if len(places) == missing else []
        if opcode == Opcode.CHUNK and comb(len(places), missing) <= MOST_TRIES:
            tries = combinations(places, missing)
        for chosen in tries:
            whole = _put_in(content, chosen)
            if _is_right(opcode, whole):
                self.mended += 1
                return whole
        return (bytes(len(content)) if opcode == Opcode.MESSAGE else content) + bytes(missing)

    def _missing(self, place: int) -> int | None:
        """How many carriage returns a record lacks that begins at a place; None if none does."""
        if not self._begins(place):
            return None
        length = RECORD.unpack_from(self._data, place)[1]
        end = place + RECORD.size + length
        return next(
            (
                missing
                for missing in range(min(MOST_MISSING, length) + 1)
                if self._begins(end - missing)
            ),
            None,
        )

    def _begins(self, place: int) -> bool:
        """Whether a record, the magic or the end of the file is at a place."""
        data = self._data
        if place == len(data) or bytes(data[place : place + len(_MAGIC)]) == _MAGIC:
            return True
        if place + RECORD.size > len(data):
            return False
        opcode, length = RECORD.unpack_from(data, place)
        return 0 < opcode <= 0x0F and place + RECORD.size + length <= len(data) + MOST_MISSING

    def _next(self, place: int) -> int:
        found = (match.start() for match in _LOOKS.finditer(self._data, place))
        return next(
            (begin for begin in found if self._missing(begin) is not None), len(self._data)
        )


def _put_in(content: bytes, places: tuple[int, ...]) -> bytes:
    """With a carriage return before each of some line feeds."""
    ends = (0, *places, len(content))
    return b"\r".join(content[begin:end] for begin, end in zip(ends, ends[1:], strict=False))


def _is_right(opcode: int, content: bytes) -> bool:
    """Whether the content of a record is as it was written, as far as it says so itself."""
    try:
        if opcode == Opcode.CHUNK:
            chunk = parse_chunk(memoryview(content))
            chunk.unpack()
            return bool(chunk.crc) and chunk.length == len(content)
        return opcode in PARSED and parse_with_length(opcode, content)[1] == len(content)
    except DamagedError:
        return False
