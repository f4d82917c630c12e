"""Faults of recorded poses: found by what a body can do and a camera system would do, and repaired
where nothing has to be guessed.

What drivers are known for: poses of a lost body repeated with new stamps, or sent as zeros; stamps
of the moment of receipt, which jitter; late and doubled messages; two bodies that exchange their
names. Nothing is filled in: a sample is kept, moved in time, moved to the body that it belongs to,
or left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np

from dart_skill.common.constants import UNTURNED
from dart_skill.recording.imports._exchanged_bodies import unswapped
from dart_skill.recording.imports.clocks import PAUSE, bunched, rate_of
from dart_skill.recording.imports.faults import BACKWARDS, GAP, Fault, spans
from dart_skill.recording.imports.pose_stream import CLEARLY, PoseStream, find_leaps

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
"""Largest deviation of stamps with which a late frame is told from a missing one [periods]."""
LEAST_COHERENCE = 0.35
"""Least coherence of stamps with a grid, 1 for no jitter, that makes a frame rate."""
CHUNK = 10.0
"""Time over which a camera's clock and the computer's run alike to a small part of a period [s]."""
FARTHEST_JUMP = 0.01
"""Largest deviation of a lone sample that is no outlier [m]."""
LARGEST_TURN = 0.1
"""Largest deviation of the orientation of a lone sample that is no outlier [rad]."""
JUMP = 6.0
"""Largest deviation of a lone sample that is no outlier [usual steps]."""


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
        bodies[one], bodies[other], found = unswapped(bodies[one], bodies[other])
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
    moves = np.ptp(stream.position[finite], axis=0).any() if finite.any() else False
    never_turned = zero.any() and zero.sum() == finite.sum() and moves
    wrong = finite & ~zero & (np.abs(norm - 1.0) > 0.1)
    rough = finite & ~zero & ~wrong & (np.abs(norm - 1.0) > 1e-3)
    lost = np.zeros(len(stream), dtype=bool) if never_turned else zero
    faults = []
    for kind, mask, text in (
        ("not_finite", ~finite, "poses that are not finite are left out"),
        ("zero_pose", lost, "poses without an orientation (zeros for a lost body) are left out"),
        ("not_unit", wrong, "quaternions are far from norm 1 and are left out"),
        ("not_unit", rough, "quaternions are off norm 1 and are normalised"),
    ):
        faults += _of_spans(kind, stream, mask, "{count} " + text, True)
    if never_turned:
        faults.append(
            _fault(
                "zero_pose",
                stream,
                0,
                len(stream) - 1,
                "no orientation was recorded, only positions: it is taken to be that of the axes",
                True,
                int(zero.sum()),
            )
        )
        quaternion = np.where(zero[:, None], UNTURNED, stream.quaternion)
        stream = replace(stream, quaternion=quaternion)
    elif rough.any():
        scale = np.where(rough, norm, 1.0)[:, None]
        stream = replace(stream, quaternion=stream.quaternion / scale)
    kept = finite & ~lost & ~wrong
    return (stream if kept.all() else stream.take(kept)), faults


# the order of stamps


def _in_order(stream: PoseStream) -> tuple[PoseStream, list[Fault]]:
    """Late messages sorted in, exact copies left out. Different poses of one stamp stay: a frame
    rate may tell their instants.
    """
    faults: list[Fault] = []
    if np.any(np.diff(stream.stamp_ns) < 0):
        stream, faults = _sorted(stream)
    copies = _doubled(stream)
    copies[1:] &= _same_as_before(stream)
    stream, found = _left_out(
        "repeated_stamp", stream, copies, "{count} copies of a message are left out"
    )
    return stream, faults + found


def _doubled(stream: PoseStream) -> np.ndarray:
    """Whether each sample (n,) has the stamp of the one before it."""
    return np.concatenate([[False], np.diff(stream.stamp_ns) == 0])[: len(stream)]


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
        faults.append(
            Fault.of(
                BACKWARDS,
                stream.body,
                stamps[moved],
                f"{len(moved)} stamps run backwards, by at most {1e3 * by:.1f} ms; {what}",
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
    ways = np.diff(stream.position, axis=0)
    returns = np.sum(~same) + 1 - len(np.unique(stream.position, axis=0))
    is_rounded = 2 * returns >= len(spans(same))
    to_and_fro = np.einsum("ij,ij->i", ways[~same][1:], ways[~same][:-1]) < 0.0
    is_smooth = len(ways[~same]) < LEAST_RUN or float(np.mean(to_and_fro)) < 0.05
    steps, changes = _steps(stream.position), np.abs(ways)
    grain = float(changes[changes > 0.0].min(initial=np.inf))
    for first, last in spans(same):  # samples first + 1 to last + 1 repeat sample `first`
        following = steps[last + 2 : last + 5]
        leap = (
            last + 1 < len(steps)
            and len(following) > 0
            and steps[last + 1] > max(1.4 * np.median(following), 10.0 * grain)
        )
        stale[first + 1 : last + 2] = leap or not (is_rounded or is_smooth)
    return _left_out(
        "stale",
        stream,
        stale,
        "the same pose again, {count} times with new stamps (a lost body): left out",
    )


# jittered stamps


def _on_grid(stream: PoseStream) -> tuple[PoseStream, list[Fault]]:
    """Stamps at a steady frame rate, where it is clear which frame each belongs to; of poses with
    one stamp only the first if it is not.
    """
    doubled = _doubled(stream)
    time = (stream.stamp_ns - stream.stamp_ns[:1]) * 1e-9
    runs = [run for run in _runs(time) if np.sum(~doubled[run]) >= LEAST_RUN]
    if bursts := bunched(stream.body, stream.stamp_ns):
        return stream, bursts
    if runs:  # each may be a grid of the median step already
        single = time[~doubled]
        begins = np.concatenate(
            [np.full(run.stop - run.start, single[run.start]) for run in _runs(single)]
        )
        frames = (single - begins) / float(np.median(np.diff(single)))
    if not runs or np.abs(frames - np.rint(frames)).max() < STRAY_RMS:
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
    return _left_out(
        "repeated_stamp",
        stream,
        doubled,
        (
            "{count} other poses with the stamp of the one before: left out, and nobody knows which of"
            " them was right"
        ),
        False,
    )


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


# orientations that leap, lone samples, and missing ones


def _without_leaps(stream: PoseStream) -> tuple[PoseStream, list[Fault]]:
    """Orientations that leapt to another solution brought back to the one that was seen more
    often.
    """
    found = find_leaps(stream)
    if found is None:
        return stream, []
    mended, leapt, angle = found
    is_clear = bool(np.mean(leapt) < CLEARLY)
    which = "one of them, and nothing tells whether it is the right one"
    text = (
        f"the orientation of {{count}} poses leapt between two solutions, {np.degrees(angle):.0f}"
        " degrees apart, as of markers that look the same after this turn: brought back to "
    ) + ("the one that was seen more often" if is_clear else which)
    first, last = np.flatnonzero(leapt)[[0, -1]].tolist()
    fault = _fault("leap", stream, first, last, text, is_clear, int(leapt.sum()))
    return mended, [fault]


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
    edges = [0, *(np.flatnonzero(np.diff(time) > PAUSE) + 1).tolist(), len(time)]
    return [slice(first, last) for first, last in pairwise(edges)]


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
    times = int(stream.stamp_ns[first]), int(stream.stamp_ns[last])
    return Fault(kind, stream.body, *times, count, text.format(count=count), repaired)


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
