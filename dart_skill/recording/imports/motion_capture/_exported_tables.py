"""Tables that Qualisys' QTM and Vicon's Nexus and Tracker export. All of them have z up, unless a
mapping says something else.

TSV of QTM, of markers (3D) and of bodies (6D): lines of a key and its values, then a line for each
frame. Lengths are millimetres and angles degrees, as QTM always writes them. Rot[0] to Rot[8] are
the matrix column by column. Without frames and times in the file a line is a frame.

CSV of Nexus and Tracker: blocks, each with its title, its rate, and three lines that name
subjects, columns and units. A block begins three lines above the one of its columns, which are
called Frame, Sub Frame, and X, Y, Z or RX, RY, RZ, (RW,) TX, TY, TZ.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import islice, takewhile

from dart_skill.recording.imports.mapping import CaptureFile
from dart_skill.recording.imports.motion_capture._capture import (
    Body,
    Capture,
    agreed_rate,
    capture_of_rows,
    length_told,
    marker,
)
from dart_skill.recording.imports.pose_stream import AS_OURS
from dart_skill.recording.imports.text_files import TextFile, TextRow, Timing, number_told

NAMES = ("MARKER_NAMES", "BODY_NAMES")
"""Keys of the lines with the names of markers and of bodies."""
MATRIX = tuple(f"Rot[{k}]" for k in range(9))
"""Columns of an orientation; the order of angles is a setting of QTM."""
ANGLES = ("Roll", "Pitch", "Yaw")
"""Columns of angles about x, y, z, where QTM calls them so."""


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
        parts = zip(names, starts, [*starts[1:], len(columns)], strict=True)
        return tuple(
            _qualisys_body(name, columns[a:b], a, are_bodies) for name, a, b in parts
        ), first
    first = len(row.cells) - 3 * len(names)
    first -= first in (1, 3) and not row.cells[-1].strip()  # some lines end with a delimiter
    if are_bodies or first not in (0, 1, 2):
        return (), first
    return (
        tuple(marker(name, first + 3 * k) for k, name in enumerate(names)),
        first,
    )


def _qualisys_body(name: str, columns: list[str], first: int, is_body: bool) -> Body:
    if not is_body:
        return marker(name, first)
    position = (first, first + 1, first + 2)
    if all(one in columns for one in MATRIX):
        return Body(
            name,
            "6DOF body",
            position,
            tuple(first + columns.index(one) for one in MATRIX),
            "matrix",
        )
    return Body(
        name,
        "6DOF body",
        position,
        (first + 3, first + 4, first + 5) if len(columns) > 5 else (),
        angle="deg",
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
        (one for one in blocks if any(_is_called(body, wanted) for body in one.bodies)), blocks[0]
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


def _is_called(body: Body, wanted: set[str]) -> bool:
    subject, _, name = body.name.rpartition(":")
    return bool({body.name, name, subject} & wanted)


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
