"""Poses and signals from CSV files: tables whose columns a mapping names, and the export of OptiTrack's Motive.

Motive writes a line of pairs (name, value) about the take, then, above the numbers, lines that tell of each column the type and name of
what it belongs to, whether it is `Rotation` or `Position`, and its axis. Cells of a body that was not tracked are empty. (Layout:
OptiTrack's documentation, "Data Export: CSV", format versions 1.2 and later.)
"""

from __future__ import annotations

import csv
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np

from dart_skill.recording.imports.mapping import QUATERNION_ORDERS, TIME_UNITS, Table
from dart_skill.recording.imports.pose_stream import IDENTITY

MOTIVE_LENGTHS = {"meters": 1.0, "centimeters": 1e-2, "millimeters": 1e-3}


def read_table(folder: Path, table: Table) -> dict[str, np.ndarray]:
    """Columns of a CSV file by name: `time` (n,) as int64 nanoseconds, the others (n, k) as numbers, nan where a cell is empty."""
    path, lines = _lines(folder, table.file, table.delimiter)
    if len(lines) <= table.header_lines:
        raise ValueError(f"{path}: {len(lines)} lines, of which {table.header_lines} are the header: there are no numbers")
    names = [name.strip() for name in lines[table.header_lines - 1][1]] if table.header_lines else []
    rows = lines[table.header_lines :]
    places = {key: [_place(path, column, names) for column in columns] for key, columns in table.columns.items()}
    time = [_nanoseconds(path, number, _cell(path, number, row, places["time"][0]), table.time) for number, row in rows]
    found = {key: _numbers(path, rows, columns) for key, columns in places.items() if key != "time"}
    return {"time": np.array(time, dtype=np.int64), **found}


def read_pose_table(folder: Path, table: Table, order: str, scale: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stamps (n,) [ns], positions (n, 3) [m], quaternions (n, 4) x, y, z, w of the rows in which the body was seen."""
    columns = read_table(folder, table)
    quaternion = columns["quaternion"]
    if quaternion.shape[1] == 0:
        quaternion = np.tile(IDENTITY, (len(columns["time"]), 1))
        seen = ~np.isnan(columns["position"]).all(axis=1)
    else:
        quaternion = quaternion[:, QUATERNION_ORDERS[order]]
        seen = ~np.isnan(np.hstack([columns["position"], quaternion])).all(axis=1)
    return columns["time"][seen], scale * columns["position"][seen], quaternion[seen]


def read_motive(folder: Path, file: str, body: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of a rigid body in a CSV export of Motive."""
    path, lines = _lines(folder, file, ",")
    header = next((k for k, (_, row) in enumerate(lines) if row and row[0].strip() == "Frame"), None)
    if header is None or not lines[0][1][0].lstrip("\ufeff").startswith("Format Version"):
        raise ValueError(
            f"{path}: no CSV export of Motive: it begins with 'Format Version', and a line 'Frame,Time (Seconds),...' is missing"
        )
    about = dict(zip(lines[0][1][::2], lines[0][1][1::2], strict=False))
    if (turns := about.get("Rotation Type", "Quaternion")) != "Quaternion":
        raise ValueError(f"{path}: rotations are '{turns}': export it with rotation type Quaternion")
    unit = about.get("Length Units", "Meters").lower()
    if unit not in MOTIVE_LENGTHS:
        raise ValueError(f"{path}: length unit '{unit}' is not one of {', '.join(MOTIVE_LENGTHS)}")
    columns = _motive_columns(path, lines[: header + 1], body)
    rows = lines[header + 1 :]
    places = [columns["Position", axis] for axis in "XYZ"] + [columns["Rotation", axis] for axis in "XYZW"]
    values = _numbers(path, rows, places)
    time_place = lines[header][1].index("Time (Seconds)")
    time = [_nanoseconds(path, number, _cell(path, number, row, time_place), "s") for number, row in rows]
    seen = ~np.isnan(values).all(axis=1)
    return np.array(time, dtype=np.int64)[seen], MOTIVE_LENGTHS[unit] * values[seen, :3], values[seen, 3:]


def _motive_columns(path: Path, header: list, body: str) -> dict[tuple[str, str], int]:
    """Places of the columns of a rigid body by ("Rotation" or "Position", axis)."""
    labelled = {row[1].strip(): row for _, row in header if len(row) > 2 and not row[0].strip()}
    axes, kinds = header[-1][1], header[-2][1]
    if "Name" not in labelled or "Type" not in labelled:
        raise ValueError(f"{path}: the lines 'Type' and 'Name' above the columns are missing: export with the header")
    found: dict[tuple[str, str], int] = {}
    names = set()
    for place, (what, name, kind, axis) in enumerate(zip(labelled["Type"], labelled["Name"], kinds, axes, strict=False)):
        if what.strip() != "Rigid Body":
            continue
        names.add(name.strip())
        if name.strip() == body:
            found.setdefault((kind.strip(), axis.strip()), place)
    wanted = [("Position", axis) for axis in "XYZ"] + [("Rotation", axis) for axis in "XYZW"]
    if missing := [key for key in wanted if key not in found]:
        raise ValueError(f"{path}: no column {missing[0][0]} {missing[0][1]} of a rigid body '{body}', only the bodies {sorted(names)}")
    return found


def _lines(folder: Path, file: str, delimiter: str) -> tuple[Path, list[tuple[int, list[str]]]]:
    """Path, and numbers and cells of the lines that are not empty."""
    path = folder / file
    try:
        with open(path, encoding="utf-8-sig", newline="") as stream:
            lines = [(number, row) for number, row in enumerate(csv.reader(stream, delimiter=delimiter), 1) if any(map(str.strip, row))]
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: no CSV file: {error}") from error
    if not lines:
        raise ValueError(f"{path}: the file is empty")
    return path, lines


def _place(path: Path, column: str | int, names: list[str]) -> int:
    if isinstance(column, int):
        return column - 1
    if names.count(column) != 1:
        many = "several columns are" if column in names else "no column is"
        raise ValueError(f"{path}: {many} called '{column}'; the columns are {', '.join(names)}")
    return names.index(column)


def _cell(path: Path, number: int, row: list[str], place: int) -> str:
    if place >= len(row):
        raise ValueError(f"{path}, line {number}: {len(row)} columns, column {place + 1} is missing: is it the right delimiter?")
    return row[place]


def _numbers(path: Path, rows: list, places: list[int]) -> np.ndarray:
    texts = [[_cell(path, number, row, place).strip() or "nan" for place in places] for number, row in rows]
    try:
        return np.array(texts, dtype=float).reshape(len(rows), len(places))
    except ValueError:
        for (number, _), cells in zip(rows, texts, strict=True):
            for text in cells:
                if not _is_float(text):
                    raise ValueError(f"{path}, line {number}: '{text}' is no number") from None
        raise


def _is_float(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _nanoseconds(path: Path, number: int, text: str, unit: str) -> int:
    """A time exactly: as a binary fraction of a second, an instant of today would be off by a tenth of a microsecond."""
    try:
        return int((Decimal(text.strip()) * int(TIME_UNITS[unit])).to_integral_value())
    except (InvalidOperation, ValueError, OverflowError):
        raise ValueError(f"{path}, line {number}: time '{text}' is no number") from None
