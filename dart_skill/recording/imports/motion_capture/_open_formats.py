"""Formats of motion capture that many programs write: markers in TRC, a table, and in C3D, a binary
format that the package `c3d` reads; and skeletons in BVH.

A BVH file has joints with fixed offsets, and their angles in each frame; where the joints are
follows from both. Angles are degrees and turn about the axes of the joint in the order of its
channels. Channels of a position take the place of the offset, as the programs that write them for
all joints mean it. The file does not say its unit of lengths, nor which axis points up.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
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
    of_frames,
)
from dart_skill.recording.imports.pose_stream import UP_AXES
from dart_skill.recording.imports.text_files import TextFile, TextRow, Timing, number_told


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


def _text(reader: Any, name: str) -> str:
    """A parameter that is a text; empty if it is not there."""
    parameter = reader.get(name)
    return "" if parameter is None else str(parameter.string_value).strip("\0 ")


WIDTH = 7
"""Columns of a joint: position and quaternion."""


@dataclass
class _Joint:
    """A joint of the skeleton, with the index of its parent, -1 for the root."""

    name: str
    parent: int
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))
    channels: tuple[str, ...] = ()
    first: int = 0


def read_bvh(path: Path) -> Capture:
    """The joints of a file.

    Parameters
    ----------
    path
        Of the file.
    """
    file = TextFile(path, " ")
    joints, line, period = _hierarchy(file)
    bodies = tuple(
        Body(
            one.name,
            "Joint",
            (WIDTH * k, WIDTH * k + 1, WIDTH * k + 2),
            tuple(range(WIDTH * k + 3, WIDTH * k + 7)),
            "quaternion",
        )
        for k, one in enumerate(joints)
        if one.name
    )
    width = sum(len(one.channels) for one in joints)

    def read(places: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        frames, numbers = file.read(file.rows(line), Timing(None, rate=1.0), range(width))
        wanted = {
            k: _placed(joints, k, numbers) for k in sorted({place // WIDTH for place in places})
        }
        columns = [wanted[place // WIDTH][:, place % WIDTH] for place in places]
        return of_frames(1.0 / period, frames / 1e9), np.column_stack(columns)

    return Capture(path, bodies, read, zero_is_lost=False)


def _hierarchy(file: TextFile) -> tuple[list[_Joint], int, float]:
    """The joints, the line above the numbers, and the time of a frame [s]."""
    joints: list[_Joint] = []
    open_ones: list[int] = []
    ends = 0
    for row in file.rows():
        first, *rest = row.cells
        word = first.strip().upper()
        if word in ("ROOT", "JOINT") and rest:
            joints.append(_Joint(" ".join(rest).rstrip(" {"), open_ones[-1] if open_ones else -1))
        elif word == "END":
            joints.append(_Joint("", open_ones[-1] if open_ones else -1))
        if "{" in row.cells:
            open_ones.append(len(joints) - 1)
        elif word == "}" and open_ones:
            open_ones.pop()
        elif word == "OFFSET" and joints:
            joints[-1].offset = _numbers(file, row, rest[:3])
        elif word == "CHANNELS" and joints:
            joints[-1].channels = tuple(one.lower() for one in rest[1:])
            joints[-1].first = ends
            ends += len(joints[-1].channels)
        elif word == "FRAME" and (text := " ".join(rest).upper()).startswith("TIME:"):
            period = _numbers(file, row, [text.removeprefix("TIME:")])
            if joints and period[0] > 0.0:
                return joints, row.number, float(period[0])
            raise file.error("'Frame Time:' is no time, or no joints are above it", row)
    raise file.error("no BVH file: after the hierarchy of joints 'Frame Time:' is missing")


def _numbers(file: TextFile, row: TextRow, cells: Sequence[str]) -> np.ndarray:
    numbers = [number_told(cell) for cell in cells]
    if None in numbers:
        raise file.error(f"'{' '.join(cells)}' are no numbers", row)
    return np.array(numbers)


def _placed(joints: Sequence[_Joint], which: int, numbers: np.ndarray) -> np.ndarray:
    """Position and quaternion (n, 7) of a joint in the axes of the file. numbers: of all channels
    (n, k).
    """
    from scipy.spatial.transform import Rotation

    chain = [which]
    while joints[chain[-1]].parent >= 0:
        chain.append(joints[chain[-1]].parent)
    position, turned = np.zeros((len(numbers), 3)), Rotation.identity(len(numbers))
    for joint in (joints[k] for k in reversed(chain)):
        values = dict(
            zip(
                joint.channels,
                numbers[:, joint.first : joint.first + len(joint.channels)].T,
                strict=True,
            )
        )
        moved = [
            values.get(f"{axis}position", np.full(len(numbers), joint.offset[k]))
            for k, axis in enumerate("xyz")
        ]
        position = position + turned.apply(np.column_stack(moved))
        if order := "".join(one[0] for one in joint.channels if one.endswith("rotation")):
            angles = np.column_stack([values[f"{axis}rotation"] for axis in order])
            turned = turned * Rotation.from_euler(
                order.upper(), angles if len(order) > 1 else angles[:, 0], degrees=True
            )
    return np.hstack([position, turned.as_quat()])
