"""What the skill learner learns from and plans with, of throws and of every other skill."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from dart_skill_msgs.msg import Demonstration as DemonstrationMsg
from dart_skill_msgs.msg import Plan as PlanMsg
from dart_skill_msgs.msg import Situation as SituationMsg

from dart_skill.arm import KnownRegistration
from dart_skill.mixture import GaussianMixture
from dart_skill.recording import Demonstration, demonstration_from_message, read_demonstrations
from dart_skill.skills.learning import (
    AnySkill,
    PreparedThrow,
    ReactiveSkill,
    SkillConfiguration,
    changed,
    changed_skill,
    check_movement,
    choose_components,
    choose_throw_components,
    configuration,
    learn,
    learn_usable,
    load_model,
    load_skill_model,
    outliers,
    prepare,
    save_skill_model,
    unlike,
)
from dart_skill.skills.practice import (
    PracticeSettings,
    PractisingSkill,
    practised_skill,
    save_practised,
)
from dart_skill.skills.protocol import HAND, Skill, TaskOutcome, check_way
from dart_skill.skills.throw import Throw
from dart_skill_nodes.comms import conversions

Parameters = Callable[[], dict[str, Any]]
"""Values of the learner's parameters, as they are now."""


@dataclass(frozen=True)
class Lesson:
    """What came of learning: from how many demonstrations, the digest of the model, what to say of
    it, and what was left out, and why.
    """

    demonstrations: int
    model_id: str
    said: tuple[str, ...]
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True)
class Taken:
    """What became of a trial: whether it was kept, why not, how many demonstrations are
    remembered, and what of its error is left [m].
    """

    kept: bool
    message: str
    demonstrations: int
    left: list[float] = field(default_factory=lambda: [float("nan")] * 2)


@dataclass(frozen=True)
class Compared:
    """How a demonstration counts: its weight in the model, its distance from what the others teach
    [m], and whether that is far more.
    """

    weight: float
    unlike: float = float("nan")
    outlier: bool = False


class Learning(Protocol):
    """One skill, as the learner needs it. angles: how many columns its mixtures have after the
    position.
    """

    skill: str
    angles: int

    @property
    def learned(self) -> bool:
        """Whether there is something to plan with."""

    def check(self, parameters: dict[str, Any]) -> None:
        """ValueError says which parameter cannot be."""

    def demonstration(self, message: DemonstrationMsg) -> Any:
        """What is in a message; ValueError says why it is none."""

    def expect(self, one: Any) -> None:
        """A demonstration came, and a lesson will follow: what can be worked out now need not be
        waited for then.
        """

    def read(self, bag: str) -> Sequence[Any]:
        """Demonstrations of a bag; ValueError if there are none."""

    def learn(self, demonstrations: Sequence[Any], configuration: str) -> Lesson:
        """Learn; ValueError says why that cannot be."""

    def finding(self, one: Any, configuration: str) -> str:
        """What can be made of a demonstration, in words; ValueError says why nothing can."""

    def describe(self, one: Any) -> tuple[int, str, float, SituationMsg]:
        """Stamp [ns], frame, duration [s] and situation of a demonstration."""

    def plan(
        self, situation: SituationMsg, frame_id: str, explore: bool
    ) -> tuple[PlanMsg, SituationMsg]:
        """A plan, and what the hand holds at its start; explore: not always the best one.
        ValueError says why there is none.
        """

    def tell(self, trial: DemonstrationMsg, plan: PlanMsg) -> Taken:
        """Learn from what became of a plan."""

    def save(self, path: str) -> str:
        """Write the model to a file; its digest."""

    def load(self, path: str) -> str:
        """Take the model of a file; its digest."""

    def mixtures(self) -> tuple[dict[str, GaussianMixture], np.ndarray]:
        """Gaussians to be shown, by name, and places (n, 3) for which movements were shown."""

    def compared(self) -> dict[str, Compared]:
        """How each demonstration that is learned from counts, by its id; of others, and before
        anything is learned, nothing.
        """

    def values(self) -> dict[str, Any]:
        """For the diagnostics."""


