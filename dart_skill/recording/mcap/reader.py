"""Reading whole MCAP files: topics from the summary, messages chunk by chunk in order of log time.

Damage is an error here (`DamagedError`): `walk` says what is left of a damaged file.
"""

from __future__ import annotations

import heapq
import struct
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import partial
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypeVar

from mcap.opcode import Opcode
from mcap.records import Attachment, ChunkIndex, Metadata, Statistics

from dart_skill.common.files import open_file
from dart_skill.recording.mcap.record_walk import Damage, Record, read_definitions, walk
from dart_skill.recording.mcap.records import (
    MAGIC,
    RECORD,
    DamagedError,
    Summary,
    defines_all,
    mapped,
    message_index,
    messages_of,
    parse,
    parse_chunk,
    parse_header,
    read_summary,
)

if TYPE_CHECKING:
    import numpy as np

T = TypeVar("T")
END_OF_TIME = 2**64
AT_ONCE = 16_384
"""Messages whose log times are looked at together."""
_STAMP = itemgetter(2)


class BagMessage(NamedTuple):
    """A message.

    Parameters
    ----------
    stamp_ns
        Log time.
    data
        CDR bytes or, decoded, an object with the message's fields.
    topic
        Its name.
    """

    topic: str
    type_name: str
    stamp_ns: int
    data: Any


Part: TypeAlias = "tuple[int, int, Callable[[], Iterable[BagMessage]]]"
"""A part of a file: log times of its first and last message [ns], and what gives its messages in
order of log time.
"""


