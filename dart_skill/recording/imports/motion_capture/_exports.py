"""Tables that Qualisys' QTM and Vicon's Nexus and Tracker export, which have z up, unless a mapping
says something else; and markers as many programs write them: TRC, a table, and C3D, a binary format
that the package `c3d` reads.

TSV of QTM, of markers (3D) and of bodies (6D): lines of a key and its values, then a line for each
frame. Lengths are millimetres and angles degrees, as QTM always writes them. Rot[0] to Rot[8] are
the matrix column by column. Without frames and times in the file a line is a frame.

CSV of Nexus and Tracker: blocks, each with its title, its rate, and three lines that name
subjects, columns and units. A block begins three lines above the one of its columns, which are
called Frame, Sub Frame, and X, Y, Z or RX, RY, RZ, (RW,) TX, TY, TZ.
"""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import islice, takewhile
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.extras import need, optional
from dart_skill.recording.imports.mapping import CaptureFile
from dart_skill.recording.imports.motion_capture._capture import (
    Body,
    Capture,
    agreed_rate,
    capture_of_rows,
    length_told,
    marker,
)
from dart_skill.recording.imports.pose_stream import AS_OURS, UP_AXES
from dart_skill.recording.imports.text_files import TextFile, TextRow, Timing, number_told

NAMES = ("MARKER_NAMES", "BODY_NAMES")
"""Keys of the lines with the names of markers and of bodies."""
MATRIX = tuple(f"Rot[{k}]" for k in range(9))
"""Columns of an orientation; the order of angles is a setting of QTM."""


def read_qualisys(file: TextFile, where: CaptureFile, unit: str) -> Capture:
    """Markers and bodies of an export.

    Parameters
    ----------
    file
        The export.
    where
        What the mapping says of it.
    unit
        Of times, of TIME_UNITS.
    """
    about: dict[str, list[str]] = {}
    columns: list[str] = []
    for row in file.rows():
        first, *values = (cell.strip() for cell in row.cells)
        if number_told(first) is not None:
            break
        if any(cell == "X" or cell.endswith(" X") for cell in (first, *values)):
            columns = [first, *values]
        else:
            about[first] = values
    else:
        raise file.error("there are no numbers in it")
    names = [name for key in NAMES for name in about.get(key, ()) if name]
    if not names:
        raise file.error(
            f"nothing names markers or bodies in it: export it with header ({' or '.join(NAMES)})"
        )
    bodies, first_place = _qualisys_bodies(names, columns, "MARKER_NAMES" not in about, row)
    if not bodies:
        raise file.error(
            f"{len(row.cells)} columns do not fit {len(names)} names: export it anew, with the"
            " names of the columns",
            row,
        )
    if first_place == 2:
        timing = Timing(1, unit)
    else:
        told = number_told("".join(about.get("FREQUENCY", [""])[:1])) or 0.0
        rate = agreed_rate(file.path, told, where.rate)
        timing = Timing(0 if first_place else None, rate=rate)

    return capture_of_rows(file, partial(file.rows, row.number - 1), timing, bodies, "mm", AS_OURS)


def looks_like_qualisys(lines: Sequence[str]) -> bool:
    """Whether a file is an export.

    Parameters
    ----------
    lines
        The first ones.
    """
    return any(line.startswith(("NO_OF_FRAMES", "NO_OF_CAMERAS", *NAMES)) for line in lines[:8])


def _qualisys_bodies(
    names: list[str], columns: list[str], are_bodies: bool, row: TextRow
) -> tuple[tuple[Body, ...], int]:
    """Bodies with their columns, none if these do not fit; and how many columns with frame and
    time are before them.
    """
    if columns:
        first = (
            2
            if columns[1].lower().startswith("time")
            else 1
            if columns[0].lower().startswith("frame")
            else 0
        )
        starts = [
            k for k in range(first, len(columns)) if columns[k] == "X" or columns[k].endswith(" X")
        ]
        if len(starts) != len(names):
            return (), first
        found = []
        for name, a, b in zip(names, starts, [*starts[1:], len(columns)], strict=True):
            own = columns[a:b]
            if not are_bodies:
                found.append(marker(name, a))
            elif all(one in own for one in MATRIX):
                rotation = tuple(a + own.index(one) for one in MATRIX)
                found.append(Body(name, "6DOF body", (a, a + 1, a + 2), rotation, "matrix"))
            else:
                rotation = (a + 3, a + 4, a + 5) if len(own) > 5 else ()
                found.append(Body(name, "6DOF body", (a, a + 1, a + 2), rotation, angle="deg"))
        return tuple(found), first
    first = len(row.cells) - 3 * len(names)
    first -= first in (1, 3) and not row.cells[-1].strip()  # some lines end with a delimiter
    if are_bodies or first not in (0, 1, 2):
        return (), first
    return (
        tuple(marker(name, first + 3 * k) for k, name in enumerate(names)),
        first,
    )


