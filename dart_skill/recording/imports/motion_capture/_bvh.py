"""Skeletons in BVH: joints with fixed offsets, and their angles in each frame; where the joints are
follows from both.

Angles are degrees and turn about the axes of the joint in the order of its channels. Channels of a
position take the place of the offset, as the programs that write them for all joints mean it. The
file does not say its unit of lengths, nor which axis points up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dart_skill.recording.imports.motion_capture._capture import Body, Capture
from dart_skill.recording.imports.text_files import TextFile, TextRow, Timing, number_told

WIDTH = 7
"""Number of columns of a joint: position and quaternion."""


@dataclass
class _Joint:
    """A joint of the skeleton, with the one that carries it; an end of the skeleton has no name."""

    name: str
    parent: _Joint | None
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
    bodies = []
    for k, one in enumerate(joints):
        x, y, z, *turn = range(WIDTH * k, WIDTH * (k + 1))
        bodies.append(Body(one.name, "Joint", (x, y, z), tuple(turn), "quaternion"))
    width = sum(len(one.channels) for one in joints)

    def read(places: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        timing = Timing(None, rate=1.0 / period)
        stamps, numbers = file.read(file.rows(line), timing, range(width))
        wanted = {k: _placed(joints[k], numbers) for k in {place // WIDTH for place in places}}
        columns = [wanted[place // WIDTH][:, place % WIDTH] for place in places]
        return stamps, np.column_stack(columns)

    return Capture(path, tuple(bodies), read, zero_is_lost=False)


def _hierarchy(file: TextFile) -> tuple[list[_Joint], int, float]:
    """The joints, the line above the numbers, and the time of a frame [s]."""
    joints: list[_Joint] = []
    latest: _Joint | None = None  # joint that was named last
    carriers: list[_Joint | None] = []  # whose braces are open
    ends = 0
    for row in file.rows():
        first, *rest = row.cells
        word = first.strip().upper()
        if word in ("ROOT", "JOINT", "END") and rest:
            latest = _Joint(" ".join(rest).rstrip(" {"), carriers[-1] if carriers else None)
            joints += [latest] if word != "END" else []
        if "{" in row.cells:
            carriers.append(latest)
        elif word == "}" and carriers:
            carriers.pop()
        elif word == "OFFSET" and latest is not None:
            latest.offset = _numbers(file, row, rest[:3])
        elif word == "CHANNELS" and latest is not None:
            latest.channels, latest.first = tuple(one.lower() for one in rest[1:]), ends
            ends += len(latest.channels)
        elif word == "FRAME" and (text := " ".join(rest).upper()).startswith("TIME:"):
            period = float(_numbers(file, row, [text.removeprefix("TIME:")])[0])
            if joints and period > 0.0:
                return joints, row.number, period
            raise file.error("'Frame Time:' is no time, or no joints are above it", row)
    raise file.error("no BVH file: after the hierarchy of joints 'Frame Time:' is missing")


def _numbers(file: TextFile, row: TextRow, cells: Sequence[str]) -> np.ndarray:
    numbers = [number_told(cell) for cell in cells]
    if None in numbers:
        raise file.error(f"'{' '.join(cells)}' are no numbers", row)
    return np.array(numbers)


def _placed(joint: _Joint, numbers: np.ndarray) -> np.ndarray:
    """Position and quaternion (n, 7) of a joint in the axes of the file. numbers: of all channels
    (n, k).
    """
    from scipy.spatial.transform import Rotation

    position, turned = np.zeros((len(numbers), 3)), Rotation.identity(len(numbers))
    if joint.parent is not None:
        carrier = _placed(joint.parent, numbers)
        position, turned = carrier[:, :3], Rotation.from_quat(carrier[:, 3:])
    own = numbers[:, joint.first : joint.first + len(joint.channels)].T
    values = dict(zip(joint.channels, own, strict=True))
    moved = np.tile(joint.offset, (len(numbers), 1))
    for k, axis in enumerate("xyz"):
        moved[:, k] = values.get(f"{axis}position", moved[:, k])
    position = position + turned.apply(moved)
    if order := "".join(one[0] for one in joint.channels if one.endswith("rotation")):
        angles = np.column_stack([values[f"{axis}rotation"] for axis in order])
        angles = angles if len(order) > 1 else angles[:, 0]
        turned = turned * Rotation.from_euler(order.upper(), angles, degrees=True)
    return np.hstack([position, turned.as_quat()])
