"""Faults of recorded poses: found by what a body can do and a camera system would do, and repaired
where nothing has to be guessed.

What drivers are known for: poses of a lost body repeated with new stamps, or sent as zeros; stamps
of the moment of receipt, which jitter; late and doubled messages; two bodies that exchange their
names. Nothing is filled in: a sample is kept, moved in time, moved to the body that it belongs to,
or left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from dart_skill.common.constants import GRAVITY
from dart_skill.recording.imports.clocks import PAUSE, bunched, rate_of
from dart_skill.recording.imports.faults import BACKWARDS, GAP, Fault, spans
from dart_skill.recording.imports.pose_stream import PoseStream, find_leaps

LATEST = 0.5
"""Longest delay of a message that is sorted in [s]."""
LEAST_RUN = 20
"""Fewest samples from which the frame rate is found."""
STRAY_RMS = 0.02
"""Root mean square of stamps about a regular grid beyond which they jitter [periods]."""
STRAY_MAX = 0.1
"""Largest deviation of a stamp from a regular grid of stamps that do not jitter [periods]."""
EARLY = 0.05
"""How far a stamp may lie before the earliest ones without being the late stamp of the frame
before [periods].
"""
TELLING_FRAMES = 0.15
"""Deviation of stamps up to which a late frame is not taken for a missing one [periods]."""
LEAST_COHERENCE = 0.35
"""Least coherence of stamps with a grid, 1 for no jitter, that makes a frame rate."""
CHUNK = 10.0
"""Time over which a camera's clock and the computer's run alike to a small part of a period [s]."""
FARTHEST_JUMP = 0.01
"""Deviation up to which a lone sample is no outlier [m]."""
LARGEST_TURN = 0.1
"""The same of an orientation [rad]."""
JUMP = 6.0
"""The same in usual steps."""
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


def repair(streams: Mapping[str, PoseStream]) -> tuple[dict[str, PoseStream], list[Fault]]:
    """Streams by body without their faults, and the faults, each body's in order of time.

    The poses are in Z-up axes and the ball is called `ball`: a free flight tells it from another
    body. A stream without faults comes back as it is, to the last bit.
    """
    faults: list[Fault] = []
    bodies = dict(streams)
    for body in bodies:
        for step in (_without_invalid, _in_order, _without_stale, _on_grid):
            bodies[body], found = step(bodies[body])
            faults += found
    for one, other in combinations(bodies, 2):
        bodies[one], bodies[other], found = _unswapped(bodies[one], bodies[other])
        faults += found
    for body in bodies:
        for step in (_without_leaps, _without_outliers):
            bodies[body], found = step(bodies[body])
            faults += found
        faults += _gaps(bodies[body])
    return bodies, sorted(faults, key=lambda fault: (fault.body, fault.start_ns, fault.kind))


# what no camera would report


def _without_invalid(stream: PoseStream) -> tuple[PoseStream, list[Fault]]:
    finite = np.isfinite(stream.position).all(axis=1) & np.isfinite(stream.quaternion).all(axis=1)
    norm = np.linalg.norm(np.where(finite[:, None], stream.quaternion, 0.0), axis=1)
    zero = finite & (norm < 1e-6)
    faults = _of_spans(
        "not_finite", stream, ~finite, "{count} poses that are not finite are left out", True
    )
    if zero.any() and zero.sum() == finite.sum() and np.ptp(stream.position[finite], axis=0).any():
        text = "no orientation was recorded, only positions: it is taken to be that of the axes"
        faults.append(_fault("zero_pose", stream, 0, len(stream) - 1, text, True, int(zero.sum())))
        stream = replace(
            stream, quaternion=np.where(zero[:, None], [0.0, 0.0, 0.0, 1.0], stream.quaternion)
        )
        return stream.take(finite), faults
    faults += _of_spans(
        "zero_pose",
        stream,
        zero,
        "{count} poses without an orientation (zeros for a lost body) are left out",
        True,
    )
    wrong = finite & ~zero & (np.abs(norm - 1.0) > 0.1)
    faults += _of_spans(
        "not_unit", stream, wrong, "{count} quaternions are far from norm 1 and are left out", True
    )
    rough = finite & ~zero & ~wrong & (np.abs(norm - 1.0) > 1e-3)
    faults += _of_spans(
        "not_unit", stream, rough, "{count} quaternions are off norm 1 and are normalised", True
    )
    if rough.any():
        scale = np.where(rough, norm, 1.0)[:, None]
        stream = replace(stream, quaternion=stream.quaternion / scale)
    kept = finite & ~zero & ~wrong
    return (stream if kept.all() else stream.take(kept)), faults


# the order of stamps


def _in_order(stream: PoseStream) -> tuple[PoseStream, list[Fault]]:
    """Late messages sorted in, exact copies left out. Different poses of one stamp stay: a frame
    rate may tell their instants.
    """
    faults: list[Fault] = []
    if np.any(np.diff(stream.stamp_ns) < 0):
        stream, faults = _sorted(stream)
    copies = np.concatenate([[False], (np.diff(stream.stamp_ns) == 0) & _same_as_before(stream)])[
        : len(stream)
    ]
    stream, found = _left_out(
        "repeated_stamp", stream, copies, "{count} copies of a message are left out"
    )
    return stream, faults + found


def _sorted(stream: PoseStream) -> tuple[PoseStream, list[Fault]]:
    stamps, order = stream.stamp_ns, np.argsort(stream.stamp_ns, kind="stable")
    latest = np.maximum.accumulate(stamps)
    late = stamps < latest
    # of each stretch within which samples change places
    last = np.flatnonzero(np.maximum.accumulate(order) == np.arange(len(stamps)))
    first = np.concatenate([[0], last[:-1] + 1])
    usual = float(np.median(_steps(stream.position)))
    index, faults = [], []
    for begin, end in zip(first, last, strict=True):
        places = np.arange(begin, end + 1)
        moved = places[late[begin : end + 1]]
        if not len(moved):
            index.append(places)
            continue
        by = float((latest - stamps)[moved].max()) * 1e-9
        before, after = (
            np.arange(max(begin - 1, 0), begin),
            np.arange(end + 1, min(end + 2, len(stamps))),
        )
        way, sorted_way = (
            _steps(stream.position[np.concatenate([before, rows, after])]).sum()
            for rows in (places, order[begin : end + 1])
        )
        safe = by <= LATEST and sorted_way <= way + 5.0 * usual
        what = (
            "sorted in"
            if safe
            else "left out: their poses do not fit there, so it is the clock that went back"
        )
        text = f"{len(moved)} stamps run backwards, by at most {1e3 * by:.1f} ms; {what}"
        faults.append(
            Fault(
                BACKWARDS,
                stream.body,
                int(stamps[moved].min()),
                int(stamps[moved].max()),
                len(moved),
                text,
                safe,
            )
        )
        index.append(order[begin : end + 1] if safe else places[~late[begin : end + 1]])
    return stream.take(np.concatenate(index)), faults


# poses that are repeated


def _same_as_before(stream: PoseStream) -> np.ndarray:
    """Whether each pose but the first has the bits of the one before it (n - 1,)."""
    rows = np.hstack([stream.position, stream.quaternion])
    return (rows[1:] == rows[:-1]).all(axis=1)


def _without_stale(stream: PoseStream) -> tuple[PoseStream, list[Fault]]:
    """Without the last pose repeated again and again, as drivers do for a body that they have
    lost.

    A body at rest may repeat its pose by itself, if its poses are rounded or have no noise. They
    are rounded if it comes back to poses that it had before; they have no noise if it never moves
    to and fro. A repeated pose that ends in a leap is stale in any case.
    """
    same = _same_as_before(stream)
    if not same.any():
        return stream, []
    stale = np.zeros(len(stream), dtype=bool)
    natural = _is_rounded(stream, same) or _is_smooth(stream, same)
    steps = _steps(stream.position)
    changes = np.abs(np.diff(stream.position, axis=0))
    grain = float(changes[changes > 0.0].min(initial=np.inf))
    for first, last in spans(same):  # samples first + 1 to last + 1 repeat sample `first`
        following = steps[last + 2 : last + 5]
        leap = (
            last + 1 < len(steps)
            and len(following) > 0
            and steps[last + 1] > max(1.4 * np.median(following), 10.0 * grain)
        )
        stale[first + 1 : last + 2] = leap or not natural
    return _left_out(
        "stale",
        stream,
        stale,
        "the same pose again, {count} times with new stamps (a lost body): left out",
    )


def _is_rounded(stream: PoseStream, same: np.ndarray) -> bool:
    poses = stream.position[np.concatenate([[True], ~same])]
    returns = len(poses) - len(np.unique(poses, axis=0))
    return 2 * returns >= len(spans(same))


def _is_smooth(stream: PoseStream, same: np.ndarray) -> bool:
    steps = np.diff(stream.position, axis=0)[~same]
    turns = np.einsum("ij,ij->i", steps[1:], steps[:-1]) < 0.0
    return len(steps) < LEAST_RUN or float(np.mean(turns)) < 0.05


# jittered stamps


def _on_grid(stream: PoseStream) -> tuple[PoseStream, list[Fault]]:
    """Stamps at a steady frame rate, where it is clear which frame each belongs to; of poses with
    one stamp only the first if it is not.
    """
    doubled = np.concatenate([[False], np.diff(stream.stamp_ns) == 0])[: len(stream)]
    time = (stream.stamp_ns - stream.stamp_ns[:1]) * 1e-9
    runs = [run for run in _runs(time) if np.sum(~doubled[run]) >= LEAST_RUN]
    if (bursts := bunched(stream.body, stream.stamp_ns)) is not None:
        return stream, bursts[1]
    if not runs or _all_regular(time[~doubled]):
        return _first_of_a_stamp(stream, doubled)
    period, coherence = _frame_period(time, runs)
    if coherence < LEAST_COHERENCE:
        steps = np.diff(time)
        text = (
            f"stamps follow no steady frame rate: {1e3 * np.median(steps):.2f} ms apart in the"
            f" median, at most {1e3 * steps.max():.0f} ms"
        )
        stream, faults = _first_of_a_stamp(stream, doubled)
        return stream, [*faults, _fault("jitter", stream, 0, len(stream) - 1, text, False)]
    frames = [(run, *_frames(time[run], period)) for run in runs]
    stray = np.concatenate([time[run] - grid for run, grid, _ in frames]) / period
    if np.sqrt(np.mean(stray**2)) < STRAY_RMS and np.abs(stray).max() < STRAY_MAX:
        return _first_of_a_stamp(stream, doubled)
    return _restamped(stream, doubled, frames, period)


def _restamped(
    stream: PoseStream, doubled: np.ndarray, frames: list, period: float
) -> tuple[PoseStream, list[Fault]]:
    stamps, faults, dropped = stream.stamp_ns.copy(), [], doubled.copy()
    for run, grid, clear in frames:
        stray = (stream.stamp_ns[run] - stream.stamp_ns[0]) * 1e-9 - grid
        moved = int(np.sum(np.abs(stray) > STRAY_RMS * period))
        if not moved:
            continue
        rms, most = 1e3 * np.sqrt(np.mean(stray**2)), 1e3 * np.abs(stray).max()
        text = f"stamps stray by {rms:.2f} ms rms, at most {most:.1f} ms, from {1 / period:.2f} Hz"
        text += (
            "; put on the grid"
            if clear
            else "; left as they are: it is not clear which frames are missing"
        )
        faults.append(_fault("jitter", stream, run.start, run.stop - 1, text, clear, moved))
        if clear:
            stamps[run] = stream.stamp_ns[0] + np.rint(1e9 * grid).astype(np.int64)
            dropped[run] = False
    faults += _of_spans(
        "repeated_stamp",
        stream,
        doubled & ~dropped,
        "{count} poses with the stamp of another: their frame was found",
        True,
    )
    stream, found = _first_of_a_stamp(replace(stream, stamp_ns=stamps), dropped)
    return stream, faults + found


def _first_of_a_stamp(stream: PoseStream, doubled: np.ndarray) -> tuple[PoseStream, list[Fault]]:
    text = (
        "{count} other poses with the stamp of the one before: left out, and nobody knows which of"
        " them was right"
    )
    return _left_out("repeated_stamp", stream, doubled, text, False)


def _all_regular(time: np.ndarray) -> bool:
    """Whether every run of stamps (n,) is a grid of the median step already."""
    step = float(np.median(np.diff(time)))
    begins = np.concatenate(
        [np.full(run.stop - run.start, time[run.start]) for run in _runs(time)]
    )
    frames = (time - begins) / step
    return bool(np.abs(frames - np.rint(frames)).max() < STRAY_RMS)


def _frame_period(time: np.ndarray, runs: list[slice]) -> tuple[float, float]:
    """The period [s] that stamps of several runs agree with best, and how well: 1 for no jitter.

    As in a periodogram: the stamps as phases of a trial period, summed over stretches of CHUNK
    seconds.
    """
    parts = [part for run in runs for part in _chunks(time[run]) if len(part) >= LEAST_RUN] or [
        time[run] for run in runs
    ]
    steps = np.concatenate([np.diff(part) for part in parts])
    longest = max(float(np.ptp(part)) for part in parts)
    best = (0.0, 0.0)
    for guess in {float(np.median(steps)), float(np.mean(steps))}:
        if guess <= 0.0:
            continue
        trials = guess + np.arange(-0.06 * guess, 0.06 * guess, guess**2 / (8.0 * longest))
        score = sum(
            np.abs(np.exp(2j * np.pi * np.outer(1.0 / trials, part)).sum(axis=1)) for part in parts
        )
        k = int(np.argmax(score))
        best = max(best, (float(score[k] / sum(len(part) for part in parts)), float(trials[k])))
    return best[1], best[0]


def _chunks(time: np.ndarray) -> list[np.ndarray]:
    return np.split(time, np.searchsorted(time, np.arange(time[0] + CHUNK, time[-1], CHUNK)))


def _frames(time: np.ndarray, period: float) -> tuple[np.ndarray, bool]:
    """Regular instants (n,) [s] of the stamps of a run, and whether it is clear which frames they
    are.

    A message may be late, never early: it belongs to the last frame that it can follow. And of
    stamps that fall to one frame the last one is its own, and those before it move back: after a
    stall the frames that come at once are sorted out from the end. That is clear unless a frame is
    missing just there, or frames are missing at all while stamps stray by so much that a late one
    looks like the next.
    """
    phasors = [np.exp(2j * np.pi * part / period).sum() for part in _chunks(time)]
    phase = np.unwrap(np.angle(phasors)) * period / (2 * np.pi)
    middles = np.array([part.mean() if len(part) else np.nan for part in _chunks(time)])
    seen = np.isfinite(middles)
    drift, offset = (
        np.polyfit(middles[seen], phase[seen], 1, w=np.abs(phasors)[seen])
        if seen.sum() > 1
        else (0.0, float(phase[0]))
    )
    place = (time - offset - drift * time) / period
    earliest = np.quantile(place - np.rint(place), 0.02) - EARLY
    nearest = np.floor(place - earliest).astype(int)
    places = np.arange(len(time))
    number = np.minimum.accumulate((nearest - places)[::-1])[::-1] + places
    late = spans(number < nearest)
    clear = all(first > 0 and number[first] - number[first - 1] == 1 for first, _ in late)
    in_time = number == nearest
    clear = clear and bool(
        np.all(np.diff(number) == 1) or np.std((place - number)[in_time]) < TELLING_FRAMES
    )
    sure = in_time & (np.abs(place - number) < 0.25)
    line = np.polynomial.Polynomial.fit(number[sure], time[sure], 1) if sure.sum() > 2 else None
    return (number * period + offset if line is None else line(number)), clear


# bodies that exchange their names


def _unswapped(one: PoseStream, other: PoseStream) -> tuple[PoseStream, PoseStream, list[Fault]]:
    """Two streams with the poses exchanged that belong to the other body.

    Between two frames either each name goes on from its own pose or each goes on from the other's.
    By the triangle inequality bodies that move alike can never seem to have changed places, so a
    way that is half as long means that they did. The wrong one of two stretches is the one without
    free flight, if one of the bodies is the ball, and else the one that is much shorter.
    """
    if min(len(one), len(other)) < LEAST_RUN:
        return one, other, []
    period = 1e-9 * float(np.median(np.diff(one.stamp_ns)))
    i, j = _matched(one.stamp_ns, other.stamp_ns, round(0.3e9 * period))
    if len(i) < LEAST_RUN:
        return one, other, []
    a, b, stamps = one.position[i], other.position[j], one.stamp_ns[i]
    straight = _steps(a) + _steps(b)
    crossing = _distance(b[1:], a[:-1]) + _distance(a[1:], b[:-1])
    changes = (straight > 2.0 * crossing) & (straight - crossing > CLOSE)
    exchanged, faults = [], []
    pieces = _pieces(one, period), _pieces(other, period)
    for run in _runs_of_both(stamps, pieces[0][i], pieces[1][j]):
        crossed = np.concatenate([[0], np.cumsum(changes[run.start : run.stop - 1])]) % 2 == 1
        wrong, sure, why = _which_is_wrong(
            one.body, other.body, a[run], b[run], stamps[run], period, crossed
        )
        for first, last in spans(wrong):
            first, last = first + run.start, last + run.start
            text = f"{last - first + 1} frames under each other's names, told by {why}"
            names = f"{one.body} and {other.body}"
            text = (
                f"{names}: {text}"
                if sure
                else f"{names}: two stretches are exchanged, and nothing tells which of them"
            )
            faults.append(
                Fault(
                    "swap",
                    names,
                    int(stamps[first]),
                    int(stamps[last]),
                    int(last - first + 1),
                    text,
                    sure,
                )
            )
            if sure:
                exchanged.append(_Span.of(stamps, run, first, last))
    return (*_exchanged((one, other), pieces, exchanged, round(0.3e9 * period)), faults)


@dataclass(frozen=True)
class _Span:
    """Stamps of an exchanged stretch: of the last clear frame before it, its first, its last, the
    first clear frame after it; nan at the ends of a run, where it goes on as long as one of the
    bodies is seen without a break.
    """

    before: float
    start: int
    stop: int
    after: float

    @classmethod
    def of(cls, stamps: np.ndarray, run: slice, first: int, last: int) -> _Span:
        before = np.nan if first == run.start else stamps[first - 1]
        return cls(
            before,
            int(stamps[first]),
            int(stamps[last]),
            np.nan if last == run.stop - 1 else stamps[last + 1],
        )

    def parts(
        self, stamps: np.ndarray, piece: np.ndarray, margin: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Samples of a stream that belong to it, and samples that may belong to it."""
        inside = (stamps >= self.start - margin) & (stamps <= self.stop + margin)
        rows = np.flatnonzero(inside)
        if np.isnan(self.before):
            inside |= (stamps < self.start) & (piece == piece[rows[0]])
        if np.isnan(self.after):
            inside |= (stamps > self.stop) & (piece == piece[rows[-1]])
        unclear = (stamps > np.nan_to_num(self.before, nan=self.start) + margin) & (
            stamps < np.nan_to_num(self.after, nan=self.stop) - margin
        )
        return inside, unclear & ~inside


