"""The hand of a recording at some instants, as the arm's joints and as the cameras tell it, and
how their clocks differ.

Nothing is taken for granted of order, units or axes: instants are chosen, and clocks compared, by
how fast something moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dart_skill.recording.imports import JointStream, PoseStream

RATE = 100.0
"""Rate at which movements are compared [Hz]."""
WINDOW = 3
"""Samples over which a speed is taken."""
GAP = 0.2
"""Longest time between samples that a value is interpolated over [s]."""
OVERLAP = 0.5
"""Share of the shorter of two recordings that must be compared."""
CLEARLY = 0.05
"""Least gain in correlation with which an offset is better than none."""
LEAST_CORRELATION = 0.5
"""Smallest correlation of two recordings of the same movements."""
CANDIDATES = 4
"""Number of offsets that are looked at."""
APART = 0.5
"""Smallest difference between two of them [s]."""
INSTANTS = 50
"""Number of instants at which a hand is compared."""
ALIKE = 1e-3
"""Largest difference of postures that are one [rad]."""
LOOKED_AT = 2000
"""Number of samples of which those instants are chosen."""


@dataclass(frozen=True)
class ClockOffset:
    """How the stamps of the joints may differ from those of the cameras.

    Parameters
    ----------
    offsets
        (k,) of the joints' stamps after the cameras', the likeliest first [s].
    correlation
        Of the movements with the first of them, from -1 to 1.
    as_stamped
        The same without an offset; -1 where the recordings do not overlap.
    """

    offsets: tuple[float, ...]
    correlation: float
    as_stamped: float

    @property
    def is_clear(self) -> bool:
        """Whether an offset explains the movements better than none."""
        return self.correlation > max(LEAST_CORRELATION, self.as_stamped + CLEARLY)


@dataclass(frozen=True)
class Instants:
    """The hand at n instants.

    Parameters
    ----------
    seconds
        (n,) since the first stamp of the joints [s], on the clock of the joints.
    joints
        (n, 7) as they were recorded.
    position
        (n, 3) as the cameras recorded it.
    quaternion
        (n, 4) the same; nan where none was recorded.
    """

    seconds: np.ndarray
    joints: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray


def clock_offset(hand: PoseStream, joints: JointStream) -> ClockOffset:
    """By how much the stamps of joints and cameras differ, from when the arm and when the hand
    moves; any unit and order will do.

    Parameters
    ----------
    hand
        Poses that the cameras saw.
    joints
        Of the arm.
    """
    origin = min(int(hand.stamp_ns[0]), int(joints.stamp_ns[0]))
    seen, arm = (activity(stream.stamp_ns - origin, stream.position) for stream in (hand, joints))
    if seen is None or arm is None:
        return ClockOffset((), 0.0, 0.0)
    lags, correlation, shared = correlations(*map(np.nan_to_num, (seen[1], arm[1])))
    offsets = lags / RATE + arm[0] - seen[0]
    # of movements that repeat themselves, what explains more of them
    merit = correlation * np.sqrt(shared)
    best = [int(np.argmax(merit))]
    near = round(APART * RATE)
    while len(best) < CANDIDATES:
        merit[max(0, best[-1] - near) : best[-1] + near] = -1.0
        following = int(np.argmax(merit))
        if merit[following] <= 0.0:
            break
        best.append(following)
    none = int(np.argmin(np.abs(offsets)))
    as_stamped = float(correlation[none]) if abs(offsets[none]) <= 1.0 / RATE else -1.0
    return ClockOffset(tuple(offsets[best].tolist()), float(correlation[best[0]]), as_stamped)


def diverse_instants(hand: PoseStream, joints: JointStream, offset: float, slow: bool) -> Instants:
    """Instants with postures as different from each other as the recording has them.

    Parameters
    ----------
    hand, joints
        What was recorded.
    offset
        Of the joints' stamps after the cameras' [s].
    slow
        Among the slower half of the samples, where clocks tell little; else among the faster half.
    """
    found = at_instants(hand.take(evenly_spaced(len(hand), LOOKED_AT)), joints, offset)
    if len(found.seconds) < 4:
        return found
    speed = np.linalg.norm(
        joints_at(joints, found.seconds + 0.02)[0] - joints_at(joints, found.seconds - 0.02)[0],
        axis=1,
    )
    limit = np.median(speed)
    chosen = np.flatnonzero(speed <= limit if slow else speed >= limit)
    rows = chosen[_farthest_points(found.joints[chosen], INSTANTS)]
    return Instants(
        found.seconds[rows], found.joints[rows], found.position[rows], found.quaternion[rows]
    )


def at_instants(hand: PoseStream, joints: JointStream, offset: float) -> Instants:
    """Every pose of the hand for which the joints are known.

    Parameters
    ----------
    offset
        Of the joints' stamps after the cameras' [s].
    """
    seconds = 1e-9 * (hand.stamp_ns - joints.stamp_ns[0]) + offset
    values, known = joints_at(joints, seconds)
    norm = np.linalg.norm(hand.quaternion, axis=1, keepdims=True)
    quaternion = np.where(
        np.abs(norm - 1.0) < 0.1, hand.quaternion / np.where(norm > 0.0, norm, 1.0), np.nan
    )
    known &= np.isfinite(hand.position).all(axis=1) & np.isfinite(values).all(axis=1)
    return Instants(seconds[known], values[known], hand.position[known], quaternion[known])


def evenly_spaced(count: int, most: int) -> np.ndarray:
    """Indices of evenly spaced samples.

    Parameters
    ----------
    count
        Of all samples.
    most
        Of those that are chosen.
    """
    return np.unique(np.linspace(0, count - 1, most).round().astype(int))


def joints_at(joints: JointStream, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joints (n, 7) at instants (n,), and whether samples lie close around each (n,).

    Parameters
    ----------
    joints
        As they were recorded.
    seconds
        Instants (n,) since their first stamp [s].
    """
    stamps, rows = np.unique(joints.stamp_ns, return_index=True)
    time, values = 1e-9 * (stamps - joints.stamp_ns[0]), joints.position[rows]
    if len(time) < 2:
        return np.full((len(seconds), values.shape[1]), np.nan), np.zeros(len(seconds), dtype=bool)
    after = np.clip(np.searchsorted(time, seconds), 1, len(time) - 1)
    step = time[after] - time[after - 1]
    share = np.clip((seconds - time[after - 1]) / step, 0.0, 1.0)[:, None]
    # as where an angle is counted within a turn
    leaps = np.abs(values[after] - values[after - 1]).max(axis=1) > 0.5 * np.pi
    nearest = values[np.where(share[:, 0] < 0.5, after - 1, after)]
    found = np.where(
        leaps[:, None], nearest, (1.0 - share) * values[after - 1] + share * values[after]
    )
    return found, (seconds >= time[0]) & (seconds <= time[-1]) & (step < GAP)


