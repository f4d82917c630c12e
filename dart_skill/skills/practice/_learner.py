"""What learns a skill, plans with it, and practises: the same for a session and for the graph."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.arm import KnownRegistration, MotionPlan, ThrowPlan
from dart_skill.common.situation import Situation
from dart_skill.mixture import GaussianMixture
from dart_skill.recording import HAND, Demonstration
from dart_skill.skills.learning import (
    AnySkill,
    Policy,
    ReactiveSkill,
    changed_skill,
    check_movement,
    choose_components,
    learn,
    learn_usable,
    load_skill_model,
    outliers,
    save_skill_model,
    unlike,
)
from dart_skill.skills.protocol import Skill, check_way, part_of

Parameters = Callable[[], dict[str, Any]]
"""Values of the parameters of the node skill_learner, as they are now."""
NOTHING = "nothing is learned yet: call ~/learn, or ~/load a model"


@dataclass(frozen=True)
class Lesson:
    """What came of learning.

    Parameters
    ----------
    learned_from
        Ids of the demonstrations.
    model_id
        Digest of the model.
    said
        What was learned.
    facts
        What there is to say of it.
    left_out
        Why demonstrations were left out, by their ids.
    """

    learned_from: tuple[str, ...]
    model_id: str
    said: str
    facts: tuple[str, ...]
    left_out: Mapping[str, str] = field(default_factory=dict)

    def without(self, left_out: Mapping[str, str]) -> Lesson:
        """The same with more that was left out before."""
        return replace(self, left_out={**left_out, **self.left_out})


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

    plan: MotionPlan | ThrowPlan | Policy
    situation: Situation
    model_id: str
    aim: Situation | None = None
    held: Situation = field(default_factory=lambda: Situation({}))


class Learner:
    """Learns one skill from demonstrations, plans with it, and learns from trials.

    Parameters
    ----------
    skill
        That is learned.
    parameters
        Of the node skill_learner.
    registration
        Of cameras and arm as it was measured before; None: told by the demonstrations.

    Attributes
    ----------
    angles
        Number of columns of its mixtures after the position.
    needs_plan
        Whether a trial teaches only beside the plan that was carried out.
    """

    angles = 0
    needs_plan = False

    def __init__(
        self,
        skill: Skill,
        parameters: Parameters,
        registration: KnownRegistration | None = None,
    ):
        self.skill, self._parameters = skill, parameters
        self.model: AnySkill | None = None

    @property
    def learned(self) -> bool:
        """Whether there is something to plan with."""
        return self.model is not None

    @property
    def _model(self) -> AnySkill:
        if self.model is None:
            raise ValueError(NOTHING)
        return self.model

    def check(self, parameters: dict[str, Any]) -> None:
        """ValueError says which parameter cannot be."""
        changed_skill(self.skill, parameters)
        check_way(parameters["choose_components"])

    def expect(self, one: Demonstration) -> None:
        """A demonstration came, and a lesson will follow: what is worked out now need not be
        waited for then. Default: nothing.
        """

    def _changed(self, configuration: str) -> tuple[Skill, str]:
        """The skill with the settings that the parameters change, and what they change."""
        if configuration:
            raise ValueError(
                f"configurations are of throws: the skill '{self.skill.name}' has its settings in"
                f" config/skills/{self.skill.name}.yaml"
            )
        return changed_skill(self.skill, self._parameters())

    def learn(self, demonstrations: Sequence[Demonstration], configuration: str = "") -> Lesson:
        """Learn.

        Raises
        ------
        ValueError
            Says why that cannot be.
        """
        skill, changes = self._changed(configuration)
        model, left_out = learn_usable(skill, demonstrations)
        if way := self._parameters()["choose_components"]:
            skill = choose_components(skill, model.demonstrations, way)
            model = learn(skill, model.demonstrations)
            changes = with_components(changes, skill.settings.components, way)
        self.model = model
        ids = tuple(one.id for one in model.demonstrations)
        said = f"learned '{self.skill.name}' from {len(ids)} demonstrations"
        facts = (f"a movement takes {model.duration:.1f} s",)
        return Lesson(
            ids, model.model_id, said + (changes and f" with {changes}"), facts, left_out
        )

    def finding(self, one: Demonstration, configuration: str = "") -> str:
        """What can be made of a demonstration, in words.

        Raises
        ------
        ValueError
            Says why nothing can.
        """
        skill, _ = self._changed(configuration)
        check_movement(skill, one)
        start, stop = skill.cut(one)
        return (
            f"a movement of {stop - start:.1f} s, {len(one.events)} times the fingers were told"
            " something"
        )

    def check_shown(self, one: Demonstration) -> None:
        """ValueError says why a demonstration cannot be learned from."""
        check_movement(self.skill, one)

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
        if isinstance(model, ReactiveSkill):
            return Planned(model.policy, asked, model.model_id)
        aim = self.skill.corrected(asked, model.offset)
        return Planned(model.plan(asked), asked, model.model_id, aim)

    def tell(self, trial: Demonstration, plan: ThrowPlan | None = None) -> Learned:
        """Learn from what became of a plan."""
        model = self._model
        start, _ = self.skill.cut(trial)
        outcome = self.skill.judge(trial, self.skill.situation(trial, start))
        model.tell(outcome)
        kept = bool(np.isfinite(outcome.miss).all())
        reason = outcome.reason or "nothing of it repeats"
        why = "" if kept else f"nobody can tell by how much it missed: {reason}"
        return Learned(kept, why, len(model.movements), outcome.miss[:2].tolist())

    def save(self, path: str | Path) -> str:
        """Write the model to a file; its digest."""
        save_skill_model(path, self._model)
        return self._model.model_id

    def load(self, path: str | Path) -> str:
        """Take the model of a file; its digest."""
        self.model = load_skill_model(path, self.skill)
        return self._model.model_id

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
        """How each demonstration that is learned from counts, by its id; empty before anything is
        learned.
        """
        if self.model is None:
            return {}
        movements, distances = self.model.movements, unlike(self.model)
        each = zip(movements, distances, outliers(distances), strict=True)
        return {one.id: Standing(1.0, float(distance), bool(far)) for one, distance, far in each}

    def values(self) -> dict[str, Any]:
        """For the diagnostics."""
        return {
            "learned_from": len(self._model.movements),
            "practised": self._model.practised,
            "model_id": self._model.model_id,
        }


def with_components(changes: str, number: int, way: str) -> str:
    """What parameters change, in words, with the number of components that was chosen."""
    return ", ".join(filter(None, (changes, f"components {number} by {way}")))


def learner_of(
    skill: Skill, parameters: Parameters, registration: KnownRegistration | None = None
) -> Learner:
    """The learner that a skill names (`Skill.learner`)."""
    return part_of(skill, "learner")(skill, parameters, registration)