def _pieces(stream: PoseStream, period: float) -> np.ndarray:
    """Number of the unbroken piece of path that each sample (n,) lies on."""
    steps = np.diff(stream.stamp_ns) * 1e-9
    broken = (steps > 3.5 * period) | (_steps(stream.position) > CLOSE + FASTEST * steps)
    return np.concatenate([[0], np.cumsum(broken)])


def _runs_of_both(stamps: np.ndarray, one: np.ndarray, other: np.ndarray) -> list[slice]:
    """Stretches of frames (n,) within which it is known how the names go on: no pause, or one of
    the bodies was seen all the time.
    """
    return _stretches((np.diff(stamps) * 1e-9 > PAUSE) & (np.diff(one) > 0) & (np.diff(other) > 0))


def _which_is_wrong(
    one: str,
    other: str,
    a: np.ndarray,
    b: np.ndarray,
    stamps: np.ndarray,
    period: float,
    crossed: np.ndarray,
) -> tuple[np.ndarray, bool, str]:
    """Frames (n,) of a run that bear the wrong names, whether that is sure, and what tells."""
    if "ball" in (one, other):
        ball, body = (b, a) if other == "ball" else (a, b)
        ball, body = np.where(crossed[:, None], body, ball), np.where(crossed[:, None], ball, body)
        flying = _frames_in_flight(stamps, ball, period) - _frames_in_flight(stamps, body, period)
        if abs(flying) >= SURE_FRAMES:
            return (crossed if flying > 0 else ~crossed), True, "free flight"
    share = float(np.mean(crossed))
    wrong = crossed if share <= 0.5 else ~crossed
    return wrong, min(share, 1.0 - share) < 0.4, "continuity"


