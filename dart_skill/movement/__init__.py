"""Movements: attractors, task frames, task-parameterised mixtures, DS-GMR, movement primitives,
orientation and segmentation (thesis 7 and 8).
"""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use
from dart_skill.common.pace import PhaseRule
from dart_skill.movement._attractor import (
    attractor_from_motion,
    critical_damping,
    follow_attractor,
)
from dart_skill.movement._differentiation import Motion, estimate_noise, smooth_derivatives
from dart_skill.movement._frames import (
    MovingFrame,
    TaskFrame,
    azimuth_frame,
    azimuth_of,
    azimuth_target_frame,
    base_frame,
    features,
    pointing_at,
    start_frame,
    target_frame,
    turn_matrix,
)
from dart_skill.movement._orientation import (
    angles_from_quaternions,
    angular_velocity,
    make_continuous,
    multiply,
    normalise,
    pointing_angles,
    quaternions_from_angles,
    rotate,
    turn_about_z,
)
from dart_skill.movement._sample_faults import SampleFaults, find_faults, retimed, without_repeats
from dart_skill.movement._segmentation import Segment, VelocityThreshold, segment_containing, speed

if TYPE_CHECKING:
    from dart_skill.movement._alignment import AlignmentFit, check_alignment
    from dart_skill.movement._autonomous import (
        AutonomousDSGMR,
        AutonomousPolicy,
        Moment,
        StateDriven,
        StateFrame,
    )
    from dart_skill.movement._ds_gmr import DSGMR, Reproduction
    from dart_skill.movement._locality import (
        WidthChoice,
        choose_width,
        gaussian_weights,
        nearest_weights,
    )
    from dart_skill.movement._patterns import Patterns, find_patterns, resampled, warped_distance
    from dart_skill.movement._primitives import (
        DiscretePrimitive,
        Execution,
        PrimitiveState,
        RhythmicPrimitive,
        Trajectory,
    )
    from dart_skill.movement._reactive import Reaction, ReactivePolicy
    from dart_skill.movement._springs import SpringMixture
    from dart_skill.movement._stiffness import (
        attractor_with_gains,
        critical_damping_matrix,
        hold_to,
        stable_gains,
        stiffness_from_covariance,
    )
    from dart_skill.movement._task_parameterised import PartialFrame, TaskParameterisedMixture
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "_alignment": "AlignmentFit check_alignment",
            "_autonomous": "AutonomousDSGMR AutonomousPolicy Moment StateDriven StateFrame",
            "_ds_gmr": "DSGMR Reproduction",
            "_locality": "WidthChoice choose_width gaussian_weights nearest_weights",
            "_patterns": "Patterns find_patterns resampled warped_distance",
            "_primitives": (
                "DiscretePrimitive Execution PrimitiveState RhythmicPrimitive Trajectory"
            ),
            "_reactive": "Reaction ReactivePolicy",
            "_springs": "SpringMixture",
            "_stiffness": (
                "attractor_with_gains critical_damping_matrix hold_to stable_gains"
                " stiffness_from_covariance"
            ),
            "_task_parameterised": "PartialFrame TaskParameterisedMixture",
        },
    )

__all__ = [
    "AlignmentFit",
    "AutonomousDSGMR",
    "AutonomousPolicy",
    "DSGMR",
    "DiscretePrimitive",
    "Execution",
    "Moment",
    "Motion",
    "MovingFrame",
    "PartialFrame",
    "Patterns",
    "PhaseRule",
    "PrimitiveState",
    "Reaction",
    "ReactivePolicy",
    "Reproduction",
    "RhythmicPrimitive",
    "SampleFaults",
    "Segment",
    "SpringMixture",
    "StateDriven",
    "StateFrame",
    "TaskFrame",
    "TaskParameterisedMixture",
    "Trajectory",
    "VelocityThreshold",
    "WidthChoice",
    "angles_from_quaternions",
    "angular_velocity",
    "attractor_from_motion",
    "attractor_with_gains",
    "azimuth_frame",
    "azimuth_of",
    "azimuth_target_frame",
    "base_frame",
    "check_alignment",
    "choose_width",
    "critical_damping",
    "critical_damping_matrix",
    "estimate_noise",
    "features",
    "find_faults",
    "find_patterns",
    "follow_attractor",
    "gaussian_weights",
    "hold_to",
    "make_continuous",
    "multiply",
    "nearest_weights",
    "normalise",
    "pointing_angles",
    "pointing_at",
    "quaternions_from_angles",
    "resampled",
    "retimed",
    "rotate",
    "segment_containing",
    "smooth_derivatives",
    "speed",
    "stable_gains",
    "start_frame",
    "stiffness_from_covariance",
    "target_frame",
    "turn_about_z",
    "turn_matrix",
    "warped_distance",
    "without_repeats",
]
