"""One MCAP file that is being written: chunks, their indexes and the summary (MCAP specification,
version 0).

Messages, chunks and message indexes are packed here, a few structs per message; the rarer records
are those of the `mcap` package. Each append is one system call on an unbuffered file, and one that
fails is cut off again: the file ends with a whole record at any time. A schema or channel is
written twice, at once and again in the next chunk, under its CRC.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from zlib import crc32

import zstandard
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from dart_skill.recording.mcap.records import MAGIC, packed

CHUNK_SIZE = 256 * 1024
COMPRESSION_LEVEL = 1

# opcode, length, channel, sequence, log time, publish time
_MESSAGE = struct.Struct("<BQHIQQ").pack
# opcode, length, first and last time, size, CRC, "zstd", compressed size
_CHUNK = struct.Struct("<BQQQQI8sQ").pack
_CHUNK_HEAD_LENGTH = 8 + 8 + 8 + 4 + 8 + 8  # of a chunk's content, before the compressed records
_INDEX = struct.Struct("<BQHI").pack  # opcode, length, channel, bytes of entries
_ZSTD = struct.pack("<I4s", 4, b"zstd")


class McapChannel:
    """A channel of a file: its record, the messages in finished chunks, and the index of the
    current chunk.
    """

    __slots__ = ("record", "number", "count", "index")

    def __init__(self, record: Channel):
        self.record, self.number, self.count = record, record.id, 0
        self.index: list[int] = []  # log time, offset, log time, offset ...


class McapFile:
    """An MCAP file that is being written. `finish` makes it a whole file and leaves it open.

    Every method may raise OSError, after which the file holds what it held before.

    Parameters
    ----------
    path
        Must not exist yet.
    profile, library
        Of the header.
    chunk_size
        Bytes of records after which a chunk ends.
    """

    def __init__(
        self,
        path: Path,
        profile: str = "ros2",
        library: str = "dart_skill",
        chunk_size: int = CHUNK_SIZE,
    ):
        self.path, self.position = path, 0
        self.start_ns: int | None = None  # log times of what is in the file
        self.end_ns: int | None = None
        self.message_count = 0
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, McapChannel] = {}
        self._chunk_size, self._chunk, self._data_crc = chunk_size, bytearray(), 0
        self._compressor = zstandard.ZstdCompressor(level=COMPRESSION_LEVEL)
        self._chunk_indexes: list[bytes] = []
        self._index_bytes = 0
        self._attachment_indexes: list[McapRecord] = []
        self._metadata_indexes: list[McapRecord] = []
        self.stream = open(path, "xb", buffering=0)
        self._append(MAGIC + packed(Header(profile, library)))

    @property
    def summary_size(self) -> int:
        """About how many bytes `finish` adds."""
        definitions = sum(len(schema.data) + 100 for schema in self.schemas.values()) + 1000 * len(
            self.channels
        )
        return (
            definitions
            + self._index_bytes
            + 200 * (len(self._attachment_indexes) + len(self._metadata_indexes))
            + 500
        )

    def add_schema(self, name: str, encoding: str, data: bytes, number: int | None = None) -> int:
        """Announce a message type.

        Parameters
        ----------
        encoding
            Of its definition, such as ros2msg.

        Returns
        -------
        int
            Its number.
        """
        schema = Schema(
            id=len(self.schemas) + 1 if number is None else number,
            name=name,
            encoding=encoding,
            data=data,
        )
        self._define(packed(schema))
        self.schemas[schema.id] = schema
        return schema.id

    def add_channel(
        self,
        topic: str,
        encoding: str,
        schema: int,
        metadata: Mapping[str, str],
        number: int | None = None,
    ) -> McapChannel:
        """Announce a topic.

        Parameters
        ----------
        schema
            Number of its type, 0 for none.
        encoding
            Of its messages, such as cdr.
        metadata
            More about it.
        """
        number = len(self.channels) + 1 if number is None else number
        channel = McapChannel(
            Channel(
                id=number,
                topic=topic,
                message_encoding=encoding,
                schema_id=schema,
                metadata=dict(metadata),
            )
        )
        self._define(packed(channel.record))
        self.channels[number] = channel
        return channel

    def add_message(
        self,
        channel: McapChannel,
        sequence: int,
        log_time_ns: int,
        publish_time_ns: int,
        data: bytes,
    ) -> bool:
        """Append a message; True if it ended a chunk. Raises struct.error for numbers out of
        range.

        Parameters
        ----------
        channel
            Its topic.
        sequence
            Its number, 0 for none.
        log_time_ns, publish_time_ns
            Received and sent.
        """
        chunk, index = self._chunk, channel.index
        header = _MESSAGE(
            5, 22 + len(data), channel.number, sequence, log_time_ns, publish_time_ns
        )
        index.append(log_time_ns)
        index.append(len(chunk))
        chunk += header
        chunk += data
        if len(chunk) < self._chunk_size:
            return False
        self.end_chunk()
        return True

    def end_chunk(self) -> bool:
        """Hand the messages so far to the operating system; False if there are none."""
        entries = {channel: channel.index for channel in self.channels.values() if channel.index}
        if not entries:
            return False
        raw = self._chunk
        self._chunk = bytearray()
        for channel in entries:
            channel.index = []
        data = self._compressor.compress(raw)
        first = min(min(entry[::2]) for entry in entries.values())
        last = max(max(entry[::2]) for entry in entries.values())
        content = _CHUNK_HEAD_LENGTH + len(data)
        parts = [
            _CHUNK(Opcode.CHUNK, content, first, last, len(raw), crc32(raw), _ZSTD, len(data)),
            data,
        ]
        start, offsets, place = self.position, {}, self.position + 9 + content
        for channel, entry in entries.items():
            size = 8 * len(entry)
            parts += [
                _INDEX(Opcode.MESSAGE_INDEX, 6 + size, channel.number, size),
                struct.pack(f"<{len(entry)}Q", *entry),
            ]
            offsets[channel.number] = place
            place += 15 + size
        self._append(b"".join(parts))
        index = ChunkIndex(
            message_start_time=first,
            message_end_time=last,
            chunk_start_offset=start,
            chunk_length=9 + content,
            message_index_offsets=offsets,
            message_index_length=place - start - 9 - content,
            compression="zstd",
            compressed_size=len(data),
            uncompressed_size=len(raw),
        )
        self._chunk_indexes.append(packed(index))
        self._index_bytes += len(self._chunk_indexes[-1])
        self._count(first, last, entries)
        return True

    def add_attachment(
        self,
        name: str,
        media_type: str,
        data: bytes,
        create_time_ns: int = 0,
        log_time_ns: int = 0,
    ) -> None:
        """Append a file that goes with the messages.

        Parameters
        ----------
        create_time_ns, log_time_ns
            When it was made and when it was added [ns].
        """
        attachment = Attachment(
            data=data,
            name=name,
            media_type=media_type,
            create_time=create_time_ns,
            log_time=log_time_ns,
        )
        record, offset = packed(attachment), self.position
        self._append(record)
        index = AttachmentIndex(
            offset=offset,
            length=len(record),
            data_size=len(data),
            name=name,
            media_type=media_type,
            create_time=create_time_ns,
            log_time=log_time_ns,
        )
        self._attachment_indexes.append(index)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Append names and texts.

        Parameters
        ----------
        values
            Texts by name.
        """
        record, offset = packed(Metadata(name=name, metadata=dict(values))), self.position
        self._append(record)
        self._metadata_indexes.append(MetadataIndex(offset=offset, length=len(record), name=name))

    def finish(self) -> None:
        """Append the summary, which makes the file whole. All or nothing of it is written."""
        self.end_chunk()
        data_end = packed(DataEnd(self._data_crc))
        start = self.position + len(data_end)
        groups = [
            (Opcode.SCHEMA, [packed(schema) for schema in self.schemas.values()]),
            (Opcode.CHANNEL, [packed(channel.record) for channel in self.channels.values()]),
            (
                Opcode.STATISTICS,
                [
                    packed(
                        Statistics(
                            attachment_count=len(self._attachment_indexes),
                            channel_count=len(self.channels),
                            channel_message_counts={
                                number: channel.count for number, channel in self.channels.items()
                            },
                            chunk_count=len(self._chunk_indexes),
                            message_count=self.message_count,
                            message_end_time=self.end_ns or 0,
                            message_start_time=self.start_ns or 0,
                            metadata_count=len(self._metadata_indexes),
                            schema_count=len(self.schemas),
                        )
                    )
                ],
            ),
            (Opcode.CHUNK_INDEX, self._chunk_indexes),
            (Opcode.ATTACHMENT_INDEX, map(packed, self._attachment_indexes)),
            (Opcode.METADATA_INDEX, map(packed, self._metadata_indexes)),
        ]
        summary, group_offsets = bytearray(), bytearray()
        for opcode, records in groups:
            begin = len(summary)
            summary += b"".join(records)
            if len(summary) > begin:
                offset = SummaryOffset(
                    group_opcode=opcode,
                    group_start=start + begin,
                    group_length=len(summary) - begin,
                )
                group_offsets += packed(offset)
        offset_start = start + len(summary)
        summary += group_offsets
        head = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, offset_start)
        footer = packed(Footer(start, offset_start, crc32(head, crc32(summary))))
        self._append(data_end + bytes(summary) + footer + MAGIC)
        self._chunk_indexes.clear()

    def _define(self, record: bytes) -> None:
        self._append(record)
        self._chunk += record

    def _count(self, first: int, last: int, entries: dict[McapChannel, list[int]]) -> None:
        self.start_ns = first if self.start_ns is None else min(first, self.start_ns)
        self.end_ns = last if self.end_ns is None else max(last, self.end_ns)
        for channel, entry in entries.items():
            channel.count += len(entry) // 2
            self.message_count += len(entry) // 2

    def _append(self, data: bytes) -> None:
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[self.stream.write(rest) :]
        except OSError:
            with suppress(OSError):  # what cannot be cut off either is left to `recover`
                self.stream.truncate(self.position)
                self.stream.seek(self.position)
            raise
        self.position += len(data)
        self._data_crc = crc32(data, self._data_crc)
