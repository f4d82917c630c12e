"""Faults of recorded samples, found before anything is differentiated: repeats, jumps and
quantisation.

A logger that is faster than its sensor writes each measurement several times. Differences of such
samples are zero, then a step: the noise seems to be zero and the accelerations are huge. A jump is
a step that no motion around it explains. Quantised samples are multiples of one number, as
encoders and short formats give them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_number, as_samples
from dart_skill.movement._time import as_stamps

LARGEST_SHARE = 0.1
"""Largest share of samples that may repeat the one before while others around them move."""
JUMP = 10.0
"""Least speed of a jump, in units of the speed before it and after it."""
AROUND = 5
"""Number of steps whose median is the speed before or after a jump."""
COARSE = 2000
"""A column with fewer levels than this between its least and greatest sample is quantised."""


@dataclass(frozen=True)
class SampleFaults:
    """What was found in samples (n, d).

    Parameters
    ----------
    repeats
        Share of the samples that repeat the one before, within the motion; a rest at the start or
        end does not count.
    held
        How many samples a measurement is held for (median); 1 if none is held.
    jumps
        Indices of the samples after a jump.
    largest_jump
        In the unit of the samples; 0 if there is none.
    quantum
        For each column its resolution, 0 if it is not quantised.
    uneven
        Whether so many repeats are left by `without_repeats` that they are a fault, since
        measurements are held for uneven times.
    """

    repeats: float
    held: int
    jumps: tuple[int, ...]
    largest_jump: float
    quantum: tuple[float, ...]
    uneven: bool = False

    @property
    def reasons(self) -> list[str]:
        """What is wrong, and what to do, in a sentence each; empty if nothing is."""
        found = []
        if self.repeats > LARGEST_SHARE:
            remedy = (
                "for uneven times: cut rests out, or keep the path alone, with retimed"
                if self.uneven
                else "thin them with without_repeats"
            )
            found.append(
                f"{100.0 * self.repeats:.0f} % of the samples repeat the one"
                f" before{', ' if self.uneven else ': '}{remedy}"
            )
        if self.jumps:
            where = f"{len(self.jumps)} in all, the first at sample {self.jumps[0]}"
            found.append(
                f"jumps of up to {self.largest_jump:.3g}, {where}: cut there, or leave it out"
            )
        coarsest = max(self.quantum, default=0.0)
        if coarsest:
            least = coarsest / np.sqrt(12.0)  # the standard deviation of rounding
            found.append(
                f"quantised in steps of {coarsest:.3g}: give smooth_derivatives a noise of at"
                f" least {least:.2g}"
            )
        return found


def find_faults(time: ArrayLike, samples: ArrayLike) -> SampleFaults:
    """Repeats, jumps and quantisation of samples (n, d) at stamps (n,) [s], n >= 2."""
    samples = as_samples(samples, "samples")
    time = as_stamps(time, len(samples), 2)
    kept = _kept(samples)
    jumps = kept[_jumps(time[kept], samples[kept])]
    sizes = np.linalg.norm(samples[jumps] - samples[jumps - 1], axis=1)
    quantum = tuple(_quantum(column) for column in samples.T)
    uneven = _repeats(samples[kept]) > LARGEST_SHARE
    return SampleFaults(
        _repeats(samples),
        _held(samples),
        tuple(jumps.tolist()),
        float(sizes.max(initial=0.0)),
        quantum,
        uneven,
    )


def without_repeats(time: ArrayLike, samples: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (m,) and samples (m, d) with each measurement once, at the stamp at which it was new;
    a rest keeps samples at that rate.
    """
    samples = as_samples(samples, "samples")
    time, kept = as_stamps(time, len(samples)), _kept(samples)
    return time[kept], samples[kept]


def retimed(samples: ArrayLike, duration: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (n,) [s] and positions (n, d) of a movement along the path of samples whose stamps
    say nothing, from rest to rest.

    The length s of the path that is covered follows the law of least jerk (Flash and Hogan,
    Journal of Neuroscience 5, 1985), s / L = 10 u^3 - 15 u^4 + 6 u^5 with u = t / duration.
    Samples that repeat take no time, and a jump is crossed on a straight line.

    Parameters
    ----------
    samples
        (m, d), coordinates in one unit.
    duration
        Of the movement [s].
    n
        How many stamps, at least 2, from 0 to `duration`.

    Raises
    ------
    ValueError
        If the samples do not move.
    """
    samples, duration, n = (
        as_samples(samples, "samples"),
        as_number(duration, "duration"),
        as_count(n, "n", 2),
    )
    steps = np.linalg.norm(np.diff(samples, axis=0), axis=1)
    if not steps.any():
        raise ValueError(f"samples must move to have a path, got {len(samples)} at one place")
    new = np.concatenate([[True], steps > 0.0])
    length = np.cumsum(np.concatenate([[0.0], steps]))[new]
    u = np.linspace(0.0, 1.0, n)
    covered = length[-1] * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    return duration * u, np.column_stack(
        [np.interp(covered, length, column) for column in samples[new].T]
    )


def _repeats(samples: np.ndarray) -> float:
    """Share of the samples that repeat the one before, from the first to the last that moves."""
    same = np.all(samples[1:] == samples[:-1], axis=1)
    moving = np.flatnonzero(~same)
    return float(same[moving[0] : moving[-1] + 1].mean()) if len(moving) else 0.0


def _runs(samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First index and length of each run of equal samples."""
    first = np.flatnonzero(np.concatenate([[True], np.any(samples[1:] != samples[:-1], axis=1)]))
    return first, np.diff(np.append(first, len(samples)))


def _held(samples: np.ndarray) -> int:
    """Median length of the runs, those at the start and end left out, since these may be rests or
    cut.
    """
    inner = _runs(samples)[1][1:-1]
    return int(np.median(inner)) if len(inner) else 1


def _kept(samples: np.ndarray) -> np.ndarray:
    """Indices of the first sample of each run, and in long runs of one in `held` where a whole
    period follows.
    """
    (first, length), held = _runs(samples), _held(samples)
    index = np.arange(len(samples))
    offset, whole = index - np.repeat(first, length), np.repeat(length, length)
    return np.flatnonzero((offset == 0) | ((offset % held == 0) & (whole - offset >= held)))


def _jumps(time: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Indices of the samples whose step is JUMP times as fast as the AROUND steps before it, and
    after it.
    """
    speed = np.linalg.norm(np.diff(samples, axis=0), axis=1) / np.diff(time)
    if len(speed) < 2 * AROUND + 1:
        return np.zeros(0, dtype=int)
    medians = np.median(np.lib.stride_tricks.sliding_window_view(speed, AROUND), axis=1)
    place = np.arange(len(speed))
    before, after = (
        medians[np.clip(place - AROUND, 0, len(medians) - 1)],
        medians[np.clip(place + 1, 0, len(medians) - 1)],
    )
    usual = np.maximum(np.maximum(before, after), np.median(speed))
    return np.flatnonzero(speed > JUMP * usual) + 1


def _quantum(column: np.ndarray) -> float:
    """The number of which all differences of the samples (n,) are multiples; 0 if there is none,
    or if it is fine.
    """
    levels = np.unique(column)
    gaps = np.diff(levels)
    rounding = 8.0 * np.finfo(float).eps * np.abs(levels).max()
    gaps = gaps[gaps > rounding]
    if len(gaps) < 3:
        return 0.0
    least = float(gaps.min())
    multiples = gaps / least
    regular = (
        np.abs(multiples - np.round(multiples)).max() < 1e-3 and np.ptp(levels) / least < COARSE
    )
    return least if regular else 0.0
