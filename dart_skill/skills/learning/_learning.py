"""From demonstrations to the model that a skill needs: of plans that are made beforehand, or one
that is asked while the arm moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from dart_skill.recording import Demonstration
from dart_skill.skills.learning._learned import LearnedSkill
from dart_skill.skills.learning._model_file import load_model, save_model
from dart_skill.skills.learning._prepared import check_movement
from dart_skill.skills.learning._reactive import ReactiveSkill
from dart_skill.skills.protocol import Skill

AnySkill = LearnedSkill | ReactiveSkill
K = TypeVar("K", bound=Skill)
CHANGED = ("components", "stiffness", "orientation_stiffness", "start_speed", "stop_speed")
"""Settings that parameters of the learner change."""


def learn(skill: Skill, demonstrations: Sequence[Demonstration]) -> AnySkill:
    """The skill that demonstrations teach.

    Raises
    ------
    ValueError
        Names one that cannot be learned from.
    """
    return (
        ReactiveSkill(skill, demonstrations)
        if skill.reacts
        else LearnedSkill(skill, demonstrations)
    )


def learn_usable(
    skill: Skill, demonstrations: Sequence[Demonstration]
) -> tuple[AnySkill, dict[str, str]]:
    """The skill that demonstrations teach, and why some of them do not, by their ids.

    Raises
    ------
    ValueError
        With all reasons, if too few do.
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


def changed_skill(skill: K, parameters: dict[str, Any]) -> tuple[K, str]:
    """A skill with parameters of the node skill_learner, and what they change, in words; 0 and an
    empty text change nothing.

    Raises
    ------
    ValueError
        Names one that makes no sense, and a task frame that the skill does not have.
    """
    changes = {name: parameters[name] for name in CHANGED if parameters[name]}
    bounds = parameters["least_stiffness"], parameters["most_stiffness"]
    changes |= {"stiffness_range": bounds} if all(bounds) else {}  # one is set before the other
    changes |= (
        {"frames": tuple(name.strip() for name in parameters["frames"].split(","))}
        if parameters["frames"]
        else {}
    )
    if not changes:
        return skill, ""
    changed = type(skill)(replace(skill.settings, **changes))
    changed.check_settings()
    return changed, ", ".join(
        f"{name} {', '.join(value) if name == 'frames' else value}"
        for name, value in changes.items()
    )


def save_skill_model(path: str | Path, learned: AnySkill) -> None:
    """Write a model to `path`, as `save_model` does.

    Parameters
    ----------
    learned
        The skill.
    """
    save_model(path, learned.demonstrations, learned.skill.settings, learned.misses)


def load_skill_model(path: str | Path, skill: Skill) -> AnySkill:
    """The model of a file, of the same skill; its settings are those that it was learned with.

    Raises
    ------
    ValueError
        If it is none.
    """
    saved = load_model(path, skill)
    learned = learn(type(skill)(saved.configuration), saved.demonstrations)
    learned.remember(saved.practised)
    return learned
