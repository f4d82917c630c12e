"""How throws are learned from what was shown and from own throws."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from dart_skill.arm import MotionPlan
from dart_skill.common.situation import Pose, Situation
from dart_skill.mixture import GaussianMixture
from dart_skill.recording import Demonstration
from dart_skill.skills.learning import ThrowingSkill, ThrowSettings, load_model
from dart_skill.skills.practice import (
    Learned,
    Planned,
    Practice,
    PracticeSettings,
    PractisingSkill,
    practised_skill,
    save_practised,
)
from dart_skill.skills.protocol import Skill

if TYPE_CHECKING:
    from dart_skill.skills.throw import Throw


class ThrowPractice(Practice):
    """A `PractisingSkill` of the method that the skill's settings name; parameters as of
    `Practice`.
    """

    angles = 2
    needs_plan = True
    skill: Throw

    @classmethod
    def refusal(cls, skill: Skill) -> str:
        s = skill.settings
        if s.practice == "power" and isinstance(s, ThrowSettings) and s.board:
            return (
                "PoWER's offsets and slopes are those of baskets: practise darts with residual,"
                " bootstrap or both"
            )
        return ""

    def _learned(self) -> Any:
        settings, skill = self.skill.settings, self.skill
        assert isinstance(settings, ThrowSettings)
        self.practising = PractisingSkill(
            self._shown,
            settings,
            settings.practice,
            self.memory,
            skill.correction,
            steady_every=_steady_every(skill),
            tried=self._tried,
            of=skill,
        )
        self.left_out = self.practising.practice.kept_out

    @property
    def model(self) -> ThrowingSkill:
        return self.practising.skill

    @property
    def facts(self) -> tuple[str, ...]:
        return (*self.model.facts, *filter(None, [self.practising.practice.patterns()]))

    def plan(self, asked: Situation, explore: bool = False) -> Planned:
        plan = self.practising.plan(self.skill.target(asked), explore)
        held = Situation({self.skill.in_hand: Pose(self.model.seat)})
        return Planned(plan, asked, plan.model_id, self.skill.at(plan.thrown.aim), held)

    def tell(self, trial: Demonstration, plan: MotionPlan | None = None) -> Learned:
        told = self.practising.tell(plan, trial)
        forgotten = f"forgotten: {', '.join(told.forgotten)}" if told.forgotten else ""
        said = [told.reason or forgotten, self.practising.ball_news]
        n = len(self.practising.practice.demonstrations)
        return Learned(told.kept, "; ".join(filter(None, said)), n, list(told.left))

    def save(self, path: str | Path) -> str:
        save_practised(path, self.practising)
        return self.model.model_id

    @classmethod
    def load(
        cls, path: str | Path, skill: Skill, memory: PracticeSettings | None = None
    ) -> ThrowPractice:
        saved = load_model(path, skill)
        settings = saved.configuration
        assert isinstance(settings, ThrowSettings)
        if settings.game != skill.game:  # type: ignore[attr-defined]
            raise ValueError(
                f"{path} is a model of other throws: it was learned for another game or board than"
                f" that of '{skill.name}'"
            )
        method = skill.settings.practice
        one = cls.__new__(cls)
        one.skill = cast("Throw", skill.with_settings(settings))
        one.memory, one.left_out = memory or PracticeSettings(), {}
        one.practising = practised_skill(
            saved, method, memory, one.skill.correction, _steady_every(skill), one.skill
        )
        return one

    def mixtures(self) -> tuple[dict[str, GaussianMixture], np.ndarray]:
        model = self.model
        tasks = np.array([throw.task for throw in model.throws])
        centre = np.median(tasks, axis=0)
        frames = model.frame_mixtures(centre)
        each = {f"frame_{k}": one for k, one in enumerate(frames, start=1) if len(frames) > 1}
        return {"components": model.mixture(centre), **each}, tasks

    def _weights(self) -> np.ndarray:
        return self.model.credence

    def values(self) -> dict[str, Any]:
        done = self.practising
        return {
            "learned_from": len(done.practice.demonstrations),
            "kept_out": len(done.practice.kept_out),
            "practised": done.practised if done.correction is None else len(done.correction),
            "practice_method": done.method,
            "model_id": done.skill.model_id,
            "posture_id": done.skill.posture_id,
            **({"ball": done.ball_in_words} if done.ball_in_words else {}),
        }


def _steady_every(skill: Any) -> int:
    """Own throws between two looks at when to let go; 0 where practice changes nothing."""
    return 0 if skill.settings.practice == "none" else skill.steady_every
