"""What a file is by its first bytes, whatever its name says; and what is packed in it."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from pathlib import Path

import zstandard

from dart_skill.common.files import open_file
from dart_skill.recording.mcap import LARGEST_UNPACKED, USUAL_RATIO

SQLITE = b"SQLite format 3\0"
_AT_ONCE = 2**20
_OTHERS = (
    (
        rb"#ROSBAG V",
        (
            "a bag of ROS 1, which is read, but not recovered: 'rosbag reindex' of ROS 1 repairs"
            " its index"
        ),
    ),
    (rb"\xfd7zXZ\0", "compressed with xz: unpack it with 'xz -d'"),
    (rb"BZh[1-9]", "compressed with bzip2: unpack it with 'bunzip2'"),
    (rb"\x04\x22\x4d\x18", "compressed with lz4: unpack it with 'lz4 -d'"),
    (rb"PK\x03\x04", "a ZIP archive: unpack it with 'unzip'"),
    (rb"7z\xbc\xaf\x27\x1c", "a 7z archive: unpack it with '7z x'"),
    (rb".{257}ustar", "a tar archive: unpack it with 'tar -xf'"),
    (rb"\x89HDF\r\n", "an HDF5 file, and no bag"),
    (rb"PAR1", "a Parquet file, and no bag"),
    (rb"\x89PNG|\xff\xd8\xff|GIF8", "a picture, and no bag"),
    (rb"%PDF", "a PDF, and no bag"),
    (
        rb"version https://git-lfs",
        "a pointer of Git LFS: the file itself was not fetched, 'git lfs pull' does it",
    ),
    (
        rb"\s*(?i:<!doctype|<html|<\?xml)",
        "a web page: the download gave a page, perhaps of a log-in, instead of the file",
    ),
    (rb"iU1DQVAw|U1FMaXRlIGZvcm1hd", "text in base64: decode it with 'base64 -d'"),
    (rb"(?i:894d4341 ?5030|53514c69746520)", "text in hexadecimal: decode it with 'xxd -r -p'"),
    (
        rb"\x37\x7f\x06[\x82\x83]",
        "the write-ahead log of an SQLite file: give the .db3 file that it stands beside",
    ),
    (
        rb"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7",
        "the rollback journal of an SQLite file: give the .db3 file that it stands beside",
    ),
)
"""First bytes of files that are no bags, and what they are."""
PACKED = {b"\x28\xb5\x2f\xfd": "zstd", b"\x1f\x8b\x08": "gzip"}


def packing(data: memoryview) -> str:
    """How a file is compressed as a whole, of the ways that are unpacked here: "zstd", "gzip" or
    "". data: its bytes.
    """
    return next((name for first, name in PACKED.items() if bytes(data[: len(first)]) == first), "")


def foreign(data: memoryview) -> str:
    """What a file is that is no bag; empty for what may be one. data: its bytes."""
    head = bytes(data[:512])
    for first, what in _OTHERS:
        if re.match(first, head, re.DOTALL):
            return what
    return (
        ""
        if re.search(rb"[^\0]", data)
        else f"nothing but {len(data)} zero bytes: the disk never stored what was written"
    )


def unpack(path: Path, kind: str, target: Path) -> str:
    """Unpack a file as far as it goes into a new one; returns why it ends early, empty if it does
    not.

    * path: of the file; kind: as of `packing`.
    * target: the new one. ValueError if it gets far larger than any recording would.
    """
    most = max(LARGEST_UNPACKED, USUAL_RATIO * path.stat().st_size)
    size, reason = 0, ""
    with open(target, "xb") as out:
        parts = _parts(path, kind)
        while True:
            try:
                part = next(parts, None)
            except (zstandard.ZstdError, zlib.error, EOFError) as error:
                reason = str(error) or type(error).__name__
                break
            if part is None:
                break
            size += len(part)
            if size > most:
                raise ValueError(
                    f"it unpacks to more than {most} bytes: no recording is so much larger than"
                    " its file"
                )
            out.write(part)
    return reason


def _parts(path: Path, kind: str) -> Iterator[bytes]:
    """What comes out of a compressed file, of several frames or members one after the other;
    EOFError where it is cut off.
    """
    step = 2**12  # so little that the end of what can be unpacked is not lost with what follows
    with open_file(path) as stream:
        unpacker, begun = _unpacker(kind), False
        rest = stream.read(step)
        while rest:
            yield unpacker.decompress(rest)
            begun = True
            rest = unpacker.unused_data or b""
            if unpacker.eof:
                unpacker, begun = _unpacker(kind), False
            elif rest:
                raise EOFError("what follows is damaged")
            rest = rest or stream.read(step)
        if begun:
            raise EOFError("its end is missing")


def _unpacker(kind: str):  # type: ignore[no-untyped-def]
    return (
        zstandard.ZstdDecompressor().decompressobj() if kind == "zstd" else zlib.decompressobj(31)
    )
