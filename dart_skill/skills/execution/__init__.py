"""Carrying out a skill: bodies that move, and a model that is asked while the arm moves."""

from dart_skill.skills.execution._moving_body import (
    FEWEST_POSES,
    POSE_WINDOW,
    BodyMotion,
    MovingBody,
)
from dart_skill.skills.execution._reactive_guide import ReactiveGuide, ReactiveSettings

__all__ = [
    "BodyMotion",
    "FEWEST_POSES",
    "MovingBody",
    "POSE_WINDOW",
    "ReactiveGuide",
    "ReactiveSettings",
]
