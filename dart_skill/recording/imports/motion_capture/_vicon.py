"""CSV exports of Vicon's Nexus and Tracker: blocks, each with its title, its rate, and three lines
that name subjects, columns and units.

A block begins three lines above the one of its columns, which are called Frame, Sub Frame, and X,
Y, Z or RX, RY, RZ, (RW,) TX, TY, TZ. Both programs have z up, unless a mapping says something
else.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from itertools import islice, takewhile

from dart_skill.recording.imports.mapping import CaptureFile
from dart_skill.recording.imports.motion_capture._capture import (
    Body,
    Capture,
    agreed_rate,
    length_told,
)
from dart_skill.recording.imports.pose_stream import AS_OURS
from dart_skill.recording.imports.text_files import Row, TextFile, Timing

TITLES = ("trajectories", "segments", "objects", "model outputs", "joints", "devices")
"""Titles of blocks, in small letters."""
POSITIONS = (("TX", "TY", "TZ"), ("X", "Y", "Z"))
"""Columns of a position."""
TURNS = ("RX", "RY", "RZ", "RW")
"""Columns of an orientation."""


def read_vicon(file: TextFile, where: CaptureFile, unit: str) -> Capture:
    """The first block that has what is wanted.

    * file: the export.
    * where: what the mapping says of it.
    * unit: of times, of TIME_UNITS; the file has frames only.
    """
    del unit
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
    """Whether a file is an export. lines: the first ones."""
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


def _headers(file: TextFile) -> list[tuple[Row, Row, Row]]:
    """The rows of each block with rate, names and columns."""
    found = []
    latest: deque[Row] = deque(maxlen=3)
    for row in file.rows():
        latest.append(row)
        if _is_header(row.cells) and len(latest) == 3:
            found.append((latest[0], latest[1], latest[2]))
    return found


def _block(file: TextFile, above: tuple[Row, Row, Row], where: CaptureFile) -> Capture:
    rate, names, columns = above
    text = rate.cells[0].strip().replace(",", ".")
    timing = Timing(
        0,
        rate=agreed_rate(
            file.path, float(text) if text.replace(".", "", 1).isdigit() else 0.0, where.rate
        ),
    )
    units = next(_after(file, columns), columns)
    is_told = not units.cells[0].strip()
    bodies, lengths = _bodies(names.cells, columns.cells, units.cells if is_told else [])
    if len(lengths) > 1:
        raise file.error(
            f"lengths are in {' and '.join(sorted(lengths))}: export them in one unit", units
        )

    def numbered() -> Iterator[Row]:
        return takewhile(
            lambda row: len(row.cells) > 1 and row.cells[0].strip().isdigit(),
            islice(_after(file, columns), is_told, None),
        )

    return Capture(
        file.path,
        bodies,
        lambda places: file.read(numbered(), timing, places, is_ragged=True),
        "".join(lengths),
        AS_OURS,
    )


def _after(file: TextFile, above: Row) -> Iterator[Row]:
    return (row for row in file.rows() if row.number > above.number)


def _bodies(
    names: Sequence[str], columns: Sequence[str], units: Sequence[str]
) -> tuple[tuple[Body, ...], set[str]]:
    """Bodies and markers of a block, and the units of their positions."""
    places: dict[str, dict[str, int]] = {}
    name = ""
    for place, column in enumerate(columns):
        name = (names[place].strip() if place < len(names) else "") or name
        places.setdefault(name, {}).setdefault(column.strip().upper(), place)
    found = [_body(name, here, units) for name, here in places.items() if name]
    bodies = tuple(one for one, _ in filter(None, found))
    return bodies, {unit for _, unit in filter(None, found)}


def _body(name: str, places: dict[str, int], units: Sequence[str]) -> tuple[Body, str] | None:
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
