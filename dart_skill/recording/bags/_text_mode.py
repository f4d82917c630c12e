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
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import combinations
from math import comb
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode

from dart_skill.common.files import open_file
from dart_skill.recording.mcap import (
    MAGIC,
    DamagedError,
    mapped,
    parse_chunk,
    parse_header,
    read_summary,
)
from dart_skill.recording.mcap.records import PARSED, RECORD, parse_with_length

LOOKED_AT = 2**22
"""Size of the part of a file without telling first bytes that is looked at [bytes]."""
ENOUGH = 16
"""Number of line feeds that do not all have a carriage return before them by chance."""
MANY = 2000
"""Number of bytes that are not zero of which some are above 127."""
MOST_TRIES = 1000
"""Largest number of ways to put carriage returns into a chunk that are tried."""
MOST_MISSING = 64
"""Largest number of carriage returns that a record may lack."""
_MAGIC = MAGIC.replace(b"\r", b"")
_LOOKS = re.compile(rb"(?=(?:[\x01-\x0f].{5}\x00\x00\x00|\x89MCAP0\n))", re.DOTALL)
_HIGH = {
    b"\x89": "",
    b"\xc2\x89": "each byte above 127 became two, of UTF-8",
    b"\xe2\x80\xb0": "each byte above 127 became a character of Windows-1252, in UTF-8",
    b"\xef\xbf\xbd": "each byte above 127 became the replacement character of UTF-8",
    b"?": "each byte above 127 became a question mark",
    b"\x09": "the highest bit of each byte was cleared",
    b"": "each byte above 127 was left out",
}
"""What became of the first byte of MCAP, 0x89, and what that means."""
_ENDS = {
    b"\r\n": "",
    b"\r\r\n": "a carriage return was put before each line feed",
    b"\r\n\r\n": "carriage returns and line feeds became both",
    b"\n\n": "each carriage return became a line feed",
    b"\n": "carriage returns before line feeds were left out",
    b"\r\r": "each line feed became a carriage return",
    b"\r": "each line feed was left out",
}
"""What became of its carriage return and line feed."""
_WINDOWS = {
    ord(bytes([byte]).decode("cp1252", "ignore") or chr(byte)): byte for byte in range(128, 256)
}
"""Bytes by the character of Windows-1252 that each became."""
_CHARACTERS: dict[bytes, dict[int, int]] = {b"\xc2\x89": {}, b"\xe2\x80\xb0": _WINDOWS}
"""Bytes by the character that each became, where that is not the one of its number."""


class Copied(NamedTuple):
    """How a file was copied as text.

    Parameters
    ----------
    high, ends
        What became of the byte 0x89, and of CR LF.
    text
        What is said of it.
    """

    high: bytes
    ends: bytes
    text: str


def how_copied(data: memoryview) -> Copied | None:
    """How a file was copied as text, by its bytes; None for one that was not.

    Parameters
    ----------
    data
        Its bytes.
    """
    head, said = bytes(data[:32]), "it was copied as if it were text: "
    for high, of_high in _HIGH.items():
        for ends, of_ends in _ENDS.items():
            if head.startswith(high + b"MCAP0" + ends + b"\x01") and (of_high or of_ends):
                return Copied(high, ends, said + " and ".join(filter(None, (of_high, of_ends))))
    is_mcap = head.startswith(MAGIC)
    if is_mcap:
        with suppress(DamagedError):
            parse_header(data[:LOOKED_AT])
            read_summary(data)
            return None  # it is whole
    elif not head.startswith(b"SQLite format 3"):
        return None
    part = bytes(data[:LOOKED_AT])
    n_ends, n_high = part.count(b"\n"), len(re.findall(rb"[\x80-\xff]", part))
    if n_ends >= ENOUGH and n_ends == part.count(b"\r\n") and (is_mcap or len(data) % 512):
        text = "a carriage return was put before each line feed that had none"
        return Copied(b"\x89", b"\r\n", said + text)
    high = b""
    if not is_mcap and n_high == 0 and len(part) - part.count(0) >= MANY:
        high = b"\x09"
    elif not is_mcap and 3 * ENOUGH <= n_high <= 3.6 * part.count(b"\xef\xbf\xbd"):
        high = b"\xef\xbf\xbd"
    return Copied(high, b"\r\n", said + _HIGH[high]) if high else None


