"""What a skill is: the protocol that all skills follow, the data that passes through it, and where
skills are found by name.
"""

from dart_skill.skills.protocol._demonstration import HAND, TaskDemonstration, Told, Track
from dart_skill.skills.protocol._messages import (
    WORDS,
    grip_of,
    read_task_demonstrations,
    situation_content,
    task_demonstration_content,
    task_demonstration_from_message,
    task_demonstration_message,
)
from dart_skill.skills.protocol._registry import load_skill, skill_names, skill_type
from dart_skill.skills.protocol._settings import (
    BIC,
    COMPONENTS,
    CROSS_VALIDATION,
    ReactiveSkillSettings,
    SkillSettings,
    check_way,
)
from dart_skill.skills.protocol._situation import Pose, Situation
from dart_skill.skills.protocol._skill import Planner, Skill, TaskOutcome, settings_file
from dart_skill.skills.protocol._solid import Solid
from dart_skill.skills.protocol._task_log import TaskLog
from dart_skill.skills.protocol._words import SkillWords

__all__ = [
    "BIC",
    "COMPONENTS",
    "CROSS_VALIDATION",
    "HAND",
    "Planner",
    "Pose",
    "ReactiveSkillSettings",
    "Situation",
    "Solid",
    "Skill",
    "SkillSettings",
    "SkillWords",
    "TaskDemonstration",
    "TaskLog",
    "TaskOutcome",
    "Told",
    "Track",
    "WORDS",
    "check_way",
    "grip_of",
    "load_skill",
    "read_task_demonstrations",
    "settings_file",
    "situation_content",
    "skill_names",
    "skill_type",
    "task_demonstration_content",
    "task_demonstration_from_message",
    "task_demonstration_message",
]
