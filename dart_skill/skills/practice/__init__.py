"""A skill that learns from its own throws: what repeats in the misses, the delay of the hand,
trials as demonstrations.
"""

from dart_skill.skills.practice._correction import CorrectionSettings
from dart_skill.skills.practice._curriculum import Curriculum
from dart_skill.skills.practice._practice import Practice, PracticeSettings
from dart_skill.skills.practice._practised_file import practised_skill, save_practised
from dart_skill.skills.practice._practising import METHODS, PractisingSkill

__all__ = [
    "CorrectionSettings",
    "Curriculum",
    "METHODS",
    "Practice",
    "PracticeSettings",
    "PractisingSkill",
    "practised_skill",
    "save_practised",
]
