"""A walk over the bytes of an MCAP file that may be damaged, which finds its way again.

Where no record begins, the walk tries what stands there as a chunk (whose CRC then vouches for
it), goes on at the next place that the summary knows, or searches the next record.
"""

from __future__ import annotations

import re
import struct
from bisect import bisect_right
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from dart_skill.recording.mcap.records import (
    MAGIC,
    MOST_UNKNOWN,
    PARSED,
    RECORD,
    Chunk,
    DamagedError,
    Message,
    Summary,
    data_end_before,
    defines_all,
    give_back,
    message_index,
    messages_of,
    parse,
    parse_chunk,
    parse_header,
    parse_with_length,
    read_summary,
    records_of,
)

_ANY_RECORD = re.compile(rb"(?=[\x01-\x0f].{5}\x00\x00\x00)", re.DOTALL)
LARGEST_UNPACKED = 2**30
"""Size up to which the content of a file may always be unpacked [bytes]."""
USUAL_RATIO = 1000
"""Largest ratio of the unpacked content to the file; more is a bomb, which takes hours to read."""
_ZERO_BLOCK = re.compile(rb"\x00{256,}")
"""Pattern of a block that was not stored when the power failed, or that a copy left out: no writer
compresses to such a one.
"""


@dataclass(frozen=True)
class Record:
    """A record that was found.

    Parameters
    ----------
    offset, end
        Where it begins and ends in the file [bytes].
    opcode
        What kind of record it is.
    content
        Its bytes, without opcode and length.
    repaired
        What was wrong about it and could be made good; else empty.
    """

    offset: int
    end: int
    opcode: int
    content: memoryview
    repaired: str = ""

    def parsed(self) -> Any:
        """What it says, of the kinds of `PARSED` (McapRecord).

        Raises
        ------
        DamagedError
            If it is an attachment with a wrong CRC.
        """
        return parse(self.opcode, self.content)

    def chunk(self) -> Chunk:
        """What it says if it is a chunk."""
        return parse_chunk(self.content)

    def messages(self) -> Iterator[Message]:
        """Those of a chunk, or the one that it is itself; none for other records.

        Raises
        ------
        DamagedError
        """
        if self.opcode == Opcode.CHUNK:
            chunk = self.chunk()
            yield from chunk.messages_in(chunk.unpack())
        elif self.opcode == Opcode.MESSAGE:
            yield from messages_of(RECORD.pack(self.opcode, len(self.content)) + self.content)

    def message_index(self) -> tuple[int, list[tuple[int, int]]]:
        """What it says if it is a message index: channel, and log time and place in the chunk of
        its messages.
        """
        channel, entries = message_index(self.content)
        return channel, list(struct.iter_unpack("<QQ", entries))


@dataclass(frozen=True)
class Damage:
    """A place of a file that is not what it should be.

    Parameters
    ----------
    offset, end
        Where it begins and ends in the file [bytes].
    reason
        What is wrong.
    rest
        A chunk that was cut off there.
    """

    offset: int
    end: int
    reason: str
    rest: Chunk | None = None


def walk(
    data: memoryview, summary: Summary | None = None, before: tuple[int, int] = (0, 0)
) -> Iterator[Record | Damage]:
    """Every record of a file's bytes after the magic, in order, and the places between them that
    are damaged.

    Ends after the footer: what follows it is a damaged place, and another file for `extents`.

    Parameters
    ----------
    summary
        Tells where records begin, also behind damage.
    before
        Bytes that were read before of the same bag, and that their chunks say that they hold.
    """
    known, unpacked = _known_places(summary), before[1]
    place, size = (len(MAGIC) if bytes(data[:8]) == MAGIC else 0), len(data)
    if place == 0:
        place = (
            _next_record(data, min(8, size), known) if size < 17 or data[8] != Opcode.HEADER else 8
        )
        yield Damage(0, place, "the file magic is invalid" + _zeros(data, 0, place))
    held = 0
    while place < size:
        held = give_back(data, held, place)
        found = _record_at(data, place)
        if (
            isinstance(found, Record)
            and found.opcode != Opcode.FOOTER
            and not _is_followed(data, found)
        ):
            inner = _next_record(data, place + 1, known, found.end)
            found = (
                Damage(place, inner, "its length is damaged, or its end is missing")
                if inner < found.end
                else found
            )
        elif isinstance(found, Damage):
            found = _chunk_at(data, place, found.reason) or _skipped(data, found, known)
        if isinstance(found, Record) and found.opcode == Opcode.CHUNK:
            unpacked += found.chunk().size
            if unpacked > max(LARGEST_UNPACKED, USUAL_RATIO * (before[0] + found.end)):
                told = f"the chunks say that they hold {unpacked} bytes, in a file of {size}:"
                yield Damage(found.offset, size, f"{told} the rest is left out")
                return
        yield found
        place = found.end
        if isinstance(found, Record) and found.opcode == Opcode.FOOTER:
            if bytes(data[place : place + len(MAGIC)]) != MAGIC:
                yield Damage(
                    place, size, "the file does not end with the magic" + _zeros(data, place, size)
                )
            elif place + len(MAGIC) < size:
                yield _after_the_end(data, place + len(MAGIC))
            return
    yield Damage(size, size, "the file ends without footer")


