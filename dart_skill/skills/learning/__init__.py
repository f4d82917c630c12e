"""From demonstrations to a model, and from a situation to a plan."""

from dart_skill.skills.learning._coverage import Coverage
from dart_skill.skills.learning._ellipsoids import component_ellipsoids
from dart_skill.skills.learning._learned import LearnedSkill, NoPlan
from dart_skill.skills.learning._learning import Model, choose_components, learn, usable
from dart_skill.skills.learning._model_file import SavedModel, load_model, save_model
from dart_skill.skills.learning._moving_frames import moving_frames
from dart_skill.skills.learning._outliers import outliers, unlike
from dart_skill.skills.learning._policy import Policy
from dart_skill.skills.learning._pose_features import frame_of, orientations, pose_features
from dart_skill.skills.learning._preparation import PreparedThrow, prepare
from dart_skill.skills.learning._prepared import PreparedMovement, prepare_movement
from dart_skill.skills.learning._reactive import Autonomous
from dart_skill.skills.learning._refinement import (
    FarthestRelease,
    PlannedThrow,
    Refinement,
    SolvedAim,
    SolvedFlight,
    Unreachable,
)
from dart_skill.skills.learning._release import landing_if_late
from dart_skill.skills.learning._representation import (
    ClockedRepresentation,
    EqualIntervals,
    FoundComponents,
    OnManifold,
    Representation,
)
from dart_skill.skills.learning._task_frames import frames_for
from dart_skill.skills.learning._throwing import (
    LEAST_DEMONSTRATIONS,
    ThrowingSkill,
    learn_prepared,
    learn_throwing,
)
from dart_skill.skills.protocol import (
    CONFIGURATIONS,
    DEFAULT,
    LADDER,
    ThrowSettings,
    configuration,
)

__all__ = [
    "Autonomous",
    "CONFIGURATIONS",
    "ClockedRepresentation",
    "Coverage",
    "DEFAULT",
    "EqualIntervals",
    "FarthestRelease",
    "FoundComponents",
    "LADDER",
    "LEAST_DEMONSTRATIONS",
    "LearnedSkill",
    "Model",
    "NoPlan",
    "OnManifold",
    "PlannedThrow",
    "Policy",
    "PreparedMovement",
    "PreparedThrow",
    "Refinement",
    "Representation",
    "SavedModel",
    "SolvedAim",
    "SolvedFlight",
    "ThrowSettings",
    "ThrowingSkill",
    "Unreachable",
    "choose_components",
    "component_ellipsoids",
    "configuration",
    "frame_of",
    "frames_for",
    "landing_if_late",
    "learn",
    "learn_prepared",
    "learn_throwing",
    "load_model",
    "moving_frames",
    "orientations",
    "outliers",
    "pose_features",
    "prepare",
    "prepare_movement",
    "save_model",
    "unlike",
    "usable",
]
