"""What a report tells, gathered from a bag: what was guided, what the arm did by itself, and what
was run.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dart_skill.recording import GraphBag, skill_of
from dart_skill.session import DartsRun, TrialResult
from dart_skill.skills.protocol import Skill, load_skill

if TYPE_CHECKING:
    from dart_skill.report._throws import Throws

PACKAGES = ("dart_skill", "numpy", "scipy", "matplotlib", "viser")
"""Whose versions a report states."""
MOST_TEXT = 100_000
"""Characters of an attached parameter file that are shown."""


Stamped = tuple[np.ndarray, np.ndarray]
"""Stamps (n,) [ns], and a row of numbers for each (n, d)."""


@dataclass(frozen=True)
class RunPhase:
    """Throws of the arm that had one purpose, one after the other.

    Parameters
    ----------
    name
        What they were for, such as "before practice".
    throws
        How many.
    learned_from
        Whether the arm learned from each of them; else they are a test, or only throws.
    """

    name: str
    throws: int
    learned_from: bool = False


@dataclass(frozen=True)
class About:
    """What is known of a run beyond its bag.

    Parameters
    ----------
    title
        Of the page.
    facts
        Name and text, in order.
    options
        Name, value and default of each.
    parameters
        Texts of parameter files, by name.
    configuration
        Of the skill, "" for the default one.
    marks
        What happened, by the number of throws that were learned from before it.
    phases
        What the throws were for, in order of time; together they are all of them. Empty: unknown.
    """

    title: str = "A bag"
    facts: Mapping[str, str] = field(default_factory=dict)
    options: Sequence[tuple[str, Any, Any]] = ()
    parameters: Mapping[str, str] = field(default_factory=dict)
    configuration: str = ""
    marks: Mapping[int, str] = field(default_factory=dict)
    phases: tuple[RunPhase, ...] = ()

    @property
    def changed(self) -> list[tuple[str, Any, Any]]:
        """The options that are not as they are by default."""
        return [option for option in self.options if option[1] != option[2]]


@dataclass(frozen=True)
class Movement:
    """What was done between two resets of the world.

    Parameters
    ----------
    since, until
        First and last stamp that is shown [ns].
    guided
        By a person.
    name
        Of the demonstration that it became, or of the arm's own, such as "trial 1".
    result
        What became of it, if that is known.
    number
        Of the trial that it is, from 1; 0 if it is none, or unknown.
    known
        From when on the result is told [ns].
    drawn
        From when on the ways of hand and body are drawn [ns].
    note
        Why it is no demonstration.
    """

    since: int
    until: int
    guided: bool
    name: str
    result: TrialResult | None = None
    number: int = 0
    known: int = 0
    drawn: int = 0
    note: str = ""


@dataclass(frozen=True, eq=False)
class Run:
    """Everything that the page is made of.

    Parameters
    ----------
    bag
        That was read.
    about
        What is known of the run beyond it.
    skill
        Of the run.
    shown
        The demonstrations.
    poses
        Of hand and bodies by role, position and quaternion (n, 7).
    joints
        Angles of the arm (n, 7) [rad].
    movements
        In order of time.
    trials
        The arm's own; empty where only the bag is known, and it does not tell.
    notes
        What is missing, and why.
    throws
        What is known of throws at baskets besides, None for other skills.
    darts
        Aims and points of darts, and the leg that was played; None for other skills.
    """

    bag: Path
    about: About
    skill: Skill
    shown: tuple[Any, ...]
    poses: dict[str, Stamped]
    joints: Stamped
    movements: tuple[Movement, ...]
    trials: tuple[TrialResult, ...]
    notes: tuple[str, ...] = ()
    throws: Throws | None = None
    darts: DartsRun | None = None

    @property
    def own(self) -> list[Movement]:
        """The arm's own movements."""
        return [one for one in self.movements if not one.guided]

    @property
    def guided(self) -> list[Movement]:
        """The movements that a person guided."""
        return [one for one in self.movements if one.guided]

    @property
    def phases(self) -> list[tuple[RunPhase, tuple[TrialResult, ...]]]:
        """What the trials were for, and the results of each purpose; one without a name where it
        is unknown.
        """
        return by_phase(self.about.phases, self.trials)

    @property
    def tests(self) -> list[tuple[RunPhase, tuple[TrialResult, ...]]]:
        """The phases at the same baskets each, from which nothing was learned; none where nothing
        was practised.
        """
        practised = any(phase.learned_from for phase, _ in self.phases)
        return [one for one in self.phases if practised and not one[0].learned_from and one[1]]

    @property
    def purposes(self) -> list[str]:
        """What each trial was for; empty where all were for the same."""
        return purposes_of(self.about.phases, self.trials)

    @property
    def practised(self) -> tuple[TrialResult, ...]:
        """The trials from which the arm learned, in order of time."""
        return tuple(
            result for phase, results in self.phases if phase.learned_from for result in results
        )


def by_phase(
    phases: Sequence[RunPhase], trials: Sequence[TrialResult]
) -> list[tuple[RunPhase, tuple[TrialResult, ...]]]:
    """The trials of each phase; all in one without a name where there is none.

    Raises
    ------
    ValueError
        If the phases do not add up to all trials.
    """
    phases = phases or (RunPhase("", len(trials)),)
    if sum(phase.throws for phase in phases) != len(trials):
        raise ValueError(
            f"phases {phases} of {len(trials)} throws: their numbers must add up to all throws"
        )
    rest = iter(trials)
    return [(phase, tuple(next(rest) for _ in range(phase.throws))) for phase in phases]


def purposes_of(phases: Sequence[RunPhase], trials: Sequence[TrialResult]) -> list[str]:
    """What each trial was for; empty where all were for the same."""
    if len(phases) < 2:
        return [""] * len(trials)
    return [phase.name for phase, results in by_phase(phases, trials) for _ in results]


def read_run(
    bag: str | os.PathLike,
    about: About | None = None,
    trials: Sequence[TrialResult] | None = None,
    darts: DartsRun | None = None,
) -> Run:
    """Everything that a bag tells of a run; BagError says what is wrong with it.

    Parameters
    ----------
    about
        What is known besides.
    trials
        As they were judged in the run. By default throws at baskets are judged again by what the
        cameras saw, and of other skills nothing is known.
    darts
        Aims and points of darts, and the leg that was played.

    Raises
    ------
    ValueError
        If phases do not add up to all trials.
    """
    bag = Path(bag)
    skill, described = load_skill(skill_of(bag)), describe(bag, about or About())
    if trials is not None:
        by_phase(described.phases, trials)
    if skill.told_by == "landings":
        from dart_skill.report._throws import read_throws

        return read_throws(bag, skill, described, trials)
    from dart_skill.report._movements import read_movements

    return read_movements(bag, skill, described, trials or (), darts)


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