def _frames_in_flight(stamps: np.ndarray, position: np.ndarray, period: float) -> int:
    """How many stretches of FLYING_FRAMES frames fall freely."""
    if len(stamps) < FLYING_FRAMES:
        return 0
    half = FLYING_FRAMES // 2
    whole = stamps[FLYING_FRAMES - 1 :] - stamps[: 1 - FLYING_FRAMES] < 1e9 * period * (
        FLYING_FRAMES - 0.5
    )
    places = np.arange(-half, half + 1)
    # second derivative of the parabola through the samples
    weights = np.linalg.pinv(np.vander(places * period, 3))[0] * 2.0
    windows = np.lib.stride_tricks.sliding_window_view(position, FLYING_FRAMES, axis=0)
    acceleration = windows @ weights
    return int(
        np.sum(whole & (_distance(acceleration, np.array([0.0, 0.0, -GRAVITY])) < NEAR_GRAVITY))
    )


def _exchanged(
    streams: tuple, pieces: tuple, stretches: list[_Span], margin: int
) -> tuple[PoseStream, PoseStream]:
    """Both streams with the samples of some spans given to each other. What lies between frames of
    one kind and the other, with no partner to tell its kind, is left out.
    """
    if not stretches:
        return streams
    given, kept = [], []
    for stream, piece in zip(streams, pieces, strict=True):
        inside, unclear = np.zeros((2, len(stream)), dtype=bool)
        for span in stretches:
            its, doubtful = span.parts(stream.stamp_ns, piece, margin)
            inside |= its
            unclear |= doubtful
        given.append(stream.take(inside))
        kept.append(stream.take(~inside & ~unclear))
    return _joined(kept[0], given[1]), _joined(kept[1], given[0])


