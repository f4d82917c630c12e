"""Movements that go somewhere, repeat there, and go away again: where in a demonstration they repeat,
and a clock that sets off and stops without a jump.

Where a movement repeats, it comes back after a period to where it was, by a way that is much longer
than what it is then off by. The period is refined by least squares with a harmonic series
(`estimate_period`); the phases of several demonstrations are brought together by circular
correlation of one period of each. Both are usual in the analysis of rhythms, as by de Cheveigne and
Kawahara ("YIN, a fundamental frequency estimator", Journal of the Acoustical Society of America 111,
2002), whose difference function `estimate_period` begins with.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from dart_skill.movement._demonstrations import N_HARMONICS, estimate_period

CLOSES = 0.1
"""A movement has come back where it is off by less than this share of its way since then."""
LEAST_WAY = 0.02
"""Shorter ways are none [m]: noise comes back to itself, too."""
SHORTEST_PERIOD = 0.2
"""Shortest period of a movement that repeats [s]."""
LAGS = 60
"""Number of periods that are tried."""
FEWEST_TURNS = 2.0
"""Fewest periods that a demonstration must show."""
UNDER_WAY = 0.3
"""A movement repeats from when it is faster than this share of its usual speed, until it is slower."""
SAME_SENSE = 0.8
"""Least correlation of a period of two demonstrations that show the same."""
PHASED = 3
"""How often a cycle is fitted again to samples where they are on it."""
SMOOTHED = 0.1
"""Corrections of phases are means over so large a share of a period."""
SLOWEST = 0.1
"""Least rate of the phase of a demonstration, in units of its mean."""
STARTS = 0.5
"""Share of a period that a rhythmic movement takes to set off, and to stop."""

RATE = Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
"""Rate of a clock that sets off, over the share of the time in which it does."""
GAINED = RATE.integ()
GROWTH = RATE.deriv()


class Turns(NamedTuple):
    """Where a movement repeats.

    * begin, end: first and last instant [s].
    * period: [s].
    """

    begin: float
    end: float
    period: float

    @property
    def number(self) -> float:
        """Number of periods between begin and end."""
        return (self.end - self.begin) / self.period


def find_turns(time: np.ndarray, position: np.ndarray) -> Turns:
    """Where a movement repeats.

    Parameters
    ----------
    time
        (n,) [s], equally spaced.
    position
        (n, d) [m].

    Raises
    ------
    ValueError
        If it does not, or not for long enough.
    """
    step = time[1] - time[0]
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1)))
    shortest, longest = SHORTEST_PERIOD / step, (len(time) - 1) / FEWEST_TURNS
    lags = np.unique(np.geomspace(shortest, max(longest, shortest), LAGS).astype(int))
    runs = [_longest_run(_comes_back(position, way, int(lag))) for lag in lags]
    turns = np.array(
        [(last - first + lag) / lag for (first, last), lag in zip(runs, lags, strict=True)]
    )
    # a movement that repeats after one period does so after two as well, and there are half as many
    best = int(turns.argmax())
    if turns[best] < FEWEST_TURNS:
        raise ValueError(
            f"the movement repeats {max(turns[best], 0.0):.1f} times in its {time[-1] - time[0]:.1f}"
            f" s: show at least {FEWEST_TURNS:.0f} turns, one after the other"
        )
    first, last = runs[best][0], min(runs[best][1] + int(lags[best]), len(time) - 1)
    first, last = _under_way(way, first, last, int(lags[best]))
    begin, seen = time[first], slice(first, last + 1)
    return Turns(begin, time[last], estimate_period(time[seen] - begin, position[seen]))


def _comes_back(position: np.ndarray, way: np.ndarray, lag: int) -> np.ndarray:
    """Whether a movement (n, d) is again where it was, so many samples later (n - lag,)."""
    off = np.linalg.norm(position[lag:] - position[:-lag], axis=1)
    gone = way[lag:] - way[:-lag]
    return (off < CLOSES * gone) & (gone > LEAST_WAY)


def _longest_run(true: np.ndarray) -> tuple[int, int]:
    """First and last index of the longest run; the last is before the first where there is none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(int)))
    if not len(edges):
        return 0, -len(true)
    starts, ends = edges[::2], edges[1::2]
    longest = int((ends - starts).argmax())
    return int(starts[longest]), int(ends[longest]) - 1


