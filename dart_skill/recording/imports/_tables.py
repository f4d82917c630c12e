"""Poses and signals from CSV files: tables whose columns a mapping names, and the export of OptiTrack's Motive.

Motive writes a line of pairs (name, value) about the take, then, above the numbers, lines that tell of each column the type and name of
what it belongs to, whether it is `Rotation` or `Position`, and its axis. Cells of a body that was not tracked are empty. (Layout:
OptiTrack's documentation, "Data Export: CSV", format versions 1.2 and later.)
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dart_skill.constants import UNTURNED
from dart_skill.recording.imports.mapping import TIME_UNITS, Table

MOTIVE_LENGTHS = {"meters": 1.0, "centimeters": 1e-2, "millimeters": 1e-3}
_MOTIVE_COLUMNS = [("Position", axis) for axis in "XYZ"] + [("Rotation", axis) for axis in "XYZW"]


def read_table(folder: Path, table: Table, unit: str = "s") -> dict[str, np.ndarray]:
    """Columns of a CSV file by name: `time` (n,) as int64 nanoseconds, the others (n, k) as numbers, nan where a cell is empty.

    unit: of the times, of TIME_UNITS.
    """
    file, n_header = _CsvFile(folder, table.file, table.delimiter), table.header_lines
    if len(file.lines) <= n_header:
        raise file.error(f"{len(file.lines)} lines, of which {n_header} are the header: there are no numbers")
    names = [name.strip() for name in file.lines[n_header - 1].cells] if n_header else []
    lines = file.lines[n_header:]
    places = {key: [file.place(column, names) for column in columns] for key, columns in table.columns.items()}
    time = file.times(lines, places.pop("time")[0], unit)
    return {"time": time, **{key: file.numbers(lines, columns) for key, columns in places.items()}}


def read_pose_table(folder: Path, table: Table, unit: str = "s") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stamps (n,) [ns], positions (n, 3) and quaternions (n, 4) of the rows in which the body was seen, as they stand in the table.

    unit: of the times, of TIME_UNITS.
    """
    columns = read_table(folder, table, unit)
    quaternion = columns["quaternion"]
    if quaternion.shape[1] == 0:
        quaternion = np.tile(UNTURNED, (len(columns["time"]), 1))
        seen = ~np.isnan(columns["position"]).all(axis=1)
    else:
        seen = ~np.isnan(np.hstack([columns["position"], quaternion])).all(axis=1)
    return columns["time"][seen], columns["position"][seen], quaternion[seen]


def read_motive(folder: Path, file: str, body: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of a rigid body in a CSV export of Motive."""
    export = _CsvFile(folder, file, ",")
    header = next((k for k, line in enumerate(export.lines) if line.cells[0].strip() == "Frame"), None)
    first = export.lines[0].cells
    if header is None or not first[0].startswith("Format Version"):
        raise export.error("no CSV export of Motive: it begins with 'Format Version', and a line 'Frame,Time (Seconds),...' is missing")
    about = dict(zip(first[::2], first[1::2], strict=False))
    if (turns := about.get("Rotation Type", "Quaternion")) != "Quaternion":
        raise export.error(f"rotations are '{turns}': export it with rotation type Quaternion")
    unit = about.get("Length Units", "Meters").lower()
    if unit not in MOTIVE_LENGTHS:
        raise export.error(f"length unit '{unit}' is not one of {', '.join(MOTIVE_LENGTHS)}")
    lines = export.lines[header + 1 :]
    values = export.numbers(lines, _motive_places(export, header, body))
    time = export.times(lines, export.lines[header].cells.index("Time (Seconds)"), "s")
    seen = ~np.isnan(values).all(axis=1)
    return time[seen], MOTIVE_LENGTHS[unit] * values[seen, :3], values[seen, 3:]


class _Line(NamedTuple):
    number: int
    cells: list[str]


class _CsvFile:
    """The lines of a CSV file that are not empty; ValueError, with the file and the line, for what is none."""

    def __init__(self, folder: Path, file: str, delimiter: str):
        self.path = folder / file
        try:
            with open(self.path, encoding="utf-8-sig", newline="") as stream:
                lines = enumerate(csv.reader(stream, delimiter=delimiter), 1)
                self.lines = [_Line(number, cells) for number, cells in lines if any(map(str.strip, cells))]
        except OSError as error:
            raise self.error(error.strerror or str(error)) from error
        except (UnicodeDecodeError, csv.Error) as error:
            raise self.error(f"no CSV file: {error}") from error
        if not self.lines:
            raise self.error("the file is empty")

    def error(self, text: str, line: _Line | None = None) -> ValueError:
        return ValueError(f"{self.path}{'' if line is None else f', line {line.number}'}: {text}")

    def place(self, column: str | int, names: list[str]) -> int:
        """Index of a column that is called by its name or number."""
        if isinstance(column, int):
            return column - 1
        if names.count(column) != 1:
            many = "several columns are" if column in names else "no column is"
            raise self.error(f"{many} called '{column}'; the columns are {', '.join(names)}")
        return names.index(column)

    def numbers(self, lines: Sequence[_Line], places: Sequence[int]) -> np.ndarray:
        """Numbers (n, k) in some columns of lines; nan where a cell is empty."""
        return np.array([[self._number(line, place) for place in places] for line in lines]).reshape(len(lines), len(places))

    def times(self, lines: Sequence[_Line], place: int, unit: str) -> np.ndarray:
        """Times (n,) in a column of lines [ns]."""
        return np.array([self._nanoseconds(line, place, unit) for line in lines], dtype=np.int64)

    def _cell(self, line: _Line, place: int) -> str:
        if place >= len(line.cells):
            raise self.error(f"{len(line.cells)} columns, column {place + 1} is missing: is it the right delimiter?", line)
        return line.cells[place].strip()

    def _number(self, line: _Line, place: int) -> float:
        text = self._cell(line, place)
        try:
            return float(text or "nan")
        except ValueError:
            raise self.error(f"'{text}' is no number", line) from None

    def _nanoseconds(self, line: _Line, place: int, unit: str) -> int:
        """A time exactly: as a binary fraction of a second, an instant of today would be off by a tenth of a microsecond."""
        text = self._cell(line, place)
        try:
            return int((Decimal(text) * int(TIME_UNITS[unit])).to_integral_value())
        except (InvalidOperation, ValueError, OverflowError):
            raise self.error(f"time '{text}' is no number", line) from None


def _motive_places(export: _CsvFile, header: int, body: str) -> list[int]:
    """Places of a rigid body's columns, in the order of _MOTIVE_COLUMNS. header: index of the last line above the numbers."""
    above = [line.cells for line in export.lines[: header + 1]]
    labelled = {cells[1].strip(): cells for cells in above if len(cells) > 2 and not cells[0].strip()}
    if "Name" not in labelled or "Type" not in labelled:
        raise export.error("the lines 'Type' and 'Name' above the columns are missing: export with the header")
    found: dict[tuple[str, str], int] = {}
    names = set()
    for place, told in enumerate(zip(labelled["Type"], labelled["Name"], above[-2], above[-1], strict=False)):
        what, name, kind, axis = map(str.strip, told)
        if what == "Rigid Body":
            names.add(name)
            if name == body:
                found.setdefault((kind, axis), place)
    if missing := [column for column in _MOTIVE_COLUMNS if column not in found]:
        raise export.error(f"no column {' '.join(missing[0])} of a rigid body '{body}', only the bodies {sorted(names)}")
    return [found[column] for column in _MOTIVE_COLUMNS]