def _joined(stream: PoseStream, more: PoseStream) -> PoseStream:
    stamps = np.concatenate([stream.stamp_ns, more.stamp_ns])
    position = np.concatenate([stream.position, more.position])
    quaternion = np.concatenate([stream.quaternion, more.quaternion])
    return replace(stream, stamp_ns=stamps, position=position, quaternion=quaternion).take(
        np.argsort(stamps, kind="stable")
    )


def _matched(one: np.ndarray, other: np.ndarray, tolerance: int) -> tuple[np.ndarray, np.ndarray]:
    """Indices of stamps (n,), (m,) that are at most a tolerance apart, each used once."""
    j = np.clip(np.searchsorted(other, one), 1, len(other) - 1)
    j -= one - other[j - 1] < other[j] - one
    near = np.abs(other[j] - one) <= tolerance
    near[1:] &= ~((j[1:] == j[:-1]) & near[:-1])
    return np.flatnonzero(near), j[near]


# orientations that leap, lone samples, and missing ones


def _without_leaps(stream: PoseStream) -> tuple[PoseStream, list[Fault]]:
    """Orientations that leapt to another solution brought back to the one that was seen more
    often.
    """
    found = find_leaps(stream)
    if found is None:
        return stream, []
    first, last = np.flatnonzero(found.leapt)[[0, -1]]
    text = (
        "the orientation of {count} poses leapt between two solutions,"
        f" {np.degrees(found.angle):.0f} degrees apart, as of markers that look the same after"
        " this turn: brought back to "
        + (
            "the one that was seen more often"
            if found.is_clear
            else "one of them, and nothing tells whether it is the right one"
        )
    )
    fault = _fault(
        "leap", stream, int(first), int(last), text, found.is_clear, int(found.leapt.sum())
    )
    return found.mended(stream), [fault]


