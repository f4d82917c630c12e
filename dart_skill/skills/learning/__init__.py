"""From demonstrations to a model, and from a situation to a plan."""

from dart_skill.skills.learning._ball_path import ball_states
from dart_skill.skills.learning._coverage import Coverage
from dart_skill.skills.learning._ellipsoids import component_ellipsoids
from dart_skill.skills.learning._first_aim import FirstAim
from dart_skill.skills.learning._learned import LearnedSkill, NoPlan
from dart_skill.skills.learning._learning import Model, choose_components, learn, usable
from dart_skill.skills.learning._model_file import SavedModel, load_model, save_model
from dart_skill.skills.learning._moving_frames import moving_frames
from dart_skill.skills.learning._outliers import outliers, unlike
from dart_skill.skills.learning._policy import Policy
from dart_skill.skills.learning._pose_features import (
    VECTORS,
    frame_of,
    orientations,
    pose_features,
    with_free_length,
    with_prior,
)
from dart_skill.skills.learning._preparation import PreparedThrow, prepare
from dart_skill.skills.learning._prepared import PreparedMovement, prepare_movement
from dart_skill.skills.learning._primitive import PosePrimitive, Primitives, VectorPrimitive
from dart_skill.skills.learning._reactive import Autonomous
from dart_skill.skills.learning._refinement import (
    AIM_TOLERANCE,
    EARLIEST_RELEASE,
    LATEST_RELEASE,
    FarthestRelease,
    PlannedThrow,
    Refinement,
    SolvedAim,
    SolvedFlight,
    Unreachable,
)
from dart_skill.skills.learning._release import (
    certainly_within,
    farthest,
    hits_along,
    landing_if_late,
    nearest_step,
    stretched_at,
    weights_at,
)
from dart_skill.skills.learning._representation import (
    ClockedRepresentation,
    EqualIntervals,
    FoundComponents,
    OnManifold,
    PerStep,
    Representation,
)
from dart_skill.skills.learning._rhythmic import AMPLITUDE, FREQUENCY, TURNS, Rhythmic
from dart_skill.skills.learning._strain import strain, strained, strained_in_words
from dart_skill.skills.learning._task_frames import frames_for
from dart_skill.skills.learning._throw_model import ThrowModel, credence_of
from dart_skill.skills.learning._throwing import (
    LEAST_DEMONSTRATIONS,
    REACH_MARGIN,
    SIDE_MARGIN,
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
    "AIM_TOLERANCE",
    "AMPLITUDE",
    "Autonomous",
    "CONFIGURATIONS",
    "ClockedRepresentation",
    "Coverage",
    "DEFAULT",
    "EARLIEST_RELEASE",
    "EqualIntervals",
    "FREQUENCY",
    "FarthestRelease",
    "FirstAim",
    "FoundComponents",
    "LADDER",
    "LATEST_RELEASE",
    "LEAST_DEMONSTRATIONS",
    "LearnedSkill",
    "Model",
    "NoPlan",
    "OnManifold",
    "PerStep",
    "PlannedThrow",
    "Policy",
    "PosePrimitive",
    "PreparedMovement",
    "PreparedThrow",
    "Primitives",
    "REACH_MARGIN",
    "Refinement",
    "Representation",
    "Rhythmic",
    "SIDE_MARGIN",
    "SavedModel",
    "SolvedAim",
    "SolvedFlight",
    "TURNS",
    "ThrowModel",
    "ThrowSettings",
    "ThrowingSkill",
    "Unreachable",
    "VECTORS",
    "VectorPrimitive",
    "ball_states",
    "certainly_within",
    "choose_components",
    "component_ellipsoids",
    "configuration",
    "credence_of",
    "farthest",
    "frame_of",
    "frames_for",
    "hits_along",
    "landing_if_late",
    "learn",
    "learn_prepared",
    "learn_throwing",
    "load_model",
    "moving_frames",
    "nearest_step",
    "orientations",
    "outliers",
    "pose_features",
    "prepare",
    "prepare_movement",
    "save_model",
    "stretched_at",
    "strain",
    "strained",
    "strained_in_words",
    "unlike",
    "usable",
    "weights_at",
    "with_free_length",
    "with_prior",
]
