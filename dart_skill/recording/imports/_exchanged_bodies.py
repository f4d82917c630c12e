"""Two bodies under each other's names, as cameras confuse them that lose both at once.

Between two frames either each name goes on from its own pose or each goes on from the other's. By
the triangle inequality bodies that move alike can never seem to have changed places, so a way that
is half as long means that they did. The wrong one of two stretches is the one without free flight,
if one of the bodies is the ball, and else the one that is much shorter.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from dart_skill.common.constants import GRAVITY
from dart_skill.recording.imports.clocks import PAUSE
from dart_skill.recording.imports.faults import Fault, spans
from dart_skill.recording.imports.pose_stream import PoseStream

LEAST_RUN = 20
"""Fewest frames in which both bodies were seen."""
CLOSE = 0.02
"""Distance of bodies up to which they cannot be told apart [m]."""
FASTEST = 8.0
"""Largest speed on a path that is not broken [m/s]."""
NEAR_GRAVITY = 2.5
"""Largest acceleration that drag may add to that of a body in free flight [m/s^2]."""
FLYING_FRAMES = 9
"""Frames over which a free flight is recognised."""
SURE_FRAMES = 5
"""Frames of free flight by which one body must surpass the other to be told from it."""
_Stretch: TypeAlias = "tuple[int | None, int, int, int | None]"
"""Stamps of an exchanged stretch [ns]: of the last clear frame before it, its first, its last, the
first clear frame after it; None at the ends of a run, where it goes on as long as one of the
bodies is seen without a break.
"""


def unswapped(one: PoseStream, other: PoseStream) -> tuple[PoseStream, PoseStream, list[Fault]]:
    """Two streams with the poses exchanged that belong to the other body, and where those were.

    Parameters
    ----------
    one, other
        In Z-up axes. The ball is called `ball`.
    """
    if min(len(one), len(other)) < LEAST_RUN:
        return one, other, []
    period = 1e-9 * float(np.median(np.diff(one.stamp_ns)))
    margin = round(0.3e9 * period)
    i, j = _matched(one.stamp_ns, other.stamp_ns, margin)
    if len(i) < LEAST_RUN:
        return one, other, []
    a, b, stamps = one.position[i], other.position[j], one.stamp_ns[i]
    straight = _distance(a[1:], a[:-1]) + _distance(b[1:], b[:-1])
    crossing = _distance(b[1:], a[:-1]) + _distance(a[1:], b[:-1])
    changes = (straight > 2.0 * crossing) & (straight - crossing > CLOSE)
    pieces = [_pieces(stream, period) for stream in (one, other)]
    # it is known how the names go on where one of the bodies was seen all the time
    is_pause = np.diff(stamps) * 1e-9 > PAUSE
    is_pause &= (np.diff(pieces[0][i]) > 0) & (np.diff(pieces[1][j]) > 0)
    names, faults = f"{one.body} and {other.body}", []
    exchanged: list[_Stretch] = []
    for begin, end in pairwise([0, *(np.flatnonzero(is_pause) + 1).tolist(), len(stamps)]):
        run = stamps[begin:end]
        crossed = np.append(0, np.cumsum(changes[begin : end - 1])) % 2 == 1
        poses = {one.body: a[begin:end], other.body: b[begin:end]}
        wrong, why = _which_is_wrong(poses, run, period, crossed)
        for first, last in spans(wrong):
            its = run[first : last + 1]
            text = f"{len(its)} frames under each other's names, told by {why}"
            if not why:
                text = "two stretches are exchanged, and nothing tells which of them"
            faults.append(Fault.of("swap", names, its, f"{names}: {text}", bool(why)))
            if why:
                before = run[first - 1] if first else None
                after = run[last + 1] if last + 1 < len(run) else None
                exchanged.append((before, its[0], its[-1], after))
    if not exchanged:
        return one, other, faults
    parts = [
        _parted(stream, piece, exchanged, margin)
        for stream, piece in zip((one, other), pieces, strict=True)
    ]
    (kept, given), (others, others_given) = parts
    return _joined(kept, others_given), _joined(others, given), faults


def _pieces(stream: PoseStream, period: float) -> np.ndarray:
    """Number of the unbroken piece of path that each sample (n,) lies on."""
    steps = np.diff(stream.stamp_ns) * 1e-9
    way = _distance(stream.position[1:], stream.position[:-1])
    broken = (steps > 3.5 * period) | (way > CLOSE + FASTEST * steps)
    return np.append(0, np.cumsum(broken))


def _which_is_wrong(
    poses: dict[str, np.ndarray], stamps: np.ndarray, period: float, crossed: np.ndarray
) -> tuple[np.ndarray, str]:
    """Frames (n,) of a run that bear the wrong names, and what tells; empty where nothing does.

    poses: positions (n, 3) by body.
    """
    if "ball" in poses:
        (body,) = (position for name, position in poses.items() if name != "ball")
        ball = np.where(crossed[:, None], body, poses["ball"])
        body = np.where(crossed[:, None], poses["ball"], body)
        flying = _frames_in_flight(stamps, ball, period) - _frames_in_flight(stamps, body, period)
        if abs(flying) >= SURE_FRAMES:
            return (crossed if flying > 0 else ~crossed), "free flight"
    share = float(np.mean(crossed))
    is_sure = min(share, 1.0 - share) < 0.4
    return (crossed if share <= 0.5 else ~crossed), "continuity" if is_sure else ""


def _frames_in_flight(stamps: np.ndarray, position: np.ndarray, period: float) -> int:
    """How many stretches of FLYING_FRAMES frames fall freely."""
    if len(stamps) < FLYING_FRAMES:
        return 0
    lasted = stamps[FLYING_FRAMES - 1 :] - stamps[: 1 - FLYING_FRAMES]
    places = period * (np.arange(FLYING_FRAMES) - FLYING_FRAMES // 2)
    # second derivative of the parabola through the samples
    weights = np.linalg.pinv(np.vander(places, 3))[0] * 2.0
    windows = np.lib.stride_tricks.sliding_window_view(position, FLYING_FRAMES, axis=0)
    falls = _distance(windows @ weights, np.array([0.0, 0.0, -GRAVITY])) < NEAR_GRAVITY
    return int(np.sum(falls & (lasted < 1e9 * period * (FLYING_FRAMES - 0.5))))


def _parted(
    stream: PoseStream, piece: np.ndarray, stretches: list[_Stretch], margin: int
) -> tuple[PoseStream, PoseStream]:
    """The samples that do not belong to exchanged stretches, and those that do. What lies between
    frames of one kind and the other, with no partner to tell its kind, is in neither.
    """
    stamps = stream.stamp_ns
    given, unclear = np.zeros((2, len(stream)), dtype=bool)
    for before, start, stop, after in stretches:
        inside = (stamps >= start - margin) & (stamps <= stop + margin)
        rows = np.flatnonzero(inside)
        if before is None:
            inside |= (stamps < start) & (piece == piece[rows[0]])
        if after is None:
            inside |= (stamps > stop) & (piece == piece[rows[-1]])
        given |= inside
        begin, end = start if before is None else before, stop if after is None else after
        unclear |= (stamps > begin + margin) & (stamps < end - margin) & ~inside
    return stream.take(~given & ~unclear), stream.take(given)


def _joined(stream: PoseStream, more: PoseStream) -> PoseStream:
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(stream, name), getattr(more, name)])
        for name in ("stamp_ns", "position", "quaternion")
    }
    return replace(stream, **columns).take(np.argsort(columns["stamp_ns"], kind="stable"))


def _matched(one: np.ndarray, other: np.ndarray, tolerance: int) -> tuple[np.ndarray, np.ndarray]:
    """Indices of stamps (n,), (m,) that are at most a tolerance apart, each used once."""
    j = np.clip(np.searchsorted(other, one), 1, len(other) - 1)
    j -= one - other[j - 1] < other[j] - one
    near = np.abs(other[j] - one) <= tolerance
    near[1:] &= ~((j[1:] == j[:-1]) & near[:-1])
    return np.flatnonzero(near), j[near]


def _distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.linalg.norm(a - b, axis=-1)
