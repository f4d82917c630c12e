"""How far the clocks of cameras and arm are apart: the speed of the hand, by the cameras and by the joints, shifted until both are alike.

With a(t) by the cameras and b(t) by the joints, the lag is the one that maximises the correlation of a(t) and b(t - lag) over the instants
at which both are known. Speed needs neither the axes of the cameras nor where the arm stands, and correlation no unit. The lags of short
stretches, one after the other, tell a drift or a step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from dart_skill.constants import N_JOINTS
from dart_skill.robot import ArmModel

STEP = 0.005
"""Of the grid on which both speeds are compared [s]."""
SPAN = 4
"""Steps over which a speed is taken."""
LONGEST_STEP = 0.15
"""Samples that are farther apart say nothing of the time between them [s]."""
LEAST_TIME = 1.0
"""Both must be known for so long together, or for a third of the shorter one, at a lag that is tried [s]."""
STRETCH = 4.0
"""Of time by which drift is found [s]."""
NEAR = 0.3
"""The lag of a stretch is looked for so near to that of the whole [s]."""
SURE = 0.8
"""Correlation of a stretch that tells anything."""
MOVED = 0.05
"""A stretch in which the hand's speed varies by less tells nothing [m/s]."""
ONE_LINE = 0.01
"""Lags that are nearer than this to a line are a drift, and no step [s]."""
MOST_DRIFT = 0.05
"""No clock runs faster or slower by more."""


@dataclass(frozen=True)
class ClockOffset:
    """What brings the stamps of the joints to those of the cameras.

    * shift_ns: to be added to each stamp of the joints [ns], `time_shift` of a mapping.
    * drift: to be added as a share of the time since the first stamp of the joints, `time_drift` of a mapping; 0 where it tells nothing.
    * correlation: of both speeds with shift and drift, 1 if they are alike but for their unit.
    * before: the same of the stamps as they are; nan where they have no time in common.
    * spread: how far the lags of stretches are from this, median [s]; nan with less than two stretches.
    * is_steady: whether they are on one line; else a clock was set anew meanwhile.
    """

    shift_ns: int
    drift: float
    correlation: float
    before: float
    spread: float
    is_steady: bool

    @property
    def shift(self) -> float:
        """`shift_ns` in seconds."""
        return 1e-9 * self.shift_ns


def clock_offset(
    hand_ns: np.ndarray, hand_position: np.ndarray, joint_ns: np.ndarray, joint_position: np.ndarray, model: ArmModel | None = None
) -> ClockOffset | None:
    """How far the clock of the joints is from that of the cameras; None where neither moves, or too little was recorded.

    * hand_ns: stamps of the hand (n,) [ns].
    * hand_position: as the cameras see it, (n, 3), in any axes and unit.
    * joint_ns: stamps of the joints (m,) [ns]; of any epoch.
    * joint_position: (m, 7) [rad].
    * model: of the arm, default ours.
    """
    hand_ns, hand_position = _finite_in_order(hand_ns, np.asarray(hand_position, dtype=float))
    joint_ns, joint_position = _finite_in_order(joint_ns, np.asarray(joint_position, dtype=float))
    if min(len(hand_ns), len(joint_ns)) < 20:
        return None
    joint_ns, arm_position = hand_by_joints(joint_ns, joint_position, model)
    first, begun = int(hand_ns[0]), int(joint_ns[0])
    cameras, arm = _speeds(hand_ns, hand_position), _speeds(joint_ns, arm_position)
    if min(np.isfinite(cameras).sum(), np.isfinite(arm).sum()) * STEP < LEAST_TIME:
        return None
    lag = _best_lag(cameras, arm)
    if lag is None:
        return None
    offset_ns = first - begun + round(1e9 * STEP * lag)
    times, lags = _lags_of_stretches(cameras, arm, lag)
    drift, spread, is_steady = 0.0, np.nan, True
    if len(lags) >= 2:
        drift, shift, spread, is_steady = _line(times, lags)
        offset_ns = first - begun + round(1e9 * shift)
    corrected = joint_ns + offset_ns + np.rint(drift * (joint_ns - begun)).astype(np.int64)
    found = _correlation_at(cameras, first, _speeds(corrected, arm_position), int(corrected[0]))
    before = _correlation_at(cameras, first, arm, begun)
    return ClockOffset(offset_ns, drift, found, before, spread, is_steady)


