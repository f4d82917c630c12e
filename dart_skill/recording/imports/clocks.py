"""The time of samples: what stamps are worth beside the times at which they were recorded, and
what a mapping makes of both.

A message has two times: its stamp, and the log time at which it was recorded, which is late but
never early. Log time tells stamps that were not filled in, seconds that are milliseconds, counters
that overflow. Of several topics it tells whose clocks are apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from dart_skill.common.constants import NS_PER_S
from dart_skill.recording.imports.faults import BURSTS, SET_BACK, UNIT, UNSTAMPED, Fault
from dart_skill.recording.imports.mapping import TIME_UNITS, Clock

PAUSE = 0.5
"""Shortest silence that ends a run of frames: the clock or the world may have been set anew [s]."""
LEAST = 20
"""Samples from which a rate is told."""
BUNCHED = 0.3
"""Where the usual step is a smaller share of the mean one, samples come in bursts."""
STEADY = 0.1
"""Where the usual step differs from the mean one by less than this share, times follow a rate."""
HONEST = 0.1
"""Smallest share of the log time that a clock goes forward in it, if it is one of seconds; its
inverse is the largest.
"""
FEWEST_STEPS = 0.2
"""Smallest share of the usual step of the log time that the usual step of stamps is; its inverse
is the largest.
"""
BACK_NS = 500_000_000
"""Longest time by which the stamp of a late message runs back [ns]."""
BEHIND_NS = 20_000_000
"""Longest time by which stamps run back and stay behind without a clock that was set [ns]."""
APART_NS = 500_000_000
"""Largest difference, by the log, of the stamps of clocks that are the same [ns]."""
SAME_NS = 50_000_000
"""Largest difference between the delays of messages of one clock [ns]."""
DRIFTS_NS = 20_000_000
"""Largest time by which clocks drift apart over a recording that is not told [ns]."""
MOST_DRIFT = 0.05
"""Largest share by which a clock of a computer or camera runs faster or slower than another."""
BIN_NS = NS_PER_S
"""Log time over which the difference of two clocks is taken together [ns]."""
MOST_STEPS = 5
"""Largest number of times that a clock was set; more are none."""
OVERFLOWS = {
    2**32: "32 bits of nanoseconds",
    2**32 * 10**3: "32 bits of microseconds",
    2**32 * NS_PER_S: "32 bits of seconds",
    2**31: "31 bits of nanoseconds",
    2**16 * 10**6: "16 bits of milliseconds",
    NS_PER_S: "nanoseconds without seconds",
}
"""Sizes of counters by the time after which they begin anew [ns]."""
HOUR_NS = 3600 * NS_PER_S


def timed(
    body: str, stamps: np.ndarray, log_ns: np.ndarray | None, clock: Clock
) -> tuple[np.ndarray, np.ndarray, list[Fault]]:
    """The times of samples as a mapping reads them (k,) [ns], which of them have a time at all
    (n,), and what is wrong with the stamps that were recorded.

    Parameters
    ----------
    body
        Its name, for faults.
    stamps
        As recorded (n,) [ns].
    log_ns
        When each was recorded (n,) [ns], None where that was not kept.
    clock
        What a mapping says of them.
    """
    faults: list[Fault] = []
    kept, times = np.ones(len(stamps), dtype=bool), stamps
    if log_ns is not None and clock.source == "log":
        times = log_ns
    elif log_ns is not None:
        # of a table that was done when its numbers were read
        times = in_seconds(stamps, clock.unit)
        if not clock.is_regular:
            kept, faults = _stamp_faults(body, times, log_ns)
            times = times[kept]
    if clock.is_regular:
        times = regular(times, log_ns)
    return clock.corrected(times), kept, faults


def in_seconds(stamps: np.ndarray, unit: str) -> np.ndarray:
    """Stamps in truth (n,) [ns].

    Parameters
    ----------
    stamps
        As recorded (n,) [ns], whose seconds are of a unit of TIME_UNITS.
    unit
        Its name.
    """
    return stamps if unit == "s" else stamps // round(NS_PER_S / TIME_UNITS[unit])


# stamps beside log times


def _stamp_faults(
    body: str, stamps: np.ndarray, log_ns: np.ndarray
) -> tuple[np.ndarray, list[Fault]]:
    """Which samples have a stamp (n,), and what is wrong with the stamps as a whole."""
    n, filled = len(stamps), stamps != 0
    if n < 2:
        return np.ones(n, dtype=bool), []
    if not filled[0] and 0 < stamps[1] < NS_PER_S:
        filled[0] = True  # a clock that begins at 0, as that of a simulation or of a file
    lasted, text = 1e-9 * float(log_ns.max() - log_ns.min()), ""
    if not filled.any():
        text = f"nobody filled in the stamps of {n} messages: all are 0"
    elif np.ptp(stamps) == 0 and lasted > 0.1:
        text = f"all {n} messages have the same stamp, {1e-9 * stamps[0]:.3f} s"
    if text:
        text += f"; they were recorded over {lasted:.1f} s"
        kept = filled if filled.any() else ~filled
        return kept, [Fault.of(UNSTAMPED, body, stamps, text, remedy="time: log")]
    faults = []
    known, log = stamps[filled], log_ns[filled]
    if gone := n - len(known):
        text = f"nobody filled in the stamps of {gone} of {n} messages, which are 0: left out"
        few = gone <= 0.05 * n
        faults.append(
            Fault.of(UNSTAMPED, body, known, text, few, ("" if few else "time: log"), gone)
        )
    wrong = _overflow(known, log) or _rate_fault(known, log) or _step_fault(known, log)
    if wrong:
        kind, text, remedy = wrong
        faults.append(Fault.of(kind, body, known, text, remedy=remedy))
    return filled, faults


_Wrong: TypeAlias = "tuple[str, str, str] | None"
"""Kind, message and remedy of what is wrong with stamps; None if nothing is."""


def _rate_fault(stamps: np.ndarray, log_ns: np.ndarray) -> _Wrong:
    """A clock that goes a thousand times as fast as the log time, or a thousandth as fast."""
    if len(stamps) < LEAST:
        return None
    order = np.argsort(log_ns, kind="stable")[len(stamps) // 10 : -(len(stamps) // 10)]
    steps, logged = np.diff(stamps[order]), np.diff(log_ns[order])
    usual = np.argsort(np.abs(steps))[:-MOST_STEPS]  # without those of a clock that was set
    lasted, whole = (float(part[usual].mean()) * len(stamps) for part in (logged, steps))
    rate = whole / lasted if lasted >= 1e8 else 1.0
    if rate < 0.0:
        return SET_BACK, "stamps run backwards all the time", "time: log"
    if HONEST <= rate <= 1.0 / HONEST:
        return None
    told = f"stamps go forward by {1e-9 * whole:.6g} s while {1e-9 * lasted:.1f} s were recorded"
    for unit, ns in TIME_UNITS.items():
        if unit != "s" and 1.0 / 3.0 < rate * ns / NS_PER_S < 3.0:
            return UNIT, f"{told}: their seconds are {unit} in truth", f"time: {unit}"
    return UNIT, f"{told}: seconds or nanoseconds are filled in wrongly", "time: log"


def _step_fault(stamps: np.ndarray, log_ns: np.ndarray) -> _Wrong:
    """Stamps that go forward rightly over seconds, but not from one message to the next, as where
    nanoseconds are microseconds.
    """
    if len(stamps) < LEAST or _unsteadiness(1e-9 * (log_ns - log_ns[0])) > 0.5:
        return None
    step, logged = float(np.median(np.diff(stamps))), float(np.median(np.diff(log_ns)))
    rate = rate_of(1e-9 * (np.maximum.accumulate(stamps) - stamps[0]))
    if (
        rate is not None and rate.is_bunched
    ) or FEWEST_STEPS * logged < step < logged / FEWEST_STEPS:
        return None
    return (
        UNIT,
        (
            f"stamps go forward by {1e-6 * step:.3f} ms from one message to the next, which are"
            f" {1e-6 * logged:.3f} ms apart: the nanoseconds are filled in wrongly"
        ),
        "time: log",
    )


def _overflow(stamps: np.ndarray, log_ns: np.ndarray) -> _Wrong:
    """Stamps that run back again and again by the same time, or once by more than a late message."""
    steps = np.diff(stamps)
    rows = np.flatnonzero(steps < -BACK_NS) + 1
    if not len(rows):
        return None
    back = -steps[rows - 1]
    usual = float(np.median(back))
    counters = (
        text
        for ns, text in OVERFLOWS.items()
        if abs(usual - ns) < 0.02 * ns and len(back) > np.ptp(log_ns) / ns - 2
    )
    counter = next(counters, "")
    if not counter and (len(back) == 1 or np.ptp(back) > 0.05 * usual):
        return None
    why = "the clock was set, or a bag was played again"
    remedy = "time: log"
    if counter:
        why = f"as a counter of {counter} does that overflows"
    elif len(back) <= MOST_STEPS:
        late = 1e-9 * (log_ns - stamps)
        by = [
            float(np.median(late[row : row + LEAST]) - np.median(late[max(0, row - LEAST) : row]))
            for row in rows
        ]
        remedy = f"time_steps: {steps_at(stamps, rows, by)}"
    return SET_BACK, f"stamps run back {len(back)} times by {1e-9 * usual:.3f} s, {why}", remedy


def clocks_apart(streams: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> list[Fault]:
    """What is wrong with clocks whose stamps differ from those of others, by when both were
    recorded.

    Parameters
    ----------
    streams
        Stamps (n,) and log times (n,) [ns] of each topic by its name in a mapping.
    """
    late = {
        name: _lateness(stamps, log_ns)
        for name, (stamps, log_ns) in streams.items()
        if len(stamps) >= LEAST
    }
    if len(late) < 2:
        return []
    reference = min(late, key=lambda name: _untrusted(name, late))
    faults = []
    for name, bins in late.items():
        both = sorted(set(bins) & set(late[reference]))
        if name != reference and len(both) >= 3:
            off = np.array([bins[k] - late[reference][k] for k in both], dtype=np.int64)
            faults += _of_difference(
                name, reference, streams[name], np.array(both) * 1e-9 * BIN_NS, off
            )
    return faults


def _untrusted(name: str, late: Mapping[str, Mapping[int, int]]) -> tuple[int, int, int]:
    """How little a clock is to be trusted: by how far it is from those of the others, how unsteady
    it is by the log, and how far from it.

    late: lateness by second of log time, of each topic.
    """
    own = np.array(list(late[name].values()), dtype=np.int64)
    off = []
    for other in (bins for one, bins in late.items() if one != name):
        both = sorted(set(other) & set(late[name]))
        off.append(max((abs(other[k] - late[name][k]) for k in both), default=0) // DRIFTS_NS)
    return (
        int(np.median(off)),
        int(np.ptp(own)) // DRIFTS_NS,
        abs(int(own[len(own) // 2])) // APART_NS,
    )


def _lateness(stamps: np.ndarray, log_ns: np.ndarray) -> dict[int, int]:
    """By how much messages were recorded after their stamps [ns], of the earlier ones of each
    second of log time.
    """
    order = np.argsort(log_ns, kind="stable")
    bins, first = np.unique(log_ns[order] // BIN_NS, return_index=True)
    groups = np.split((log_ns - stamps)[order], first[1:])
    return {
        int(k): int(np.sort(group)[len(group) // 10])
        for k, group in zip(bins, groups, strict=True)
    }


def _of_difference(
    name: str,
    reference: str,
    stream: tuple[np.ndarray, np.ndarray],
    at: np.ndarray,
    off: np.ndarray,
) -> list[Fault]:
    """Stamps that would have to be later by `off` (k,) [ns] to agree with those of another topic,
    at log times (k,) [s].
    """
    stamps, log_ns = stream
    level = int(np.median(off - off[0])) + int(off[0])
    rest = 1e-9 * (off - level)
    slope = _slope(at, rest) if len(at) >= 5 else 0.0
    from_line = rest - slope * (at - np.median(at))
    drifts = MOST_DRIFT > abs(slope) > 1e-9 * DRIFTS_NS / np.ptp(at) and np.median(
        np.abs(from_line)
    ) < 0.1 * abs(slope) * np.ptp(at)
    spread = from_line - np.median(from_line) if drifts else rest
    steps = np.flatnonzero(np.abs(np.diff(spread)) > 1e-9 * APART_NS)
    if 0 < len(steps) <= MOST_STEPS:
        by, when = np.diff(spread)[steps[0]], at[steps[0] + 1] - at[0]
        text = (
            f"the clock was set by {-by:.3f} s, {when:.0f} s after the first message, against that"
            f" of the {reference}"
        )
        levels = [float(np.median(part)) * 1e-9 for part in np.split(off, steps + 1)]
        rows = [_leap(stamps, log_ns, at[k : k + 2]) for k in steps]
        told = f"time_shift: {levels[0]:.3f}, " if abs(levels[0]) > 1e-9 * APART_NS else ""
        remedy = f"{told}time_steps: {steps_at(stamps, rows, np.diff(levels))}"
        return [Fault.of(SET_BACK, name, stamps, text, remedy=remedy)]
    if drifts:
        shift = 1e-9 * level - slope * (float(np.median(at)) - float(at[0]))
        text = (
            f"the clock runs {'slower' if slope > 0 else 'faster'} than that of the {reference},"
            f" by {1e3 * abs(slope):.3f} ms a second"
        )
        told = f"time_shift: {shift:.3f}, " if abs(shift) > 1e-9 * SAME_NS else ""
        return [Fault.of("drift", name, stamps, text, remedy=f"{told}time_drift: {slope:.6f}")]
    if abs(level) <= APART_NS:
        return []
    hours = (
        abs(level) > 0.9 * HOUR_NS
        and abs((level + HOUR_NS // 2) % HOUR_NS - HOUR_NS // 2) < APART_NS
        and abs(level) < 27 * HOUR_NS
    )
    kind = (
        "a whole number of hours: a time zone"
        if hours
        else "another epoch"
        if abs(level) > 30 * 24 * HOUR_NS
        else "another clock"
    )
    side = "behind" if level > 0 else "ahead of"
    text = (
        f"stamps are {1e-9 * abs(level):.3f} s {side} those of the {reference}, by when both were"
        f" recorded: {kind}"
    )
    return [Fault.of("clock", name, stamps, text, remedy=f"time_shift: {1e-9 * level:.3f}")]


def _leap(stamps: np.ndarray, log_ns: np.ndarray, around: np.ndarray) -> int:
    """The first sample after the clock was set, in one of two seconds of log time (2,) [s]."""
    near = (1e9 * around[0] <= log_ns[1:]) & (log_ns[1:] < 1e9 * around[1] + BIN_NS)
    return int(np.argmax(np.where(near, np.abs(np.diff(stamps) - np.diff(log_ns)), -1))) + 1


def without_running_back(stamp_ns: np.ndarray) -> np.ndarray:
    """Stamps (n,) of a clock that was set back, as if it went on with the next sample.

    Parameters
    ----------
    stamp_ns
        In the order of recording (n,) [ns].
    """
    if len(stamp_ns) < 4:
        return stamp_ns
    steps = np.diff(stamp_ns)
    following = np.lib.stride_tricks.sliding_window_view(
        np.pad(stamp_ns[1:], (0, 2), mode="edge"), 3
    ).max(axis=1)
    # what is late is followed by what is not
    back = (steps < -BEHIND_NS) & (following < stamp_ns[:-1])
    return stamp_ns + np.concatenate(
        [[0], np.cumsum(np.where(back, round(float(np.median(steps))) - steps, 0))]
    )


def steps_at(
    stamps: np.ndarray, rows: Sequence[int] | np.ndarray, by: Sequence[float] | np.ndarray
) -> list[list[float]]:
    """The steps of a clock that was set, as a mapping has them.

    Parameters
    ----------
    stamps
        As recorded (n,) [ns].
    rows
        First samples after that, ascending.
    by
        What is to be added from each of them on [s].
    """
    found = []
    for row, more in zip(rows, by, strict=True):
        at = 0.5e-9 * float(stamps[row - 1] + stamps[row]) + 0.5 * more
        found.append([round(float(at), 4), round(float(more), 4)])
    return found


def _slope(at: np.ndarray, values: np.ndarray) -> float:
    """Slope of the line that most points (k,) lie on (Theil, Sen), of not too many of them."""
    chosen = np.unique(np.linspace(0, len(at) - 1, min(len(at), 300)).astype(int))
    earlier, later = np.triu_indices(len(chosen), 1)
    at, values = at[chosen], values[chosen]
    return float(np.median((values[later] - values[earlier]) / (at[later] - at[earlier])))


# rates


@dataclass(frozen=True)
class Rate:
    """How often samples come.

    Parameters
    ----------
    period
        Between two, on average, without silences [s].
    interval
        Between two bursts [s]; as the period where they come one by one.
    count
        Samples of a burst.
    """

    period: float
    interval: float
    count: int

    @property
    def is_bunched(self) -> bool:
        """Whether samples come in bursts: their times are those of receipt, or of a slow clock."""
        return self.count > 1


def rate_of(time: np.ndarray) -> Rate | None:
    """How often samples come at times (n,) [s], in ascending order; None of too few. It counts
    steps, and no frames between them.
    """
    steps = _without_pauses(time)
    if len(steps) < LEAST - 1 or steps.sum() <= 0.0:
        return None
    mean, median = float(np.mean(steps)), float(np.median(steps))
    if median >= BUNCHED * mean:
        return Rate(median, median, 1)
    long = steps > mean
    count = max(2, round(len(steps) / int(long.sum())))
    interval = float(np.median(steps[long]) + (count - 1) * np.median(steps[~long]))
    return Rate(interval / count, interval, count)


def bunched(body: str, stamps: np.ndarray) -> list[Fault]:
    """Samples that come in bursts as a fault; none if they do not.

    Parameters
    ----------
    body
        Its name.
    stamps
        In ascending order.
    """
    rate = rate_of((stamps - stamps[:1]) * 1e-9)
    if rate is None or not rate.is_bunched:
        return []
    steps = 1e-9 * np.diff(stamps)
    within = float(np.median(steps[steps < 0.5 * rate.interval])) * (rate.count - 1)
    return [
        Fault.of(
            BURSTS,
            body,
            stamps,
            (
                f"stamps come in bursts, {rate.count} within {1e3 * within:.1f} ms every"
                f" {1e3 * rate.interval:.0f} ms: of receipt, and not of the frames, of which there are"
                f" {1.0 / rate.period:.1f} a second"
            ),
            remedy="time: regular",
        )
    ]


def regular(times: np.ndarray, log_ns: np.ndarray | None) -> np.ndarray:
    """Evenly spaced times (n,) [ns] of samples, in the order of recording.

    Of stamps and log times those that follow a rate better are the ruler. A stretch without a
    silence has the common period; where the ruler follows a rate, a longer step in it is as many
    frames as fit into it, else no frame is taken to be missing. A sample is late and never early:
    the earliest ones of a stretch say where its frames are.

    Parameters
    ----------
    times
        Stamps of the samples [ns].
    log_ns
        When they were recorded (n,) [ns], None where that was not kept.
    """
    order = np.maximum.accumulate(_ruler(times, log_ns))
    time = (order - order[:1]) * 1e-9
    rate = rate_of(time)
    if rate is None:
        return times
    longest = PAUSE if not rate.is_bunched else min(PAUSE, 2.5 * rate.interval)
    steps, usual = np.diff(time), _without_pauses(time)
    # most of them are the usual one
    is_steady = np.mean(np.abs(usual - np.median(usual)) < 0.3 * np.median(usual)) > 0.8
    frames = np.ones(len(steps))
    if is_steady and not rate.is_bunched:
        frames = np.maximum(1.0, np.rint(steps / rate.period))
    ends = [0, *(np.flatnonzero(steps > longest) + 1).tolist(), len(time)]
    runs = [slice(first, last) for first, last in pairwise(ends)]
    numbers = [np.append(0.0, np.cumsum(frames[run.start : run.stop - 1])) for run in runs]
    # slope of time over the number of the frame, of all stretches together
    above = below = 0.0
    for run, number in zip(runs, numbers, strict=True):
        if len(number) >= LEAST:
            centred = number - number.mean()
            above += float(centred @ (time[run] - time[run].mean()))
            below += float(centred @ centred)
    period = above / below if above and below else rate.period
    found = times.copy()
    for run, number in zip(runs, numbers, strict=True):
        origin = float(np.quantile(time[run] - period * number, 0.02))
        found[run] = order[0] + np.rint(1e9 * (origin + period * number)).astype(np.int64)
    return found


def _ruler(times: np.ndarray, log_ns: np.ndarray | None) -> np.ndarray:
    """Stamps or log times (n,) [ns]: those that tell a rate. Log times of another epoch than the
    stamps keep that of the stamps.
    """
    if log_ns is None or len(times) < LEAST:
        return times
    if np.ptp(times) == 0:
        return log_ns
    late = int(np.median(log_ns - times))
    by_log = _unsteadiness((log_ns - log_ns[0]) * 1e-9)
    by_stamp = _unsteadiness((np.maximum.accumulate(times) - times[0]) * 1e-9)
    if by_log < STEADY and by_log < by_stamp:
        return log_ns - (late if abs(late) > APART_NS else 0)
    return times


def _unsteadiness(time: np.ndarray) -> float:
    """By which share the usual step of times (n,) [s] differs from the mean one."""
    steps = _without_pauses(time)
    if not len(steps) or np.mean(steps) <= 0.0:
        return np.inf
    return abs(1.0 - float(np.median(steps) / np.mean(steps)))


def _without_pauses(time: np.ndarray) -> np.ndarray:
    """Steps between times (n,) [s], but for those over a pause."""
    steps = np.diff(time)
    return steps[steps < PAUSE]