def extents(data: memoryview) -> list[tuple[int, int]]:
    """Where each file begins and ends, of those that were put one after another into one; usually
    it is only one.

    Parameters
    ----------
    data
        The bytes. What follows a footer is a file of its own, also where its head is missing, and
        so is what follows a header. A file that is kept in another one as an attachment belongs to
        that.
    """
    if _is_one(data):
        return [(0, len(data))]
    found, begin = [], 0
    while begin < len(data):
        end = begin + _end_of_first(data[begin:])
        found.append((begin, end))
        begin = end
    return found or [(0, 0)]


def belongs(data: memoryview, summary: Summary) -> bool:
    """Whether a summary is that of the file which it stands in: one of its chunks at least is
    where and what it says.

    Parameters
    ----------
    data
        The file's bytes.
    """
    for place in summary.chunks:
        found = (
            _record_at(data, place.chunk_start_offset)
            if place.chunk_start_offset < len(data)
            else None
        )
        if (
            isinstance(found, Record)
            and found.opcode == Opcode.CHUNK
            and found.end - found.offset == place.chunk_length
        ):
            chunk = found.chunk()
            said = (
                place.message_start_time,
                place.message_end_time,
                place.uncompressed_size,
                place.compression,
            )
            if said == (chunk.start_ns, chunk.end_ns, chunk.size, chunk.compression):
                return True
    return not len(summary.chunks) and data_end_before(data, summary.start) is not None


def _is_one(data: memoryview) -> bool:
    """Whether the summary at the end, by its CRC, stands where it was written: then nothing was
    put before it or into it.
    """
    try:
        parse_header(data[: 2**20])
        summary = read_summary(data, with_crc=True)
    except DamagedError:
        return False
    return summary is not None and belongs(data, summary)


def _end_of_first(data: memoryview) -> int:
    """Where the first file ends: behind its footer, or where the header of another one begins."""
    for found in walk(data):
        if isinstance(found, Damage):
            continue
        magic = found.offset - len(MAGIC)
        if (
            found.opcode == Opcode.HEADER
            and magic > 0
            and bytes(data[magic : found.offset]) == MAGIC
        ):
            return magic
        if found.opcode == Opcode.FOOTER:
            return min(found.end + len(MAGIC), len(data))
    return len(data)


def _after_the_end(data: memoryview, place: int) -> Damage:
    """What follows a file that is whole by itself."""
    count, zeros = len(data) - place, _zeros(data, place, len(data))
    text = f"{count} bytes follow the end of the file{zeros}"
    if bytes(data[place : place + len(MAGIC)]) == MAGIC:
        text = f"another MCAP file of {count} bytes follows the end of this one"
    return Damage(place, len(data), text)


def _zeros(data: memoryview, begin: int, end: int) -> str:
    """What to say of a block of zero bytes that a damaged place has, if there is one."""
    found = _ZERO_BLOCK.search(data, begin, end)
    if found is None:
        return ""
    return (
        f", with a block of {found.end() - found.start()} zero bytes, which the disk never stored"
        " or a copy left out"
    )