def hand_by_joints(joint_ns: np.ndarray, joint_position: np.ndarray, model: ArmModel | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (k,) [ns] and positions (k, 3) [m] of the hand by the arm's kinematics, at no more than about 100 states a second.

    * joint_ns: stamps of the joints (m,) [ns], in order of time.
    * joint_position: (m, 7) [rad].
    * model: of the arm, default ours.
    """
    slots = (joint_ns - joint_ns[0]) // round(2e9 * STEP)
    kept = np.flatnonzero(np.diff(slots, prepend=-1) > 0)
    model = model or ArmModel()
    speeds = np.zeros((len(kept), N_JOINTS))
    return joint_ns[kept], model.hand_states(joint_position[kept], speeds)[0]


def _finite_in_order(stamps: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Samples that are finite, in order of time, one of each stamp."""
    stamps = np.asarray(stamps, dtype=np.int64)
    kept = np.isfinite(rows).all(axis=1)
    stamps, rows = stamps[kept], rows[kept]
    order = np.argsort(stamps, kind="stable")
    order = order[np.diff(stamps[order], prepend=stamps[order[:1]] - 1) > 0]
    return stamps[order], rows[order]


def _speeds(stamps: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Speed on a grid of STEP since the first stamp (k,); nan where nobody knows it. Of a silence of hours nothing is kept in memory but
    its grid, which is no longer than a day.
    """
    time = 1e-9 * (stamps - stamps[0])
    grid = np.arange(0.0, min(time[-1], 86400.0), STEP)
    after = np.clip(np.searchsorted(time, grid, side="right"), 1, len(time) - 1)
    known = time[after] - time[after - 1] <= LONGEST_STEP
    place = np.column_stack([np.interp(grid, time, column) for column in position.T])
    speed = np.full(len(grid), np.nan)
    if len(grid) > SPAN:
        speed[SPAN // 2 : len(grid) - SPAN // 2] = np.linalg.norm(place[SPAN:] - place[:-SPAN], axis=1) / (SPAN * STEP)
    whole = np.convolve(~known, np.ones(SPAN + 1), mode="same") == 0
    return np.where(whole, speed, np.nan)


def _correlations(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Correlation of a(t) with b(t - lag) over what both know, for each lag from -(len(b) - 1) to len(a) - 1; and over how many."""
    size = next_fast_len(len(a) + len(b), real=True)

    def spectrum(values: np.ndarray) -> np.ndarray:
        return rfft(values, size)

    known_a, known_b = np.isfinite(a), np.isfinite(b)
    a, b = np.where(known_a, a - np.nanmean(a), 0.0), np.where(known_b, b - np.nanmean(b), 0.0)
    of_a = [spectrum(one) for one in (known_a.astype(float), a, a * a)]
    of_b = [np.conj(spectrum(one)) for one in (known_b.astype(float), b, b * b)]

    def products(i: int, j: int) -> np.ndarray:
        around = irfft(of_a[i] * of_b[j], size)
        return np.concatenate([around[size - len(b) + 1 :], around[: len(a)]])

    count = np.rint(products(0, 0))
    n = np.maximum(count, 1.0)
    mean_a, mean_b = products(1, 0) / n, products(0, 1) / n
    spread_a, spread_b = products(2, 0) / n - mean_a**2, products(0, 2) / n - mean_b**2
    floor_a, floor_b = 1e-3 * (a @ a) / max(known_a.sum(), 1), 1e-3 * (b @ b) / max(known_b.sum(), 1)
    common = (products(1, 1) / n - mean_a * mean_b) / np.sqrt(np.maximum(spread_a, floor_a) * np.maximum(spread_b, floor_b) + 1e-300)
    return common, count


def _best_lag(a: np.ndarray, b: np.ndarray) -> float | None:
    """Steps by which b is to be moved to be like a; None where one of them does not vary. Of two that are as good, the one that explains
    more of the time is taken.
    """
    if min(np.nanstd(a), np.nanstd(b)) < 1e-9:
        return None
    common, count = _correlations(a, b)
    least = max(LEAST_TIME / STEP, 0.3 * min(np.isfinite(a).sum(), np.isfinite(b).sum()))
    common = np.where(count >= least, common, -1.0)
    if not (common > -1.0).any():
        return None
    merit = common * np.sqrt(np.minimum(1.0, count / count.max()))
    best = int(np.argmax(merit))
    return best - (len(b) - 1) + _summit(common, best)


def _summit(values: np.ndarray, best: int) -> float:
    """Where the parabola through a largest value and its neighbours has its summit, in steps from that value."""
    if not 0 < best < len(values) - 1:
        return 0.0
    before, here, after = values[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    return float(np.clip(0.5 * (before - after) / bend, -1.0, 1.0)) if bend < 0.0 else 0.0


def _lags_of_stretches(a: np.ndarray, b: np.ndarray, lag: float) -> tuple[np.ndarray, np.ndarray]:
    """Middle of each stretch that tells one, on the clock of b [s], and its lag [s]. A drift may carry it along, so that each stretch is
    looked for near the lag of the one before it, outwards from where the whole fits best.
    """
    whole, size, near = round(lag), round(STRETCH / STEP), round(NEAR / STEP)
    starts = np.arange(0, len(b), size)
    fits = [_lag_of(a, b, int(start), size, whole, near) for start in starts]
    if not fits:
        return np.empty(0), np.empty(0)
    begin = int(np.argmax([fit[1] for fit in fits]))
    found: dict[int, float] = {}
    for places in (range(begin, len(starts)), range(begin - 1, -1, -1)):
        guess = found.get(begin, float(whole))
        for k in places:
            its_lag, correlation = _lag_of(a, b, int(starts[k]), size, round(guess), near)
            if correlation >= SURE:
                found[k] = guess = its_lag
    told = sorted(found)
    middles = np.array([starts[k] + 0.5 * size for k in told]) * STEP
    return middles, STEP * np.array([found[k] for k in told])


def _lag_of(a: np.ndarray, b: np.ndarray, start: int, size: int, guess: int, near: int) -> tuple[float, float]:
    """Lag of a stretch of b that begins at `start`, near a guess, in steps; and its correlation, -1 where it tells nothing."""
    part = b[start : start + size]
    first, last = start + guess - near, start + guess + len(part) + near
    around = np.full(last - first, np.nan)
    lower, upper = max(first, 0), min(last, len(a))
    if upper <= lower or np.isfinite(part).sum() * STEP < LEAST_TIME or np.nanstd(part) < MOVED:
        return float(guess), -1.0
    around[lower - first : upper - first] = a[lower:upper]
    if np.isfinite(around).sum() * STEP < LEAST_TIME:
        return float(guess), -1.0
    common, count = _correlations(around, part)
    inside = slice(len(part) - 1, len(part) + 2 * near)  # lags 0 to 2 near
    common, count = common[inside], count[inside]
    common = np.where(count >= max(LEAST_TIME / STEP, 0.5 * np.isfinite(part).sum()), common, -1.0)
    best = int(np.argmax(common))
    if best in (0, len(common) - 1):
        return float(guess), -1.0
    return guess - near + best + _summit(common, best), float(common[best])


def _line(times: np.ndarray, lags: np.ndarray) -> tuple[float, float, float, bool]:
    """Slope, value at 0 and median deviation of the line that most lags lie on [1], [s], [s], and whether nearly all do (Theil, Sen)."""
    later, earlier = np.triu_indices(len(times), 1)[::-1]
    if len(later) > 200_000:
        chosen = np.linspace(0, len(later) - 1, 200_000).astype(int)
        later, earlier = later[chosen], earlier[chosen]
    slope = float(np.median((lags[later] - lags[earlier]) / (times[later] - times[earlier])))
    flat = float(np.median(np.abs(lags - np.median(lags))))
    tilted = float(np.median(np.abs(lags - slope * times - np.median(lags - slope * times))))
    if len(times) < 4 or abs(slope) > MOST_DRIFT or abs(slope) * np.ptp(times) < max(0.002, 3.0 * tilted) or tilted > 0.7 * flat:
        slope = 0.0
    rest = lags - slope * times
    shift = float(np.median(rest))
    off = np.abs(rest - shift)
    return slope, shift, float(np.median(off)), bool(np.mean(off < ONE_LINE) > 0.8)


def _correlation_at(a: np.ndarray, a_ns: int, b: np.ndarray, b_ns: int) -> float:
    """Correlation of two speeds on grids that begin at these stamps; nan where they have too little in common."""
    lag = round(1e-9 * (b_ns - a_ns) / STEP)
    lower, upper = max(lag, 0), min(len(a), lag + len(b))
    if upper - lower < LEAST_TIME / STEP:
        return float("nan")
    one, other = a[lower:upper], b[lower - lag : upper - lag]
    known = np.isfinite(one) & np.isfinite(other)
    if known.sum() * STEP < LEAST_TIME or min(np.std(one[known]), np.std(other[known])) == 0.0:
        return float("nan")
    return float(np.corrcoef(one[known], other[known])[0, 1])
