"""What a report tells, gathered from a bag: throws that were guided, throws of the arm's own, the
skill, and what was run.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.figures import SAME_BASKET, HandRecording
from dart_skill.recording import (
    SKILL,
    BagError,
    Demonstration,
    GraphBag,
    read_demonstrations,
    skill_of,
)
from dart_skill.recording.imports import ThrowRecording, fault_lines, read_recording
from dart_skill.session import ThrowResult, find_throws
from dart_skill.skills.learning import LEAST_DEMONSTRATIONS, ThrowingSkill, learn_throwing
from dart_skill.skills.learning import configuration as configuration_of
from dart_skill.skills.observation import FoundThrow, worlds

PACKAGES = ("dart_skill", "numpy", "scipy", "matplotlib", "viser")
"""Whose versions a report states."""
MOST_TEXT = 100_000
"""Characters of an attached parameter file that are shown."""


@dataclass(frozen=True)
class Phase:
    """Throws of the arm that had one purpose, one after the other.

    * name: what they were for, such as "before practice".
    * throws: how many.
    * learned_from: whether the arm learned from each of them; else they are a test, or only
      throws.
    """

    name: str
    throws: int
    learned_from: bool = False


@dataclass(frozen=True)
class About:
    """What somebody knows of a run beyond its bag.

    * title: of the page.
    * facts: name and text, in order.
    * options: name, value and default of each.
    * parameters: texts of parameter files, by name.
    * configuration: of the skill, "" for the default one.
    * marks: what happened after so many of the throws that were learned from.
    * phases: what the throws were for, in order of time; together they are all of them. Empty:
      nobody knows.
    """

    title: str = "Throws of a bag"
    facts: Mapping[str, str] = field(default_factory=dict)
    options: Sequence[tuple[str, Any, Any]] = ()
    parameters: Mapping[str, str] = field(default_factory=dict)
    configuration: str = ""
    marks: Mapping[int, str] = field(default_factory=dict)
    phases: tuple[Phase, ...] = ()

    @property
    def changed(self) -> list[tuple[str, Any, Any]]:
        """The options that are not as they are by default."""
        return [option for option in self.options if option[1] != option[2]]


@dataclass(frozen=True, eq=False)
class Run:
    """Everything that the page is made of.

    * bag: that was read.
    * about: what is known of the run beyond it.
    * recording: the raw streams.
    * guided, own: throws that were found in them, in order of time.
    * results: one for each throw of the arm's own.
    * shown: the demonstrations.
    * skill: learned from them, None if there are too few.
    * command_stamps: of the controller's commands (n,) [ns].
    * notes: what is missing, and why.
    """

    bag: Path
    about: About
    recording: ThrowRecording
    guided: tuple[FoundThrow, ...]
    own: tuple[FoundThrow, ...]
    results: tuple[ThrowResult, ...]
    shown: tuple[Demonstration, ...]
    skill: ThrowingSkill | None
    command_stamps: np.ndarray
    notes: tuple[str, ...] = ()

    @property
    def numbers(self) -> dict[int, int]:
        """Number of the result, from 1 on, of each throw of the arm in the recording, by its index
        in `own`.

        Both are in order of time; a throw that never came about is a result only.
        """
        found, numbers = 0, {}
        cut = [
            (k, throw.demonstration.target)
            for k, throw in enumerate(self.own)
            if throw.demonstration is not None
        ]
        for number, result in enumerate(self.results, start=1):
            if (
                found < len(cut)
                and np.linalg.norm(np.subtract(cut[found][1], result.target)) < SAME_BASKET
            ):
                numbers[cut[found][0]] = number
                found += 1
        return numbers

    @property
    def phases(self) -> list[tuple[Phase, tuple[ThrowResult, ...]]]:
        """What the throws of the arm were for, and the results of each purpose; one without a name
        where nobody knows.
        """
        phases = self.about.phases or (Phase("", len(self.results)),)
        ends = np.cumsum([phase.throws for phase in phases])
        return [
            (phase, self.results[end - phase.throws : end])
            for phase, end in zip(phases, ends, strict=True)
        ]

    @property
    def tests(self) -> list[tuple[Phase, tuple[ThrowResult, ...]]]:
        """The phases at the same baskets each, from which nothing was learned; none where nothing
        was practised.
        """
        practised = any(phase.learned_from for phase, _ in self.phases)
        return [one for one in self.phases if practised and not one[0].learned_from and one[1]]

    @property
    def purposes(self) -> list[str]:
        """What each throw of the arm was for; empty where all were for the same."""
        if len(self.phases) < 2:
            return [""] * len(self.results)
        return [phase.name for phase, results in self.phases for _ in results]

    @property
    def practised(self) -> tuple[ThrowResult, ...]:
        """The throws from which the arm learned, in order of time."""
        return tuple(
            result for phase, results in self.phases if phase.learned_from for result in results
        )

    @property
    def recordings(self) -> list[HandRecording]:
        """The stretches between two resets of the world, as the figures want them."""
        return [
            _stretch(self, since, until)
            for since, until in worlds([self.recording.bodies["hand"].stamp_ns])
        ]


def read_run(
    bag: str | os.PathLike,
    about: About | None = None,
    results: Sequence[ThrowResult] | None = None,
) -> Run:
    """Everything that a bag tells of a run; BagError says what is wrong with it.

    about: what is known besides. results: of the arm's throws as they were judged in the run,
    which has those, too, that came to nothing; by default they are judged again, by what the
    cameras saw. ValueError if phases do not add up to all throws.
    """
    bag = Path(bag)
    if (name := skill_of(bag)) != SKILL:
        raise BagError(f"{bag} is of the skill '{name}': there are reports of throws only")
    described = describe(bag, about or About())
    if results is not None:
        _check_phases(described.phases, len(results))
    shown = _published(bag)
    learned = _learned(shown, described.configuration) if shown else None
    recording = read_recording(bag)
    throws = find_throws(recording)
    guided, own = (
        tuple(throw for throw in throws if throw.taught == taught) for taught in (True, False)
    )
    shown = shown or tuple(
        throw.demonstration for throw in guided if throw.demonstration is not None and throw.shows
    )
    judged = (
        tuple(result_of(throw) for throw in own if throw.demonstration is not None)
        if results is None
        else tuple(results)
    )
    _check_phases(described.phases, len(judged))
    skill, notes = learned or _learned(shown, described.configuration)
    uncut = Counter(throw.reason for throw in throws if throw.demonstration is None)
    notes += [
        f"{n} throws could not be cut: {why}" if n > 1 else f"could not be cut: {why}"
        for why, n in uncut.items()
    ]
    return Run(
        bag,
        described,
        recording,
        guided,
        own,
        judged,
        shown,
        skill,
        recording.command_stamps,
        (*fault_lines(recording.faults), *notes),
    )


def _check_phases(phases: Sequence[Phase], n_throws: int) -> None:
    if phases and sum(phase.throws for phase in phases) != n_throws:
        raise ValueError(
            f"phases {phases} of {n_throws} throws: their numbers must add up to all throws"
        )


def result_of(throw: FoundThrow) -> ThrowResult:
    """How a throw of a recording ended."""
    one, outcome = throw.demonstration, throw.outcome
    assert one is not None and outcome is not None  # a throw that was cut was judged
    landing = _point(outcome.landing) if outcome.landing_seen else None
    error = float(outcome.landing_error) if outcome.landing_seen else None
    return ThrowResult(_point(one.target), landing, error, bool(outcome.in_basket), throw.reason)


def _point(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def versions() -> dict[str, str]:
    """Versions of this package and of what it computes with; "not installed" where there is none."""
    found = {"Python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found


def machine() -> str:
    """Operating system, kind of processor and number of cores of this machine, without its name."""
    try:
        system = platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError, AttributeError):
        system = platform.system()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return (
        f"{system}, {platform.system()} {platform.release().split('-')[0]}, {platform.machine()},"
        f" {cores} cores"
    )


def describe(bag: Path, about: About) -> About:
    """What the bag says of itself added to what is known."""
    with GraphBag(bag) as reader:
        told = {
            name.capitalize(): text
            for name, text in reader.custom_data.items()
            if text.strip("{}[] ")
        }
        size = sum(file.size for file in reader.files)
        told["Bag"] = (
            f"{bag.name}: {reader.message_count} messages on {len(reader.topics)} topics,"
            f" {size / 1e6:.1f} MB"
        )
        told["Recorded time"] = (
            f"{(reader.end_ns - reader.start_ns) * 1e-9:.1f} s on the clock of the recorder"
        )
        files = {
            item.name: item.data.decode("utf-8", "replace")[:MOST_TEXT]
            for item in reader.attachments()
            if "yaml" in item.media_type
        }
    facts, parameters = {**told, **about.facts}, {**files, **about.parameters}
    return replace(about, facts=facts, parameters=parameters)


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
        return learn_throwing(list(shown), configuration_of(name)), []
    except ValueError as error:
        return None, [f"no skill is shown: {error}"]


def _stretch(run: Run, since: int, until: int) -> HandRecording:
    bodies, stamps = run.recording.bodies, run.command_stamps
    parts = {
        name: (bodies[name].stamp_ns >= since) & (bodies[name].stamp_ns <= until)
        for name in ("hand", "ball", "basket")
    }
    basket = bodies["basket"].position[parts["basket"]]
    opened = [
        one.stamp_ns
        for one in run.recording.openings
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
