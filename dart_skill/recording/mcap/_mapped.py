"""Bytes of a file of any size, of which few are in memory at a time."""

from __future__ import annotations

import mmap
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from zlib import crc32

from dart_skill.common.files import open_file

READ_AT_ONCE = 2**24
"""Part of a file that stays in memory while the file is gone through [bytes]."""


@contextmanager
def mapped(path: Path) -> Iterator[memoryview]:
    """The bytes of a file, read as they are needed."""
    if path.stat().st_size == 0:
        yield memoryview(b"")
        return
    with open_file(path) as stream:
        content = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    view = memoryview(content)
    try:
        yield view
    finally:
        view.release()
        with suppress(BufferError):  # an exception on its way out may still hold a part of it
            content.close()


def give_back(data: memoryview, begin: int, end: int) -> int:
    """Let go of the memory of a file's bytes once they are many; returns where those begin that
    are still held.

    * data: the bytes of `mapped`, which are read again where somebody asks for them again.
    * begin, end: what was read since the last time.
    """
    if end - begin < READ_AT_ONCE:
        return begin
    if isinstance(data.obj, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
        before = _address(data) - _address(
            data.obj
        )  # where a file that is one of several in it begins
        first, last = ((before + place) // mmap.PAGESIZE * mmap.PAGESIZE for place in (begin, end))
        data.obj.madvise(mmap.MADV_DONTNEED, first, last - first)
    return end


def _address(data: memoryview | mmap.mmap) -> int:
    import numpy as np  # only large files are asked where they are

    return np.frombuffer(data, np.uint8).ctypes.data


def crc_of(data: memoryview, end: int) -> int:
    """CRC of a file's bytes before an end, of which few are in memory at a time. data: its bytes;
    end: before which they count.
    """
    crc = held = 0
    for begin in range(0, end, READ_AT_ONCE):
        stop = min(begin + READ_AT_ONCE, end)
        crc, held = crc32(data[begin:stop], crc), give_back(data, held, stop)
    return crc
