"""Finding the motion in a recording by thresholds on the magnitude of the velocity (thesis 8.4.3,
figure 8.11).

Positions come at about 100 Hz, with noise, irregular stamps and gaps. The velocity along each axis
is the median of the slopes between all pairs of samples in a window (Theil-Sen). It needs no equal
spacing, and a single bad sample does not change it. The window is so wide that the noise, which is
told from the samples, stays well below the thresholds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_number, as_samples
from dart_skill.movement._differentiation import MIN_SAMPLES, estimate_noise
from dart_skill.movement._time import as_stamps

QUIET = 0.3
"""Share of the lower threshold that the noise of a speed may make."""
CREEPS = 0.05
"""Share of its fastest speed at which a hand is at rest that never comes below the threshold: soft
joints creep for seconds after a fast movement.
"""
BUNCHED = 0.3
"""Share of the mean step that the usual one is at least, unless stamps come in bursts."""
MOST_BESIDE = 60
"""Largest number of samples before and after one over which slopes are taken."""
MOST_PAIRS = 10**8
"""Largest number of pairs of samples over which slopes are taken, so that a wrong rate costs no
time.
"""


def speed(time: ArrayLike, positions: ArrayLike, window: float = 0.07) -> np.ndarray:
    """Magnitude (n,) of the velocity of positions (n, d) at stamps (n,) [s], from the samples
    within a window [s].
    """
    positions = as_samples(positions, "positions")
    time = as_stamps(time, len(positions), 3)
    half = max(1, round(as_number(window, "window") / _usual_step(time, window)) // 2)
    half = min(
        half, (len(time) - 1) // 2, MOST_BESIDE, max(10, math.isqrt(MOST_PAIRS // len(time)))
    )
    index = np.arange(len(time))[:, None] + np.arange(-half, half + 1)
    inside = (index >= 0) & (index < len(time))
    first, second = np.triu_indices(2 * half + 1, 1)
    index = np.clip(index, 0, len(time) - 1)
    steps = time[index[:, second]] - time[index[:, first]]
    steps = np.where(inside[:, first] & inside[:, second], steps, np.nan)
    velocity = [
        np.nanmedian((axis[index[:, second]] - axis[index[:, first]]) / steps, axis=1)
        for axis in positions.T
    ]
    return np.linalg.norm(velocity, axis=0)


def _usual_step(time: np.ndarray, window: float) -> float:
    """The usual step of stamps (n,) [s]; of stamps in bursts not that within a burst, of which a
    window [s] has no such number.
    """
    steps = np.diff(time)
    short = steps[steps <= window]
    return max(float(np.median(steps)), BUNCHED * float(np.mean(short)) if len(short) else 0.0)


@dataclass(frozen=True)
class Segment:
    """One motion in a recording.

    Parameters
    ----------
    motion_start
        Crossings of the thresholds, interpolated between samples.
    motion_stop : [s]
        Crossings of the thresholds, interpolated between samples.
    start
        The same with run-up and settling time, within the recording.
    stop : [s]
        The same with run-up and settling time, within the recording.
    first, last
        Indices of the first and last sample from start to stop; `samples` is the slice of them.
    peak_speed : [m/s]
    largest_gap : [s]
        Longest time between neighbouring samples from start to stop.
    """

    motion_start: float
    motion_stop: float
    start: float
    stop: float
    first: int
    last: int
    peak_speed: float
    largest_gap: float

    @property
    def samples(self) -> slice:
        return slice(self.first, self.last + 1)

    @property
    def duration(self) -> float:
        """Time from motion_start to motion_stop, seconds."""
        return self.motion_stop - self.motion_start

    def contains(self, instant: float) -> bool:
        """Whether an instant [s] is between start and stop, so within the margins, too."""
        return self.start <= instant <= self.stop


@dataclass(frozen=True)
class VelocityThreshold:
    """Segmentation by thresholds of the speed with hysteresis (thesis 8.4.3).

    A motion that has already begun at the first sample has no start and is left out.

    Parameters
    ----------
    start
        Float, default 0.3 [m/s]. A motion starts where the speed rises above it.
    stop
        Float, default 0.1 [m/s]. A motion stops where the speed falls below it.
    min_duration
        Float, default 0.2 [s]. Shorter motions are ignored.
    max_pause
        Float, default 0.15 [s]. A shorter rest does not end a motion, such as the turn between
        wind-up and throw.
    run_up
        Float, default 0.1 [s]. Margin before the start.
    settle
        Float, default 0.1 [s]. Margin after the stop.
    window
        Float, default 0.07 [s]. The speed is estimated from the samples within it; within a wider
        one if they are noisier than those of motion capture, see `window_for`.
    """

    start: float = 0.3
    stop: float = 0.1
    min_duration: float = 0.2
    max_pause: float = 0.15
    run_up: float = 0.1
    settle: float = 0.1
    window: float = 0.07

    def __post_init__(self) -> None:
        for name in ("start", "stop", "window"):
            as_number(getattr(self, name), name)
        for name in ("min_duration", "max_pause", "run_up", "settle"):
            as_number(getattr(self, name), name, strict=False)
        if self.stop > self.start:
            raise ValueError(
                f"stop threshold {self.stop:g} m/s is above the start threshold {self.start:g}"
                " m/s; lower it"
            )

    def segment(
        self, time: ArrayLike, positions: ArrayLike, instant: float | None = None
    ) -> list[Segment]:
        """Motions in positions (n, d) [m] at stamps (n,) [s], in order.

        Parameters
        ----------
        instant
            Of which the motion is wanted [s]: where it lies in one that is over, the last one need
            not be.

        Raises
        ------
        ValueError
            If nothing moved, or if the last motion does not stop within the recording.
        """
        positions = as_samples(positions, "positions")
        time = as_stamps(time, len(positions), 3)
        speeds = self.speeds(time, positions)
        spans = self._spans(time, speeds, instant)
        self._require_motion(time, speeds, spans)
        return [self._segment(time, speeds, begin, end) for begin, end in spans]

    def speeds(self, time: np.ndarray, positions: np.ndarray) -> np.ndarray:
        """The speed (n,) of positions (n, d) at stamps (n,) that the thresholds are held against."""
        return speed(time, positions, self.window_for(time, positions))

    def window_for(self, time: np.ndarray, positions: np.ndarray) -> float:
        """The window [s] for positions (n, d) at stamps (n,): wider than `window` only where the
        noise asks for it.

        The slope of a line through samples every T, with noise sigma, within a window w has the
        variance 12 sigma^2 T / w^3.
        """
        if len(time) < MIN_SAMPLES:
            return self.window
        noise, interval = float(estimate_noise(time, positions)), float(np.median(np.diff(time)))
        return max(
            self.window, float(np.cbrt(12.0 * interval * (noise / (QUIET * self.stop)) ** 2))
        )

    def _spans(
        self, time: np.ndarray, speeds: np.ndarray, instant: float | None
    ) -> list[tuple[int, int]]:
        """For each motion, indices of the first sample above `start` and of the first one below
        `stop` after it.
        """
        spans = self._merge(time, _hysteresis(speeds, self.start, self.stop))
        spans = [(begin, end) for begin, end in spans if begin > 0]
        over = [(begin, end) for begin, end in spans if end < len(time)]
        if instant is not None and any(time[begin] <= instant <= time[end] for begin, end in over):
            spans = over
        if spans and spans[-1][1] == len(time):
            spans[-1] = self._crept(speeds, spans[-1][0])
        if spans and spans[-1][1] == len(time):
            raise ValueError(
                f"the motion that starts at {time[spans[-1][0]]:.3f} s never falls below"
                f" {self.stop:g} m/s before the recording ends at {time[-1]:.3f} s (peak speed"
                f" {speeds[spans[-1][0] :].max():.3g} m/s, last {speeds[-1]:.3g} m/s); record"
                " longer or raise the stop threshold"
            )
        return [
            (begin, end) for begin, end in spans if time[end] - time[begin] >= self.min_duration
        ]

    def _crept(self, speeds: np.ndarray, begin: int) -> tuple[int, int]:
        """The span of a motion that does not come below `stop`, up to where an arm that only creeps
        has come to rest; up to the end of the recording if it has not.
        """
        peak = begin + int(speeds[begin:].argmax())
        slow = speeds[peak:] < CREEPS * speeds[peak]
        return begin, peak + int(slow.argmax()) if slow.any() else len(speeds)

    def _merge(self, time: np.ndarray, spans: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Spans, in which those that are less than max_pause apart are joined."""
        merged = spans[:1]
        for begin, end in spans[1:]:
            if time[begin] - time[merged[-1][1]] < self.max_pause:
                merged[-1] = (merged[-1][0], end)
            else:
                merged.append((begin, end))
        return merged

    def _require_motion(self, time: np.ndarray, speeds: np.ndarray, spans: list) -> None:
        if spans:
            return
        peak = int(speeds.argmax())
        seen = (
            f"peak speed {speeds[peak]:.3g} m/s at {time[peak]:.3f} s, start threshold"
            f" {self.start:g} m/s"
        )
        if speeds[peak] <= self.start:
            raise ValueError(
                f"nothing moved between {time[0]:.3f} and {time[-1]:.3f} s: {seen}; move the hand"
                " farther and faster, or check the tracking; a slow movement needs a lower"
                " start_threshold"
            )
        raise ValueError(
            f"no motion that starts after the first sample lasts {self.min_duration:g} s: {seen}; "
            "start recording earlier or lower min_duration"
        )

    def _segment(self, time: np.ndarray, speeds: np.ndarray, begin: int, end: int) -> Segment:
        motion_start = _crossing(time, speeds, begin, self.start)
        motion_stop = _crossing(time, speeds, end, self.stop)
        start, stop = (
            max(motion_start - self.run_up, time[0]),
            min(motion_stop + self.settle, time[-1]),
        )
        first, last = (
            int(np.searchsorted(time, start)),
            int(np.searchsorted(time, stop, side="right")) - 1,
        )
        return Segment(
            motion_start,
            motion_stop,
            float(start),
            float(stop),
            first,
            last,
            float(speeds[begin:end].max()),
            float(np.diff(time[first : last + 1]).max(initial=0.0)),
        )


