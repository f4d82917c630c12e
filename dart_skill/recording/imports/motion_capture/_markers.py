"""Files of markers that many programs write: TRC, a table, and C3D, a binary format that the
package `c3d` reads.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from itertools import dropwhile
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.extras import need, optional
from dart_skill.recording.imports.mapping import CaptureFile
from dart_skill.recording.imports.motion_capture._capture import (
    Body,
    Capture,
    agreed_rate,
    length_told,
    of_frames,
)
from dart_skill.recording.imports.pose_stream import UP_AXES
from dart_skill.recording.imports.text_files import Row, TextFile, Timing


def read_trc(file: TextFile, where: CaptureFile, unit: str) -> Capture:
    """Markers of a TRC file, with its own times.

    * file: the file.
    * where: what the mapping says of it.
    * unit: of times, of TIME_UNITS.
    """
    del where
    head: list[Row] = []
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
    keys, values = head[1].cells, head[2].cells
    about = dict(
        zip(
            (key.strip().lower() for key in keys),
            (value.strip() for value in values),
            strict=False,
        )
    )
    names = [
        (place, cell.strip())
        for place, cell in enumerate(head[3].cells)
        if place > 1 and cell.strip()
    ]
    if (
        len(names) > 1 and names[1][0] - names[0][0] == 1
    ):  # separated by spaces, or without the empty cells of y and z
        names = [(2 + 3 * k, name) for k, (_, name) in enumerate(names)]
    bodies = tuple(Body(name, "Marker", (place, place + 1, place + 2)) for place, name in names)

    def numbered() -> Iterator[Row]:
        return dropwhile(lambda row: row.number <= head[-1].number, file.rows())

    length = length_told(about.get("units", ""))
    return Capture(
        file.path,
        bodies,
        lambda places: file.read(numbered(), Timing(1, unit), places, is_ragged=True),
        length,
    )


def read_c3d(path: Path, where: CaptureFile) -> Capture:
    """Markers of a C3D file. The axis that is upright on the screen points up, unless the mapping
    says another one.

    * path: of the file.
    * where: what the mapping says of it.
    """
    need("c3d")
    try:
        with warnings.catch_warnings(), open(path, "rb") as stream:
            warnings.simplefilter("ignore")
            reader = optional("c3d").Reader(stream)
            names, first, rate = (
                _labels(reader),
                reader.first_frame,
                float(reader.point_rate or 0.0),
            )
            length, upright = _text(reader, "POINT:UNITS"), _text(reader, "POINT:Y_SCREEN")
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
    stamps = of_frames(agreed_rate(path, rate, where.rate), np.arange(first, first + len(points)))
    bodies = tuple(
        Body(name, "Marker", (3 * k, 3 * k + 1, 3 * k + 2))
        for k, name in enumerate(names[: points.shape[1]])
    )
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


def _text(reader: Any, name: str) -> str:
    """A parameter that is a text; empty if it is not there."""
    parameter = reader.get(name)
    return "" if parameter is None else str(parameter.string_value).strip("\0 ")