class ThrowLearning:
    """Throws: their configurations, practice and model files."""

    angles = 2

    def __init__(
        self, skill: Throw, parameters: Parameters, registration: KnownRegistration | None
    ):
        self._thrown, self.skill, self._parameters, self._registration = (
            skill,
            skill.name,
            parameters,
            registration,
        )
        p = parameters()
        self._method, self._memory = (
            p["practice_method"],
            PracticeSettings(p["practice_capacity"], p["practice_forget"]),
        )
        self.practising: PractisingSkill | None = None

    @property
    def learned(self) -> bool:
        return self.practising is not None

    def check(self, parameters: dict[str, Any]) -> None:
        changed(configuration(parameters["configuration"]), parameters)
        check_way(parameters["choose_components"])
        if given := [name for name in ("start_speed", "stop_speed") if parameters[name]]:
            raise ValueError(
                f"{given[0]} is of the demonstration_recorder, which cuts throws: set it there"
            )

    def demonstration(self, message: DemonstrationMsg) -> Demonstration:
        return demonstration_from_message(message, self.skill)

    def expect(self, one: Demonstration) -> None:
        with suppress(ValueError):  # the lesson says why it is left out
            prepare(one, self._chosen("")[0])

    def read(self, bag: str) -> list[Demonstration]:
        return read_demonstrations(bag, self.skill)

    def _chosen(self, name: str) -> tuple[SkillConfiguration, str]:
        """The configuration of that name as the parameters change it, and what they change."""
        p = self._parameters()
        chosen, changes = changed(configuration(name or p["configuration"]), p)
        return self._thrown.configured_for(chosen), changes

    def learn(self, demonstrations: Sequence[Demonstration], configuration: str) -> Lesson:
        chosen, changes = self._chosen(configuration)
        chosen = (
            chosen
            if self._registration is None
            else replace(chosen, registration=self._registration)
        )
        if way := self._parameters()["choose_components"]:
            chosen = choose_throw_components(list(_prepared(demonstrations, chosen)), chosen, way)
            changes = ", ".join(
                filter(None, (changes, f"components {chosen.components} by {way}"))
            )
        self.take(list(demonstrations), chosen)
        skill, practice = self._skill.skill, self._skill.practice
        n = len(practice.demonstrations)
        said = (
            (
                f"learned from {n} demonstrations with"
                f" '{skill.configuration.name}'{changes and f' but {changes}'}"
            ),
            f"the hand opens {1e3 * skill.hand_delay:.0f} ms after it is told to",
            *filter(None, [practice.patterns()]),
        )
        return Lesson(n, skill.model_id, said, tuple(practice.kept_out.values()))

    def take(self, demonstrations: list[Demonstration], chosen: SkillConfiguration) -> None:
        """Learn from demonstrations with a configuration."""
        settings = self._thrown.correction
        self.practising = PractisingSkill(
            demonstrations,
            chosen,
            self._method,
            self._memory,
            settings,
            steady_every=self._steady_every,
        )

    @property
    def _steady_every(self) -> int:
        return 0 if self._method == "none" else self._thrown.steady_every

    @property
    def _skill(self) -> PractisingSkill:
        if self.practising is None:
            raise ValueError("nothing is learned yet: call ~/learn, or ~/load a model")
        return self.practising

    def finding(self, one: Demonstration, configuration: str) -> str:
        return prepare(one, self._chosen(configuration)[0]).in_words

    def describe(self, one: Demonstration) -> tuple[int, str, float, SituationMsg]:
        return (
            one.stamp_ns,
            one.frame_id,
            float(np.nan_to_num(one.motion_stop - one.motion_start)),
            self._shown_at(one),
        )

    def _shown_at(self, one: Demonstration) -> SituationMsg:
        return conversions.at_place(one.target, self._thrown.bodies[1])

    def plan(
        self, situation: SituationMsg, frame_id: str, explore: bool
    ) -> tuple[PlanMsg, SituationMsg]:
        skill, asked = self._skill, conversions.aimed(situation, self._thrown)
        message = conversions.throw_plan_msg(
            skill.plan(self._thrown.target(asked), explore), frame_id, self._thrown
        )
        message.situation = conversions.situation_msg(asked)
        return message, conversions.at_place(skill.skill.seat, self._thrown.bodies[0])

    def tell(self, trial: DemonstrationMsg, plan: PlanMsg) -> Taken:
        skill = self._skill
        told = skill.tell(
            conversions.throw_plan(plan, self._thrown) if plan.trajectory.points else None,
            self.demonstration(trial),
        )
        forgotten = f"forgotten: {', '.join(told.forgotten)}" if told.forgotten else ""
        return Taken(
            told.kept,
            told.reason or forgotten,
            len(skill.practice.demonstrations),
            list(told.left),
        )

    def save(self, path: str) -> str:
        skill = self._skill
        save_practised(path, skill)
        return skill.skill.model_id

    def load(self, path: str) -> str:
        saved = load_model(path, self._thrown)
        if saved.configuration.game != self._thrown.game:
            raise ValueError(
                f"{path} is a model of other throws: it was learned for another game or board than"
                f" that of '{self.skill}'"
            )
        self.practising = practised_skill(
            saved, self._method, self._memory, self._thrown.correction, self._steady_every
        )
        return self._skill.skill.model_id

    def mixtures(self) -> tuple[dict[str, GaussianMixture], np.ndarray]:
        skill = self._skill.skill
        tasks = np.array([throw.task for throw in skill.throws])
        centre = np.median(tasks, axis=0)
        frames = skill.frame_mixtures(centre)
        each = {f"frame_{k}": one for k, one in enumerate(frames, start=1) if len(frames) > 1}
        return {"components": skill.mixture(centre), **each}, tasks

    def compared(self) -> dict[str, Compared]:
        if not self.learned:
            return {}
        skill = self._skill.skill
        return {
            throw.id: Compared(float(weight))
            for throw, weight in zip(skill.throws, skill.credence, strict=True)
        }

    def values(self) -> dict[str, Any]:
        skill = self._skill
        practised = skill.practised if skill.correction is None else len(skill.correction)
        learned = {
            "learned_from": len(skill.practice.demonstrations),
            "kept_out": len(skill.practice.kept_out),
            "practised": practised,
        }
        ids = {"model_id": skill.skill.model_id, "posture_id": skill.skill.posture_id}
        return {**learned, "practice_method": skill.method, **ids}


