"""Text files of rows of cells, as programs of all kinds write them: encodings, delimiters, decimal
commas, cells that say nothing.

A file is read row by row, and only the wanted columns are kept, so that a long and wide one needs
little memory.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dart_skill.common.constants import NS_PER_S
from dart_skill.common.files import open_file
from dart_skill.recording.imports.mapping import TIME_UNITS

DELIMITERS = ("\t", ";", ",")
"""Characters between cells, in the order in which they are tried: a comma may be a decimal one where
there are others.
"""
MISSING = {
    "",
    "null",
    "na",
    "n/a",
    "#n/a",
    "#nv",
    "none",
    "-",
    "--",
    "-nan(ind)",
    "nan(ind)",
    "1.#qnan",
    "1.#ind",
    "-1.#ind",
    "-1.#qnan",
}
"""What cells without a number hold, in small letters."""
OTHERS = {
    b"PK\x03\x04": "a workbook or an archive: save the sheet as CSV",
    b"\xd0\xcf\x11\xe0": "an old workbook: save the sheet as CSV",
    b"\x89HDF": "HDF5: save its arrays as .npz",
    b"\x80": "maybe a pickle, which may run anything: save it as CSV, .npz or .parquet",
}
"""What to do with files that are no text, by their first bytes."""
SAMPLE = 65_536
"""Size of the beginning that tells encoding and delimiter [bytes]."""
LAST_LINES = 10
"""Number of lines at the end of the sample that tell the delimiter; a header may precede them."""
LATEST_NS = 2**62
"""Time that no recording reaches [ns]."""
SCALES = {unit: int(scale) for unit, scale in TIME_UNITS.items()}
"""Nanoseconds of each unit of time, as whole numbers."""
CHUNK = 4096
"""Number of rows that become numbers at a time."""


class TextRow(NamedTuple):
    """A line that is not empty: its number, from 1, and its cells."""

    number: int
    cells: Sequence[str]


@dataclass(frozen=True)
class Timing:
    """How the time of a row is told.

    Parameters
    ----------
    place
        Index of the column with times, or with the numbers of frames; None: rows are counted.
    unit
        Of the times, of TIME_UNITS.
    rate
        Frames per second [1/s]; 0 where the column has times.
    """

    place: int | None
    unit: str = "s"
    rate: float = 0.0


class TextFile:
    """A text file of rows.

    Parameters
    ----------
    path
        Of the file.
    delimiter
        Between cells, " " for any number of spaces; empty: as the file itself tells.

    Raises
    ------
    ValueError
        With the file and the line, for what is none.
    """

    def __init__(self, path: Path, delimiter: str = ""):
        self.path = path
        self._sample = self._beginning()
        self._encoding = self._told_encoding()
        self.delimiter = delimiter or self._told_delimiter()

    def error(self, text: str, row: TextRow | None = None) -> ValueError:
        """An error that names the file, and the line of a row."""
        return ValueError(f"{self.path}{'' if row is None else f', line {row.number}'}: {text}")

    def rows(self, after: int = 0) -> Iterator[TextRow]:
        """The rows below a line, in order.

        Parameters
        ----------
        after
            Number of the line.
        """
        try:
            with io.TextIOWrapper(
                open_file(self.path), self._encoding, errors="replace"
            ) as stream:
                if self.delimiter == " " and not any('"' in line for line in self.first_lines):
                    numbered: Iterable[tuple[int, list[str]]] = enumerate(
                        map(str.split, stream), 1
                    )
                else:
                    spaced = self.delimiter == " "
                    reader = csv.reader(stream, delimiter=self.delimiter, skipinitialspace=spaced)
                    numbered = ((reader.line_num, cells) for cells in reader)
                for number, cells in numbered:
                    if number > after and any(map(str.strip, cells)):
                        yield TextRow(number, cells)
        except csv.Error as error:
            raise self.error(f"no CSV file: {error}") from error

    def read(
        self,
        rows: Iterable[TextRow],
        timing: Timing,
        places: Sequence[int],
        is_ragged: bool = False,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Stamps (n,) [ns] and numbers (n, k) in some columns of rows; nan where a cell says
        nothing.

        Parameters
        ----------
        timing
            How time is told.
        places
            Indices of the columns.
        is_ragged
            Whether cells may be missing at the end of a row.
        """
        place, last = timing.place, max((*places, timing.place or 0))
        pick = (
            itemgetter(*places)
            if len(places) > 1
            else lambda cells: tuple(cells[one] for one in places)
        )
        times: list[int] = []
        parts: list[np.ndarray] = []
        chunk: list[TextRow] = []
        for number, cells in rows:
            if len(cells) <= last:
                cells = self._filled(TextRow(number, cells), timing, places, is_ragged)
            times.append(len(times) if place is None else self._time(cells[place], number, timing))
            chunk.append(TextRow(number, pick(cells)))
            if len(chunk) == CHUNK:
                parts.append(self._numbers(chunk))
                chunk = []
        parts.append(self._numbers(chunk).reshape(len(chunk), len(places)))
        stamps = np.rint(np.array(times) * (NS_PER_S / timing.rate)) if timing.rate else times
        return np.array(stamps, dtype=np.int64), np.concatenate(parts)

    def _filled(
        self, row: TextRow, timing: Timing, places: Sequence[int], is_ragged: bool
    ) -> list[str]:
        """The cells of a row that ends too early."""
        missing = [one for one in (*places, timing.place or 0) if one >= len(row.cells)]
        if not is_ragged:
            raise self.error(
                f"{len(row.cells)} columns, column {min(missing) + 1} is missing: is it the right"
                " delimiter?",
                row,
            )
        return [*row.cells, *[""] * (max(missing) + 1 - len(row.cells))]

    def _beginning(self) -> bytes:
        try:
            with open_file(self.path) as stream:
                sample = stream.read(SAMPLE)
        except OSError as error:
            raise self.error(error.strerror or str(error)) from error
        if not sample.strip():
            raise self.error("the file is empty")
        return sample

    def _told_encoding(self) -> str:
        """By the mark at the beginning, by zeros of UTF-16, else UTF-8 or what Windows writes in
        western Europe.
        """
        sample = self._sample
        if sample[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return "utf-16"
        if b"\0" in sample:
            even, odd = sample[0::2].count(0), sample[1::2].count(0)
            if min(even, odd) or max(even, odd) < len(sample) // 4:
                known = next(
                    (text for magic, text in OTHERS.items() if sample.startswith(magic)),
                    "export it as text",
                )
                raise self.error(f"no text file: {known}")
            return "utf-16-le" if odd > even else "utf-16-be"
        try:
            sample.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            return (
                "utf-8-sig"
                if error.start > len(sample) - 4 and len(sample) == SAMPLE
                else "cp1252"
            )
        return "utf-8-sig"

    @cached_property
    def first_lines(self) -> list[str]:
        """Lines at the beginning that are not empty and whole."""
        lines = self._sample.decode(self._encoding, errors="replace").splitlines()
        return [
            line
            for line in (lines[:-1] if len(self._sample) == SAMPLE and len(lines) > 1 else lines)
            if line.strip()
        ]

    def _told_delimiter(self) -> str:
        lines = self.first_lines[-LAST_LINES:]
        spaced = " " if all(len(line.split()) > 1 for line in lines) else ","
        return next((one for one in DELIMITERS if all(one in line for line in lines)), spaced)

    def _numbers(self, chunk: Sequence[TextRow]) -> np.ndarray:
        try:
            return np.array(
                [[float(cell) if cell else math.nan for cell in cells] for _, cells in chunk]
            )
        except ValueError:
            pass
        has_points = any("." in cell for _, cells in chunk for cell in cells)
        return np.array(
            [[self._number(cell, row, has_points) for cell in row.cells] for row in chunk]
        )

    def _number(self, cell: str, row: TextRow, has_points: bool) -> float:
        text = cell.strip()
        if text.lower() in MISSING:
            return math.nan
        if "," in text and has_points:
            raise self.error(
                f"'{text}' has a comma and other numbers have a point: export it without commas"
                " for thousands",
                row,
            )
        try:
            return float(text.replace(",", ".", 1))
        except ValueError:
            raise self.error(f"'{text}' is no number", row) from None

    def _time(self, cell: str, number: int, timing: Timing) -> int:
        text = cell.strip()
        try:
            time = nanoseconds(text, timing.unit) if not timing.rate else int(float(text))
        except (ValueError, OverflowError):
            raise self.error(f"time '{text}' is no number", TextRow(number, [])) from None
        if abs(time) >= LATEST_NS:
            raise self.error(
                f"time '{text}' is no time of a recording: is '{timing.unit}' its unit?",
                TextRow(number, []),
            )
        return time


def number_told(text: str) -> float | None:
    """The number that a cell holds, with a decimal point or comma; None if it holds none."""
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return None


def nanoseconds(text: str, unit: str = "s") -> int:
    """A time exactly: as a binary fraction of a second, an instant of today would be off by a
    tenth of a microsecond.

    Parameters
    ----------
    text
        A number, or a date with a time as ISO 8601 writes it.
    unit
        Of the number, of TIME_UNITS.

    Raises
    ------
    ValueError
        For what is no time.
    """
    try:
        return int((Decimal(text.replace(",", ".", 1)) * SCALES[unit]).to_integral_value())
    except (InvalidOperation, ValueError):
        if text[:5].count("-") != 1:
            raise ValueError(f"'{text}' is no time") from None
    return int(np.datetime64(text.rstrip("Z"), "ns").astype(np.int64))
