"""Files that are read only if they are files, and that are there whole or not at all."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

_KINDS = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
    stat.S_IFDIR: "a folder",
}


class NoFile(OSError):
    """What should be a file is something else, which may never end, or never begin."""


def require_file(path: str | os.PathLike) -> None:
    """NoFile for what is there but is no regular file: a pipe, a device, a socket, a folder.
    FileNotFoundError if nothing is.
    """
    _check(os.stat(_checked(path)).st_mode, path)


def open_file(path: str | os.PathLike) -> BinaryIO:
    """A regular file, open for reading.

    Raises
    ------
    NoFile
        For anything else, which is not waited for.
    """
    descriptor = os.open(
        _checked(path), os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)
    )
    try:
        _check(os.fstat(descriptor).st_mode, path)
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


@contextmanager
def new_file(path: str | os.PathLike, replace: bool = False) -> Iterator[BinaryIO]:
    """A file to write, which is there whole and on the disk when the block ends, and not at all if
    the block or the disk fails.

    Parameters
    ----------
    replace
        Instead of one that is there already; else FileExistsError. It is written beside its place,
        and renamed.

    Raises
    ------
    OSError
        With its name where the disk is full.
    """
    place = Path(os.path.realpath(_checked(path)))
    if not replace and place.exists():
        raise FileExistsError(f"{place} exists already: choose another name")
    beside = place.with_name(f".{place.name[:100]}.{os.getpid()}.part")
    try:
        with open(beside, "xb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        if replace:
            beside.replace(place)
        else:
            _put(beside, place)
    except OSError as error:
        if error.errno is None or error.filename is not None:
            raise
        # a disk that is full says of no file that it was this one
        raise OSError(error.errno, error.strerror, str(place)) from error
    finally:
        with suppress(OSError):
            beside.unlink()


def _put(beside: Path, place: Path) -> None:
    """Give a file its name, unless another one has got it meanwhile."""
    try:
        os.link(beside, place)
    except FileExistsError:
        raise FileExistsError(f"{place} exists already: choose another name") from None
    except OSError:  # a file system without hard links
        beside.replace(place)


def _checked(path: str | os.PathLike) -> str:
    text = os.fspath(path)
    if not isinstance(text, str) or "\0" in text:
        raise ValueError(f"{text!r} is no path")
    return text


def _check(mode: int, path: str | os.PathLike) -> None:
    if not stat.S_ISREG(mode):
        raise NoFile(
            f"{os.fspath(path)} is {_KINDS.get(stat.S_IFMT(mode), 'something else')}, and not a"
            " file"
        )