def _prepared(
    demonstrations: Sequence[Demonstration], chosen: SkillConfiguration
) -> Iterator[PreparedThrow]:
    """Those that can be learned from."""
    for one in demonstrations:
        with suppress(ValueError):
            yield prepare(one, chosen)


class TaskLearning:
    """Every other skill, by its class."""

    angles = 0

    def __init__(self, skill: Skill, parameters: Parameters):
        self._skill, self._parameters, self.skill = skill, parameters, skill.name
        self.model: AnySkill | None = None

    @property
    def learned(self) -> bool:
        return self.model is not None

    def check(self, parameters: dict[str, Any]) -> None:
        changed_skill(self._skill, parameters)
        check_way(parameters["choose_components"])

    def demonstration(self, message: DemonstrationMsg) -> Demonstration:
        return demonstration_from_message(message, self._skill.name)

    def expect(self, one: Demonstration) -> None:
        """Nothing: a movement is cut when it is learned."""

    def read(self, bag: str) -> list[Demonstration]:
        return read_demonstrations(bag, self._skill.name)

    def _changed(self, configuration: str) -> tuple[Skill, str]:
        """The skill with the settings that the parameters change, and what they change."""
        if configuration:
            raise ValueError(
                f"configurations are of throws: the skill '{self.skill}' has its settings in"
                f" config/skills/{self.skill}.yaml"
            )
        return changed_skill(self._skill, self._parameters())

    def learn(self, demonstrations: Sequence[Demonstration], configuration: str) -> Lesson:
        skill, changes = self._changed(configuration)
        model, left_out = learn_usable(skill, demonstrations)
        if way := self._parameters()["choose_components"]:
            skill = choose_components(skill, model.demonstrations, way)
            model = learn(skill, model.demonstrations)
            changes = ", ".join(
                filter(None, (changes, f"components {skill.settings.components} by {way}"))
            )
        self.model = model
        n = len(self.model.demonstrations)
        said = f"learned '{self.skill}' from {n} demonstrations{changes and f' with {changes}'}"
        return Lesson(
            n,
            self.model.model_id,
            (said, f"a movement takes {self.model.duration:.1f} s"),
            tuple(left_out.values()),
        )

    @property
    def _learned(self) -> AnySkill:
        if self.model is None:
            raise ValueError("nothing is learned yet: call ~/learn, or ~/load a model")
        return self.model

    def finding(self, one: Demonstration, configuration: str) -> str:
        skill, _ = self._changed(configuration)
        check_movement(skill, one)
        start, stop = skill.cut(one)
        return (
            f"a movement of {stop - start:.1f} s, {len(one.events)} times the fingers were told"
            " something"
        )

    def describe(self, one: Demonstration) -> tuple[int, str, float, SituationMsg]:
        start, stop = self._skill.cut(one)
        situation = conversions.situation_msg(self._skill.situation(one, start))
        return (
            one.stamp_ns + round(start * 1e9),
            self._parameters()["frame_id"],
            stop - start,
            situation,
        )

    def plan(
        self, situation: SituationMsg, frame_id: str, explore: bool
    ) -> tuple[PlanMsg, SituationMsg]:
        asked, model = conversions.situation(situation), self._learned
        self._skill.check_known(asked.poses, asked.numbers, model.movements[-1].situation.numbers)
        if isinstance(model, ReactiveSkill):
            message = conversions.policy_msg(model.policy, frame_id)
        else:
            message = conversions.plan_msg(model.plan(asked), frame_id)
            message.aim = conversions.situation_msg(self._skill.corrected(asked, model.offset))
        message.model_id, message.situation = model.model_id, situation
        return message, SituationMsg()

    def tell(self, trial: DemonstrationMsg, plan: PlanMsg) -> Taken:
        seen, model = demonstration_from_message(trial, self._skill.name), self._learned
        start, _ = self._skill.cut(seen)
        outcome: TaskOutcome = self._skill.judge(seen, self._skill.situation(seen, start))
        model.tell(outcome)
        kept = bool(np.isfinite(outcome.miss).all())
        why = (
            ""
            if kept
            else (
                "nobody can tell by how much it missed:"
                f" {outcome.reason or 'nothing of it repeats'}"
            )
        )
        return Taken(kept, why, len(model.movements), outcome.miss[:2].tolist())

    def save(self, path: str) -> str:
        save_skill_model(path, self._learned)
        return self._learned.model_id

    def load(self, path: str) -> str:
        self.model = load_skill_model(path, self._skill)
        return self._learned.model_id

    def mixtures(self) -> tuple[dict[str, GaussianMixture], np.ndarray]:
        model = self._learned
        last = model.movements[-1].situation
        places = [
            one.situation.pose(role).position
            for one in model.movements
            for role in self._skill.bodies
        ]
        return {"components": model.mixture(last.moved(HAND, model.start))}, np.array(
            places
        ).reshape(-1, 3)

    def compared(self) -> dict[str, Compared]:
        if not self.learned:
            return {}
        movements, apart = self._learned.movements, unlike(self._learned)
        each = zip(movements, apart, outliers(apart), strict=True)
        return {one.id: Compared(1.0, float(distance), bool(far)) for one, distance, far in each}

    def values(self) -> dict[str, Any]:
        return {
            "learned_from": len(self._learned.movements),
            "practised": self._learned.practised,
            "model_id": self._learned.model_id,
        }
