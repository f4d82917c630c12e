"""A skill that learns from its own trials: what repeats in the misses, the delay of the hand, trials
as demonstrations.
"""

from dart_skill.skills.practice._correction import (
    DIFFERENCES,
    NOISES,
    SHARES,
    USUAL_SCATTER,
    Correction,
    CorrectionSettings,
    polar,
    repeatable_miss,
)
from dart_skill.skills.practice._curriculum import UNKNOWN_ERROR, UNSEEN_ERROR, Curriculum
from dart_skill.skills.practice._hand_delay import USUAL_DELAY_SPREAD, HandDelay, likely_late
from dart_skill.skills.practice._learner import TEACH, Learner, Lesson, Parameters, changed_skill
from dart_skill.skills.practice._memory import PracticeSettings, TrialMemory
from dart_skill.skills.practice._newton import NewtonCorrection
from dart_skill.skills.practice._practice import (
    BootstrapPractice,
    Learned,
    Planned,
    Practice,
    ResidualPractice,
    Standing,
)
from dart_skill.skills.practice._practised_file import practised_skill, save_practised
from dart_skill.skills.practice._practising import PractisingSkill
from dart_skill.skills.practice._searching import LEAST_SCATTER, PRIOR_SPREAD, correction_of
from dart_skill.skills.practice._steadiness import Steadiness
from dart_skill.skills.practice._target_choice import TargetChoice, target_choice_of
from dart_skill.skills.practice._trial_bodies import Poses, TrialBodies

__all__ = [
    "BootstrapPractice",
    "Correction",
    "CorrectionSettings",
    "Curriculum",
    "DIFFERENCES",
    "HandDelay",
    "LEAST_SCATTER",
    "Learned",
    "Learner",
    "Lesson",
    "NOISES",
    "NewtonCorrection",
    "PRIOR_SPREAD",
    "Parameters",
    "Planned",
    "Poses",
    "Practice",
    "PracticeSettings",
    "PractisingSkill",
    "ResidualPractice",
    "SHARES",
    "Standing",
    "Steadiness",
    "TEACH",
    "TargetChoice",
    "TrialBodies",
    "TrialMemory",
    "UNKNOWN_ERROR",
    "UNSEEN_ERROR",
    "USUAL_DELAY_SPREAD",
    "USUAL_SCATTER",
    "changed_skill",
    "correction_of",
    "likely_late",
    "polar",
    "practised_skill",
    "repeatable_miss",
    "save_practised",
    "target_choice_of",
]
