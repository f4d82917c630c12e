"""The dart board: the bed (scoring area) of a point, its score, and the names of beds and targets
(thesis 6.1).

All lengths in this package are in millimetres. The origin is the centre of the bull; x points to
the right and y up, as the thrower sees the board. A point on a circle belongs to the ring inside
it (r <= 170 is a double). A point on a wire between two sectors belongs to the clockwise one.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_finite

RADII = np.array([6.35, 15.9, 99.0, 107.0, 162.0, 170.0])
"""Outer radii of double bull, single bull, inner singles, trebles, outer singles and doubles [mm].
"""
SECTORS = np.array([20, 1, 18, 4, 13, 6, 10, 15, 2, 17, 3, 19, 7, 16, 8, 11, 14, 9, 12, 5])
"""Numbers of the sectors, clockwise from the top."""
SECTOR_ANGLE = np.pi / 10.0

# Beds: 0 double bull, 1 single bull, then 20 inner singles, 20 trebles, 20 outer singles, 20
# doubles, clockwise, and 82 the miss.
N_BEDS = 83
MISS = 82
_RINGS = ("S", "T", "S", "D")
BED_NAMES = ("DB", "SB", *(f"{letter}{number}" for letter in _RINGS for number in SECTORS), "miss")
BED_SCORES = np.concatenate([[50, 25], SECTORS, 3 * SECTORS, SECTORS, 2 * SECTORS, [0]])
BED_IS_DOUBLE = np.array([name == "DB" or name.startswith("D") for name in BED_NAMES])
BED_SCORES.flags.writeable = BED_IS_DOUBLE.flags.writeable = False
POSSIBLE_SCORES = tuple(sorted({int(score) for score in BED_SCORES}))
HIGHEST_CHECKOUT = 170
"""The largest score that one turn can finish, with a double as its last dart: T20, T20, DB."""

_SYNONYMS = {
    "BULL": "DB",
    "50": "DB",
    "25": "SB",
    "DBULL": "DB",
    "SBULL": "SB",
    "MISS": "miss",
    "0": "miss",
    "M": "miss",
}


def as_points(value: ArrayLike, name: str = "points") -> np.ndarray:
    """Points (..., 2) [mm], finite."""
    points = as_finite(value, name)
    if points.ndim == 0 or points.shape[-1] != 2:
        raise ValueError(f"{name} must have shape (..., 2), x and y in mm, got {points.shape}")
    return points


def bed_of(ring: ArrayLike, sector: ArrayLike) -> np.ndarray:
    """Index of the bed of a ring (0 double bull to 5 doubles, 6 off the board) and a sector (0 at
    the top, clockwise).
    """
    ring = np.asarray(ring)
    inside = np.where(ring < 2, ring, 2 + 20 * (ring - 2) + np.asarray(sector))
    return np.where(ring == 6, MISS, inside)


def bed_at(points: ArrayLike) -> np.ndarray:
    """Index (...), into BED_NAMES, of the bed that contains each of the points (..., 2) [mm]."""
    points = as_points(points)
    x, y = points[..., 0], points[..., 1]
    ring = np.searchsorted(RADII, np.hypot(x, y), side="left")
    sector = np.floor(np.arctan2(x, y) / SECTOR_ANGLE + 0.5).astype(int) % 20
    return bed_of(ring, sector)


def score(points: ArrayLike) -> np.ndarray:
    """Score (...) of points (..., 2) [mm]."""
    return BED_SCORES[bed_at(points)]


def direction(sector: ArrayLike) -> np.ndarray:
    """Unit vector (..., 2) along the middle of a sector; a sector of k + 0.5 is the wire after
    sector k.
    """
    angle = np.asarray(sector) * SECTOR_ANGLE
    return np.stack([np.sin(angle), np.cos(angle)], axis=-1)


def bed_centres() -> np.ndarray:
    """A point (82, 2) [mm] in the middle of each bed except the miss; that of the single bull is
    above the double bull.
    """
    middles = 0.5 * (RADII[1:-1] + RADII[2:])
    rings = [radius * direction(np.arange(20)) for radius in middles]
    return np.concatenate([[[0.0, 0.0], [0.0, RADII[:2].mean()]], *rings])


def name_at(point: ArrayLike) -> str:
    """Name of the bed at a point (2,) [mm]: T20, S5, DB, SB or miss."""
    return BED_NAMES[int(bed_at(point))]


def place_of(point: ArrayLike) -> str:
    """Name of the bed at a point (2,) [mm]; "outside D1" for a point off the board beyond double
    one.
    """
    point = as_points(point, "point")
    bed = name_at(point)
    return (
        bed
        if bed != "miss"
        else f"outside {name_at(point * (0.5 * RADII[-2:].sum() / np.hypot(*point)))}"
    )


def beds_named(value: str | int) -> np.ndarray:
    """Mask (83,) of the beds that a score (0, 20, 57) or a name (T19, D16, S20, DB, SB, miss) can
    mean.

    A number means every bed with that score: 20 means both beds of single 20, and double 10.
    """
    text = str(value).strip()
    if re.fullmatch(r"[+-]?\d+(\.0*)?", text):
        return _beds_scoring(int(float(text)), value)
    mask = np.array([bed == _canonical(text) for bed in BED_NAMES])
    if not mask.any():
        raise ValueError(
            f"{value!r} is no score or bed; write a score such as 19, or a name such as T19, D16,"
            " S5, DB, SB or miss"
        )
    return mask


def _beds_scoring(number: int, value: str | int) -> np.ndarray:
    if number not in POSSIBLE_SCORES:
        raise ValueError(
            f"score {value} cannot be thrown with one dart; possible are 0 to 20, 25, 50, their"
            " doubles up to 40 and trebles up to 60"
        )
    return BED_SCORES == number


def as_target(value: str | ArrayLike) -> np.ndarray:
    """Point (2,) [mm] of a target: the middle of a bed (T20, D16, DB; S5 is the outer, larger
    single), or a point x, y.

    Parameters
    ----------
    value
        A name or a point (2,) [mm].

    Raises
    ------
    ValueError
        For what is neither.
    """
    if not isinstance(value, str):
        point = as_points(value, "aim")
        if point.shape != (2,):
            raise ValueError(
                f"aim must be one point x, y in mm or a name such as T20, got shape {point.shape}"
            )
        return point
    name = _canonical(value)
    beds = [
        bed for bed, known in enumerate(BED_NAMES) if known == name and name not in ("SB", "miss")
    ]
    if not beds:
        raise ValueError(
            f"aim {value!r} has no middle to aim at; name a bed such as T20, D16, S5 or DB, or"
            " give x and y in mm"
        )
    return bed_centres()[beds[-1]]


def _canonical(text: str) -> str:
    text = text.strip().upper()
    return _SYNONYMS.get(text, text)


def parse_score_list(scores: Sequence[str | int]) -> tuple[np.ndarray, np.ndarray]:
    """Masks (n, 83) of the beds that each throw can have hit, and whether it bounced out (n,);
    then its mask is all False.

    A throw is a score, the name of a bed, or x (also None or "bounce") for a dart that bounced
    out: its place is not known.
    """
    if isinstance(scores, (str, bytes)) or not np.iterable(scores):
        raise ValueError(f"scores must be a list with one entry per dart, got {scores!r}")
    scores = list(scores)
    if len(scores) == 0:
        raise ValueError("scores is empty; list the score of each dart, e.g. 20 5 1 T20 0")
    masks = np.array([_parse_one(value, index) for index, value in enumerate(scores)])
    return masks, ~np.any(masks, axis=1)


def _parse_one(value: str | int | None, index: int) -> np.ndarray:
    if value is None or str(value).strip().lower() in ("x", "bounce"):
        return np.zeros(N_BEDS, dtype=bool)
    try:
        return beds_named(value)
    except ValueError as error:
        raise ValueError(f"throw {index + 1}: {error}") from None
