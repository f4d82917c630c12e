"""What a report tells of throws at baskets, found in the raw streams of a bag."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dart_skill.figures import SAME_BASKET, HandRecording
from dart_skill.recording import BagError, Demonstration, read_demonstrations
from dart_skill.recording.imports import ThrowRecording, fault_lines, read_recording
from dart_skill.report._run import About, Movement, Run, Stamped, by_phase, purposes_of
from dart_skill.session import TrialResult, find_throws, throw_settings
from dart_skill.skills.learning import LEAST_DEMONSTRATIONS, ThrowingSkill, learn_throwing
from dart_skill.skills.observation import FoundThrow, worlds
from dart_skill.skills.protocol import Skill

LEAD = 0.2
"""Shown before the motion starts [s]."""
FOLLOWED = 0.9
"""Shown after the hand was told to open [s]."""
WAY = 0.4
"""The ways of hand and ball are drawn from so long before the hand is told to open [s]."""


@dataclass(frozen=True, eq=False)
class Throws:
    """What figures show of throws.

    Parameters
    ----------
    recording
        The raw streams.
    found
        Throws in them, in order of time.
    learned
        From the demonstrations, None if there are too few.
    """

    recording: ThrowRecording
    found: tuple[FoundThrow, ...]
    learned: ThrowingSkill | None

    @property
    def command_stamps(self) -> np.ndarray:
        """Stamps (n,) of the controller's commands [ns]."""
        return self.recording.command_stamps

    @property
    def stretches(self) -> list[HandRecording]:
        """The recording between two resets of the world, as the figures want it."""
        hand = self.recording.bodies["hand"].stamp_ns
        return [_stretch(self.recording, since, until) for since, until in worlds([hand])]


def read_throws(
    bag: Path, skill: Skill, about: About, trials: Sequence[TrialResult] | None
) -> Run:
    """Everything that a bag tells of throws at baskets.

    Parameters
    ----------
    about
        What is known besides.
    trials
        The arm's throws as they were judged in the run, which has those, too, that came to
        nothing; None: they are judged again.
    """
    shown = _published(bag)
    learned = _learned(shown, about.configuration) if shown else None
    recording = read_recording(bag)
    found = tuple(find_throws(recording))
    shown = shown or tuple(
        one.demonstration for one in found if one.demonstration is not None and one.shows
    )
    own = [one for one in found if not one.taught and one.demonstration is not None]
    results = tuple(map(result_of, own)) if trials is None else tuple(trials)
    by_phase(about.phases, results)
    skill_learned, notes = learned or _learned(shown, about.configuration)
    uncut = Counter(throw.reason for throw in found if throw.demonstration is None)
    notes += [
        f"{n} throws could not be cut: {why}" if n > 1 else f"could not be cut: {why}"
        for why, n in uncut.items()
    ]
    purposes, numbers = purposes_of(about.phases, results), numbers_of(own, results)
    movements = [_guided(one) for one in found if one.taught and one.demonstration is not None]
    for throw, number in zip(own, numbers, strict=True):
        purpose = purposes[number - 1] if number else ""
        name = f"throw {number}" if number else f"throw {own.index(throw) + 1}"
        movements.append(_movement(throw, ": ".join(filter(None, (purpose, name))), number))
    joints = recording.joints
    nothing: Stamped = (np.empty(0, dtype=np.int64), np.empty((0, 7)))
    return Run(
        bag,
        about,
        skill,
        shown,
        {
            role: (one.stamp_ns, np.hstack([one.position, one.quaternion]))
            for role in ("hand", "ball")
            for one in [recording.bodies[role]]
        },
        nothing if joints is None else (joints.stamp_ns, joints.position),
        tuple(movements),
        results,
        (*fault_lines(recording.faults), *notes),
        Throws(recording, found, skill_learned),
    )


def numbers_of(own: Sequence[FoundThrow], results: Sequence[TrialResult]) -> list[int]:
    """Number of the result, from 1, of each throw of the arm that was cut; 0 without one.

    Both are in order of time; a throw that never came about is a result only.
    """
    numbers: list[int] = []
    for number, result in enumerate(results, start=1):
        if len(numbers) == len(own):
            break
        cut = own[len(numbers)].demonstration
        assert cut is not None  # only throws that were cut are asked for
        if np.linalg.norm(np.subtract(cut.target, result.target)) < SAME_BASKET:
            numbers.append(number)
    return numbers + [0] * (len(own) - len(numbers))


def result_of(throw: FoundThrow) -> TrialResult:
    """How a throw of a recording ended."""
    one, outcome = throw.demonstration, throw.outcome
    assert one is not None and outcome is not None  # a throw that was cut was judged
    landing, error = (
        (outcome.landing, outcome.landing_error) if outcome.landing_seen else (None, None)
    )
    return TrialResult.of_throw(one.target, landing, error, outcome.in_basket, throw.reason)


def _movement(throw: FoundThrow, name: str, number: int = 0) -> Movement:
    """A throw as the replay shows it: its result is told when the ball is down, or in the end."""
    one, outcome = throw.demonstration, throw.outcome
    assert one is not None and outcome is not None  # only throws that were cut are shown
    until = throw.stamp_ns + round(1e9 * FOLLOWED)
    down = throw.stamp_ns + round(1e9 * outcome.landing_time) if outcome.landing_seen else until
    return Movement(
        one.stamp_ns + round(1e9 * (one.motion_start - LEAD)),
        until,
        throw.taught,
        name,
        result_of(throw),
        number,
        known=down,
        drawn=throw.stamp_ns - round(1e9 * WAY),
    )


def _guided(throw: FoundThrow) -> Movement:
    assert throw.demonstration is not None
    movement = _movement(throw, throw.demonstration.id)
    note = throw.reason or ("" if throw.shows else "a miss: no demonstration")
    return replace(movement, note=note)


def _published(bag: Path) -> tuple[Demonstration, ...]:
    """The demonstrations of the topic of that name; none without it."""
    try:
        return tuple(read_demonstrations(bag))
    except BagError:
        return ()


def _learned(shown: Sequence[Demonstration], name: str) -> tuple[ThrowingSkill | None, list[str]]:
    if len(shown) < LEAST_DEMONSTRATIONS:
        return None, [f"{len(shown)} demonstrations are too few to learn from: no skill is shown"]
    try:
        return learn_throwing(list(shown), throw_settings(name)), []
    except ValueError as error:
        return None, [f"no skill is shown: {error}"]


def _stretch(recording: ThrowRecording, since: int, until: int) -> HandRecording:
    bodies, stamps = recording.bodies, recording.command_stamps
    parts = {
        name: (bodies[name].stamp_ns >= since) & (bodies[name].stamp_ns <= until)
        for name in ("hand", "ball", "basket")
    }
    basket = bodies["basket"].position[parts["basket"]]
    opened = [
        one.stamp_ns
        for one in recording.openings
        if since <= one.stamp_ns <= until and not one.taught
    ]
    hand, ball = bodies["hand"], bodies["ball"]
    return HandRecording(
        hand.stamp_ns[parts["hand"]],
        hand.position[parts["hand"]],
        ball.stamp_ns[parts["ball"]],
        ball.position[parts["ball"]],
        basket=np.median(basket, axis=0) if len(basket) else np.full(3, np.nan),
        command_stamps=stamps[(stamps >= since) & (stamps <= until)],
        opened_ns=opened[0] if opened else None,
    )
