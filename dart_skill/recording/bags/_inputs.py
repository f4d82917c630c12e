"""Opening the files of a bag, whatever they are called: MCAP or SQLite, compressed as a whole,
message by message, or not at all.

What a file is, its first bytes say, and so do those of a message: the header of CDR begins with a
zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from dart_skill.common.files import open_file
from dart_skill.recording.bags._files import PACKED, SUFFIXES, unpacked_name
from dart_skill.recording.mcap import (
    LARGEST_UNPACKED,
    USUAL_RATIO,
    BagMessage,
    DamagedError,
    McapInput,
)

if TYPE_CHECKING:
    from dart_skill.recording.bags._sqlite import SqliteInput

MCAP_MAGIC, SQLITE_MAGIC = b"\x89MCAP0\r\n", b"SQLite format 3\0"
ZSTD_MAGIC, LZ4_MAGIC = b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18"
LARGEST_MESSAGE = 2**28
"""A compressed message that says that it holds more is not unpacked [bytes]."""


def storage_of(path: Path) -> str | None:
    """What rosbag2 calls the format of a file: mcap or sqlite3, by its first bytes, else by its
    name; None if neither says it.
    """
    with open_file(path) as stream:
        first = stream.read(len(SQLITE_MAGIC))
    if first.startswith(MCAP_MAGIC):
        return "mcap"
    if first == SQLITE_MAGIC:
        return "sqlite3"
    suffix = Path(unpacked_name(path.name)).suffix
    return {".mcap": "mcap", ".db3": "sqlite3"}[suffix] if suffix in SUFFIXES else None


def open_input(path: Path) -> McapInput | SqliteInput:
    """A file of a bag, open for reading; DamagedError."""
    if storage_of(path) != "sqlite3":
        return McapInput(path)
    from dart_skill.recording.bags._sqlite import SqliteInput

    return SqliteInput(path)


def is_packed(path: Path) -> bool:
    """Whether a file was compressed as a whole."""
    return path.suffix in PACKED


def unpack_file(path: Path, folder: Path) -> Path:
    """What a file that was compressed as a whole holds, as a file in the folder; DamagedError,
    also if that is far more than any bag.
    """
    import zstandard

    target = folder / unpacked_name(path.name)
    size, most = 0, max(LARGEST_UNPACKED, USUAL_RATIO * path.stat().st_size)
    with open_file(path) as stream, open(target, "wb") as unpacked:
        try:
            for part in _parts(path, stream):
                size += len(part)
                if size > most:
                    raise DamagedError(
                        f"{path.name} unpacks to more than {most} bytes: no recording is so much"
                        " larger than its file"
                    )
                unpacked.write(part)
        except (zstandard.ZstdError, RuntimeError, EOFError) as error:
            raise DamagedError(f"{path.name} cannot be unpacked ({error})") from error
    return target


def _parts(path: Path, stream: BinaryIO) -> Iterator[bytes]:
    if path.suffix == ".lz4":
        import lz4.frame

        reader = lz4.frame.LZ4FrameFile(stream)
    else:
        import zstandard

        reader = zstandard.ZstdDecompressor().stream_reader(stream, read_across_frames=True)
    with reader:
        while part := reader.read(2**20):
            yield part


def unpacked_messages(messages: Iterator[BagMessage]) -> Iterator[BagMessage]:
    """Messages of a bag, unpacked if the first of them shows that each was compressed by itself."""
    first = next(messages, None)
    if first is None:
        return iter(())
    unpack, messages = unpacker_of(first.data), chain((first,), messages)
    return (
        messages if unpack is None else (one._replace(data=unpack(one.data)) for one in messages)
    )


def unpacker_of(data: bytes) -> Callable[[bytes], bytes] | None:
    """What unpacks messages like this one, whose bytes are no CDR; None for what was not
    compressed. It raises DamagedError.
    """
    return _UNPACKERS.get(bytes(data[:4]))


def _zstd(data: bytes) -> bytes:
    import zstandard

    try:
        size = zstandard.frame_content_size(data)
        if size > LARGEST_MESSAGE:
            raise DamagedError(
                f"a message says that it holds {size} bytes, more than the {LARGEST_MESSAGE} that"
                " are unpacked"
            )
        return zstandard.ZstdDecompressor().decompress(
            data, max_output_size=LARGEST_MESSAGE if size < 0 else 0
        )
    except zstandard.ZstdError as error:
        raise DamagedError(f"a message cannot be unpacked ({error})") from error


def _lz4(data: bytes) -> bytes:
    import lz4.frame

    try:
        unpacked: bytes = lz4.frame.LZ4FrameDecompressor().decompress(
            data, max_length=LARGEST_MESSAGE
        )
    except (RuntimeError, EOFError) as error:
        raise DamagedError(f"a message cannot be unpacked ({error})") from error
    return unpacked


_UNPACKERS = {ZSTD_MAGIC: _zstd, LZ4_MAGIC: _lz4}
