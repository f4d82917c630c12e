"""CSV exports of OptiTrack's Motive, format versions 1.2 and later, and older ones, with bodies in
a line, of Motive 1 and Tracking Tools.

The first line tells pairs (key, value) of the take. Then, above the numbers, lines tell of each
column the type, name and number of what it belongs to, whether it is `Rotation` or `Position`, and
its axis. Cells of a body that was not tracked are empty. Angles are degrees about the axes of the
body (OptiTrack's documentation, "Data Export: CSV", and the conversions of the NatNet SDK).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import islice, takewhile

import numpy as np

from dart_skill.recording.imports.mapping import EULER_ORDERS, CaptureFile
from dart_skill.recording.imports.motion_capture._capture import (
    Body,
    Capture,
    agreed_rate,
    capture_of_rows,
    length_told,
)
from dart_skill.recording.imports.text_files import TextFile, TextRow, Timing, number_told

KEYS = (
    "format version",
    "take name",
    "take notes",
    "capture frame rate",
    "export frame rate",
    "capture start time",
    "capture start frame",
    "total frames in take",
    "total exported frames",
    "rotation type",
    "length units",
    "coordinate space",
)
"""Words of the first line, in small letters; a name or a note between them may hold commas."""
MOST_HEADER_ROWS = 60
"""Largest number of lines of a header."""
KINDS = ("rigid body", "bone", "marker")
"""Words of which each type of column has one, in small letters."""
LABELS = ("type", "name", "id", "parent")
"""What the lines above the numbers are called, in small letters."""


OLD_BODY = 11
"""Number of cells of a body in a line of the old format: number, position, quaternion, three
angles.
"""
REFUSALS = {
    "global": "",
    "local": (
        "the positions of bones are relative to their parents: export it with world coordinates"
        " (Coordinate Space: Global)"
    ),
}
"""Why a bone cannot be used, by what is told of the coordinate space."""
UNTOLD_SPACE = (
    "the file does not say its Coordinate Space: add 'space: global' to the mapping if bones are in"
    " the axes of the world"
)


def read_motive(file: TextFile, where: CaptureFile, unit: str) -> Capture:
    """An export.

    Parameters
    ----------
    file
        The export.
    where
        What the mapping says of it.
    unit
        Of times, of TIME_UNITS.

    Raises
    ------
    ValueError
        Says what is wrong with it.
    """
    head, numbers = _head(file)
    named = [row for row in head if row.cells[0].strip().lower() == "frame"]
    if numbers is None and any(
        len(row.cells) > 4 and row.cells[1].strip().isdigit() for row in named
    ):
        return _old(file, head)
    if numbers is None and named:
        raise file.error("there are no frames below the names of its columns", named[-1])
    if numbers is None or len(head) < 2:
        raise file.error(
            "no CSV export of Motive: it begins with 'Format Version', and lines above the numbers"
            " name the columns"
        )
    about = _about(file, head)
    return capture_of_rows(
        file,
        partial(file.rows, numbers.number - 1),
        _timing(file, head, about, where, unit),
        _bodies(file, head, about, where),
        length_told(about.get("length units", "")),
    )


def looks_like_motive(lines: Sequence[str]) -> bool:
    """Whether a file is an export.

    Parameters
    ----------
    lines
        The first ones.
    """
    first = lines[0].lower()
    if (
        first.startswith(("comment", "righthanded", "lefthanded", "info"))
        or "format version" in first
        or "take name" in first
    ):
        return True
    words = ("rotation", "position", *KINDS)
    return any(
        sum(map(line.lower().count, words)) > 2
        for line in lines[:8]
        if not line.lstrip().startswith("<")
    )


def _head(file: TextFile) -> tuple[list[TextRow], TextRow | None]:
    """Rows above the numbers, and the first row of numbers."""
    head: list[TextRow] = []
    for row in islice(file.rows(), MOST_HEADER_ROWS):
        first = row.cells[0].strip().replace(",", "").replace(".", "").lstrip("-")
        if len(row.cells) > 1 and first.isdigit():
            return head, row
        head.append(row)
    return head, None


def _about(file: TextFile, head: Sequence[TextRow]) -> dict[str, str]:
    """Values of the known keys of the first line, by the key in small letters; a note may have
    made several lines of it.
    """
    found: dict[str, str] = {}
    for row in takewhile(lambda row: row.cells[0].strip(), head[:-2]):
        cells = [cell.strip() for cell in row.cells]
        for cell, value in zip(cells, [*cells[1:], ""], strict=True):
            key = cell.lower()
            if key in KEYS and found.setdefault(key, value) != value:
                raise file.error(
                    f"'{cell}' is told twice, as '{found[key]}' and as '{value}': correct the"
                    " header",
                    row,
                )
    return found


def _bodies(
    file: TextFile, head: Sequence[TextRow], about: dict[str, str], where: CaptureFile
) -> tuple[Body, ...]:
    *above, what, axes = [row.cells for row in head]
    above = [cells for cells in above if not cells[0].strip() and len(cells) > 2]
    labelled = {cells[1].strip().lower(): cells for cells in above}
    kinds = [
        cells
        for cells in above
        if any(kind in cell.lower() for kind in KINDS for cell in cells[2:])
    ]
    types = labelled.get("type") or next(iter(kinds), [])
    others = [
        cells
        for cells in above
        if cells is not types and cells[1].strip().lower() not in LABELS[2:]
    ]
    idents = labelled.get("id", [])
    wanted = {where.body, *where.markers}
    names = labelled.get("name") or next(
        (cells for cells in above if wanted & set(map(str.strip, cells))), []
    )
    names = names or next(iter(others), []) or idents
    groups: dict[tuple[str, str, str, int], dict[tuple[str, str], int]] = {}
    latest: dict[tuple[str, str, str], int] = {}
    for place, axis in enumerate(axes):
        column = (_cell(what, place), axis.strip().upper())
        if column[1] not in tuple("XYZW") or not column[0]:
            continue
        key = (_cell(types, place), _cell(names, place), _cell(idents, place))
        if column in groups.get((*key, latest.setdefault(key, 1)), {}):
            latest[key] += 1
        groups.setdefault((*key, latest[key]), {})[column] = place
    turn = about.get("rotation type", "").upper()
    space = about.get("coordinate space", "").lower()
    if where.space and space == "local":
        raise file.error("space is 'global' in the mapping, but the file itself says 'Local'")
    turn = turn if turn in EULER_ORDERS else ""
    found = []
    for number, ((kind, name, ident, _), columns) in enumerate(groups.items(), 1):
        body = _body(kind, name or str(number), ident, columns, turn)
        if body is not None:
            is_bone = kind.lower().endswith("bone")
            refusal = REFUSALS.get(space or where.space, UNTOLD_SPACE) if is_bone else ""
            found.append(replace(body, refusal=refusal))
    return tuple(found)


def _cell(cells: Sequence[str], place: int) -> str:
    return cells[place].strip() if place < len(cells) else ""


def _body(
    kind: str, name: str, ident: str, columns: dict[tuple[str, str], int], turn: str
) -> Body | None:
    """The body of some columns, by (what, axis); None if they hold no position."""
    parts: dict[str, dict[str, int]] = {}
    for (what, axis), place in columns.items():
        parts.setdefault(what, {})[axis] = place
    whole = {what: axes for what, axes in parts.items() if set("XYZ") <= set(axes)}
    turns = {
        what
        for what, axes in whole.items()
        if "W" in axes or what.lower().startswith(("rot", "orient"))
    }
    places = [what for what in whole if what not in turns]
    position = next(
        (what for what in places if what.lower().startswith("pos")),
        places[0] if len(places) == 1 else "",
    )
    if not position:
        return None
    rotation = whole[turns.pop()] if turns else {}
    order = "XYZW" if "W" in rotation else "XYZ"
    return Body(
        name,
        kind,
        tuple(whole[position][axis] for axis in "XYZ"),
        tuple(rotation[axis] for axis in order) if rotation else (),
        "quaternion" if "W" in rotation else turn,
        "" if "W" in rotation else "deg",
        ident,
    )


def _timing(
    file: TextFile, head: Sequence[TextRow], about: dict[str, str], where: CaptureFile, unit: str
) -> Timing:
    """The column of times, which is beside that of the frames, else the frames with their rate."""
    *_, what, axes = [row.cells for row in head]
    if axes[0].strip().lower().startswith("time"):
        return Timing(0, unit)
    if (
        len(axes) > 1
        and axes[1].strip()
        and not _cell(what, 1)
        and axes[1].strip().upper() not in tuple("XYZW")
    ):
        return Timing(1, unit)
    told = (number_told(about.get(key, "")) for key in KEYS[4:2:-1])
    rate = next((number for number in told if number and number > 0.0), 0.0)
    return Timing(0, rate=agreed_rate(file.path, rate, where.rate))


def _old(file: TextFile, head: Sequence[TextRow]) -> Capture:
    """An export of Motive 1.0 or 1.1: in the line of a frame are the bodies that were seen in it."""
    defining = list(takewhile(lambda row: row.cells[0].strip().lower() != "frame", head))
    if any(row.cells[0].strip().lower() == "lefthanded" for row in defining):
        raise file.error("its axes are left-handed: export it with right-handed ones")
    names: dict[str, str] = {}
    for row in defining:
        if row.cells[0].strip().lower() in ("rigidbody", "trackable") and len(row.cells) > 2:
            names.setdefault(row.cells[2].strip(), row.cells[1].strip())
    bodies = []
    for k, (ident, name) in enumerate(names.items()):
        x, y, z, *turn = range(7 * k, 7 * k + 7)
        bodies.append(Body(name, "Rigid Body", (x, y, z), tuple(turn), "quaternion", ident=ident))
    if not bodies:
        raise file.error("no rigid bodies are defined above its frames")
    return Capture(file.path, tuple(bodies), partial(_read_old, file, list(names)))


def _read_old(
    file: TextFile, idents: Sequence[str], places: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    wanted = sorted({place // 7 for place in places})
    lines = []
    for row in file.rows():
        cells = [cell.strip() for cell in row.cells]
        if cells[0].lower() != "frame" or len(cells) < 4 or not cells[3].isdigit():
            continue
        seen = {
            cells[at]: cells[at + 1 : at + 8]
            for at in range(4, 4 + OLD_BODY * int(cells[3]), OLD_BODY)
            if at < len(cells)
        }
        values = [value for k in wanted for value in seen.get(idents[k], [""] * 7)]
        lines.append(TextRow(row.number, [cells[2], *values]))
    order = [1 + 7 * wanted.index(place // 7) + place % 7 for place in places]
    return file.read(lines, Timing(0), order)