def _without_outliers(stream: PoseStream) -> tuple[PoseStream, list[Fault]]:
    """Without lone samples that jump away and back."""
    if len(stream) < LEAST_RUN:
        return stream, []
    p, q = stream.position, stream.quaternion
    lone = _jumps(_steps(p), _distance(p[2:], p[:-2]), FARTHEST_JUMP)
    lone |= _jumps(_angle(q[1:], q[:-1]), _angle(q[2:], q[:-2]), LARGEST_TURN)
    near = np.diff(stream.stamp_ns) < 3.5 * np.median(np.diff(stream.stamp_ns))
    lone[1:-1] &= near[1:] & near[:-1]
    return _left_out("outlier", stream, lone, "{count} poses jump away and back: left out")


def usual_steps(steps: np.ndarray) -> np.ndarray:
    """The median (n,) of each of steps (n,), the five before it and the five after it; beyond an
    end, that end counts for them.
    """
    around = np.lib.stride_tricks.sliding_window_view(np.pad(steps, 5, mode="edge"), 11)
    return np.partition(around, 5, axis=1)[:, 5]


def _jumps(steps: np.ndarray, over: np.ndarray, least: float) -> np.ndarray:
    """Which samples (n,) are far from both neighbours while these are close: steps (n - 1,)
    between neighbours, `over` (n - 2,) one.
    """
    usual = usual_steps(steps)
    jump = np.minimum(steps[1:], steps[:-1])
    lone = np.zeros(len(steps) + 1, dtype=bool)
    lone[1:-1] = (
        (jump > least) & (jump > JUMP * np.minimum(usual[1:], usual[:-1])) & (over < 0.5 * jump)
    )
    return lone


