"""What learns a skill: the same for a session and for the graph."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.arm import (
    KnownRegistration,
    MotionPlan,
    Speed,
    stretched,
    the_arm,
    unfollowable,
)
from dart_skill.common.configuration import node_parameters
from dart_skill.common.situation import Situation
from dart_skill.common.words import counted
from dart_skill.mixture import GaussianMixture
from dart_skill.recording import Demonstration
from dart_skill.skills.learning import (
    NoPlan,
    choose_components,
    strain,
    strained,
    strained_in_words,
    usable,
)
from dart_skill.skills.practice._memory import PracticeSettings
from dart_skill.skills.practice._practice import Learned, Planned, Practice, Standing
from dart_skill.skills.protocol import Skill, check_way, model_type, part_of

Parameters = Callable[[], Mapping[str, Any]]
"""Values of the parameters of the node skill_learner, as they are now."""

TEACH = "dart-skill teach --count 5, then dart-skill learn (or dart-skill up --model FILE)"
"""What to do where nothing is learned yet."""
NOTHING = f"nothing is learned yet: {TEACH}"
CHANGED = ("components", "stiffness", "orientation_stiffness", "start_speed", "stop_speed")
"""Settings that parameters of the learner change, where these are not 0."""


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


def configured_parameters() -> Mapping[str, Any]:
    """Parameters of the node skill_learner as config/ has them."""
    return node_parameters("skill_learner.yaml", "skill_learner")


class Learner:
    """Learns one skill from demonstrations, plans with it, and learns from trials.

    Parameters
    ----------
    skill
        That is learned.
    parameters
        Of the node skill_learner; default: as config/ has them.
    registration
        Of cameras and arm as it was measured before; None: told by the demonstrations.

    Attributes
    ----------
    practice
        What was learned, None before.
    """

    def __init__(
        self,
        skill: Skill,
        parameters: Parameters = configured_parameters,
        registration: KnownRegistration | None = None,
    ):
        self._parameters = parameters
        p = parameters()
        settings = skill.settings
        if registration is not None:
            settings = replace(settings, registration=registration)
        if p["practice_method"]:
            settings = settings.changed({"practice": p["practice_method"]}, "practice_method")
        self.skill = skill.with_settings(settings)
        self._practice = part_of(self.skill, "practice")
        self._memory = PracticeSettings(p["practice_capacity"], p["practice_forget"])
        self.practice: Practice | None = None
        self._strained: dict[str, str] = {}

    @property
    def angles(self) -> int:
        """Number of columns of its mixtures after the position."""
        return self._practice.angles

    @property
    def needs_plan(self) -> bool:
        """Whether a trial teaches only beside the plan that was carried out."""
        return self._practice.needs_plan

    @property
    def learned(self) -> bool:
        """Whether there is something to plan with."""
        return self.practice is not None

    @property
    def _learned(self) -> Practice:
        if self.practice is None:
            raise ValueError(NOTHING)
        return self.practice

    def check(self, parameters: Mapping[str, Any]) -> None:
        """ValueError says which parameter cannot be."""
        changed_skill(self.skill, parameters)
        check_way(parameters["choose_components"])

    def expect(self, one: Demonstration) -> None:
        """A demonstration came, and a lesson will follow: what is worked out now need not be
        waited for then.
        """
        with suppress(ValueError):  # the lesson says why it is left out
            self.finding(one)

    def finding(self, one: Demonstration, configuration: str = "") -> str:
        """What can be made of a demonstration, in words.

        Raises
        ------
        ValueError
            Says why nothing can.
        """
        skill, _ = changed_skill(self.skill, self._parameters(), configuration)
        words = model_type(skill).prepared(skill, one).in_words
        limit = self.strain(one)
        return f"{words}; {limit}" if limit else words

    def strain(self, one: Demonstration) -> str:
        """Limits that the arm came to while a demonstration was shown, in words; empty if none."""
        return strain(self.skill, one)

    def learn(self, demonstrations: Sequence[Demonstration], configuration: str = "") -> Lesson:
        """Learn.

        Raises
        ------
        ValueError
            Says why that cannot be.
        """
        p = self._parameters()
        skill, changes = changed_skill(self.skill, p, configuration)
        kept, left_out = usable(skill, demonstrations)
        try:
            if way := p["choose_components"]:
                skill = choose_components(skill, kept, way)
                number = f"components {skill.settings.components} by {way}"
                changes = ", ".join(filter(None, (changes, number)))
            self.practice = self._practice(skill, kept, self._memory)
        except ValueError as error:
            raise ValueError("; ".join([str(error), *left_out.values()])) from error
        ids = self._learned.model.ids
        said = f"learned '{skill.name}' from {counted(len(ids), 'demonstration')}"
        said += changes and f" with {changes}"
        left_out = {**left_out, **self._learned.left_out}
        self._strained = strained(self.skill, kept)
        facts = (*self._learned.facts, *filter(None, [strained_in_words(self._strained)]))
        return Lesson(ids, self._learned.model.model_id, said, facts, left_out)

    def plan(self, asked: Situation, explore: bool = False) -> Planned:
        """See `Practice.plan`; NoPlan says where the arm cannot follow it, and names demonstrations
        for which it is so.
        """
        planned = self._learned.plan(asked, explore)
        if isinstance(planned.plan, MotionPlan):
            if self._strained:
                self._check_bent(planned.plan)
            # what is thrown is refined within the joints' ranges and the motors' speeds
            if planned.plan.speed == Speed.CAREFUL and (
                why := unfollowable(planned.plan.as_the_arm_has_it(), the_arm())
            ):
                raise NoPlan(f"{why}: choose a situation nearer to what was shown")
        return planned

    def _check_bent(self, plan: MotionPlan) -> None:
        """NoPlan for a plan that stretches the arm, as some of what was shown did."""
        if why := stretched(plan.as_the_arm_has_it(), the_arm()):
            names = ", ".join(self._strained)
            raise NoPlan(
                f"{why}: drop what was shown at a limit of the arm ({names}), learn again, and show"
                " it with a bent elbow"
            )

    def tell(self, trial: Demonstration, plan: MotionPlan | None = None) -> Learned:
        """See `Practice.tell`."""
        return self._learned.tell(trial, plan)

    def save(self, path: str | Path) -> str:
        """See `Practice.save`."""
        return self._learned.save(path)

    def load(self, path: str | Path) -> str:
        """Take the model of a file; its digest."""
        self.practice = self._practice.load(path, self.skill, self._memory)
        self._strained = {}
        return self._learned.model.model_id

    def mixtures(self) -> tuple[dict[str, GaussianMixture], np.ndarray]:
        """See `Practice.mixtures`."""
        return self._learned.mixtures()

    def standings(self) -> dict[str, Standing]:
        """See `Practice.standings`; empty before anything is learned."""
        return {} if self.practice is None else self.practice.standings()

    def values(self) -> dict[str, Any]:
        """For the diagnostics."""
        return self._learned.values()


def changed_skill(
    skill: Skill, parameters: Mapping[str, Any], configuration: str = ""
) -> tuple[Skill, str]:
    """A skill with parameters of the node skill_learner, and what they change, in words; 0 and an
    empty text change nothing.

    Parameters
    ----------
    configuration
        In place of that of the parameters.

    Raises
    ------
    ValueError
        Names one that makes no sense, and a task frame that the skill does not have.
    """
    name = configuration or parameters["configuration"]
    skill = skill.named(name)
    changes: dict[str, Any] = {one: parameters[one] for one in CHANGED if parameters[one]}
    bounds = parameters["least_stiffness"], parameters["most_stiffness"]
    changes |= {"stiffness_range": bounds} if all(bounds) else {}  # one is set before the other
    if parameters["frames"]:
        changes["frames"] = tuple(one.strip() for one in parameters["frames"].split(","))
    if useless := sorted(set(changes) & skill.settings.UNUSED):
        raise ValueError(
            f"{useless[0]} is without effect on '{skill.name}': demonstration_recorder cuts what"
            " is shown, so set it there"
        )
    skill = skill.with_settings(skill.settings.changed(changes, "skill_learner"))
    skill.check_settings()
    words = [f"configuration {name}"] if name else []
    for one, value in changes.items():
        words.append(f"{one} {', '.join(value) if one == 'frames' else value}")
    return skill, ", ".join(words)
