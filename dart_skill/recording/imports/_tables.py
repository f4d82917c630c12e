"""Poses and signals from tables whose columns a mapping names: text files, and arrays of NumPy,
MATLAB and Parquet.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.constants import UNTURNED
from dart_skill.common.extras import optional
from dart_skill.recording.imports.mapping import ANGLE_UNITS, LENGTH_UNITS, TIME_UNITS, Table
from dart_skill.recording.imports.text_files import TextFile, TextRow, Timing

UNIT = re.compile(r"[\[(]\s*([a-z]+)\s*[\])]$")
"""Pattern of a unit in brackets at the end of the name of a column."""
UNITS: Mapping[str, Mapping[str, float]] = {
    "length": LENGTH_UNITS,
    "time": TIME_UNITS,
    "angle": ANGLE_UNITS,
}
"""Units that a header may name, by the key of the mapping."""


def read_table(
    folder: Path, table: Table, unit: str = "s", units: Mapping[str, str] | None = None
) -> dict[str, np.ndarray]:
    """Columns of a file by name: `time` (n,) as int64 nanoseconds, the others (n, k) as numbers,
    nan where a cell is empty.

    Parameters
    ----------
    folder
        Of the recording.
    table
        File and columns.
    unit
        Of the times, of TIME_UNITS.
    units
        What the mapping says of the other columns.

    Raises
    ------
    ValueError
        If the header of a text says something else.
    """
    path = folder / table.file
    reader = ARRAYS.get(path.suffix.lower())
    try:
        return (
            _of_text(path, table, unit, units or {})
            if reader is None
            else _of_arrays(path, table, unit, reader)
        )
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror or error}") from error


def read_pose_table(
    folder: Path, table: Table, unit: str = "s", length: str = "m"
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stamps (n,) [ns], positions (n, 3) and quaternions (n, 4) of the rows in which the body was
    seen, as they stand in the table.

    Parameters
    ----------
    folder
        Of the recording.
    table
        File and columns.
    unit
        Of the times, of TIME_UNITS.
    length
        Of the positions, of LENGTH_UNITS.
    """
    columns = read_table(folder, table, unit, {"position": length})
    quaternion = columns["quaternion"]
    for name, width in (("position", 3), ("quaternion", 4)):
        if columns[name].shape[1] not in (width, 0):
            raise ValueError(
                f"{folder / table.file}: {name} has {columns[name].shape[1]} columns instead of"
                f" {width}"
            )
    if quaternion.shape[1] == 0:
        quaternion = np.tile(UNTURNED, (len(columns["time"]), 1))
        seen = ~np.isnan(columns["position"]).all(axis=1)
    else:
        seen = ~np.isnan(np.hstack([columns["position"], quaternion])).all(axis=1)
    return columns["time"][seen], columns["position"][seen], quaternion[seen]


# text


def _of_text(
    path: Path, table: Table, unit: str, units: Mapping[str, str]
) -> dict[str, np.ndarray]:
    file, header = TextFile(path, table.delimiter), []
    rows = file.rows()
    for _ in range(table.header_lines):
        header.append(next(rows, None))
    first = next(rows, None)
    above = [row for row in header if row is not None]
    if first is None:
        raise file.error(
            f"{len(above)} lines, of which {table.header_lines} are the header: there are no"
            " numbers"
        )
    names = _names(above)
    places = {
        key: [_place(file, column, names, above) for column in columns]
        for key, columns in table.columns.items()
    }
    _check_width(file, first, above)
    for key, said in {**units, "time": unit}.items():
        _check_units(file, above, said, places.get(key, ()))
    stamps, numbers = file.read(
        file.rows(first.number - 1),
        Timing(places.pop("time")[0], unit),
        [one for some in places.values() for one in some],
    )
    ends = np.cumsum([len(some) for some in places.values()])
    return (
        {"time": stamps, **dict(zip(places, np.split(numbers, ends[:-1], axis=1), strict=True))}
        if places
        else {"time": stamps}
    )