def _under_way(way: np.ndarray, first: int, last: int, lag: int) -> tuple[int, int]:
    """The first and last sample between two, at which a movement is as fast as it usually is."""
    width = max(lag // 8, 1)
    inner = np.arange(first, last - width + 1)
    fast = way[inner + width] - way[inner]
    quick = np.flatnonzero(fast > UNDER_WAY * np.median(fast))
    return int(inner[quick[0]]), int(inner[quick[-1]]) + width


def shift_between(cycle: np.ndarray, other: np.ndarray) -> float:
    """By what share of a period another cycle is behind one, so that `other` at a phase plus this
    is `cycle` at the phase.

    Parameters
    ----------
    cycle, other
        One period of each at the same equally spaced phases (n, d).

    Raises
    ------
    ValueError
        Where they are not the same movement, as of a circle in the other sense.
    """
    one, two = (rows - rows.mean(axis=0) for rows in (cycle, other))
    spectra = np.fft.rfft(one, axis=0).conj() * np.fft.rfft(two, axis=0)
    alike = np.fft.irfft(spectra.sum(axis=1), n=len(one))
    alike /= np.sqrt(np.square(one).sum() * np.square(two).sum())
    k = int(alike.argmax())
    if alike[k] < SAME_SENSE:
        raise ValueError(
            f"its turns are others than those of the first (their correlation is {alike[k]:.2f}, at"
            f" least {SAME_SENSE} for the same): show the same figure, in the same sense"
        )
    before, at, after = alike[k - 1], alike[k], alike[(k + 1) % len(alike)]
    curve = before - 2.0 * at + after
    finer = 0.5 * (before - after) / curve if curve else 0.0
    return float(((k + finer) / len(one)) % 1.0)


class HarmonicCycle:
    """A cycle as a harmonic series, by least squares from samples of one or several demonstrations.

    A person does not turn evenly, and sets off and stops. So after the first fit samples count where
    they are on the cycle, by projection on it, and the series is fitted again.

    Parameters
    ----------
    phases
        Of each demonstration (n,), in periods, increasing.
    rows
        Its samples (n, d), of which the first three are a place [m].

    Attributes
    ----------
    phases
        Of each demonstration, as they were found.
    """

    def __init__(self, phases: Sequence[np.ndarray], rows: Sequence[np.ndarray]):
        self.phases = list(phases)
        self._fit(rows)
        for _ in range(PHASED):
            self.phases = [
                self.phases_of(one, here) for one, here in zip(self.phases, rows, strict=True)
            ]
            self._fit(rows)

    def _fit(self, rows: Sequence[np.ndarray]) -> None:
        waves = _waves(np.concatenate(self.phases))[0]
        self._weights = np.linalg.lstsq(waves, np.concatenate(rows), rcond=None)[0]

    def at(self, phases: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The cycle and its first and second derivative by the phase (n, d), at phases (n,)."""
        values, slopes, curvatures = (waves @ self._weights for waves in _waves(phases))
        return values, slopes, curvatures

    def phases_of(self, phases: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Phases (n,) at which the cycle is nearest to samples (n, d), from others near them."""
        made, slope, _ = (one[:, :3] for one in self.at(phases))
        later = np.einsum("ni,ni->n", rows[:, :3] - made, slope) / np.square(slope).sum(1).mean()
        width = max(int(SMOOTHED * len(phases) / (phases[-1] - phases[0])), 1)
        kernel = np.ones(width)
        smooth = np.convolve(later, kernel, "same") / np.convolve(
            np.ones_like(later), kernel, "same"
        )
        steps = np.diff(phases + smooth)
        even = (phases[-1] - phases[0]) / (len(phases) - 1)
        return phases[0] + smooth[0] + np.append(0.0, np.cumsum(np.maximum(steps, SLOWEST * even)))


def _waves(phases: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One, and sines and cosines of the harmonics, at phases (n,), and two derivatives of them."""
    faster = 2.0 * np.pi * np.arange(1, N_HARMONICS + 1)
    angle = np.outer(phases, faster)
    sine, cosine, still = np.sin(angle), np.cos(angle), np.zeros((len(phases), 1))
    return (
        np.hstack([still + 1.0, sine, cosine]),
        np.hstack([still, faster * cosine, -faster * sine]),
        np.hstack([still, -(faster**2) * sine, -(faster**2) * cosine]),
    )


class SoftClock(NamedTuple):
    """A clock that goes from 0 to `length`, at rate 1 but for the time `ramp` in which it sets off,
    and that in which it stops: its rate and the change of that are 0 at both ends.

    * length: [s], at least `ramp`.
    * ramp: [s].
    """

    length: float
    ramp: float

    @property
    def duration(self) -> float:
        """From its first to its last instant [s]."""
        return self.length + self.ramp

    def at(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What it shows [s], its rate and the change of that [1/s], at instants (n,) [s]."""
        early = np.clip(time / self.ramp, 0.0, 1.0)
        late = np.clip((self.duration - time) / self.ramp, 0.0, 1.0)
        between = np.clip(time - self.ramp, 0.0, self.duration - 2.0 * self.ramp)
        shows = self.ramp * (GAINED(early) + 0.5 - GAINED(late)) + between
        return shows, RATE(np.minimum(early, late)), (GROWTH(early) - GROWTH(late)) / self.ramp
