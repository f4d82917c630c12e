"""The files of a bag: which there are, in order, and opening them, whatever they are called: MCAP or
SQLite, compressed as a whole, message by message, or not at all.

What a file is, its first bytes say, and so do those of a message: the header of CDR begins with a
zero.
"""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path, PureWindowsPath
from typing import TYPE_CHECKING

import lz4.frame
import zstandard

from dart_skill.common.configuration import shared_folders
from dart_skill.common.files import open_file
from dart_skill.recording.mcap import (
    LARGEST_UNPACKED,
    USUAL_RATIO,
    BagMessage,
    DamagedError,
    McapInput,
)

if TYPE_CHECKING:
    from dart_skill.recording.bags._other_inputs import Ros1Input, SqliteInput

EXAMPLE = "bags/five_demonstrations"
"""Bag that comes with the library."""
SUFFIXES = (".mcap", ".db3")
SIDE_FILES = {"-wal": "write-ahead log", "-journal": "journal"}
"""Endings of what SQLite keeps beside a file: what is not in it yet, and what was in it before."""
PACKED = (".zstd", ".zst", ".lz4")
"""Endings of a file that was compressed as a whole, behind its own."""


def example_bag() -> Path:
    """Bag of five guided throws, which comes with the library: enough to learn from.

    Poses of hand, ball and basket (100 Hz), joint states (100 Hz), and the teacher's commands.

    Raises
    ------
    FileNotFoundError
        If it was not installed.
    """
    folders = shared_folders(EXAMPLE, "dart_skill", EXAMPLE)
    for folder in folders:
        if folder.is_dir():
            return folder
    raise FileNotFoundError(
        f"the bag {EXAMPLE} is not in {', '.join(map(str, folders))}: install again"
    )


def unpacked_name(name: str) -> str:
    """The name of a file without the ending of its compression."""
    return next((name.removesuffix(ending) for ending in PACKED if name.endswith(ending)), name)


def part_number(file: Path) -> tuple[str, int]:
    """Name and number of a file of a split bag; number -1 if it has none."""
    stem = Path(unpacked_name(file.name)).stem
    match = re.fullmatch(r"(.*)_(\d+)", stem)
    return (match[1], int(match[2])) if match else (stem, -1)


def side_files(file: Path) -> dict[str, Path]:
    """The write-ahead log and the journal beside an SQLite file, by their ending.

    Parameters
    ----------
    file
        Which need not be there.
    """
    beside = {ending: file.with_name(file.name + ending) for ending in SIDE_FILES}
    return {ending: one for ending, one in beside.items() if one.is_file() and one.stat().st_size}


def has_only_log(file: Path) -> bool:
    """Whether an SQLite file is empty or missing and its write-ahead log is there: SQLite throws
    that away when it opens the file.
    """
    return (
        file.suffix == ".db3"
        and "-wal" in side_files(file)
        and not (file.is_file() and file.stat().st_size)
    )


def missing_parts(files: list[Path]) -> list[str]:
    """Which parts of a split bag are missing between others and before the first, by name.

    Parameters
    ----------
    files
        Those that are there.
    """
    found, last = [], {part_number(file)[0]: -1 for file in files}
    for name, number in sorted(map(part_number, files)):
        first = last[name] + 1
        if number > first:
            found.append(
                f"{name}_{first}" + (f" to {name}_{number - 1}" if number > first + 1 else "")
            )
        last[name] = number
    return found


def storage_files(folder: Path) -> list[Path]:
    """The files of a folder that hold messages, in order, and those that were compressed and are
    not there as they were before.
    """
    found = []
    for file in folder.iterdir():
        plain = folder / unpacked_name(file.name)
        if plain.suffix in SUFFIXES and (plain == file or not plain.exists()):
            found.append(file)
    return sorted(found, key=part_number)


def named_files(folder: Path, metadata: dict) -> list[Path]:
    """The files that the metadata name, whether they are there or not; in the folder, wherever
    they were when it was recorded.
    """
    names = [PureWindowsPath(str(name)).name for name in metadata.get("relative_file_paths") or []]
    return [folder / name for name in dict.fromkeys(names) if name]


def chosen_files(folder: Path, metadata: dict) -> tuple[list[Path], list[Path]]:
    """The files of a bag in a folder, in order, and those that are missing of it.

    Those that metadata.yaml names, if they are there. Where as many others stand in their place,
    the files were renamed or unpacked since.
    """
    there, named = storage_files(folder), named_files(folder, metadata)
    missing = [file for file in named if not file.exists()]
    others = [file for file in there if file not in named]
    if not named or (missing and len(others) == len(missing)):
        return there, []
    return [file for file in named if file not in missing], missing