def _names(above: Sequence[TextRow]) -> list[list[str]]:
    """Names of the columns: of each line of the header, the last one first, and of two and of all
    of them together.
    """
    lines = [[cell.strip() for cell in row.cells] for row in above]
    filled = []
    for line in lines:
        filled.append(list(line))
        for place in range(1, len(line)):
            filled[-1][place] = line[place] or filled[-1][place - 1]
    joined = [
        [" ".join(filter(None, cells)) for cells in zip(*filled[k:-1], lines[-1], strict=False)]
        for k in range(len(lines) - 1)
    ]
    return [*lines[::-1], *joined[::-1]]


def _place(
    file: TextFile, column: str | int, names: Sequence[Sequence[str]], above: Sequence[TextRow]
) -> int:
    """Index of a column that is called by its name or number."""
    if isinstance(column, int):
        return column - 1
    for line in names:
        if line.count(column) == 1:
            return line.index(column)
    many = "several columns are" if any(column in line for line in names) else "no column is"
    there = (
        names[len(above)]
        if many.startswith("several") and len(names) > len(above)
        else names[0]
        if names
        else []
    )
    raise file.error(f"{many} called '{column}'; the columns are {', '.join(there)}")


def _check_width(file: TextFile, first: TextRow, above: Sequence[TextRow]) -> None:
    """ValueError for numbers with decimal commas between commas: twice as many cells as names."""
    filled = [cell for cell in first.cells if cell.strip()]
    if above and file.delimiter == "," and len(filled) >= 2 * len(above[-1].cells) > 2:
        raise file.error(
            f"{len(filled)} cells for {len(above[-1].cells)} columns: are these decimal commas?"
            " Export it with points",
            first,
        )


def _check_units(
    file: TextFile, above: Sequence[TextRow], said: str, places: Sequence[int]
) -> None:
    """ValueError if the header names another unit than the mapping."""
    word, known = next((word, units) for word, units in UNITS.items() if said in units)
    for place in places:
        for row in above:
            cell = row.cells[place].strip() if place < len(row.cells) else ""
            found = UNIT.search(cell)
            told = found[1] if found else cell if len(above) > 1 else ""
            if told in known and told != said:
                raise file.error(
                    f"column '{cell}' is in {told}, but {word} is '{said}' in the mapping: give"
                    f" '{word}: {told}'",
                    row,
                )


# arrays


def _of_arrays(
    path: Path, table: Table, unit: str, reader: Callable[[Path, Sequence[str | int]], dict]
) -> dict[str, np.ndarray]:
    wanted = [column for columns in table.columns.values() for column in columns]
    arrays = reader(path, wanted)
    parts = {
        key: [_array(path, column, arrays) for column in columns]
        for key, columns in table.columns.items()
    }
    time = _stamps(path, np.asarray(parts.pop("time")[0]), unit)
    found: dict[str, np.ndarray] = {"time": time}
    for key, arrays_of_key in parts.items():
        columns = [_samples(path, key, np.asarray(one), len(time)) for one in arrays_of_key]
        found[key] = np.hstack(columns) if columns else np.empty((len(time), 0))
    return found


def _array(path: Path, column: str | int, arrays: Mapping[str | int, Any]) -> Any:
    if column not in arrays:
        there = ", ".join(map(str, arrays)) or "nothing"
        raise ValueError(f"{path}: nothing is called '{column}' in it, only {there}")
    return arrays[column]


def _samples(path: Path, key: str, values: np.ndarray, n: int) -> np.ndarray:
    """Samples (n, k) of floats of an array with n rows, or, as MATLAB may have them, n columns."""
    if values.dtype.kind not in "fiub":
        raise ValueError(f"{path}: {key} holds no numbers, but {values.dtype}: save it as numbers")
    values = values.reshape(-1, 1) if values.ndim == 1 else values
    if values.ndim == 2 and values.shape[0] != n and values.shape[1] == n:
        values = values.T
    if values.ndim != 2 or values.shape[0] != n:
        raise ValueError(
            f"{path}: {key} has the shape {values.shape}, of which no side has the {n} samples of"
            " the time"
        )
    return np.ma.filled(np.ma.asarray(values).astype(float), np.nan)