TITLES = ("trajectories", "segments", "objects", "model outputs", "joints", "devices")
"""Titles of blocks, in small letters."""
POSITIONS = (("TX", "TY", "TZ"), ("X", "Y", "Z"))
"""Columns of a position."""
TURNS = ("RX", "RY", "RZ", "RW")
"""Columns of an orientation."""


def read_vicon(file: TextFile, where: CaptureFile) -> Capture:
    """The first block that has what is wanted.

    Parameters
    ----------
    file
        The export, which has frames and no times.
    where
        What the mapping says of it.
    """
    blocks = [
        capture for above in _headers(file) if (capture := _block(file, above, where)).bodies
    ]
    if not blocks:
        raise file.error("no block with positions in it: export trajectories, segments or objects")
    wanted = {*where.markers, where.body}
    return next(
        (
            one
            for one in blocks
            if wanted & {part for body in one.bodies for part in _names(body.name)}
        ),
        blocks[0],
    )


def looks_like_vicon(lines: Sequence[str]) -> bool:
    """Whether a file is an export.

    Parameters
    ----------
    lines
        The first ones.
    """
    plain = [line.replace('"', "").replace(";", ",").replace("\t", ",") for line in lines[:8]]
    return any(
        line.strip().strip(",").lower() in TITLES or _is_header(line.split(",")) for line in plain
    )


def _names(name: str) -> set[str]:
    """What a body is called: its name as a whole, its subject, and what stands behind that."""
    return {name, name.rpartition(":")[0], name.rpartition(":")[2]}


def _is_header(cells: Sequence[str]) -> bool:
    return len(cells) > 2 and [cell.strip().lower() for cell in cells[:2]] == [
        "frame",
        "sub frame",
    ]


def _headers(file: TextFile) -> list[tuple[TextRow, TextRow, TextRow]]:
    """The rows of each block with rate, names and columns."""
    found = []
    latest: deque[TextRow] = deque(maxlen=3)
    for row in file.rows():
        latest.append(row)
        if _is_header(row.cells) and len(latest) == 3:
            found.append((latest[0], latest[1], latest[2]))
    return found


def _block(file: TextFile, above: tuple[TextRow, TextRow, TextRow], where: CaptureFile) -> Capture:
    rate, names, columns = above
    told = number_told(rate.cells[0].strip()) or 0.0
    timing = Timing(0, rate=agreed_rate(file.path, max(0.0, told), where.rate))
    units = next(file.rows(columns.number), columns)
    is_told = not units.cells[0].strip()
    bodies, lengths = _vicon_bodies(names.cells, columns.cells, units.cells if is_told else [])
    if len(lengths) > 1:
        raise file.error(
            f"lengths are in {' and '.join(sorted(lengths))}: export them in one unit", units
        )

    def numbered() -> Iterator[TextRow]:
        return takewhile(
            lambda row: len(row.cells) > 1 and row.cells[0].strip().isdigit(),
            islice(file.rows(columns.number), is_told, None),
        )

    return capture_of_rows(file, numbered, timing, bodies, "".join(lengths), AS_OURS)


def _vicon_bodies(
    names: Sequence[str], columns: Sequence[str], units: Sequence[str]
) -> tuple[tuple[Body, ...], set[str]]:
    """Bodies and markers of a block, and the units of their positions."""
    places: dict[str, dict[str, int]] = {}
    name = ""
    for place, column in enumerate(columns):
        name = (names[place].strip() if place < len(names) else "") or name
        places.setdefault(name, {}).setdefault(column.strip().upper(), place)
    found = [_vicon_body(name, here, units) for name, here in places.items() if name]
    bodies = tuple(one for one, _ in filter(None, found))
    return bodies, {unit for _, unit in filter(None, found)}