def read_definitions(
    data: memoryview, summary: Summary | None = None
) -> tuple[dict[int, Schema], dict[int, Channel]]:
    """Schemas and channels of a file by number: best those of the summary, then those in chunks
    with a CRC, then the others; of several the first.

    Parameters
    ----------
    data
        The file's bytes.
    summary
        As for `walk`.
    """
    vouched, others = all_definitions(data, summary)
    best = ({key: found[0] for key, found in others.items()} | vouched).values()
    schemas = {one.id: one for one in best if isinstance(one, Schema)}
    return schemas, {one.id: one for one in best if isinstance(one, Channel)}


def all_definitions(
    data: memoryview, summary: Summary | None = None
) -> tuple[dict[tuple[type, int], Any], dict[tuple[type, int], list]]:
    """Schemas and channels of a file by kind and number: the first of those that a CRC vouches
    for, and all others that differ, in order.

    Parameters
    ----------
    data, summary
        As for `read_definitions`.
    """
    vouched: dict[tuple[type, int], Any] = {}
    others: dict[tuple[type, int], list] = {}
    if summary is not None and summary.has_crc:
        told: list[Any] = [*summary.schemas.values(), *summary.channels.values()]
        vouched = {(type(one), one.id): one for one in told}
        if defines_all(summary):
            return vouched, others
    for item in walk(data, summary):
        if isinstance(item, Damage):
            continue
        if item.opcode == Opcode.CHUNK:
            chunk, found = item.chunk(), []
            with suppress(DamagedError):
                for one in definitions_in(chunk.unpack(), chunk.most_records):
                    found.append(one)  # also where a damaged record follows
            if chunk.crc:
                vouched = {(type(one), one.id): one for one in reversed(found)} | vouched
                continue
        elif item.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            found = [item.parsed()]
        else:
            continue
        for one in found:
            known = others.setdefault((type(one), one.id), [])
            known += [one] if one not in known else []
    return vouched, others


def definitions_in(raw: bytes, most: int) -> Iterator[Schema | Channel]:
    """Schemas and channels of a chunk.

    Parameters
    ----------
    raw
        Its records.
    most
        As there may be of them.

    Raises
    ------
    DamagedError
    """
    for opcode, begin, end in records_of(raw, most=most):
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            yield parse(opcode, raw[begin:end])


def _known_places(summary: Summary | None) -> list[int]:
    """Where records begin, as the summary says, in order."""
    if summary is None:
        return []
    found = {summary.start}
    for chunk in summary.chunks:
        begin = chunk.chunk_start_offset
        found |= {begin, begin + chunk.chunk_length, *chunk.message_index_offsets.values()}
    found |= {index.offset for index in summary.attachments}
    return sorted(found | {index.offset for index in summary.metadata})


def _record_at(data: memoryview, place: int) -> Record | Damage:
    """The record that begins at a place, or why there is none."""
    if place + RECORD.size > len(data):
        return Damage(place, len(data), "the file ends within a record")
    opcode, length = RECORD.unpack_from(data, place)
    end = place + RECORD.size + length
    if opcode == 0 or 0x0F < opcode < 0x80:
        return Damage(place, end, "no record begins here")
    content = data[place + RECORD.size : min(end, len(data))]
    if end > len(data):
        return Damage(
            place, len(data), "the file ends within a record", _rest(opcode, length, content)
        )
    try:
        known = length
        if opcode == Opcode.CHUNK:
            known = parse_chunk(content).length
        elif opcode == Opcode.MESSAGE_INDEX:
            known = 6 + len(message_index(content)[1])
        elif opcode == Opcode.MESSAGE and length < 22:
            raise DamagedError("the message is too short")
        elif opcode in PARSED:
            # one whose CRC is wrong is still a record, to be left out
            _, known = parse_with_length(opcode, content, check_crc=False)
        elif opcode >= 0x80 and _chunk_at(data, place, "") is not None:
            raise DamagedError("the chunk's opcode is damaged")
        if known < length and (
            opcode == Opcode.FOOTER or _hides_record(data, place + RECORD.size + known, end)
        ):
            raise DamagedError(
                f"the {Opcode(opcode).name} record has a length that does not fit its content"
            )
    except DamagedError as error:
        return Damage(place, end, str(error))
    return Record(place, end, opcode, content)


