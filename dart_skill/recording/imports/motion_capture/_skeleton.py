"""BVH files: a skeleton of joints with fixed offsets, and their angles in each frame; where the
joints are follows from both.

Angles are degrees and turn about the axes of the joint in the order of its channels. Channels of a
position take the place of the offset, as the programs that write them for all joints mean it. The
file does not say its unit of lengths, nor which axis points up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dart_skill.recording.imports.motion_capture._capture import Body, Capture, of_frames
from dart_skill.recording.imports.text_files import Row, TextFile, Timing

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
    """The joints of a file. path: of the file."""
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
        rows = (row for row in file.rows() if row.number > line)
        frames, numbers = file.read(rows, Timing(None, rate=1.0), range(width))
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


def _numbers(file: TextFile, row: Row, cells: Sequence[str]) -> np.ndarray:
    try:
        return np.array([float(cell.replace(",", ".")) for cell in cells])
    except ValueError:
        raise file.error(f"'{' '.join(cells)}' are no numbers", row) from None


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