def _gaps(stream: PoseStream) -> list[Fault]:
    if len(stream) < 3:
        return []
    steps = np.diff(stream.stamp_ns)
    rate = rate_of((stream.stamp_ns - stream.stamp_ns[0]) * 1e-9)
    usual = float(np.median(steps)) if rate is None else 1e9 * rate.interval
    period = usual if rate is None else 1e9 * rate.period
    return [
        _fault(
            GAP,
            stream,
            k,
            k + 1,
            f"not seen for {1e-9 * steps[k]:.3f} s",
            False,
            max(1, round(steps[k] / period) - 1),
        )
        for k in np.flatnonzero(steps > 1.5 * usual).tolist()
    ]


# small helpers


def _runs(time: np.ndarray) -> list[slice]:
    """Stretches of stamps (n,) [s] without a pause."""
    return _stretches(np.diff(time) > PAUSE)


def _stretches(ends: np.ndarray) -> list[slice]:
    """Stretches of samples (n,), which end where `ends` (n - 1,) is true."""
    edges = np.concatenate([[0], np.flatnonzero(ends) + 1, [len(ends) + 1]])
    return [
        slice(int(first), int(last)) for first, last in zip(edges[:-1], edges[1:], strict=True)
    ]


def _fault(
    kind: str,
    stream: PoseStream,
    first: int,
    last: int,
    text: str,
    repaired: bool,
    count: int | None = None,
) -> Fault:
    count = last - first + 1 if count is None else count
    stamps = stream.stamp_ns
    return Fault(
        kind,
        stream.body,
        int(stamps[first]),
        int(stamps[last]),
        count,
        text.format(count=count),
        repaired,
    )


def _of_spans(
    kind: str, stream: PoseStream, mask: np.ndarray, text: str, repaired: bool
) -> list[Fault]:
    return [_fault(kind, stream, first, last, text, repaired) for first, last in spans(mask)]


def _left_out(
    kind: str, stream: PoseStream, mask: np.ndarray, text: str, repaired: bool = True
) -> tuple[PoseStream, list[Fault]]:
    """The stream without the samples of a mask, and a fault for each stretch of them."""
    return (stream.take(~mask) if mask.any() else stream), _of_spans(
        kind, stream, mask, text, repaired
    )


def _steps(position: np.ndarray) -> np.ndarray:
    """Way from each position (n, 3) to the next one."""
    return _distance(position[1:], position[:-1])


def _distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.linalg.norm(a - b, axis=-1)


def _angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles between orientations (n, 4) [rad]."""
    return 2.0 * np.arccos(np.clip(np.abs(np.einsum("ij,ij->i", a, b)), 0.0, 1.0))