def _hysteresis(speeds: np.ndarray, start: float, stop: float) -> list[tuple[int, int]]:
    """Spans [begin, end) from a sample above `start` to the first one after it below `stop`; end =
    n if there is none.
    """
    events = np.where(speeds > start, 1, np.where(speeds < stop, -1, 0))
    decided = np.flatnonzero(events)
    turns = decided[np.flatnonzero(np.diff(events[decided], prepend=-1))]
    bounds = [int(i) for i in turns] + [len(speeds)] * (len(turns) % 2)
    return list(zip(bounds[::2], bounds[1::2], strict=True))


def _crossing(time: np.ndarray, speeds: np.ndarray, index: int, threshold: float) -> float:
    """Stamp at which the speed passes the threshold between samples index - 1 and index."""
    before, after = speeds[index - 1], speeds[index]
    share = (threshold - before) / (after - before)
    return float(time[index - 1] + share * (time[index] - time[index - 1]))


def segment_containing(segments: Sequence[Segment], instant: float) -> Segment:
    """The segment that contains an instant [s], such as a release.

    Where the margins of two segments overlap, it is the one whose motion contains the instant.

    Raises
    ------
    ValueError
        If there is none.
    """
    inside = [one for one in segments if one.contains(instant)]
    if not inside:
        spans = ", ".join(f"{one.start:.3f} to {one.stop:.3f}" for one in segments) or "none"
        raise ValueError(f"no segment contains {instant:.3f} s; segments: {spans}")
    return max(inside, key=lambda one: one.motion_start <= instant <= one.motion_stop)
