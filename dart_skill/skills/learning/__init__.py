"""From demonstrations to a model, and from a situation to a plan."""

from dart_skill.skills.learning._components import choose_components, choose_throw_components
from dart_skill.skills.learning._configuration import (
    CONFIGURATIONS,
    DEFAULT,
    LADDER,
    SkillConfiguration,
    changed,
    configuration,
)
from dart_skill.skills.learning._coverage import Coverage
from dart_skill.skills.learning._ellipsoids import component_ellipsoids
from dart_skill.skills.learning._learned import LearnedSkill, NoPlan
from dart_skill.skills.learning._learning import (
    AnySkill,
    changed_skill,
    learn,
    learn_usable,
    load_skill_model,
    save_skill_model,
)
from dart_skill.skills.learning._model_file import SavedModel, load_model, save_model
from dart_skill.skills.learning._moving_frames import moving_frames
from dart_skill.skills.learning._outliers import outliers, unlike
from dart_skill.skills.learning._policy import Policy
from dart_skill.skills.learning._pose_features import frame_of, orientations, pose_features
from dart_skill.skills.learning._preparation import PreparedThrow, prepare
from dart_skill.skills.learning._prepared import PreparedMovement, check_movement, prepare_movement
from dart_skill.skills.learning._reactive import ReactiveSkill
from dart_skill.skills.learning._release import landing_if_late
from dart_skill.skills.learning._task_frames import frames_for
from dart_skill.skills.learning._throwing import (
    LEAST_DEMONSTRATIONS,
    ThrowingSkill,
    Unreachable,
    learn_prepared,
    learn_throwing,
)

__all__ = [
    "AnySkill",
    "CONFIGURATIONS",
    "Coverage",
    "DEFAULT",
    "LADDER",
    "LEAST_DEMONSTRATIONS",
    "LearnedSkill",
    "NoPlan",
    "Policy",
    "PreparedMovement",
    "PreparedThrow",
    "ReactiveSkill",
    "SavedModel",
    "SkillConfiguration",
    "ThrowingSkill",
    "Unreachable",
    "changed",
    "changed_skill",
    "check_movement",
    "choose_components",
    "choose_throw_components",
    "component_ellipsoids",
    "configuration",
    "frame_of",
    "frames_for",
    "landing_if_late",
    "learn",
    "learn_prepared",
    "learn_throwing",
    "learn_usable",
    "load_model",
    "load_skill_model",
    "moving_frames",
    "orientations",
    "outliers",
    "pose_features",
    "prepare",
    "prepare_movement",
    "save_model",
    "save_skill_model",
    "unlike",
]
