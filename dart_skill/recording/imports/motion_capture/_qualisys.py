"""TSV exports of Qualisys' QTM, of markers (3D) and of bodies (6D): lines of a key and its values,
then a line for each frame.

Lengths are millimetres and angles degrees, as QTM always writes them. Rot[0] to Rot[8] are the
matrix column by column. Without frames and times in the file a line is a frame. QTM has z up,
unless a mapping says something else.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import dropwhile

from dart_skill.recording.imports.mapping import CaptureFile
from dart_skill.recording.imports.motion_capture._capture import Body, Capture, agreed_rate
from dart_skill.recording.imports.pose_stream import AS_OURS
from dart_skill.recording.imports.text_files import Row, TextFile, Timing

NAMES = ("MARKER_NAMES", "BODY_NAMES")
"""Keys of the lines with the names of markers and of bodies."""
MATRIX = tuple(f"Rot[{k}]" for k in range(9))
"""Columns of an orientation; its angles are in an order that QTM lets everybody choose."""
ANGLES = ("Roll", "Pitch", "Yaw")
"""Columns of angles about x, y, z, where QTM calls them so."""


def read_qualisys(file: TextFile, where: CaptureFile, unit: str) -> Capture:
    """Markers and bodies of an export.

    * file: the export.
    * where: what the mapping says of it.
    * unit: of times, of TIME_UNITS.
    """
    about: dict[str, list[str]] = {}
    columns: list[str] = []
    for row in file.rows():
        first, *values = (cell.strip() for cell in row.cells)
        if _is_number(first):
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
    bodies, first_place = _bodies(names, columns, "MARKER_NAMES" not in about, row)
    if not bodies:
        raise file.error(
            f"{len(row.cells)} columns do not fit {len(names)} names: export it anew, with the"
            " names of the columns",
            row,
        )
    timing = (
        Timing(1, unit)
        if first_place == 2
        else _timing(file, about, where, 0 if first_place else None)
    )

    def numbered() -> Iterator[Row]:
        return dropwhile(lambda row: not _is_number(row.cells[0].strip()), file.rows())

    return Capture(
        file.path,
        bodies,
        lambda places: file.read(numbered(), timing, places, is_ragged=True),
        "mm",
        AS_OURS,
    )


def looks_like_qualisys(lines: Sequence[str]) -> bool:
    """Whether a file is an export. lines: the first ones."""
    return any(line.startswith(("NO_OF_FRAMES", "NO_OF_CAMERAS", *NAMES)) for line in lines[:8])


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _timing(
    file: TextFile, about: dict[str, list[str]], where: CaptureFile, place: int | None
) -> Timing:
    told = "".join(about.get("FREQUENCY", [""])[:1]).replace(",", ".")
    return Timing(
        place, rate=agreed_rate(file.path, float(told) if _is_number(told) else 0.0, where.rate)
    )


def _bodies(
    names: list[str], columns: list[str], are_bodies: bool, row: Row
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
        return tuple(_body(name, columns[a:b], a, are_bodies) for name, a, b in parts), first
    first = len(row.cells) - 3 * len(names)
    first -= first in (1, 3) and not row.cells[-1].strip()  # some lines end with a delimiter
    if are_bodies or first not in (0, 1, 2):
        return (), first
    return (
        tuple(Body(name, "Marker", _three(first + 3 * k)) for k, name in enumerate(names)),
        first,
    )


def _body(name: str, columns: list[str], first: int, is_body: bool) -> Body:
    if not is_body:
        return Body(name, "Marker", _three(first))
    if all(one in columns for one in MATRIX):
        return Body(
            name,
            "6DOF body",
            _three(first),
            tuple(first + columns.index(one) for one in MATRIX),
            "matrix",
        )
    return Body(
        name,
        "6DOF body",
        _three(first),
        _three(first + 3) if len(columns) > 5 else (),
        angle="deg",
    )


def _three(first: int) -> tuple[int, int, int]:
    return first, first + 1, first + 2
