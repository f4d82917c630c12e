"""How a skill is learned from what was shown, plans, and learns from its own trials: a part of a
skill, chosen by the setting `practice`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, cast

import numpy as np

from dart_skill.arm import MotionPlan
from dart_skill.common.situation import Situation
from dart_skill.mixture import GaussianMixture
from dart_skill.recording import HAND, Demonstration
from dart_skill.skills.learning import (
    LearnedSkill,
    Policy,
    learn,
    load_model,
    outliers,
    save_model,
    unlike,
)
from dart_skill.skills.practice._memory import PracticeSettings
from dart_skill.skills.practice._practised_file import count_shown
from dart_skill.skills.protocol import Part, Skill, TaskOutcome


@dataclass(frozen=True)
class Learned:
    """What was learned from a trial.

    Parameters
    ----------
    kept
        Whether the trial was learned from.
    message
        Why not.
    demonstrations
        Number of those that are remembered.
    left
        What of its error is left (2,) [m].
    """

    kept: bool
    message: str
    demonstrations: int
    left: list[float] = field(default_factory=lambda: [float("nan")] * 2)


@dataclass(frozen=True)
class Standing:
    """How a demonstration counts.

    Parameters
    ----------
    weight
        In the model.
    unlike
        Its distance from what the others teach [m].
    outlier
        Whether that is far more than usual.
    """

    weight: float
    unlike: float = float("nan")
    outlier: bool = False


@dataclass(frozen=True)
class Planned:
    """A plan for a situation.

    Parameters
    ----------
    plan
        Of the hand, or a policy that is asked while the arm moves.
    situation
        That it is for.
    aim
        For which the model was asked, where that is another one.
    model_id
        Of the model.
    held
        Where bodies are in the hand at its start.
    """

    plan: MotionPlan | Policy
    situation: Situation
    model_id: str
    aim: Situation | None = None
    held: Situation = field(default_factory=lambda: Situation({}))


class Practice(Part):
    """A model of poses of the hand, from which trials change nothing ("none"); base of the others.

    Parameters
    ----------
    skill
        That is learned.
    demonstrations
        That are learned from.
    memory
        How many of them and of trials are kept; default None: all.
    tried
        Trials that are learned from, oldest first.

    Attributes
    ----------
    angles
        Number of columns of its mixtures after the position.
    needs_plan
        Whether a trial teaches only beside the plan that was carried out.
    left_out
        Why demonstrations are not learned from, by their ids.
    """

    angles: ClassVar[int] = 0
    needs_plan: ClassVar[bool] = False

    def __init__(
        self,
        skill: Skill,
        demonstrations: Sequence[Demonstration],
        memory: PracticeSettings | None = None,
        tried: Sequence[Demonstration] = (),
    ):
        self.skill, self.memory = skill, memory or PracticeSettings()
        self._shown, self._tried = list(demonstrations), list(tried)
        self.left_out: dict[str, str] = {}
        self._model = self._learned()

    def _learned(self) -> LearnedSkill:
        return cast(LearnedSkill, learn(self.skill, [*self._shown, *self._tried]))

    @property
    def model(self) -> Any:
        """What was learned last."""
        return self._model

    @property
    def facts(self) -> tuple[str, ...]:
        """What there is to say of the model."""
        return self.model.facts

    def plan(self, asked: Situation, explore: bool = False) -> Planned:
        """A plan for a situation.

        Parameters
        ----------
        explore
            Not always the best one.

        Raises
        ------
        ValueError
            Says why there is none.
        """
        model = self._model
        self.skill.check_known(asked.poses, asked.numbers, model.movements[-1].situation.numbers)
        if self.skill.reacts:
            return Planned(model.policy, asked, model.model_id, held=model.held)
        aim = self.skill.corrected(asked, model.offset)
        return Planned(model.plan(asked), asked, model.model_id, aim, model.held)

    def tell(self, trial: Demonstration, plan: MotionPlan | None = None) -> Learned:
        """Learn from what became of a plan."""
        start, _ = self.skill.cut(trial)
        situation = self.skill.situation(trial, start)
        outcome = self.skill.judge(trial, situation)
        why = self._take(trial, situation, outcome)
        return Learned(not why, why, len(self._model.movements), outcome.miss[:2].tolist())

    def _take(self, trial: Demonstration, situation: Situation, outcome: TaskOutcome) -> str:
        """Learn from a trial; why that cannot be."""
        return "own trials change nothing: practice is 'none'"

    def save(self, path: str | Path) -> str:
        """Write the model with what practice found to a file; its digest."""
        found = {"n_shown": len(self._shown)} if self._tried else None
        settings = self.skill.settings
        save_model(path, [*self._shown, *self._tried], settings, self._model.misses, found)
        return self._model.model_id

    @classmethod
    def load(
        cls, path: str | Path, skill: Skill, memory: PracticeSettings | None = None
    ) -> Practice:
        """The one of a file; its settings are those that it was learned with."""
        saved = load_model(path, skill)
        shown = count_shown(saved.found, len(saved.demonstrations))
        one = cls(
            skill.with_settings(saved.configuration),
            saved.demonstrations[:shown],
            memory,
            saved.demonstrations[shown:],
        )
        one._model.remember(saved.practised)
        return one

    def mixtures(self) -> tuple[dict[str, GaussianMixture], np.ndarray]:
        """Gaussians to be shown, by name, and places (n, 3) for which movements were shown."""
        model = self._model
        last = model.movements[-1].situation
        places = [
            one.situation.pose(role).position
            for one in model.movements
            for role in self.skill.bodies
        ]
        mixture = model.mixture(last.moved(HAND, model.start))
        return {"components": mixture}, np.array(places).reshape(-1, 3)

    def standings(self) -> dict[str, Standing]:
        """How each demonstration that is learned from counts, by its id."""
        model = self.model
        distances = unlike(model)
        each = zip(model.ids, self._weights(), distances, outliers(distances), strict=True)
        return {
            name: Standing(float(weight), float(distance), bool(far))
            for name, weight, distance, far in each
        }

    def _weights(self) -> np.ndarray:
        """Weight of each demonstration in the model (n,)."""
        return np.ones(len(self.model.ids))

    def values(self) -> dict[str, Any]:
        """For the diagnostics."""
        return {
            "learned_from": len(self._model.movements),
            "practised": len(self._model.misses) or len(self._tried),
            "model_id": self._model.model_id,
        }


class ResidualPractice(Practice):
    """What repeats in the misses is taken out of the next plan: an offset in the axes of the body
    that the skill corrects.
    """

    def _take(self, trial: Demonstration, situation: Situation, outcome: TaskOutcome) -> str:
        self._model.tell(outcome)
        if np.isfinite(outcome.miss).all():
            return ""
        reason = outcome.reason or "nothing of it repeats"
        return f"it cannot be told by how much it missed: {reason}"


class BootstrapPractice(Practice):
    """A trial is one more demonstration (thesis 8.2), of the situation for which it would have been
    right (`Skill.achieved`).

    Raises
    ------
    ValueError
        For a memory that forgets by crowding, which is one of throws.
    """

    def __init__(
        self,
        skill: Skill,
        demonstrations: Sequence[Demonstration],
        memory: PracticeSettings | None = None,
        tried: Sequence[Demonstration] = (),
    ):
        if memory is not None and memory.forget != PracticeSettings.forget:
            raise ValueError(
                f"practice_forget '{memory.forget}' is for throws: the skill '{skill.name}' forgets"
                f" the {PracticeSettings.forget} trial"
            )
        super().__init__(skill, demonstrations, memory, tried)

    def _take(self, trial: Demonstration, situation: Situation, outcome: TaskOutcome) -> str:
        if not outcome.success and self.skill.achieved(trial, situation) is situation:
            return f"it failed, and the skill does not say for what it is right: {outcome.reason}"
        before = self._tried
        self._tried = [*before, trial]
        capacity = self.memory.capacity
        while capacity and len(self._shown) + len(self._tried) > capacity and self._tried:
            self._tried.pop(0)
        try:
            self._model = self._learned()
        except ValueError as error:
            self._tried = before
            return str(error)
        return ""