def as_it_was(copied: Copied, file: Path, folder: Path) -> tuple[Path, str, bool] | None:
    """Write a file as it was before it was copied.

    Parameters
    ----------
    copied
        How it was.
    file
        Which is only read.
    folder
        Of the new file.

    Returns
    -------
    tuple[Path, str, bool] | None
        It, what was done and whether that is all, None if nothing can be done.
    """
    if copied.high not in (b"\x89", *_CHARACTERS) or copied.ends not in (
        b"\r\n",
        b"\r\r\n",
        b"\n",
    ):
        return None
    path = folder / "as_it_was"
    try:
        with open_file(file) as lines, open(path, "xb") as out:
            out.writelines(_undone(copied, lines))
    except UnicodeError:
        return None
    with mapped(path) as undone:
        if bytes(undone[: len(_MAGIC)]) != _MAGIC:
            return path, "this was undone", True
        returned = folder / "returned"
        with open(returned, "xb") as out:
            n_changed, n_mended = _put_back(undone, out)
    text = (
        f"of {n_changed} records that lost a carriage return, {n_mended} have it again, where"
        " their CRC says"
    )
    return returned, text, n_mended == n_changed


def _undone(copied: Copied, lines: Iterable[bytes]) -> Iterator[bytes]:
    """Lines without what the copy put in; UnicodeError where that cannot be."""
    characters = _CHARACTERS.get(copied.high)
    has_more = copied.ends == b"\r\r\n" or (copied.ends == b"\r\n" and characters is None)
    for line in lines:
        if characters is not None:
            line = line.decode().translate(characters).encode("latin-1")
        yield line[:-2] + b"\n" if has_more and line.endswith(b"\r\n") else line


def _put_back(data: memoryview, out: BinaryIO) -> tuple[int, int]:
    """Write a file with the carriage returns that it lacks before line feeds, record by record:
    the length of each says how many are missing.

    Returns
    -------
    tuple[int, int]
        Number of records that lacked some, and of those that are as they were.
    """
    place = n_changed = n_mended = 0
    while place < len(data):
        if bytes(data[place : place + len(_MAGIC)]) == _MAGIC:
            out.write(MAGIC)
            place += len(_MAGIC)
            continue
        missing = _missing(data, place)
        if missing is None:
            looks = (match.start() for match in _LOOKS.finditer(data, place + 1))
            end = next((one for one in looks if _missing(data, one) is not None), len(data))
            out.write(data[place:end])
            place = end
            continue
        opcode, length = RECORD.unpack_from(data, place)
        begin, place = place + RECORD.size, place + RECORD.size + length - missing
        content = bytes(data[begin:place])
        if missing:
            whole = _whole(opcode, content, missing)
            n_changed, n_mended = n_changed + 1, n_mended + (whole is not None)
            # zero bytes at its end make it no record
            rest = bytes(len(content)) if opcode == Opcode.MESSAGE else content
            content = whole or rest + bytes(missing)
        out.write(RECORD.pack(opcode, length) + content)
    return n_changed, n_mended


def _missing(data: memoryview, place: int) -> int | None:
    """How many carriage returns a record lacks that begins at a place; None if none does."""
    if not _begins(data, place) or place + RECORD.size > len(data):
        return None
    length = RECORD.unpack_from(data, place)[1]
    end = place + RECORD.size + length
    counts = range(min(MOST_MISSING, length) + 1)
    return next((count for count in counts if _begins(data, end - count)), None)


def _begins(data: memoryview, place: int) -> bool:
    """Whether a record, the magic or the end of the file is at a place."""
    if place == len(data) or bytes(data[place : place + len(_MAGIC)]) == _MAGIC:
        return True
    if place + RECORD.size > len(data):
        return False
    opcode, length = RECORD.unpack_from(data, place)
    return 0 < opcode <= 0x0F and place + RECORD.size + length <= len(data) + MOST_MISSING


def _whole(opcode: int, content: bytes, missing: int) -> bytes | None:
    """The content of a record as it was written, as far as it says so itself; None where nothing
    says how it was.
    """
    places = [match.start() for match in re.finditer(b"\n", content)]
    tries: Iterable[tuple[int, ...]] = [tuple(places)] if len(places) == missing else []
    if opcode == Opcode.CHUNK and comb(len(places), missing) <= MOST_TRIES:
        tries = combinations(places, missing)
    for chosen in tries:
        ends = (0, *chosen, len(content))
        whole = b"\r".join(content[begin:end] for begin, end in zip(ends, ends[1:], strict=False))
        with suppress(DamagedError):
            if opcode == Opcode.CHUNK:
                chunk = parse_chunk(memoryview(whole))
                chunk.unpack()
                if chunk.crc and chunk.length == len(whole):
                    return whole
            elif opcode in PARSED and parse_with_length(opcode, whole)[1] == len(whole):
                return whole
    return None
