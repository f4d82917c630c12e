"""What skills share: from demonstrations to a model of poses in task frames, from a situation to a plan, from misses to a correction."""

from dart_skill.skill.model._learned import LearnedSkill, NoPlan
from dart_skill.skill.model._learning import AnySkill, learn, learn_usable
from dart_skill.skill.model._moving_frames import moving_frames
from dart_skill.skill.model._outliers import outliers, unlike
from dart_skill.skill.model._policy import Policy
from dart_skill.skill.model._pose_components import choose_components
from dart_skill.skill.model._pose_features import frame_of, orientations, pose_features
from dart_skill.skill.model._prepared import PreparedMovement, check_movement, prepare_movement
from dart_skill.skill.model._reactive import ReactiveSkill
from dart_skill.skill.model._skill_file import changed_skill, load_skill_model, save_skill_model

__all__ = [
    "AnySkill",
    "LearnedSkill",
    "NoPlan",
    "Policy",
    "PreparedMovement",
    "ReactiveSkill",
    "changed_skill",
    "check_movement",
    "choose_components",
    "frame_of",
    "learn",
    "learn_usable",
    "load_skill_model",
    "moving_frames",
    "orientations",
    "outliers",
    "pose_features",
    "prepare_movement",
    "save_skill_model",
    "unlike",
]