def activity(stamp_ns: np.ndarray, values: np.ndarray) -> tuple[float, np.ndarray] | None:
    """When a stream begins [s], and how fast it moves from then on at RATE, from 0 to 1, nan where
    it is silent; None if it never moves.
    """
    good = np.isfinite(values).all(axis=1)
    stamps, rows = np.unique(stamp_ns[good], return_index=True)
    if len(stamps) < 2 * WINDOW:
        return None
    time, values = 1e-9 * stamps, values[good][rows]
    grid = np.arange(time[0], time[-1], 1.0 / RATE)
    even = np.column_stack([np.interp(grid, time, column) for column in values.T])
    speed = np.zeros(len(grid))
    speed[WINDOW:] = np.linalg.norm(even[WINDOW:] - even[:-WINDOW], axis=1)
    holes = np.flatnonzero(np.diff(time) > GAP)
    for first, last in zip(time[holes], time[holes + 1], strict=True):
        speed[int((first - time[0]) * RATE) : int((last - time[0]) * RATE) + WINDOW + 2] = np.nan
    usual = np.quantile(speed[np.isfinite(speed)], 0.95)
    return (float(time[0]), np.tanh(speed / (0.3 * usual))) if usual > 0.0 else None


def correlations(seen: np.ndarray, arm: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lags (k,) of the second behind the first that leave enough to compare [samples], with each
    the correlation (k,), and how much of the shorter one is compared (k,), from 0 to 1.
    """
    from scipy.signal import correlate, correlation_lags

    lags = correlation_lags(len(arm), len(seen))
    ones = np.ones_like(seen), np.ones_like(arm)
    count = np.maximum(np.round(correlate(ones[1], ones[0])), 1.0)
    total_arm, total_seen = correlate(arm, ones[0]) / count, correlate(ones[1], seen) / count
    square_arm, square_seen = (
        correlate(arm**2, ones[0]) / count,
        correlate(ones[1], seen**2) / count,
    )
    covariance = correlate(arm, seen) / count - total_arm * total_seen
    spread = np.sqrt(
        np.maximum(square_arm - total_arm**2, 1e-9) * np.maximum(square_seen - total_seen**2, 1e-9)
    )
    shared = count / min(len(seen), len(arm))
    enough = shared >= OVERLAP
    return lags[enough], (covariance / spread)[enough], shared[enough]


def _farthest_points(points: np.ndarray, count: int) -> np.ndarray:
    """Indices of points (n, d) each of which is as far as possible from those before it."""
    chosen = [0]
    distance = np.linalg.norm(points - points[0], axis=1)
    while len(chosen) < min(count, len(points)) and distance.max() > ALIKE:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen)
