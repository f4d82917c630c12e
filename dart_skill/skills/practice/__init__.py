"""A skill that learns from its own throws: what repeats in the misses, the delay of the hand,
trials as demonstrations.
"""

from dart_skill.skills.practice._correction import CorrectionSettings
from dart_skill.skills.practice._curriculum import Curriculum
from dart_skill.skills.practice._learner import (
    NOTHING,
    Learned,
    Learner,
    Lesson,
    Parameters,
    Planned,
    Standing,
    learner_of,
    with_components,
)
from dart_skill.skills.practice._practice import Practice, PracticeSettings
from dart_skill.skills.practice._practised_file import practised_skill, save_practised
from dart_skill.skills.practice._practising import METHODS, PractisingSkill
from dart_skill.skills.practice._target_choice import TargetChoice, target_choice_of

__all__ = [
    "CorrectionSettings",
    "Curriculum",
    "Learned",
    "Learner",
    "Lesson",
    "METHODS",
    "NOTHING",
    "Parameters",
    "Planned",
    "Practice",
    "PracticeSettings",
    "PractisingSkill",
    "Standing",
    "TargetChoice",
    "learner_of",
    "practised_skill",
    "save_practised",
    "target_choice_of",
    "with_components",
]
