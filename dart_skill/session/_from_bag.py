"""Learning from a recording alone: throws are found in the raw streams, cut as the recorder cuts
them, and learned from.

A throw is found by the command that opens the hand; in recordings without it, by a
motion of the hand (thesis 8.4.3) out of which the ball flies. A throw that a person guided and
that went into the basket is a demonstration; the arm's own throws and misses can be learned from
too, as what they are: throws at where the ball came down (8.2).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np

from dart_skill.arm import Registration
from dart_skill.common.constants import REMEMBERED
from dart_skill.common.words import counted
from dart_skill.common.world import THROW
from dart_skill.movement import VelocityThreshold
from dart_skill.recording import (
    AS_ASKED,
    DROPPED,
    BagError,
    Demonstration,
    ids_named,
    unwanted,
)
from dart_skill.recording.imports import (
    BACKWARDS,
    BAG,
    Fault,
    RecordingMapping,
    ThrowRecording,
    clocks_of,
    in_words,
    read_in_parts,
    read_recording,
)
from dart_skill.session._finding import found_in
from dart_skill.session._throw_memory import ThrowMemory
from dart_skill.skills.learning import LEAST_DEMONSTRATIONS, ThrowSettings, prepare
from dart_skill.skills.observation import THRESHOLDS, FoundThrow
from dart_skill.skills.protocol import load_skill

if TYPE_CHECKING:
    from dart_skill.skills.practice import PractisingSkill

OWN_THROW = "thrown by the arm itself"
"""Why a throw is left out that no person guided."""
FAR_TURN = 0.2
"""Turn between cameras and arm that a mapping must say [rad]."""
FAR_SHIFT = 0.2
"""Shift between cameras and arm that a mapping must say [m]."""
MISSED = "missed the basket"
"""Why a throw is left out that was guided elsewhere."""


MOST_FAULTS = 8
"""So many are named where nothing can be learned."""


def throw_settings(configuration: str = "") -> ThrowSettings:
    """Settings of throws at baskets as config/ has them, with a named change.

    Raises
    ------
    ValueError
        Lists the names that there are.
    """
    settings = load_skill(THROW).named(configuration).settings
    assert isinstance(settings, ThrowSettings)
    return settings


class NothingLearned(ValueError):
    """Too little to learn from.

    Attributes
    ----------
    report
        What was found, and what is wrong with it.
    """

    def __init__(self, text: str, report: LearnReport):
        super().__init__(text)
        self.report = report


@dataclass(frozen=True)
class LearnReport:
    """What was found in a recording, and what became of it.

    Parameters
    ----------
    source
        The recording.
    throws
        What was found, in order of time.
    faults
        Of the recorded poses, joint states and stamps.
    clocks
        How the mapping had stamps read, as `clocks_of`.
    """

    source: str
    throws: tuple[FoundThrow, ...] = ()
    faults: tuple[Fault, ...] = field(default=(), repr=False)
    clocks: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def learned_from(self) -> tuple[Demonstration, ...]:
        """The demonstrations that the skill was learned from."""
        return tuple(
            throw.demonstration
            for throw in self.throws
            if throw.demonstration is not None and not throw.reason
        )

    @property
    def weakness(self) -> str:
        """Why a model that was learned from a few left-overs is weak; empty where most of what
        could be learned from was.
        """
        unusable = [
            throw.reason
            for throw in self.throws
            if throw.reason and throw.was is None and not _is_unwanted(throw.reason)
        ]
        learned = len(self.learned_from)
        if len(unusable) <= learned:
            return ""
        reasons = "; ".join(sorted({*unusable}))
        return (
            f"weak: {learned} of {learned + len(unusable)} demonstrations could be learned from;"
            f" the others: {reasons}"
        )


def learn_from_bag(
    path: str | os.PathLike,
    mapping: RecordingMapping | None = None,
    configuration: str = "default",
    *,
    with_throws: bool = False,
    without: Sequence[str] = (),
    method: str = "residual",
    thresholds: VelocityThreshold = THRESHOLDS,
    remember: int = REMEMBERED,
) -> tuple[PractisingSkill, LearnReport]:
    """The skill that a recording teaches, as the learner node would learn it, and what was found.

    Parameters
    ----------
    mapping
        Where everything is, for recordings that are not ours.
    with_throws
        Also from misses and from the arm's own throws.
    without
        Ids of throws that are left out, or their numbers from 1 in order of time, besides the
        demonstrations that were dropped while they were recorded.
    remember
        How many are learned from at most, so that neither memory nor model grow with the recording
        (`ThrowMemory`); 0 for all. `NothingLearned`, a ValueError, if there is too little to learn
        from.
    """
    chosen = throw_settings(configuration)
    reasons, memory = _reasons(path, mapping, without), ThrowMemory(remember, chosen)
    clocks = clocks_of(mapping) if mapping else {}
    judged = partial(_judged, chosen=chosen, with_throws=with_throws, reasons=reasons)
    report, has_joints = _throws_in_parts(
        read_in_parts(path, mapping),
        LearnReport(os.path.basename(os.fspath(path)), clocks=clocks),
        thresholds,
        judged,
        memory,
    )
    _check_without(report, without)
    too_few = len(report.learned_from) < LEAST_DEMONSTRATIONS
    set_back = any(fault.kind == BACKWARDS and not fault.repaired for fault in report.faults)
    if (
        has_joints
        and (too_few or report.weakness or set_back)
        and not any(fault.is_of_time for fault in report.faults)
    ):
        _refuse_disagreement(path, mapping, report)
    if too_few:
        raise NothingLearned(_too_few(report, has_joints), report)
    # who only looks for throws does not practise
    from dart_skill.skills.practice import PractisingSkill

    learned = PractisingSkill(list(report.learned_from), chosen, method)
    if _is_far(learned.skill.registration):
        _refuse_disagreement(path, mapping, report)
    return learned, report


def _is_far(registration: Registration) -> bool:
    """Whether cameras and arm stand so differently to each other that learning, which expects
    small deviations, may be wrong about it.
    """
    turns = (
        2.0 * np.arccos(min(1.0, abs(turn[3])))
        for turn in (registration.turn, registration.hand_turn)
    )
    shifts = (
        float(np.linalg.norm(shift)) for shift in (registration.shift, registration.hand_shift)
    )
    return max(turns) > FAR_TURN or max(shifts) > FAR_SHIFT


def _refuse_disagreement(
    path: str | os.PathLike, mapping: RecordingMapping | None, report: LearnReport
) -> None:
    """`NothingLearned` that says why joints and cameras disagree, if they do."""
    # a recording that can be learned from needs none
    from dart_skill.session._disagreement import disagreement

    found = disagreement(path, mapping)
    if found is None:
        return
    learned = (
        f"{report.source}: nothing is learned, though {len(report.learned_from)} of"
        f" {len(report.throws)} throws could be"
    )
    mend = (
        "; 'dart-skill learn BAG --mapping auto' writes that mapping"
        if found.mapping is not None and mapping is None
        else ""
    )
    raise NothingLearned(
        "; ".join([*_main_faults(report.faults), f"{learned}: {found}{mend}"]), report
    )


def throws_in_bag(
    path: str | os.PathLike,
    mapping: RecordingMapping | None,
    chosen: ThrowSettings,
    *,
    with_throws: bool = False,
    without: Sequence[str] = (),
) -> tuple[LearnReport, ThrowRecording]:
    """What was found in the streams of a recording, and which of it would be learned from; and all
    of the recording.

    As `learn_from_bag`.
    """
    recording, reasons = read_recording(path, mapping), _reasons(path, mapping, without)
    judged = partial(_judged, chosen=chosen, with_throws=with_throws, reasons=reasons)
    report, _ = _throws_in_parts(
        [recording],
        LearnReport(recording.source),
        THRESHOLDS,
        judged,
        ThrowMemory(0, chosen),
    )
    _check_without(report, without)
    return report, recording


def _throws_in_parts(
    parts: Iterable[ThrowRecording],
    report: LearnReport,
    thresholds: VelocityThreshold,
    judged: Callable[[FoundThrow, int], FoundThrow],
    memory: ThrowMemory,
) -> tuple[LearnReport, bool]:
    """A report with what was found in the parts of a recording, and whether the arm's joints were
    recorded. A part is forgotten when the next one is read: what grows with a recording is what is
    remembered of it.
    """
    faults: list[Fault] = []
    source, has_joints = report.source, False

    def seen() -> Iterator[ThrowRecording]:
        nonlocal source, has_joints
        for part in parts:
            faults.extend(part.faults)
            source, has_joints = part.source, has_joints or part.joints is not None
            yield part

    memory.take(map(judged, found_in(seen(), thresholds), count(1)))
    return (
        replace(report, source=source, throws=tuple(memory.throws), faults=tuple(faults)),
        has_joints,
    )


def _reasons(
    path: str | os.PathLike, mapping: RecordingMapping | None, without: Sequence[str]
) -> dict[str, str]:
    """As `unwanted`; what is no bag, as a folder of tables, has no marks."""
    try:
        return unwanted(path, without)
    except BagError:
        if mapping is None:
            raise
        return dict.fromkeys(without, AS_ASKED)


def _unless(throw: FoundThrow, number: int, reasons: Mapping[str, str]) -> FoundThrow:
    """The throw with the reason why it is not wanted, if so: by its id, or its number."""
    if throw.demonstration is None or throw.reason:
        return throw
    reason = reasons.get(throw.demonstration.id) or reasons.get(str(number), "")
    return replace(throw, reason=reason)


def _is_unwanted(reason: str) -> bool:
    """Whether a throw is left out because it is none that was asked for, and not because something
    is wrong with it.
    """
    return reason in (OWN_THROW, MISSED, AS_ASKED, DROPPED)


def _check_without(report: LearnReport, without: Sequence[str]) -> None:
    ids_named(
        without,
        [throw.shown[0] if throw.shown is not None else "" for throw in report.throws],
        report.source,
    )


def _judged(
    throw: FoundThrow,
    number: int,
    chosen: ThrowSettings,
    with_throws: bool,
    reasons: Mapping[str, str],
) -> FoundThrow:
    """The throw with the reason why it is not learned from, if there is one. number: of all that
    were found, from 1 on.
    """
    one, outcome, reason = throw.demonstration, throw.outcome, ""
    if throw.reason or one is None or outcome is None:
        return throw
    if not with_throws:
        reason = "" if throw.taught else OWN_THROW
        reason = reason or ("" if outcome.in_basket else MISSED)
    if not reason:
        try:
            prepare(one, chosen)
        except ValueError as error:
            reason = str(error)
    return _unless(replace(throw, reason=reason), number, reasons)


def _too_few(report: LearnReport, has_joints: bool) -> str:
    learned, seen = len(report.learned_from), len(report.throws)
    reasons = sorted({throw.reason for throw in report.throws if throw.reason})
    text = (
        f"{report.source}: {counted(learned, 'demonstration')} among {counted(seen, 'throw')}"
        f" {'is' if learned == 1 else 'are'} too few: at least {LEAST_DEMONSTRATIONS} are needed"
    )
    if not seen:
        reasons.append(
            "the ball flies out of no motion of the hand: are roles, up axis, units and the frame"
            " of the hand right?"
        )
    if not has_joints:
        reasons.append(
            "the arm's joint angles were not recorded: a mapping may name them under 'joints'"
        )
    return explained("; ".join([*_main_faults(report.faults), text, *reasons]))


def _main_faults(faults: Sequence[Fault]) -> list[str]:
    """The faults for which there is a remedy, or which could not be repaired, one of a kind for
    each body.
    """
    told = [
        fault
        for fault in faults
        if fault.kind != BAG and (fault.remedy or not (fault.repaired or fault.is_information))
    ]
    kinds = {(fault.kind, fault.body): fault for fault in reversed(told)}
    ordered = sorted(kinds.values(), key=lambda fault: (not fault.remedy, fault.start_ns))
    return [in_words(fault) for fault in ordered[:MOST_FAULTS]]


def explained(reasons: str) -> str:
    """Why throws are left out, and the option with which those of the arm itself are taken."""
    return (
        f"{reasons}; with --with-throws (with_throws=True) those of the arm itself are taken, too"
        if OWN_THROW in reasons
        else reasons
    )
