"""When the clock of joints or cameras was set meanwhile, and by how much: told by leaps of stamps,
and by movements that fit otherwise.

Movements are compared with several offsets of the clocks. The offset of each instant is the one of
the cheapest path through them, on which each change of the offset costs as much as a clear misfit
(Viterbi).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dart_skill.recording.imports import MOST_STEPS, JointStream, PoseStream, steps_at
from dart_skill.session._alignment import RATE, activity, correlations

BLOCK = 8.0
"""Time over which offsets are looked for [s]."""
FEW = 5
"""Number of offsets that are looked at of each such time."""
DISTINCT = 0.08
"""Smallest difference between offsets of movements that are two [s]."""
EVERY = 5
"""Number of samples of movements that are compared together."""
CHANGE = 0.25
"""What a change of the offset costs, in mean misfits of a moving second without any resemblance.
"""
FARTHER = 0.03
"""Share of a movement that it costs at most to be told by another offset than most: of movements
that repeat themselves the nearest one.
"""
ALIKE = 0.12
"""Largest misfit, in the same unit, that may be chance."""
LEAST_STEP = 0.005
"""Smallest step of a clock that was set [s]."""
LIKE = 0.25
"""Share of a step by which a leap of stamps may differ from it."""


@dataclass(frozen=True)
class Change:
    """A change of the offset between joints and cameras.

    Parameters
    ----------
    first, last
        Stamps of the cameras between which it happened [ns].
    before, by
        The joints' stamps after the cameras' before it, and what is added then [s].
    """

    first: float
    last: float
    before: float
    by: float


def rows_of_change(
    change: Change, hand: np.ndarray, joints: np.ndarray, was: tuple[np.ndarray, np.ndarray]
) -> tuple[bool | None, tuple[int, int]]:
    """Whether it is the clock of the cameras that was set, None where leaps do not tell; and the
    first samples after that of both.

    Parameters
    ----------
    change
        Of their offset.
    hand, joints
        Stamps (n,), (m,) of both [ns].
    was
        The same as recorded.
    """
    by = 1e9 * change.by
    since, until = (
        change.first + 1e9 * change.before,
        change.last + 1e9 * (change.before + change.by),
    )
    ours, row = _leap(hand, was[0], (change.first, change.last), -by)
    theirs, their_row = _leap(joints, was[1], (min(since, since + by), max(until, until - by)), by)
    return (ours <= theirs if min(ours, theirs) < LIKE * abs(by) else None), (row, their_row)


def _leap(
    stamps: np.ndarray, was: np.ndarray, between: tuple[float, float], by: float
) -> tuple[float, int]:
    """By how much the leap that is most like a step differs from it [ns], and the first sample
    after it.

    Where stamps ran back, and do no longer, any step may be; where no leap is like it, the longest
    silence is taken.
    """
    steps = np.diff(stamps)
    near = (stamps[1:] >= between[0]) & (stamps[:-1] <= between[1])
    leap = steps - np.median(steps)
    apart = np.where(near, np.where(steps != np.diff(was), 0.0, np.abs(leap - by)), np.inf)
    best = int(np.argmin(apart))
    if not apart[best] < LIKE * abs(by):
        best = int(np.argmax(np.where(near, np.abs(leap), -1.0)))
    return float(apart[best]), best + 1


def steps_of(stamps: np.ndarray, was: np.ndarray) -> list[list[float]]:
    """Steps of a clock as a mapping has them.

    Parameters
    ----------
    stamps
        Set right (n,) [ns].
    was
        As recorded (n,) [ns].
    """
    by = 1e-9 * np.diff(stamps - was)
    rows = np.flatnonzero(np.abs(by) > LEAST_STEP)
    return steps_at(was, rows + 1, by[rows])


def changes_of_movements(hand: PoseStream, joints: JointStream) -> list[Change]:
    """Changes of the offset by when hand and joints move, in order of time; none where movements
    do not resemble each other.
    """
    origin = min(int(hand.stamp_ns[0]), int(joints.stamp_ns[0]))
    seen, arm = (activity(stream.stamp_ns - origin, stream.position) for stream in (hand, joints))
    if seen is None or arm is None:
        return []
    arm_speed = np.nan_to_num(arm[1])
    lags = _lags(np.nan_to_num(seen[1]), arm_speed)
    cost = np.column_stack([_misfit(seen[1], arm_speed, lag) for lag in lags])
    offsets = lags / RATE + arm[0] - seen[0]
    apart = np.abs(offsets - offsets[np.argmin(cost.sum(axis=0))])
    leaps = 1e-9 * np.abs(np.concatenate([[0], np.diff(hand.stamp_ns), np.diff(joints.stamp_ns)]))
    # of stamps; of movements that repeat themselves they tell which
    leaps = leaps[(leaps > DISTINCT) | (leaps == 0.0)]
    apart = np.where(np.abs(apart[:, None] - leaps).min(axis=1) < DISTINCT, 0.0, apart)
    cost += FARTHER * apart / (apart + 1.0) * _misfit(seen[1], np.zeros(1), len(seen[1]))[:, None]
    stamps = origin + 1e9 * (seen[0] + np.arange(len(cost)) * EVERY / RATE)
    return changes(stamps, offsets, cost / RATE, CHANGE, ALIKE)


def changes(
    stamps: np.ndarray, offsets: np.ndarray, cost: np.ndarray, penalty: float, chance: float
) -> list[Change]:
    """Changes between offsets (k,) [s] on the cheapest path; none where there are too many.

    Parameters
    ----------
    stamps
        Of instants (n,) [ns].
    cost
        Of each instant with each offset (n, k).
    penalty
        Of a change.
    chance
        Cost that tells nothing.
    """
    path = _cheapest(cost, penalty)
    rows = np.flatnonzero(np.diff(path)) + 1
    found = []
    for row, low, high in zip(rows, [0, *rows], [*rows[1:], len(path)], strict=False):
        one, other = path[row - 1], path[row]
        # of a change at each row from `low` on
        total = np.cumsum(np.concatenate([[0.0], (cost[:, one] - cost[:, other])[low:high]]))
        good = total <= total[row - low] + chance
        begin = row - int(np.argmin(np.concatenate([good[: row - low][::-1], [False]])))
        end = row + int(np.argmin(np.concatenate([good[row - low :], [False]]))) - 1
        first, last = stamps[max(begin - 1, 0)], stamps[min(end, len(stamps) - 1)]
        found.append(
            Change(
                float(first),
                float(last),
                float(offsets[one]),
                float(offsets[other] - offsets[one]),
            )
        )
    return found if len(found) <= MOST_STEPS else []


def _cheapest(cost: np.ndarray, penalty: float) -> np.ndarray:
    """Column of each row of costs (n, k) on the cheapest path, on which each change costs a
    penalty.
    """
    total, came = cost[0].copy(), np.zeros(cost.shape, dtype=int)
    stay = np.arange(cost.shape[1])
    for k in range(1, len(cost)):
        best = int(np.argmin(total))
        changed = total[best] + penalty < total
        came[k] = np.where(changed, best, stay)
        total = np.where(changed, total[best] + penalty, total) + cost[k]
    path = np.empty(len(cost), dtype=int)
    path[-1] = np.argmin(total)
    for k in range(len(cost) - 1, 0, -1):
        path[k - 1] = came[k, path[k]]
    return path


def _lags(seen: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Lags (k,) of joints behind cameras [samples] that a part of the recording, or all of it,
    suggests.
    """
    block = round(BLOCK * RATE)
    parts = [(0, seen)] + [(k, seen[k : k + block]) for k in range(0, len(seen), block // 2)]
    found: list[int] = []
    for begin, part in parts:
        if part.max(initial=0.0) == 0.0:
            continue
        lags, like, shared = correlations(part, arm)
        merit = like * np.sqrt(shared)
        for _ in range(FEW):
            best = int(np.argmax(merit))
            found.append(int(lags[best]) - begin)
            merit[max(0, best - round(DISTINCT * RATE)) : best + round(DISTINCT * RATE)] = -1.0
    return np.unique(found)


def _misfit(seen: np.ndarray, arm: np.ndarray, lag: int) -> np.ndarray:
    """Squared differences of movements with a lag, added up over EVERY samples; unknown joints
    rest, of an unseen hand nothing is told.
    """
    places = np.arange(len(seen)) + lag
    known = (places >= 0) & (places < len(arm))
    apart = np.nan_to_num(seen - np.where(known, arm[np.clip(places, 0, len(arm) - 1)], 0.0)) ** 2
    whole = np.pad(apart, (0, -len(apart) % EVERY))
    return whole.reshape(-1, EVERY).sum(axis=1)