class McapInput:
    """A whole MCAP file, open for reading.

    Attributes
    ----------
    library
        What wrote the file.
    schemas, channels
        By number.
    counts
        Messages by the number of their channel.
    message_count
        Of all channels.
    start_ns, end_ns
        Log times of the first and last message, 0 without messages.
    strays
        Messages by the number of a channel that the file does not define.
    compression
        Of the chunks; several are separated by commas.
    storage
        How rosbag2 calls the format.

    Raises
    ------
    DamagedError
        For what is no whole file.
    """

    storage = "mcap"

    def __init__(self, path: Path):
        self.path = path
        self._chunks: list[ChunkIndex] | None = None  # where all messages are
        self._places: dict[int, list[int]] = {Opcode.METADATA: [], Opcode.ATTACHMENT: []}
        self.counts: Counter[int] = Counter()
        self._stream = open_file(path)
        try:
            with mapped(path) as data:
                self.library = parse_header(data)[0].library
                summary = read_summary(data)
                statistics = summary and summary.statistics
                if (
                    summary
                    and statistics
                    and is_complete(summary)
                    and not _holds_more(data, summary)
                ):
                    self._take(summary, statistics)
                else:
                    self._scan(data)
        except BaseException:
            self._stream.close()
            raise

    @property
    def is_open(self) -> bool:
        """Whether it can be read."""
        return not self._stream.closed

    @property
    def is_counted(self) -> bool:
        """Whether the file itself tells how many messages are in it, and where they are."""
        return self._chunks is not None

    def metadata(self) -> list[Metadata]:
        """Metadata records, in the order in which they were written."""
        return self._records(Opcode.METADATA)

    def attachments(self) -> list[Attachment]:
        """Files that were kept with the messages, in the order in which they were written."""
        return self._records(Opcode.ATTACHMENT)

    def parts(self, wanted: dict[int, tuple[str, str]], start_ns: int, stop_ns: int) -> list[Part]:
        """The parts of the file that may hold messages of some channels and times.

        Parameters
        ----------
        wanted
            Topic and type by number of the channel.
        start_ns, stop_ns
            Log times from the first to before the second.
        """
        if self._chunks is None:
            read = partial(self._found_messages, wanted, start_ns, stop_ns)
            return [(self.start_ns, self.end_ns, read)]
        in_chunk = partial(_messages_in, wanted=wanted, start_ns=start_ns, stop_ns=stop_ns)
        return [
            (
                chunk.message_start_time,
                chunk.message_end_time,
                partial(self._of_chunk, chunk, in_chunk),
            )
            for chunk in self._chunks
            if start_ns <= chunk.message_end_time
            and chunk.message_start_time < stop_ns
            and not wanted.keys().isdisjoint(chunk.message_index_offsets)
        ]

    def log_times(self, wanted: Mapping[int, int]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Numbers and log times (n,) [ns] of messages of some channels, some at a time, in the
        order of writing.

        By the message indexes, where there are some: no chunk is unpacked.

        Parameters
        ----------
        wanted
            Number that is given for each channel.

        Raises
        ------
        DamagedError
        """
        import numpy as np

        if self._chunks is None:
            with mapped(self.path) as data:
                messages = (one for record in _undamaged(data) for one in record.messages())
                yield from in_arrays(
                    (wanted[one.channel], one.log_time_ns)
                    for one in messages
                    if one.channel in wanted
                )
        for chunk in self._chunks or ():
            data = memoryview(
                self._at(chunk.chunk_start_offset + chunk.chunk_length, chunk.message_index_length)
            )
            numbers, entries = [np.empty(0, np.int64)], [np.empty((0, 2), "<u8")]
            while len(data) > RECORD.size:
                end = RECORD.size + RECORD.unpack_from(data)[1]
                channel, index = message_index(data[RECORD.size : end])
                if channel in wanted:
                    entries.append(np.frombuffer(index, "<u8").reshape(-1, 2))
                    numbers.append(np.full(len(entries[-1]), wanted[channel]))
                data = data[end:]
            stamps, places = np.concatenate(entries).T
            order = np.argsort(places, kind="stable")
            yield np.concatenate(numbers)[order], stamps[order]

    def missing(self, wanted: Collection[int]) -> dict[int, int]:
        """Messages that are missing by the sequence numbers of the first and the last one of each
        channel.

        Only the chunks with these two are unpacked; of a file without indexes nothing is told.

        Parameters
        ----------
        wanted
            Numbers of channels.

        Raises
        ------
        DamagedError
        """
        ends: dict[int, ChunkIndex] = {}
        for number in wanted:
            its = [one for one in self._chunks or () if number in one.message_index_offsets]
            ends |= {one.chunk_start_offset: one for one in (*its[:1], *its[-1:])}
        told: dict[int, list[int]] = {}
        for _, chunk in sorted(ends.items()):
            for one in self._of_chunk(chunk, lambda raw, most: list(messages_of(raw, most=most))):
                told.setdefault(one.channel, []).append(one.sequence)
        return +Counter(
            {
                number: told[number][-1] - told[number][0] + 1 - self.counts[number]
                for number in told.keys() & set(wanted)
            }
        )

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def _at(self, place: int, length: int) -> bytes:
        self._stream.seek(place)
        return self._stream.read(length)

    def _records(self, opcode: int) -> list:
        found = []
        for place in self._places[opcode]:
            _opcode, length = RECORD.unpack(self._at(place, RECORD.size))
            found.append(parse(opcode, self._at(place + RECORD.size, length)))
        return found

    def _take(self, summary: Summary, statistics: Statistics) -> None:
        self.schemas, self.channels = summary.schemas, summary.channels
        self._chunks = summary.chunks
        self.strays: dict[int, int] = {}
        self.counts = Counter(statistics.channel_message_counts)
        self.message_count = statistics.message_count
        self.start_ns, self.end_ns = statistics.message_start_time, statistics.message_end_time
        compressions = {chunk.compression for chunk in summary.chunks}
        self.compression = ", ".join(sorted(compressions - {""}))
        self._places = {
            Opcode.METADATA: [index.offset for index in summary.metadata],
            Opcode.ATTACHMENT: [index.offset for index in summary.attachments],
        }

    def _scan(self, data: memoryview) -> None:
        """What the summary would say, from the whole file."""
        compressions: set[str] = set()
        first_ns, last_ns = END_OF_TIME, 0
        for found in _undamaged(data):
            for message in found.messages():
                self.counts[message.channel] += 1
                first_ns = min(first_ns, message.log_time_ns)
                last_ns = max(last_ns, message.log_time_ns)
            if found.opcode == Opcode.CHUNK:
                compressions.add(found.chunk().compression)
            elif found.opcode in self._places:
                self._places[found.opcode].append(found.offset)
        self.schemas, self.channels = read_definitions(data)
        self.strays = {k: count for k, count in self.counts.items() if k not in self.channels}
        self.compression = ", ".join(sorted(compressions - {""}))
        self.message_count = self.counts.total()
        self.start_ns, self.end_ns = (first_ns, last_ns) if self.message_count else (0, 0)

    def _of_chunk(self, chunk: ChunkIndex, read: Callable[[bytes, int], T]) -> T:
        """What is read of a chunk; DamagedError. read: takes its unpacked records, and how many
        there may be.
        """
        place = chunk.chunk_start_offset
        try:
            record = self._at(place, chunk.chunk_length)
            if len(record) < RECORD.size or RECORD.unpack_from(record) != (
                Opcode.CHUNK,
                len(record) - RECORD.size,
            ):
                raise DamagedError("no chunk begins there")
            packed_chunk = parse_chunk(memoryview(record)[RECORD.size :])
            return read(packed_chunk.unpack(), packed_chunk.most_records)
        except (DamagedError, struct.error) as error:
            raise DamagedError(
                f"the chunk at byte {place} of {self.path.name} is damaged: {error}"
            ) from error

    def _found_messages(
        self, wanted: dict[int, tuple[str, str]], start_ns: int, stop_ns: int
    ) -> list[BagMessage]:
        """All that are wanted of a file that does not tell where its messages are: they are read
        into memory.
        """
        with mapped(self.path) as data:
            found = [
                BagMessage(*wanted[message.channel], message.log_time_ns, message.data)
                for record in _undamaged(data)
                for message in record.messages()
                if message.channel in wanted and start_ns <= message.log_time_ns < stop_ns
            ]
        return sorted(found, key=_STAMP)


def in_time_order(parts: Iterable[Part]) -> Iterator[BagMessage]:
    """Messages of all parts in order of log time; parts that overlap in time are merged."""
    group: list[Part] = []
    until = 0
    for start_ns, end_ns, read in sorted(parts, key=itemgetter(0)):
        if group and start_ns >= until:
            yield from _merged(group)
            group = []
        group.append((start_ns, end_ns, read))
        until = max(until, end_ns)
    yield from _merged(group)


def in_arrays(pairs: Iterator[tuple[int, int]]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Numbers and log times (n,) of pairs of them, some at a time."""
    import numpy as np

    while some := list(islice(pairs, AT_ONCE)):
        numbers, stamps = zip(*some, strict=True)
        yield np.array(numbers), np.array(stamps)


def _undamaged(data: memoryview) -> Iterator[Record]:
    for found in walk(data):
        if isinstance(found, Damage):
            raise DamagedError(f"{found.reason} (at byte {found.offset})")
        yield found


def _messages_in(
    raw: bytes, most: int, wanted: dict[int, tuple[str, str]], start_ns: int, stop_ns: int
) -> list[BagMessage]:
    """What is wanted of the unpacked records of a chunk, in order of log time."""
    found = [
        BagMessage(*wanted[one.channel], one.log_time_ns, one.data)
        for one in messages_of(raw, most=most)
        if one.channel in wanted and start_ns <= one.log_time_ns < stop_ns
    ]
    return sorted(found, key=_STAMP)


def _merged(group: list[Part]) -> Iterator[BagMessage]:
    if len(group) == 1:
        yield from group[0][2]()
        return
    for message in heapq.merge(*map(_when_due, group), key=_STAMP):
        if message[0] is not None:
            yield message


def _when_due(part: Part) -> Iterator:
    """A part's messages, read when the merge has come to its first log time."""
    yield (None, None, part[0])
    yield from part[2]()


def is_complete(summary: Summary) -> bool:
    """Whether the summary tells where all messages are: each is in a chunk that has indexes, of a
    channel that the summary has.

    Parameters
    ----------
    summary
        Of a file.
    """
    told = summary.statistics
    indexed = sum(
        (chunk.message_index_length - 15 * len(chunk.message_index_offsets)) // 16
        for chunk in summary.chunks
    )
    return (
        told is not None
        and defines_all(summary)
        and indexed == told.message_count == sum(told.channel_message_counts.values())
        and told.metadata_count == len(summary.metadata)
        and told.attachment_count == len(summary.attachments)
    )


def _holds_more(data: memoryview, summary: Summary) -> bool:
    """Whether messages stand before, between or behind those chunks that the summary has."""
    place = len(MAGIC)
    known = [
        (begin, begin + one.chunk_length + one.message_index_length)
        for one in summary.chunks
        for begin in [one.chunk_start_offset]
    ]
    for begin, end in [*known, (summary.start, summary.start)]:
        while place + RECORD.size <= begin:
            opcode, length = RECORD.unpack_from(data, place)
            if opcode in (Opcode.CHUNK, Opcode.MESSAGE):
                return True
            place += RECORD.size + length
        place = end
    return False
