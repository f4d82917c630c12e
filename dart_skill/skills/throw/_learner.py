"""What learns throws: their configurations, aims, practice and model files."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dart_skill.arm import KnownRegistration, ThrowPlan
from dart_skill.common.situation import Pose, Situation
from dart_skill.mixture import GaussianMixture
from dart_skill.recording import Demonstration
from dart_skill.skills.learning import (
    DEFAULT,
    SkillConfiguration,
    changed,
    choose_throw_components,
    configuration,
    load_model,
    prepare,
)
from dart_skill.skills.practice import (
    NOTHING,
    Learned,
    Learner,
    Lesson,
    Parameters,
    Planned,
    PracticeSettings,
    PractisingSkill,
    Standing,
    practised_skill,
    save_practised,
    with_components,
)
from dart_skill.skills.protocol import check_way

if TYPE_CHECKING:
    from dart_skill.skills.throw import Throw


class ThrowLearner(Learner):
    """A learner of throws; parameters as of `Learner`."""

    angles = 2
    needs_plan = True
    skill: Throw

    def __init__(
        self,
        skill: Throw,
        parameters: Parameters,
        registration: KnownRegistration | None = None,
    ):
        super().__init__(skill, parameters)
        p = parameters()
        self._registration, self._method = registration, p["practice_method"]
        self._memory = PracticeSettings(p["practice_capacity"], p["practice_forget"])
        self.practising: PractisingSkill | None = None

    @property
    def learned(self) -> bool:
        return self.practising is not None

    @property
    def _practising(self) -> PractisingSkill:
        if self.practising is None:
            raise ValueError(NOTHING)
        return self.practising

    def check(self, parameters: dict[str, Any]) -> None:
        changed(configuration(parameters["configuration"]), parameters)
        check_way(parameters["choose_components"])
        if given := [name for name in ("start_speed", "stop_speed") if parameters[name]]:
            raise ValueError(
                f"{given[0]} is of the demonstration_recorder, which cuts throws: set it there"
            )

    def expect(self, one: Demonstration) -> None:
        with suppress(ValueError):  # the lesson says why it is left out
            prepare(one, self._chosen("")[0])

    def _chosen(self, name: str) -> tuple[SkillConfiguration, str]:
        """The configuration of that name as the parameters change it, and what they change."""
        p = self._parameters()
        chosen, changes = changed(configuration(name or p["configuration"]), p)
        return self.skill.configured_for(chosen), changes

    def learn(self, demonstrations: Sequence[Demonstration], configuration: str = "") -> Lesson:
        chosen, changes = self._chosen(configuration)
        if self._registration is not None:
            chosen = replace(chosen, registration=self._registration)
        if way := self._parameters()["choose_components"]:
            usable = []
            for one in demonstrations:
                with suppress(ValueError):
                    usable.append(prepare(one, chosen))
            chosen = choose_throw_components(usable, chosen, way)
            changes = with_components(changes, chosen.components, way)
        self.take(list(demonstrations), chosen)
        model, practice = self._practising.skill, self._practising.practice
        ids = tuple(one.id for one in practice.demonstrations)
        said = f"learned from {len(ids)} demonstrations with '{model.configuration.name}'"
        facts = (
            f"the hand opens {1e3 * model.hand_delay:.0f} ms after it is told to",
            *filter(None, [practice.patterns()]),
        )
        said += changes and f" but {changes}"
        return Lesson(ids, model.model_id, said, facts, practice.kept_out)

    def take(self, demonstrations: list[Demonstration], chosen: SkillConfiguration) -> None:
        """Learn from demonstrations with a configuration."""
        self.practising = PractisingSkill(
            demonstrations,
            chosen,
            self._method,
            self._memory,
            self.skill.correction,
            steady_every=self._steady_every,
        )

    @property
    def _steady_every(self) -> int:
        return 0 if self._method == "none" else self.skill.steady_every

    def finding(self, one: Demonstration, configuration: str = "") -> str:
        return prepare(one, self._chosen(configuration)[0]).in_words

    def check_shown(self, one: Demonstration) -> None:
        prepare(one, self.skill.configured_for(DEFAULT))

    def plan(self, asked: Situation, explore: bool = False) -> Planned:
        model = self._practising
        plan = model.plan(self.skill.target(asked), explore)
        held = Situation({self.skill.moves: Pose(model.skill.seat)})
        return Planned(plan, asked, plan.model_id, held=held)

    def tell(self, trial: Demonstration, plan: ThrowPlan | None = None) -> Learned:
        told = self._practising.tell(plan, trial)
        forgotten = f"forgotten: {', '.join(told.forgotten)}" if told.forgotten else ""
        n = len(self._practising.practice.demonstrations)
        return Learned(told.kept, told.reason or forgotten, n, list(told.left))

    def save(self, path: str | Path) -> str:
        save_practised(path, self._practising)
        return self._practising.skill.model_id

    def load(self, path: str | Path) -> str:
        saved = load_model(path, self.skill)
        if saved.configuration.game != self.skill.game:
            raise ValueError(
                f"{path} is a model of other throws: it was learned for another game or board than"
                f" that of '{self.skill.name}'"
            )
        self.practising = practised_skill(
            saved, self._method, self._memory, self.skill.correction, self._steady_every
        )
        return self._practising.skill.model_id

    def mixtures(self) -> tuple[dict[str, GaussianMixture], np.ndarray]:
        model = self._practising.skill
        tasks = np.array([throw.task for throw in model.throws])
        centre = np.median(tasks, axis=0)
        frames = model.frame_mixtures(centre)
        each = {f"frame_{k}": one for k, one in enumerate(frames, start=1) if len(frames) > 1}
        return {"components": model.mixture(centre), **each}, tasks

    def standings(self) -> dict[str, Standing]:
        if self.practising is None:
            return {}
        model = self.practising.skill
        each = zip(model.throws, model.credence, strict=True)
        return {throw.id: Standing(float(weight)) for throw, weight in each}

    def values(self) -> dict[str, Any]:
        model = self._practising
        return {
            "learned_from": len(model.practice.demonstrations),
            "kept_out": len(model.practice.kept_out),
            "practised": model.practised if model.correction is None else len(model.correction),
            "practice_method": model.method,
            "model_id": model.skill.model_id,
            "posture_id": model.skill.posture_id,
        }
