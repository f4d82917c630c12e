"""Finding the throws of a recording in its raw streams, cut as the recorder cuts them. It needs
neither SciPy nor the arm's model.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from dart_skill.arm import the_arm
from dart_skill.movement import Segment, VelocityThreshold
from dart_skill.recording import Opening
from dart_skill.recording.imports import ThrowRecording
from dart_skill.skills.observation import (
    MEMORY_NS,
    THRESHOLDS,
    FoundThrow,
    ThrowFinder,
    ThrowLog,
    fit_release,
    watched_until,
    worlds,
)

FLIGHT_NS = 1_000_000_000
"""Longest time from a motion of the hand to the end of the flight of a ball that it threw [ns]."""


def find_throws(
    recording: ThrowRecording, thresholds: VelocityThreshold = THRESHOLDS
) -> list[FoundThrow]:
    """Every throw of a recording, in order of time. Demonstrations of our own bags are those that
    the recorder published, to the last bit: guided throws into the basket, which it calls
    demonstration_<stamp at which the hand was told to open>.
    """
    return list(found_in([recording], thresholds))


def found_in(
    parts: Iterable[ThrowRecording], thresholds: VelocityThreshold
) -> Iterator[FoundThrow]:
    """As `find_throws`, of the parts of a recording in order of time. What no later throw needs is
    forgotten.
    """
    log = ThrowLog()
    finder, has_button, newest = ThrowFinder(log, thresholds), True, None
    waiting: list[Opening] = []  # of throws that may not be over
    for part in parts:
        if newest is not None:
            finder.forget_before(min([newest, *(one.stamp_ns for one in waiting)]) - MEMORY_NS)
        _fill(log, part)
        has_button, stretches = part.has_button, _worlds(part)
        if stretches and newest is not None:  # what was told between two parts
            stretches[0] = (min(stretches[0][0], newest + 1), stretches[0][1])
        for since, until in stretches:
            waiting += _openings(part, since, until, thresholds)
        newest = stretches[-1][1] if stretches else newest
        while newest is not None and waiting and watched_until(waiting[0].stamp_ns) <= newest:
            yield from finder.find(waiting.pop(0), has_button)
    for opening in waiting:
        yield from finder.find(opening, has_button)


def _openings(
    recording: ThrowRecording, since: int, until: int, thresholds: VelocityThreshold
) -> list[Opening]:
    """When the hand was told to open between two stamps, or if that was not kept, when the ball
    left it.
    """
    if recording.has_button:
        return [one for one in recording.openings if since <= one.stamp_ns <= until]
    return _releases(recording, since, until, thresholds)


def _worlds(recording: ThrowRecording) -> list[tuple[int, int]]:
    streams = [body.stamp_ns for body in recording.bodies.values()]
    return worlds([*streams, recording.joints.stamp_ns] if recording.joints else streams)


def _fill(log: ThrowLog, recording: ThrowRecording) -> None:
    """Tell a log everything that was recorded."""
    for role, stream in (("hand", log.hand), ("ball", log.ball), ("basket", log.basket)):
        body = recording.bodies[role]
        rows = np.hstack([body.position, body.quaternion]) if role == "hand" else body.position
        log.left_out[role] += len(rows) - stream.extend(body.stamp_ns, rows)
    joints = recording.joints
    if joints is not None:
        for k, stamp in enumerate(joints.stamp_ns.tolist()):
            log.add_joints(stamp, joints.position[k], joints.velocity[k])


def _between(stamps: np.ndarray, since: int, until: int) -> np.ndarray:
    return np.flatnonzero((stamps >= since) & (stamps <= until))


def _releases(
    recording: ThrowRecording, since: int, until: int, thresholds: VelocityThreshold
) -> list[Opening]:
    """When the ball left the hand, for each motion of the hand out of which it flew."""
    hand = recording.bodies["hand"]
    rows = _between(hand.stamp_ns, since, until)
    if len(rows) < 10:
        return []
    origin = int(hand.stamp_ns[rows[0]])
    try:
        motions = thresholds.segment(1e-9 * (hand.stamp_ns[rows] - origin), hand.position[rows])
    except ValueError:
        return []  # nothing moved, or nothing that begins and ends here
    releases = [
        release
        for motion in motions
        if (release := _release_in(recording, origin, motion)) is not None
    ]
    return [Opening(stamp, True) for stamp in releases]


def _release_in(recording: ThrowRecording, origin: int, motion: Segment) -> int | None:
    first, last = origin + round(1e9 * motion.start), origin + round(1e9 * motion.stop)
    hand, ball = recording.bodies["hand"], recording.bodies["ball"]
    h, b = _between(hand.stamp_ns, first, last), _between(ball.stamp_ns, first, last + FLIGHT_NS)
    times = [1e-9 * (stream.stamp_ns[rows] - origin) for stream, rows in ((hand, h), (ball, b))]
    try:
        grip = the_arm().hand.ball_centre
        release = fit_release(
            times[1], ball.position[b], times[0], hand.position[h], hand.quaternion[h], grip
        )
    except ValueError:
        return None
    return origin + round(1e9 * release.time) if motion.contains(release.time) else None