def _rest(opcode: int, length: int, content: memoryview) -> Chunk | None:
    """The chunk that a file's end cuts off, if that is what stands there."""
    with suppress(DamagedError):
        if (
            opcode == Opcode.CHUNK
            and (chunk := parse_chunk(content, cut_off=True)).length <= length
        ):
            return chunk
    return None


def _hides_record(data: memoryview, place: int, end: int) -> bool:
    """Whether what looks like fields that are not known here, from a place to the end of their
    record, are the next records.
    """
    if bytes(data[place : place + len(MAGIC)]) == MAGIC:
        return True
    if not _begins(data, place):
        return False
    after = place + RECORD.size + RECORD.unpack_from(data, place)[1]
    return (
        after <= end
        or after == len(data)
        or bytes(data[after : after + len(MAGIC)]) == MAGIC
        or _begins(data, after)
    )


def _chunk_at(data: memoryview, place: int, reason: str) -> Record | None:
    """What stands at a place as a chunk, whatever its opcode and length say, if its own sizes and
    CRC agree.
    """
    begin = place + RECORD.size
    try:
        chunk = parse_chunk(data[begin:], cut_off=True)
        end = begin + chunk.length
        if end > len(data) or not chunk.crc:
            return None
        chunk.unpack()
    except DamagedError:
        return None
    return Record(place, end, Opcode.CHUNK, data[begin:end], repaired=reason)


def _skipped(data: memoryview, damage: Damage, known: list[int]) -> Damage:
    """The damage as far as the next record. A chunk's rest is one only where nothing comes after
    it.
    """
    end = _next_record(data, damage.offset + 1, known)
    return Damage(
        damage.offset,
        end,
        (damage.reason + _zeros(data, damage.offset, end)),
        damage.rest if end == len(data) else None,
    )


def _is_followed(data: memoryview, record: Record) -> bool:
    """Whether another record, the magic or the end comes after a record, or its CRC says that it
    is whole.
    """
    if (
        record.end == len(data)
        or bytes(data[record.end : record.end + len(MAGIC)]) == MAGIC
        or _begins(data, record.end)
    ):
        return True
    with suppress(DamagedError):
        if record.opcode == Opcode.ATTACHMENT:
            record.parsed()
            return True
        if record.opcode == Opcode.CHUNK and (chunk := record.chunk()).crc:
            chunk.unpack()
            return True
    return False


def _begins(data: memoryview, place: int) -> bool:
    """Whether the opcode and length of a record stand at a place."""
    if place + RECORD.size > len(data):
        return False
    opcode, length = RECORD.unpack_from(data, place)
    return (0 < opcode <= 0x0F or opcode >= 0x80) and place + RECORD.size + length <= len(data)


def _next_record(data: memoryview, place: int, known: list[int], before: int | None = None) -> int:
    """Where the next record begins, at or after a place: by the summary, or by its looks; the end
    of the data without one.

    before: the search ends there.
    """
    size, index = len(data) if before is None else before, bisect_right(known, place - 1)
    limit = min(known[index], size) if index < len(known) else size
    for match in _ANY_RECORD.finditer(data, place, min(len(data), limit + 8)):
        begin = match.start()
        if begin >= limit:
            break
        found = _record_at(data, begin)
        if isinstance(found, Record) and _goes_on(data, found):
            return begin
    return limit


def _goes_on(data: memoryview, record: Record) -> bool:
    """Whether the bytes of a record that was searched are one indeed: chunks by content, others by
    their fields and what follows.
    """
    if record.opcode in PARSED:
        _, known = parse_with_length(record.opcode, record.content, check_crc=False)
        if len(record.content) > known + MOST_UNKNOWN:
            return False
    if record.opcode == Opcode.CHUNK:
        with suppress(DamagedError):
            record.chunk().unpack()
            return True
        return False
    if record.opcode == Opcode.FOOTER:
        return bytes(data[record.end :]) == MAGIC
    following = bytes(data[record.end : record.end + RECORD.size])
    if len(following) < RECORD.size:
        return not following
    opcode, length = RECORD.unpack(following)
    return 0 < opcode <= 0x0F and record.end + RECORD.size + length <= len(data)
