"""Learning from a recording alone: throws are found in the raw streams, cut as the recorder cuts them, and learned from.

A throw is found by the command that opens the hand; in recordings where nobody kept it, by a motion of the hand (thesis 8.4.3) out of which
the ball flies. A throw that a person guided and that went into the basket is a demonstration; the arm's own throws and misses can be
learned from too, as what they are: throws at where the ball came down (8.2).
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from dart_skill.movement import Segment, VelocityThreshold
from dart_skill.recording import Demonstration, Opening, check_known, read_demonstrations, read_dropped
from dart_skill.recording.imports import Fault, RecordingMapping, ThrowRecording, read_in_parts, read_recording
from dart_skill.robot import wam_description
from dart_skill.skill.learn import LEAST_DEMONSTRATIONS, SkillConfiguration, prepare
from dart_skill.skill.learn import configuration as configuration_of
from dart_skill.skill.observe import MEMORY_NS, THRESHOLDS, FoundThrow, ThrowFinder, ThrowLog, fit_release, watched_until, worlds

if TYPE_CHECKING:
    from dart_skill.skill.improve import PractisingSkill

OWN_THROW = "thrown by the arm itself"
"""Why a throw is left out that no person guided."""
FLIGHT_NS = 1_000_000_000
"""A ball that was thrown in a motion of the hand flies within this time after it."""


@dataclass(frozen=True)
class LearnReport:
    """What was found in a recording, and what became of it.

    * source: the recording.
    * raw: whether throws were found in the streams, not read from /demonstrations.
    * throws: what was found, in order of time.
    * faults: of the recorded poses.
    """

    source: str
    raw: bool
    throws: tuple[FoundThrow, ...] = ()
    faults: tuple[Fault, ...] = field(default=(), repr=False)

    @property
    def learned_from(self) -> tuple[Demonstration, ...]:
        """The demonstrations that the skill was learned from."""
        return tuple(throw.demonstration for throw in self.throws if throw.demonstration is not None and not throw.reason)


def learn_from_bag(
    path: str | os.PathLike,
    mapping: RecordingMapping | None = None,
    configuration: str = "default",
    *,
    raw: bool = True,
    with_throws: bool = False,
    without: Sequence[str] = (),
    method: str = "residual",
    thresholds: VelocityThreshold = THRESHOLDS,
) -> tuple[PractisingSkill, LearnReport]:
    """The skill that a recording teaches, as the learner node would learn it, and what was found.

    mapping: where everything is, for recordings that are not ours. raw: from the streams; else from the topic /demonstrations, as the
    recorder cut them. with_throws: also from misses and from the arm's own throws. without: ids of throws that are left out, besides the
    demonstrations that were dropped while they were recorded. ValueError if there is too little to learn from.
    """
    chosen = configuration_of(configuration)
    report, has_joints = LearnReport(os.path.basename(os.fspath(path)), raw), True
    if raw:
        report, has_joints = _throws_in_parts(read_in_parts(path, mapping), report, chosen, with_throws, thresholds)
    else:
        shown = [FoundThrow(_instant(one), True, one) for one in read_demonstrations(path)]
        report = replace(report, throws=tuple(shown))
    report = _without_dropped(report, path, mapping, without)
    if len(report.learned_from) < LEAST_DEMONSTRATIONS:
        raise ValueError(_too_few(report, has_joints))
    from dart_skill.skill.improve import PractisingSkill  # who only looks for throws does not practise

    return PractisingSkill(list(report.learned_from), chosen, method), report


def throws_in_bag(
    path: str | os.PathLike,
    mapping: RecordingMapping | None,
    chosen: SkillConfiguration,
    *,
    with_throws: bool = False,
    without: Sequence[str] = (),
) -> tuple[LearnReport, ThrowRecording]:
    """What was found in the streams of a recording, and which of it would be learned from; and all of the recording.

    As `learn_from_bag`.
    """
    recording = read_recording(path, mapping)
    report, _ = _throws_in_parts([recording], LearnReport(recording.source, True), chosen, with_throws, THRESHOLDS)
    return _without_dropped(report, path, mapping, without), recording


def _throws_in_parts(
    parts: Iterable[ThrowRecording], report: LearnReport, chosen: SkillConfiguration, with_throws: bool, thresholds: VelocityThreshold
) -> tuple[LearnReport, bool]:
    """A report with what was found in the parts of a recording, and whether the arm's joints were recorded. A part is forgotten when the
    next one is read: what grows with a recording is what was found in it.
    """
    faults: list[Fault] = []
    source, has_joints = report.source, False

    def seen() -> Iterator[ThrowRecording]:
        nonlocal source, has_joints
        for part in parts:
            faults.extend(part.faults)
            source, has_joints = part.source, has_joints or part.joints is not None
            yield part

    throws = tuple(_judged(throw, with_throws, chosen) for throw in _found(seen(), thresholds))
    return replace(report, source=source, throws=throws, faults=tuple(faults)), has_joints


def _without_dropped(report: LearnReport, path: str | os.PathLike, mapping: RecordingMapping | None, without: Sequence[str]) -> LearnReport:
    """The report with the reasons why throws are not learned from that somebody did not want."""
    check_known(without, [throw.demonstration.id for throw in report.throws if throw.demonstration is not None], report.source)
    dropped = set() if mapping else read_dropped(path)
    return replace(report, throws=tuple(_unless_dropped(throw, dropped, without) for throw in report.throws))


def find_throws(recording: ThrowRecording, thresholds: VelocityThreshold = THRESHOLDS) -> list[FoundThrow]:
    """Every throw of a recording, in order of time. Demonstrations of our own bags are those that the recorder published, to the last bit:
    guided throws into the basket, which it calls demonstration_<stamp at which the hand was told to open>.
    """
    return list(_found([recording], thresholds))


def _found(parts: Iterable[ThrowRecording], thresholds: VelocityThreshold) -> Iterator[FoundThrow]:
    """As `find_throws`, of the parts of a recording in order of time. What no later throw needs is forgotten."""
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


def _unless_dropped(throw: FoundThrow, dropped: Collection[str], without: Collection[str]) -> FoundThrow:
    """The throw with the reason why somebody did not want it, if so."""
    if throw.demonstration is None or throw.reason:
        return throw
    if throw.demonstration.id in without:
        return replace(throw, reason="as asked")
    return replace(throw, reason="dropped while it was recorded") if throw.demonstration.id in dropped else throw


def _judged(throw: FoundThrow, with_throws: bool, chosen: SkillConfiguration) -> FoundThrow:
    """The throw with the reason why it is not learned from, if there is one."""
    one, outcome, reason = throw.demonstration, throw.outcome, ""
    if throw.reason or one is None or outcome is None:
        return throw
    if not with_throws:
        reason = "" if throw.taught else OWN_THROW
        reason = reason or ("" if outcome.in_basket else "missed the basket")
    if not reason:
        try:
            prepare(one, chosen)
        except ValueError as error:
            reason = str(error)
    return replace(throw, reason=reason)


def _too_few(report: LearnReport, has_joints: bool) -> str:
    learned, seen = len(report.learned_from), len(report.throws)
    reasons = sorted({throw.reason for throw in report.throws if throw.reason})
    text = f"{report.source}: {learned} demonstrations among {seen} throws are too few: at least {LEAST_DEMONSTRATIONS} are needed"
    if not seen:
        reasons.append("the ball flies out of no motion of the hand: are roles, up axis, units and the frame of the hand right?")
    if not has_joints:
        reasons.append("the arm's joint angles were not recorded: a mapping may name them under 'joints'")
    return explained("; ".join([text, *reasons]))


def explained(reasons: str) -> str:
    """Why throws are left out, and the option with which those of the arm itself are taken."""
    return f"{reasons}; with --with-throws (with_throws=True) those of the arm itself are taken, too" if OWN_THROW in reasons else reasons


def _instant(one: Demonstration) -> int:
    since = one.hand_opened if np.isfinite(one.hand_opened) else one.motion_start
    return one.stamp_ns + round(1e9 * float(np.nan_to_num(since)))


# finding throws


def _openings(recording: ThrowRecording, since: int, until: int, thresholds: VelocityThreshold) -> list[Opening]:
    """When the hand was told to open between two stamps, or if nobody kept that, when the ball left it."""
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
        log.rejected += len(rows) - stream.extend(body.stamp_ns, rows)
    joints = recording.joints
    if joints is not None:
        for k, stamp in enumerate(joints.stamp_ns.tolist()):
            log.add_joints(stamp, joints.position[k], joints.velocity[k])


def _between(stamps: np.ndarray, since: int, until: int) -> np.ndarray:
    return np.flatnonzero((stamps >= since) & (stamps <= until))


def _releases(recording: ThrowRecording, since: int, until: int, thresholds: VelocityThreshold) -> list[Opening]:
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
    releases = [release for motion in motions if (release := _release_in(recording, origin, motion)) is not None]
    return [Opening(stamp, True) for stamp in releases]


def _release_in(recording: ThrowRecording, origin: int, motion: Segment) -> int | None:
    first, last = origin + round(1e9 * motion.start), origin + round(1e9 * motion.stop)
    hand, ball = recording.bodies["hand"], recording.bodies["ball"]
    h, b = _between(hand.stamp_ns, first, last), _between(ball.stamp_ns, first, last + FLIGHT_NS)
    times = [1e-9 * (stream.stamp_ns[rows] - origin) for stream, rows in ((hand, h), (ball, b))]
    try:
        grip = wam_description().hand.ball_centre
        release = fit_release(times[1], ball.position[b], times[0], hand.position[h], hand.quaternion[h], grip)
    except ValueError:
        return None
    return origin + round(1e9 * release.time) if motion.contains(release.time) else None
