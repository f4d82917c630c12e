"""What a file of motion capture holds, whatever program wrote it; and how a body becomes positions
in metres with quaternions.

Each format is a function that gives a `Capture`: the bodies and markers with the columns that hold
them, and what the file says of units and rotations. What it does not say is asked for, and what a
mapping says otherwise is an error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dart_skill.common.constants import UNTURNED
from dart_skill.recording.imports.mapping import (
    ANGLE_UNITS,
    LENGTH_UNITS,
    ROTATIONS,
    CaptureFile,
    PoseSource,
)
from dart_skill.recording.imports.pose_stream import UP_AXES, Axes
from dart_skill.recording.imports.text_files import TextFile, TextRow, Timing

LENGTH_WORDS = {
    "m": ("m", "meter", "meters", "metre", "metres"),
    "cm": ("cm", "centimeter", "centimeters", "centimetre", "centimetres"),
    "mm": ("mm", "millimeter", "millimeters", "millimetre", "millimetres"),
    "in": ("in", "inch", "inches"),
    "ft": ("ft", "foot", "feet"),
}
"""What programs call each unit of length, in small letters."""
FEWEST_MARKERS = 3
"""Fewest markers that give the orientation of a body."""
MOST_NAMES = 40
"""Most names that are listed in an error."""
MEASURED = "Marker"
"""Kind of markers that cameras saw; others of the same name are where a program expects them."""


@dataclass(frozen=True)
class Body:
    """A rigid body, bone or marker of a file.

    Parameters
    ----------
    name
        As the file has it.
    ident
        Its number or code there, may be empty.
    kind
        As the file has it.
    position
        Indices of the columns x, y, z.
    rotation
        Indices of the columns of its orientation; none for a marker.
    turn
        How these tell it: quaternion, matrix (column by column), a word of ROTATIONS, or empty
        where the file does not say it.
    angle
        Their unit, of ANGLE_UNITS; empty where the file does not say it, or they are no angles.
    refusal
        Why it cannot be used; empty if it can.
    """

    name: str
    kind: str
    position: tuple[int, ...]
    rotation: tuple[int, ...] = ()
    turn: str = ""
    angle: str = ""
    ident: str = ""
    refusal: str = ""


@dataclass(frozen=True)
class Capture:
    """A file of motion capture.

    Parameters
    ----------
    path
        Of the file.
    bodies
        With their columns.
    read
        Gives stamps (n,) [ns] and numbers (n, k) of columns; nan where nothing was seen.
    length
        Unit of positions, of LENGTH_UNITS; empty where the file does not say it.
    axes
        Where ours point in those of the file; None where the file does not say it.
    zero_is_lost
        Whether a position of zeros is a body that was not seen.
    """

    path: Path
    bodies: tuple[Body, ...]
    read: Callable[[Sequence[int]], tuple[np.ndarray, np.ndarray]]
    length: str = ""
    axes: Axes | None = None
    zero_is_lost: bool = True

    def error(self, text: str) -> ValueError:
        """An error that names the file."""
        return ValueError(f"{self.path}: {text}")


def poses_of(
    capture: Capture, where: PoseSource
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Axes]:
    """Stamps (n,) [ns], positions (n, 3) [m], quaternions (n, 4) of the frames in which a body was
    seen; where our axes point in theirs.

    Parameters
    ----------
    where
        Which body, and what the mapping says of the file.
    """
    assert where.capture is not None  # as the caller has seen
    chosen = _chosen(capture, where.capture)
    if refusal := next((body.refusal for body in chosen if body.refusal), ""):
        raise capture.error(f"'{chosen[0].name}': {refusal}")
    said = where.length if "length" in where.told else ""
    scale = LENGTH_UNITS[agreed(capture, "length", capture.length, said, LENGTH_UNITS)]
    axes = where.axes if where.told & {"up", "xyz"} else capture.axes
    if axes is None:
        raise capture.error(
            "the file does not say which axis points up: add 'up:' to the mapping, one of"
            f" {', '.join(UP_AXES)} (y is the default of Motive)"
        )
    body = _with_turn(capture, chosen[0], where.capture.rotation)
    stamps, numbers = capture.read(
        [place for one in chosen for place in (*one.position, *one.rotation)]
    )
    if len(chosen) > 1:
        position, quaternion = marker_poses(_seen(capture, numbers.reshape(len(stamps), -1, 3)))
    else:
        position, quaternion = _seen(capture, numbers[:, :3]), _quaternions(numbers[:, 3:], body)
    seen = np.isfinite(position).all(axis=1)
    return stamps[seen], scale * position[seen], quaternion[seen], axes


def marker(name: str, place: int) -> Body:
    """A marker whose x, y, z stand in three columns, the first of which is this one."""
    return Body(name, MEASURED, (place, place + 1, place + 2))


def capture_of_rows(
    file: TextFile,
    rows: Callable[[], Iterable[TextRow]],
    timing: Timing,
    bodies: Sequence[Body],
    length: str = "",
    axes: Axes | None = None,
) -> Capture:
    """A file of motion capture that is a table.

    Parameters
    ----------
    rows
        Gives those with numbers.
    timing
        How their time is told; the others: as of `Capture`.
    """
    return Capture(
        file.path,
        tuple(bodies),
        lambda places: file.read(rows(), timing, places, is_ragged=True),
        length,
        axes,
    )


def agreed(capture: Capture, key: str, told: str, said: str, choices: Sequence[str] | dict) -> str:
    """What the file tells, or the mapping says.

    Parameters
    ----------
    key
        Of the mapping.
    told
        By the file.
    said
        By the mapping; empty for nothing.
    choices
        Possible values.

    Raises
    ------
    ValueError
        If neither does, or they contradict each other.
    """
    if told and said and told != said:
        raise capture.error(
            f"{key} is '{said}' in the mapping, but the file itself says '{told}': leave {key}"
            " out, or correct the file"
        )
    if not told and not said:
        raise capture.error(
            f"the file does not say its {key}: add '{key}:' to the mapping, one of"
            f" {', '.join(choices)}"
        )
    return told or said


def agreed_rate(path: Path, told: float, said: float) -> float:
    """Frames per second [1/s].

    Parameters
    ----------
    path
        Of the file.
    told
        By the file.
    said
        By the mapping; 0 for nothing [1/s].

    Raises
    ------
    ValueError
        If neither tells it, or file and mapping contradict each other.
    """
    if told and said and abs(told - said) > 1e-6 * told:
        raise ValueError(
            f"{path}: rate is {said:g} in the mapping, but the file itself says {told:g}: leave"
            " rate out, or correct the file"
        )
    if not told > 0.0 and not said:
        raise ValueError(
            f"{path}: it has no times, and does not say its frame rate: add 'rate:' to the"
            " mapping, in frames per second"
        )
    return told or said


def length_told(text: str) -> str:
    """The unit of length that is meant by a word; empty if none is.

    Parameters
    ----------
    text
        The word.
    """
    return next(
        (unit for unit, words in LENGTH_WORDS.items() if text.strip().lower() in words), ""
    )


def _chosen(capture: Capture, wanted: CaptureFile) -> list[Body]:
    """The body, or the markers, that a mapping names."""
    if wanted.markers:
        unturned = {
            name: [one for one in _named(capture, name) if not one.rotation]
            for name in wanted.markers
        }
        return [_the_one(capture, name, _measured(of)) for name, of in unturned.items()]
    found = _named(capture, wanted.body)
    found = [one for one in found if one.rotation] or _measured(found)
    markers = [
        one
        for one in capture.bodies
        if not one.rotation and one.name.startswith(f"{wanted.body}:")
    ]
    return [_the_one(capture, wanted.body, found)] if found or not markers else _measured(markers)


def _measured(bodies: list[Body]) -> list[Body]:
    """Those of some bodies that are markers which cameras saw; all of them if none is."""
    return [one for one in bodies if one.kind == MEASURED] or bodies


def _named(capture: Capture, name: str) -> list[Body]:
    """Bodies of a name, or of an ident; else those with this name behind a colon, as in
    Skeleton:Bone.
    """
    return (
        [one for one in capture.bodies if one.name == name]
        or [one for one in capture.bodies if one.ident == name]
        or [one for one in capture.bodies if one.name.rpartition(":")[2] == name]
    )


def _the_one(capture: Capture, name: str, found: list[Body]) -> Body:
    if len(found) == 1:
        return found[0]
    if not found:
        names = list(dict.fromkeys(one.name for one in capture.bodies))
        more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
        raise capture.error(
            f"nothing is called '{name}' in it, only"
            f" {', '.join(names[:MOST_NAMES]) or 'nothing at all'}{more}"
        )
    remedy = "give them different names in the program, and export it again"
    for others in ([one.name for one in found], [one.ident for one in found]):
        if len(set(others)) == len(found):
            remedy = f"name one of {', '.join(others)} instead"
    raise capture.error(f"{len(found)} bodies are called '{name}': {remedy}")


def _with_turn(capture: Capture, body: Body, said: tuple[str, ...]) -> Body:
    """The body with how its orientation is told, by the file or by the words of the mapping."""
    kind = next((word for word in said if word in ROTATIONS), "")
    unit = next((word for word in said if word in ANGLE_UNITS), "")
    if body.rotation and len(body.rotation) != 3 and said:
        raise capture.error(
            f"rotation is '{kind or unit}' in the mapping, but '{body.name}' has a {body.turn} in"
            " the file: leave it out"
        )
    if len(body.rotation) != 3:
        return body
    missing = [] if body.turn or kind else [f"one of {', '.join(ROTATIONS)}"]
    missing += [] if body.angle or unit else ["rad or deg"]
    if missing:
        raise capture.error(
            f"the file does not say how '{body.name}' is turned: add 'rotation:' to the mapping,"
            f" {', and '.join(missing)}"
        )
    turn = agreed(capture, "rotation", body.turn, kind, ROTATIONS)
    return replace(
        body, turn=turn, angle=agreed(capture, "rotation", body.angle, unit, ANGLE_UNITS)
    )


def _seen(capture: Capture, position: np.ndarray) -> np.ndarray:
    """Positions (..., 3) that are nan where nothing was seen, of which most programs write zeros."""
    seen = np.isfinite(position).all(axis=-1)
    seen &= (position != 0.0).any(axis=-1) | (not capture.zero_is_lost)
    return np.where(seen[..., None], position, np.nan)


def _quaternions(numbers: np.ndarray, body: Body) -> np.ndarray:
    """Quaternions (n, 4) of what tells orientations (n, k); nan where they are not known, and none
    turned if nothing tells them.
    """
    from scipy.spatial.transform import Rotation  # our own bags need none

    if not body.rotation:
        return np.tile(UNTURNED, (len(numbers), 1))
    if body.turn == "quaternion":
        return numbers
    found = np.full((len(numbers), 4), np.nan)
    known = np.isfinite(numbers).all(axis=1)
    if body.turn == "matrix":
        matrices = numbers.reshape(-1, 3, 3).transpose(0, 2, 1)
        known &= np.linalg.det(np.where(known[:, None, None], matrices, np.eye(3))) > 0.5
        turned = Rotation.from_matrix(matrices[known])
    elif not known.any():
        return found
    else:
        angles, sequence = ANGLE_UNITS[body.angle] * numbers[known], ROTATIONS[body.turn]
        order = ["xyz".index(axis) for axis in sequence.lower()]
        turned = Rotation.from_rotvec(angles)
        if sequence:
            turned = Rotation.from_euler(sequence, angles[:, order])
    found[known] = turned.as_quat()
    return found


def marker_poses(markers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) and quaternions (n, 4) of a body that carries markers; nan where too few of
    them were seen.

    Its origin is the mean of the markers. Its x axis points from the first marker to the second,
    and the third lies in the x-y plane, where y is positive. Where some of more than three markers
    are hidden, the body follows from the others. Two markers have no orientation.

    Parameters
    ----------
    markers
        (n, k, 3), nan where one was not seen.
    """
    from scipy.spatial.transform import Rotation

    whole = np.isfinite(markers).all(axis=(1, 2))
    if markers.shape[1] < FEWEST_MARKERS or not whole.any():
        alike = UNTURNED if markers.shape[1] < FEWEST_MARKERS else (np.nan,) * 4
        return markers.mean(axis=1), np.tile(alike, (len(markers), 1))
    shape = _shape(markers[whole])
    seen = np.isfinite(markers).all(axis=2)
    fit = seen.sum(axis=1) >= FEWEST_MARKERS
    weight = seen[fit][:, :, None]
    there = np.where(weight, markers[fit], 0.0)
    n_seen = weight.sum(axis=1)
    centre, of_shape = there.sum(axis=1) / n_seen, (weight * shape).sum(axis=1) / n_seen
    moments = np.einsum(
        "nki,nkj->nij", weight * (there - centre[:, None]), weight * (shape - of_shape[:, None])
    )
    u, _, vt = np.linalg.svd(moments)
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    turned = u @ vt
    position, quaternion = np.full((len(markers), 3), np.nan), np.full((len(markers), 4), np.nan)
    position[fit] = centre - np.einsum("nij,nj->ni", turned, of_shape)
    quaternion[fit] = Rotation.from_matrix(turned).as_quat()
    return position, quaternion


def _shape(markers: np.ndarray) -> np.ndarray:
    """Markers (k, 3) in the axes of the body, about their mean: the median over frames (n, k, 3)
    in which all were seen.
    """
    x = markers[:, 1] - markers[:, 0]
    z = np.cross(x, markers[:, 2] - markers[:, 0])
    if not (np.linalg.norm(z, axis=1) > 1e-6 * np.sum(x * x, axis=1)).any():
        raise ValueError("the first three markers lie on a line: name others first in 'markers:'")
    x, z = (
        axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-300) for axis in (x, z)
    )
    axes = np.stack([x, np.cross(z, x), z], axis=1)
    shape = np.median(
        np.einsum("nij,nkj->nki", axes, markers - markers.mean(axis=1, keepdims=True)), axis=0
    )
    return shape - shape.mean(axis=0)
