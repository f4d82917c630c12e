"""NumPy archives of arrays (.npz) from wherever: never with pickle, and never more memory than
they are worth.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterable, Mapping
from typing import Any, BinaryIO

import numpy as np

LARGEST = 2**28
"""Largest size of all that an archive holds: thousands of demonstrations [bytes]."""


def read_arrays(file: BinaryIO) -> dict[str, np.ndarray]:
    """Everything in an open archive, once it is known how much that is.

    Parameters
    ----------
    file
        Open for reading bytes.

    Raises
    ------
    ValueError
        Or what zip and NumPy raise, for what is none.
    """
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        size = sum(member.file_size for member in members)
        if size > LARGEST:
            raise ValueError(
                f"it says that it holds {size} bytes, more than the {LARGEST} that a model may"
                " have"
            )
        for member in members:
            _check_size(archive, member)
    file.seek(0)
    with np.load(file, allow_pickle=False) as loaded:
        return dict(loaded)


def write_arrays(file: BinaryIO, content: Mapping[str, Any]) -> None:
    """Write what `read_arrays` reads, compressed.

    Parameters
    ----------
    file
        Open for writing bytes.
    content
        Arrays by their names.

    Raises
    ------
    ValueError
        For more than it would read.
    """
    size = sum(np.asarray(value).nbytes for value in content.values())
    if size > LARGEST:
        raise ValueError(
            f"{size} bytes are more than the {LARGEST} that a model may have: learn from fewer"
            " demonstrations"
        )
    np.savez_compressed(file, **content)


def numbered(rows: Iterable[Mapping[str, Any]]) -> dict[str, np.ndarray]:
    """Many of one kind in one archive: each by its number and name.

    Parameters
    ----------
    rows
        The arrays of each, by their names.
    """
    return {
        f"{k:04d}.{name}": np.asarray(value)
        for k, row in enumerate(rows)
        for name, value in row.items()
    }


def in_order(content: Mapping[str, np.ndarray]) -> list[dict[str, np.ndarray]]:
    """What `numbered` put together, apart again, in its order.

    Parameters
    ----------
    content
        That alone.

    Raises
    ------
    ValueError
        For a name without a number.
    """
    rows: dict[int, dict[str, np.ndarray]] = {}
    for name, value in content.items():
        number, _, rest = name.partition(".")
        rows.setdefault(int(number), {})[rest] = value
    return [rows[k] for k in sorted(rows)]


def _check_size(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> None:
    """An array takes the memory that its head says, whatever follows: the two must agree."""
    with archive.open(member) as stream:
        version = np.lib.format.read_magic(stream)
        read = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }.get(version)
        if read is None:
            raise ValueError(f"{member.filename} has the unknown array format {version}")
        shape, _, dtype = read(stream)
        if stream.tell() + math.prod(shape) * dtype.itemsize != member.file_size:
            raise ValueError(
                f"{member.filename} says that it has the shape {shape}, but it has"
                f" {member.file_size} bytes"
            )