def _vicon_body(
    name: str, places: dict[str, int], units: Sequence[str]
) -> tuple[Body, str] | None:
    """A body with the unit of its position; None for what has none: angles, forces, moments."""

    def unit(place: int) -> str:
        return units[place].strip().lower() if place < len(units) else ""

    position = next((one for one in POSITIONS if all(axis in places for axis in one)), None)
    if position is None or (
        unit(places[position[0]]) and not length_told(unit(places[position[0]]))
    ):
        return None
    x, y, z = (places[axis] for axis in position)
    rotation = tuple(places[axis] for axis in TURNS if axis in places)
    rotation = rotation if len(rotation) > 2 else ()
    angle = unit(rotation[0]) if len(rotation) == 3 else ""
    turn = "quaternion" if len(rotation) == 4 else ""
    kind = "Segment" if rotation else "Marker"
    return Body(
        name, kind, (x, y, z), rotation, turn, angle if angle in ("deg", "rad") else ""
    ), length_told(unit(x))


def read_trc(file: TextFile, unit: str) -> Capture:
    """Markers of a TRC file, with its own times.

    Parameters
    ----------
    unit
        Of these, of TIME_UNITS.
    """
    head: list[TextRow] = []
    for row in file.rows():
        if row.cells[0].strip().isdigit() and len(head) > 3:
            break
        head.append(row)
        if len(head) > 8:
            raise file.error("no row of numbers below the names of markers", row)
    if len(head) < 4:
        raise file.error(
            "no TRC file: below 'PathFileType' are a row of keys, one of values, and one with the"
            " names of markers"
        )
    keys, values = ([cell.strip() for cell in row.cells] for row in head[1:3])
    about = dict(zip(map(str.lower, keys), values, strict=False))
    names = [
        (place, cell.strip())
        for place, cell in enumerate(head[3].cells)
        if place > 1 and cell.strip()
    ]
    # separated by spaces, or without the empty cells of y and z
    if len(names) > 1 and names[1][0] - names[0][0] == 1:
        names = [(2 + 3 * k, name) for k, (_, name) in enumerate(names)]
    return capture_of_rows(
        file,
        partial(file.rows, head[-1].number),
        Timing(1, unit),
        [marker(name, place) for place, name in names],
        length_told(about.get("units", "")),
    )


def read_c3d(path: Path, where: CaptureFile) -> Capture:
    """Markers of a C3D file. The axis that is upright on the screen points up, unless the mapping
    says another one.

    Parameters
    ----------
    path
        Of the file.
    where
        What the mapping says of it.
    """
    need("c3d")
    try:
        with warnings.catch_warnings(), open(path, "rb") as stream:
            warnings.simplefilter("ignore")
            reader = optional("c3d").Reader(stream)
            names, first = _labels(reader), reader.first_frame
            rate = float(reader.point_rate or 0.0)
            texts = (reader.get(f"POINT:{name}") for name in ("UNITS", "Y_SCREEN"))
            length, upright = (one and str(one.string_value).strip("\0 ") or "" for one in texts)
            points = np.array(
                [frame[:, :4].astype(np.float32) for _, frame, _ in reader.read_frames(copy=False)]
            )
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from error
    except Exception as error:  # the package meets arbitrary bytes
        raise ValueError(f"{path}: no C3D file, or a damaged one: {error}") from error
    if points.ndim != 3 or not points.size:
        raise ValueError(f"{path}: there are no markers in it")
    points[points[:, :, 3] < 0.0] = np.nan
    flat = points[:, :, :3].reshape(len(points), -1).astype(float)
    frames = np.arange(first, first + len(points))
    stamps = np.rint(frames * (1e9 / agreed_rate(path, rate, where.rate))).astype(np.int64)
    bodies = tuple(marker(name, 3 * k) for k, name in enumerate(names[: points.shape[1]]))
    axes = UP_AXES.get(upright.lower().lstrip("+"))
    return Capture(
        path, bodies, lambda places: (stamps, flat[:, list(places)]), length_told(length), axes
    )


def _labels(reader: Any) -> list[str]:
    """Names of all markers: more than 255 of them are in several parameters."""
    found = list(reader.point_labels)
    for k in range(2, 10):
        parameter = reader.get(f"POINT:LABELS{k}")
        found += [] if parameter is None else list(parameter.string_array)
    return [name.strip() for name in found]
