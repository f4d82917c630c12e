"""Movements: attractors, task frames, task-parameterised mixtures, DS-GMR, orientation and segmentation
(thesis 7.5 and 8).
"""

from .attractor import attractor_from_motion, critical_damping, follow_attractor
from .differentiation import Motion, estimate_noise, smooth_derivatives
from .ds_gmr import DSGMR, Reproduction
from .frames import (
    TaskFrame,
    azimuth_frame,
    azimuth_of,
    azimuth_target_frame,
    base_frame,
    features,
    pointing_at,
    start_frame,
    target_frame,
)
from .orientation import (
    angles_from_quaternions,
    angular_velocity,
    conjugate,
    from_matrices,
    make_continuous,
    multiply,
    normalise,
    pointing_angles,
    pointing_directions,
    quaternions_from_angles,
    rotate,
    to_matrices,
    turn_about_z,
)
from .segmentation import Segment, VelocityThreshold, segment_containing, speed
from .task_parameterised import TaskParameterisedMixture

__all__ = [
    "DSGMR",
    "Motion",
    "Reproduction",
    "Segment",
    "TaskFrame",
    "TaskParameterisedMixture",
    "VelocityThreshold",
    "angles_from_quaternions",
    "angular_velocity",
    "attractor_from_motion",
    "azimuth_frame",
    "azimuth_of",
    "azimuth_target_frame",
    "base_frame",
    "conjugate",
    "critical_damping",
    "estimate_noise",
    "features",
    "follow_attractor",
    "from_matrices",
    "make_continuous",
    "multiply",
    "normalise",
    "pointing_angles",
    "pointing_at",
    "pointing_directions",
    "quaternions_from_angles",
    "rotate",
    "segment_containing",
    "smooth_derivatives",
    "speed",
    "start_frame",
    "target_frame",
    "to_matrices",
    "turn_about_z",
]
