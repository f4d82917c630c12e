"""What a skill is: the protocol that all skills follow, and where skills are found by name."""

from dart_skill.skills.protocol._judged_skill import TaskOutcome
from dart_skill.skills.protocol._registry import (
    Part,
    check_parts,
    general_part,
    load_skill,
    model_type,
    part_names,
    part_of,
    skill_names,
    skill_type,
)
from dart_skill.skills.protocol._settings import (
    BIC,
    COMPONENTS,
    CROSS_VALIDATION,
    OF_REACTING,
    SkillSettings,
    check_way,
)
from dart_skill.skills.protocol._skill import Planner, Skill
from dart_skill.skills.protocol._skill_base import settings_file
from dart_skill.skills.protocol._throw_settings import (
    CONFIGURATIONS,
    DEFAULT,
    LADDER,
    PRACTICE_METHODS,
    ThrowSettings,
    configuration,
)
from dart_skill.skills.protocol._words import SkillWords, Solid

__all__ = [
    "BIC",
    "COMPONENTS",
    "CONFIGURATIONS",
    "CROSS_VALIDATION",
    "DEFAULT",
    "LADDER",
    "OF_REACTING",
    "PRACTICE_METHODS",
    "Part",
    "Planner",
    "Skill",
    "SkillSettings",
    "SkillWords",
    "Solid",
    "TaskOutcome",
    "ThrowSettings",
    "check_parts",
    "check_way",
    "configuration",
    "general_part",
    "load_skill",
    "model_type",
    "part_names",
    "part_of",
    "settings_file",
    "skill_names",
    "skill_type",
]
