"""What a skill says of itself. The rest, from a recording to a plan and on to practice, is the
same for all skills.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np

from dart_skill.arm import MotionPlan, Speed, WamDescription
from dart_skill.common.configuration import config_path
from dart_skill.common.situation import Pose, Situation
from dart_skill.movement import VelocityThreshold, segment_containing
from dart_skill.recording import HAND, Demonstration, demonstration_id
from dart_skill.skills.observation import SensorLog
from dart_skill.skills.protocol._settings import SkillSettings
from dart_skill.skills.protocol._solid import Solid
from dart_skill.skills.protocol._words import SkillWords

if TYPE_CHECKING:
    from dart_skill.darts import ModelBasedAgent

K = TypeVar("K", bound="Skill")
RUN_UP_NS = 1_000_000_000
"""A movement that is judged is looked at from so long before it began [ns]."""


class Planner(Protocol):
    """A skill that was learned."""

    def plan(self, situation: Situation) -> MotionPlan:
        """A movement for a situation."""
        ...


def settings_file(kind: type[Skill]) -> Path | None:
    """YAML file with the settings of a skill: in the folder skills of config/, or of another
    package the file beside its module.

    Parameters
    ----------
    kind
        Class of the skill.
    """
    try:
        return config_path(f"skills/{kind.name}.yaml")
    except FileNotFoundError:
        beside = Path(inspect.getfile(kind)).with_name(f"{kind.name}.yaml")
        return beside if beside.is_file() else None


@dataclass(frozen=True, eq=False)
class TaskOutcome:
    """What became of a movement, by what the cameras saw.

    Parameters
    ----------
    success
        Whether it did what it was for.
    error
        How far from perfect it was [m]; nan if it cannot be told.
    reason
        Of a failure, in words; empty for a success.
    miss
        Where the body that practice corrects (`Skill.corrects`) seems to be off (3,) [m], in its
        own axes; nan if it cannot be told.
    observed
        Places (3,) [m] and velocities (3,) [m/s] at instants that the skill names, as the release
        of a ball.
    """

    success: bool
    error: float
    reason: str = ""
    miss: np.ndarray = field(default_factory=lambda: np.full(3, np.nan))
    observed: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)


class Skill:
    """Base of all skills: every method has a default that serves a movement of the hand between
    bodies. Only `judge` must be written.

    Class attributes:

    Attribute: settings, as they were given, or the defaults.

    Attributes
    ----------
    name
        Of the skill, as `--skill` and the entry point have it.
    task
        What it does, in words, as data sets for other learners have it; empty: its name.
    bodies
        Roles of the tracked bodies that it needs beside the hand.
    world
        The simulated world in which it is shown and tried (`simulation.WORLDS`); with a real arm
        it is of no meaning.
    speed
        The level of config/limits.yaml that its movements need.
    corrects
        Role of the body whose place practice corrects; empty: practice corrects nothing.
    numbers
        Names of those that a situation may have, beside those with which the skill was shown.
    units
        Of the numbers of a situation, by name, for who reads them; one that is not here has none.
    turned
        Whether it matters how the bodies are turned that a situation names.
    model
        Class of what is learned (as `skills.learning.LearnedSkill`), as "module:class".
    parts
        Its own parts, which its settings may choose beside those for any skill: for a kind
        (`GROUPS`) "module:class" by name.
    turns_hand
        Whether the hand turns on its way.
    configurations
        Changes of its settings that have a name, by name.
    practised_by_hand
        Whether a person can put the bodies to their places while it practises.
    by_pointer
        Whether it is slow enough to be shown with a mouse.
    cuts_itself
        Whether every movement into its world is found and cut without ~/start and ~/stop.
    in_the_open
        Whether its bodies stand in the region of config/world.yaml, out of the reach of the arm.
    settings_type
        Class of its settings.
    told_by
        How a summary, a table and a page tell of its trials: "trials" (error and result of each),
        "landings" (where what was thrown came down too) or "darts" (aims and points).
    """

    name = ""
    task = ""
    bodies: tuple[str, ...] = ()
    world = "bench"
    speed = Speed.CAREFUL
    corrects = ""
    numbers: tuple[str, ...] = ()
    units: Mapping[str, str] = MappingProxyType({})
    turned = True
    model = "dart_skill.skills.learning:LearnedSkill"
    parts: Mapping[str, Mapping[str, str]] = MappingProxyType({})
    turns_hand = True
    configurations: Mapping[str, Mapping[str, Any]] = MappingProxyType({})
    practised_by_hand = False
    by_pointer = True
    cuts_itself = False
    in_the_open = False
    settings_type: type[SkillSettings] = SkillSettings
    told_by = "trials"

    def __init__(self, settings: SkillSettings | None = None):
        self.settings = settings or self.settings_type()

    @classmethod
    def configured(cls: type[K]) -> K:
        """The skill with the settings of its file (`settings_file`), the defaults where there is
        none.
        """
        path = settings_file(cls)
        return cls(None if path is None else cls.settings_type.from_file(path))

    def with_settings(self: K, settings: SkillSettings) -> K:
        """The same skill with other settings."""
        other = copy(self)
        other.settings = settings
        return other

    def named(self: K, configuration: str) -> K:
        """The same skill with a named change of its settings; an empty name changes nothing.

        Raises
        ------
        ValueError
            Lists the names that there are.
        """
        if not configuration:
            return self
        if not self.configurations:
            raise ValueError(
                f"configurations are of throws: the skill '{self.name}' has its settings in"
                f" config/skills/{self.name}.yaml"
            )
        if configuration not in self.configurations:
            raise ValueError(
                f"no configuration '{configuration}': choose one of"
                f" {', '.join(sorted(self.configurations))}"
            )
        return self.with_settings(replace(self.settings, **self.configurations[configuration]))

    @property
    def reacts(self) -> bool:
        """Whether the model is asked at every state of the arm, with the newest poses of the bodies,
        which may move. Otherwise a plan is made beforehand.
        """
        from dart_skill.skills.protocol._registry import part_of  # which loads skills

        return part_of(self, "representation").drive == "state"

    @property
    def moves(self) -> str:
        """Role of what the movement moves, without which it is not seen what comes of it: the first
        body, or the hand where there is none.
        """
        return self.bodies[0] if self.bodies else HAND

    @property
    def situated(self) -> tuple[str, ...]:
        """Roles of the bodies on whose poses a plan depends. Default: all that the skill needs; of
        a skill that reacts, none.
        """
        return () if self.reacts else self.bodies

    @property
    def words(self) -> SkillWords:
        """What people are told of it."""
        return SkillWords(
            welcome=(
                f"Press Teach to have {self.name} shown, or Take the hand to show it yourself."
                " Then press Learn, then Execute."
            ),
            shown=f"of the skill '{self.name}', guided by a person, in new situations",
            begin=(
                f"bring the hand to where the {self.name} begins, hold it still, and press Enter"
            ),
        )

    def check_known(
        self, bodies: Iterable[str], numbers: Iterable[str], shown: Iterable[str] = ()
    ) -> None:
        """ValueError for a body or a number that the skill does not have.

        * bodies, numbers: their names in a situation that is asked for.
        * shown: names of further numbers, with which it was shown.
        """
        known = {"body": (HAND, *self.bodies), "number": (*self.numbers, *shown)}
        for what, given in (("body", bodies), ("number", numbers)):
            if unknown := sorted(set(given) - set(known[what])):
                has = f"only {', '.join(known[what])}" if known[what] else "none"
                raise ValueError(
                    f"the situation names the {what} '{unknown[0]}', which '{self.name}' does not"
                    f" have: it has {has}"
                )

    def solids(self, role: str) -> Sequence[Solid]:
        """How a body looks, for viewers. Default: nothing is known, so a small box stands for it."""
        return ()

    def surroundings(self) -> Sequence[Solid]:
        """What stands around in the world, where nothing tracks it, for viewers. Default: nothing."""
        return ()

    def loaded(self, description: WamDescription) -> WamDescription:
        """The arm with what its hand may hold, as the skill's user knows it
        (`arm.with_box`). Default: as it is described.
        """
        return description

    @property
    def world_settings(self) -> Mapping[str, Any]:
        """What its simulated world takes from its settings, by name: fields of `simulation.Bench`.
        Default: nothing.
        """
        return {}

    def cut(self, demonstration: Demonstration) -> tuple[float, float]:
        """First and last instant of the movement in a recording [s].

        Default: from when the fingers were told something for the first time to when they were
        told for the last time. Where they were told nothing, or only once, the movement between
        the velocity thresholds (8.4.3), the one in which they were told.

        Raises
        ------
        ValueError
            If there is none.
        """
        told = demonstration.events
        if len(told) > 1:
            return told[0].time, told[-1].time
        s = self.settings
        thresholds = VelocityThreshold(
            start=s.start_speed, stop=s.stop_speed, min_duration=s.shortest
        )
        time, position = demonstration.hand_time, demonstration.hand_position
        if told:
            found = segment_containing(
                thresholds.segment(time, position, told[0].time), told[0].time
            )
        else:
            found = max(thresholds.segment(time, position), key=lambda one: one.duration)
        return found.motion_start, found.motion_stop

    @property
    def shown_by(self) -> str:
        """How a simulated person shows it: "carry" the first body to its goal, "follow" the body
        that moves, or "swing". Default: "follow" if it reacts, else "carry".
        """
        return "follow" if self.reacts else "carry"

    @property
    def awaited(self) -> tuple[str, ...]:
        """Roles whose poses up to its end are waited for before a demonstration is cut."""
        return (HAND, *self.bodies)

    @property
    def decisive(self) -> tuple[str, ...]:
        """Roles that decide what became of a movement."""
        return (HAND, *self.bodies)

    def take_world(self, parameters: Mapping[str, Any]) -> None:
        """Take what a node was told of the world. Default: nothing of it matters."""

    def sensor_log(self, joint_period_ns: int = 10_000_000) -> SensorLog:
        """A log of what is seen of its bodies.

        Parameters
        ----------
        joint_period_ns
            As of `SensorLog`.
        """
        return SensorLog((HAND, *self.bodies), joint_period_ns)

    def infer_events(self, log: SensorLog, since_ns: int, until_ns: int) -> None:
        """Add to a log what a recording that tells no events shows of them, between two stamps.
        Default: nothing.
        """

    def record(
        self, log: SensorLog, until_ns: int, thresholds: VelocityThreshold
    ) -> Demonstration:
        """What a log saw of a demonstration, up to a stamp.

        Parameters
        ----------
        thresholds
            Of the recorder. Default: all since the world was set anew.

        Raises
        ------
        ValueError
            Says what is missing.
        """
        since = log.world_begins_ns()
        seen = log.seen(demonstration_id(since), since, until_ns, self.name)
        return self.described(seen)  # what is no movement of the skill is no demonstration

    def is_decided(
        self, log: SensorLog, situation: Situation, told_ns: int, until_ns: int
    ) -> bool:
        """Whether later poses change nothing about what became of a movement. Default: they may.

        Parameters
        ----------
        told_ns
            Stamp at which the fingers were told the last thing.
        """
        return False

    def judged_since(self, begun_ns: int, told_ns: int) -> int:
        """Stamp from which on a log must remember what is judged.

        Parameters
        ----------
        begun_ns, told_ns
            As of `outcome`.
        """
        return begun_ns - RUN_UP_NS

    def outcome(
        self, log: SensorLog, asked: Situation, begun_ns: int, told_ns: int, until_ns: int
    ) -> tuple[TaskOutcome, Situation]:
        """What became of a movement by what a log saw up to a stamp, and in which situation.

        Parameters
        ----------
        asked
            Situation that was asked for, as far as it was.
        begun_ns, told_ns
            Stamps at which it began, and the fingers were told the last thing; 0: not known.

        Raises
        ------
        ValueError
            Where the log does not tell.
        """
        since = self.judged_since(begun_ns, told_ns)
        seen = log.seen("trial", since, until_ns, self.name)
        before = self.situation(seen, (begun_ns - since) * 1e-9)
        situation = Situation({**before.poses, **asked.poses}, {**before.numbers, **asked.numbers})
        return self.judge(seen, situation), situation

    def described(self, seen: Demonstration) -> Demonstration:
        """What was seen with the situation and the instants of the movement that it shows.

        Raises
        ------
        ValueError
            If it shows none.
        """
        start, stop = self.cut(seen)
        return replace(
            seen, situation=self.situation(seen, start), motion_start=start, motion_stop=stop
        )

    def situation(self, demonstration: Demonstration, start: float) -> Situation:
        """Where all bodies are when the movement starts [s]. Default: where they were just before."""
        return Situation(
            {role: demonstration.track(role).pose_at(start) for role in (HAND, *self.bodies)}
        )

    def achieved(self, demonstration: Demonstration, situation: Situation) -> Situation:
        """The situation for which the movement would have been right: a miss can be relabelled.
        Default: the one that there was.
        """
        return situation

    def frames(self, situation: Situation) -> list[Pose]:
        """Task frames (7.5.2). Default: one where the hand starts, and one at each body."""
        return [situation.pose(role) for role in (HAND, *self.bodies)]

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Names of the task frames, by which settings choose among them. Default: the hand, and
        each body.
        """
        return (HAND, *self.bodies)

    def chosen_frames(self, situation: Situation) -> list[Pose]:
        """The task frames that count: those that the settings name, or all.

        Raises
        ------
        ValueError
            If the skill does not name its frames.
        """
        frames, chosen = self.frames(situation), self.settings.frames
        if not chosen:
            return frames
        if len(self.frame_names) != len(frames):
            raise ValueError(
                f"the skill '{self.name}' has {len(frames)} task frames and names"
                f" {', '.join(self.frame_names)}: write frame_names"
            )
        return [
            frame for name, frame in zip(self.frame_names, frames, strict=True) if name in chosen
        ]

    def check_settings(self) -> None:
        """ValueError for settings that are not of this skill: a task frame that it does not have,
        gains that no model of it can give.
        """
        from dart_skill.skills.protocol._registry import part_of  # which loads skills

        representation = part_of(self, "representation")
        if self.settings.stiffness_range and not representation.tells_covariance:
            raise ValueError(
                f"the representation '{self.settings.representation}' knows no covariance of the"
                " attractor, so give no stiffness_range"
            )
        if unknown := [name for name in self.settings.frames if name not in self.frame_names]:
            raise ValueError(
                f"the skill '{self.name}' has no task frame '{unknown[0]}': choose among"
                f" {', '.join(self.frame_names)}"
            )

    def inputs(self, situation: Situation) -> Sequence[float]:
        """Further inputs of the regression beside time. Default: the numbers of the situation, in
        the order of their names.
        """
        return [situation.numbers[name] for name in sorted(situation.numbers)]

    def refine(self, plan: MotionPlan, situation: Situation, planner: Planner) -> MotionPlan:
        """A plan before it is carried out, by the planner that made it, which may be asked for
        others. Default: as it is.
        """
        return plan

    def goal(self, situation: Situation) -> Pose:
        """Where a simulated person who shows the skill carries its first body, in the world.

        Raises
        ------
        ValueError
            If it cannot be shown.
        """
        raise ValueError(
            f"the skill '{self.name}' cannot be shown in simulation: write"
            f" {type(self).__name__}.goal"
        )

    def draw(self, rng: np.random.Generator, wide: bool = False) -> Situation:
        """A situation in which the skill is shown in simulation, or, wide, tried: where the bodies
        that can be put somewhere are put.

        Raises
        ------
        ValueError
            If the skill has none to offer.
        """
        raise ValueError(
            f"the skill '{self.name}' offers no situations: write {type(self).__name__}.draw, or"
            " name one"
        )

    def draws(self, rng: np.random.Generator, n: int) -> list[Situation]:
        """Situations in which the skill is shown n times. Default: n that are drawn one by one."""
        return [self.draw(rng) for _ in range(n)]

    def unhurried(self, situation: Situation) -> Situation:
        """A situation in which the skill is shown, for a person with a mouse, who takes their
        time. Default: the same.
        """
        return situation

    def judge(self, seen: Demonstration, situation: Situation) -> TaskOutcome:
        """What became of a movement that was made in a situation, from what was seen of it.

        Raises
        ------
        NotImplementedError
            If the skill does not say.
        """
        raise NotImplementedError(
            f"the skill '{self.name}' does not say how its outcome is judged: write"
            f" {type(self).__name__}.judge"
        )

    def corrected(self, situation: Situation, offset: np.ndarray) -> Situation:
        """The situation to plan for where what repeats in the misses is an offset (3,) [m] in the
        axes of the body that is corrected.
        """
        if not self.corrects or not offset.any():
            return situation
        pose = situation.pose(self.corrects)
        return situation.moved(self.corrects, pose.place(Pose(-offset)))

    def agent(self) -> ModelBasedAgent | None:
        """What chooses the aim of each trial (6.1). Default: None, situations are drawn."""
        return None

    def situations(
        self, seed: int, shown: int, tried: int
    ) -> tuple[Iterator[Situation], Iterator[Situation]]:
        """Situations of a seed in which the skill is shown, and then others in which it is tried.

        Default: both are drawn from one stream of random numbers, so that the second depend on how
        many of the first were taken. Where none is shown they are others than those of a lesson.

        Parameters
        ----------
        shown, tried
            How many are needed. More to be shown follow, for lessons that fail.
        """
        rng = np.random.default_rng([seed, 7])

        def lessons() -> Iterator[Situation]:
            yield from self.draws(rng, shown)
            while True:
                yield self.draw(rng)

        def trials() -> Iterator[Situation]:
            if not shown:
                rng.random(1000)
            for _ in range(tried):
                yield self.draw(rng, wide=True)

        return lessons(), trials()

    def in_words(self, situation: Situation) -> str:
        """A situation in words. Default: each body and each number."""
        return situation.in_words(units=self.units)

    @property
    def looks(self) -> bool:
        """Whether a trial in simulation is planned for what the cameras see, and not for where the
        bodies were put. Default: where it depends on them.
        """
        return self.reacts or bool(self.situated)
