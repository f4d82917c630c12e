"""From demonstrations to the model that a skill needs: of plans that are made beforehand, or one
that is asked while the arm moves.
"""

from __future__ import annotations

from collections.abc import Sequence

from dart_skill.skills.learning._learned import LearnedSkill
from dart_skill.skills.learning._prepared import check_movement
from dart_skill.skills.learning._reactive import ReactiveSkill
from dart_skill.skills.protocol import Skill, TaskDemonstration

AnySkill = LearnedSkill | ReactiveSkill


def learn(skill: Skill, demonstrations: Sequence[TaskDemonstration]) -> AnySkill:
    """The skill that demonstrations teach; ValueError names one that cannot be learned from."""
    return (
        ReactiveSkill(skill, demonstrations)
        if skill.reacts
        else LearnedSkill(skill, demonstrations)
    )


def learn_usable(
    skill: Skill, demonstrations: Sequence[TaskDemonstration]
) -> tuple[AnySkill, dict[str, str]]:
    """The skill that demonstrations teach, and why some of them do not, by their ids; ValueError,
    with all reasons, if too few do.
    """
    usable, left_out = [], {}
    for one in demonstrations:
        try:
            check_movement(skill, one)
            usable.append(one)
        except ValueError as error:
            left_out[one.id] = str(error)
    try:
        return learn(skill, usable), left_out
    except ValueError as error:
        raise ValueError("; ".join([str(error), *left_out.values()])) from error
