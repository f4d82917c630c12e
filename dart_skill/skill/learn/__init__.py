"""From demonstrations to a skill, and from a skill to the plan of a throw."""

from dart_skill.skill.learn._configuration import CONFIGURATIONS, DEFAULT, LADDER, SkillConfiguration, changed, configuration
from dart_skill.skill.learn._crowd import Crowd
from dart_skill.skill.learn._ellipsoids import component_ellipsoids
from dart_skill.skill.learn._model_file import SavedModel, load_model, save_model
from dart_skill.skill.learn._preparation import PreparedThrow, prepare
from dart_skill.skill.learn._release import landing_if_late
from dart_skill.skill.learn._task_frames import frames_for
from dart_skill.skill.learn._throw_components import choose_components
from dart_skill.skill.learn._throwing import LEAST_DEMONSTRATIONS, ThrowingSkill, Unreachable, learn, learn_prepared

__all__ = [
    "CONFIGURATIONS",
    "DEFAULT",
    "LADDER",
    "LEAST_DEMONSTRATIONS",
    "Crowd",
    "PreparedThrow",
    "SavedModel",
    "SkillConfiguration",
    "ThrowingSkill",
    "Unreachable",
    "changed",
    "choose_components",
    "component_ellipsoids",
    "configuration",
    "frames_for",
    "landing_if_late",
    "learn",
    "learn_prepared",
    "load_model",
    "prepare",
    "save_model",
]
