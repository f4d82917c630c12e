"""From demonstrations to the model of a skill."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dart_skill.common.words import counted
from dart_skill.mixture import best_number
from dart_skill.recording import Demonstration
from dart_skill.skills.learning._learned import LearnedSkill
from dart_skill.skills.learning._outliers import FEWEST
from dart_skill.skills.learning._throwing import ThrowingSkill
from dart_skill.skills.protocol import (
    BIC,
    COMPONENTS,
    CROSS_VALIDATION,
    Skill,
    check_way,
    model_type,
)

Model = LearnedSkill | ThrowingSkill


def learn(skill: Skill, demonstrations: Sequence[Demonstration]) -> Model:
    """The model that demonstrations teach.

    Raises
    ------
    ValueError
        Names one that cannot be learned from.
    """
    return model_type(skill).learned(skill, demonstrations)


def usable(
    skill: Skill, demonstrations: Sequence[Demonstration]
) -> tuple[list[Demonstration], dict[str, str]]:
    """Demonstrations that can be learned from, and why others cannot, by their ids."""
    kept, left_out = [], {}
    for one in demonstrations:
        try:
            model_type(skill).prepared(skill, one)
            kept.append(one)
        except ValueError as error:
            left_out[one.id] = str(error)
    return kept, left_out


def choose_components(skill: Skill, demonstrations: Sequence[Demonstration], way: str) -> Skill:
    """The skill with the number of components, among COMPONENTS, that is best in a way (BIC or
    CROSS_VALIDATION; thesis 3.2.2).

    Raises
    ------
    ValueError
        Names a demonstration that cannot be learned from, or says that there are too few, or that
        BIC compares nothing.
    """
    check_way(way)
    if way == CROSS_VALIDATION and len(demonstrations) < FEWEST:
        raise ValueError(
            f"only {counted(len(demonstrations), 'demonstration')} to leave out each once: record at"
            f" least {FEWEST}"
        )

    def with_number(number: int) -> Skill:
        return skill.with_settings(replace(skill.settings, components=number))

    def score(number: int) -> float:
        try:
            model = learn(with_number(number), demonstrations)
        except ValueError:  # so many components that some have nothing to learn from
            return float("inf")
        return model.bic() if way == BIC else model.left_out_error()

    learn(skill, demonstrations)  # or a ValueError that says why nothing can be learned
    return with_number(best_number(COMPONENTS, score))
