"""Movements of a hand that turns: poses of position and unit quaternion on the manifold R^n x S3.

Angles of attack, side slip and roll (`dart_skill.movement.angles_from_quaternions`) are singular
where the hand points along an axis. What is here has no such place. A pose is a row x, y, z and a
quaternion x, y, z, w. q and -q are one orientation.
"""

from dart_skill.movement.pose._course import PosePrimitiveCourse, pose_answers
from dart_skill.movement.pose._ds_gmr import PoseDSGMR, PoseReproduction
from dart_skill.movement.pose._em import PoseFrame
from dart_skill.movement.pose._gaussians import PoseMixture, product_of_poses
from dart_skill.movement.pose._manifold import (
    angles_between,
    exponential,
    logarithm,
    mean_point,
    parallel_transport,
)
from dart_skill.movement.pose._motion import (
    PoseMotion,
    follow_pose_attractor,
    pose_attractor,
    pose_motion,
)
from dart_skill.movement.pose._per_step import PerStepPoses
from dart_skill.movement.pose._primitives import (
    DiscretePosePrimitive,
    PoseState,
    PoseTrajectory,
    RhythmicPosePrimitive,
)
from dart_skill.movement.pose._task_parameterised import TaskParameterisedPoseMixture

__all__ = [
    "DiscretePosePrimitive",
    "PerStepPoses",
    "PoseDSGMR",
    "PoseFrame",
    "PoseMixture",
    "PoseMotion",
    "PosePrimitiveCourse",
    "PoseReproduction",
    "PoseState",
    "PoseTrajectory",
    "RhythmicPosePrimitive",
    "TaskParameterisedPoseMixture",
    "angles_between",
    "exponential",
    "follow_pose_attractor",
    "logarithm",
    "mean_point",
    "parallel_transport",
    "pose_answers",
    "pose_attractor",
    "pose_motion",
    "product_of_poses",
]
