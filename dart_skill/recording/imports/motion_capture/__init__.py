"""Files that motion capture programs export: which program wrote one is told by its content."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dart_skill.common.files import open_file
from dart_skill.recording.imports.mapping import CaptureFile, PoseSource
from dart_skill.recording.imports.motion_capture._bvh import read_bvh
from dart_skill.recording.imports.motion_capture._capture import Capture, poses_of
from dart_skill.recording.imports.motion_capture._exports import (
    looks_like_qualisys,
    looks_like_vicon,
    read_c3d,
    read_qualisys,
    read_trc,
    read_vicon,
)
from dart_skill.recording.imports.motion_capture._motive import looks_like_motive, read_motive
from dart_skill.recording.imports.pose_stream import Axes
from dart_skill.recording.imports.text_files import TextFile

NOT_READ = {
    (
        ".tak",
        ".ttp",
        ".tra",
        ".motive",
    ): "a file of Motive: open it there, and export CSV ('Export Tracking Data')",
    (
        ".x1d",
        ".x2d",
        ".x1s",
        ".x2s",
        ".vsk",
        ".vss",
        ".xcp",
    ): "a file of Vicon: open it in Nexus or Tracker, and export C3D or ASCII (CSV)",
    (".qtm", ".qpr"): "a file of QTM: open it there, and export TSV with header, 3D or 6D",
    (".mvn", ".mvnx", ".mtb"): "a file of Xsens: open it in MVN, and export BVH or C3D",
    (
        ".fbx",
        ".htr",
        ".asf",
        ".amc",
        ".trb",
        ".cap",
        ".cmo",
    ): "not read: export BVH of a skeleton, C3D or TRC of markers, or CSV",
}
"""What to do with files of other formats, by their endings."""


def read_capture(
    folder: Path, where: PoseSource
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Axes]:
    """Stamps (n,) [ns], positions (n, 3) [m], quaternions (n, 4), x, y, z, w, of the frames in
    which a body was seen; and where our axes point in its.

    Parameters
    ----------
    folder
        Of the recording.
    where
        Which body in which file, and what the mapping says of it.

    Raises
    ------
    ValueError
        Says what is wrong with the file, or what it does not say.
    """
    assert where.capture is not None  # as the caller has seen
    path = folder / where.capture.file
    try:
        return poses_of(_opened(path, where.capture, where.clock.unit), where)
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror or error}") from error


def _opened(path: Path, where: CaptureFile, unit: str) -> Capture:
    ending = path.suffix.lower()
    with open_file(path) as stream:
        first = stream.read(16)
    remedy = next((text for endings, text in NOT_READ.items() if ending in endings), "")
    if first[1:2] == b"\x50" and first[:1] < b"\x20":
        return read_c3d(path, where)
    try:
        file = TextFile(path)
    except ValueError as error:
        raise ValueError(f"{path}: {remedy}") if remedy else error from None
    lines = file.first_lines
    if lines[0].strip().upper().startswith("HIERARCHY"):
        return read_bvh(path)
    if lines[0].startswith("PathFileType"):
        return read_trc(file, unit)
    if looks_like_qualisys(lines):
        return read_qualisys(file, where, unit)
    if looks_like_vicon(lines):
        return read_vicon(file, where)
    if looks_like_motive(lines):
        return read_motive(file, where, unit)
    known = "CSV of Motive, Nexus or Tracker, TSV of QTM, C3D, TRC, BVH"
    other = (
        f"no export of a motion capture program that is known ({known}): a table is read with"
        " 'table:' and columns"
    )
    raise ValueError(f"{path}: {remedy or other}")


__all__ = ["read_capture"]