def _stamps(path: Path, values: np.ndarray, unit: str) -> np.ndarray:
    """Stamps (n,) [ns] of times: integers and dates exactly, floats as exactly as they are."""
    flat = np.squeeze(values) if values.size > 1 else values.reshape(-1)
    if flat.dtype.kind == "M":
        return flat.astype("datetime64[ns]").astype(np.int64)
    if flat.ndim != 1 or flat.dtype.kind not in "fiu":
        raise ValueError(
            f"{path}: time has the shape {values.shape} and holds {values.dtype}: give a column of"
            " numbers"
        )
    scale = int(TIME_UNITS[unit])
    if flat.dtype.kind != "f":
        return flat.astype(np.int64) * scale
    if not (np.isfinite(flat).all() and (np.abs(flat) * scale < 2.0**62).all()):
        raise ValueError(f"{path}: a time is not finite, or too large: is '{unit}' its unit?")
    whole = np.floor(flat)
    return whole.astype(np.int64) * scale + np.rint((flat - whole) * scale).astype(np.int64)


def _numpy(path: Path, wanted: Sequence[str | int]) -> dict[str | int, Any]:
    """Arrays of an .npz by name, fields of a structured .npy, or columns of a plain one by number."""
    try:
        loaded = np.load(path, allow_pickle=False)
        arrays: dict[str | int, Any] = {}
        if isinstance(loaded, np.lib.npyio.NpzFile):
            with loaded:
                arrays = {name: loaded[name] if name in wanted else None for name in loaded.files}
        elif loaded.dtype.names:
            arrays = {name: loaded[name].reshape(len(loaded), -1) for name in loaded.dtype.names}
        elif loaded.ndim == 2:
            arrays = {k + 1: loaded[:, k] for k in range(loaded.shape[1])}
        else:
            raise ValueError(
                f"an array of shape {loaded.shape}: save rows of columns, or a structured array"
            )
    except (ValueError, EOFError) as error:
        hint = (
            "; Python objects are not read, as they may run anything: save arrays of numbers"
            if "pickle" in str(error).lower()
            else ""
        )
        raise ValueError(
            f"{path}: {'it holds Python objects' if hint else error}{hint}"
        ) from error
    return arrays


def _matlab(path: Path, wanted: Sequence[str | int]) -> dict[str | int, Any]:
    """Variables of a .mat file by name; fields of structures as `structure.field`."""
    from scipy.io import loadmat

    try:
        loaded = loadmat(path, simplify_cells=True)
    except NotImplementedError:
        raise ValueError(
            f"{path}: written by MATLAB as version 7.3: save it with save('{path.name}', '-v7')"
        ) from None
    except Exception as error:  # SciPy meets arbitrary bytes
        raise ValueError(f"{path}: no file of MATLAB: {error}") from error
    flat = {name: value for name, value in loaded.items() if not name.startswith("__")}
    for name in list(flat):
        if isinstance(flat[name], dict):
            flat.update(_fields(name, flat.pop(name)))
    del wanted
    return dict(flat)


def _fields(name: str, structure: Mapping[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in structure.items():
        found.update(
            _fields(f"{name}.{key}", value)
            if isinstance(value, dict)
            else {f"{name}.{key}": value}
        )
    return found


def _parquet(path: Path, wanted: Sequence[str | int]) -> dict[str | int, Any]:
    """Columns of a Parquet file by name or number; nan where there is no value."""
    pa, pq = optional("pyarrow"), optional("pyarrow.parquet")
    try:
        there = pq.read_schema(path).names
        names: dict[str | int, str] = {
            **dict(enumerate(there, 1)),
            **{name: name for name in there},
        }
        table = pq.read_table(path, columns=[names[key] for key in wanted if key in names])
    except pa.ArrowException as error:
        raise ValueError(f"{path}: no Parquet file: {error}") from error
    return {
        key: table.column(name).to_numpy() if key in wanted else None
        for key, name in names.items()
    }


ARRAYS: Mapping[str, Callable[[Path, Sequence[str | int]], dict]] = {
    ".npy": _numpy,
    ".npz": _numpy,
    ".mat": _matlab,
    ".parquet": _parquet,
}
"""What reads the arrays of a file, by its ending."""