def sync_folder(path: Path) -> None:
    """Get the names of the files in a folder to the disk; without them no power cut leaves the
    files.
    """
    with suppress(OSError):  # some file systems sync no folders, and need none to
        folder = os.open(path, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


MCAP_MAGIC = b"\x89MCAP0\r\n"
SQLITE_MAGIC = b"SQLite format 3\0"
ROS1_MAGIC = b"#ROSBAG "
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
LZ4_MAGIC = b"\x04\x22\x4d\x18"
GZIP_MAGIC = b"\x1f\x8b\x08"
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
LARGEST_MESSAGE = 2**28
"""Largest content of a compressed message that is unpacked [bytes]."""


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


def is_of_ros1(path: Path) -> bool:
    """Whether a file is a bag of ROS 1, by its first bytes."""
    with open_file(path) as stream:
        return stream.read(len(ROS1_MAGIC)) == ROS1_MAGIC


def open_input(path: Path) -> McapInput | SqliteInput:
    """A file of a bag of ROS 2, open for reading.

    Raises
    ------
    DamagedError
    """
    if storage_of(path) != "sqlite3":
        return McapInput(path)
    from dart_skill.recording.bags._other_inputs import SqliteInput

    return SqliteInput(path)


def open_any(path: Path) -> McapInput | SqliteInput | Ros1Input:
    """A file of a bag, of ROS 1, too, open for reading.

    Raises
    ------
    DamagedError
        ValueError for what is no bag of ROS 1, as rosbags says it.
    """
    if not is_of_ros1(path):
        return open_input(path)
    from dart_skill.recording.bags._other_inputs import Ros1Input

    return Ros1Input(path)


def is_packed(path: Path) -> bool:
    """Whether a file was compressed as a whole."""
    return path.suffix in PACKED


def packing(data: memoryview) -> str:
    """How a file is compressed as a whole, by its first bytes: "zstd", "gzip" or ""."""
    if data[:4] == ZSTD_MAGIC:
        return "zstd"
    return "gzip" if data[:3] == GZIP_MAGIC else ""


def foreign(data: memoryview) -> str:
    """What a file is that is no bag; empty for what may be one.

    Parameters
    ----------
    data
        Its bytes.
    """
    head = bytes(data[:512])
    for first, what in _OTHERS:
        if re.match(first, head, re.DOTALL):
            return what
    return (
        ""
        if re.search(rb"[^\0]", data)
        else f"nothing but {len(data)} zero bytes: the disk never stored what was written"
    )


def unpack_file(path: Path, folder: Path) -> Path:
    """What a file that was compressed as a whole holds, as a file in the folder.

    Raises
    ------
    DamagedError
        Also if that is far more than any bag.
    """
    target = folder / unpacked_name(path.name)
    if reason := unpack(path, "lz4" if path.suffix == ".lz4" else "zstd", target):
        raise DamagedError(f"{path.name} cannot be unpacked ({reason})")
    return target


def unpack(path: Path, kind: str, target: Path) -> str:
    """Unpack a file as far as it goes into a new one.

    Parameters
    ----------
    kind
        "zstd", "gzip" or "lz4".

    Returns
    -------
    str
        Why it ends early, empty if it does not.

    Raises
    ------
    DamagedError
        If it gets far larger than any recording would.
    """
    size, most = 0, max(LARGEST_UNPACKED, USUAL_RATIO * path.stat().st_size)
    with open(target, "wb") as out:
        try:
            for part in _parts(path, kind):
                size += len(part)
                if size > most:
                    raise DamagedError(
                        f"{path.name} unpacks to more than {most} bytes: no recording is so much"
                        " larger than its file"
                    )
                out.write(part)
        except (zstandard.ZstdError, zlib.error, RuntimeError, EOFError) as error:
            return str(error) or type(error).__name__
    return ""


def _parts(path: Path, kind: str) -> Iterator[bytes]:
    """What comes out of a compressed file, of several frames or members one after the other;
    EOFError where it is cut off.
    """
    step = 2**12  # so little that the end of what can be unpacked is not lost with what follows
    with open_file(path) as stream:
        unpacker, begun = _UNPACKERS[kind](), False
        rest = stream.read(step)
        while rest:
            yield unpacker.decompress(rest)
            begun = True
            rest = unpacker.unused_data or b""
            if unpacker.eof:
                unpacker, begun = _UNPACKERS[kind](), False
            elif rest:
                raise EOFError("what follows is damaged")
            rest = rest or stream.read(step)
        if begun:
            raise EOFError("its end is missing")


def unpacked_messages(messages: Iterator[BagMessage]) -> Iterator[BagMessage]:
    """Messages of a bag, unpacked if the first of them shows that each was compressed by itself."""
    for first in messages:
        unpack, every = unpacker_of(first.data), chain((first,), messages)
        yield from (
            every if unpack is None else (one._replace(data=unpack(one.data)) for one in every)
        )


def unpacker_of(data: bytes) -> Callable[[bytes], bytes] | None:
    """What unpacks messages like this one, whose bytes are no CDR; None for what was not
    compressed. It raises DamagedError.
    """
    return {ZSTD_MAGIC: _from_zstd, LZ4_MAGIC: _from_lz4}.get(bytes(data[:4]))


def plain_message(data: bytes) -> bytes:
    """A message that was compressed by itself, unpacked; another one, and one that cannot be
    unpacked, as it is.
    """
    unpack_message = unpacker_of(data)
    if unpack_message is not None:
        with suppress(DamagedError):
            return unpack_message(data)
    return data


@contextmanager
def _explained() -> Iterator[None]:
    try:
        yield
    except (zstandard.ZstdError, RuntimeError, EOFError) as error:
        raise DamagedError(f"a message cannot be unpacked ({error})") from error


@_explained()
def _from_zstd(data: bytes) -> bytes:
    size = zstandard.frame_content_size(data)
    if size > LARGEST_MESSAGE:
        raise DamagedError(
            f"a message says that it holds {size} bytes, more than the {LARGEST_MESSAGE} that are"
            " unpacked"
        )
    most = LARGEST_MESSAGE if size < 0 else 0
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=most)


@_explained()
def _from_lz4(data: bytes) -> bytes:
    return lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=LARGEST_MESSAGE)


_UNPACKERS: dict[str, Callable] = {
    "zstd": lambda: zstandard.ZstdDecompressor().decompressobj(),
    "gzip": lambda: zlib.decompressobj(31),
    "lz4": lz4.frame.LZ4FrameDecompressor,
}
"""What unpacks a file, by how it is compressed."""
